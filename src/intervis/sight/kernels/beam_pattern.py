"""How far apart the beams of a scan are, measured between neighbouring returns."""

import numpy as np

from intervis.arrays import Float64Array, IntArray
from intervis.kernels import kernel
from intervis.sight.kernels.projection import FULL_CIRCLE

CONE = 0.5
"""A neighbour in azimuth is off in elevation by at most this fraction of its distance, and vice
versa."""
SAME_RAD = 1e-6
"""Directions closer than this are one beam whose return was sent twice."""


@kernel
def direction_scale(pseudo_elevation: float) -> tuple[float, float]:
    """Radians of azimuth across the beam, and of elevation, per unit of the pseudo-angles."""
    e = abs(pseudo_elevation)
    m = e if e <= 1.0 else 2.0 - e
    norm = np.sqrt(1.0 + m * m)
    cos_elevation = 1.0 / norm if e <= 1.0 else m / norm
    return cos_elevation * 2.0 * np.pi / FULL_CIRCLE, 1.0 / (norm * norm)


@kernel
def neighbour_angles(
    azimuth: Float64Array,
    elevation: Float64Array,
    order: IntArray,
    start: IntArray,
    columns: int,
    rows: int,
    picked: IntArray,
    beside: Float64Array,
    above: Float64Array,
    solid_angle: Float64Array,
) -> None:
    """Angles from picked returns to their nearest neighbours beside and above, radians.

    `solid_angle` becomes the mean solid angle of one return around the picked one, steradians.

    `order` lists the returns by cell, row by row of a grid of `rows` x `columns` cells over the
    pseudo-angles; those of cell k start at `start[k]`. Only the 3 x 3 cells around a return are
    searched. NaN: no neighbour there.
    """
    for n in range(len(picked)):
        i = picked[n]
        beside[n], above[n] = np.nan, np.nan
        per_azimuth, per_elevation = direction_scale(elevation[i])
        c, r = cell_of(azimuth[i], elevation[i], columns, rows)
        around = 0
        for row in range(max(r - 1, 0), min(r + 2, rows)):
            for shift in range(-1, 2):
                cell = row * columns + (c + shift) % columns
                around += start[cell + 1] - start[cell]
                for m in range(start[cell], start[cell + 1]):
                    j = order[m]
                    turn = abs(azimuth[i] - azimuth[j])
                    across = min(turn, FULL_CIRCLE - turn) * per_azimuth
                    up = abs(elevation[i] - elevation[j]) * per_elevation
                    angle = np.sqrt(across * across + up * up)
                    if angle < SAME_RAD:
                        continue
                    if up <= CONE * across and not beside[n] <= angle:
                        beside[n] = angle
                    if across <= CONE * up and not above[n] <= angle:
                        above[n] = angle
        cells = 9.0 * (per_azimuth * FULL_CIRCLE / columns) * (per_elevation * 4.0 / rows)
        solid_angle[n] = cells / around


@kernel
def cell_of(azimuth: float, elevation: float, columns: int, rows: int) -> tuple[int, int]:
    """Column and row of the grid of `neighbour_angles`."""
    column = min(int(azimuth / FULL_CIRCLE * columns), columns - 1)
    return column, min(max(int((elevation + 2.0) / 4.0 * rows), 0), rows - 1)


@kernel
def cells_of(
    azimuth: Float64Array, elevation: Float64Array, columns: int, rows: int, cells: IntArray
) -> None:
    """Cell of each return in the grid of `neighbour_angles`."""
    for i in range(len(azimuth)):
        column, row = cell_of(azimuth[i], elevation[i], columns, rows)
        cells[i] = row * columns + column
