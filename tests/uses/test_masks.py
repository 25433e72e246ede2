"""Masks of a frame: cameras, scanners, added scans, moving things; each definition by a double."""

import tracemalloc

import numpy as np
import pytest

from intervis.camera import Camera
from intervis.errors import SettingsError
from intervis.sight import Scene
from intervis.transform import inverse, rigid, transform
from intervis.uses.voxels import camera_voxels
from intervis.uses.voxels.camera_voxels import (
    PosedCamera,
    in_image,
    seen_by_lines,
    seen_by_pixels,
)
from intervis.uses.voxels.masks import DEFINITIONS, PosedScan, masks_of
from intervis.uses.voxels.voxel_grid import VoxelGrid

GRID = VoxelGrid([0.0, -4.0, -1.8], 0.4, (30, 20, 8))
AHEAD = rigid([[0, -1, 0], [0, 0, -1], [1, 0, 0]], [0.0, 0.0, 0.0])
"""Camera axes (x right, y down, z ahead) from x ahead, y left, z up."""


def scan_of_street(x_wall_m: float = 9.1) -> np.ndarray:
    """Flat ground 1.7 m below the scanner, a box at 5 m and a wall."""
    azimuth, elevation = np.meshgrid(
        np.radians(np.arange(-70, 70, 0.4)), np.radians(np.arange(-25, 6, 0.4))
    )
    rays = np.stack([np.cos(azimuth), np.sin(azimuth), np.tan(elevation)], axis=-1).reshape(-1, 3)
    ground = np.where(rays[:, 2] < -1e-3, -1.7 / np.minimum(rays[:, 2], -1e-3), 1e6)
    wall, box = x_wall_m / rays[:, 0], 5.0 / rays[:, 0]
    box[~((np.abs(box * rays[:, 1]) < 1.0) & (box * rays[:, 2] < 0.3))] = 1e6
    range_m = np.minimum(np.minimum(ground, wall), box)
    return rays * range_m[:, None]


def camera(side_m: float = 0.0) -> PosedCamera:
    """A camera of 90 x 60 degrees that looks ahead, to the left of the scanner."""
    projection = np.array([[60.0, 0, 60, 0], [0, 60, 35, 0], [0, 0, 1, 0]])
    grid_from_cam = rigid(np.eye(3), [0.2, side_m, 0.1]) @ inverse(AHEAD)
    return PosedCamera(Camera(projection, 120, 70), inverse(grid_from_cam))


def test_the_image_of_a_camera_point_by_point() -> None:
    posed = camera(0.5)
    np.testing.assert_allclose(posed.centre, [0.2, 0.5, 0.1])
    points = np.random.default_rng(0).uniform(-8, 8, (400, 3))
    inside = in_image(posed, points)
    for point, found in zip(points, inside, strict=True):
        x, y, z = transform(posed.cam_from_grid, point)
        u, v = 60 * x / z + 60, 60 * y / z + 35
        assert found == (z > 0.1 and 0 <= u < 120 and 0 <= v < 70)
    assert 5 < inside.sum() < 200


def test_an_exact_camera_mask_is_that_of_sight_lines() -> None:
    scan = PosedScan(scan_of_street(), np.eye(4))
    posed = camera(1.5)
    masks = masks_of(GRID, [scan], cameras={"front": posed})
    scene = Scene.from_scan(scan.points)
    every = np.argwhere(np.ones(GRID.shape, bool))
    centres = GRID.centre_of(every)
    visible = scene.sight(posed.centre, centres).visible & in_image(posed, centres)
    expected = visible.reshape(GRID.shape) & masks.mask_lidar
    np.testing.assert_array_equal(masks.camera["front"], expected)
    np.testing.assert_array_equal(masks.mask_camera, expected)
    assert 300 < expected.sum() < masks.mask_lidar.sum()


