"""The fast engine: marks along many sight lines, judged against the charts of the nearest scans.

`intervis.sight.oracle` does the same slowly and plainly; the definition is in `evidence`.

The marks of a few lines at a time go through short passes over small arrays. A pass either
reckons, without branch or look-up, so that the compiler works on eight marks at once; or it looks
up, and does little else. One pass that does both takes twice as long. Lines are rounded up to
full eights of marks; the surplus is never counted.

A kernel counts the holders of each array it is handed, in memory that all threads share, unless
the compiler finds that needless: it does where arrays are last used in one loop that each way
through the kernel leads to. So a pass is one loop, returns at its end, and calls no other kernel
with arrays; and what is called for each mark is handed numbers, not tuples of tables.
"""

from typing import NamedTuple

import numpy as np

from intervis.arrays import Float64Array, IntArray
from intervis.kernels import in_parts, kernel
from intervis.sight.atlas import Memory, choose_scans
from intervis.sight.block import (
    ACROSS,
    BY_ACROSS,
    BY_NEAREST,
    CLEAR,
    DEPTH,
    FIRST,
    GAP,
    HEIGHT,
    HIDDEN,
    MOVED,
    NEAR,
    ODDS,
    OPEN,
    PIECE,
    PLACE,
    RANK,
    SEEN,
    STEP,
    UNSEEN,
    WAY,
    Block,
    Int32Array,
    lay_out,
    new_block,
    turn_to_scan,
)
from intervis.sight.chart import Int16Array
from intervis.sight.evidence import MODEL, NOISE, Model
from intervis.sight.marks import aim, divide, look, measure, meet, raise_above_ground, weigh, within
from intervis.sight.moved import (
    CHANGED,
    GONE,
    HERE,
    Motion,
    find_across,
    find_changed,
    motion_of,
    stood_here,
)


class Findings(NamedTuple):
    """What the marks of L lines add up to; see `evidence`.

    The exponent -log P(visible) in three parts: `open`, marks in free space; `seen`, marks at
    seen surfaces; `hidden`, marks that no scan saw, whose length is `unknown_m`.
    `clearance_m` is the least gap to a surface or the ground on the way (inf with none);
    `worst_m` the distance from the line's first end to the mark at a seen surface that is most
    likely filled, `worst_scan` the scan that says so (-1: there is none).
    """

    open: Float64Array
    seen: Float64Array
    hidden: Float64Array
    unknown_m: Float64Array
    clearance_m: Float64Array
    worst_m: Float64Array
    worst_scan: IntArray

    @property
    def exponent(self) -> Float64Array:
        """-log P(visible)."""
        return NOISE + self.open + self.seen + self.hidden


@kernel
def _keep_depths(
    marks: Float64Array, lines: Float64Array, span: IntArray, count: int, n: int
) -> None:
    """Keep how deep the marks lie behind the n-th scan's surface, of lines that it lies across."""
    for i in range(count):
        if int(lines[i, ACROSS]) == n:
            for m in range(span[i, 0], span[i, 2]):
                marks[BY_ACROSS, m] = marks[DEPTH, m]


@kernel
def _follow(
    cells: Int16Array,
    first: Float64Array,
    second: Float64Array,
    motion: Motion,
    block: Block,
) -> None:
    """Decide the marks that two scans saw differently: did what moved stand there?"""
    marks = block.marks
    for i in range(len(first)):
        line, a, b = block.lines[i], first[i], second[i]
        if line[ACROSS] <= 0.0:
            continue
        rank, from_mark = int(line[ACROSS]), block.span[i, 0]
        near, across = block.charts[block.chosen[i, 0]], block.charts[block.chosen[i, rank]]
        for m in range(from_mark, block.span[i, 1]):
            if marks[MOVED, m] != CHANGED:
                continue
            s = (m - from_mark + line[FIRST]) * line[STEP]
            x, y, z = a[0] + s * (b[0] - a[0]), a[1] + s * (b[1] - a[1]), a[2] + s * (b[2] - a[2])
            if not stood_here(cells, near, across, x, y, z, line[WAY : WAY + 3], motion):
                marks[MOVED, m] = GONE
                continue
            marks[MOVED, m] = HERE
            if marks[NEAR, m] == np.inf:
                one, other = marks[BY_NEAREST, m], marks[BY_ACROSS, m]
                marks[NEAR, m] = abs(max(one, other))
                marks[RANK, m] = 0 if one > other else rank


