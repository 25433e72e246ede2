"""The fast engine: marks along many sight lines, judged against the charts of the nearest scans.

`intervis.sight.oracle` does the same slowly and plainly; the definition is in `evidence`.

The marks of a few lines at a time go through short passes over small arrays. A pass either
reckons, without branch or look-up, so that the compiler works on eight marks at once; or it looks
up, and does little else. One pass that does both takes twice as long. Lines are rounded up to
full eights of marks; the surplus is never counted.
"""

import numpy as np

from intervis.arrays import Float32Array, Float64Array, IntArray
from intervis.kernels import in_parts, kernel
from intervis.sight.atlas import CARRIED, Memory
from intervis.sight.block import (
    ACROSS,
    ALONG,
    BY_ACROSS,
    BY_NEAREST,
    CELL,
    COLUMNS,
    ENTRY,
    FIRST,
    GAP,
    HEIGHT,
    HIGH,
    LOW,
    MOVED,
    NEAR,
    ODDS,
    OFFSET,
    PLACE,
    RHO,
    ROWS,
    ROWS_PER_SLOPE,
    SCAN,
    SHARE,
    SLOPE_FROM,
    START,
    STEP,
    THE_SCAN,
    UNIT_M,
    WAY,
    Block,
    lay_out,
    new_block,
    turn_to_scan,
)
from intervis.sight.chart import TURN, Int16Array, turn_of
from intervis.sight.evidence import MODEL, Model
from intervis.sight.findings import Findings, add_up, new_findings, sort_out
from intervis.sight.ground import CELL_M, CELLS
from intervis.sight.moved import ALONE, NONE, has_changed, has_left, stood_here


@kernel
def _within(value: float, most: float) -> float:
    """A value from 0 to `most`; 0 for what is no number."""
    value = value if value > 0.0 else 0.0
    return value if value < most else most


@kernel
def _aim(marks: Float64Array, lines: Float64Array, span: IntArray, count: int) -> None:
    """Each mark's rho, lower cell in its line's chart, and share of the next row."""
    for i in range(count):
        begin, end = span[i, 0], span[i, 2]
        rho_of, cell, share = marks[RHO, begin:end], marks[CELL, begin:end], marks[SHARE, begin:end]
        u0, v0, w0 = lines[i, START], lines[i, START + 1], lines[i, START + 2]
        du, dv, dw = lines[i, ALONG], lines[i, ALONG + 1], lines[i, ALONG + 2]
        first, step = lines[i, FIRST], lines[i, STEP]
        slope_from, rows_per_slope = lines[i, SLOPE_FROM], lines[i, ROWS_PER_SLOPE]
        columns, rows, offset = lines[i, COLUMNS], lines[i, ROWS], lines[i, OFFSET]
        columns_per_turn = columns / TURN
        for m in range(end - begin):
            s = (m + first) * step
            u, v, w = u0 + s * du, v0 + s * dv, w0 + s * dw
            rho = np.sqrt(u * u + v * v)
            f = (w / rho - slope_from) * rows_per_slope
            on_chart = (f >= 0.0) & (f < rows - 1.0)
            f = f if on_chart else 0.0
            row = np.floor(f)
            column = np.floor(_within(turn_of(u, v) * columns_per_turn, columns - 1.0))
            rho_of[m] = rho
            share[m] = f - row if on_chart else -1.0
            cell[m] = offset + column * rows + row


@kernel
def _look(cells: Int16Array, marks: Float64Array, count: int) -> None:
    """The charts' values at the marks: the lower and the upper one of two rows."""
    cell, low, high = marks[CELL], marks[LOW], marks[HIGH]
    for m in range(count):
        at = int(cell[m])
        low[m] = cells[at]
        high[m] = cells[at + 1]


