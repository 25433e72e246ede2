"""Points on the surfaces of boxes that face a viewpoint, weighted by the solid angle they take."""

from typing import NamedTuple

import numpy as np

from intervis.arrays import Float64Array, IntArray
from intervis.transform import inverse, transform

GROWN_M = 0.2
"""Boxes are grown by this, but not downwards, where they stand on the ground: lines end before the
returns of the object itself."""

SPACING_M = 0.25
"""Distance of points on a face, at most where no more than `MOST_PER_EDGE` are needed."""

MOST_PER_EDGE = 12


class SurfacePoints(NamedTuple):
    """L points on boxes, scene frame, metres; the box and the share of its solid angle of each."""

    points: Float64Array
    box: IntArray
    share: Float64Array


def facing_surfaces(
    viewpoint: Float64Array, scene_from_box: Float64Array, size_m: Float64Array
) -> SurfacePoints:
    """Points on the faces of grown boxes that face a viewpoint.

    A box that holds the viewpoint has none.

    Parameters
    ----------
    viewpoint : (3,) float64 array
        Scene frame, metres.
    scene_from_box : (B, 4, 4) float64 array
    size_m : (B, 3) float64 array
        Along x, y and z of the box.

    Examples
    --------
    A cube of 2 m, 10 m ahead, shows one face, 8.8 m away, that is 2.4 m wide and 2.2 m high:

    >>> pose = np.eye(4)
    >>> pose[0, 3] = 10.0
    >>> found = facing_surfaces(np.zeros(3), pose[None], np.full((1, 3), 2.0))
    >>> len(found.points), found.points[:, 0].min().round(6), found.share.sum().round(6)
    (90, np.float64(8.8), np.float64(1.0))
    """
    parts = [
        _of_box(viewpoint, *grown(pose, size))
        for pose, size in zip(scene_from_box, size_m, strict=True)
    ]
    counts = [len(points) for points, _ in parts]
    return SurfacePoints(
        np.concatenate([points for points, _ in parts]) if parts else np.empty((0, 3)),
        np.repeat(np.arange(len(parts)), counts),
        np.concatenate([share for _, share in parts]) if parts else np.empty(0),
    )


def grown(scene_from_box: Float64Array, size_m: Float64Array) -> tuple[Float64Array, Float64Array]:
    """The pose of a box grown by `GROWN_M`, and half of its edges (3,), metres."""
    shift = np.eye(4)
    shift[2, 3] = 0.5 * GROWN_M
    return scene_from_box @ shift, 0.5 * size_m + GROWN_M * np.array([1.0, 1.0, 0.5])


def _of_box(
    viewpoint: Float64Array, scene_from_box: Float64Array, half_m: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """Points (K, 3) of one box, scene frame, and their shares of its solid angle."""
    from_box = transform(inverse(scene_from_box), viewpoint)
    points, weights = [], []
    for axis in range(3):
        if abs(from_box[axis]) <= half_m[axis]:
            continue  # the viewpoint lies between the two faces
        first, second = (axis + 1) % 3, (axis + 2) % 3
        u, v = np.meshgrid(_middles(half_m[first]), _middles(half_m[second]), indexing="ij")
        face = np.empty((u.size, 3))
        face[:, axis] = np.copysign(half_m[axis], from_box[axis])
        face[:, first], face[:, second] = u.ravel(), v.ravel()
        range_m = np.linalg.norm(face - from_box, axis=1)
        area = 4.0 * half_m[first] * half_m[second] / u.size
        weights.append(area * np.abs(face[:, axis] - from_box[axis]) / range_m**3)
        points.append(face)
    if not points:
        return np.empty((0, 3)), np.empty(0)
    weight = np.concatenate(weights)
    return transform(scene_from_box, np.concatenate(points)), weight / weight.sum()


def _middles(half_m: float) -> Float64Array:
    """Middles of equal parts of an edge."""
    count = int(np.clip(np.ceil(2.0 * half_m / SPACING_M), 1, MOST_PER_EDGE))
    return np.asarray(((np.arange(count) + 0.5) / count * 2.0 - 1.0) * half_m)
