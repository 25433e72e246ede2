"""A scan projected: directions, ranges and level coordinates of its returns.

The sensor is estimated from them, the range image and the ground map are drawn from them.
"""

from dataclasses import dataclass

import numpy as np

from intervis.arrays import Float64Array, FloatArray
from intervis.sight.kernels.projection import project_points, rotate_points


@dataclass(frozen=True, eq=False)
class ProjectedScan:
    """What follows for each of N returns from its coordinates alone.

    Attributes
    ----------
    xyz : (3, N) float64 array
        Coordinates in the sensor's frame, metres.
    level : (3, N) float64 array
        Coordinates around the sensor in axes of which z points up, metres.
    azimuth, elevation : (N,) float64 arrays
        Pseudo-angles, see `intervis.sight.kernels.projection`.
    planar_m, range_m : (N,) float64 arrays
        Planar range, and distance from the sensor.
    """

    xyz: Float64Array
    level: Float64Array
    azimuth: Float64Array
    elevation: Float64Array
    planar_m: Float64Array
    range_m: Float64Array

    def __len__(self) -> int:
        return len(self.range_m)

    def turn_level(self, level_from_sensor: Float64Array) -> None:
        """Write the level coordinates by another rotation (3, 3) than that of `project_scan`."""
        rotate_points(np.array(level_from_sensor, np.float64, order="C"), self.xyz, self.level)


def project_scan(
    points_velo: FloatArray, level_from_sensor: Float64Array | None = None
) -> ProjectedScan:
    """Project the returns of a scan.

    Parameters
    ----------
    points_velo : (N, 3) float array
        Finite points in the sensor's frame, metres.
    level_from_sensor : (3, 3) float64 array or None
        Rotation to axes of which z points up. None: the sensor stands upright.

    Examples
    --------
    >>> scan = project_scan(np.array([[3.0, 4.0, 0.0], [0.0, 0.0, 2.0]]))
    >>> scan.planar_m, scan.elevation
    (array([5., 2.]), array([0., 2.]))
    """
    rotation = np.eye(3) if level_from_sensor is None else level_from_sensor
    # One large block: glibc then keeps freed memory of that size for the next scan. Smaller ones
    # are given back to the system, and fresh pages cost more than all that is done here.
    rows = np.empty((10, len(points_velo)))
    scan = ProjectedScan(rows[:3], rows[3:6], *rows[6:])
    scan.xyz[:] = points_velo[:, :3].T
    project_points(scan.xyz, scan.azimuth, scan.elevation, scan.planar_m, scan.range_m)
    scan.turn_level(rotation)
    return scan
