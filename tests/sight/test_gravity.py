"""Up in a scan without a pose: planes on paper, tilted scanners of worlds and of real cars."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import intervis
from intervis import Scene
from intervis.errors import PointsError, SceneError, SettingsError
from intervis.sight.gravity import level_rotation
from intervis.sight.gravity import up_of_scan as up_of_projected
from intervis.sight.projected_scan import project_scan
from intervis.sight.reference import reference_result


def up_of_scan(points):
    return up_of_projected(project_scan(points))


def courtyard(rng, count=12000):
    """Returns of level ground 2 m below the scanner, of two walls and of a car, as seen upright."""
    ground = np.column_stack([rng.uniform(-15, 15, (count, 2)), np.full(count, -2.0)])
    ground = ground[np.hypot(ground[:, 0], ground[:, 1]) > 2.0]
    x, y = rng.uniform(-15, 15, count // 3), rng.uniform(-15, 12, count // 4)
    wall = np.column_stack([x, np.full(len(x), 12.0), rng.uniform(-2, 3, len(x))])
    side = np.column_stack([np.full(len(y), -14.0), y, rng.uniform(-2, 2, len(y))])
    car = np.column_stack([rng.uniform(5, 9, 300), rng.uniform(-3, -1.2, 300), np.full(300, -0.5)])
    points = np.concatenate([ground, wall, side, car])
    return points + rng.normal(scale=0.01, size=points.shape)


def error_deg(found, true):
    return float(np.degrees(np.arccos(np.clip(found @ true, -1.0, 1.0))))


@pytest.mark.parametrize(
    "roll_pitch_deg", [(0.0, 45.0), (45.0, 0.0), (-4.2, 45.2), (30.0, -20.0), (180.0, 0.0), (0, 60)]
)
def test_a_tilted_scan_shows_where_up_is(rng, roll_pitch_deg):
    turn = Rotation.from_euler("xy", roll_pitch_deg, degrees=True).as_matrix()
    found = up_of_scan(courtyard(rng) @ turn)
    assert error_deg(found, turn.T @ [0.0, 0.0, 1.0]) < 0.3


@pytest.mark.parametrize("tilt_deg", [0.0, 5.0, 8.0, -8.0])
def test_an_upright_scan_and_a_rising_road_stay_as_they_are(rng, tilt_deg):
    turn = Rotation.from_euler("y", tilt_deg, degrees=True).as_matrix()
    assert up_of_scan(courtyard(rng) @ turn) is None


def test_walls_alone_are_no_ground(rng):
    wall = np.column_stack([rng.uniform(-9, 9, 4000), np.full(4000, 6.0), rng.uniform(-2, 4, 4000)])
    for turn in (np.eye(3), Rotation.from_euler("x", 15, degrees=True).as_matrix()):
        assert up_of_scan(wall @ turn) is None


def test_too_few_returns_say_nothing():
    for count in (0, 1, 5, 30):
        assert up_of_scan(np.random.default_rng(0).normal(size=(count, 3))) is None


@settings(max_examples=15)
@given(st.integers(0, 2**32 - 1))
def test_copies_order_and_strays_change_nothing(seed):
    rng = np.random.default_rng(seed)
    turn = Rotation.from_euler("xyz", [*rng.uniform(-25, 25, 1), 40.0, 0.0], degrees=True)
    points = courtyard(rng, 6000) @ turn.as_matrix()
    found = up_of_scan(points)
    copies = points[rng.integers(0, len(points), 2000)]
    changed = np.concatenate([points, copies, [[900.0, -40.0, 30.0]], np.zeros((50, 3))])
    assert np.array_equal(up_of_scan(rng.permutation(changed)), found)


@given(st.lists(st.floats(-1, 1), min_size=3, max_size=3).map(np.array))
def test_the_rotation_takes_up_to_z_and_is_one(direction):
    length = np.linalg.norm(direction)
    if length < 1e-3:
        return
    up = direction / length
    rotation = level_rotation(up)
    assert rotation @ up == pytest.approx([0.0, 0.0, 1.0], abs=1e-12)
    assert rotation @ rotation.T == pytest.approx(np.eye(3), abs=1e-12)
    assert np.linalg.det(rotation) == pytest.approx(1.0)


def test_a_scene_of_a_tilted_scan_answers_as_with_its_pose(rng):
    """The frame differs, the lines and their heights above the ground are the same."""
    points = courtyard(rng)
    turn = Rotation.from_euler("xy", [-4.0, 45.0], degrees=True).as_matrix()
    tilted = Scene.from_scan(points @ turn)
    pose = np.eye(4)
    pose[:3, :3] = turn
    posed = Scene.from_scan(points @ turn, pose)
    assert error_deg(tilted.up, turn.T @ [0.0, 0.0, 1.0]) < 0.3
    starts, ends = rng.uniform([-9, -9, -1.5], [9, 9, 3], (2, 3000, 3))
    of_tilted = tilted.sight_lines(starts @ turn, ends @ turn)
    of_posed = posed.sight_lines(starts, ends)
    # Ground maps lie in axes that are turned about z, by cells of a square metre.
    assert np.abs(of_tilted.probability - of_posed.probability).mean() < 0.01
    assert np.mean(of_tilted.state == of_posed.state) > 0.99
    upright = Scene.from_scan(points @ turn, np.eye(4)).sight_lines(starts @ turn, ends @ turn)
    assert np.mean(upright.state == of_posed.state) < np.mean(of_tilted.state == of_posed.state)


def test_engine_and_reference_agree_in_a_tilted_scene(rng):
    turn = Rotation.from_euler("xy", [10.0, 40.0], degrees=True).as_matrix()
    scene = Scene.from_scan(courtyard(rng) @ turn)
    assert scene.up[2] < 0.9
    starts, ends = rng.uniform([-9, -9, -1.5], [9, 9, 3], (2, 300, 3)) @ turn
    sight, packed = scene.sight_lines(starts, ends), scene.packed_scans()
    by_reference = [
        reference_result(packed, a, b).probability for a, b in zip(starts, ends, strict=True)
    ]
    assert sight.probability == pytest.approx(by_reference, abs=1e-9)


def test_the_first_scan_decides_and_a_pose_counts(rng):
    turn = Rotation.from_euler("y", 45, degrees=True).as_matrix()
    points = courtyard(rng)
    scene = Scene.from_scan(points @ turn, np.eye(4))
    assert scene.up.tolist() == [0.0, 0.0, 1.0]
    scene.add(points @ turn)
    assert scene.up.tolist() == [0.0, 0.0, 1.0]
    tilted = Scene.from_scan(points @ turn)
    assert "tilted by 45 degrees" in repr(tilted)
    assert "tilt" in tilted._repr_html_()
    up = tilted.up
    tilted.add(points, np.eye(4))
    assert np.array_equal(tilted.up, up)
    assert np.array_equal(tilted.snapshot().up, up)
    up[:] = 0.0
    assert not np.array_equal(tilted.up, up)


def test_up_may_be_given(rng):
    points = courtyard(rng)
    turn = Rotation.from_euler("y", 45, degrees=True).as_matrix()
    true = turn.T @ [0.0, 0.0, 1.0]
    scene = Scene(up=9.81 * true)
    scene.add(points @ turn)
    assert scene.up == pytest.approx(true, abs=1e-12)
    upright = Scene(up=[0, 0, 1])
    upright.add(points @ turn)
    assert upright.tilt_deg == 0.0
    for wrong in ([0, 0, 0], [1, 2], "z", [np.nan, 0, 1]):
        with pytest.raises((SettingsError, PointsError)):
            Scene(up=wrong)


def test_a_tilted_scene_has_no_ground_over_x_and_y(rng):
    turn = Rotation.from_euler("y", 45, degrees=True).as_matrix()
    scene = Scene.from_scan(courtyard(rng) @ turn)
    with pytest.raises(SceneError, match="no pose"):
        scene.ground_height([[1.0, 2.0]])


WORLD_CELLS = (
    ("pandar64", "tilted", "street", 45.0),
    ("qt64", "tilted", "car-park", 45.0),
    ("hdl-32e", "tilted", "crossing", 45.0),
    ("os1-128", "upside-down", "roadside", 180.0),
    ("hdl-64e", "upright", "street", 0.0),
    ("livox", "mast", "car-park", 0.0),
    ("terrestrial", "tripod", "hall", 0.0),
)


@pytest.mark.parametrize(("scanner", "mount", "world", "tilt_deg"), WORLD_CELLS)
def test_scanners_of_worlds_that_no_number_was_chosen_on(scanner, mount, world, tilt_deg):
    from intervis.lab.truth.cells import Cell, random_of, scan_of
    from intervis.lab.worlds.places import PLACES

    cell = Cell(scanner, mount, world)
    scan = scan_of(cell, PLACES[world](5), random_of(cell, 5))
    true = scan.pose[:3, :3].T @ [0.0, 0.0, 1.0]
    assert error_deg(true, np.array([0.0, 0.0, 1.0])) == pytest.approx(tilt_deg, abs=0.5)
    found = up_of_scan(scan.points)
    if tilt_deg == 0.0:
        assert found is None
    else:
        assert error_deg(found, true) < 3.0


@pytest.mark.parametrize(
    ("name", "true"),
    [
        ("left", [-0.7096, -0.0516, 0.7027]),
        ("right", [-0.7169, -0.0073, 0.6971]),
        ("top", None),
    ],
)
def test_real_scanners_of_a_car(shared_data, name, true):
    """Up by the registered poses of the data's README."""
    scan = shared_data / "opencalib/lidar2lidar/0001" / f"{name}.pcd"
    if not scan.is_file():
        pytest.skip(f"no real scan {scan}")
    found = up_of_scan(intervis.open_drive(scan)[0].points[:, :3])
    if true is None:
        assert found is None
    else:
        assert error_deg(found, np.array(true)) < 2.0