@kernel
def _find_places(
    marks: Float64Array,
    of: int,
    places: Int32Array,
    count: int,
    start: float,
    steps_per_unit: float,
    entries: int,
) -> None:
    """Where the values of a row lie in a table from `start` on."""
    value, place, last = marks[of], places[PLACE], entries - 1.0
    for m in range(count):
        place[m] = within((value[m] - start) * steps_per_unit, last)


@kernel
def _add_height(marks: Float64Array, places: Int32Array, count: int, heights: Float64Array) -> None:
    """Add to the odds of the marks what their heights above the ground alone make of them."""
    odds, place = marks[ODDS], places[PLACE]
    for m in range(count):
        odds[m] += heights[np.uint32(place[m])]


@kernel
def _decide_moved(marks: Float64Array, count: int, here: float, away: float) -> None:
    """Bound the odds of marks where something that moved stood, has gone or is yet to come."""
    odds, moved = marks[ODDS], marks[MOVED]
    for m in range(count):
        summed = odds[m]
        at_least = max(summed, here) if moved[m] > 0.0 else summed
        odds[m] = min(at_least, away) if moved[m] < 0.0 else at_least


@kernel
def _fill(marks: Float64Array, places: Int32Array, count: int, shares: Float64Array) -> None:
    """Turn the odds that each mark is filled into the probability."""
    odds, place = marks[ODDS], places[PLACE]
    for m in range(count):
        odds[m] = shares[np.uint32(place[m])]


@kernel
def _sort_out(marks: Float64Array, count: int, buried_m: float, buried_share: float) -> None:
    """Split the probabilities of the marks by what was seen there."""
    gap, near, height = marks[GAP], marks[NEAR], marks[HEIGHT]
    seen, free, hidden = marks[SEEN], marks[OPEN], marks[HIDDEN]
    unseen, clear = marks[UNSEEN], marks[CLEAR]
    for m in range(count):
        # One choice at a time, of numbers read before: conditions joined by "and", or a load that
        # hangs on one, take twice as long.
        ahead, met, above, share = gap[m], near[m], height[m], seen[m]
        in_earth = above if ahead == np.inf else 0.0
        met = 0.0 if in_earth < -buried_m else met
        share = buried_share if in_earth < -buried_m else share
        in_seen = share if met < np.inf else 0.0
        in_open = share - in_seen if ahead < np.inf else 0.0
        seen[m] = in_seen
        free[m] = in_open
        hidden[m] = share - in_seen - in_open
        not_met = 1.0 if met == np.inf else 0.0
        unseen[m] = not_met if ahead == np.inf else 0.0
        least = min(ahead, above) if met == np.inf else np.inf
        clear[m] = least if ahead < np.inf else np.inf


@kernel
def _add_up(count: int, block: Block, rate_per_m: float, at: int, found: Findings) -> None:
    """The findings on a block's lines, whose marks are sorted out; the first is line `at`."""
    marks = block.marks
    seen, free, hidden = marks[SEEN], marks[OPEN], marks[HIDDEN]
    unseen, clear, rank, height = marks[UNSEEN], marks[CLEAR], marks[RANK], marks[HEIGHT]
    for i in range(count):
        begin, end, piece = block.span[i, 0], block.span[i, 1], block.lines[i, PIECE]
        in_seen, in_open, in_hidden, marks_unseen, least = 0.0, 0.0, 0.0, 0.0, np.inf
        for m in range(begin, end):
            in_seen += seen[m]
            in_open += free[m]
            in_hidden += hidden[m]
            marks_unseen += unseen[m]
            least = min(least, clear[m])
        worst, worst_height, worst_at, worst_scan = 0.0, np.inf, 0.0, -1
        if in_seen > 0.0:
            for m in range(begin, end):
                # of marks under the ground, all as bad, the one next to its surface
                if seen[m] > worst or (seen[m] == worst > 0.0 and height[m] > worst_height):
                    worst, worst_height = seen[m], height[m]
                    worst_scan = block.chosen[i, int(rank[m])]
                    worst_at = m - begin + block.lines[i, FIRST]
        found.seen[at + i] = in_seen * rate_per_m * piece
        found.open[at + i] = in_open * rate_per_m * piece
        found.hidden[at + i] = in_hidden * rate_per_m * piece
        found.unknown_m[at + i] = marks_unseen * piece
        found.clearance_m[at + i] = max(least, 0.0)
        found.worst_m[at + i] = worst_at * piece
        found.worst_scan[at + i] = worst_scan


