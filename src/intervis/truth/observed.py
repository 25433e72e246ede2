"""Which sight lines of an exact world one scan can honestly answer, whoever answers them.

"Visible" says that beams have crossed the space along the line, "occluded" that the line meets a
surface that a beam has hit. Where neither is so, "unknown" is the right word however the line runs,
and no method may be blamed for it. Here the world's triangles say what is so.
"""

import numpy as np

from intervis.arrays import BoolArray, Float64Array
from intervis.transform import inverse, transform
from intervis.truth.rays import SegmentCaster

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


def answerable(
    caster: SegmentCaster,
    pose: Float64Array,
    fan_rad: tuple[float, float],
    viewpoint: Float64Array,
    targets: Float64Array,
    visible: BoolArray,
) -> BoolArray:
    """Which lines could be answered rightly, by their true answer, from what one scan saw.

    Parameters
    ----------
    caster : SegmentCaster
        Over the triangles of the world, world frame.
    pose : (4, 4) float64 array
        world_from_velo of the scan.
    fan_rad : (float, float)
        Lowest and highest elevation of its beams, in the sensor's frame.
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
    found[visible] = _crossed(caster, pose, fan_rad, viewpoint, targets[visible])
    found[~visible] = _hit(caster, pose, fan_rad, viewpoint, targets[~visible])
    return found


def _crossed(
    caster: SegmentCaster,
    pose: Float64Array,
    fan_rad: tuple[float, float],
    viewpoint: Float64Array,
    targets: Float64Array,
) -> BoolArray:
    """Whether beams crossed the space along lines (K, 3)."""
    length = np.linalg.norm(targets - viewpoint, axis=1)
    looked_m = np.maximum(length - 2 * END_M, 0.0)
    steps = np.ceil(looked_m / STEP_M).astype(int)
    line = np.repeat(np.arange(len(targets)), steps)
    number = np.arange(len(line)) - np.repeat(np.cumsum(steps) - steps, steps)
    share = (END_M + (number + 0.5) * (looked_m / np.maximum(steps, 1))[line]) / length[line]
    points = viewpoint + share[:, None] * (targets - viewpoint)[line]
    range_m, reach_m = _beams(caster, pose, fan_rad, points)
    unseen = np.bincount(line, ~(range_m <= reach_m), len(targets))
    return np.asarray(unseen * (looked_m / np.maximum(steps, 1)) <= MOST_UNSEEN_M)


def _hit(
    caster: SegmentCaster,
    pose: Float64Array,
    fan_rad: tuple[float, float],
    viewpoint: Float64Array,
    targets: Float64Array,
) -> BoolArray:
    """Whether beams hit one of the surfaces on lines (K, 3)."""
    found = np.zeros(len(targets), dtype=bool)
    start = np.tile(viewpoint, (len(targets), 1))
    left = np.arange(len(targets))
    for _ in range(MOST_SURFACES):
        way = targets[left] - start[left]
        length = np.linalg.norm(way, axis=1)
        at_m = caster.first_hit(start[left], targets[left])
        met = np.isfinite(at_m)
        left, way, at_m, length = left[met], way[met], at_m[met], length[met]
        if len(left) == 0:
            break
        way /= length[:, None]
        points = start[left] + at_m[:, None] * way
        range_m, reach_m = _beams(caster, pose, fan_rad, points)
        found[left] = np.abs(range_m - reach_m) <= ON_IT_M
        start[left] = points + 1e-3 * way  # on, behind this surface
        left = left[~found[left]]
    return found


def _beams(
    caster: SegmentCaster, pose: Float64Array, fan_rad: tuple[float, float], points: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """Range of points (M, 3) from the sensor, and how far a beam towards each of them goes.

    NaN where no beam goes there, or none comes back.
    """
    own = transform(inverse(pose), points)
    range_m = np.linalg.norm(own, axis=1)
    elevation = np.arctan2(own[:, 2], np.hypot(own[:, 0], own[:, 1]))
    sensor = pose[:3, 3]
    far = sensor + (points - sensor) * (RANGE_M / np.maximum(range_m, 1e-9))[:, None]
    reach_m = caster.first_hit(sensor, far)
    told = np.isfinite(reach_m) & (elevation >= fan_rad[0]) & (elevation <= fan_rad[1])
    return range_m, np.where(told, reach_m, np.nan)
