"""Where a blocked line meets the surface, and by how much it would have to move to pass."""

import numpy as np

from intervis.arrays import Float64Array, IntArray
from intervis.kernels import in_parts, kernel
from intervis.sight.chart import TURN, turn_of
from intervis.sight.engine import Memory, surface_at

REACH_M = 1.5
"""The surface is looked for so far along the line, to either side of the mark it blocks."""
STEP_M = 0.1
FARTHEST_MISS_M = 10.0
"""A line that would have to move farther is said to miss by this much."""


@kernel
def _depth(memory: Memory, k: int, x: float, y: float, z: float) -> float:
    """How deep a point of the scene lies behind scan k's surface; NaN where it saw none."""
    g = memory.sensor_from_scene[k]
    u = g[0, 0] * x + g[0, 1] * y + g[0, 2] * z + g[0, 3]
    v = g[1, 0] * x + g[1, 1] * y + g[1, 2] * z + g[1, 3]
    w = g[2, 0] * x + g[2, 1] * y + g[2, 2] * z + g[2, 3]
    rho = np.sqrt(u * u + v * v)
    here = surface_at(memory, k, u, v, w, rho)
    return rho - abs(here) if here != 0.0 else np.nan


@kernel
def _crossing(
    memory: Memory, k: int, a: Float64Array, along: Float64Array, length: float, worst: float
) -> float:
    """Distance from `a` where the line crosses scan k's surface next to `worst`; else `worst`."""
    here = _depth(
        memory, k, a[0] + worst * along[0], a[1] + worst * along[1], a[2] + worst * along[2]
    )
    before = here  # towards the first end
    after = here  # towards the second one
    for n in range(1, int(REACH_M / STEP_M) + 1):
        low = worst - n * STEP_M
        high = worst + n * STEP_M
        if low >= 0.0:
            depth = _depth(
                memory, k, a[0] + low * along[0], a[1] + low * along[1], a[2] + low * along[2]
            )
            if before * depth <= 0.0:
                return low + STEP_M * (depth / (depth - before) if depth != before else 0.0)
            before = depth
        if high <= length:
            depth = _depth(
                memory, k, a[0] + high * along[0], a[1] + high * along[1], a[2] + high * along[2]
            )
            if after * depth <= 0.0:
                return high - STEP_M * (depth / (depth - after) if depth != after else 0.0)
            after = depth
    return worst


@kernel
def _miss(memory: Memory, k: int, x: float, y: float, z: float) -> float:
    """Shortest way out from behind scan k's surface: upwards, downwards or to either side."""
    g = memory.sensor_from_scene[k]
    u = g[0, 0] * x + g[0, 1] * y + g[0, 2] * z + g[0, 3]
    v = g[1, 0] * x + g[1, 1] * y + g[1, 2] * z + g[1, 3]
    w = g[2, 0] * x + g[2, 1] * y + g[2, 2] * z + g[2, 3]
    rho = np.sqrt(u * u + v * v)
    rows = memory.rows[k]
    columns = memory.columns[k]
    r = int((w / rho - memory.slope_from[k]) * memory.rows_per_slope[k] + 0.5)
    c = min(int(turn_of(u, v) * (columns / TURN)), columns - 1)
    if not 0 <= r < rows:
        return 0.0
    least = FARTHEST_MISS_M
    for way in range(4):
        step = rho * (1.0 / memory.rows_per_slope[k] if way < 2 else 2.0 * np.pi / columns)
        n = 1
        while n * step < least:
            row = r + n if way == 0 else (r - n if way == 1 else r)
            column = c + n if way == 2 else (c - n if way == 3 else c)
            if not 0 <= row < rows:
                break
            here = memory.unit_m[k] * abs(
                float(memory.cells[memory.offset[k] + row * columns + column % columns])
            )
            if here == 0.0 or here > rho:
                least = n * step
                break
            n += 1
    return least


@kernel
def _meet(
    memory: Memory,
    first: Float64Array,
    second: Float64Array,
    worst_m: Float64Array,
    worst_scan: IntArray,
    blocker: Float64Array,
    miss_m: Float64Array,
    begin: int,
    end: int,
) -> None:
    along = np.empty(3)
    for i in range(begin, end):
        k = worst_scan[i]
        if k < 0:
            continue
        a = first[i]
        length = 0.0
        for axis in range(3):
            along[axis] = second[i, axis] - a[axis]
            length += along[axis] ** 2
        length = np.sqrt(length)
        for axis in range(3):
            along[axis] /= length
        at = _crossing(memory, k, a, along, length, worst_m[i])
        for axis in range(3):
            blocker[i, axis] = a[axis] + at * along[axis]
        at = worst_m[i]
        miss_m[i] = _miss(
            memory, k, a[0] + at * along[0], a[1] + at * along[1], a[2] + at * along[2]
        )


def meet_surfaces(
    memory: Memory,
    first: Float64Array,
    second: Float64Array,
    worst_m: Float64Array,
    worst_scan: IntArray,
) -> tuple[Float64Array, Float64Array]:
    """Where L blocked lines meet the surface (L, 3), and by how much they miss the gap (L,).

    The miss is measured at the mark that is most likely filled, across the beam of the scan that
    saw the surface: the least shift up, down or sideways after which that scan saw farther, or
    saw nothing.
    """
    blocker, miss_m = np.full((len(first), 3), np.nan), np.zeros(len(first))

    def work(begin: int, end: int) -> None:
        _meet(memory, first, second, worst_m, worst_scan, blocker, miss_m, begin, end)

    in_parts(work, len(first), least=512)
    return blocker, miss_m
