"""Segments against known triangles: cast by Embree where it is installed, else by our own caster.

Embree (the package ``embreex``, which only the development environment brings) judges our own
work; it shares no line with it.
"""

from importlib.util import find_spec
from typing import Any, Protocol

import numpy as np

from intervis.arrays import BoolArray, Float32Array, Float64Array, FloatArray
from intervis.errors import MissingExtraError


class SegmentCaster(Protocol):
    """Triangles that segments can be tested against.

    Attributes
    ----------
    name : str
        Who casts.
    """

    name: str

    def first_hit(self, origins: FloatArray, ends: FloatArray) -> Float64Array:
        """Distance (M,) at which each segment first meets a triangle, infinite where none."""
        ...

    def blocked(
        self, origins: FloatArray, ends: FloatArray, *, slack_m: float | FloatArray = 0.0
    ) -> BoolArray:
        """Whether (M,) each segment meets a triangle before its last ``slack_m`` metres."""
        ...


def caster_of(triangles: FloatArray) -> SegmentCaster:
    """Embree over the triangles (F, 3, 3) where it is installed, else the built-in caster.

    Examples
    --------
    >>> caster_of(np.empty((0, 3, 3))).blocked(np.zeros(3), np.ones((1, 3)))
    array([False])
    """
    return (EmbreeCaster if find_spec("embreex") else BuiltInCaster)(triangles)


class BuiltInCaster:
    """The caster of `intervis.lab.worlds`, in float64, behind the face of `SegmentCaster`.

    Parameters
    ----------
    triangles : (F, 3, 3) float array
        Corners in metres, any frame.
    """

    name = "built-in"

    def __init__(self, triangles: FloatArray) -> None:
        from intervis.lab.worlds.ray_casting import RayCaster

        self._caster = RayCaster(triangles)

    def first_hit(self, origins: FloatArray, ends: FloatArray) -> Float64Array:
        """As `SegmentCaster.first_hit`."""
        start, way, length = _segments(origins, ends)
        if len(length) == 0:
            return np.empty(0)
        hit, _ = self._caster.closest(start, way, float(length.max()))
        return np.where(hit < length, hit, np.inf)

    def blocked(
        self, origins: FloatArray, ends: FloatArray, *, slack_m: float | FloatArray = 0.0
    ) -> BoolArray:
        """As `SegmentCaster.blocked`."""
        start, way, length = _segments(origins, ends)
        if len(length) == 0:
            return np.empty(0, dtype=bool)
        reach = np.maximum(length - slack_m, 0.0)
        return self._caster.blocked(start, start + way * reach[:, None])


class EmbreeCaster:
    """Triangles that segments can be tested against.

    Embree computes in float32. The triangles are therefore moved to their own centre first; at
    100 m from it coordinates are then good to 8 micrometres.

    Parameters
    ----------
    triangles : (F, 3, 3) float array
        Corners in metres, any frame.

    Raises
    ------
    MissingExtraError
        embreex is not installed.

    Examples
    --------
    A triangle across the x axis at x = 2, and segments before it and through it:

    >>> caster = EmbreeCaster(np.array([[[2.0, -9, -9], [2, 9, -9], [2, 0, 9]]]))
    >>> caster.first_hit(np.zeros(3), np.array([[1.0, 0, 0], [5, 0, 0]]))
    array([inf,  2.])
    """

    name = "Embree"

    def __init__(self, triangles: FloatArray) -> None:
        try:
            from embreex.mesh_construction import TriangleMesh
            from embreex.rtcore_scene import EmbreeScene
        except ImportError:
            raise MissingExtraError("embreex", "dev", "Casting rays at triangles") from None
        corners = np.asarray(triangles, dtype=np.float64).reshape(-1, 3, 3)
        self._origin: Float64Array = np.zeros(3)
        self._scene: Any = None
        if len(corners):
            self._origin = (corners.min(axis=(0, 1)) + corners.max(axis=(0, 1))) / 2
            self._scene = EmbreeScene(robust=True)
            TriangleMesh(self._scene, (corners - self._origin).astype(np.float32))

    def first_hit(self, origins: FloatArray, ends: FloatArray) -> Float64Array:
        """Distance at which each segment first meets a triangle.

        Parameters
        ----------
        origins : (M, 3) or (3,) float array
        ends : (M, 3) float array

        Returns
        -------
        (M,) float64 array
            Metres from the origin; infinite where the segment meets none.
        """
        start, way, length = _segments(origins, ends)
        if self._scene is None or len(length) == 0:
            return np.full(len(length), np.inf)
        found = self._scene.run(*self._placed(start, way), query="DISTANCE").astype(np.float64)
        return np.where(found < length, found, np.inf)

    def blocked(
        self, origins: FloatArray, ends: FloatArray, *, slack_m: float | FloatArray = 0.0
    ) -> BoolArray:
        """Whether each segment meets a triangle before its last ``slack_m`` metres.

        Parameters
        ----------
        origins : (M, 3) or (3,) float array
        ends : (M, 3) float array
        slack_m : float or (M,) array
            How far before its end a segment stops. One shorter than that meets nothing.

        Returns
        -------
        (M,) bool array

        Examples
        --------
        >>> caster = EmbreeCaster(np.array([[[2.0, -9, -9], [2, 9, -9], [2, 0, 9]]]))
        >>> caster.blocked(np.zeros(3), np.array([[3.0, 0, 0]])), caster.blocked(
        ...     np.zeros(3), np.array([[3.0, 0, 0]]), slack_m=1.1)
        (array([ True]), array([False]))
        """
        start, way, length = _segments(origins, ends)
        if self._scene is None or len(length) == 0:
            return np.zeros(len(length), dtype=bool)
        reach = length - slack_m
        far = np.maximum(reach, 0.0).astype(np.float32)
        met = self._scene.run(*self._placed(start, way), dists=far, query="OCCLUDED") >= 0
        return np.asarray(met & (reach > 0))

    def _placed(self, start: Float64Array, way: Float64Array) -> tuple[Float32Array, Float32Array]:
        return (start - self._origin).astype(np.float32), way.astype(np.float32)


def _segments(
    origins: FloatArray, ends: FloatArray
) -> tuple[Float64Array, Float64Array, Float64Array]:
    """Starts (M, 3), unit directions (M, 3) and lengths (M,)."""
    end = np.asarray(ends, dtype=np.float64)
    start = np.broadcast_to(np.asarray(origins, dtype=np.float64), end.shape)
    way = end - start
    length = np.linalg.norm(way, axis=1)
    way /= np.where(length > 0, length, 1.0)[:, None]
    way[length == 0] = (1.0, 0.0, 0.0)  # any: a segment of no length meets nothing
    return start, way, length
