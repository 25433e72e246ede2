"""A camera's picture of a moment: colours, sun, shadow, sky and haze."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from intervis.arrays import Float64Array
from intervis.camera import Camera
from intervis.transform import inverse
from intervis.worlds.world import Moment


@dataclass(frozen=True)
class Light:
    """Sun and sky.

    Attributes
    ----------
    sun : three floats
        Direction towards the sun, world frame, any length.
    """

    sun: tuple[float, float, float] = (-0.45, 0.55, 0.75)


def pixel_rays(camera: Camera, world_from_cam: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Centre (3,) and unit directions (H * W, 3) of a camera's pixels, world frame.

    A pixel's centre lies at whole numbers: column u, row v is where `projection` gives (u, v).
    """
    rows, columns = np.mgrid[0 : camera.height_px, 0 : camera.width_px]
    pixels = np.stack([columns, rows, np.ones_like(rows)], axis=-1).reshape(-1, 3)
    ways = pixels @ np.linalg.inv(camera.projection[:, :3]).T @ world_from_cam[:3, :3].T
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    centre = world_from_cam[:3, :3] @ camera.centre_cam + world_from_cam[:3, 3]
    return centre, ways


def render(
    moment: Moment,
    camera: Camera,
    cam_from_velo: Float64Array,
    pose: Float64Array,
    light: Light | None = None,
) -> NDArray[np.uint8]:
    """(H, W, 3) uint8 picture that the camera takes of a moment."""
    sun = np.asarray((light or Light()).sun, float)
    sun /= np.linalg.norm(sun)
    centre, ways = pixel_rays(camera, pose @ inverse(cam_from_velo))
    ranges, hits = moment.caster.closest(centre, ways)
    normals = moment.normals[hits]
    facing = np.einsum("ij,ij->i", normals, ways)
    normals *= -np.sign(facing)[:, None]
    lit = np.maximum(normals @ sun, 0)
    hit = hits >= 0
    places = centre + ways * np.where(hit, ranges, 0)[:, None]
    ask = np.flatnonzero(hit & (lit > 0))
    start = places[ask] + normals[ask] * 1e-3
    lit[ask[moment.caster.blocked(start, start + 150 * sun)]] = 0
    ambient = 0.35 + 0.15 * normals[:, 2]
    colour = moment.colours[hits] * (lit[:, None] * [1.1, 1.05, 0.95] + ambient[:, None])
    up = np.clip(ways[:, 2] * 3, 0, 1)[:, None]
    sky = (1 - up) * [0.8, 0.87, 0.93] + up * [0.3, 0.5, 0.85]
    haze = np.exp(-np.where(hit, ranges, 0) / 350)[:, None]
    colour = np.where(hit[:, None], haze * colour + (1 - haze) * [0.75, 0.82, 0.9], sky)
    tone = np.clip(colour, 0, 1) ** (1 / 2.2)
    return (tone * 255).round().astype(np.uint8).reshape(camera.height_px, camera.width_px, 3)
