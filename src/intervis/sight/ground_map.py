"""Terrain height around a sensor.

Traffic, people and parked cars occupy the lowest two metres. The prior that unobserved space is
occupied therefore depends on the height above ground.
"""

import numpy as np

from intervis.arrays import Float32Array, Float64Array
from intervis.sight.kernels.terrain import (
    CELLS,
    extrapolate,
    lowest_returns,
    remove_outliers,
    remove_too_low,
    slope_filter,
)

USUAL_MOUNT_M = 1.7
"""Height of the sensor above ground that is assumed if the scan shows no ground."""


def ground_map_of(points_velo: Float64Array) -> Float32Array:
    """Height of the ground around the sensor.

    Parameters
    ----------
    points_velo : (N, 3) float64 array
        A scan in its sensor's frame, metres, z up.

    Returns
    -------
    (CELLS, CELLS) float32 array
        Metres in the sensor's frame, on cells of `kernels.terrain.CELL_M`. Row a covers x from
        (a - CELLS / 2) CELL_M on, column b the same in y. -1.7 m everywhere if the scan shows no
        ground.

    Examples
    --------
    >>> x, y = np.meshgrid(np.arange(-9, 9, 0.2), np.arange(-9, 9, 0.2))
    >>> flat = np.stack([x.ravel(), y.ravel(), np.full(x.size, -2.0)], axis=1)
    >>> float(ground_map_of(flat)[64, 64])
    -2.0
    """
    lowest = np.empty((CELLS, CELLS), np.float32)
    height = np.empty((CELLS, CELLS), np.float32)
    lowest_returns(points_velo, lowest)
    remove_outliers(lowest, height)
    remove_too_low(height)
    if not np.isfinite(height).any():
        height[:] = -USUAL_MOUNT_M
        return height
    known = np.isfinite(height)
    slope_filter(height)
    extrapolate(height, known)
    return height
