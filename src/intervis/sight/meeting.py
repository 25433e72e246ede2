"""Where a blocked line meets the surface, and by how much it would have to move to pass."""

import numpy as np

from intervis.arrays import Float64Array
from intervis.kernels import kernel
from intervis.sight.atlas import CARRIED, Memory, to_sensor
from intervis.sight.chart import TURN, Int16Array, turn_of

REACH_M = 1.5
"""The surface is looked for so far along the line, to either side of the mark it blocks."""
STEP_M = 0.1
FARTHEST_MISS_M = 10.0
"""A line that would have to move farther is said to miss by this much."""

# What is known of a chart beside its cells.
UNIT_M, COLUMNS, ROWS, SLOPE_FROM, ROWS_PER_SLOPE = range(5)


@kernel
def new_sketch() -> Float64Array:
    """Working memory: a line's first end and its direction in a sensor's frame, and a chart."""
    return np.empty((3, 5))


@kernel
def _place(chart: Float64Array, line: Float64Array, at_m: float) -> tuple[float, float, int]:
    """A place on the line in the chart: rho, row with its share of the next, column."""
    u = line[0, 0] + at_m * line[1, 0]
    v = line[0, 1] + at_m * line[1, 1]
    w = line[0, 2] + at_m * line[1, 2]
    rho = np.sqrt(u * u + v * v)
    columns = chart[COLUMNS]
    row = (w / rho - chart[SLOPE_FROM]) * chart[ROWS_PER_SLOPE]
    return rho, row, int(min(turn_of(u, v) * (columns / TURN), columns - 1.0))


@kernel
def _depth(cells: Int16Array, chart: Float64Array, line: Float64Array, at_m: float) -> float:
    """How deep a place on the line lies behind the surface; NaN where none was seen."""
    rho, f, column = _place(chart, line, at_m)
    rows = int(chart[ROWS])
    if not (0.0 <= f < rows - 1.0):
        return np.nan
    row = int(f)
    f -= row
    low = abs(float(cells[column * rows + row]))
    high = abs(float(cells[column * rows + row + 1]))
    surface = high if f >= 0.5 else low
    if surface == 0.0:
        return np.nan
    if abs(low - high) < CARRIED * min(low, high):
        surface = low + (high - low) * f
    return float(rho - surface * chart[UNIT_M])


@kernel
def _crossing(
    cells: Int16Array, chart: Float64Array, line: Float64Array, length: float, worst_m: float
) -> float:
    """Distance along the line to where it crosses the surface next to `worst_m`.

    `worst_m` itself where it does not.
    """
    here = _depth(cells, chart, line, worst_m)
    before = here  # towards the first end
    after = here  # towards the second one
    for n in range(1, int(REACH_M / STEP_M) + 1):
        low = worst_m - n * STEP_M
        high = worst_m + n * STEP_M
        if low >= 0.0:
            depth = _depth(cells, chart, line, low)
            if before * depth <= 0.0:
                return low + STEP_M * (depth / (depth - before) if depth != before else 0.0)
            before = depth
        if high <= length:
            depth = _depth(cells, chart, line, high)
            if after * depth <= 0.0:
                return high - STEP_M * (depth / (depth - after) if depth != after else 0.0)
            after = depth
    return worst_m


@kernel
def _miss(cells: Int16Array, chart: Float64Array, line: Float64Array, at_m: float) -> float:
    """Shortest way out from behind the surface: upwards, downwards or to either side."""
    rho, place, c = _place(chart, line, at_m)
    rows, columns = int(chart[ROWS]), int(chart[COLUMNS])
    if not (0.0 <= place + 0.5 < rows):
        return 0.0
    r = int(place + 0.5)
    least = FARTHEST_MISS_M
    units = rho / chart[UNIT_M]
    for way in range(4):
        step = rho * (1.0 / chart[ROWS_PER_SLOPE] if way < 2 else 2.0 * np.pi / columns)
        n = 1
        while n * step < least:
            row = r + n if way == 0 else (r - n if way == 1 else r)
            column = c + n if way == 2 else (c - n if way == 3 else c)
            if not 0 <= row < rows:
                break
            here = abs(float(cells[(column % columns) * rows + row]))
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
    line, chart = sketch[:2], sketch[2]
    to_sensor(memory.sensor_from_scene[k], a, b, line[0], line[1])
    for axis in range(3):
        line[1, axis] /= length
    chart[UNIT_M], chart[COLUMNS], chart[ROWS] = memory.unit_m[k], memory.columns[k], memory.rows[k]
    chart[SLOPE_FROM], chart[ROWS_PER_SLOPE] = memory.slope_from[k], memory.rows_per_slope[k]
    cells = memory.cells[memory.offset[k] :]
    share = _crossing(cells, chart, line, length, worst_m) / length
    for axis in range(3):
        blocker[axis] = a[axis] + share * (b[axis] - a[axis])
    return float(_miss(cells, chart, line, worst_m))