@kernel
def _measure(
    marks: Float64Array, lines: Float64Array, span: IntArray, count: int, model: Model
) -> None:
    """How deep the marks lie behind the surface that was seen, and what that makes of them."""
    depth_from_m, per_m = model.depth_from_m, model.per_m
    surface_from_m = model.surface_from_m
    entries = float(len(model.solid))
    for i in range(count):
        begin, end = span[i, 0], span[i, 2]
        rho_of, share = marks[RHO, begin:end], marks[SHARE, begin:end]
        lows, highs = marks[LOW, begin:end], marks[HIGH, begin:end]
        entry_of, scan_of = marks[ENTRY, begin:end], marks[SCAN, begin:end]
        gap_of, near_of = marks[GAP, begin:end], marks[NEAR, begin:end]
        unit_m, scan = lines[i, UNIT_M], lines[i, THE_SCAN]
        for m in range(end - begin):
            f, low, high = share[m], lows[m], highs[m]
            value = high if f >= 0.5 else low
            known = (value != 0.0) & (f >= 0.0)
            below, above = abs(low), abs(high)
            mixed = below + (above - below) * f
            surface = mixed if abs(below - above) < CARRIED * min(below, above) else abs(value)
            depth = rho_of[m] - surface * unit_m
            entry = np.floor(_within((depth - depth_from_m) * per_m, entries - 1.0))
            entry += entries if value > 0.0 else 0.0
            entry_of[m] = entry if known else 2.0 * entries
            gap = -depth if known & (depth < surface_from_m) else np.inf
            near = abs(depth) if known & (depth >= surface_from_m) else np.inf
            # read whether used or not: a load on a condition is four times as slow as the rest
            before, scan_before = near_of[m], scan_of[m]
            gap_of[m] = min(gap_of[m], gap)
            near_of[m] = min(before, near)
            scan_of[m] = scan if near < before else scan_before


@kernel
def _keep_depths(
    marks: Float64Array, lines: Float64Array, span: IntArray, count: int, n: int
) -> None:
    """Keep how deep the marks lie behind the surface of the n-th scan, where that is asked for."""
    for i in range(count):
        across = int(lines[i, ACROSS])
        if across == NONE or (n > 0 and n != across):
            continue
        begin, end = span[i, 0], span[i, 2]
        kept = marks[BY_NEAREST if n == 0 else BY_ACROSS, begin:end]
        rho_of, share = marks[RHO, begin:end], marks[SHARE, begin:end]
        lows, highs = marks[LOW, begin:end], marks[HIGH, begin:end]
        unit_m = lines[i, UNIT_M]
        for m in range(end - begin):
            f, below, above = share[m], abs(lows[m]), abs(highs[m])
            value = above if f >= 0.5 else below
            known = (value != 0.0) & (f >= 0.0)
            mixed = below + (above - below) * f
            surface = mixed if abs(below - above) < CARRIED * min(below, above) else value
            kept[m] = rho_of[m] - surface * unit_m if known else np.nan


@kernel
def _follow(
    memory: Memory,
    first: Float64Array,
    second: Float64Array,
    begin: int,
    count: int,
    model: Model,
    block: Block,
) -> None:
    """Decide the marks that two scans saw differently: did what moved stand there?"""
    marks = block.marks
    for i in range(count):
        line, a, b = block.lines[i], first[begin + i], second[begin + i]
        from_mark, to_mark = block.span[i, 0], block.span[i, 1]
        marks[MOVED, from_mark : block.span[i, 2]] = 0.0
        if line[ACROSS] == NONE:
            continue
        if line[ACROSS] == ALONE:
            for m in range(from_mark, to_mark):
                if has_left(marks[BY_NEAREST, m], marks[HEIGHT, m], model):
                    marks[MOVED, m] = -1.0
            continue
        near, across = block.chosen[i, 0], block.chosen[i, int(line[ACROSS])]
        for m in range(from_mark, to_mark):
            one, other = marks[BY_NEAREST, m], marks[BY_ACROSS, m]
            if not has_changed(one, other, marks[HEIGHT, m], model):
                continue
            s = (m - from_mark + line[FIRST]) * line[STEP]
            x, y, z = a[0] + s * (b[0] - a[0]), a[1] + s * (b[1] - a[1]), a[2] + s * (b[2] - a[2])
            if stood_here(memory, near, across, x, y, z, line[WAY : WAY + 3], model):
                marks[MOVED, m] = 1.0
                if marks[NEAR, m] > model.surface_to_m:
                    marks[NEAR, m] = model.surface_to_m
                    marks[SCAN, m] = near if one > other else across
            else:
                marks[MOVED, m] = -1.0


