"""Held-out returns: labels from a reference scan that the evaluated method does not get.

Scan i is the input, pose j the viewpoint, scan j the reference. A point of scan i is *visible*
from pose j where a return of scan j lies on it. It is *occluded* where all beams of scan j in its
direction end well before it. In all other cases it has no label: between the beams, beside an
edge, or where a beam ends farther away.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from intervis.arrays import (
    BoolArray,
    Float64Array,
    FloatArray,
    IntArray,
    checked_points,
    finite_rows,
)
from intervis.directions import chord, directions, nearest_directions
from intervis.transform import checked_pose, inverse, transform

NEIGHBOUR_ANGLE_DEG = 0.25
"""Returns of the reference scan within this angle of a direction are used for its label."""
NEAREST_ANGLE_DEG = 0.15
"""There is no label where the nearest return is farther off than this."""
NEIGHBOUR_COUNT = 8
"""At most so many returns are used, the nearest ones."""
MIN_OCCLUDERS = 2
"""Least number of returns for the label "occluded": a single nearer return may be noise."""
SAME_M, SAME_FRACTION = 0.15, 0.01
"""A return lies on the point where the ranges differ by less than this, plus a fraction of the
range."""
BEFORE_M, BEFORE_FRACTION = 1.0, 0.02
"""A return occludes the point where it ends earlier by more than this, plus a fraction of the
range."""
MIN_RANGE_M, MAX_RANGE_M = 2.7, 75.0
"""Points nearer to pose j (the vehicle itself) or farther away (too few beams) have no label."""


@dataclass(frozen=True, eq=False)
class HeldOutLabels:
    """Labels of the points of scan i, seen from pose j.

    Attributes
    ----------
    index : (K,) int64 array
        Rows of scan i that have a label, ascending.
    visible : (K,) bool array
        True: visible, a return of scan j lies on the point. False: occluded.
    viewpoint_i : (3,) float64 array
        Origin of pose j in frame i, metres: the start of the sight lines.
    range_m : (K,) float64 array
        Distance of the labelled points from the viewpoint.
    """

    index: IntArray
    visible: BoolArray
    viewpoint_i: Float64Array
    range_m: Float64Array


def held_out_labels(
    points_i: FloatArray, pose_i: ArrayLike, points_j: FloatArray, pose_j: ArrayLike
) -> HeldOutLabels:
    """Label points of scan i as visible or occluded from pose j, by the returns of scan j.

    Let r be the range of a point of scan i from pose j. The returns of scan j within 0.25 degrees
    of its direction are compared with it, at most the eight nearest. The nearest must be within
    0.15 degrees; otherwise the point has no label.

    - visible: one of them has ``abs(range - r) < 0.15 + 0.01 r``;
    - occluded: there are at least two, and all have ``range < r - (1 + 0.02 r)``;
    - all other points have no label, nor points with ``r`` outside 2.7 to 75 m.

    Parameters
    ----------
    points_i, points_j : (N, 3), (M, 3) float arrays
        The scans, each in its own sensor's frame, metres. Rows that are not finite are ignored,
        and so are returns at the origin, which have no direction.
    pose_i, pose_j : (4, 4) arrays
        world_from_velo of the two scans.

    Returns
    -------
    HeldOutLabels

    Raises
    ------
    PointsError
        A scan has the wrong shape or type.
    PoseError
        A pose is not a rigid motion.

    Examples
    --------
    Two reference returns lie on a point 10 m ahead; two others end 6 m before another point:

    >>> scan = np.array([[10.0, 0.0, 0.0], [0.0, 10.0, 0.0]])
    >>> reference = np.array([[10, 0.0, 0], [10, 0.02, 0], [0, 4.0, 0], [0.01, 4, 0]])
    >>> labels = held_out_labels(scan, np.eye(4), reference, np.eye(4))
    >>> labels.index, labels.visible
    (array([0, 1]), array([ True, False]))
    """
    row_i, xyz_i = _finite(points_i, "points_i")
    _, xyz_j = _finite(points_j, "points_j")
    world_from_i = checked_pose(pose_i, "pose_i")
    world_from_j = checked_pose(pose_j, "pose_j")
    j_from_i = inverse(world_from_j) @ world_from_i
    viewpoint_i = transform(inverse(world_from_i), world_from_j[:3, 3])

    direction_i, range_i = directions(transform(j_from_i, xyz_i))
    direction_j, range_j = directions(xyz_j)
    beams = np.flatnonzero(range_j > 0)
    query = np.flatnonzero((range_i >= MIN_RANGE_M) & (range_i <= MAX_RANGE_M))
    if len(beams) == 0 or len(query) == 0:
        nothing = np.empty(0, dtype=np.int64)
        return HeldOutLabels(nothing, nothing.astype(bool), viewpoint_i, np.empty(0))

    distance, row = nearest_directions(
        direction_j[beams], direction_i[query], NEIGHBOUR_COUNT, NEIGHBOUR_ANGLE_DEG
    )
    beam_range = np.append(range_j[beams], np.inf)[row]  # row == len(beams): no neighbour
    visible, occluded = _classify(distance, beam_range, range_i[query])
    labelled = visible | occluded
    query = query[labelled]
    return HeldOutLabels(row_i[query], visible[labelled], viewpoint_i, range_i[query])


def _finite(points: FloatArray, name: str) -> tuple[IntArray, Float64Array]:
    """The finite rows of a scan: their indices, and the points in float64."""
    xyz = checked_points(points, name)
    row = np.flatnonzero(finite_rows(xyz))
    return row, xyz[row].astype(np.float64)


def _classify(
    distance: Float64Array, beam_range: Float64Array, point_range: Float64Array
) -> tuple[BoolArray, BoolArray]:
    """Which points are visible and which occluded, (K,) each; both False: no label.

    `distance` and `beam_range` are (K, 8): chord distance and range of the neighbouring beams.
    """
    exists = np.isfinite(distance)
    r = point_range[:, None]
    near_enough = distance[:, 0] < chord(NEAREST_ANGLE_DEG)
    on_point = exists & (np.abs(beam_range - r) < SAME_M + SAME_FRACTION * r)
    before = beam_range < r - (BEFORE_M + BEFORE_FRACTION * r)
    visible = near_enough & on_point.any(axis=1)
    enough = exists.sum(axis=1) >= MIN_OCCLUDERS
    occluded = near_enough & enough & (before | ~exists).all(axis=1)
    return visible, occluded
