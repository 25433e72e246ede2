"""A depth buffer: which points of a whole scan a viewpoint sees, in a millisecond and roughly.

The directions around the viewpoint are divided into cells. A point is called visible unless another
point of its cell is clearly nearer.

A scan of N points costs: its 12 N or 16 N bytes read; 8 N bytes of cells and ranges written once
and read twice; about 40 operations a point with two roots and two divisions, which are vectorised;
a look-up in the buffer to draw each point and one to compare it. The buffer has 1.3 MB with cells
of half a degree. Coordinates around the viewpoint are kept for a block of points only, which the
cache of a core holds. Each thread draws its points into a buffer of its own, so no write is atomic;
the comparison reads all buffers.
"""

from __future__ import annotations  # help() then shows ArrayLike by its name

from math import ceil, radians
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from intervis.arrays import (
    BoolArray,
    Float32Array,
    Float64Array,
    FloatArray,
    Int32Array,
    array_of,
    checked_point,
    checked_points,
)
from intervis.errors import SettingsError
from intervis.kernels import in_parts, thread_count
from intervis.sight.kernels.depth_buffer import cells_of, draw_nearest, not_behind, place_around
from intervis.sight.kernels.projection import ZENITH
from intervis.sight.occupancy_model import END_MARGIN_M
from intervis.sight.query_checks import finite_number

CELL_RANGE_DEG = (0.05, 10.0)
"""Sizes of a cell: a buffer of the finest cells has 132 MB."""

MOST_BUFFERS = 4
"""Buffers, and so threads: more would cost more to clear and to compare than they save."""

LEAST_POINTS = 250_000
"""Of a thread: fewer take a millisecond, and waking a thread twice on a busy machine takes longer.
A scan of usual size is done by the thread that asks."""

BLOCK = 32_768
"""Points whose coordinates are kept at a time."""


