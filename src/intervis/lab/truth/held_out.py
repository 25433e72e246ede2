"""Held-out returns: a scan that the method never sees says what was visible from its pose.

Scan i is what a method may see, pose j the viewpoint, scan j the judge. A point of scan i counts
as *visible* from pose j where a return of scan j lies on it, as *occluded* where every beam of
scan j in its direction ended well before it, and is not judged in all other cases: between the
beams, beside an edge, or behind a beam that came back from farther away.
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
"""Returns of the judging scan within this angle of a direction have a say about it."""
NEAREST_ANGLE_DEG = 0.15
"""No judgement where the nearest return lies farther off than this."""
NEIGHBOUR_COUNT = 8
"""At most so many returns have a say, the nearest ones."""
LEAST_OCCLUDERS = 2
"""A single nearer return may be noise; so many must agree that a point is hidden."""
SAME_M, SAME_SHARE = 0.15, 0.01
"""A return nearer to the point's range than this, plus a share of the range, lies on it."""
BEFORE_M, BEFORE_SHARE = 1.0, 0.02
"""A return that ends earlier than this, plus a share of the range, hides it."""
NEAREST_RANGE_M, FARTHEST_RANGE_M = 2.7, 75.0
"""Points nearer to pose j (the car itself) or farther away (too few beams) are not judged."""


@dataclass(frozen=True, eq=False)
class Judgement:
    """What scan j says about the points of scan i, seen from pose j.

    Attributes
    ----------
    index : (K,) int64 array
        Rows of scan i that are judged, ascending.
    visible : (K,) bool array
        Whether a return of scan j lies on the point; where not, the point is hidden from there.
    viewpoint_i : (3,) float64 array
        Pose j's origin in frame i, metres: where the sight lines start.
    range_m : (K,) float64 array
        Distance of the judged points from that viewpoint.
    """

    index: IntArray
    visible: BoolArray
    viewpoint_i: Float64Array
    range_m: Float64Array


def judge(
    points_i: FloatArray, pose_i: ArrayLike, points_j: FloatArray, pose_j: ArrayLike
) -> Judgement:
    """Let scan j say which points of scan i are visible from pose j.

    With r the range of a point of scan i from pose j, and the returns of scan j within 0.25
    degrees of its direction (eight nearest at most; the nearest within 0.15 degrees, or the point
    is not judged):

    - visible: one of them has ``abs(range - r) < 0.15 + 0.01 r``;
    - occluded: there are two at least, and all of them have ``range < r - (1 + 0.02 r)``;
    - anything else is not judged, nor is a point with ``r`` outside 2.7 to 75 m.

    Parameters
    ----------
    points_i, points_j : (N, 3), (M, 3) float arrays
        The scans, each in its own sensor's frame, metres. Non-finite rows are passed over, and so
        are returns at the very origin, which have no direction.
    pose_i, pose_j : (4, 4) arrays
        world_from_velo of the two scans.

    Returns
    -------
    Judgement

    Raises
    ------
    PointsError
        A scan has the wrong shape or type.
    PoseError
        A pose is no rigid motion.

    Examples
    --------
    Two returns of the judge on a point 10 m ahead; two more stop 6 m before another one:

    >>> seen = np.array([[10.0, 0.0, 0.0], [0.0, 10.0, 0.0]])
    >>> judging = np.array([[10, 0.0, 0], [10, 0.02, 0], [0, 4.0, 0], [0.01, 4, 0]])
    >>> answer = judge(seen, np.eye(4), judging, np.eye(4))
    >>> answer.index, answer.visible
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
    asked = np.flatnonzero((range_i >= NEAREST_RANGE_M) & (range_i <= FARTHEST_RANGE_M))
    if len(beams) == 0 or len(asked) == 0:
        nothing = np.empty(0, dtype=np.int64)
        return Judgement(nothing, nothing.astype(bool), viewpoint_i, np.empty(0))

    apart, row = nearest_directions(
        direction_j[beams], direction_i[asked], NEIGHBOUR_COUNT, NEIGHBOUR_ANGLE_DEG
    )
    ranges = np.append(range_j[beams], np.inf)[row]  # row == len(beams) marks "none"
    seen, hidden = _say(apart, ranges, range_i[asked])
    judged = seen | hidden
    asked = asked[judged]
    return Judgement(row_i[asked], seen[judged], viewpoint_i, range_i[asked])


def _finite(points: FloatArray, name: str) -> tuple[IntArray, Float64Array]:
    """The finite rows of a scan: their indices, and the points in float64."""
    xyz = checked_points(points, name)
    row = np.flatnonzero(finite_rows(xyz))
    return row, xyz[row].astype(np.float64)


def _say(
    apart: Float64Array, ranges: Float64Array, asked_range: Float64Array
) -> tuple[BoolArray, BoolArray]:
    """Which asked points are visible and which occluded, (K,) each; both False: not judged."""
    beside = np.isfinite(apart)
    asked = asked_range[:, None]
    near_enough = apart[:, 0] < chord(NEAREST_ANGLE_DEG)
    on_it = beside & (np.abs(ranges - asked) < SAME_M + SAME_SHARE * asked)
    before = ranges < asked - (BEFORE_M + BEFORE_SHARE * asked)
    seen = near_enough & on_it.any(axis=1)
    hidden = near_enough & (beside.sum(axis=1) >= LEAST_OCCLUDERS) & (before | ~beside).all(axis=1)
    return seen, hidden
