"""Directions of points seen from the origin, and the nearest of many directions."""

import numpy as np
from scipy.spatial import cKDTree

from intervis.arrays import Float64Array, IntArray
from intervis.kernels import thread_count


def directions(points: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Unit vectors (N, 3) and ranges (N,) of points (N, 3); (0, 0, 1) for a point at the origin."""
    range_m = np.sqrt(np.einsum("ij,ij->i", points, points))
    known = range_m > 0
    unit = np.tile([0.0, 0.0, 1.0], (len(points), 1))
    unit[known] = points[known] / range_m[known, None]
    return unit, range_m


def tangents(unit: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Two unit vectors (K, 3) each, across unit vectors (K, 3) and across each other.

    Examples
    --------
    >>> across, up = tangents(np.array([[0.6, 0.0, 0.8]]))
    >>> across.round(3), up.round(3)
    (array([[-0.8,  0. ,  0.6]]), array([[ 0., -1.,  0.]]))
    """
    # The coordinate axis farthest from the direction is never parallel to it.
    axis = np.eye(3)[np.argmin(np.abs(unit), axis=1)]
    across = np.cross(unit, axis)
    across /= np.linalg.norm(across, axis=1)[:, None]
    return across, np.cross(unit, across)


def chord(angle_deg: float) -> float:
    """Distance of two unit vectors that enclose an angle."""
    return float(2.0 * np.sin(np.radians(angle_deg) / 2.0))


def nearest_directions(
    candidates: Float64Array, queries: Float64Array, count: int, within_deg: float
) -> tuple[Float64Array, IntArray]:
    """The candidate directions nearest to each query direction.

    Parameters
    ----------
    candidates, queries : (N, 3), (K, 3) float64 arrays
        Unit vectors.
    count : int
        Number of neighbours of each query.
    within_deg : float
        Candidates at this angle or farther are no neighbours.

    Returns
    -------
    distance : (K, count) float64 array
        Chord distances, ascending; infinite where there are fewer neighbours.
    row : (K, count) int array
        Rows of the candidates; N where there are fewer neighbours.

    Examples
    --------
    >>> candidates = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    >>> nearest_directions(candidates, candidates[:1], 2, within_deg=1.0)
    (array([[ 0., inf]]), array([[0, 2]]))
    """
    # Beams are ordered along rings. An unbalanced tree keeps this order, so that consecutive
    # queries read memory that is still in the processor's cache.
    tree = cKDTree(candidates, balanced_tree=False, compact_nodes=False)
    distance, row = tree.query(
        queries, k=count, distance_upper_bound=chord(within_deg), workers=thread_count()
    )
    return distance, row
