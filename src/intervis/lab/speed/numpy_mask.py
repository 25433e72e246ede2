"""`intervis.visible_mask` in plain numpy: what it is timed against, and held to bit by bit."""

import numpy as np

from intervis.arrays import BoolArray, Float64Array, FloatArray


def numpy_mask(
    points: FloatArray,
    viewpoint: Float64Array,
    *,
    cell_deg: float = 0.5,
    tolerance_m: float = 1.0,
    tolerance_fraction: float = 0.02,
) -> BoolArray:
    """Which points (N, 3) hold the smallest range of their cell, but for the tolerance.

    The arguments are those of `intervis.visible_mask`. It shares none of its code.
    """
    columns = int(np.ceil(360.0 / cell_deg))
    rows = int(np.ceil(4.0 / np.radians(cell_deg)))
    x, y, z = (points[:, axis] - np.float64(viewpoint[axis]) for axis in range(3))
    rho = np.sqrt(x * x + y * y)
    range_m = np.sqrt(x * x + y * y + z * z)
    # The origin, and what rounding around the viewpoint cannot tell from it, is no return.
    at_origin = (x == -viewpoint[0]) & (y == -viewpoint[1]) & (z == -viewpoint[2])
    returned = (range_m < 1e9) & ~at_origin
    column = np.zeros(len(points), np.int64)
    row = np.zeros(len(points), np.int64)
    octants = _octants(x[returned], y[returned])
    heights = _heights(rho[returned], z[returned])
    column[returned] = np.minimum(octants * (columns / 8.0), columns - 1)
    row[returned] = np.minimum((heights + 2.0) * (rows / 4.0), rows - 1)
    cell, single = row * columns + column, range_m.astype(np.float32)
    nearest = np.full(rows * columns, np.inf, np.float32)
    hides = returned & (single >= 0.4)
    np.minimum.at(nearest, cell[hides], single[hides])
    kept, tolerance = np.float32(1.0 - tolerance_fraction), np.float32(tolerance_m)
    return np.asarray(returned & (single * kept - tolerance <= nearest[cell]))


def _octants(x: Float64Array, y: Float64Array) -> Float64Array:
    """Azimuth, 0 to 8: the angle within an octant by a cubic in the tangent."""
    across, along = np.abs(x), np.abs(y)
    steeper = np.maximum(across, along)
    tangent = np.minimum(across, along) / np.where(steeper > 0.0, steeper, 1.0)
    angle = tangent * (1.3147 - tangent * (0.2343 + 0.0804 * tangent))
    quarter = np.where(along <= across, angle, 2.0 - angle)
    half = np.where(x >= 0.0, quarter, 4.0 - quarter)
    return np.where(y >= 0.0, half, 8.0 - half)


def _heights(rho: Float64Array, z: Float64Array) -> Float64Array:
    """Elevation, -2 to 2: z / rho to 45 degrees, 2 - rho / z beyond."""
    up = np.abs(z)
    longer = np.maximum(rho, up)
    ratio = np.minimum(rho, up) / np.where(longer > 0.0, longer, 1.0)
    return np.copysign(np.where(up <= rho, ratio, 2.0 - ratio), np.where(z >= 0.0, 1.0, -1.0))
