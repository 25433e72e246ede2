"""The scanner against closed formulas; its noise and dropout against their statistics."""

import dataclasses

import numpy as np
import pytest

from intervis.errors import SettingsError
from intervis.lab.worlds import shapes
from intervis.lab.worlds.analytic import plane
from intervis.lab.worlds.scanner import SCANNERS, Scanner
from intervis.lab.worlds.sensor_rig import SensorRig
from intervis.lab.worlds.triangles import Material, Triangles
from intervis.lab.worlds.world import Actor, World
from intervis.transform import rigid, transform

COLUMNS = 500
EXACT = Scanner(
    columns=COLUMNS, noise_m=0.0, intensity_noise=0.0, dropout=0.0, least_signal=0.0, roof=None
)
GREY = Material("building", (0.4, 0.4, 0.4), 0.5)


def room(half_m: float = 20.0) -> Triangles:
    """A closed box about the sensor: every beam has a return."""
    return Triangles.of(shapes.box([-half_m] * 3, [half_m] * 3), GREY)


def test_beam_table_is_two_blocks_of_32() -> None:
    elevations = np.array(Scanner().elevations_deg)
    assert len(elevations) == 64
    assert elevations[0] == 2.0
    assert elevations[-1] == -24.8
    gaps = -np.diff(elevations)
    np.testing.assert_allclose(gaps[:31], 1 / 3, atol=2e-6)
    np.testing.assert_allclose(gaps[31], 0.5, atol=2e-6)
    np.testing.assert_allclose(gaps[32:], (24.8 - 53 / 6) / 31, atol=2e-6)


def test_ranges_over_a_plane_are_height_over_sine(rng) -> None:
    world = plane().world()
    points, attributes = EXACT.scan(world.at(0.0), world.vehicle_pose_at(0.0), rng)
    elevation = np.radians(EXACT.elevations_deg)[attributes["ring"]]
    # Triangles end at 60 m ahead and behind, 40 m to the sides.
    expected = 1.73 / np.sin(-elevation)
    np.testing.assert_allclose(attributes["range"], expected, rtol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(points, axis=1), expected, rtol=1e-6)
    np.testing.assert_allclose(points[:, 2], -1.73, atol=2e-6)
    slope = np.tan(np.radians(EXACT.elevations_deg))
    counts = np.bincount(attributes["ring"], minlength=64)
    assert (counts[slope < -1.73 / 40] == EXACT.columns).all()
    assert not counts[slope >= 0].any()


def test_columns_turn_to_the_left_from_straight_ahead(rng) -> None:
    world = World(room(), (), lambda time_s: np.eye(4))
    points, attributes = EXACT.scan(world.at(0.0), np.eye(4), rng)
    assert len(points) == 64 * COLUMNS
    np.testing.assert_array_equal(attributes["ring"], np.repeat(np.arange(64), COLUMNS))
    azimuth = np.degrees(np.arctan2(points[:, 1], points[:, 0])).reshape(64, COLUMNS) % 360
    expected = np.broadcast_to(np.arange(COLUMNS) * 360 / COLUMNS, (64, COLUMNS))
    np.testing.assert_allclose(azimuth, expected, atol=1e-4)
    assert abs(360 / Scanner().columns - 0.18) < 0.01


def test_noise_lies_along_the_beam_with_two_centimetres(rng) -> None:
    world = World(room(), (), lambda time_s: np.eye(4))
    scanner = dataclasses.replace(EXACT, noise_m=0.02)
    points, attributes = scanner.scan(world.at(0.0), np.eye(4), rng)
    error = np.linalg.norm(points.astype(np.float64), axis=1) - attributes["range"]
    assert abs(error.std() - 0.02) < 0.0005  # 32,000 draws: six sigma
    assert abs(error.mean()) < 5 * 0.02 / np.sqrt(len(error))
    assert np.abs(error).max() < 0.12
    ways = points / np.linalg.norm(points, axis=1, keepdims=True)
    np.testing.assert_allclose(ways, scanner.directions(), atol=1e-6)


def test_dropout_has_its_rate_and_shifts_nothing(rng) -> None:
    world = World(room(), (), lambda time_s: np.eye(4))
    snapshot = world.at(0.0)
    some = dataclasses.replace(Scanner(columns=COLUMNS, roof=None), dropout=0.1, least_signal=0.0)
    fewer = dataclasses.replace(some, dropout=0.3)
    kept, _ = some.scan(snapshot, np.eye(4), np.random.default_rng(5))
    less, _ = fewer.scan(snapshot, np.eye(4), np.random.default_rng(5))
    total = 64 * COLUMNS
    assert abs(len(kept) / total - 0.9) < 5 * np.sqrt(0.09 / total)
    assert abs(len(less) / total - 0.7) < 5 * np.sqrt(0.21 / total)
    known = {row.tobytes() for row in kept}
    assert all(row.tobytes() in known for row in less)


