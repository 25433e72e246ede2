"""Hidden point removal: a point is visible when it is a corner of the flipped cloud's hull.

Katz, Tal, Basri: Direct visibility of point sets, ACM Trans. Graph. 26(3), 2007.
"""

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from intervis.arrays import BoolArray, Float64Array
from intervis.lab.truth.baselines.input_scans import Seen

SAME_POINT_M = 1e-4
"""Points nearer than this are one: a hull keeps only one of two equal points."""


def hidden_point_removal(
    points: Float64Array, viewpoint: Float64Array, radius_factor: float
) -> BoolArray:
    """Which points (N, 3) are visible from a viewpoint, by spherical flipping and a convex hull.

    Parameters
    ----------
    points : (N, 3) float64 array
    viewpoint : (3,) float64 array
    radius_factor : float
        Radius of the flipping sphere over the largest distance from the viewpoint.

    Examples
    --------
    Of two points on one ray in front of a wall of four, the farther one is hidden:

    >>> wall = np.array([[9.0, -9, -9], [9, 9, -9], [9, 9, 9], [9, -9, 9], [5, 0, 0], [8, 0, 0]])
    >>> hidden_point_removal(wall, np.zeros(3), 10.0)
    array([ True,  True,  True,  True,  True, False])
    """
    way = points - viewpoint
    distance = np.linalg.norm(way, axis=1)
    visible: BoolArray = distance <= SAME_POINT_M  # nothing fits between a point and itself
    rows = np.flatnonzero(~visible)
    if len(rows) == 0:
        return visible
    radius = radius_factor * distance.max()
    flipped = way[rows] * (2 * radius / distance[rows] - 1)[:, None]
    try:
        corners = ConvexHull(np.vstack([flipped, np.zeros(3)])).vertices
    except QhullError:  # fewer than four points, or all in one plane: the hull has no inside
        visible[:] = True
        return visible
    visible[rows[corners[corners < len(rows)]]] = True
    return visible


def answer(
    seen: Seen,
    viewpoint: Float64Array,
    targets: Float64Array,
    *,
    radius_factor: float,
    each_side: int = 3,
) -> Float64Array:
    """Probability (1 or 0) that targets are visible among the points of the nearest scans."""
    cloud = seen.nearest(each_side).points_world
    together = np.vstack([targets, cloud])
    cell = np.round((together - viewpoint) / SAME_POINT_M).astype(np.int64)
    _, first, place = np.unique(cell, axis=0, return_index=True, return_inverse=True)
    visible = hidden_point_removal(together[first], viewpoint, radius_factor)
    return visible[place[: len(targets)]].astype(np.float64)
