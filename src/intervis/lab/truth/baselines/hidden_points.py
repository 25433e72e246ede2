"""Hidden point removal: a point is visible where it is a vertex of the flipped cloud's hull.

Katz, Tal, Basri: Direct visibility of point sets, ACM Trans. Graph. 26(3), 2007,
doi:10.1145/1276377.1276407.
"""

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from intervis.arrays import BoolArray, Float64Array
from intervis.lab.truth.baselines.input_scans import InputScans

SAME_POINT_M = 1e-4
"""Points nearer than this count as one: of two equal points a hull has only one as a vertex."""


def hidden_point_removal(
    points: Float64Array, viewpoint: Float64Array, radius_factor: float
) -> BoolArray:
    """Which points (N, 3) are visible from a viewpoint, by spherical flipping and a convex hull.

    Parameters
    ----------
    points : (N, 3) float64 array
    viewpoint : (3,) float64 array
    radius_factor : float
        Radius of the flipping sphere divided by the largest distance from the viewpoint.

    Examples
    --------
    Of two points on one ray in front of a wall of four, the farther one is occluded:

    >>> wall = np.array([[9.0, -9, -9], [9, 9, -9], [9, 9, 9], [9, -9, 9], [5, 0, 0], [8, 0, 0]])
    >>> hidden_point_removal(wall, np.zeros(3), 10.0)
    array([ True,  True,  True,  True,  True, False])
    """
    offset = points - viewpoint
    distance = np.linalg.norm(offset, axis=1)
    visible: BoolArray = distance <= SAME_POINT_M  # points at the viewpoint have no direction
    rows = np.flatnonzero(~visible)
    if len(rows) == 0:
        return visible
    radius = radius_factor * distance.max()
    flipped = offset[rows] * (2 * radius / distance[rows] - 1)[:, None]
    try:
        vertices = ConvexHull(np.vstack([flipped, np.zeros(3)])).vertices
    except QhullError:  # fewer than four points, or all in one plane: the hull has no volume
        visible[:] = True
        return visible
    visible[rows[vertices[vertices < len(rows)]]] = True
    return visible


def predict(
    inputs: InputScans,
    viewpoint: Float64Array,
    targets: Float64Array,
    *,
    radius_factor: float,
    each_side: int = 3,
) -> Float64Array:
    """1 where hidden point removal keeps the target, 0 elsewhere; see `baselines`.

    Parameters
    ----------
    radius_factor : float
        As in `hidden_point_removal`.
    each_side : int
        Number of scans before and after the viewpoint, beside the target frame's scan.
    """
    cloud = inputs.nearest(each_side).points_world
    together = np.vstack([targets, cloud])
    cell = np.round((together - viewpoint) / SAME_POINT_M).astype(np.int64)
    _, first, cell_number = np.unique(cell, axis=0, return_index=True, return_inverse=True)
    visible = hidden_point_removal(together[first], viewpoint, radius_factor)
    return visible[cell_number[: len(targets)]].astype(np.float64)
