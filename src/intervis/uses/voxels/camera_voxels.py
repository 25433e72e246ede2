"""What cameras see of a grid of voxels whose states are known."""

from __future__ import annotations  # help() shows the names of the array types

from dataclasses import dataclass

import numpy as np

from intervis.arguments import object_of
from intervis.arrays import BoolArray, Float64Array, IntArray, UInt8Array
from intervis.camera import Camera
from intervis.kernels import in_parts
from intervis.sight import Scene
from intervis.transform import checked_pose, inverse, transform
from intervis.uses.voxels.kernels.ray_walk import mark_pixels
from intervis.uses.voxels.voxel_grid import VoxelGrid

NEAREST_M = 0.1
"""Depth from which on a voxel's centre is in the image."""
_LINES_PER_THREAD, _ROWS_PER_CALL = 4096, 64
_VOXELS_PER_CALL = 1 << 18


@dataclass(frozen=True, eq=False)
class PosedCamera:
    """A camera and its place.

    Attributes
    ----------
    camera : Camera
    cam_from_grid : (4, 4) float64 array
        Rectified camera coordinates from those of the grid.
    """

    camera: Camera
    cam_from_grid: Float64Array

    def __post_init__(self) -> None:
        object_of(self.camera, Camera, "camera")
        pose = checked_pose(self.cam_from_grid, "cam_from_grid")
        object.__setattr__(self, "cam_from_grid", pose)

    @property
    def centre(self) -> Float64Array:
        """(3,) centre of projection in the frame of the grid, metres."""
        return transform(inverse(self.cam_from_grid), self.camera.centre_cam)


def in_image(posed: PosedCamera, points: Float64Array) -> BoolArray:
    """Which points (N, 3), in the frame of the grid, lie in the image of a camera."""
    image_from_grid = posed.camera.projection @ posed.cam_from_grid
    u, v, depth = image_from_grid[:, :3] @ points.T + image_from_grid[:, 3:]
    inside = (depth > NEAREST_M) & (u >= 0) & (v >= 0)
    inside &= (u < posed.camera.width_px * depth) & (v < posed.camera.height_px * depth)
    return np.asarray(inside)


def in_view(grid: VoxelGrid, posed: PosedCamera) -> BoolArray:
    """Which voxels (I, J, K) have their centre in the image of a camera, hidden or not."""
    inside = np.empty(grid.size, np.bool_)
    for begin in range(0, grid.size, _VOXELS_PER_CALL):
        stop = min(begin + _VOXELS_PER_CALL, grid.size)
        inside[begin:stop] = in_image(posed, _centres_of(grid, np.arange(begin, stop)))
    return inside.reshape(grid.shape)


def _centres_of(grid: VoxelGrid, voxel: IntArray) -> Float64Array:
    """Centres (N, 3) of voxels (N,), counted in C order."""
    return grid.centre_of(np.stack(np.unravel_index(voxel, grid.shape), axis=-1))


def seen_by_lines(
    grid: VoxelGrid, observed: BoolArray, posed: PosedCamera, scene: Scene
) -> BoolArray:
    """Which observed voxels (I, J, K) a camera sees.

    Their centres lie in the image, and the sight line from the camera to the centre is visible
    (`intervis.Scene.sight`). A surface within 0.4 m of the centre does not occlude it.
    """
    seen, of_each = np.zeros(grid.size, np.bool_), observed.reshape(-1)
    for begin in range(0, grid.size, _VOXELS_PER_CALL):  # a line takes 100 times a voxel's memory
        voxel = begin + np.flatnonzero(of_each[begin : begin + _VOXELS_PER_CALL])
        centre = _centres_of(grid, voxel)
        inside = in_image(posed, centre)
        visible = scene.sight(posed.centre, centre[inside]).visible
        seen[voxel[inside][visible]] = True
    return seen.reshape(grid.shape)


def seen_by_pixels(grid: VoxelGrid, state: UInt8Array, posed: PosedCamera) -> UInt8Array:
    """Which observed voxels (I, J, K) the rays of a camera's pixels meet, as Occ3D prints it.

    One ray runs through the middle of each pixel, up to the first occupied voxel.
    """
    camera, origin = posed.camera, (posed.centre - grid.corner) / grid.cell_m
    reach_m = np.linalg.norm(np.maximum(abs(posed.centre - grid.corner), abs(grid.upper)))
    grid_from_pixel = _rays_of(posed) * (float(reach_m) + grid.cell_m * sum(grid.shape))
    seen = np.zeros(grid.shape, np.uint8)
    columns = np.arange(camera.width_px) + 0.5
    for top in range(0, camera.height_px, _ROWS_PER_CALL):
        rows = np.arange(top, min(top + _ROWS_PER_CALL, camera.height_px)) + 0.5
        u, v = (side.ravel() for side in np.meshgrid(columns, rows))
        along = np.column_stack([u, v, np.ones(len(u))]) @ grid_from_pixel.T
        ends = origin + along / grid.cell_m

        def work(begin: int, stop: int, ends: Float64Array = ends) -> None:
            mark_pixels(origin, ends, state, seen, begin, stop)

        in_parts(work, len(ends), least=_LINES_PER_THREAD)
    return seen


def _rays_of(posed: PosedCamera) -> Float64Array:
    """(3, 3) matrix from homogeneous pixels to ahead-pointing rays of a depth of 1 m."""
    projection, rotation = posed.camera.projection[:, :3], posed.cam_from_grid[:3, :3]
    return np.asarray(np.linalg.inv(projection @ rotation))
