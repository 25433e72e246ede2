"""Rays against known triangles, cast by Embree (the package ``embreex``, development only)."""

from typing import Any

import numpy as np

from intervis.arrays import BoolArray, Float32Array, Float64Array, FloatArray
from intervis.errors import MissingExtraError


class RayCaster:
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

    >>> caster = RayCaster(np.array([[[2.0, -9, -9], [2, 9, -9], [2, 0, 9]]]))
    >>> caster.first_hit(np.zeros(3), np.array([[1.0, 0, 0], [5, 0, 0]]))
    array([inf,  2.])
    """

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
        start, direction, length = self._segments(origins, ends)
        if self._scene is None or len(length) == 0:
            return np.full(len(length), np.inf)
        found = self._scene.run(start, direction, query="DISTANCE").astype(np.float64)
        return np.where(found < length, found, np.inf)

    def blocked(
        self,
        origins: FloatArray,
        ends: FloatArray,
        *,
        slack_m: float | FloatArray = 0.0,
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
        >>> caster = RayCaster(np.array([[[2.0, -9, -9], [2, 9, -9], [2, 0, 9]]]))
        >>> caster.blocked(np.zeros(3), np.array([[3.0, 0, 0]])), caster.blocked(
        ...     np.zeros(3), np.array([[3.0, 0, 0]]), slack_m=1.1)
        (array([ True]), array([False]))
        """
        start, direction, length = self._segments(origins, ends)
        reach = length - slack_m
        if self._scene is None or len(length) == 0:
            return np.zeros(len(length), dtype=bool)
        far = np.maximum(reach, 0.0).astype(np.float32)
        met = self._scene.run(start, direction, dists=far, query="OCCLUDED") >= 0
        return np.asarray(met & (reach > 0))

    def _segments(
        self, origins: FloatArray, ends: FloatArray
    ) -> tuple[Float32Array, Float32Array, Float64Array]:
        """Starts and unit directions in Embree's frame and precision, and the lengths (M,)."""
        end = np.asarray(ends, dtype=np.float64)
        start = np.broadcast_to(np.asarray(origins, dtype=np.float64), end.shape)
        way = end - start
        length = np.linalg.norm(way, axis=1)
        direction = way / np.where(length > 0, length, 1.0)[:, None]
        direction[length == 0] = (1.0, 0.0, 0.0)  # any: a segment of no length meets nothing
        return (start - self._origin).astype(np.float32), direction.astype(np.float32), length
