"""Primitives of Foxglove's messages: poses, segments, spheres, colours."""

from typing import Any

import numpy as np

from intervis.arrays import Float64Array
from intervis.view.colours import rgb
from intervis.view.recordings.placement import placement

EDGE_PX, LINE_PX, SPHERE_M = 1.5, 3.0, 0.5


def sphere(place: Float64Array, colour: str) -> Any:
    """A sphere at a place (3,)."""
    from foxglove.messages import SpherePrimitive, Vector3

    at = np.eye(4)
    at[:3, 3] = place
    size = Vector3(x=SPHERE_M, y=SPHERE_M, z=SPHERE_M)
    return SpherePrimitive(pose=pose_of(at), size=size, color=rgba(colour))


def segments(ends: Float64Array, colour: str, width_px: float) -> Any:
    """Segments (K, 2, 3) in one colour."""
    from foxglove.messages import LinePrimitive, LinePrimitiveLineType

    return LinePrimitive(
        type=LinePrimitiveLineType.LineList,
        pose=pose_of(np.eye(4)),
        thickness=width_px,
        scale_invariant=True,
        points=points_of(ends.reshape(-1, 3)),
        color=rgba(colour),
    )


def points_of(points: Float64Array) -> list[Any]:
    """Points (N, 3)."""
    from foxglove.messages import Point3

    return [Point3(x=x, y=y, z=z) for x, y, z in points.tolist()]


def pose_of(parent_from_child: Float64Array) -> Any:
    """A pose from a (4, 4) matrix."""
    from foxglove.messages import Pose, Quaternion, Vector3

    place = placement(parent_from_child)
    return Pose(
        position=Vector3(**xyz(place.translation)),
        orientation=Quaternion(**xyzw(place.quaternion)),
    )


def rgba(colour: str, alpha: float = 1.0) -> Any:
    """A colour from ``#rrggbb``."""
    from foxglove.messages import Color

    red, green, blue = (channel / 255 for channel in rgb(colour))
    return Color(r=red, g=green, b=blue, a=alpha)


def xyz(values: Float64Array) -> dict[str, float]:
    """Keywords of a vector (3,)."""
    return dict(zip("xyz", values.tolist(), strict=True))


def xyzw(values: Float64Array) -> dict[str, float]:
    """Keywords of a quaternion (4,)."""
    return dict(zip("xyzw", values.tolist(), strict=True))