@kernel
def _weigh(marks: Float64Array, count: int, odds_table: Float64Array, weight: float) -> None:
    """Add what the scans say to the odds of the marks."""
    odds, entry = marks[ODDS], marks[ENTRY]
    for m in range(count):
        odds[m] += weight * odds_table[int(entry[m])]


@kernel
def _raise_above_ground(
    ground: Float32Array, marks: Float64Array, lines: Float64Array, span: IntArray, count: int
) -> None:
    """Heights of the marks above the ground that the nearest scan saw."""
    per_m, half = 1.0 / CELL_M, 0.5 * CELLS * CELL_M
    for i in range(count):
        begin, end = span[i, 0], span[i, 2]
        place, height = marks[PLACE, begin:end], marks[HEIGHT, begin:end]
        u0, v0, w0 = lines[i, START] + half, lines[i, START + 1] + half, lines[i, START + 2]
        du, dv, dw = lines[i, ALONG], lines[i, ALONG + 1], lines[i, ALONG + 2]
        first, step = lines[i, FIRST], lines[i, STEP]
        before = lines[i, THE_SCAN] * CELLS
        for m in range(end - begin):
            s = (m + first) * step
            p = np.floor(_within((u0 + s * du) * per_m, CELLS - 1.0))
            q = np.floor(_within((v0 + s * dv) * per_m, CELLS - 1.0))
            place[m] = (before + p) * CELLS + q
            height[m] = w0 + s * dw
        # what lies under that ground is blocked by it, if no scan says otherwise
        marks[SCAN, begin:end] = lines[i, THE_SCAN]
    heights = ground.reshape(-1)
    place, height = marks[PLACE], marks[HEIGHT]
    for m in range(span[count - 1, 2]):
        height[m] -= heights[int(place[m])]


@kernel
def _fill(marks: Float64Array, count: int, model: Model, followed: bool) -> None:
    """Turn the odds that each mark is filled into the probability."""
    heights, shares = model.heights, model.shares
    height_from_m, per_m = model.height_from_m, model.per_m
    share_from, shares_per_odds = model.share_from, model.shares_per_odds
    last_height, last_share = len(heights) - 1.0, len(shares) - 1.0
    odds, height, place = marks[ODDS], marks[HEIGHT], marks[PLACE]
    for m in range(count):
        place[m] = _within((height[m] - height_from_m) * per_m, last_height)
    if followed:
        moved, here, away = marks[MOVED], model.moved_here, model.moved_away
        for m in range(count):
            odds[m] += heights[int(place[m])]
        for m in range(count):
            summed = odds[m]
            at_least = max(summed, here) if moved[m] > 0.0 else summed
            odds[m] = min(at_least, away) if moved[m] < 0.0 else at_least
        for m in range(count):
            odds[m] = shares[int(_within((odds[m] - share_from) * shares_per_odds, last_share))]
        return
    for m in range(count):
        entry = (odds[m] + heights[int(place[m])] - share_from) * shares_per_odds
        odds[m] = shares[int(_within(entry, last_share))]


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
    marks, lines, span = block.marks, block.lines, block.span
    scans = block.chosen.shape[1]
    at = 0
    while at < len(first):
        count = lay_out(memory, first, second, at, model, block)
        in_all = span[count - 1, 2]
        marks[ODDS, :in_all] = 0.0
        marks[GAP, :in_all] = np.inf
        marks[NEAR, :in_all] = np.inf
        for n in range(scans):
            turn_to_scan(memory, n, first, second, at, count, block)
            _aim(marks, lines, span, count)
            _look(memory.cells, marks, in_all)
            _measure(marks, lines, span, count, model)
            _weigh(marks, in_all, odds_table, model.weights[scans - 1, n])
            if scans > 1:
                _keep_depths(marks, lines, span, count, n)
            if n == 0:
                _raise_above_ground(memory.ground, marks, lines, span, count)
        if scans > 1:
            _follow(memory, first, second, at, count, model, block)
        _fill(marks, in_all, model, scans > 1)
        sort_out(marks, in_all, model)
        add_up(memory, count, block, model, at, found)
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
    found = new_findings(count)

    def work(start: int, stop: int) -> None:
        part, block = slice(start, stop), new_block(memory, model)
        to_find = Findings._make([values[part] for values in found])
        judge_some(memory, first[part], second[part], model, table, block, to_find)

    in_parts(work, count, least=512)
    return found
