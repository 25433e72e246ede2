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

import numpy as np

from intervis.arrays import Float64Array, IntArray
from intervis.kernels import in_parts, kernel
from intervis.sight.atlas import Memory, choose_scans
from intervis.sight.block import (
    ACROSS,
    BY_ACROSS,
    BY_NEAREST,
    DEPTH,
    FIRST,
    HEIGHT,
    MOVED,
    NEAR,
    ODDS,
    PLACE,
    RANK,
    STEP,
    WAY,
    Block,
    Int32Array,
    lay_out,
    new_block,
    turn_to_scan,
)
from intervis.sight.chart import Int16Array
from intervis.sight.findings import Findings, add_up, new_findings, sort_out
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
from intervis.sight.occupancy_model import MODEL, Model


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
            if marks[NEAR, m] > motion.surface_to_m:
                one, other = marks[BY_NEAREST, m], marks[BY_ACROSS, m]
                marks[NEAR, m] = motion.surface_to_m
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
        sort_out(marks, in_all, model)
        add_up(later_s, count, block, model, at, found)
        at += count


def odds_table_of(model: Model) -> Float64Array:
    """Odds of scattered surfaces, then of solid ones, then 0: of what no scan saw."""
    return np.concatenate([model.scatter, model.solid, [0.0]])


@kernel
def put_in_order(first: Float64Array, second: Float64Array) -> None:
    """Swap the two ends of lines, (L, 3) each, so that the lexicographically smaller comes first.

    The engine never knows which end is the viewpoint: that is what makes answers reciprocal.
    """
    for i in range(len(first)):
        swap = False
        for axis in range(3):
            if first[i, axis] != second[i, axis]:
                swap = first[i, axis] > second[i, axis]
                break
        if swap:
            for axis in range(3):
                first[i, axis], second[i, axis] = second[i, axis], first[i, axis]


def judge_lines(
    memory: Memory, starts: Float64Array, ends: Float64Array, model: Model = MODEL
) -> Findings:
    """Findings for L lines between finite points, (L, 3) each, scene frame.

    Where a finding lies along the line, it is counted from the end that comes first in order.
    """
    first, second = (np.array(points, np.float64, order="C") for points in (starts, ends))
    put_in_order(first, second)
    count, table = len(first), odds_table_of(model)
    found = new_findings(count)

    def work(start: int, stop: int) -> None:
        part, block = slice(start, stop), new_block(memory, model)
        to_find = Findings._make([values[part] for values in found])
        judge_some(memory, first[part], second[part], model, table, block, to_find)

    in_parts(work, count, least=512)
    return found
