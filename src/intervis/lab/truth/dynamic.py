"""Dynamic objects between two scans: returns of one scan that the other one saw through.

The reference scan is taken at another time than the input scans. Where an object left or arrived
in between, the input scans alone do not determine the answer. This module separates such sight
lines from the static ones, from the returns of the two scans.
"""

import numpy as np

from intervis.arrays import BoolArray, Float64Array, FloatArray, finite_rows
from intervis.directions import directions, nearest_directions
from intervis.transform import inverse, transform

NEIGHBOUR_ANGLE_DEG = 1.0
"""Beams of the other scan within this angle decide whether it saw through a return."""
MAX_BEAMS, MIN_BEAMS = 24, 6
"""At most the 24 nearest beams are used; with fewer than 6 the return counts as static."""
BEYOND_M, BEYOND_FRACTION = 1.0, 0.02
"""All these beams must end farther than the return by this, plus a fraction of its range."""
LINE_ANGLE_DEG = 0.4
"""A return within this angle of a sight line, seen from the viewpoint, lies on the line."""


def dynamic_returns(
    points: FloatArray, pose: Float64Array, other: FloatArray, other_pose: Float64Array
) -> BoolArray:
    """Which returns of a scan lie on objects that were absent when another scan was taken.

    Parameters
    ----------
    points, other : (N, 3), (M, 3) float arrays
        Each in its own sensor's frame, metres.
    pose, other_pose : (4, 4) float64 arrays
        world_from_velo of the two.

    Returns
    -------
    (N,) bool array
        True where all beams of the other scan near the return end beyond it. False where the
        other scan has too few beams in that direction.

    Examples
    --------
    A wall at 10 m, and a post in front of it that is in the first scan only:

    >>> y, z = (grid.ravel() for grid in np.mgrid[-1:1:0.05, -1:1:0.05])
    >>> wall = np.stack([np.full(y.size, 10.0), y, z], axis=1)
    >>> with_post = np.vstack([wall, [[5.0, 0.0, 0.0]]])
    >>> dynamic_returns(with_post, np.eye(4), wall, np.eye(4)).nonzero()[0]
    array([1600])
    """
    found = np.zeros(len(points), dtype=bool)
    row = np.flatnonzero(finite_rows(points))
    query, query_m = directions(transform(inverse(other_pose) @ pose, points[row, :3]))
    beams, beams_m = directions(other[finite_rows(other), :3].astype(np.float64))
    if len(row) == 0 or len(beams) == 0:
        return found
    _, nearest = nearest_directions(beams, query, MAX_BEAMS, NEIGHBOUR_ANGLE_DEG)
    exists = nearest < len(beams)
    ranges = np.append(beams_m, np.inf)[nearest]
    beyond = ranges > (query_m + BEYOND_M + BEYOND_FRACTION * query_m)[:, None]
    found[row] = (exists.sum(axis=1) >= MIN_BEAMS) & (beyond | ~exists).all(axis=1)
    return found


def dynamic_lines(
    viewpoint: Float64Array,
    targets: Float64Array,
    points_i: FloatArray,
    pose_i: Float64Array,
    points_j: FloatArray,
    pose_j: Float64Array,
) -> BoolArray:
    """Which sight lines pass an object that left or arrived between two scans.

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
        Whether a dynamic return of one of the scans lies on the line, before the target.
    """
    disappeared = points_i[dynamic_returns(points_i, pose_i, points_j, pose_j), :3]
    appeared = points_j[dynamic_returns(points_j, pose_j, points_i, pose_i), :3]
    return _passes(viewpoint, targets, transform(pose_i, disappeared)) | _passes(
        viewpoint, targets, transform(pose_j, appeared)
    )


def _passes(viewpoint: Float64Array, targets: Float64Array, obstacles: Float64Array) -> BoolArray:
    """Which sight lines (K,) pass one of the points (T, 3) before their target; world frame."""
    target, target_m = directions(targets - viewpoint)
    obstacle, obstacle_m = directions(obstacles - viewpoint)
    if len(obstacle) == 0 or len(target) == 0:
        return np.zeros(len(targets), dtype=bool)
    _, nearest = nearest_directions(obstacle, target, MAX_BEAMS, LINE_ANGLE_DEG)
    ranges = np.append(obstacle_m, np.inf)[nearest]
    return np.asarray((ranges < target_m[:, None]).any(axis=1))
