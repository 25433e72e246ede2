"""Simple bodies as (T, 3, 3) triangles in metres, corners anticlockwise seen from outside."""

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from intervis.arrays import Float64Array
from intervis.transform import rigid


def grid(points: ArrayLike) -> Float64Array:
    """Two triangles for each cell of a grid of points.

    Parameters
    ----------
    points : (n, m, 3) array
        The triangles face along (first direction) x (second direction): with rows along x and
        columns along y they face up.

    Returns
    -------
    (2 (n - 1) (m - 1), 3, 3) float64 array

    Examples
    --------
    >>> patch = [[[0, 0, 0], [0, 1, 0]], [[1, 0, 0], [1, 1, 0]]]
    >>> grid(patch).shape
    (2, 3, 3)
    """
    corners = np.asarray(points, dtype=np.float64)
    a, b = corners[:-1, :-1], corners[1:, :-1]
    c, d = corners[1:, 1:], corners[:-1, 1:]
    cells = np.stack([np.stack([a, b, c], axis=-2), np.stack([a, c, d], axis=-2)], axis=-3)
    return cells.reshape(-1, 3, 3)


def quad(a: ArrayLike, b: ArrayLike, c: ArrayLike, d: ArrayLike) -> Float64Array:
    """(2, 3, 3) a flat quadrilateral, corners anticlockwise seen from the front."""
    corners = np.asarray([a, b, c, d], dtype=np.float64)
    return corners[[[0, 1, 2], [0, 2, 3]]]


def box(lower: ArrayLike, upper: ArrayLike, bottom: bool = True) -> Float64Array:
    """(12, 3, 3) an upright box, or (10, 3, 3) without its bottom.

    Examples
    --------
    >>> box([0, 0, 0], [1, 2, 3]).shape
    (12, 3, 3)
    """
    (x0, y0, z0), (x1, y1, z1) = np.asarray(lower, float), np.asarray(upper, float)
    low = [(x0, y0, z0), (x1, y0, z0), (x1, y1, z0), (x0, y1, z0)]
    high = [(x, y, z1) for x, y, _ in low]
    sides = [quad(low[k], low[k - 3], high[k - 3], high[k]) for k in range(4)]
    faces = [*sides, quad(*high)]
    if bottom:
        faces.append(quad(*low[::-1]))
    return np.concatenate(faces)


def tube(
    radii_m: ArrayLike, heights_m: ArrayLike, sides: int = 8, closed: bool = True
) -> Float64Array:
    """A body of revolution about z: rings of `radii_m` at `heights_m`, from bottom to top.

    Examples
    --------
    >>> tube([0.1, 0.1], [0.0, 4.0], sides=8).shape
    (32, 3, 3)
    """
    radii, heights = np.asarray(radii_m, float), np.asarray(heights_m, float)
    azimuth_rad = np.linspace(0, 2 * np.pi, sides + 1)
    azimuth_rad[-1] = 0.0
    rings = np.stack(
        [
            radii[:, None] * np.cos(azimuth_rad),
            radii[:, None] * np.sin(azimuth_rad),
            np.broadcast_to(heights[:, None], (len(radii), sides + 1)),
        ],
        axis=-1,
    )
    parts = [grid(rings.swapaxes(0, 1))]
    if closed:
        parts += [fan(rings[0, -2::-1]), fan(rings[-1, :-1])]
    return np.concatenate(parts)


def fan(rim: ArrayLike) -> Float64Array:
    """(n, 3, 3) a triangle fan from the mean of a rim to its n edges."""
    corners = np.asarray(rim, dtype=np.float64)
    middle = np.broadcast_to(corners.mean(axis=0), corners.shape)
    return np.stack([middle, corners, np.roll(corners, -1, axis=0)], axis=1)


def ellipsoid(radii_m: ArrayLike, rings: int = 6, sides: int = 10) -> Float64Array:
    """An ellipsoid about the origin; the corners lie on it, the faces slightly inside."""
    elevation_rad = np.linspace(-np.pi / 2, np.pi / 2, rings + 1)
    ball = tube(np.cos(elevation_rad), np.sin(elevation_rad), sides, closed=False)
    area = np.linalg.norm(np.cross(ball[:, 1] - ball[:, 0], ball[:, 2] - ball[:, 0]), axis=1)
    stretched: Float64Array = ball[area > 1e-12] * np.asarray(radii_m, float)
    return stretched


def extruded(profile: ArrayLike, start: ArrayLike, end: ArrayLike) -> Float64Array:
    """A closed outline extruded along a straight line, with both ends closed.

    Parameters
    ----------
    profile : (n, 3) array
        Outline, anticlockwise seen from the side of `start`; star-shaped about its mean.
    start, end : (3,) arrays
        Translation of the outline at either end.
    """
    outline = np.asarray(profile, dtype=np.float64)
    first, last = outline + np.asarray(start, float), outline + np.asarray(end, float)
    ring = np.stack([first, last], axis=1)
    ring = np.concatenate([ring, ring[:1]])
    return np.concatenate([grid(ring[::-1]), fan(first), fan(last[::-1])])


def leaves(
    rng: np.random.Generator, number: int, radii_m: ArrayLike, size_m: float
) -> Float64Array:
    """(number, 3, 3) small triangles of random direction, denser near an ellipsoid's surface."""
    directions = rng.normal(size=(number, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    middle = (
        directions * (rng.uniform(0.55, 1.0, (number, 1)) ** (1 / 3)) * np.asarray(radii_m, float)
    )
    corners = rng.normal(size=(number, 3, 3))
    corners -= corners.mean(axis=1, keepdims=True)
    corners /= np.linalg.norm(corners, axis=2, keepdims=True)
    scale = size_m * rng.uniform(0.6, 1.3, (number, 1, 1))
    placed: Float64Array = middle[:, None] + corners * scale
    return placed


def perturbed(rng: np.random.Generator, triangles: Float64Array, spread: float) -> Float64Array:
    """Triangles whose corners move radially by a random factor of 1 +- `spread`.

    Equal corners get the same factor.
    """
    corners = triangles.reshape(-1, 3)
    _, which = np.unique(corners.round(9), axis=0, return_inverse=True)
    factor = rng.uniform(1 - spread, 1 + spread, which.max() + 1)[which.ravel()]
    return np.asarray((corners * factor[:, None]).reshape(-1, 3, 3))


def upright_rotation(yaw_rad: float, position: ArrayLike = (0.0, 0.0, 0.0)) -> Float64Array:
    """(4, 4) rotation about z by `yaw_rad`, then translation to `position`."""
    return rigid(Rotation.from_euler("z", yaw_rad).as_matrix(), position)
