"""The fast engine: marks along many sight lines, judged against the charts of the nearest scans.

`intervis.sight.oracle` does the same slowly and plainly; the definition is in `evidence`.
"""

from typing import NamedTuple

import numpy as np

from intervis.arrays import Float32Array, Float64Array, IntArray
from intervis.kernels import in_parts, kernel
from intervis.sight.chart import TURN, turn_of
from intervis.sight.evidence import (
    DEPTH_TABLE_FROM_M,
    END_M,
    HEIGHT_TABLE,
    HEIGHT_TABLE_FROM_M,
    MARK_M,
    NOISE,
    RATE_PER_M,
    SCANS,
    SCATTER_TABLE,
    SOLID_TABLE,
    SURFACE_FROM_M,
    SURFACE_TO_M,
    TABLE_STEP_M,
    scan_weights,
)
from intervis.sight.ground import CELL_M, CELLS

CARRIED = 0.1
"""Between two rows the surface is interpolated where rho differs by less than this share."""
NEAR_M = 0.5
"""Scans whose distances to a line's ends differ by less than this are ranked newest first."""
MOST_MARKS = 2048
"""Longer lines get longer pieces."""


class Memory(NamedTuple):
    """Charts of S scans, oldest first, laid out for kernels.

    `cells` holds each scan's chart, row after row, from `offset` on; `sensor_from_scene` is
    (S, 3, 4); `position` (S, 3) are the sensors' places in the scene; `ground` is (S, G, G).
    """

    cells: Float32Array
    offset: IntArray
    columns: IntArray
    rows: IntArray
    slope_from: Float64Array
    slope_step: Float64Array
    sensor_from_scene: Float64Array
    position: Float64Array
    ground: Float32Array


class Findings(NamedTuple):
    """What the marks of L lines add up to; see `evidence`.

    `exponent` is -log P(visible); `seen` its part from marks at seen surfaces; `unknown_m` the
    length that no scan saw; `clearance_m` the least gap to a surface or the ground on the way
    (inf with none); `worst_m` the distance from the line's first end to the mark most likely
    filled at a seen surface, `worst_scan` the scan that says so (-1: there is none).
    """

    exponent: Float64Array
    seen: Float64Array
    unknown_m: Float64Array
    clearance_m: Float64Array
    worst_m: Float64Array
    worst_scan: IntArray


@kernel
def surface_at(memory: Memory, k: int, x: float, y: float, z: float, rho: float) -> float:
    """Signed surface rho of scan k in the direction of (x, y, z), see `chart`; 0 for nothing."""
    f = (z / rho - memory.slope_from[k]) / memory.slope_step[k]
    rows = memory.rows[k]
    if not (0.0 <= f < rows - 1.0):
        return 0.0
    columns = memory.columns[k]
    r = int(f)
    f -= r
    c = min(int(turn_of(x, y) * (columns / TURN)), columns - 1)
    at = memory.offset[k] + c * rows + r
    low = memory.cells[at]
    high = memory.cells[at + 1]
    below = float(abs(low))
    above = float(abs(high))
    near = high if f >= 0.5 else low
    if below > 0.0 and above > 0.0 and abs(below - above) < CARRIED * min(below, above):
        mixed = below + (above - below) * f
        return float(mixed if near > 0.0 else -mixed)
    return float(near)


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
def _entry(table: Float64Array, value: float, start: float) -> float:
    at = (value - start) / TABLE_STEP_M
    if not at > 0.0:
        return float(table[0])
    if at >= len(table):
        return float(table[-1])
    return float(table[int(at)])


