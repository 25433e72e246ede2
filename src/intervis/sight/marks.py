"""Passes over the marks of a block: what one scan shows of them, and the ground below them.

Values are looked up by narrow unsigned numbers: signed ones may count from the end, and to see to
that takes as long as the look-up.
"""

import numpy as np

from intervis.arrays import Float32Array, Float64Array, IntArray
from intervis.kernels import kernel
from intervis.sight.atlas import CARRIED, COLUMNS, OFFSET, ROWS, ROWS_PER_SLOPE, SLOPE_FROM, UNIT_M
from intervis.sight.block import (
    ALONG,
    CELL,
    ENTRY,
    FIRST,
    GAP,
    HEIGHT,
    HIGH,
    LOW,
    NEAR,
    ODDS,
    PART,
    PLACE,
    RANK,
    RHO,
    SHARE,
    START,
    STEP,
    Block,
    Int32Array,
    in_eights,
)
from intervis.sight.chart import TURN, Int16Array, turn_of
from intervis.sight.ground import CELL_M, CELLS
from intervis.sight.occupancy_model import Model


@kernel
def within(value: float, most: float) -> float:
    """A value from 0 to `most`; 0 for what is no number."""
    value = value if value > 0.0 else 0.0
    return value if value < most else most


@kernel
def divide(count: int, block: Block) -> None:
    """The share of its line that lies before each mark: scan after scan needs it."""
    lines, span = block.lines, block.span
    for i in range(count):
        begin, end = span[i, 0], span[i, 2]
        part_of, first, step = block.marks[PART, begin:end], lines[i, FIRST], lines[i, STEP]
        for m in range(in_eights(begin, end)):
            part_of[m] = (m + first) * step


@kernel
def aim(n: int, count: int, block: Block) -> None:
    """Each mark's rho, lower cell in its line's chart, and share of the next row."""
    marks, places, lines, span = block.marks, block.places, block.lines, block.span
    for i in range(count):
        begin, end = span[i, 0], span[i, 2]
        rho_of, share_of = marks[RHO, begin:end], marks[SHARE, begin:end]
        cell_of = places[CELL, begin:end]
        u0, v0, w0 = lines[i, START], lines[i, START + 1], lines[i, START + 2]
        du, dv, dw = lines[i, ALONG], lines[i, ALONG + 1], lines[i, ALONG + 2]
        part_of, k = marks[PART, begin:end], block.chosen[i, n]
        slope_from, rows_per_slope = block.charts[k, SLOPE_FROM], block.charts[k, ROWS_PER_SLOPE]
        columns, rows = block.charts[k, COLUMNS], block.charts[k, ROWS]
        columns_per_turn = columns / TURN
        for m in range(in_eights(begin, end)):
            s = part_of[m]
            u, v, w = u0 + s * du, v0 + s * dv, w0 + s * dw
            rho = np.sqrt(u * u + v * v)
            f = (w / rho - slope_from) * rows_per_slope
            on_chart = (f >= 0.0) & (f < rows - 1.0)
            f = f if on_chart else 0.0
            row = np.floor(f)
            column = np.floor(within(turn_of(u, v) * columns_per_turn, columns - 1.0))
            rho_of[m] = rho
            share_of[m] = f - row if on_chart else -1.0
            cell_of[m] = column * rows + row


@kernel
def look(cells: Int16Array, runs: int, block: Block) -> None:
    """The charts' values at the marks: the lower and the upper one of two rows."""
    for i in range(runs):
        begin, end = block.runs[i, 0], block.runs[i, 1]
        cell = block.places[CELL, begin:end]
        low, high = block.values[LOW, begin:end], block.values[HIGH, begin:end]
        seen = cells[int(block.charts[block.runs[i, 2], OFFSET]) :]
        for m in range(in_eights(begin, end)):
            at = np.uint32(cell[m])
            low[m] = seen[at]
            high[m] = seen[at + 1]


