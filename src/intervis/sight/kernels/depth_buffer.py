"""Kernels of the depth buffer: cells of points, nearest range of each cell, and what lies behind.

Each is one loop, so that the first two are vectorised; see the notes of the package.
"""

import numpy as np

from intervis.arrays import LARGEST_M, BoolArray, Float32Array, Float64Array, FloatArray, Int32Array
from intervis.kernels import kernel
from intervis.sight.kernels.projection import (
    FULL_CIRCLE,
    ZENITH,
    pseudo_azimuth,
    pseudo_elevation,
)


@kernel
def place_around(values: FloatArray, step: int, viewpoint: Float64Array, xyz: Float64Array) -> None:
    """Coordinates (3, N) around the viewpoint, of points that lie `step` values apart."""
    x, y, z = xyz[0], xyz[1], xyz[2]
    a, b, c = viewpoint[0], viewpoint[1], viewpoint[2]
    for i in range(len(x)):
        x[i] = values[i * step] - a
        y[i] = values[i * step + 1] - b
        z[i] = values[i * step + 2] - c


@kernel
def cells_of(
    xyz: Float64Array,
    viewpoint: Float64Array,
    columns: int,
    rows: int,
    cell: Int32Array,
    range_m: Float32Array,
) -> None:
    """Cell and range of points (3, N) around the viewpoint; range NaN for what is no return.

    Cells are equal steps of the pseudo-angles, numbered row by row. The origin of the points'
    frame is no return.
    """
    x, y, z = xyz[0], xyz[1], xyz[2]
    a, b, c = -viewpoint[0], -viewpoint[1], -viewpoint[2]
    columns_per_unit, rows_per_unit = columns / FULL_CIRCLE, rows / (2.0 * ZENITH)
    last_column, last_row, width = columns - 1.0, rows - 1.0, np.int32(columns)
    for i in range(len(x)):
        u, v, w = x[i], y[i], z[i]
        square = u * u + v * v
        rho = np.sqrt(square)
        r = np.sqrt(square + w * w)
        origin = (u == a) & (v == b) & (w == c)
        there = (r < LARGEST_M) & ~origin  # not for NaN
        column = min(pseudo_azimuth(u, v) * columns_per_unit, last_column)
        row = min((pseudo_elevation(rho, w) + ZENITH) * rows_per_unit, last_row)
        column = column if there else 0.0  # an integer of NaN would be an index out of bounds
        row = row if there else 0.0
        cell[i] = np.int32(row) * width + np.int32(column)
        range_m[i] = r if there else np.nan


@kernel
def draw_nearest(
    cell: Int32Array, range_m: Float32Array, from_m: float, nearest: Float32Array
) -> None:
    """Lower each cell to the smallest range of its points that are `from_m` or more away.

    Every point writes: a branch on whether it is nearer cannot be foreseen, and costs more.
    """
    for i in range(len(cell)):
        r, there = range_m[i], nearest[cell[i]]
        nearest[cell[i]] = r if (r < there) & (r >= from_m) else there


@kernel
def not_behind(
    cell: Int32Array,
    range_m: Float32Array,
    nearest: Float32Array,
    tolerance_m: float,
    kept_fraction: float,
    visible: BoolArray,
) -> None:
    """Which points are hardly farther than the nearest range of their cell, in any buffer (B, C).

    A point counts as `kept_fraction` of its range less the tolerance.
    """
    tolerance, kept = np.float32(tolerance_m), np.float32(kept_fraction)
    for i in range(len(cell)):
        visible[i] = range_m[i] * kept - tolerance <= nearest[0, cell[i]]
    for buffer in nearest[1:]:
        for i in range(len(cell)):
            visible[i] &= range_m[i] * kept - tolerance <= buffer[cell[i]]
