"""Directions around a viewpoint, and which of many lie beside one."""

import numpy as np
from scipy.spatial import cKDTree

from intervis.arrays import Float64Array, IntArray
from intervis.kernels import thread_count


def directions(points: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Unit vectors (N, 3) and ranges (N,) of points (N, 3); one at the origin points upwards."""
    range_m = np.sqrt(np.einsum("ij,ij->i", points, points))
    away = range_m > 0
    ways = np.tile([0.0, 0.0, 1.0], (len(points), 1))
    ways[away] = points[away] / range_m[away, None]
    return ways, range_m


def chord(angle_deg: float) -> float:
    """Distance of two unit vectors that enclose an angle."""
    return float(2.0 * np.sin(np.radians(angle_deg) / 2.0))


def nearest_directions(
    ways: Float64Array, asked: Float64Array, count: int, within_deg: float
) -> tuple[Float64Array, IntArray]:
    """Chord distance and row (K, count) of the directions nearest to each asked one.

    Nearest first; where there are fewer within the angle, infinite and ``len(ways)``.

    Examples
    --------
    >>> ways = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    >>> nearest_directions(ways, ways[:1], 2, within_deg=1.0)
    (array([[ 0., inf]]), array([[0, 2]]))
    """
    # Beams and asked directions both lie along rings: neighbours stay in the cache.
    tree = cKDTree(ways, balanced_tree=False, compact_nodes=False)
    distance, row = tree.query(
        asked, k=count, distance_upper_bound=chord(within_deg), workers=thread_count()
    )
    return distance, row
