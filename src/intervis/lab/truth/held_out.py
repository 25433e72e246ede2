"""Held-out returns: labels from a reference scan that the evaluated method does not get.

Scan i is the input, pose j the viewpoint, scan j the reference. A point of scan i is *visible*
from pose j where a return of scan j lies on it. It is *occluded* where all beams of scan j in its
direction end well before it. In all other cases it has no label: between the beams, at a
silhouette, or where a beam ends farther away.

Where the beams of scan j are far apart, this is not enough for "occluded": seen at a grazing angle,
the ground below a point is nearer than the point by more than any tolerance, and the beams above it
may have no return. In exact worlds most such labels are wrong (`intervis.lab.truth.label_check`).
With `LabelRule.surrounded` the nearer returns must surround the point's direction and lie at about
one range.
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
from intervis.directions import chord, directions, nearest_directions, tangents
from intervis.transform import checked_pose, inverse, transform

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
SURROUNDING_RANGES = 1.1
"""Ranges of surrounding returns differ by at most this factor: they lie on one object, not on the
ground and an object before it."""
NEAREST_SPACINGS, NEIGHBOUR_SPACINGS = 0.8, 1.3
"""Angles of `rule_for_scanner`, in beam spacings of the reference scanner."""
SCANNER_RANGE_M = (1.5, 75.0)
"""Range limits of `rule_for_scanner`."""
MAX_SPACING_DEG = 20.0
"""Neighbours of a return are searched within this angle."""


@dataclass(frozen=True)
class LabelRule:
    """Which returns of the reference scan decide on a label, and which points get one.

    The defaults are for a scanner with beams 0.1 to 0.4 degrees apart on a moving vehicle.

    Attributes
    ----------
    nearest_angle_deg : float
        There is no label where the nearest return is farther off than this.
    neighbour_angle_deg : float
        Returns within this angle of a direction are used for its label.
    min_range_m, max_range_m : float
        Points nearer to pose j (the vehicle itself) or farther away (too few beams) have no label.
    label_silhouettes : bool
        Whether a point is labelled visible although another of its returns is nearer by more than
        1 m. Such a point lies at the silhouette of a nearer object: some beams end on the object,
        some on the point. The returns do not show which holds for the point.
    surrounded : bool
        Whether a point is labelled occluded only where nearer returns lie on all sides of its
        direction, no two neighbours more than 180 degrees apart as seen from it, at ranges that
        differ by at most 10 %.
    """

    nearest_angle_deg: float = 0.15
    neighbour_angle_deg: float = 0.25
    min_range_m: float = 2.7
    max_range_m: float = 75.0
    label_silhouettes: bool = False
    surrounded: bool = False


DRIVE_RULE = LabelRule()
"""The rule for two scans of one vehicle."""
SILHOUETTES_VISIBLE = LabelRule(label_silhouettes=True)
"""The same with silhouettes labelled visible: the rule of results up to schema 2."""


def beam_spacing_deg(points: FloatArray) -> float:
    """Median angle from each return of a scan (N, 3) to its fourth nearest neighbour, degrees.

    Returns at the origin and rows that are not finite are ignored. NaN where fewer than half of
    the returns have four neighbours within 20 degrees.

    Examples
    --------
    Directions on a square grid of 0.2 degrees have four neighbours at this angle:

    >>> azimuth, elevation = np.radians(0.2 * np.mgrid[-20:21, -20:21]).reshape(2, -1)
    >>> grid = np.column_stack([np.ones(len(azimuth)), np.tan(azimuth), np.tan(elevation)])
    >>> round(beam_spacing_deg(9.0 * grid), 3)
    0.2
    """
    _, xyz = _finite(points, "points")
    unit, range_m = directions(xyz)
    unit = unit[range_m > 0]
    if len(unit) == 0:
        return float("nan")
    # Of the five nearest, the first is the return itself.
    distance, _ = nearest_directions(unit, unit, 5, MAX_SPACING_DEG)
    median = float(np.median(distance[:, 4]))
    return float(np.degrees(2 * np.arcsin(median / 2))) if np.isfinite(median) else float("nan")


def rule_for_scanner(points_j: FloatArray, *, surrounded: bool = True) -> LabelRule:
    """The rule for two scanners at one moment: angles in beam spacings of the reference scanner.

    With spacing s (`beam_spacing_deg`), the nearest return must lie within max(0.15, 0.8 s)
    degrees, and returns within max(0.25, 1.3 s) degrees are used. Points at 1.5 to 75 m have
    labels. Occluded points are surrounded by nearer returns, see `LabelRule`.
    """
    spacing_deg = float(np.nan_to_num(beam_spacing_deg(points_j)))
    return LabelRule(
        nearest_angle_deg=max(DRIVE_RULE.nearest_angle_deg, NEAREST_SPACINGS * spacing_deg),
        neighbour_angle_deg=max(DRIVE_RULE.neighbour_angle_deg, NEIGHBOUR_SPACINGS * spacing_deg),
        min_range_m=SCANNER_RANGE_M[0],
        max_range_m=SCANNER_RANGE_M[1],
        surrounded=surrounded,
    )


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
    points_i: FloatArray,
    pose_i: ArrayLike,
    points_j: FloatArray,
    pose_j: ArrayLike,
    rule: LabelRule = DRIVE_RULE,
) -> HeldOutLabels:
    """Label points of scan i as visible or occluded from pose j, by the returns of scan j.

    Let r be the range of a point of scan i from pose j. The returns of scan j within 0.25 degrees
    of its direction are compared with it, at most the eight nearest. The nearest must be within
    0.15 degrees; otherwise the point has no label.

    - visible: one of them has ``abs(range - r) < 0.15 + 0.01 r``, and none ``range < r - 1``;
    - occluded: there are at least two, and all have ``range < r - (1 + 0.02 r)``;
    - all other points have no label, nor points with ``r`` outside 2.7 to 75 m.

    These are the values of the default rule.

    Parameters
    ----------
    points_i, points_j : (N, 3), (M, 3) float arrays
        The scans, each in its own sensor's frame, metres. Rows that are not finite are ignored,
        and so are returns at the origin, which have no direction.
    pose_i, pose_j : (4, 4) arrays
        world_from_velo of the two scans.
    rule : LabelRule

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
    query = np.flatnonzero((range_i >= rule.min_range_m) & (range_i <= rule.max_range_m))
    if len(beams) == 0 or len(query) == 0:
        nothing = np.empty(0, dtype=np.int64)
        return HeldOutLabels(nothing, nothing.astype(bool), viewpoint_i, np.empty(0))

    distance, row = nearest_directions(
        direction_j[beams], direction_i[query], NEIGHBOUR_COUNT, rule.neighbour_angle_deg
    )
    beam_range = np.append(range_j[beams], np.inf)[row]  # row == len(beams): no neighbour
    visible, occluded = _classify(distance, beam_range, range_i[query], rule)
    if rule.surrounded:
        some = np.flatnonzero(occluded)
        occluded[some] = surrounded(
            direction_i[query[some]], direction_j[beams], range_j[beams], row[some]
        )
    labelled = visible | occluded
    query = query[labelled]
    return HeldOutLabels(row_i[query], visible[labelled], viewpoint_i, range_i[query])


