"""Carved grids against a plain double, voxel by voxel, and against sight lines."""

import numpy as np
import pytest

from intervis.errors import PointsError, PoseError, SceneError
from intervis.sight import Scene
from intervis.sight.kernels.carving import (
    LEAST_CORNERS,
    SAME_HEIGHT_CELLS,
    SAME_HEIGHT_JUMP,
    SAME_RANGE_CELLS,
)
from intervis.sight.occupancy_model import (
    ASSUMED_FROM_M,
    DEPTH_FROM_M,
    ENTRIES_PER_M,
    HEIGHT_FROM_M,
    MODEL,
)
from intervis.sight.reference import (
    _depth_behind_surface,
    _height_above_ground,
    _in_sensor_frame,
    _planar_range_and_elevation,
)
from intervis.transform import rigid, transform
from intervis.uses.voxels.carving import STATES, Carver
from intervis.uses.voxels.voxel_grid import VoxelGrid

FREE, OCCUPIED, OCCLUDED, UNKNOWN = range(4)


def room(tilt_rad: float = 0.0, at: tuple[float, float] = (0.3, -0.2)):
    """Returns of a 40-beam scanner over a floor with a wall and a box, and the scanner's pose."""
    rng = np.random.default_rng(5)
    azimuth = np.radians(np.arange(0.1, 360, 0.5))
    azimuth, elevation = np.meshgrid(azimuth, np.radians(np.linspace(-25, 8, 40)))
    c, s = np.cos(tilt_rad), np.sin(tilt_rad)
    pose = rigid([[c, 0, s], [0, 1, 0], [-s, 0, c]], [*at, 1.7])
    level = np.cos(elevation)
    rays = [level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)]
    rays = np.stack(rays, axis=-1).reshape(-1, 3)
    up = rays @ pose[:3, :3].T
    far = 1e6
    floor = np.where(up[:, 2] < -1e-6, -pose[2, 3] / np.minimum(up[:, 2], -1e-6), far)
    wall = np.where(up[:, 0] > 1e-6, (9.0 - pose[0, 3]) / np.maximum(up[:, 0], 1e-6), far)
    box = np.where(up[:, 1] > 1e-6, (3.0 - pose[1, 3]) / np.maximum(up[:, 1], 1e-6), far)
    at_box = pose[:3, 3] + up * box[:, None]
    box[~((np.abs(at_box[:, 0] - 2) < 1) & (at_box[:, 2] < 1.2))] = far
    range_m = np.minimum(np.minimum(floor, wall), box)
    hit = range_m < 40
    range_m = range_m[hit] + rng.normal(0, 0.01, hit.sum())
    return rays[hit] * range_m[:, None], pose


GRID = VoxelGrid([-4.0, -6.0, -0.5], 0.25, (64, 48, 16))


@pytest.fixture(scope="module")
def carved():
    points, pose = room(0.06)
    carver = Carver(GRID)
    carver.add(points, pose, now=True)
    return points, pose, carver.result()


def state_by_definition(depth, surface, planar, elevation, centre_depth, holds) -> int:
    """The state of one voxel from its eight corners, by the words of `carving`."""
    known = ~np.isnan(depth)
    if holds:
        return OCCUPIED
    if known.sum() < LEAST_CORNERS:
        return UNKNOWN
    depth, planar, elevation = depth[known], planar[known], elevation[known]
    ahead = depth < 0
    if ahead.all() or not ahead.any():
        return FREE if ahead.all() else OCCLUDED
    range_m = planar - depth
    height = range_m * elevation
    one_range = np.ptp(range_m) < SAME_RANGE_CELLS * GRID.cell_m
    one_height = (
        np.ptp(height) < SAME_HEIGHT_CELLS * GRID.cell_m
        and np.ptp(range_m) < SAME_HEIGHT_JUMP * range_m.min()
    )
    beside = surface[known].all() and depth[~ahead].min() < GRID.cell_m
    if one_range or one_height or beside:
        return OCCUPIED
    if np.isnan(centre_depth):
        return FREE if 2 * ahead.sum() > known.sum() else OCCLUDED
    return FREE if centre_depth < 0 else OCCLUDED


def entry(table: np.ndarray, value: float, start: float) -> float:
    return float(table[int(np.clip((value - start) * ENTRIES_PER_M, 0, len(table) - 1))])


