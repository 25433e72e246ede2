"""Triangulated scans: each scan is meshed over its directions, and sight lines are cast at it."""

from collections import OrderedDict
from dataclasses import dataclass, field
from time import perf_counter

import numpy as np
from scipy.spatial import Delaunay

from intervis.arrays import BoolArray, Float64Array, FloatArray, finite_rows
from intervis.lab.truth.baselines.input_scans import InputScans
from intervis.lab.worlds.ray_casting import RayCaster
from intervis.transform import inverse, transform

SEAM_DEG = 5.0
"""Points this near to azimuth -180 are repeated beyond +180, so that the mesh has no gap there."""


def surface(scan: FloatArray, jump_fraction: float) -> Float64Array:
    """Triangles (F, 3, 3) over a scan: Delaunay in azimuth and elevation, cut at range jumps.

    Parameters
    ----------
    scan : (N, 3) float array
        Sensor frame, metres.
    jump_fraction : float
        Triangles whose farthest corner is farther than the nearest one by more than this fraction
        are removed.

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
    repeated = np.flatnonzero(azimuth < -180.0 + SEAM_DEG)
    row = np.concatenate([np.arange(len(points)), repeated])
    plane = np.column_stack([np.concatenate([azimuth, azimuth[repeated] + 360.0]), elevation[row]])
    if len(row) < 4:
        return np.empty((0, 3, 3))
    face = row[Delaunay(plane).simplices]
    near, far = range_m[face].min(axis=1), range_m[face].max(axis=1)
    triangles: Float64Array = points[face[far <= (1 + jump_fraction) * near]]
    return triangles


@dataclass
class SurfaceCache:
    """The ray casters of the scans used last: query sets share scans, and meshing is slow.

    Attributes
    ----------
    size : int
        Number of casters kept.
    cost_s : float
        Seconds that all surfaces returned so far would have cost without the cache.
    spent_s : float
        Seconds actually spent on meshing.
    """

    size: int = 24
    cost_s: float = 0.0
    spent_s: float = 0.0
    _kept: OrderedDict[tuple[int, float], tuple[FloatArray, RayCaster, float]] = field(
        default_factory=OrderedDict
    )

    def caster(self, scan: FloatArray, jump_fraction: float) -> RayCaster:
        """The ray caster of a scan's surface, in the scan's own frame."""
        key = (id(scan), jump_fraction)
        if key not in self._kept:
            start = perf_counter()
            caster = RayCaster(surface(scan, jump_fraction))
            took = perf_counter() - start
            self.spent_s += took
            # Holds the scan too: as long as it is alive, no other array can have its id.
            self._kept[key] = (scan, caster, took)
            while len(self._kept) > self.size:
                self._kept.popitem(last=False)
        self._kept.move_to_end(key)
        self.cost_s += self._kept[key][2]
        return self._kept[key][1]


SURFACES = SurfaceCache()


def predict(
    inputs: InputScans,
    viewpoint: Float64Array,
    targets: Float64Array,
    *,
    jump_fraction: float,
    tolerance_m: float,
    tolerance_fraction: float,
    each_side: int = 3,
    votes: int = 1,
) -> Float64Array:
    """Votes of the nearest scans' surfaces as a score from 0 to 1; see `baselines`.

    Parameters
    ----------
    jump_fraction : float
        As in `surface`.
    tolerance_m, tolerance_fraction : float
        A surface this near to the target, plus a fraction of the target's range, does not occlude
        it.
    each_side : int
        Number of scans before and after the viewpoint that vote, beside the target frame's scan.
    votes : int
        Number of surfaces that must block the sight line; at most the number of scans.

    Returns
    -------
    (M,) float64 array
        0.5 or more where fewer than ``votes`` surfaces block the line. The value falls with every
        vote, so that it can be ranked; it is not a calibrated probability.
    """
    voters = inputs.nearest(each_side)
    blocked_count = np.zeros(len(targets))
    distance_m = np.linalg.norm(targets - viewpoint, axis=1)
    tolerance = tolerance_m + tolerance_fraction * distance_m
    for scan, pose in zip(voters.scans, voters.poses, strict=True):
        blocked: BoolArray = SURFACES.caster(scan, jump_fraction).blocked(
            transform(inverse(pose), viewpoint),
            transform(inverse(pose), targets),
            slack_m=tolerance,
        )
        blocked_count += blocked
    needed = min(votes, len(voters.scans)) - 0.5
    return 1.0 / (1.0 + (blocked_count / needed) ** 2) if needed > 0 else np.ones(len(targets))
