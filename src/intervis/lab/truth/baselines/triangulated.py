"""Triangulated scans: each scan becomes a surface over its directions, and rays are cast at it."""

from collections import OrderedDict
from dataclasses import dataclass, field
from time import perf_counter

import numpy as np
from scipy.spatial import Delaunay

from intervis.arrays import BoolArray, Float64Array, FloatArray, finite_rows
from intervis.lab.truth.baselines.input_scans import Seen
from intervis.lab.worlds.ray_casting import RayCaster
from intervis.transform import inverse, transform

SEAM_DEG = 5.0
"""The chart is continued this far over its seam, so that the surface closes behind the sensor."""


def surface(scan: FloatArray, jump_share: float, longest_m: float = np.inf) -> Float64Array:
    """Triangles (F, 3, 3) over a scan: Delaunay in azimuth and elevation, cut where ranges jump.

    Parameters
    ----------
    scan : (N, 3) float array
        Sensor frame, metres.
    jump_share : float
        A triangle goes when its farthest corner is farther than its nearest one by this share.
    longest_m : float
        A triangle goes when an edge of it is longer.

    Examples
    --------
    >>> ahead = np.array([[9.0, 0, 0], [9, 1, 0], [9, 0, 1], [20, 3, 1]])
    >>> len(surface(ahead, 0.2)), len(surface(ahead, 9.0))
    (1, 2)
    """
    points = np.asarray(scan[finite_rows(scan), :3], dtype=np.float64)
    range_m = np.linalg.norm(points, axis=1)
    points, range_m = points[range_m > 0], range_m[range_m > 0]
    azimuth = np.degrees(np.arctan2(points[:, 1], points[:, 0]))
    elevation = np.degrees(np.arcsin(np.clip(points[:, 2] / range_m, -1, 1)))
    over = np.flatnonzero(azimuth < -180.0 + SEAM_DEG)
    row = np.concatenate([np.arange(len(points)), over])
    chart = np.column_stack([np.concatenate([azimuth, azimuth[over] + 360.0]), elevation[row]])
    if len(row) < 4:
        return np.empty((0, 3, 3))
    face = row[Delaunay(chart).simplices]
    corner_range = range_m[face]
    near, far = corner_range.min(axis=1), corner_range.max(axis=1)
    triangles: Float64Array = points[face]
    edge = np.linalg.norm(triangles - np.roll(triangles, 1, axis=1), axis=2).max(axis=1)
    kept: Float64Array = triangles[(far <= (1 + jump_share) * near) & (edge <= longest_m)]
    return kept


@dataclass
class Surfaces:
    """The surfaces made last: pairs of poses share scans, and meshing is the dear part.

    Attributes
    ----------
    most : int
        How many are kept.
    cost_s : float
        What the surfaces handed out so far cost to make, each time anew.
    spent_s : float
        What was really spent on making them.
    """

    most: int = 24
    cost_s: float = 0.0
    spent_s: float = 0.0
    _kept: OrderedDict[tuple[int, float, float], tuple[FloatArray, RayCaster, float]] = field(
        default_factory=OrderedDict
    )

    def of(self, scan: FloatArray, jump_share: float, longest_m: float) -> RayCaster:
        """The ray caster of a scan's surface, in the scan's own frame."""
        key = (id(scan), jump_share, longest_m)
        if key not in self._kept:
            start = perf_counter()
            caster = RayCaster(surface(scan, jump_share, longest_m))
            took = perf_counter() - start
            self.spent_s += took
            # the scan is kept as well: as long as it lives, no other array has its id
            self._kept[key] = (scan, caster, took)
            while len(self._kept) > self.most:
                self._kept.popitem(last=False)
        self._kept.move_to_end(key)
        self.cost_s += self._kept[key][2]
        return self._kept[key][1]


SURFACES = Surfaces()


def answer(
    seen: Seen,
    viewpoint: Float64Array,
    targets: Float64Array,
    *,
    jump_share: float,
    slack_m: float,
    slack_share: float,
    longest_m: float = np.inf,
    each_side: int = 3,
    votes: int = 1,
) -> Float64Array:
    """Probability that targets (M, 3) are visible, by votes of the nearest scans' surfaces.

    Parameters
    ----------
    seen : Seen
    viewpoint : (3,) float64 array
        World frame.
    targets : (M, 3) float64 array
        World frame.
    jump_share, longest_m : float
        Which triangles are cut; see `surface`.
    slack_m, slack_share : float
        A surface this near the target, plus a share of its range, does not hide it.
    each_side : int
        So many scans before and after the viewpoint vote, and the asked one.
    votes : int
        So many surfaces must be in the way; never more than there are scans.

    Returns
    -------
    (M,) float64 array
        0.5 or more where fewer surfaces than ``votes`` are in the way. The number falls with
        every vote, so that it can be ranked; it is no calibrated probability.
    """
    voters = seen.nearest(each_side)
    against = np.zeros(len(targets))
    slack = slack_m + slack_share * np.linalg.norm(targets - viewpoint, axis=1)
    for scan, pose in zip(voters.scans, voters.poses, strict=True):
        blocked: BoolArray = SURFACES.of(scan, jump_share, longest_m).blocked(
            transform(inverse(pose), viewpoint), transform(inverse(pose), targets), slack_m=slack
        )
        against += blocked
    needed = min(votes, len(voters.scans)) - 0.5
    return 1.0 / (1.0 + (against / needed) ** 2) if needed > 0 else np.ones(len(targets))