def probability_by_definition(state, depth, is_surface, height, assumed) -> float:
    volumetric, surface, _ = np.split(MODEL.tables.depth_log_odds[:-1], 3)
    known_entries = int(MODEL.parameters.known_height_entries)
    over_known, over_assumed = np.split(MODEL.tables.height_log_odds, [known_entries])
    if np.isnan(assumed):
        log_odds = entry(over_known, height, HEIGHT_FROM_M)
    else:
        log_odds = entry(over_assumed, assumed, ASSUMED_FROM_M)
    if state == OCCUPIED:
        is_surface, depth = is_surface or np.isnan(depth), 0.0
    if state != UNKNOWN and not np.isnan(depth):
        log_odds += entry(surface if is_surface else volumetric, depth, DEPTH_FROM_M)
    return 1.0 / (1.0 + np.exp(-log_odds))


def test_states_and_probabilities_follow_from_the_definition(carved) -> None:
    points, pose, result = carved
    index = np.random.default_rng(1).integers(0, GRID.shape, (6000, 3))
    scans = Scene.from_scan(points, pose).packed_scans()
    holds = GRID.occupied_by(transform(pose, points))[tuple(index.T)]
    around = np.array(list(np.ndindex(2, 2, 2)))
    corners = GRID.corner + (index[:, None] + around).reshape(-1, 3) * GRID.cell_m
    local = _in_sensor_frame(scans, 0, corners)
    at_corners = [
        part.reshape(-1, 8)
        for part in (
            *_depth_behind_surface(scans, 0, local)[:2],
            *_planar_range_and_elevation(local),
        )
    ]
    centres = GRID.centre_of(index)
    depth, is_surface, *_ = _depth_behind_surface(scans, 0, _in_sensor_frame(scans, 0, centres))
    heights = _height_above_ground(scans, 0, centres)
    expected = np.array(
        [
            state_by_definition(*(part[n] for part in at_corners), depth[n], holds[n])
            for n in range(len(index))
        ]
    )
    found = result.state[tuple(index.T)]
    assert (np.bincount(expected, minlength=4) > 30).all()
    # A corner on the surface, or a decision on the last bits of a float32, may fall either way.
    assert np.mean(found != expected) < 0.002
    probability = result.probability[tuple(index.T)]
    wrong = 0
    for n in np.flatnonzero(found == expected):
        by_hand = probability_by_definition(
            expected[n], depth[n], is_surface[n], heights[0][n], heights[1][n]
        )
        wrong += abs(probability[n] - by_hand) > 0.01  # the table of occupancies has steps
    assert wrong < 0.002 * len(index)


def test_sight_lines_from_the_scanner_agree(carved) -> None:
    points, pose, result = carved
    index = np.random.default_rng(2).integers(0, GRID.shape, (20_000, 3))
    scene, centres = Scene.from_scan(points, pose), GRID.centre_of(index)
    sight, scans = scene.sight(pose[:3, 3], centres), scene.packed_scans()
    depth = _depth_behind_surface(scans, 0, _in_sensor_frame(scans, 0, centres))[0]
    state = result.state[tuple(index.T)]
    far = np.linalg.norm(GRID.centre_of(index) - pose[:3, 3], axis=1) > 1.0
    free, occluded = far & (state == FREE), far & (state == OCCLUDED)
    assert np.mean(sight.occluded[free]) < 0.003
    assert np.mean(sight.visible[far & (state == OCCUPIED)]) > 0.9
    assert np.mean(sight.visible[free]) > 0.95
    assert np.mean(state[sight.occluded & far] == OCCLUDED) > 0.98
    # A line that ends up to 0.4 m behind a surface ends on it.
    assert np.mean(sight.visible[occluded & (depth > 1.0)]) < 0.01


def wall(x_m: float, from_y: float = -4.0, to_y: float = 4.0) -> np.ndarray:
    y, z = np.meshgrid(np.arange(from_y, to_y, 0.04), np.arange(-1.5, 1.5, 0.06))
    return np.stack([np.full(y.size, x_m), y.ravel(), z.ravel()], axis=1)


