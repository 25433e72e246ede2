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
def _depth(cells: Int16Array, chart: Float64Array, line: Float64Array, at_m: float) -> float:
    """How deep a place on the line lies behind the surface; NaN where none was seen."""
    return depth_at(
        cells,
        chart,
        line[0, 0] + at_m * line[1, 0],
        line[0, 1] + at_m * line[1, 1],
        line[0, 2] + at_m * line[1, 2],
    )


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
    u = line[0, 0] + at_m * line[1, 0]
    v = line[0, 1] + at_m * line[1, 1]
    w = line[0, 2] + at_m * line[1, 2]
    rho = np.sqrt(u * u + v * v)
    rows, columns = int(chart[ROWS]), int(chart[COLUMNS])
    place = (w / rho - chart[SLOPE_FROM]) * chart[ROWS_PER_SLOPE]
    c = int(min(turn_of(u, v) * (chart[COLUMNS] / TURN), chart[COLUMNS] - 1.0))
    at = int(chart[OFFSET])
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
            here = abs(float(cells[at + (column % columns) * rows + row]))
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