@kernel
def judge_some(
    memory: Memory,
    first: Float64Array,
    second: Float64Array,
    model: Model,
    odds_table: Float64Array,
    block: Block,
    found: Findings,
) -> None:
    """Write the findings on lines; see `judge_lines`."""
    cells, ground, position = memory.cells, memory.ground.reshape(-1), memory.position
    age_m, later_s = memory.age_m, memory.later_s
    marks, places, lines = block.marks, block.places, block.lines
    span, chosen = block.span, block.chosen
    away, rank = block.away, block.rank
    scans = chosen.shape[1]
    weights, heights, shares = model.weights[scans - 1], model.heights, model.shares
    height_from_m, motion = model.height_from_m, motion_of(model)
    share_from, shares_per_odds = model.share_from, model.shares_per_odds
    at = 0
    while at < len(first):
        count = lay_out(first, second, at, model.mark_m, model.end_m, lines, span)
        in_all, a, b = span[count - 1, 2], first[at : at + count], second[at : at + count]
        if len(position) > 1:
            choose_scans(position, age_m, a, b, chosen, away, rank)
            find_across(position, later_s, a, b, chosen, lines)
        divide(count, block)
        for n in range(scans):
            depths = BY_NEAREST if n == 0 else DEPTH
            runs = turn_to_scan(n, a, b, block)
            aim(n, count, block)
            look(cells, runs, block)
            measure(depths, runs, block, model)
            meet(marks, depths, n, in_all, model)
            weigh(marks, places, n, in_all, odds_table, weights[n])
            if n == 0:
                raise_above_ground(ground, marks, places, lines, span, chosen, count)
            else:
                _keep_depths(marks, lines, span, count, n)
        _find_places(marks, HEIGHT, places, in_all, height_from_m, model.per_m, len(heights))
        _add_height(marks, places, in_all, heights)
        if scans > 1:
            find_changed(marks, lines, span, count, motion)
            _follow(cells, a, b, motion, block)
            _decide_moved(marks, in_all, model.moved_here, model.moved_away)
        _find_places(marks, ODDS, places, in_all, share_from, shares_per_odds, len(shares))
        _fill(marks, places, in_all, shares)
        _sort_out(marks, in_all, model.buried_m, model.buried_rate_per_m / model.rate_per_m)
        _add_up(count, block, model.rate_per_m, at, found)
        at += count


def odds_table_of(model: Model) -> Float64Array:
    """Odds of scattered surfaces, then of solid ones, then 0: of what no scan saw."""
    return np.concatenate([model.scatter, model.solid, [0.0]])


def judge_lines(
    memory: Memory, first: Float64Array, second: Float64Array, model: Model = MODEL
) -> Findings:
    """Findings for L lines between finite points `first` and `second`, (L, 3) each, scene frame.

    The caller orders the two ends, so that a line and its reverse are the same line here.
    """
    count, table = len(first), odds_table_of(model)
    a, b, c, d, e, f = np.empty((6, count))
    found = Findings(a, b, c, d, e, f, np.empty(count, np.int64))

    def work(start: int, stop: int) -> None:
        part, block = slice(start, stop), new_block(memory, model)
        to_find = Findings._make([values[part] for values in found])
        judge_some(memory, first[part], second[part], model, table, block, to_find)

    in_parts(work, count, least=512)
    return found
