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
def choose_scans(
    memory: Memory, a: Float64Array, b: Float64Array, chosen: IntArray, rank: Float64Array
) -> None:
    """The scans with a say about one line, nearest first, newest first among equals."""
    position = memory.position
    count = 0
    for k in range(len(position) - 1, -1, -1):
        to_a = 0.0
        to_b = 0.0
        for axis in range(3):
            to_a += (a[axis] - position[k, axis]) ** 2
            to_b += (b[axis] - position[k, axis]) ** 2
        away = np.floor((np.sqrt(min(to_a, to_b)) + memory.age_m[k]) / NEAR_M)
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


@kernel
def to_sensor(
    g: Float64Array, a: Float64Array, b: Float64Array, start: Float64Array, along: Float64Array
) -> None:
    """A line's first end, and the way from there to the second one, in a sensor's frame."""
    x, y, z = a[0], a[1], a[2]
    dx, dy, dz = b[0] - x, b[1] - y, b[2] - z
    for axis in range(3):
        start[axis] = g[axis, 0] * x + g[axis, 1] * y + g[axis, 2] * z + g[axis, 3]
        along[axis] = g[axis, 0] * dx + g[axis, 1] * dy + g[axis, 2] * dz


@kernel
def depth_at(memory: Memory, k: int, x: float, y: float, z: float) -> float:
    """How deep a place in scan k's own frame lies behind its surface; NaN where it saw none."""
    rho = np.sqrt(x * x + y * y)
    f = (z / rho - memory.slope_from[k]) * memory.rows_per_slope[k]
    rows = memory.rows[k]
    if not (0.0 <= f < rows - 1.0):
        return np.nan
    row = int(f)
    f -= row
    columns = memory.columns[k]
    column = min(int(turn_of(x, y) * (columns / TURN)), columns - 1)
    at = memory.offset[k] + column * rows + row
    low, high = abs(float(memory.cells[at])), abs(float(memory.cells[at + 1]))
    surface = high if f >= 0.5 else low
    if surface == 0.0:
        return np.nan
    if abs(low - high) < CARRIED * min(low, high):
        surface = low + (high - low) * f
    return float(rho - surface * memory.unit_m[k])
