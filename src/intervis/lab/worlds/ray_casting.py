"""Ray casting at known triangles: the first hit of each ray, and blocked segments.

Embree (the package ``embreex``) finds the triangle that each ray hits, in float32. The range is
then computed in float64 from the plane of that triangle.
"""

from collections.abc import Iterable
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from intervis.arrays import BoolArray, Float64Array, IntArray
from intervis.errors import MissingExtraError, PointsError

FLOAT32_STEP = 2.0**-22
"""Rounding of float32, with a margin, as a fraction of the largest coordinate."""
GRAZING = 1e-3
"""Sine of the angle to a plane below which rounding may move the crossing out of a triangle."""


def require_embreex() -> tuple[Any, Any]:
    """The classes EmbreeScene and TriangleMesh of embreex.

    Raises
    ------
    MissingExtraError
        embreex is not installed.
    """
    try:
        import embreex  # noqa: F401
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene
    except ImportError:
        raise MissingExtraError("embreex", "lab", "ray casting") from None
    return EmbreeScene, TriangleMesh


class RayCaster:
    """Casts rays at triangles.

    Embree chooses the triangle in float32, in coordinates relative to the middle of all triangles.
    At an edge, or where two surfaces are nearer to each other than about 1e-7 of the size of the
    world, it may choose the neighbour. Closed surfaces have no gaps at common edges. A surface on
    which a ray starts may or may not be hit.

    Parameters
    ----------
    triangles : (T, 3, 3) float array
        Corners in metres; degenerate triangles are never hit.

    Raises
    ------
    PointsError
        Wrong shape, or corners that are not finite.
    MissingExtraError
        embreex is not installed.

    Examples
    --------
    >>> wall = np.array([[[5.0, -9, -9], [5, 9, -9], [5, 0, 9]]])
    >>> RayCaster(wall).closest([0.0, 0, 0], [[1.0, 0, 0], [0, 1, 0]])
    (array([ 5., inf]), array([ 0, -1]))
    >>> RayCaster(wall).blocked([0.0, 0, 0], [[4.0, 0, 0], [6, 0, 0]])
    array([False,  True])
    """

    def __init__(self, triangles: ArrayLike) -> None:
        scene_class, mesh_class = require_embreex()
        corners = np.array(triangles, dtype=np.float64, order="C")  # a copy: the caster keeps it
        if corners.ndim != 3 or corners.shape[1:] != (3, 3):
            raise PointsError(f"triangles must have the shape (T, 3, 3), got {corners.shape}.")
        if not np.isfinite(corners).all():
            raise PointsError("triangles must have finite corners.")
        self._meshes: list[_Mesh] = []
        self.triangle_count = len(corners)
        if len(corners):
            self._meshes.append(_Mesh(corners, scene_class(robust=True), mesh_class))

    @classmethod
    def joined(cls, casters: Iterable[Self]) -> Self:
        """One caster over several; the triangles are numbered on from caster to caster."""
        whole = cls(np.empty((0, 3, 3)))
        for caster in casters:
            whole._meshes += caster._meshes
            whole.triangle_count += caster.triangle_count
        return whole

    def closest(
        self, origins: ArrayLike, directions: ArrayLike, farthest: float = np.inf
    ) -> tuple[Float64Array, IntArray]:
        """The first hit of each ray.

        Parameters
        ----------
        origins, directions : (R, 3) or (3,) arrays
            Metres; directions need not be of unit length. A direction of length zero hits nothing.
        farthest : float
            Where the rays end, in lengths of the direction.

        Returns
        -------
        ranges : (R,) float64 array
            Lengths of the direction (metres for unit directions), infinity where nothing is hit.
        hits : (R,) int64 array
            Index of the triangle, -1 where nothing is hit.
        """
        starts, units = _paired(_rows(origins, "origins"), _rows(directions, "directions"))
        lengths = np.linalg.norm(units, axis=1)
        moves = lengths > 0
        lengths[~moves] = 1.0
        units = np.where(moves[:, None], units / lengths[:, None], [1.0, 0.0, 0.0])
        ranges_m = np.where(moves, farthest * lengths, 0.0)
        hits = np.full(len(starts), -1, np.int64)
        first = 0
        for mesh in self._meshes:
            own_m, own = mesh.closest(starts, units, ranges_m)
            nearer = own_m < ranges_m
            ranges_m[nearer], hits[nearer] = own_m[nearer], own[nearer] + first
            first += len(mesh.triangles)
        return np.where(hits >= 0, ranges_m / lengths, np.inf), hits

    def first_hit(self, origins: ArrayLike, ends: ArrayLike) -> Float64Array:
        """Distance (M,) in metres from the origin to the first hit of each segment.

        Infinite where the segment hits nothing, as a segment of length zero does.

        Parameters
        ----------
        origins, ends : (M, 3) or (3,) arrays
            Metres.
        """
        segments, lengths_m = self._segments(origins, ends)
        fractions, hits = self.closest(origins, segments, 1.0)
        distances_m = np.full(len(hits), np.inf)
        hit = hits >= 0
        distances_m[hit] = fractions[hit] * lengths_m[hit]
        return distances_m

    def blocked(
        self, origins: ArrayLike, ends: ArrayLike, *, slack_m: float | Float64Array = 0.0
    ) -> BoolArray:
        """Whether (M,) each segment hits a triangle before its last ``slack_m`` metres.

        Parameters
        ----------
        origins, ends : (M, 3) or (3,) arrays
            Metres.
        slack_m : float or (M,) array
            A hit this near to the end does not count: the end may lie on a surface.
        """
        _, lengths_m = self._segments(origins, ends)
        return self.first_hit(origins, ends) < lengths_m - slack_m

    @staticmethod
    def _segments(origins: ArrayLike, ends: ArrayLike) -> tuple[Float64Array, Float64Array]:
        starts, targets = _paired(_rows(origins, "origins"), _rows(ends, "ends"))
        segments = targets - starts
        return segments, np.linalg.norm(segments, axis=1)