def test_a_camera_beside_sees_other_voxels_than_the_scanner() -> None:
    masks = masks_of(
        GRID,
        [PosedScan(scan_of_street(), np.eye(4))],
        cameras={"left": camera(3.0), "right": camera(-3.0)},
    )
    left, right = masks.camera["left"], masks.camera["right"]
    behind_left = GRID.index_of(np.array([[5.8, 1.9, -0.8]]))[0][0]
    assert left[tuple(behind_left)] or not masks.mask_lidar[tuple(behind_left)]
    assert (left & ~right).sum() > 50
    assert (right & ~left).sum() > 50


def test_a_large_grid_is_seen_in_parts(monkeypatch) -> None:
    scan = PosedScan(scan_of_street(), np.eye(4))
    whole = masks_of(GRID, [scan], cameras={"front": camera(1.5)}).camera["front"]
    monkeypatch.setattr(camera_voxels, "_VOXELS_PER_CALL", 700)  # the grid has 4,800
    parts = masks_of(GRID, [scan], cameras={"front": camera(1.5)}).camera["front"]
    np.testing.assert_array_equal(parts, whole)
    assert whole.any()


def test_memory_of_a_camera_grows_by_its_mask_only(monkeypatch) -> None:
    """Twice the voxels take two bytes more for each; a line takes about a hundred."""
    monkeypatch.setattr(camera_voxels, "_VOXELS_PER_CALL", 20_000)
    scene, posed = Scene.from_scan(scan_of_street()), camera()
    peaks_bytes = {}
    for columns in (30, 30, 240):  # once to compile
        grid = VoxelGrid([1.0, -2.0, -1.0], 0.05, (columns, 80, 40))
        observed = np.ones(grid.shape, np.bool_)
        tracemalloc.start()
        seen_by_lines(grid, observed, posed, scene)
        peaks_bytes[columns] = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    assert peaks_bytes[240] - peaks_bytes[30] < 4 * (240 - 30) * 80 * 40


def by_sampling(start: np.ndarray, end: np.ndarray) -> list[tuple[int, ...]]:
    """Voxels along a segment in order, by dense samples: misses cut corners only."""
    steps = start + np.linspace(0, 1, 20_000)[:, None] * (end - start)
    index, inside = GRID.index_of(steps)
    index = index[inside]
    kept = np.append(True, (np.diff(index, axis=0) != 0).any(axis=1)) if len(index) else []
    return [tuple(voxel) for voxel in index[kept].tolist()]


def test_occ3d_is_what_its_paper_prints() -> None:
    points = scan_of_street()[::70]
    origin = np.array([0.31, 0.17, 0.03])
    pose = rigid(np.eye(3), origin)
    masks = masks_of(GRID, [PosedScan(points, pose)], definition="occ3d")
    crossed, ended = set(), set()
    for point in transform(pose, points):
        voxels = by_sampling(origin, point)
        last, inside = GRID.index_of(point[None])
        crossed |= set(voxels) - {tuple(last[0])}
        ended |= {tuple(last[0])} if inside[0] else set()
    occupied = np.zeros(GRID.shape, bool)
    occupied[tuple(np.array(sorted(ended)).T)] = True
    np.testing.assert_array_equal(masks.occupied, occupied)
    free = {tuple(voxel) for voxel in np.argwhere(masks.free).tolist()}
    sampled = crossed - ended
    assert sampled <= free
    assert len(free - sampled) <= 0.005 * len(free)
    np.testing.assert_array_equal(masks.invalid, ~(masks.free | masks.occupied))
    np.testing.assert_array_equal(masks.lidar["lidar"], masks.mask_lidar)


def test_occ3d_pixels_take_over_the_state_up_to_the_first_occupied_voxel() -> None:
    rng = np.random.default_rng(4)
    state = rng.choice(np.array([0] * 20 + [1, 3], np.uint8), GRID.shape)
    posed = PosedCamera(
        Camera(np.array([[9.07, 0, 8.03, 0], [0, 9.11, 6.02, 0], [0, 0, 1, 0]]), 16, 12),
        camera(0.317).cam_from_grid,
    )
    seen = seen_by_pixels(GRID, state, posed)
    expected = np.zeros(GRID.shape, bool)
    grid_from_cam = inverse(posed.cam_from_grid)
    for row in range(12):
        for column in range(16):
            ray = np.array([(column + 0.5 - 8.03) / 9.07, (row + 0.5 - 6.02) / 9.11, 1.0])
            for voxel in by_sampling(posed.centre, transform(grid_from_cam, 14 * ray)):
                expected[voxel] |= state[voxel] in (0, 1)
                if state[voxel] == 1:
                    break
    assert seen.sum() > 100
    # Samples miss corners that a ray cuts by less than a millimetre.
    assert np.count_nonzero(expected != seen) <= 0.01 * seen.sum()


