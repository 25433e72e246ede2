"""Answerable sight lines: lines of an exact world that one scan determines, for any method.

A line is visible when beams have crossed the space along it, and occluded when it crosses a
surface that a beam has hit. Where neither holds, "unknown" is the correct answer of every method.
The triangles of the world decide which case holds.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np

from intervis.arrays import BoolArray, Float64Array
from intervis.lab.worlds.ray_casting import RayCaster
from intervis.transform import inverse, transform

STEP_M = 1.0
"""Largest step of the samples along a line."""
END_M = 0.5
"""Length at each end of a line that is not sampled: the ends may lie on surfaces."""
MAX_UNOBSERVED_M = 1.0
"""A visible line is answerable where at most this length of it was crossed by no beam."""
MAX_RANGE_M = 120.0
"""A beam that hits nothing within this range returns nothing and observes nothing."""
SAME_SURFACE_M = 0.1
"""A beam hits the surface that a line crosses where the two points are at most this far apart."""
MAX_SURFACES = 8
"""At most so many surfaces along a line are examined."""


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
        Elevation of the lowest and the highest beam, sensor frame.
    """

    caster: RayCaster
    pose: Float64Array
    lowest_rad: float
    highest_rad: float

    @classmethod
    def of_scan(cls, caster: RayCaster, pose: Float64Array, scan: Float64Array) -> Self:
        """Beams between the lowest and the highest return of a scan (N, 3), sensor frame."""
        if len(scan) == 0:
            return cls(caster, pose, 0.0, 0.0)
        elevation_rad = _elevation_rad(scan)
        return cls(caster, pose, float(elevation_rad.min()), float(elevation_rad.max()))

    def cover(self, points: Float64Array) -> BoolArray:
        """Whether the points (M, 3), world frame, lie within the sensor's elevation range."""
        elevation_rad = _elevation_rad(transform(inverse(self.pose), points))
        return np.asarray((elevation_rad >= self.lowest_rad) & (elevation_rad <= self.highest_rad))

    def reach(self, points: Float64Array) -> BoolArray:
        """Whether the points (M, 3), world frame, are covered and visible from the sensor."""
        return np.asarray(self.cover(points) & ~self.caster.blocked(self.pose[:3, 3], points))

    def ranges_towards(self, points: Float64Array) -> tuple[Float64Array, Float64Array]:
        """Range of points (M, 3), world frame, and the range that a beam towards each measures.

        The latter is NaN where no beam points there, or the beam returns nothing.
        """
        origin = self.pose[:3, 3]
        offset = points - origin
        range_m = np.linalg.norm(offset, axis=1)
        far = origin + offset * (MAX_RANGE_M / np.maximum(range_m, 1e-9))[:, None]
        hit_m = self.caster.first_hit(origin, far)
        return range_m, np.where(np.isfinite(hit_m) & self.cover(points), hit_m, np.nan)


def _elevation_rad(points_velo: Float64Array) -> Float64Array:
    return np.arctan2(points_velo[:, 2], np.hypot(points_velo[:, 0], points_velo[:, 1]))


def answerable(
    beams: Beams, viewpoint: Float64Array, targets: Float64Array, visible: BoolArray
) -> BoolArray:
    """Which sight lines one scan determines.

    Parameters
    ----------
    beams : Beams
        Of that scan.
    viewpoint, targets : (3,), (K, 3) float64 arrays
        World frame, metres.
    visible : (K,) bool array
        Ground truth.

    Returns
    -------
    (K,) bool array
        For visible lines: whether beams crossed all of the line but `MAX_UNOBSERVED_M`. For
        occluded lines: whether a beam hit one of the surfaces that the line crosses.
    """
    found = np.zeros(len(targets), dtype=bool)
    found[visible] = _crossed(beams, viewpoint, targets[visible])
    found[~visible] = _hit(beams, viewpoint, targets[~visible])
    return found


def _crossed(beams: Beams, viewpoint: Float64Array, targets: Float64Array) -> BoolArray:
    """Whether beams crossed the space along lines to targets (K, 3)."""
    length = np.linalg.norm(targets - viewpoint, axis=1)
    sampled_m = np.maximum(length - 2 * END_M, 0.0)
    samples = np.ceil(sampled_m / STEP_M).astype(int)
    step_m = sampled_m / np.maximum(samples, 1)
    line = np.repeat(np.arange(len(targets)), samples)
    number = np.arange(len(line)) - np.repeat(np.cumsum(samples) - samples, samples)
    fraction = (END_M + (number + 0.5) * step_m[line]) / length[line]
    points = viewpoint + fraction[:, None] * (targets - viewpoint)[line]
    range_m, hit_m = beams.ranges_towards(points)
    unobserved = np.bincount(line, ~(range_m <= hit_m), len(targets))  # NaN counts as unobserved
    return np.asarray(unobserved * step_m <= MAX_UNOBSERVED_M)


def _hit(beams: Beams, viewpoint: Float64Array, targets: Float64Array) -> BoolArray:
    """Whether beams hit one of the surfaces on lines to targets (K, 3)."""
    found = np.zeros(len(targets), dtype=bool)
    start = np.tile(viewpoint, (len(targets), 1))
    active = np.arange(len(targets))
    for _ in range(MAX_SURFACES):
        direction = targets[active] - start[active]
        distance = beams.caster.first_hit(start[active], targets[active])
        crosses = np.isfinite(distance)
        active, direction, distance = active[crosses], direction[crosses], distance[crosses]
        if len(active) == 0:
            break
        direction /= np.linalg.norm(direction, axis=1)[:, None]
        points = start[active] + distance[:, None] * direction
        range_m, hit_m = beams.ranges_towards(points)
        found[active] = np.abs(range_m - hit_m) <= SAME_SURFACE_M
        start[active] = points + 1e-3 * direction  # continue behind this surface
        active = active[~found[active]]
    return found