class _Mesh:
    """An Embree scene of T triangles, T > 0, around their own centre."""

    def __init__(self, triangles: Float64Array, scene: Any, mesh_class: Any) -> None:
        self.triangles = triangles
        one, two = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
        normals = np.cross(one, two)
        areas = np.linalg.norm(normals, axis=1)
        self._normals = normals / np.where(areas > 0, areas, 1.0)[:, None]
        low, high = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
        self._centre = (low + high) / 2
        self._size_m = float(np.abs(high - low).max())
        self._scene = scene
        mesh_class(scene, (triangles - self._centre).astype(np.float32))

    def closest(
        self, starts: Float64Array, units: Float64Array, reach_m: Float64Array
    ) -> tuple[Float64Array, IntArray]:
        """Ranges (R,) in metres and triangles (R,) that rays of unit direction hit first."""
        local = starts - self._centre
        if not len(local):
            return np.empty(0), np.empty(0, np.int64)
        # Embree's range may be off by rounding: search a little beyond, the caller cuts exactly.
        rounding_m = FLOAT32_STEP * (self._size_m + np.abs(local).max(axis=1))
        search_m = np.minimum(reach_m * (1 + FLOAT32_STEP) + 64 * rounding_m, 1e37)
        found = self._scene.run(
            local.astype(np.float32),
            units.astype(np.float32),
            dists=search_m.astype(np.float32),
            output=True,
        )
        hits = found["primID"].astype(np.int64)
        ranges_m = np.full(len(hits), np.inf)
        hit = np.flatnonzero(hits >= 0)
        ranges_m[hit] = self._plane_ranges_m(starts[hit], units[hit], hits[hit], found["tfar"][hit])
        return ranges_m, hits

    def _plane_ranges_m(
        self, starts: Float64Array, units: Float64Array, hits: IntArray, rough_m: Float64Array
    ) -> Float64Array:
        """Where rays (R,) cross the planes of their triangles, within the triangles' extent.

        A ray in the plane of its triangle keeps Embree's rough range.
        """
        normals = self._normals[hits]
        sines = np.einsum("ri,ri->r", normals, units)
        heights_m = np.einsum("ri,ri->r", normals, self.triangles[hits, 0] - starts)
        ranges_m = np.where(sines != 0, heights_m / np.where(sines != 0, sines, 1.0), rough_m)
        grazing = np.flatnonzero(np.abs(sines) < GRAZING)
        if len(grazing):  # a hit is a weighted mean of the corners, so it lies between them
            corners = self.triangles[hits[grazing]] - starts[grazing, None]
            along_m = np.einsum("rci,ri->rc", corners, units[grazing])
            low_m, high_m = along_m.min(axis=1), along_m.max(axis=1)
            ranges_m[grazing] = np.clip(ranges_m[grazing], low_m, high_m)
        return np.asarray(np.maximum(ranges_m, 0.0))


def _rows(array: ArrayLike, name: str) -> Float64Array:
    rows = np.ascontiguousarray(np.atleast_2d(np.asarray(array, dtype=np.float64)))
    if rows.ndim != 2 or rows.shape[1] != 3:
        raise PointsError(f"{name} must have the shape (3,) or (R, 3), got {np.shape(array)}.")
    return rows


def _paired(first: Float64Array, second: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Two lists of points broadcast to the same length."""
    try:
        first, second = np.broadcast_arrays(first, second)
    except ValueError:
        raise PointsError(
            f"{len(first)} and {len(second)} points cannot be paired:"
            " give two arrays of the same length, or a single point."
        ) from None
    return first, second