def test_the_definitions_differ_where_they_say() -> None:
    points = scan_of_street()
    labels = np.full(len(points), 40, np.uint16)
    made = {
        name: masks_of(GRID, [PosedScan(points, np.eye(4), labels=labels)], definition=name)
        for name in DEFINITIONS
    }
    tool = made["semantickitti"]
    assert tool.occluded[tool.occupied].all()  # an occupied voxel blocks itself
    assert not (made["exact"].occluded & made["exact"].occupied).any()
    assert not tool.invalid[tool.occupied].any()
    sky = tuple(GRID.index_of(np.array([[2.0, 0.1, 1.3]]))[0][0])
    assert made["exact"].invalid[sky]  # above the highest beam: nobody looked
    assert not tool.invalid[sky]  # the tool asks for blockers only


def moving_scene(keep_moving: bool):
    """A thing, labelled as moving, that only the later scan shows, 3 m before the wall."""
    wall = scan_of_street(9.1)
    thing = np.array([[6.2, 3.0 + 0.05 * n, -0.5 + 0.1 * m] for n in range(8) for m in range(8)])
    later = np.vstack([wall, thing])
    labels = np.append(np.full(len(wall), 50), np.full(len(thing), 252)).astype(np.uint16)
    scans = [
        PosedScan(wall, np.eye(4), labels=np.full(len(wall), 50, np.uint16)),
        PosedScan(later, np.eye(4), labels=labels, is_now=False),
    ]
    return [masks_of(GRID, scans, definition=name, keep_moving=keep_moving) for name in DEFINITIONS]


def test_moving_things_of_added_scans_are_left_out_unless_asked_for() -> None:
    at = tuple(GRID.index_of(np.array([[6.25, 3.2, -0.2]]))[0][0])
    for masks in moving_scene(keep_moving=False):
        assert masks.label[at] == 0
        assert not masks.occupied[at]
    exact, tool, rays = moving_scene(keep_moving=True)
    assert tool.label[at] == rays.label[at] == 252
    assert tool.occupied[at]
    assert rays.occupied[at]
    assert not exact.occupied[at]  # the scan of the moment saw it free


def test_several_scanners() -> None:
    left = rigid(np.eye(3), [0.0, 3.0, 0.0])
    scans = [
        PosedScan(scan_of_street(), np.eye(4), "roof"),
        PosedScan(scan_of_street() - [0, 3.0, 0], left, "left"),
    ]
    masks = masks_of(GRID, scans)
    assert set(masks.lidar) == {"roof", "left"}
    alone = masks_of(GRID, scans[:1])
    np.testing.assert_array_equal(masks.lidar["roof"], alone.mask_lidar)
    either = masks.lidar["roof"] | masks.lidar["left"]
    assert np.mean(either == masks.mask_lidar) > 0.999


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"definition": "kitti"}, "there is no definition 'kitti'; choose one of exact"),
        ({"definition": "semantickitti"}, "needs labels of points for every scan"),
    ],
)
def test_mistakes_are_told(options, message) -> None:
    with pytest.raises(SettingsError, match=message):
        masks_of(GRID, [PosedScan(scan_of_street(), np.eye(4))], **options)
    labelled = PosedScan(scan_of_street(), np.eye(4), labels=np.ones(len(scan_of_street()), "u2"))
    with pytest.raises(SettingsError, match="no masks of cameras"):
        masks_of(GRID, [labelled], definition="semantickitti", cameras={"front": camera()})
