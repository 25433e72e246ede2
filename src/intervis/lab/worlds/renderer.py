"""A camera's picture of a moment: one ray a pixel, one more to the sun, more along edges."""

from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from intervis.arrays import Float32Array, Float64Array, IntArray
from intervis.camera import Camera
from intervis.kernels import in_parts
from intervis.lab.worlds import shading
from intervis.lab.worlds.world import Moment
from intervis.transform import inverse

SHADOW_M = 160.0
EDGE = 0.055
"""Difference between neighbours, of 1, above which a pixel is sampled again."""
SPOTS = ((-0.33, 0.21), (0.29, -0.31))
"""Where in a pixel the further samples lie, pixels from its centre."""


@dataclass(frozen=True)
class Light:
    """Where the sun stands.

    Attributes
    ----------
    sun : three floats
        Direction towards it, world frame, any length.
    """

    sun: tuple[float, float, float] = (-0.62, 0.34, 0.72)

    @property
    def unit(self) -> Float64Array:
        """(3,) the same of length one."""
        way = np.asarray(self.sun, dtype=np.float64)
        return np.asarray(way / np.linalg.norm(way))


def pixel_rays(
    camera: Camera, world_from_cam: Float64Array, columns_px: ArrayLike, rows_px: ArrayLike
) -> tuple[Float64Array, Float64Array]:
    """Centre (3,) of a camera and unit directions (R, 3) through places of its image.

    Parameters
    ----------
    camera : Camera
        Whose pixels have their centres at whole numbers.
    world_from_cam : (4, 4) float64 array
        From the rectified camera frame.
    columns_px, rows_px : (R,) arrays
        Places in the image.

    Examples
    --------
    >>> camera = Camera(np.array([[700.0, 0, 600, 0], [0, 700, 180, 0], [0, 0, 1, 0]]), 1242, 375)
    >>> pixel_rays(camera, np.eye(4), [600.0], [180.0])[1]
    array([[0., 0., 1.]])
    """
    columns, rows = np.asarray(columns_px, float), np.asarray(rows_px, float)
    world_from_pixel = world_from_cam[:3, :3] @ np.linalg.inv(camera.projection[:, :3])
    ways = columns[:, None] * world_from_pixel[:, 0] + rows[:, None] * world_from_pixel[:, 1]
    ways += world_from_pixel[:, 2]
    ways /= np.sqrt(np.einsum("ij,ij->i", ways, ways))[:, None]
    centre = world_from_cam[:3, :3] @ camera.centre_cam + world_from_cam[:3, 3]
    return centre, ways


def _seen(
    moment: Moment, origin: Float64Array, ways: Float64Array, sun: Float64Array
) -> Float32Array:
    """Linear colours (R, 3) along rays from one point."""
    ranges, hits = moment.caster.closest(origin, ways)
    total = len(ways)
    starts, asks = np.empty((total, 3)), np.empty(total, np.bool_)
    looks = (ways, ranges, hits, origin, moment.normals, moment.labels)
    in_parts(partial(shading.sunward, *looks, sun, starts, asks), total)
    asked = np.flatnonzero(asks)
    sunlit = np.zeros(total, np.bool_)
    from_there = starts[asked]
    sunlit[asked] = ~moment.caster.blocked(from_there, from_there + SHADOW_M * sun)
    out = np.empty((total, 3), np.float32)
    in_parts(partial(shading.shade, *looks, moment.colours, sun, sunlit, out), total)
    return out


def _developed(linear: Float32Array) -> Float32Array:
    out = np.empty_like(linear)
    in_parts(partial(shading.developed, linear, out), len(linear))
    return out


def _edges(picture: Float32Array) -> IntArray:
    """Flat indices of the pixels of an (H, W, 3) picture that differ much from a neighbour."""
    grey = picture @ np.array([0.3, 0.5, 0.2], np.float32)
    edge = np.zeros(grey.shape, np.bool_)
    across = np.abs(np.diff(grey, axis=1)) > EDGE
    down = np.abs(np.diff(grey, axis=0)) > EDGE
    edge[:, 1:] |= across
    edge[:, :-1] |= across
    edge[1:] |= down
    edge[:-1] |= down
    return np.flatnonzero(edge)


def render(
    moment: Moment,
    camera: Camera,
    cam_from_velo: Float64Array,
    pose: Float64Array,
    light: Light | None = None,
) -> NDArray[np.uint8]:
    """The picture that a camera takes of a moment.

    Parameters
    ----------
    moment : Moment
        The world at that time.
    camera, cam_from_velo : Camera, (4, 4) float64 array
        The camera, and the way from the sensor to its rectified frame.
    pose : (4, 4) float64 array
        world_from_velo.
    light : Light, optional
        Another sun.

    Returns
    -------
    (H, W, 3) uint8 array
        Red, green, blue.
    """
    sun = (light or Light()).unit
    world_from_cam = pose @ inverse(cam_from_velo)
    size = (camera.height_px, camera.width_px)
    rows, columns = (part.ravel().astype(np.float64) for part in np.indices(size))
    centre, ways = pixel_rays(camera, world_from_cam, columns, rows)
    picture = _developed(_seen(moment, centre, ways, sun))
    edge = _edges(picture.reshape(*size, 3))
    spots = np.asarray(SPOTS)
    _, ways = pixel_rays(
        camera,
        world_from_cam,
        (columns[edge][:, None] + spots[:, 0]).ravel(),
        (rows[edge][:, None] + spots[:, 1]).ravel(),
    )
    more = _developed(_seen(moment, centre, ways, sun)).reshape(len(edge), len(spots), 3)
    picture[edge] = (picture[edge] + more.sum(axis=1)) / (1 + len(spots))
    return (picture.reshape(*size, 3) * 255).round().astype(np.uint8)
