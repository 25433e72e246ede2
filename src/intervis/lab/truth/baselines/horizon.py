"""2.5-D horizon: a target is occluded below the highest return before it in its azimuth sector.

This is the rule of terrain viewsheds, with the returns as heights: an overhanging object occludes
everything below the line over it.
"""

import numpy as np

from intervis.arrays import Float64Array, IntArray
from intervis.lab.truth.baselines.input_scans import InputScans

MAX_DISTANCE_M = 9e5
"""Horizontal distances are clipped to this, so that they stay below the sectors' spacing."""
SECTOR_SPACING_M = 1e6
"""Sort key: sector number times this, plus the horizontal distance."""


def predict(
    inputs: InputScans,
    viewpoint: Float64Array,
    targets: Float64Array,
    *,
    azimuth_deg: float,
    tolerance_m: float,
    tolerance_fraction: float,
) -> Float64Array:
    """1 where a target lies on or above the horizon before it, 0 elsewhere; see `baselines`.

    Parameters
    ----------
    azimuth_deg : float
        Width of a sector.
    tolerance_m, tolerance_fraction : float
        Returns that lie less than this before the target, plus a fraction of its horizontal
        distance, are ignored.
    """
    count = len(targets)
    points = np.vstack([targets, inputs.points_world]) - viewpoint
    horizontal_m = np.hypot(points[:, 0], points[:, 1])
    elevation_rad = np.arctan2(points[:, 2], horizontal_m)
    azimuth = np.degrees(np.arctan2(points[:, 1], points[:, 0])) + 180.0
    sector = (azimuth / azimuth_deg).astype(np.int64)
    # Returns sorted by sector, and by distance within a sector.
    key = sector * SECTOR_SPACING_M + np.minimum(horizontal_m, MAX_DISTANCE_M)
    order = np.argsort(key[count:], kind="stable") + count
    highest = _running_maximum(elevation_rad[order], sector[order])
    limit_m = horizontal_m[:count] * (1 - tolerance_fraction) - tolerance_m
    query = sector[:count] * SECTOR_SPACING_M + np.clip(limit_m, 0.0, MAX_DISTANCE_M)
    last = np.searchsorted(key[order], query) - 1
    inside = (last >= 0) & (sector[order][last] == sector[:count])
    horizon = np.where(inside, highest[last], -np.inf)
    return (elevation_rad[:count] >= horizon).astype(np.float64)


def _running_maximum(elevation_rad: Float64Array, sector: IntArray) -> Float64Array:
    """Highest elevation (N,) so far within each run of equal sectors."""
    # Elevations lie within +-pi/2: with this offset a sector starts above all earlier ones.
    offset = sector * 10.0
    highest: Float64Array = np.maximum.accumulate(elevation_rad + offset) - offset
    return highest