def test_half_of_the_returns_are_lost_at_least_signal(rng) -> None:
    # On a sphere about the sensor every beam has cosine 1.
    radius = 50.0
    ball = Triangles.of(shapes.ellipsoid([radius] * 3, 90, 180), GREY)
    scanner = dataclasses.replace(EXACT, least_signal=0.5 / radius**2)
    snapshot = World(ball, (), lambda time_s: np.eye(4)).at(0.0)
    points, _ = scanner.scan(snapshot, np.eye(4), rng)
    assert abs(len(points) / (64 * COLUMNS) - 0.5) < 0.014  # five sigma
    near = dataclasses.replace(EXACT, least_signal=0.5 / (10 * radius) ** 2)
    assert len(near.scan(snapshot, np.eye(4), rng)[0]) > 0.999 * 64 * COLUMNS


def test_glass_passes_most_slanting_beams(rng) -> None:
    pane = Triangles.of(shapes.box([-20] * 3, [20] * 3), Material("window", (0, 0, 0), 0.5))
    snapshot = World(pane, (), lambda time_s: np.eye(4)).at(0.0)
    points, _ = EXACT.scan(snapshot, np.eye(4), rng)
    face = np.abs(points[:, :2]).max(axis=1) / np.linalg.norm(points, axis=1)
    assert 0.3 < len(points) / (64 * COLUMNS) < 0.8
    assert (face > 0.98).mean() > 0.15  # beams at normal incidence return


def test_range_limits(rng) -> None:
    scanner = dataclasses.replace(EXACT, nearest_m=21.0, farthest_m=25.0)
    snapshot = World(room(20.0), (), lambda time_s: np.eye(4)).at(0.0)
    points, attributes = scanner.scan(snapshot, np.eye(4), rng)
    assert 0 < len(points) < 64 * COLUMNS
    assert attributes["range"].min() >= 21.0
    assert attributes["range"].max() < 25.0


def test_own_roof_hides_what_lies_under_it(rng) -> None:
    world = plane().world()
    snapshot, pose = world.at(0.0), world.vehicle_pose_at(0.0)
    roofed = dataclasses.replace(EXACT, roof=(-2.75, 2.25, -0.72, 0.72, -0.9))
    with_roof, _ = roofed.scan(snapshot, pose, rng)
    without, _ = EXACT.scan(snapshot, pose, rng)
    # A roof at 0.9 of 1.73 m shades a ground 1.73 / 0.9 times as long and wide.
    scale = 1.73 / 0.9
    shaded = (np.abs(without[:, 1]) <= 0.72 * scale) & (without[:, 0] <= 2.25 * scale)
    shaded &= without[:, 0] >= -2.75 * scale
    assert shaded.sum() > 200
    assert len(with_roof) == (~shaded).sum()


def test_scan_moves_with_world_and_sensor(street_snapshot, street, rng) -> None:
    coarse = dataclasses.replace(Scanner(), columns=200)
    pose = street.vehicle_pose_at(0.7)
    moved_from_world = rigid([[0, -1, 0], [1, 0, 0], [0, 0, 1]], [3.0, -2.0, 1.0])
    near = np.linalg.norm(street_snapshot.triangles[:, 0] - pose[:3, 3], axis=1) < 30
    triangles = Triangles.of(street_snapshot.triangles[near], GREY)
    one = World(triangles, (), lambda time_s: pose).at(0.0)
    two = World(triangles.transformed(moved_from_world), (), lambda time_s: pose).at(0.0)
    here, mine = coarse.scan(one, pose, np.random.default_rng(1))
    there, theirs = coarse.scan(two, moved_from_world @ pose, np.random.default_rng(1))
    assert abs(len(here) - len(there)) <= 3
    if len(here) == len(there):
        assert (np.abs(here - there).max(axis=1) < 1e-3).mean() > 0.999
        assert (mine["ring"] == theirs["ring"]).all()


def test_attributes_belong_to_what_was_hit(street, street_snapshot) -> None:
    pose = street.vehicle_pose_at(0.7)
    points, found = Scanner().scan(street_snapshot, pose, np.random.default_rng(3))
    assert {len(column) for column in found.values()} == {len(points)}
    np.testing.assert_array_equal(found["label"], street_snapshot.labels[found["triangle"]])
    np.testing.assert_array_equal(found["object"], street_snapshot.objects[found["triangle"]])
    assert found["intensity"].min() >= 0
    assert found["intensity"].max() <= 0.99
    assert points.dtype == np.float32
    assert (found["object"] > 0).sum() > 500  # actors are hit
    # Each point lies in the plane of its triangle, except for noise along the beam.
    places = transform(pose, points)
    corner = street_snapshot.triangles[found["triangle"], 0]
    off = np.einsum("ij,ij->i", places - corner, street_snapshot.normals[found["triangle"]])
    assert np.abs(off).max() < 6 * 0.02


