"""How long grids and masks take: `make bench`. Medians; kernels are compiled before.

`test_lines` is the yardstick: the line engine asked for every hundredth voxel of the same grid.
"""

import numpy as np
import pytest

from intervis.camera import Camera
from intervis.sight import Scene
from intervis.transform import inverse, rigid
from intervis.uses import Carver, PosedScan, bev_grid, masks_of
from intervis.uses.camera_voxels import PosedCamera
from intervis.uses.drive_masks import on_own_car
from intervis.uses.mask_layouts import LAYOUTS

KITTI, OCC3D = LAYOUTS["semantickitti"].grid, LAYOUTS["occ3d-nuscenes"].grid
SCANS = 71
EVERY = 100


@pytest.fixture(scope="session")
def scans(frames):
    """As many posed scans as a target of SemanticKITTI has; the drive is repeated."""
    inverse_first = inverse(frames[0].pose)
    posed = [(frame.points, inverse_first @ frame.pose) for frame in frames]
    return [posed[n % len(posed)] for n in range(SCANS)]


def carve(grid, scans):
    carver = Carver(grid)
    for nth, (points, pose) in enumerate(scans):
        carver.add(points, pose, now=nth == 0)
    return carver.result()


def six_cameras():
    """Cameras of 1600 x 900 pixels that look to all sides, as those of nuScenes do."""
    axes = rigid([[0, -1, 0], [0, 0, -1], [1, 0, 0]], np.zeros(3))
    projection = np.array([[1260.0, 0, 810, 0], [0, 1260, 490, 0], [0, 0, 1, 0]])
    posed = {}
    for name, degrees in enumerate((0, 55, 110, 180, 250, 305)):
        c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        grid_from_cam = rigid([[c, -s, 0], [s, c, 0], [0, 0, 1]], [0.5 * c, 0.5 * s, 1.5])
        posed[str(name)] = PosedCamera(Camera(projection, 1600, 900), axes @ inverse(grid_from_cam))
    return posed


@pytest.mark.benchmark(group="grids: bird's-eye view, 400 x 400 cells, one scan")
def test_bev(benchmark, frames):
    benchmark(bev_grid, [(frames[0].points, None)], reach_m=40.0, cell_m=0.2)


@pytest.mark.benchmark(group="grids: 256 x 256 x 32 voxels, one scan")
def test_semantickitti_grid(benchmark, scans):
    benchmark(carve, KITTI, scans[:1])


@pytest.mark.benchmark(group="grids: 256 x 256 x 32 voxels, one scan")
def test_lines(benchmark, frames):
    scene = Scene.from_scan(frames[0].points)
    index = np.argwhere(np.ones(KITTI.shape, bool))[::EVERY]
    benchmark(scene.sight, [0, 0, 0], KITTI.centre_of(index))


@pytest.mark.benchmark(group="grids: 256 x 256 x 32 voxels, 71 scans", min_rounds=2)
def test_semantickitti_target(benchmark, scans):
    benchmark(carve, KITTI, scans)


@pytest.mark.benchmark(group="grids: 200 x 200 x 16 voxels, one scan and six cameras")
def test_occ3d_with_cameras(benchmark, frames):
    points = frames[0].points[~on_own_car(frames[0].points)]
    scan = PosedScan(points, rigid(np.eye(3), [0.0, 0.0, 1.8]))
    benchmark(masks_of, OCC3D, [scan], cameras=six_cameras())
