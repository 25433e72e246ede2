"""Depth buffer: a target is visible unless a return in its cell of directions is clearly nearer."""

import numpy as np

from intervis.arrays import Float64Array, IntArray
from intervis.lab.truth.baselines.input_scans import Seen


def answer(
    seen: Seen,
    viewpoint: Float64Array,
    targets: Float64Array,
    *,
    azimuth_deg: float,
    elevation_deg: float,
    slack_m: float,
    slack_share: float,
) -> Float64Array:
    """Probability (1 or 0) that targets (M, 3) are visible, in a buffer around the viewpoint.

    Parameters
    ----------
    seen : Seen
    viewpoint : (3,) float64 array
        World frame.
    targets : (M, 3) float64 array
        World frame.
    azimuth_deg, elevation_deg : float
        Size of a cell.
    slack_m, slack_share : float
        A return hides what is farther by this much, plus a share of the target's range.
    """
    row, column, range_m, shape = _cells(
        np.vstack([targets, seen.points_world]) - viewpoint, azimuth_deg, elevation_deg
    )
    nearest = np.full(shape, np.inf)
    count = len(targets)
    np.minimum.at(nearest, (row[count:], column[count:]), range_m[count:])
    limit = nearest[row[:count], column[:count]] + slack_m + slack_share * range_m[:count]
    return (range_m[:count] <= limit).astype(np.float64)


def _cells(
    points: Float64Array, azimuth_deg: float, elevation_deg: float
) -> tuple[IntArray, IntArray, Float64Array, tuple[int, int]]:
    flat = np.hypot(points[:, 0], points[:, 1])
    azimuth = np.degrees(np.arctan2(points[:, 1], points[:, 0])) + 180.0
    elevation = np.degrees(np.arctan2(points[:, 2], flat)) + 90.0
    columns, rows = int(np.ceil(360.0 / azimuth_deg)), int(np.ceil(180.0 / elevation_deg)) + 1
    column = (azimuth / azimuth_deg).astype(np.int64) % columns
    row = (elevation / elevation_deg).astype(np.int64)
    return row, column, np.hypot(flat, points[:, 2]), (rows, columns)
