"""What changed between two scans: returns of the one that the other one saw through.

A sight line is judged by a scan that was taken at another time than the scans that a method may
see. Where something drove off or came up meanwhile, no method can be right but by luck. This module
tells such lines from the others, by the returns of the two scans alone.
"""

import numpy as np

from intervis.arrays import BoolArray, Float64Array, FloatArray, finite_rows
from intervis.directions import directions, nearest_directions
from intervis.transform import inverse, transform

AROUND_DEG = 1.0
"""A scan saw through a place where all of its beams within this angle of it went on."""
MOST_BEAMS, LEAST_BEAMS = 24, 6
"""So many of them are asked, the nearest ones; fewer than the latter cannot say."""
BEYOND_M, BEYOND_SHARE = 1.0, 0.02
"""They went on by this much, plus a share of the range, at least."""
BESIDE_DEG = 0.4
"""A return so near to a sight line, in angle from its viewpoint, lies on it."""


def seen_through(
    points: FloatArray, pose: Float64Array, other: FloatArray, other_pose: Float64Array
) -> BoolArray:
    """Which returns of a scan another scan saw through: what they lay on was not there then.

    Parameters
    ----------
    points, other : (N, 3), (M, 3) float arrays
        Each in its own sensor's frame, metres.
    pose, other_pose : (4, 4) float64 arrays
        world_from_velo of the two.

    Returns
    -------
    (N,) bool array
        False as well where the other scan cannot say.

    Examples
    --------
    A wall at 10 m, and before it a post that stood there only in the first scan:

    >>> y, z = (grid.ravel() for grid in np.mgrid[-1:1:0.05, -1:1:0.05])
    >>> wall = np.stack([np.full(y.size, 10.0), y, z], axis=1)
    >>> with_post = np.vstack([wall, [[5.0, 0.0, 0.0]]])
    >>> seen_through(with_post, np.eye(4), wall, np.eye(4)).nonzero()[0]
    array([1600])
    """
    found = np.zeros(len(points), dtype=bool)
    row = np.flatnonzero(finite_rows(points))
    asked, asked_m = directions(transform(inverse(other_pose) @ pose, points[row, :3]))
    beams, beams_m = directions(other[finite_rows(other), :3].astype(np.float64))
    if len(row) == 0 or len(beams) == 0:
        return found
    _, nearest = nearest_directions(beams, asked, MOST_BEAMS, AROUND_DEG)
    there = nearest < len(beams)
    ranges = np.append(beams_m, np.inf)[nearest]
    beyond = ranges > (asked_m + BEYOND_M + BEYOND_SHARE * asked_m)[:, None]
    found[row] = (there.sum(axis=1) >= LEAST_BEAMS) & (beyond | ~there).all(axis=1)
    return found


def changed_between(
    viewpoint: Float64Array,
    targets: Float64Array,
    points_i: FloatArray,
    pose_i: Float64Array,
    points_j: FloatArray,
    pose_j: Float64Array,
) -> BoolArray:
    """Which sight lines pass something that left or came between two scans.

    Parameters
    ----------
    viewpoint, targets : (3,), (K, 3) float64 arrays
        World frame, metres.
    points_i, points_j : (N, 3), (M, 3) float arrays
        The two scans, each in its own sensor's frame, metres.
    pose_i, pose_j : (4, 4) float64 arrays
        world_from_velo of the two.

    Returns
    -------
    (K,) bool array
        Whether a return of one scan that the other saw through lies on the line, before its target.
    """
    left = points_i[seen_through(points_i, pose_i, points_j, pose_j), :3]
    came = points_j[seen_through(points_j, pose_j, points_i, pose_i), :3]
    return _passes(viewpoint, targets, transform(pose_i, left)) | _passes(
        viewpoint, targets, transform(pose_j, came)
    )


def _passes(viewpoint: Float64Array, targets: Float64Array, things: Float64Array) -> BoolArray:
    """Which sight lines pass one of the points (T, 3) before they reach their target."""
    aim, aim_m = directions(targets - viewpoint)
    ways, ways_m = directions(things - viewpoint)
    if len(ways) == 0 or len(aim) == 0:
        return np.zeros(len(targets), dtype=bool)
    _, nearest = nearest_directions(ways, aim, MOST_BEAMS, BESIDE_DEG)
    ranges = np.append(ways_m, np.inf)[nearest]
    return np.asarray((ranges < aim_m[:, None]).any(axis=1))
