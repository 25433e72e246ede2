"""A grid of voxels: corner, cell and shape, indices and centres, and a bound on its size."""

from __future__ import annotations  # help() shows the names of the array types

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from intervis.arguments import is_count, shown
from intervis.arrays import (
    BoolArray,
    Float64Array,
    FloatArray,
    IntArray,
    checked_point,
    numbers_of,
)
from intervis.errors import PointsError, SettingsError
from intervis.sight.query_checks import positive_length

MOST_VOXELS = 40_000_000
LEAST_CELL_M, FARTHEST_M = 1e-3, 1e7

BYTES_PER_VOXEL = 24
"""Memory that a voxel takes while a grid is carved."""


@dataclass(frozen=True, eq=False)
class VoxelGrid:
    """Cubes of space; voxel [i, j, k] reaches from corner + cell_m (i, j, k) to the next one.

    Attributes
    ----------
    corner : (3,) float64 array
        Smallest x, y and z, metres.
    cell_m : float
        Edge of a voxel.
    shape : three ints
        Voxels along x, y and z.

    Raises
    ------
    SettingsError
        A length is not positive, the cell is below 1 mm, the corner beyond 10,000 km, a count is
        not a whole positive number, or there are more than `MOST_VOXELS` voxels.

    Examples
    --------
    >>> grid = VoxelGrid([0.0, -25.6, -2.0], 0.2, (256, 256, 32))
    >>> grid.index_of(np.array([[5.01, 0.0, -1.99], [-0.1, 0.0, 0.0]]))
    (array([[ 25, 128,   0],
           [ -1, 128,  10]]), array([ True, False]))
    >>> grid.centre_of([25, 128, 0]).round(1)
    array([ 5.1,  0.1, -1.9])
    """

    corner: Float64Array
    cell_m: float
    shape: tuple[int, int, int]

    def __init__(self, corner: ArrayLike, cell_m: float, shape: ArrayLike) -> None:
        object.__setattr__(self, "corner", checked_point(corner, "corner"))
        object.__setattr__(self, "cell_m", positive_length("cell_m", cell_m))
        if self.cell_m < LEAST_CELL_M or np.abs(self.corner).max() > FARTHEST_M:
            raise SettingsError(
                f"voxels are {LEAST_CELL_M:g} m or larger, and the corner of a grid lies within"
                f" {FARTHEST_M:g} m, got {self.cell_m:g} and {self.corner.tolist()}."
            )
        counts = _items(shape)
        if len(counts) != 3 or not all(is_count(count) for count in counts):
            raise SettingsError(
                f"shape must be three whole numbers of 1 or more, got {shown(shape)}."
            )
        if max(counts) > MOST_VOXELS:
            raise SettingsError(
                f"a grid has at most {MOST_VOXELS:,} voxels, got shape {shown(shape)}: choose"
                " larger voxels or a smaller space."
            )
        object.__setattr__(self, "shape", tuple(int(count) for count in counts))
        if self.size > MOST_VOXELS:
            raise SettingsError(
                f"{' x '.join(f'{count:,}' for count in self.shape)} voxels are"
                f" {self.size:,}, which would take {self.size * BYTES_PER_VOXEL / 1e9:,.1f} GB; at"
                f" most {MOST_VOXELS:,} are carved: choose larger voxels or a smaller space."
            )

    @property
    def size(self) -> int:
        """Number of voxels."""
        i, j, k = self.shape
        return i * j * k

    @property
    def upper(self) -> Float64Array:
        """(3,) largest x, y and z, metres."""
        return np.asarray(self.corner + self.cell_m * np.array(self.shape))

    def index_of(self, points: FloatArray) -> tuple[IntArray, BoolArray]:
        """Voxels (N, 3) of points (N, 3), and which of them lie in the grid; NaN lies outside."""
        given = numbers_of(points, "points")
        if given.ndim != 2 or given.shape[1] != 3:
            raise PointsError(f"points must have the shape (N, 3), got {given.shape}.")
        with np.errstate(over="ignore"):
            index = np.floor((given - self.corner) / self.cell_m)
        index[np.isnan(index)] = -1.0
        inside = ((index >= 0) & (index < self.shape)).all(axis=1)
        return np.clip(index, -1, max(self.shape)).astype(np.int64), np.asarray(inside)

    def centre_of(self, index: ArrayLike) -> Float64Array:
        """Centres (..., 3) of voxels (..., 3), metres."""
        given = numbers_of(index, "index")
        if given.shape[-1:] != (3,):
            raise PointsError(f"index must have the shape (..., 3), got {given.shape}.")
        with np.errstate(over="ignore"):
            return np.asarray(self.corner + (given + 0.5) * self.cell_m)

    def occupied_by(self, points: FloatArray) -> BoolArray:
        """Voxels (I, J, K) that hold at least one of the finite points (N, 3)."""
        index, inside = self.index_of(points)
        occupied = np.zeros(self.shape, np.bool_)
        occupied[tuple(index[inside].T)] = True
        return occupied


def _items(shape: Any) -> list[Any]:
    """The counts of a shape; none where it has no order."""
    is_row = isinstance(shape, np.ndarray) and shape.ndim == 1
    return list(shape) if is_row or isinstance(shape, list | tuple) else []