def visible_mask(
    points: ArrayLike,
    viewpoint: ArrayLike,
    *,
    cell_deg: float = 0.5,
    tolerance_m: float = 1.0,
    tolerance_fraction: float = 0.02,
) -> BoolArray:
    """Which points of a scan a viewpoint sees, by a depth buffer: fast and rough.

    A point is visible unless another point in its direction is nearer by more than ``tolerance_m +
    tolerance_fraction * range``. Directions are told apart by cells. Points within 0.4 m of the
    viewpoint hide nothing, as in a `Scene`.

    It is for masks of many scans or viewpoints where a share of wrong answers does not matter: to
    thin a map, to choose viewpoints, to draw. Use `Scene` for everything else: it knows surfaces
    between the returns, free space and what was never observed, and gives probabilities for a
    stated risk. What the mask gets wrong:

    - There is no "unknown". Where no return lies in front, also because no beam came there, a point
      is called visible.
    - Surfaces have holes. Where the viewpoint is much nearer to a surface than the scanner was, the
      returns on it lie more than a cell apart, and what is behind shows through. Larger cells close
      the holes.
    - Surfaces at a grazing angle hide themselves: on a road that is seen from low above, a cell
      holds returns many metres apart, and the far ones are called hidden. Smaller cells and more
      tolerance mend that.
    - Edges are a cell wide, and objects are hidden from `tolerance_m` behind a surface on only.

    Parameters
    ----------
    points : (N, 3) or (N, 4) float array
        Scan or map, metres, z up. A fourth column is ignored.
    viewpoint : (3,) array
        In the frame of the points, metres.
    cell_deg : float
        Size of a cell in azimuth, and in elevation at the horizon, degrees, 0.05 to 10. Rows are
        equal steps of the tangent of the elevation: at 45 degrees cells are half as high. Azimuths
        are divided evenly but for a few percent.
    tolerance_m, tolerance_fraction : float
        What must lie between two points of a cell: metres, 0 or more, and a fraction of the farther
        one's range, 0 or more and less than 1.

    Returns
    -------
    (N,) bool array
        Rows that are no return (not finite, 0, 0, 0, or beyond 1e9 m) are not visible, and hide
        nothing.

    Raises
    ------
    PointsError
        `points` or `viewpoint` are malformed.
    SettingsError
        A number is out of range.

    Examples
    --------
    A wall 5 m ahead hides a post behind it, and not one beside it:

    >>> y, z = np.meshgrid(np.arange(-2, 2, 0.02), np.arange(-1, 1, 0.02))
    >>> wall = np.stack([np.full(y.size, 5.0), y.ravel(), z.ravel()], axis=1)
    >>> seen = visible_mask(np.vstack([wall, [[9.0, 0.5, 0.1], [9.0, 6.0, 0.1]]]), [0, 0, 0])
    >>> bool(seen[:-2].all()), seen[-2:].tolist()
    (True, [False, True])
    """
    values, step, count = _rows(points)
    origin = checked_point(viewpoint)
    columns, rows = _shape(cell_deg)
    tolerance_m, kept = _tolerances(tolerance_m, tolerance_fraction)
    buffers = max(1, min(thread_count(), MOST_BUFFERS, count // LEAST_POINTS))
    cell, range_m, nearest, xyz = _memory(count, buffers, columns * rows)
    visible = np.empty(count, np.bool_)
    bounds = [count * part // buffers for part in range(buffers + 1)]

    def draw(first: int, last: int) -> None:
        for part in range(first, last):
            nearest[part] = np.inf
            for start in range(bounds[part], bounds[part + 1], BLOCK):
                own = slice(start, min(start + BLOCK, bounds[part + 1]))
                # Kernels are vectorised for rows that lie side by side: no cut through all three.
                around = xyz[part, : 3 * (own.stop - start)].reshape(3, -1)
                place_around(values[start * step :], step, origin, around)
                cells_of(around, origin, columns, rows, cell[own], range_m[own])
                draw_nearest(cell[own], range_m[own], END_MARGIN_M, nearest[part])

    def compare(first: int, last: int) -> None:
        own = slice(bounds[first], bounds[last])
        not_behind(cell[own], range_m[own], nearest, tolerance_m, kept, visible[own])

    in_parts(draw, buffers, least=1)
    in_parts(compare, buffers, least=1)
    return visible


def _rows(points: ArrayLike) -> tuple[FloatArray, int, int]:
    """The values of a point array in a row, how many a point has, and the number of points."""
    array = array_of(points, "points")
    if array.size == 0 and array.ndim <= 2:
        return np.empty(0), 3, 0
    checked_points(points if hasattr(points, "points") else array)
    # Kernels are compiled for writable and contiguous arrays; others are copied.
    row = np.require(array, requirements=["C", "W"]).reshape(-1)
    return row, array.shape[1], len(array)


def _shape(cell_deg: Any) -> tuple[int, int]:
    """Columns and rows of the buffer."""
    least, most = CELL_RANGE_DEG
    if not least <= finite_number("cell_deg", cell_deg, "degrees") <= most:
        raise SettingsError(f"cell_deg must be from {least} to {most:g} degrees, got {cell_deg!r}.")
    size_deg = float(cell_deg)
    return ceil(360.0 / size_deg), ceil(2.0 * ZENITH / radians(size_deg))


def _tolerances(tolerance_m: Any, fraction: Any) -> tuple[float, float]:
    """The tolerance in metres, and the part of a range that is not tolerance."""
    if finite_number("tolerance_m", tolerance_m, "metres") < 0.0:
        raise SettingsError(f"tolerance_m must be 0 metres or more, got {tolerance_m!r}.")
    if not 0.0 <= finite_number("tolerance_fraction", fraction, "0 to 1") < 1.0:
        raise SettingsError(
            f"tolerance_fraction must be 0 or more and less than 1, got {fraction!r}."
        )
    return float(tolerance_m), 1.0 - float(fraction)


def _memory(
    count: int, buffers: int, cells: int
) -> tuple[Int32Array, Float32Array, Float32Array, Float64Array]:
    """Cells (N,), ranges (N,), buffers (B, C), and coordinates of a block for each (B, 3 K).

    One piece of memory, which the C library keeps for the next call: fresh pages would cost more
    than all that is done here.
    """
    sizes = [24 * BLOCK * buffers, 4 * count, 4 * count, 4 * buffers * cells]
    xyz, cell, range_m, nearest = np.split(np.empty(sum(sizes), np.uint8), np.cumsum(sizes[:-1]))
    return (
        cell.view(np.int32),
        range_m.view(np.float32),
        nearest.view(np.float32).reshape(buffers, cells),
        xyz.view(np.float64).reshape(buffers, 3 * BLOCK),
    )
