"""Which sight lines of an exact world one scan can honestly answer, whoever answers them.

"Visible" says that beams have crossed the space along the line, "occluded" that the line meets a
surface that a beam has hit. Where neither is so, "unknown" is the right word however the line runs,
and no method may be blamed for it. Here the world's triangles say what is so.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np

from intervis.arrays import BoolArray, Float64Array
from intervis.lab.worlds.ray_casting import RayCaster
from intervis.transform import inverse, transform

STEP_M = 1.0
"""Space along a line is looked at in steps of this length."""
END_M = 0.5
"""So near to a line's ends it is not: they may lie on surfaces."""
MOST_UNSEEN_M = 1.0
"""A line is answerable as visible where no more of it than this was crossed by no beam."""
RANGE_M = 120.0
"""A beam that meets nothing over this length does not come back, and tells nothing."""
ON_IT_M = 0.1
"""What a beam hits lies on a surface met by the line if they are so near together."""
MOST_SURFACES = 8
"""So many surfaces along one line are looked at."""


@dataclass(frozen=True, eq=False)
class Beams:
    """The beams of one scan in a world of known triangles.

    Attributes
    ----------
    caster : RayCaster
        Over the triangles of the world, world frame.
    pose : (4, 4) float64 array
        world_from_velo of the scan.
    lowest_rad, highest_rad : float
        Elevation of the lowest and the highest beam, in the sensor's frame.
    """

    caster: RayCaster
    pose: Float64Array
    lowest_rad: float
    highest_rad: float

    @classmethod
    def of_scan(cls, caster: RayCaster, pose: Float64Array, scan: Float64Array) -> Self:
        """Between the lowest and the highest return of a scan (N, 3), in its sensor's frame."""
        if len(scan) == 0:
            return cls(caster, pose, 0.0, 0.0)
        elevation_rad = _elevation_rad(scan)
        return cls(caster, pose, float(elevation_rad.min()), float(elevation_rad.max()))

    def fan_holds(self, points: Float64Array) -> BoolArray:
        """Whether a beam goes towards each of the points (M, 3), world frame."""
        elevation_rad = _elevation_rad(transform(inverse(self.pose), points))
        return np.asarray((elevation_rad >= self.lowest_rad) & (elevation_rad <= self.highest_rad))

    def see(self, points: Float64Array) -> BoolArray:
        """Whether the sensor has a free way to each of the points, within the fan."""
        return np.asarray(self.fan_holds(points) & ~self.caster.blocked(self.pose[:3, 3], points))

    def towards(self, points: Float64Array) -> tuple[Float64Array, Float64Array]:
        """Range of points (M, 3) from the sensor, and how far a beam towards each of them goes.

        The latter is NaN where no beam goes there, or none comes back.
        """
        way = points - self.pose[:3, 3]
        range_m = np.linalg.norm(way, axis=1)
        far = self.pose[:3, 3] + way * (RANGE_M / np.maximum(range_m, 1e-9))[:, None]
        reach_m = self.caster.first_hit(self.pose[:3, 3], far)
        return range_m, np.where(np.isfinite(reach_m) & self.fan_holds(points), reach_m, np.nan)


def _elevation_rad(points_velo: Float64Array) -> Float64Array:
    return np.arctan2(points_velo[:, 2], np.hypot(points_velo[:, 0], points_velo[:, 1]))


def answerable(
    beams: Beams, viewpoint: Float64Array, targets: Float64Array, visible: BoolArray
) -> BoolArray:
    """Which lines could be answered rightly, by their true answer, from what one scan saw.

    Parameters
    ----------
    beams : Beams
        Of that scan.
    viewpoint, targets : (3,), (K, 3) float64 arrays
        World frame, metres.
    visible : (K,) bool array
        The truth.

    Returns
    -------
    (K,) bool array
        Of visible lines: whether beams crossed all of it but `MOST_UNSEEN_M`. Of others: whether a
        beam hit one of the surfaces that the line meets.
    """
    found = np.zeros(len(targets), dtype=bool)
    found[visible] = _crossed(beams, viewpoint, targets[visible])
    found[~visible] = _hit(beams, viewpoint, targets[~visible])
    return found


def _crossed(beams: Beams, viewpoint: Float64Array, targets: Float64Array) -> BoolArray:
    """Whether beams crossed the space along lines (K, 3)."""
    length = np.linalg.norm(targets - viewpoint, axis=1)
    looked_m = np.maximum(length - 2 * END_M, 0.0)
    steps = np.ceil(looked_m / STEP_M).astype(int)
    step_m = looked_m / np.maximum(steps, 1)
    line = np.repeat(np.arange(len(targets)), steps)
    number = np.arange(len(line)) - np.repeat(np.cumsum(steps) - steps, steps)
    share = (END_M + (number + 0.5) * step_m[line]) / length[line]
    points = viewpoint + share[:, None] * (targets - viewpoint)[line]
    range_m, reach_m = beams.towards(points)
    unseen = np.bincount(line, ~(range_m <= reach_m), len(targets))
    return np.asarray(unseen * step_m <= MOST_UNSEEN_M)


def _hit(beams: Beams, viewpoint: Float64Array, targets: Float64Array) -> BoolArray:
    """Whether beams hit one of the surfaces on lines (K, 3)."""
    found = np.zeros(len(targets), dtype=bool)
    start = np.tile(viewpoint, (len(targets), 1))
    left = np.arange(len(targets))
    for _ in range(MOST_SURFACES):
        way = targets[left] - start[left]
        at_m = beams.caster.first_hit(start[left], targets[left])
        met = np.isfinite(at_m)
        left, way, at_m = left[met], way[met], at_m[met]
        if len(left) == 0:
            break
        way /= np.linalg.norm(way, axis=1)[:, None]
        points = start[left] + at_m[:, None] * way
        range_m, reach_m = beams.towards(points)
        found[left] = np.abs(range_m - reach_m) <= ON_IT_M
        start[left] = points + 1e-3 * way  # on, behind this surface
        left = left[~found[left]]
    return found