def column(carver: Carver) -> list[str]:
    """States along x of the voxels in the middle."""
    state = carver.result().state
    return [STATES[int(one)] for one in state[:, state.shape[1] // 2, state.shape[2] // 2]]


def test_a_wall_on_paper() -> None:
    carver = Carver(VoxelGrid([0.0, -1.5, -0.3], 1.0, (8, 3, 1)))
    carver.add(wall(5.5))
    assert column(carver)[2:] == ["free"] * 3 + ["occupied"] + ["occluded"] * 2


def test_what_was_there_during_one_scan_of_many_is_free_unless_it_is_now() -> None:
    """Something stands at 3.5 m in one scan, before a wall at 6.5 m that four others see."""
    for now, at_thing in ((False, "free"), (True, "occupied")):
        carver = Carver(VoxelGrid([0.0, -1.5, -0.3], 1.0, (8, 3, 1)))
        carver.add(np.vstack([wall(3.5, -1, 1)]), now=now)
        for _ in range(4):
            carver.add(wall(6.5))
        states = column(carver)
        assert states[3] == at_thing
        assert states[6] == "occupied"
        assert states[7] == "occluded"
        assert carver.result().scans == 5


def test_a_scan_from_behind_opens_what_one_from_before_cannot_see() -> None:
    grid = VoxelGrid([0.0, -1.5, -0.3], 1.0, (10, 3, 1))
    carver = Carver(grid)
    carver.add(wall(4.5))
    assert column(carver)[5:] == ["occluded"] * 5
    backwards = rigid(np.diag([-1.0, -1.0, 1.0]), [9.5, 0, 0])
    carver.add(wall(5.0), backwards)
    assert column(carver)[5:8] == ["free"] * 3
    assert column(carver)[4] == "occupied"


def test_a_lifted_grid_is_a_grid_that_is_higher() -> None:
    points, pose = room()
    flat = VoxelGrid([-2.0, -3.0, 0.0], 0.25, (32, 24, 8))
    higher = VoxelGrid([-2.0, -3.0, 0.5], 0.25, (32, 24, 8))
    lifted = Carver(flat, lift_m=np.full((33, 25), 0.5))
    plain = Carver(higher)
    for carver in (lifted, plain):
        carver.add(points, pose)
    assert np.mean(lifted.result().state == plain.result().state) > 0.999
    np.testing.assert_allclose(
        np.median(lifted.result().probability - plain.result().probability), 0.0, atol=1e-6
    )


def test_the_scans_of_a_grid_may_be_turned_with_it() -> None:
    """What a grid says does not depend on where its corner lies in the scene."""
    points, pose = room()
    shift = np.array([16.0, -8.0, 4.0])  # whole voxels, and no rounding
    moved = pose.copy()
    moved[:3, 3] += shift
    first, second = Carver(GRID), Carver(VoxelGrid(GRID.corner + shift, GRID.cell_m, GRID.shape))
    first.add(points, pose)
    second.add(points, moved)
    assert np.mean(first.result().state == second.result().state) > 0.9995


def test_inputs_stay_and_mistakes_are_told() -> None:
    points, pose = room()
    points = np.vstack([points, [[np.nan, 0, 0], [np.inf, 0, 0], [0, 0, 0]]])
    before = points.copy(), pose.copy()
    carver = Carver(GRID)
    with pytest.raises(SceneError, match="has no scan"):
        carver.result()
    with pytest.raises(PointsError, match="shape"):
        carver.add(np.zeros((4, 2)))
    with pytest.raises(PoseError, match="not a rigid motion"):
        carver.add(points, np.diag([2.0, 1, 1, 1]))
    carver.add(points, pose)
    np.testing.assert_array_equal(points, before[0])
    np.testing.assert_array_equal(pose, before[1])
    assert "64 x 48 x 16 voxels of 0.25 m" in repr(carver.result())
    at_scanner = GRID.index_of(pose[None, :3, 3])[0][0]
    assert carver.result().state[tuple(at_scanner)] != OCCUPIED  # 0, 0, 0 is no return


def test_an_empty_scan_leaves_all_unknown() -> None:
    carver = Carver(VoxelGrid([0.0, 0.0, 0.0], 1.0, (2, 2, 2)))
    carver.add(np.empty((0, 3)))
    assert (carver.result().state == UNKNOWN).all()
