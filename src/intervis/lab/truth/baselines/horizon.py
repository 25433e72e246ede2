"""Horizon: in each sector of azimuth, a target is hidden below the highest return before it.

What terrain viewsheds do, with the returns as heights: overhanging things hide all that is below
the line over them.
"""

import numpy as np

from intervis.arrays import Float64Array, IntArray
from intervis.lab.truth.baselines.input_scans import Seen


def answer(
    seen: Seen,
    viewpoint: Float64Array,
    targets: Float64Array,
    *,
    azimuth_deg: float,
    slack_m: float,
    slack_share: float,
) -> Float64Array:
    """Probability (1 or 0) that targets (M, 3) are visible over the horizon before them.

    Parameters
    ----------
    seen : Seen
    viewpoint : (3,) float64 array
        World frame; its z axis points up.
    targets : (M, 3) float64 array
        World frame.
    azimuth_deg : float
        Width of a sector.
    slack_m, slack_share : float
        Returns less far before the target than this, plus a share of its range, do not count.
    """
    count = len(targets)
    points = np.vstack([targets, seen.points_world]) - viewpoint
    flat = np.hypot(points[:, 0], points[:, 1])
    slope = np.arctan2(points[:, 2], flat)
    azimuth = np.degrees(np.arctan2(points[:, 1], points[:, 0])) + 180.0
    sector = (azimuth / azimuth_deg).astype(np.int64)
    # one sorted line: sector by sector, and inside a sector by distance
    key = sector * 1e6 + np.minimum(flat, 9e5)
    order = np.argsort(key[count:], kind="stable") + count
    highest = _running_maximum(slope[order], sector[order])
    asked = sector[:count] * 1e6 + np.clip(flat[:count] * (1 - slack_share) - slack_m, 0.0, 9e5)
    place = np.searchsorted(key[order], asked) - 1
    inside = (place >= 0) & (sector[order][place] == sector[:count])
    horizon = np.where(inside, highest[place], -np.inf)
    return (slope[:count] >= horizon).astype(np.float64)


def _running_maximum(slope: Float64Array, sector: IntArray) -> Float64Array:
    """Highest slope (N,) so far within each run of equal sectors."""
    lift = sector * 10.0  # slopes lie within +-pi/2: a later sector starts above all earlier ones
    highest: Float64Array = np.maximum.accumulate(slope + lift) - lift
    return highest
