"""Plain bodies as (T, 3, 3) triangles, corners anticlockwise seen from outside, metres."""

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
        Their front looks along (second direction) x (first direction), negated: rows running
        along x and columns along y face up.

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
    """(2, 3, 3) a flat piece with its corners in turn, anticlockwise seen from the front."""
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
    """A body of revolution about z: rings of `radii_m` at `heights_m`, from below to above.

    Examples
    --------
    >>> tube([0.1, 0.1], [0.0, 4.0], sides=8).shape
    (32, 3, 3)
    """
    radii, heights = np.asarray(radii_m, float), np.asarray(heights_m, float)
    turn = np.linspace(0, 2 * np.pi, sides + 1)
    turn[-1] = 0.0
    rings = np.stack(
        [
            radii[:, None] * np.cos(turn),
            radii[:, None] * np.sin(turn),
            np.broadcast_to(heights[:, None], (len(radii), sides + 1)),
        ],
        axis=-1,
    )
    parts = [grid(rings.swapaxes(0, 1))]
    if closed:
        parts += [fan(rings[0, -2::-1]), fan(rings[-1, :-1])]
    return np.concatenate(parts)


def fan(rim: ArrayLike) -> Float64Array:
    """(n, 3, 3) a flat or domed disc: triangles from a rim's mean to its n edges."""
    corners = np.asarray(rim, dtype=np.float64)
    middle = np.broadcast_to(corners.mean(axis=0), corners.shape)
    return np.stack([middle, corners, np.roll(corners, -1, axis=0)], axis=1)


def ellipsoid(radii_m: ArrayLike, rings: int = 6, sides: int = 10) -> Float64Array:
    """An ellipsoid about the origin; its corners lie on it, its faces a little inside."""
    tilt = np.linspace(-np.pi / 2, np.pi / 2, rings + 1)
    ball = tube(np.cos(tilt), np.sin(tilt), sides, closed=False)
    area = np.linalg.norm(np.cross(ball[:, 1] - ball[:, 0], ball[:, 2] - ball[:, 0]), axis=1)
    stretched: Float64Array = ball[area > 1e-12] * np.asarray(radii_m, float)
    return stretched


def swept(profile: ArrayLike, start: ArrayLike, end: ArrayLike) -> Float64Array:
    """A closed outline carried straight from one end to another, both ends closed.

    Parameters
    ----------
    profile : (n, 3) array
        Outline, anticlockwise seen from the side that `start` lies on; star-shaped about its mean.
    start, end : (3,) arrays
        What is added to it at either end.
    """
    outline = np.asarray(profile, dtype=np.float64)
    first, last = outline + np.asarray(start, float), outline + np.asarray(end, float)
    ring = np.stack([first, last], axis=1)
    ring = np.concatenate([ring, ring[:1]])
    return np.concatenate([grid(ring[::-1]), fan(first), fan(last[::-1])])


def leaves(
    rng: np.random.Generator, number: int, radii_m: ArrayLike, size_m: float
) -> Float64Array:
    """(number, 3, 3) small triangles of all directions, crowding towards an ellipsoid's skin."""
    way = rng.normal(size=(number, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    middle = way * (rng.uniform(0.55, 1.0, (number, 1)) ** (1 / 3)) * np.asarray(radii_m, float)
    corners = rng.normal(size=(number, 3, 3))
    corners -= corners.mean(axis=1, keepdims=True)
    corners /= np.linalg.norm(corners, axis=2, keepdims=True)
    scale = size_m * rng.uniform(0.6, 1.3, (number, 1, 1))
    placed: Float64Array = middle[:, None] + corners * scale
    return placed


def lumpy(rng: np.random.Generator, triangles: Float64Array, share: float) -> Float64Array:
    """Corners moved in or out from the origin by up to `share`; those that meet stay together."""
    corners = triangles.reshape(-1, 3)
    _, which = np.unique(corners.round(9), axis=0, return_inverse=True)
    factor = rng.uniform(1 - share, 1 + share, which.max() + 1)[which.ravel()]
    return np.asarray((corners * factor[:, None]).reshape(-1, 3, 3))


def upright_rotation(yaw_rad: float, place: ArrayLike = (0.0, 0.0, 0.0)) -> Float64Array:
    """(4, 4) a turn about z by `yaw_rad`, then a shift to `place`."""
    return rigid(Rotation.from_euler("z", yaw_rad).as_matrix(), place)