@kernel
def _judge_lines(
    memory: Memory,
    first: Float64Array,
    second: Float64Array,
    weights: Float64Array,
    solid: Float64Array,
    scatter: Float64Array,
    heights: Float64Array,
    start: int,
    stop: int,
    found: Findings,
) -> None:
    chosen = np.empty(weights.shape[1], np.int64)
    rank = np.empty(weights.shape[1])
    half = 0.5 * CELLS * CELL_M
    for i in range(start, stop):
        a, b = first[i], second[i]
        count = _nearest_scans(memory, a, b, chosen, rank)
        dx, dy, dz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
        length = np.sqrt(dx * dx + dy * dy + dz * dz)
        marks = int(min(max(np.ceil(length / MARK_M), 1.0), float(MOST_MARKS)))
        piece = length / marks
        exponent, seen, unknown, clearance = NOISE, 0.0, 0.0, np.inf
        worst, worst_at, worst_scan = 0.0, 0.0, -1
        for m in range(marks):
            s = (m + 0.5) / marks
            if min(s, 1.0 - s) * length <= END_M:
                continue
            x, y, z = a[0] + s * dx, a[1] + s * dy, a[2] + s * dz
            odds, height, gap = 0.0, 0.0, np.inf
            scan_here, depth_here, free, surface = -1, np.inf, False, False
            for n in range(count):
                k = chosen[n]
                g = memory.sensor_from_scene[k]
                u = g[0, 0] * x + g[0, 1] * y + g[0, 2] * z + g[0, 3]
                v = g[1, 0] * x + g[1, 1] * y + g[1, 2] * z + g[1, 3]
                w = g[2, 0] * x + g[2, 1] * y + g[2, 2] * z + g[2, 3]
                if n == 0:
                    p = min(max(int((u + half) / CELL_M), 0), CELLS - 1)
                    q = min(max(int((v + half) / CELL_M), 0), CELLS - 1)
                    height = w - memory.ground[k, p, q]
                rho = np.sqrt(u * u + v * v)
                here = surface_at(memory, k, u, v, w, rho)
                if here == 0.0:
                    continue
                depth = rho - abs(here)
                table = solid if here > 0.0 else scatter
                odds += weights[count - 1, n] * _entry(table, depth, DEPTH_TABLE_FROM_M)
                if depth < SURFACE_FROM_M:
                    free = True
                    gap = min(gap, -depth)
                elif depth <= SURFACE_TO_M:
                    surface = True
                    if abs(depth) < depth_here:
                        depth_here, scan_here = abs(depth), k
            odds += _entry(heights, height, HEIGHT_TABLE_FROM_M)
            filled = RATE_PER_M * piece / (1.0 + np.exp(-odds))
            exponent += filled
            if surface:
                seen += filled
                if filled > worst:
                    worst, worst_at, worst_scan = filled, s * length, scan_here
            elif not free:
                unknown += piece
            else:
                clearance = min(clearance, max(min(gap, height), 0.0))
        found.exponent[i] = exponent
        found.seen[i] = seen
        found.unknown_m[i] = unknown
        found.clearance_m[i] = clearance
        found.worst_m[i] = worst_at
        found.worst_scan[i] = worst_scan


def weight_table() -> Float64Array:
    """Row n - 1 holds the weights of n scans."""
    table = np.zeros((SCANS, SCANS))
    for count in range(1, SCANS + 1):
        table[count - 1, :count] = scan_weights(count)
    return table


def judge_lines(memory: Memory, first: Float64Array, second: Float64Array) -> Findings:
    """Findings for L lines between finite points `first` and `second`, (L, 3) each, scene frame.

    The caller orders the two ends, so that a line and its reverse are the same line here.
    """
    count = len(first)
    found = Findings(
        exponent=np.empty(count),
        seen=np.empty(count),
        unknown_m=np.empty(count),
        clearance_m=np.empty(count),
        worst_m=np.empty(count),
        worst_scan=np.empty(count, np.int64),
    )
    weights = weight_table()

    def work(start: int, stop: int) -> None:
        _judge_lines(
            memory, first, second, weights, SOLID_TABLE, SCATTER_TABLE, HEIGHT_TABLE,
            start, stop, found,
        )  # fmt: skip

    in_parts(work, count, least=512)
    return found
