"""A scan of a room whose walls are known, in the order of a spinning scanner's beams."""

import numpy as np


def scanned_room(beams: int = 8, step_deg: float = 1.0) -> np.ndarray:
    """(N, 3) float64 returns of a spinning scanner at the origin, ring by ring.

    A room from x -6 to 14 and y -5 to 9 m, walls without end, with a pillar of one metre at (4, 2).
    """
    azimuth = np.radians(np.arange(-180.0, 180.0, step_deg) + 0.3)
    rings = []
    for elevation_deg in np.linspace(-12.0, 9.0, beams):
        x, y = np.cos(azimuth), np.sin(azimuth)
        walls = np.stack([14 / x, -6 / x, 9 / y, -5 / y])
        range_m = np.where(walls > 0, walls, np.inf).min(axis=0)
        # The pillar: a circle of radius 0.5 about (4, 2).
        ahead = 4 * x + 2 * y
        below_root = ahead**2 - (4**2 + 2**2) + 0.25
        met = (below_root > 0) & (ahead > 0)
        near = ahead - np.sqrt(np.where(met, below_root, 0.0))
        range_m = np.where(met, np.minimum(near, range_m), range_m)
        z = range_m * np.tan(np.radians(elevation_deg))
        rings.append(np.column_stack([range_m * x, range_m * y, z]))
    return np.concatenate(rings)
