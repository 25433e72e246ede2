"""Depth buffer: a target is occluded where a return in its direction cell is clearly nearer."""

import numpy as np

from intervis.arrays import Float64Array, IntArray
from intervis.lab.truth.baselines.input_scans import InputScans


def predict(
    inputs: InputScans,
    viewpoint: Float64Array,
    targets: Float64Array,
    *,
    azimuth_deg: float,
    elevation_deg: float,
    tolerance_m: float,
    tolerance_fraction: float,
) -> Float64Array:
    """1 where no return in the target's cell is clearly nearer, 0 elsewhere; see `baselines`.

    Parameters
    ----------
    azimuth_deg, elevation_deg : float
        Size of a cell of the buffer, which covers all directions around the viewpoint.
    tolerance_m, tolerance_fraction : float
        A return occludes targets that are farther by this, plus a fraction of the target's range.
    """
    row, column, range_m, shape = _cells(
        np.vstack([targets, inputs.points_world]) - viewpoint, azimuth_deg, elevation_deg
    )
    nearest = np.full(shape, np.inf)
    count = len(targets)
    np.minimum.at(nearest, (row[count:], column[count:]), range_m[count:])
    limit = (
        nearest[row[:count], column[:count]] + tolerance_m + tolerance_fraction * range_m[:count]
    )
    return (range_m[:count] <= limit).astype(np.float64)


def _cells(
    points: Float64Array, azimuth_deg: float, elevation_deg: float
) -> tuple[IntArray, IntArray, Float64Array, tuple[int, int]]:
    """Row, column and range (N,) of points relative to the viewpoint, and the buffer's shape."""
    horizontal_m = np.hypot(points[:, 0], points[:, 1])
    azimuth = np.degrees(np.arctan2(points[:, 1], points[:, 0])) + 180.0
    elevation = np.degrees(np.arctan2(points[:, 2], horizontal_m)) + 90.0
    columns, rows = int(np.ceil(360.0 / azimuth_deg)), int(np.ceil(180.0 / elevation_deg)) + 1
    column = (azimuth / azimuth_deg).astype(np.int64) % columns
    row = (elevation / elevation_deg).astype(np.int64)
    return row, column, np.hypot(horizontal_m, points[:, 2]), (rows, columns)