@kernel
def measure(to: int, runs: int, block: Block, model: Model) -> None:
    """How deep the marks lie behind the surface that was seen, and where that is in the table."""
    depth_from_m, per_m, entries = model.depth_from_m, model.per_m, float(len(model.solid))
    for i in range(runs):
        begin, end = block.runs[i, 0], block.runs[i, 1]
        rho_of, share = block.marks[RHO, begin:end], block.marks[SHARE, begin:end]
        lows, highs = block.values[LOW, begin:end], block.values[HIGH, begin:end]
        depth_of, entry_of = block.marks[to, begin:end], block.places[ENTRY, begin:end]
        unit_m = block.charts[block.runs[i, 2], UNIT_M]
        for m in range(in_eights(begin, end)):
            f, low, high = share[m], float(lows[m]), float(highs[m])
            value = high if f >= 0.5 else low
            known = (value != 0.0) & (f >= 0.0)
            below, above = abs(low), abs(high)
            mixed = below + (above - below) * f
            surface = mixed if abs(below - above) < CARRIED * min(below, above) else abs(value)
            depth = rho_of[m] - surface * unit_m
            entry = np.floor(within((depth - depth_from_m) * per_m, entries - 1.0))
            entry += entries if value > 0.0 else 0.0
            entry_of[m] = entry if known else 2.0 * entries
            depth_of[m] = depth if known else np.nan


@kernel
def meet(marks: Float64Array, by: int, n: int, count: int, model: Model) -> None:
    """What the n-th scan's depths say of the gaps before surfaces, and of the ways behind them."""
    surface_from_m = model.surface_from_m
    depth_of, gap_of, near_of, rank_of = marks[by], marks[GAP], marks[NEAR], marks[RANK]
    later, rank = n > 0, float(n)
    for m in range(count):
        # read whether used or not: a load on a condition is four times as slow as the rest
        depth, gap_before, before, rank_before = depth_of[m], gap_of[m], near_of[m], rank_of[m]
        gap = -depth if depth < surface_from_m else np.inf
        near = abs(depth) if depth >= surface_from_m else np.inf
        gap_of[m] = min(gap_before, gap) if later else gap
        near_of[m] = min(before, near) if later else near
        rank_of[m] = rank_before if later & (near >= before) else rank


@kernel
def weigh(
    marks: Float64Array, places: Int32Array, n: int, count: int, table: Float64Array, weight: float
) -> None:
    """Add what the n-th scan says to the odds of the marks."""
    odds, entry = marks[ODDS], places[ENTRY]
    if n == 0:
        for m in range(count):
            odds[m] = weight * table[np.uint32(entry[m])]
        return
    for m in range(count):
        odds[m] += weight * table[np.uint32(entry[m])]


@kernel
def raise_above_ground(
    heights: Float32Array,
    marks: Float64Array,
    places: Int32Array,
    lines: Float64Array,
    span: IntArray,
    chosen: IntArray,
    count: int,
) -> None:
    """Heights of the marks above the ground that the nearest scan saw; `heights` is all ground."""
    per_m, half = 1.0 / CELL_M, 0.5 * CELLS * CELL_M
    for i in range(count):
        begin, end = span[i, 0], span[i, 2]
        place, height = places[PLACE, begin:end], marks[HEIGHT, begin:end]
        u0, v0, w0 = lines[i, START] + half, lines[i, START + 1] + half, lines[i, START + 2]
        du, dv, dw = lines[i, ALONG], lines[i, ALONG + 1], lines[i, ALONG + 2]
        part_of = marks[PART, begin:end]
        before = float(chosen[i, 0]) * CELLS
        for m in range(in_eights(begin, end)):
            s = part_of[m]
            p = np.floor(within((u0 + s * du) * per_m, CELLS - 1.0))
            q = np.floor(within((v0 + s * dv) * per_m, CELLS - 1.0))
            place[m] = (before + p) * CELLS + q
            height[m] = w0 + s * dw
    place, height = places[PLACE], marks[HEIGHT]
    for m in range(span[count - 1, 2]):
        height[m] -= heights[np.uint32(place[m])]
