"""Rays against known triangles: what is hit first, and is anything in between."""

from collections.abc import Sequence
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from intervis.arrays import BoolArray, Float64Array, IntArray
from intervis.errors import PointsError
from intervis.kernels import in_parts
from intervis.lab.worlds import bvh


def _rows(array: ArrayLike, name: str) -> Float64Array:
    rows = np.ascontiguousarray(np.atleast_2d(np.asarray(array, dtype=np.float64)))
    if rows.ndim != 2 or rows.shape[1] != 3:
        raise PointsError(f"{name} must have the shape (3,) or (R, 3), got {np.shape(array)}.")
    return rows


def _paired(first: Float64Array, second: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Two lists of points of the same length; a list of one is repeated."""
    try:
        first, second = np.broadcast_arrays(first, second)
    except ValueError:
        raise PointsError(
            f"{len(first)} and {len(second)} points cannot be paired:"
            " give as many of the one as of the other, or a single one."
        ) from None
    return np.ascontiguousarray(first), np.ascontiguousarray(second)


class RayCaster:
    """Casts rays at one or several soups of triangles, indexed as if they were joined.

    Parameters
    ----------
    triangles : (T, 3, 3) float array
        Corners in metres; degenerate triangles are allowed and never hit.

    Raises
    ------
    PointsError
        Wrong shape, or corners that are not finite.

    Examples
    --------
    >>> wall = np.array([[[5.0, -9, -9], [5, 9, -9], [5, 0, 9]]])
    >>> RayCaster(wall).closest([0.0, 0, 0], [[1.0, 0, 0], [0, 1, 0]])
    (array([ 5., inf]), array([ 0, -1]))
    >>> RayCaster(wall).blocked([0.0, 0, 0], [[4.0, 0, 0], [6, 0, 0]])
    array([False,  True])
    """

    def __init__(self, triangles: ArrayLike) -> None:
        corners = np.ascontiguousarray(triangles, dtype=np.float64)
        if corners.ndim != 3 or corners.shape[1:] != (3, 3):
            raise PointsError(f"triangles must have the shape (T, 3, 3), got {corners.shape}.")
        if not np.isfinite(corners).all():
            raise PointsError("triangles must have finite corners.")
        self._trees = [bvh.built(corners)] if len(corners) else []
        self.triangle_count = len(corners)

    @classmethod
    def joined(cls, casters: "Sequence[RayCaster]") -> "RayCaster":
        """One caster over several, without building anything anew."""
        whole = cls(np.empty((0, 3, 3)))
        for caster in casters:
            whole._trees += caster._trees
            whole.triangle_count += caster.triangle_count
        return whole

    def closest(
        self, origins: ArrayLike, directions: ArrayLike, farthest: float = np.inf
    ) -> tuple[Float64Array, IntArray]:
        """What each ray meets first.

        Parameters
        ----------
        origins, directions : (R, 3) or (3,) arrays
            Metres; directions need not be of unit length.
        farthest : float
            Where to stop looking, in lengths of the direction.

        Returns
        -------
        ranges : (R,) float64 array
            Lengths of the direction (metres for unit directions), infinity where nothing is hit.
        hits : (R,) int64 array
            Index of the triangle, -1 where nothing is hit.
        """
        starts, ways = _paired(_rows(origins, "origins"), _rows(directions, "directions"))
        ranges = np.full(len(starts), float(farthest))
        hits = np.full(len(starts), -1, np.int64)
        shift = 0
        for tree in self._trees:
            work = partial(bvh.closest, *tree, starts, ways, shift, ranges, hits)
            in_parts(work, len(starts))
            shift += len(tree[-1])
        ranges[hits < 0] = np.inf
        return ranges, hits

    def blocked(self, first: ArrayLike, second: ArrayLike, margin_m: float = 0.0) -> BoolArray:
        """Does any triangle cross the segment between two points.

        Parameters
        ----------
        first, second : (R, 3) or (3,) arrays
            Metres.
        margin_m : float
            Crossings nearer than this to either end do not count: the ends may lie on surfaces.

        Returns
        -------
        (R,) bool array
        """
        starts, ends = _paired(_rows(first, "first"), _rows(second, "second"))
        ways = ends - starts
        lengths = np.linalg.norm(ways, axis=1)
        ways /= np.where(lengths > 0, lengths, 1.0)[:, None]
        nearest, farthest = np.full(len(starts), float(margin_m)), lengths - margin_m
        out = np.zeros(len(starts), np.bool_)
        for boxes, links, corners, _ in self._trees:
            tree = boxes, links, corners
            in_parts(partial(bvh.blocked, *tree, starts, ways, nearest, farthest, out), len(starts))
        return out
