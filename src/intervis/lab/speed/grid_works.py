"""Grids and masks that are timed; sight lines to a part of the voxels stand beside them."""

from collections.abc import Iterator, Sequence

import numpy as np

from intervis.arrays import Float64Array
from intervis.camera import Camera
from intervis.lab.speed.timing import Work
from intervis.sight import Scene
from intervis.transform import inverse, rigid
from intervis.uses import Carver, PosedScan, VoxelGrid, bev_grid, masks_of
from intervis.uses.voxels.camera_voxels import PosedCamera
from intervis.uses.voxels.drive_masks import on_own_car
from intervis.uses.voxels.mask_layouts import LAYOUTS

KITTI, OCC3D = LAYOUTS["semantickitti"].grid, LAYOUTS["occ3d-nuscenes"].grid

TARGET_SCANS = 71
"""Scans of one grid of SemanticKITTI: the anchor and the 70 after it."""

EVERY = 100
"""Sight lines are asked to one voxel in so many."""


def grid_works(scans: Sequence[Float64Array], poses: Sequence[Float64Array]) -> Iterator[Work]:
    """Grids of one scan and of many, from scans with world_from_velo poses."""
    first, back = scans[0], inverse(poses[0])
    posed = [(scan, back @ pose) for scan, pose in zip(scans, poses, strict=True)]
    if np.isfinite(Scene.from_scan(first).ground_height([[0.0, 0.0]])).all():
        yield Work(
            "bird's-eye view, 400 x 400 cells of 0.2 m",
            "intervis",
            lambda: bev_grid([(first, None)], reach_m=40.0, cell_m=0.2),
            160_000,
        )
    voxels = int(np.prod(KITTI.shape))
    group = "256 x 256 x 32 voxels, one scan"
    yield Work(group, "intervis", lambda: _carve(KITTI, posed[:1]), voxels)
    scene = Scene.from_scan(first)
    centres = KITTI.centre_of(np.argwhere(np.ones(KITTI.shape, bool))[::EVERY])
    hundredth = "sight lines, to a hundredth"
    yield Work(group, hundredth, lambda: scene.sight(np.zeros(3), centres), len(centres))
    many = [posed[n % len(posed)] for n in range(TARGET_SCANS)]
    group = f"the same, {TARGET_SCANS} scans"
    yield Work(group, "intervis", lambda: _carve(KITTI, many), voxels)
    seen, cameras = first[~on_own_car(first)], _six_cameras()
    group = "200 x 200 x 16 voxels, one scan and six cameras"
    scan = PosedScan(seen, rigid(np.eye(3), [0.0, 0.0, 1.8]))
    yield Work(
        group,
        "intervis",
        lambda: masks_of(OCC3D, [scan], cameras=cameras),
        int(np.prod(OCC3D.shape)),
    )


def _carve(grid: VoxelGrid, scans: Sequence[tuple[Float64Array, Float64Array]]) -> object:
    carver = Carver(grid)
    for nth, (points, pose) in enumerate(scans):
        carver.add(points, pose, now=nth == 0)
    return carver.result()


def _six_cameras() -> dict[str, PosedCamera]:
    """Cameras of 1600 x 900 pixels that look to all sides, as those of nuScenes do."""
    axes = rigid([[0, -1, 0], [0, 0, -1], [1, 0, 0]], np.zeros(3))
    projection = np.array([[1260.0, 0, 810, 0], [0, 1260, 490, 0], [0, 0, 1, 0]])
    posed = {}
    for degrees in (0, 55, 110, 180, 250, 305):
        c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        grid_from_cam = rigid([[c, -s, 0], [s, c, 0], [0, 0, 1]], [0.5 * c, 0.5 * s, 1.5])
        camera = Camera(projection, 1600, 900)
        posed[f"{degrees} degrees"] = PosedCamera(camera, axes @ inverse(grid_from_cam))
    return posed
