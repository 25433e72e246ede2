"""The fast engine: marks along many sight lines, judged against the charts of the nearest scans.

`intervis.sight.oracle` does the same slowly and plainly; the definition is in `evidence`.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from intervis.arrays import Float32Array, Float64Array, IntArray
from intervis.kernels import in_parts, kernel
from intervis.sight.chart import TURN, turn_of
from intervis.sight.evidence import MODEL, NOISE, Model
from intervis.sight.ground import CELL_M, CELLS

Int16Array = NDArray[np.int16]
Int32Array = NDArray[np.int32]

CARRIED = 0.1
"""Between two rows the surface is interpolated where rho differs by less than this share."""
NEAR_M = 0.5
"""Scans whose distances to a line's ends differ by less than this are ranked newest first."""
MOST_MARKS = 2048
"""Longer lines get longer pieces."""


# Rows of what the scans say about the marks of a line: summed log-odds, least gap before a seen
# surface, least distance from one that is met, which scan saw that one;
# and the height above the ground that the nearest scan saw.
ODDS, GAP, DEPTH, SCAN, HEIGHT = range(5)
RHO, SHARE = range(2)


class Memory(NamedTuple):
    """Charts of S scans, oldest first, laid out for kernels.

    `cells` holds each scan's chart, row after row, from `offset` on; `sensor_from_scene` is
    (S, 3, 4); `position` (S, 3) are the sensors' places in the scene; `ground` is (S, G, G).
    """

    cells: Int16Array
    unit_m: Float64Array
    offset: IntArray
    columns: IntArray
    rows: IntArray
    slope_from: Float64Array
    rows_per_slope: Float64Array
    sensor_from_scene: Float64Array
    position: Float64Array
    ground: Float32Array


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
def surface_at(memory: Memory, k: int, x: float, y: float, z: float, rho: float) -> float:
    """Signed surface rho of scan k in the direction of (x, y, z), see `chart`; 0 for nothing."""
    f = (z / rho - memory.slope_from[k]) * memory.rows_per_slope[k]
    rows = memory.rows[k]
    if not (0.0 <= f < rows - 1.0):
        return 0.0
    columns = memory.columns[k]
    r = int(f)
    f -= r
    c = min(int(turn_of(x, y) * (columns / TURN)), columns - 1)
    at = memory.offset[k] + r * columns + c
    low = float(memory.cells[at])
    high = float(memory.cells[at + columns])
    near = high if f >= 0.5 else low
    surface = abs(near)
    if near != 0.0 and abs(abs(low) - abs(high)) < CARRIED * min(abs(low), abs(high)):
        surface = abs(low) + (abs(high) - abs(low)) * f
    return float(surface * memory.unit_m[k] if near > 0.0 else -surface * memory.unit_m[k])


@kernel
def _nearest_scans(
    memory: Memory, a: Float64Array, b: Float64Array, chosen: IntArray, rank: Float64Array
) -> int:
    """The scans with a say about one line, nearest first, newest first among equals."""
    count = 0
    for k in range(len(memory.offset) - 1, -1, -1):
        to_a = 0.0
        to_b = 0.0
        for axis in range(3):
            to_a += (a[axis] - memory.position[k, axis]) ** 2
            to_b += (b[axis] - memory.position[k, axis]) ** 2
        away = np.floor(np.sqrt(min(to_a, to_b)) / NEAR_M)
        if count < len(chosen):
            count += 1
        elif not away < rank[count - 1]:
            continue
        at = count - 1
        while at > 0 and rank[at - 1] > away:
            rank[at] = rank[at - 1]
            chosen[at] = chosen[at - 1]
            at -= 1
        rank[at] = away
        chosen[at] = k
    return count


@kernel
def _aim(
    memory: Memory,
    k: int,
    start: Float64Array,
    along: Float64Array,
    marks: int,
    skipped: int,
    aim: Float64Array,
    cell: Int32Array,
) -> None:
    """Each mark's rho, lower cell in scan k's chart (-1: off the chart), share of the next row.

    Free of branches and of look-ups, so that the compiler can work on several marks at once.
    """
    u0, v0, w0 = start[0], start[1], start[2]
    du, dv, dw = along[0], along[1], along[2]
    slope_from, rows_per_slope = memory.slope_from[k], memory.rows_per_slope[k]
    columns = memory.columns[k]
    columns_per_turn = columns / TURN
    last_row, last_column = memory.rows[k] - 1.0, columns - 1.0
    for m in range(marks - 2 * skipped):
        s = (m + skipped + 0.5) / marks
        u, v, w = u0 + s * du, v0 + s * dv, w0 + s * dw
        rho = np.sqrt(u * u + v * v)
        f = (w / rho - slope_from) * rows_per_slope
        on_chart = (f >= 0.0) & (f < last_row)
        f = f if on_chart else 0.0
        row = np.floor(f)
        column = np.floor(min(turn_of(u, v) * columns_per_turn, last_column))
        aim[RHO, m] = rho
        aim[SHARE, m] = f - row
        cell[m] = np.int32(row * columns + column) if on_chart else np.int32(-1)