def _finite(points: FloatArray, name: str) -> tuple[IntArray, Float64Array]:
    """The finite rows of a scan: their indices, and the points in float64."""
    xyz = checked_points(points, name)
    row = np.flatnonzero(finite_rows(xyz))
    return row, xyz[row].astype(np.float64)


def _classify(
    distance: Float64Array, beam_range: Float64Array, point_range: Float64Array, rule: LabelRule
) -> tuple[BoolArray, BoolArray]:
    """Which points are visible and which occluded, (K,) each; both False: no label.

    `distance` and `beam_range` are (K, 8): chord distance and range of the neighbouring beams.
    """
    exists = np.isfinite(distance)
    r = point_range[:, None]
    near_enough = distance[:, 0] < chord(rule.nearest_angle_deg)
    on_point = exists & (np.abs(beam_range - r) < SAME_M + SAME_FRACTION * r)
    before = beam_range < r - (BEFORE_M + BEFORE_FRACTION * r)
    visible = near_enough & on_point.any(axis=1)
    if not rule.label_silhouettes:
        visible &= ~(beam_range < r - BEFORE_M).any(axis=1)
    enough = exists.sum(axis=1) >= MIN_OCCLUDERS
    occluded = near_enough & enough & (before | ~exists).all(axis=1)
    return visible, occluded


def surrounded(
    direction: Float64Array,
    beam_direction: Float64Array,
    beam_range: Float64Array,
    row: IntArray,
) -> BoolArray:
    """Whether returns lie on all sides of directions (K, 3), at ranges that differ by 10 % at most.

    `beam_direction` (M, 3) and `beam_range` (M,) are the returns, `row` (K, 8) those around each
    direction, the nearest first and M where there is none, as of `nearest_directions`.
    """
    exists = row < len(beam_range)
    neighbours = np.append(beam_direction, np.zeros((1, 3)), axis=0)[row]
    range_m = np.append(beam_range, np.nan)[row]
    across, up = tangents(direction)
    bearing = np.arctan2(
        np.einsum("knd,kd->kn", neighbours, up), np.einsum("knd,kd->kn", neighbours, across)
    )
    # A missing neighbour repeats the first one, which is the nearest.
    bearing = np.sort(np.where(exists, bearing, bearing[:, :1]), axis=1)
    turn = np.diff(bearing, axis=1, append=bearing[:, :1] + 2.0 * np.pi)
    one_range = np.nanmax(range_m, axis=1) <= SURROUNDING_RANGES * np.nanmin(range_m, axis=1)
    return np.asarray((turn < np.pi).all(axis=1) & one_range)
