"""Where a blocked line meets the surface, and by how much it would have to move to pass."""

import numpy as np

from intervis.arrays import Float64Array
from intervis.kernels import kernel
from intervis.sight.chart import TURN, turn_of
from intervis.sight.engine import Memory, surface_at, to_sensor

REACH_M = 1.5
"""The surface is looked for so far along the line, to either side of the mark it blocks."""
STEP_M = 0.1
FARTHEST_MISS_M = 10.0
"""A line that would have to move farther is said to miss by this much."""


@kernel
def new_sketch() -> Float64Array:
    """Working memory for a line in the frame of a sensor: its first end, and its direction."""
    return np.empty((2, 3))


@kernel
def _depth(memory: Memory, k: int, line: Float64Array, at_m: float) -> float:
    """How deep a place on the line lies behind scan k's surface; NaN where it saw none."""
    u = line[0, 0] + at_m * line[1, 0]
    v = line[0, 1] + at_m * line[1, 1]
    w = line[0, 2] + at_m * line[1, 2]
    rho = np.sqrt(u * u + v * v)
    here = surface_at(memory, k, u, v, w, rho)
    return rho - abs(here) if here != 0.0 else np.nan


@kernel
def _crossing(memory: Memory, k: int, line: Float64Array, length: float, worst_m: float) -> float:
    """Distance along the line to where it crosses scan k's surface next to `worst_m`.

    `worst_m` itself where it does not.
    """
    here = _depth(memory, k, line, worst_m)
    before = here  # towards the first end
    after = here  # towards the second one
    for n in range(1, int(REACH_M / STEP_M) + 1):
        low = worst_m - n * STEP_M
        high = worst_m + n * STEP_M
        if low >= 0.0:
            depth = _depth(memory, k, line, low)
            if before * depth <= 0.0:
                return low + STEP_M * (depth / (depth - before) if depth != before else 0.0)
            before = depth
        if high <= length:
            depth = _depth(memory, k, line, high)
            if after * depth <= 0.0:
                return high - STEP_M * (depth / (depth - after) if depth != after else 0.0)
            after = depth
    return worst_m


@kernel
def _miss(memory: Memory, k: int, line: Float64Array, at_m: float) -> float:
    """Shortest way out from behind scan k's surface: upwards, downwards or to either side."""
    u = line[0, 0] + at_m * line[1, 0]
    v = line[0, 1] + at_m * line[1, 1]
    w = line[0, 2] + at_m * line[1, 2]
    rho = np.sqrt(u * u + v * v)
    rows, columns = memory.rows[k], memory.columns[k]
    r = int((w / rho - memory.slope_from[k]) * memory.rows_per_slope[k] + 0.5)
    c = min(int(turn_of(u, v) * (columns / TURN)), columns - 1)
    if not 0 <= r < rows:
        return 0.0
    least = FARTHEST_MISS_M
    units = rho / memory.unit_m[k]
    for way in range(4):
        step = rho * (1.0 / memory.rows_per_slope[k] if way < 2 else 2.0 * np.pi / columns)
        n = 1
        while n * step < least:
            row = r + n if way == 0 else (r - n if way == 1 else r)
            column = c + n if way == 2 else (c - n if way == 3 else c)
            if not 0 <= row < rows:
                break
            here = abs(float(memory.cells[memory.offset[k] + (column % columns) * rows + row]))
            if here == 0.0 or here > units:
                least = n * step
                break
            n += 1
    return least


@kernel
def meet_surface(
    memory: Memory,
    k: int,
    a: Float64Array,
    b: Float64Array,
    length: float,
    worst_m: float,
    sketch: Float64Array,
    blocker: Float64Array,
) -> float:
    """Write where a blocked line meets scan k's surface; return by how much it misses the gap.

    The miss is measured at the mark that is most likely filled, `worst_m` from `a`, across the
    beam of the scan that saw the surface: the least shift up, down or sideways after which that
    scan saw farther, or saw nothing.
    """
    to_sensor(memory.sensor_from_scene[k], a, b, sketch[0], sketch[1])
    for axis in range(3):
        sketch[1, axis] /= length
    share = _crossing(memory, k, sketch, length, worst_m) / length
    for axis in range(3):
        blocker[axis] = a[axis] + share * (b[axis] - a[axis])
    return _miss(memory, k, sketch, worst_m)
