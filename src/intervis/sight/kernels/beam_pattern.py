"""How far apart the beams of a scan are, measured between neighbouring returns."""

import numpy as np

from intervis.arrays import Float64Array, Int32Array, IntArray
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
def list_by_cell(
    azimuth: Float64Array,
    elevation: Float64Array,
    hits: IntArray,
    picked: IntArray,
    columns: int,
    rows: int,
) -> tuple[Int32Array, Int32Array]:
    """Lists of the returns `hits` in each cell of 3 x 3 around a picked return.

    The cells are those of a grid of `rows` x `columns` over the pseudo-angles, row by row. Returns
    the first return of each cell's list, -1 if it is empty, -2 if the cell is around no picked
    return; and the return that follows each return, -1 after the last.
    """
    first = np.full(rows * columns, -2, np.int32)
    for i in picked:
        c, r = cell_of(azimuth[i], elevation[i], columns, rows)
        for row in range(max(r - 1, 0), min(r + 2, rows)):
            for shift in range(-1, 2):
                first[row * columns + (c + shift) % columns] = -1
    cells = np.empty(len(azimuth), np.int32)
    for i in range(len(azimuth)):
        c, r = cell_of(azimuth[i], elevation[i], columns, rows)
        cells[i] = r * columns + c
    following = np.empty(len(azimuth), np.int32)
    for i in hits:
        if first[cells[i]] != -2:
            following[i] = first[cells[i]]
            first[cells[i]] = i
    return first, following


@kernel
def neighbour_angles(
    azimuth: Float64Array,
    elevation: Float64Array,
    first: Int32Array,
    following: Int32Array,
    columns: int,
    rows: int,
    picked: IntArray,
    beside: Float64Array,
    above: Float64Array,
    solid_angle: Float64Array,
) -> None:
    """Angles from picked returns to their nearest neighbours beside and above, radians.

    `solid_angle` becomes the mean solid angle of one return around the picked one, steradians.

    `first` and `following` are those of `list_by_cell`. Only the 3 x 3 cells around a return are
    searched. Infinite: no neighbour there.
    """
    for n in range(len(picked)):
        i = picked[n]
        least_beside, least_above = np.inf, np.inf
        per_azimuth, per_elevation = direction_scale(elevation[i])
        c, r = cell_of(azimuth[i], elevation[i], columns, rows)
        around = 0
        for row in range(max(r - 1, 0), min(r + 2, rows)):
            for shift in range(-1, 2):
                j = first[row * columns + (c + shift) % columns]
                while j >= 0:
                    around += 1
                    turn = abs(azimuth[i] - azimuth[j])
                    across = min(turn, FULL_CIRCLE - turn) * per_azimuth
                    up = abs(elevation[i] - elevation[j]) * per_elevation
                    angle = np.sqrt(across * across + up * up)
                    angle = angle if angle >= SAME_RAD else np.inf
                    least_beside = min(least_beside, angle if up <= CONE * across else np.inf)
                    least_above = min(least_above, angle if across <= CONE * up else np.inf)
                    j = following[j]
        beside[n], above[n] = least_beside, least_above
        cells = 9.0 * (per_azimuth * FULL_CIRCLE / columns) * (per_elevation * 4.0 / rows)
        solid_angle[n] = cells / around


@kernel
def cell_of(azimuth: float, elevation: float, columns: int, rows: int) -> tuple[int, int]:
    """Column and row of the grid of `neighbour_angles`."""
    column = min(int(azimuth / FULL_CIRCLE * columns), columns - 1)
    return column, min(max(int((elevation + 2.0) / 4.0 * rows), 0), rows - 1)
