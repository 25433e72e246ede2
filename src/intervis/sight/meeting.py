"""Where a blocked line meets the surface, and by how much it would have to move to pass."""

import numpy as np

from intervis.arrays import Float64Array
from intervis.kernels import kernel
from intervis.sight.atlas import (
    COLUMNS,
    OFFSET,
    ROWS,
    ROWS_PER_SLOPE,
    SLOPE_FROM,
    UNIT_M,
    depth_at,
    to_sensor,
)
from intervis.sight.chart import TURN, Int16Array, turn_of

REACH_M = 1.5
"""The surface is looked for so far along the line, to either side of the mark it blocks."""
STEP_M = 0.1
FARTHEST_MISS_M = 10.0
"""A line that would have to move farther is said to miss by this much."""


@kernel
def _crossing(
    cells: Int16Array, chart: Float64Array, line: Float64Array, length: float, worst_m: float
) -> float:
    """Distance along the line to where it crosses the surface next to `worst_m`.

    `worst_m` itself where it does not.
    """
    x, y, z = line[0, 0], line[0, 1], line[0, 2]
    dx, dy, dz = line[1, 0], line[1, 1], line[1, 2]
    crossing, n = np.nan, 1
    before = depth_at(cells, chart, x + worst_m * dx, y + worst_m * dy, z + worst_m * dz)
    after = before  # towards the second end; `before`, towards the first one
    while np.isnan(crossing) and n <= int(REACH_M / STEP_M):
        low, high = worst_m - n * STEP_M, worst_m + n * STEP_M
        if low >= 0.0:
            depth = depth_at(cells, chart, x + low * dx, y + low * dy, z + low * dz)
            if before * depth <= 0.0:
                crossing = low + STEP_M * (depth / (depth - before) if depth != before else 0.0)
            before = depth
        if high <= length and np.isnan(crossing):
            depth = depth_at(cells, chart, x + high * dx, y + high * dy, z + high * dz)
            if after * depth <= 0.0:
                crossing = high - STEP_M * (depth / (depth - after) if depth != after else 0.0)
            after = depth
        n += 1
    return worst_m if np.isnan(crossing) else crossing


@kernel
def _miss(cells: Int16Array, chart: Float64Array, line: Float64Array, at_m: float) -> float:
    """Shortest way out from behind the surface: upwards, downwards or to either side."""
    u = line[0, 0] + at_m * line[1, 0]
    v = line[0, 1] + at_m * line[1, 1]
    w = line[0, 2] + at_m * line[1, 2]
    rho = np.sqrt(u * u + v * v)
    rows, columns, at = int(chart[ROWS]), int(chart[COLUMNS]), int(chart[OFFSET])
    place = (w / rho - chart[SLOPE_FROM]) * chart[ROWS_PER_SLOPE]
    c = int(min(turn_of(u, v) * (chart[COLUMNS] / TURN), chart[COLUMNS] - 1.0))
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
            if not 0 <= column < columns:  # a division at each step would take most of the time
                column %= columns
            here = abs(float(cells[at + column * rows + row]))
            if here == 0.0 or here > units:
                least = n * step
                break
            n += 1
    return least


@kernel
def meet_surface(
    cells: Int16Array,
    chart: Float64Array,
    a: Float64Array,
    b: Float64Array,
    length: float,
    worst_m: float,
    line: Float64Array,
    blocker: Float64Array,
) -> float:
    """Write where a blocked line meets a scan's surface; return by how much it misses the gap.

    The miss is measured at the mark that is most likely filled, `worst_m` from `a`, across the
    beam of the scan that saw the surface: the least shift up, down or sideways after which that
    scan saw farther, or saw nothing. `chart` is that scan's row of the atlas's index, `line`
    (2, 3) working memory: the line's first end and its direction in the sensor's frame.
    """
    to_sensor(chart, a, b, line[0], line[1])
    for axis in range(3):
        line[1, axis] /= length
    share = _crossing(cells, chart, line, length, worst_m) / length
    for axis in range(3):
        blocker[axis] = a[axis] + share * (b[axis] - a[axis])
    return float(_miss(cells, chart, line, worst_m))