def test_sweep_of_a_world_at_rest_is_its_scan() -> None:
    world = plane().world()
    coarse = dataclasses.replace(Scanner(), columns=180)
    one, mine = coarse.scan(world.at(0.0), world.vehicle_pose_at(0.0), np.random.default_rng(2))
    two, theirs = coarse.sweep(world, 0.0, np.random.default_rng(2))
    np.testing.assert_allclose(one, two, atol=1e-5)
    np.testing.assert_array_equal(mine["ring"], theirs["ring"])
    assert not mine["time"].any()
    assert np.ptp(theirs["time"]) > 0.098


def test_sweep_follows_the_motion_of_the_vehicle() -> None:
    # Driving at 10 m/s towards a wall 30 m ahead (at time 0), scanning for 0.1 s about time 0.
    wall = Triangles.of(shapes.box([30, -900, -900], [31, 900, 900]), GREY)
    world = World(wall, (), lambda time_s: rigid(np.eye(3), [10.0 * time_s, 0, 0]))
    scanner = dataclasses.replace(EXACT, columns=360, farthest_m=1e4)
    points, found = scanner.sweep(world, 0.0, np.random.default_rng(2))
    azimuth = np.arctan2(points[:, 1], points[:, 0])
    np.testing.assert_allclose(found["time"], azimuth / (2 * np.pi) * 0.1, atol=1e-6)
    np.testing.assert_allclose(points[:, 0], 30.0 - 10.0 * found["time"], rtol=1e-5)


def test_sweep_sees_the_way_that_actors_go() -> None:
    wall = Triangles.of(shapes.box([0, -900, -900], [1, 900, 900]), GREY)
    actor = Actor("wall", wall, lambda time_s: rigid(np.eye(3), [30.0 - 10.0 * time_s, 0, 0]))
    world = World(Triangles.joined([]), (actor,), lambda time_s: np.eye(4))
    scanner = dataclasses.replace(EXACT, columns=360, farthest_m=1e4)
    points, found = scanner.sweep(world, 0.0, np.random.default_rng(2), sectors=36)
    # A sector of 10 degrees takes 2.8 ms: the wall is off by 1.4 cm at its ends.
    assert np.abs(points[:, 0] - (30.0 - 10.0 * found["time"])).max() < 0.0145


def test_street_returns_are_as_many_as_in_a_kitti_frame(street) -> None:
    rig = SensorRig()
    camera, scanner = rig.camera(), Scanner()
    for number in (0, 120):
        rng = np.random.default_rng([0, number])
        pose = street.vehicle_pose_at(0.1 * number)
        points, _ = scanner.scan(street.at(0.1 * number), pose, rng)
        assert 110_000 <= len(points) <= 125_000
        points_cam = transform(rig.cam_from_velo, points)
        pixels = points_cam @ camera.projection[:, :3].T + camera.projection[:, 3]
        column, row = (pixels[:, :2] / pixels[:, 2:]).T
        in_view = (pixels[:, 2] > 0) & (column >= 0) & (row >= 0)
        in_view &= (column < camera.width_px) & (row < camera.height_px)
        assert 16_000 <= in_view.sum() <= 20_000


@pytest.mark.realdata
def test_ranges_are_spread_as_in_a_real_residential_scan(street, shared_data) -> None:
    from intervis.drives import open_drive

    drive = open_drive(shared_data / "pcd_drive")
    real = np.linalg.norm(drive[drive.frame_numbers[14]].points, axis=1)
    points, _ = Scanner().scan(
        street.at(8.0), street.vehicle_pose_at(8.0), np.random.default_rng([0, 80])
    )
    ours = np.linalg.norm(points, axis=1)
    shares = [10, 25, 50, 75, 90]
    ratio = np.percentile(ours, shares) / np.percentile(real[real > 1], shares)
    assert (ratio > 0.6).all()
    assert (ratio < 1.6).all()


@pytest.mark.parametrize("name", sorted(SCANNERS))
def test_every_preset_scans(name: str, street, street_snapshot) -> None:
    scanner = SCANNERS[name]
    assert list(scanner.elevations_deg) == sorted(scanner.elevations_deg, reverse=True)
    pose = street.vehicle_pose_at(0.7)
    points, found = scanner.scan(street_snapshot, pose, np.random.default_rng(3))
    assert 0.5 < len(points) / (len(scanner.elevations_deg) * scanner.columns) < 1
    assert found["range"].max() <= scanner.farthest_m


@pytest.mark.parametrize(
    "wrong",
    [
        {"elevations_deg": ()},
        {"columns": 0},
        {"elevations_deg": (90.0,)},
        {"nearest_m": 5.0, "farthest_m": 4.0},
        {"noise_m": -0.1},
        {"dropout": 1.5},
    ],
)
def test_invalid_scanners_are_refused(wrong) -> None:
    with pytest.raises(SettingsError, match="a scanner"):
        Scanner(**wrong)


def test_an_empty_world_returns_nothing(rng) -> None:
    snapshot = World(Triangles.joined([]), (), lambda time_s: np.eye(4)).at(0.0)
    points, attributes = Scanner(columns=20).scan(snapshot, np.eye(4), rng)
    assert points.shape == (0, 3)
    assert attributes["intensity"].shape == (0,)
