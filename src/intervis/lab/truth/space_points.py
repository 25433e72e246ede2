"""Random points in space, labelled by the returns of a reference scan.

The points lie in the field of view of the reference scanner: along the directions of its returns,
and between them. They need not lie on a surface. A point is *visible* from the scanner where all
its beams in that direction end beyond the point, and *occluded* where all end before it: in front
of a surface or behind one, in the air or below the ground. Directions without a return have no
points: a scan does not tell whether a beam was sent there.
"""

from dataclasses import dataclass

import numpy as np

from intervis.arrays import BoolArray, Float64Array, FloatArray, finite_rows
from intervis.directions import chord, directions, nearest_directions, tangents
from intervis.lab.truth.held_out import (
    MIN_OCCLUDERS,
    NEIGHBOUR_COUNT,
    SAME_FRACTION,
    SAME_M,
    LabelRule,
    surrounded,
)

SPACE_COUNT = 30_000
"""Number of points drawn for each pair; a part of them gets a label."""
SPACE_RANGE_M = 40.0
"""Largest range of the points."""


@dataclass(frozen=True, eq=False)
class SpacePoints:
    """Labelled points in space.

    Attributes
    ----------
    points : (K, 3) float64 array
        Frame of the reference scanner, metres.
    visible : (K,) bool array
        True: visible from the reference scanner. False: occluded.
    """

    points: Float64Array
    visible: BoolArray


def space_points(
    reference: FloatArray, rule: LabelRule, count: int, rng: np.random.Generator
) -> SpacePoints:
    """Draw points in the field of view of a reference scan, and label them by its returns.

    A direction is that of a random return, turned by up to the rule's ``nearest_angle_deg`` along
    two axes. The range is uniform from the rule's smallest range to 40 m. With range r, the
    returns within ``neighbour_angle_deg`` of the direction are compared, at most the eight nearest,
    of which the nearest must be within ``nearest_angle_deg``:

    - visible: all have ``range > r + 0.15 + 0.01 r``;
    - occluded: there are at least two, and all have ``range < r - (0.15 + 0.01 r)`` (and they
      surround the direction, if the rule says so);
    - other points are left out: at a surface, or at a silhouette.

    Parameters
    ----------
    reference : (N, 3) float array
        The scan, in its scanner's frame, metres.
    rule : LabelRule
    count : int
        Number of points drawn.
    rng : numpy.random.Generator

    Examples
    --------
    A wall 10 m ahead: points before it are visible, points behind it are not.

    >>> y, z = (grid.ravel() for grid in np.mgrid[-2:2:0.03, -2:2:0.03])
    >>> wall = np.column_stack([np.full(y.size, 10.0), y, z])
    >>> found = space_points(wall, LabelRule(), 1000, np.random.default_rng(0))
    >>> x = found.points[:, 0]
    >>> bool((x[found.visible] < 10).all()), bool((x[~found.visible] > 10).all())
    (True, True)
    """
    unit, range_m = directions(reference[finite_rows(reference), :3].astype(np.float64))
    beams, beams_m = unit[range_m > 0], range_m[range_m > 0]
    if len(beams) == 0:
        return SpacePoints(np.empty((0, 3)), np.empty(0, dtype=bool))
    query = _turned(beams[rng.integers(0, len(beams), count)], rule.nearest_angle_deg, rng)
    query_m = rng.uniform(rule.min_range_m, min(rule.max_range_m, SPACE_RANGE_M), count)
    distance, row = nearest_directions(beams, query, NEIGHBOUR_COUNT, rule.neighbour_angle_deg)
    exists = np.isfinite(distance)
    ends = np.append(beams_m, np.nan)[row]  # row == len(beams): no neighbour
    r, margin = query_m[:, None], (SAME_M + SAME_FRACTION * query_m)[:, None]
    near_enough = distance[:, 0] < chord(rule.nearest_angle_deg)
    visible = near_enough & ((ends > r + margin) | ~exists).all(axis=1)
    occluded = near_enough & ((ends < r - margin) | ~exists).all(axis=1)
    occluded &= exists.sum(axis=1) >= MIN_OCCLUDERS
    if rule.surrounded:
        some = np.flatnonzero(occluded)
        occluded[some] = surrounded(query[some], beams, beams_m, row[some])
    labelled = visible | occluded
    return SpacePoints((r * query)[labelled], visible[labelled])


def _turned(unit: Float64Array, angle_deg: float, rng: np.random.Generator) -> Float64Array:
    """Unit vectors (K, 3) turned by up to an angle along each of two axes across them."""
    first, second = tangents(unit)
    shift = np.tan(np.radians(rng.uniform(-angle_deg, angle_deg, (2, len(unit), 1))))
    turned = unit + shift[0] * first + shift[1] * second
    return np.asarray(turned / np.linalg.norm(turned, axis=1)[:, None])
