"""A camera's picture of a snapshot: flat shading by one sun and the sky, with shadows and haze."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from intervis.arrays import Float64Array
from intervis.camera import Camera
from intervis.lab.worlds.world import Snapshot
from intervis.transform import inverse

SUN_DIRECTION = (-0.62, 0.34, 0.72)
"""Direction towards the sun, world frame, any length."""
SUNLIGHT, SKYLIGHT = np.array([1.9, 1.75, 1.5]), np.array([0.55, 0.6, 0.7])
"""Linear red, green, blue of white paper that faces the sun, or the sky."""
HORIZON, ZENITH = np.array([0.80, 0.86, 0.92]), np.array([0.25, 0.45, 0.80])
HAZE_M = 500.0
"""Over this distance the haze replaces 63 % of a surface's light."""
SHADOW_M, SHADOW_START_M = 160.0, 2e-3
"""Length of shadow rays, and how far above the surface they start."""
GAMMA = 2.2


def pixel_rays(
    camera: Camera, world_from_cam: Float64Array, columns_px: ArrayLike, rows_px: ArrayLike
) -> tuple[Float64Array, Float64Array]:
    """Centre (3,) of a camera and unit directions (R, 3) through places of its image.

    Parameters
    ----------
    camera : Camera
        Pixel centres lie at whole numbers.
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
    directions = columns[:, None] * world_from_pixel[:, 0] + rows[:, None] * world_from_pixel[:, 1]
    directions += world_from_pixel[:, 2]
    directions /= np.sqrt(np.einsum("ij,ij->i", directions, directions))[:, None]
    centre = world_from_cam[:3, :3] @ camera.centre_cam + world_from_cam[:3, 3]
    return centre, directions


def render(
    snapshot: Snapshot,
    camera: Camera,
    cam_from_velo: Float64Array,
    pose: Float64Array,
    sun: ArrayLike = SUN_DIRECTION,
) -> NDArray[np.uint8]:
    """The picture that a camera takes of a snapshot.

    Parameters
    ----------
    snapshot : Snapshot
        The world at the time of the picture.
    camera : Camera
    cam_from_velo : (4, 4) float64 array
        The rectified camera frame from the sensor's.
    pose : (4, 4) float64 array
        world_from_velo.
    sun : (3,) array
        Direction towards the sun, world frame, any length.

    Returns
    -------
    (H, W, 3) uint8 array
        Red, green, blue.
    """
    size = (camera.height_px, camera.width_px)
    rows, columns = (part.ravel().astype(np.float64) for part in np.indices(size))
    towards_sun = np.asarray(sun, float) / np.linalg.norm(sun)
    centre, directions = pixel_rays(camera, pose @ inverse(cam_from_velo), columns, rows)
    light = _light(snapshot, centre, directions, towards_sun)
    picture = np.clip(light, 0, 1) ** (1 / GAMMA) * 255
    return picture.round().astype(np.uint8).reshape(*size, 3)


def _light(
    snapshot: Snapshot, origin: Float64Array, directions: Float64Array, sun: Float64Array
) -> Float64Array:
    """Linear colours (R, 3) that arrive along rays of unit direction from one point."""
    light: Float64Array = HORIZON + np.clip(2 * directions[:, 2:], 0, 1) * (ZENITH - HORIZON)
    ranges_m, hits = snapshot.caster.closest(origin, directions)
    hit = np.flatnonzero(hits >= 0)
    ranges_m, hits, directions = ranges_m[hit, None], hits[hit], directions[hit]
    normals = snapshot.normals[hits]
    normals *= -np.sign(np.einsum("ij,ij->i", normals, directions))[:, None]  # towards the camera
    starts = origin + ranges_m * directions + SHADOW_START_M * normals
    sunlit = ~snapshot.caster.blocked(starts, starts + SHADOW_M * sun)
    direct = np.maximum(normals @ sun, 0) * sunlit
    surface = snapshot.colours[hits] * (
        direct[:, None] * SUNLIGHT + (0.75 + 0.25 * normals[:, 2:]) * SKYLIGHT
    )
    clear = np.exp(-ranges_m / HAZE_M)
    light[hit] = clear * surface + (1 - clear) * HORIZON
    return light
