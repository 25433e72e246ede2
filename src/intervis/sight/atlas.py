"""The charts of many scans side by side, as kernels read them, and which of them have a say."""

from typing import NamedTuple

import numpy as np

from intervis.arrays import Float32Array, Float64Array, IntArray
from intervis.kernels import kernel
from intervis.sight.chart import TURN, Int16Array, turn_of

NEAR_M = 0.5
"""Scans whose distances to a line's ends differ by less than this are ranked newest first."""
CARRIED = 0.1
"""Between two rows the surface is interpolated where rho differs by less than this share."""

# Columns of an atlas's index, which tells of each scan what kernels ask for again and again: its
# chart, and the rows of sensor_from_scene, one after another.
UNIT_M, OFFSET, COLUMNS, ROWS, SLOPE_FROM, ROWS_PER_SLOPE, FROM_SCENE = range(7)


class Memory(NamedTuple):
    """Charts of S scans, oldest first, laid out for kernels.

    `cells` holds each scan's chart, column after column, from `offset` on; `sensor_from_scene` is
    (S, 3, 4); `position` (S, 3) are the sensors' places in the scene; `ground` is (S, G, G);
    `age_m` is how much farther away each scan counts for having been taken at another time, and
    `later_s` how long after the moment asked about: 0 and NaN where none is asked about.
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
    age_m: Float64Array
    later_s: Float64Array


@kernel
def index_of(memory: Memory) -> Float64Array:
    """The index (S, 18) of an atlas: see the names of its columns above.

    A kernel is handed all arrays of a `Memory` one by one, which takes longer than to look up a
    mark: what is called for each mark or line takes this in its place.
    """
    index = np.empty((len(memory.offset), FROM_SCENE + 12))
    for k in range(len(index)):
        index[k, UNIT_M], index[k, OFFSET] = memory.unit_m[k], memory.offset[k]
        index[k, COLUMNS], index[k, ROWS] = memory.columns[k], memory.rows[k]
        index[k, SLOPE_FROM] = memory.slope_from[k]
        index[k, ROWS_PER_SLOPE] = memory.rows_per_slope[k]
        for axis in range(3):
            for n in range(4):
                index[k, FROM_SCENE + 4 * axis + n] = memory.sensor_from_scene[k, axis, n]
    return index


@kernel
def choose_scans(
    position: Float64Array,
    age_m: Float64Array,
    first: Float64Array,
    second: Float64Array,
    chosen: IntArray,
    away: Float64Array,
    rank: Float64Array,
) -> None:
    """The scans with a say about each line, nearest first, newest first among equals.

    Lines of one viewpoint mostly choose alike: a line whose distances are those of the one before
    takes its choice over. `away` (S,) and `rank` are working memory.
    """
    away[:] = np.nan
    for i in range(len(first)):
        a0, a1, a2 = first[i, 0], first[i, 1], first[i, 2]
        b0, b1, b2 = second[i, 0], second[i, 1], second[i, 2]
        changes = 0
        for k in range(len(away)):
            x, y, z = position[k, 0], position[k, 1], position[k, 2]
            to_a = (a0 - x) ** 2 + (a1 - y) ** 2 + (a2 - z) ** 2
            to_b = (b0 - x) ** 2 + (b1 - y) ** 2 + (b2 - z) ** 2
            steps = np.floor((np.sqrt(min(to_a, to_b)) + age_m[k]) / NEAR_M)
            changes += 1 if steps != away[k] else 0
            away[k] = steps
        if changes == 0:
            for n in range(chosen.shape[1]):
                chosen[i, n] = chosen[i - 1, n]
            continue
        count = 0
        for k in range(len(away) - 1, -1, -1):
            if count < chosen.shape[1]:
                count += 1
            elif not away[k] < rank[count - 1]:
                continue
            at = count - 1
            while at > 0 and rank[at - 1] > away[k]:
                rank[at] = rank[at - 1]
                chosen[i, at] = chosen[i, at - 1]
                at -= 1
            rank[at] = away[k]
            chosen[i, at] = k


@kernel
def to_sensor(
    chart: Float64Array, a: Float64Array, b: Float64Array, start: Float64Array, along: Float64Array
) -> None:
    """A line's first end, and the way from there to the second one, in a sensor's frame."""
    x, y, z = a[0], a[1], a[2]
    dx, dy, dz = b[0] - x, b[1] - y, b[2] - z
    for axis in range(3):
        g = chart[FROM_SCENE + 4 * axis : FROM_SCENE + 4 * axis + 4]
        start[axis] = g[0] * x + g[1] * y + g[2] * z + g[3]
        along[axis] = g[0] * dx + g[1] * dy + g[2] * dz


@kernel
def depth_at(cells: Int16Array, chart: Float64Array, x: float, y: float, z: float) -> float:
    """How deep a place in a scan's own frame lies behind its surface; NaN where it saw none.

    `cells` are those of all scans, `chart` is the scan's row of the index.
    """
    rho = np.sqrt(x * x + y * y)
    f = (z / rho - chart[SLOPE_FROM]) * chart[ROWS_PER_SLOPE]
    rows = chart[ROWS]
    if not (0.0 <= f < rows - 1.0):
        return np.nan
    row = int(f)
    f -= row
    columns = chart[COLUMNS]
    column = int(min(turn_of(x, y) * (columns / TURN), columns - 1.0))
    at = int(chart[OFFSET]) + column * int(rows) + row
    low, high = abs(float(cells[at])), abs(float(cells[at + 1]))
    surface = high if f >= 0.5 else low
    if surface == 0.0:
        return np.nan
    if abs(low - high) < CARRIED * min(low, high):
        surface = low + (high - low) * f
    return float(rho - surface * chart[UNIT_M])