@kernel
def _say_of_scan(
    memory: Memory,
    k: int,
    a: Float64Array,
    b: Float64Array,
    marks: int,
    skipped: int,
    nearest: bool,
    weight: float,
    model: Model,
    say: Float64Array,
    aim: Float64Array,
    cell: Int32Array,
) -> None:
    """Add one scan's say to the marks of one line; rows of `say` are named below."""
    g = memory.sensor_from_scene[k]
    start = np.empty(3)
    along = np.empty(3)
    for axis in range(3):
        start[axis] = g[axis, 0] * a[0] + g[axis, 1] * a[1] + g[axis, 2] * a[2] + g[axis, 3]
        along[axis] = (
            g[axis, 0] * (b[0] - a[0]) + g[axis, 1] * (b[1] - a[1]) + g[axis, 2] * (b[2] - a[2])
        )
    count = marks - 2 * skipped
    _aim(memory, k, start, along, marks, skipped, aim, cell)
    unit_m, columns, offset = memory.unit_m[k], memory.columns[k], memory.offset[k]
    cells = memory.cells[offset : offset + columns * memory.rows[k]]
    last_entry = len(model.solid) - 1.0
    for m in range(count):
        at = cell[m]
        if at < 0:
            continue
        f, rho = aim[SHARE, m], aim[RHO, m]
        low, high = float(cells[at]), float(cells[at + columns])
        near = high if f >= 0.5 else low
        if near == 0.0:
            continue
        below, above = abs(low), abs(high)
        mixed = below + (above - below) * f
        surface = mixed if abs(below - above) < CARRIED * min(below, above) else abs(near)
        depth = rho - surface * unit_m
        entry = int(min(max((depth - model.depth_from_m) * model.per_m, 0.0), last_entry))
        say[ODDS, m] += weight * (model.solid[entry] if near > 0.0 else model.scatter[entry])
        if depth < model.surface_from_m:
            say[GAP, m] = min(say[GAP, m], -depth)
        elif depth <= model.surface_to_m and abs(depth) < say[DEPTH, m]:
            say[DEPTH, m] = abs(depth)
            say[SCAN, m] = k
    if nearest:
        ground = memory.ground[k]
        half = 0.5 * CELLS * CELL_M
        for m in range(count):
            s = (m + skipped + 0.5) / marks
            p = (start[0] + s * along[0] + half) / CELL_M
            q = (start[1] + s * along[1] + half) / CELL_M
            p = min(max(p, 0.0), CELLS - 1.0)
            q = min(max(q, 0.0), CELLS - 1.0)
            say[HEIGHT, m] = start[2] + s * along[2] - ground[int(p), int(q)]


@kernel
def _judge_lines(
    memory: Memory,
    first: Float64Array,
    second: Float64Array,
    model: Model,
    start: int,
    stop: int,
    found: Findings,
) -> None:
    chosen = np.empty(model.weights.shape[1], np.int64)
    rank = np.empty(model.weights.shape[1])
    say = np.empty((5, MOST_MARKS))
    aim = np.empty((2, MOST_MARKS))
    cell = np.empty(MOST_MARKS, np.int32)
    for i in range(start, stop):
        a, b = first[i], second[i]
        length = np.sqrt((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2 + (b[2] - a[2]) ** 2)
        marks = int(min(max(np.ceil(length / model.mark_m), 1.0), float(MOST_MARKS)))
        piece = length / marks
        # Marks up to end_m from the ends: the first kept one is the first beyond it.
        skipped = (marks + 1) // 2
        if length > 2.0 * model.end_m:
            skipped = min(int(np.floor(model.end_m / piece + 0.5)), skipped)
        say[ODDS, :marks] = 0.0
        say[GAP, :marks] = np.inf
        say[DEPTH, :marks] = np.inf
        count = _nearest_scans(memory, a, b, chosen, rank)
        for n in range(count):
            weight = model.weights[count - 1, n]
            _say_of_scan(
                memory, chosen[n], a, b, marks, skipped, n == 0, weight, model, say, aim, cell
            )
        free, seen, hidden, unknown, clearance = 0.0, 0.0, 0.0, 0.0, np.inf
        worst, worst_at, worst_scan = 0.0, 0.0, -1
        for m in range(marks - 2 * skipped):
            entry = (say[HEIGHT, m] - model.height_from_m) * model.per_m
            odds = say[ODDS, m] + model.heights[int(min(max(entry, 0.0), len(model.heights) - 1.0))]
            entry = (odds - model.share_from) * model.shares_per_odds
            share = model.shares[int(min(max(entry, 0.0), len(model.shares) - 1.0))]
            filled = model.rate_per_m * piece * share
            if say[DEPTH, m] < np.inf:
                seen += filled
                if filled > worst:
                    worst, worst_scan = filled, int(say[SCAN, m])
                    worst_at = (m + skipped + 0.5) * piece
            elif say[GAP, m] < np.inf:
                free += filled
                clearance = min(clearance, max(min(say[GAP, m], say[HEIGHT, m]), 0.0))
            else:
                hidden += filled
                unknown += piece
        found.open[i] = free
        found.seen[i] = seen
        found.hidden[i] = hidden
        found.unknown_m[i] = unknown
        found.clearance_m[i] = clearance
        found.worst_m[i] = worst_at
        found.worst_scan[i] = worst_scan


def judge_lines(
    memory: Memory, first: Float64Array, second: Float64Array, model: Model = MODEL
) -> Findings:
    """Findings for L lines between finite points `first` and `second`, (L, 3) each, scene frame.

    The caller orders the two ends, so that a line and its reverse are the same line here.
    """
    count = len(first)
    found = Findings(
        open=np.empty(count),
        seen=np.empty(count),
        hidden=np.empty(count),
        unknown_m=np.empty(count),
        clearance_m=np.empty(count),
        worst_m=np.empty(count),
        worst_scan=np.empty(count, np.int64),
    )

    def work(start: int, stop: int) -> None:
        _judge_lines(memory, first, second, model, start, stop, found)

    in_parts(work, count, least=512)
    return found
