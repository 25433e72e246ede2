"""The projection of a range image: where a direction lies on it, without trigonometric functions.

The sphere around a sensor is divided as a cube map is: the sides, up to 45 degrees above and below
the sensor's xy plane, and an upper and a lower cap. With the horizontal range rho:

    |z| <= rho   pseudo-elevation = z / rho                       planar range = rho
    |z| >  rho   pseudo-elevation = sign(z) (2 - rho / |z|)       planar range = |z|

Both are continuous at 45 degrees. Within a column, 1 / planar range of a plane is linear in the
pseudo-elevation, on the sides and on the caps.
"""

import numpy as np

from intervis.arrays import Float64Array
from intervis.kernels import kernel

FULL_CIRCLE = 8.0
"""`pseudo_azimuth` of a full turn."""
ZENITH = 2.0
"""`pseudo_elevation` straight up; straight down it is -2."""


@kernel
def pseudo_azimuth(x: float, y: float) -> float:
    """Azimuth as a number from 0 (x axis) to 8, one unit per octant, monotone in the angle.

    Within an octant it is linear in the angle to 0.1 degrees. Range images are written and read
    with the same function, so the error only makes some columns a few percent wider than others.
    """
    ax = abs(x)
    ay = abs(y)
    most = max(ax, ay)
    m = min(ax, ay) / (most if most > 0.0 else 1.0)
    u = m * (1.3147 - m * (0.2343 + 0.0804 * m))
    u = u if ay <= ax else 2.0 - u
    u = u if x >= 0.0 else 4.0 - u
    return u if y >= 0.0 else 8.0 - u


@kernel
def pseudo_elevation(rho: float, z: float) -> float:
    """Elevation as a number from -2 (straight down) to 2, monotone in the angle."""
    height = abs(z)
    most = max(rho, height)
    m = min(rho, height) / (most if most > 0.0 else 1.0)
    u = m if height <= rho else 2.0 - m
    return u if z >= 0.0 else -u


@kernel
def project_points(
    xyz: Float64Array,
    azimuth: Float64Array,
    elevation: Float64Array,
    planar_range: Float64Array,
    distance: Float64Array,
) -> None:
    """Pseudo-angles, planar range and distance of points (3, N) in the sensor's frame."""
    x, y, z = xyz[0], xyz[1], xyz[2]
    for i in range(len(x)):
        u, v, w = x[i], y[i], z[i]
        rho = np.sqrt(u * u + v * v)
        azimuth[i] = pseudo_azimuth(u, v)
        elevation[i] = pseudo_elevation(rho, w)
        planar_range[i] = max(rho, abs(w))
        distance[i] = np.sqrt(u * u + w * w + v * v)


@kernel
def rotate_points(rotation: Float64Array, xyz: Float64Array, rotated: Float64Array) -> None:
    """Rotate points (3, N) by (3, 3)."""
    x, y, z = xyz[0], xyz[1], xyz[2]
    for axis in range(3):
        a, b, c = rotation[axis, 0], rotation[axis, 1], rotation[axis, 2]
        for i in range(len(x)):
            rotated[axis, i] = a * x[i] + b * y[i] + c * z[i]
