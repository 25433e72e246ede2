"""Simulated drives on disk: reproducible to the byte, whole files only, with their world."""

import errno
import os
import sys
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

from intervis.drives import kitti_writer, open_drive
from intervis.drives.kitti_writer import Layout
from intervis.drives.point_labels import CLASS_NAMES
from intervis.errors import DriveError, MissingExtraError, OutputError, SettingsError
from intervis.lab.worlds import load_world, shapes, simulate, simulate_drive, simulation
from intervis.lab.worlds.point_classes import point_labels
from intervis.lab.worlds.ray_casting import RayCaster
from intervis.lab.worlds.scanner import Scanner
from intervis.lab.worlds.sensor_rig import SensorRig
from intervis.lab.worlds.triangles import LABELS, Material, Triangles
from intervis.lab.worlds.world import Actor, World
from intervis.transform import checked_pose, rigid, transform

COARSE = Scanner(elevations_deg=tuple(np.linspace(2, -24, 16)), columns=240)


@lru_cache
def small_world(seed: int = 0) -> World:
    """Ground with a house and a car that drives ahead: simulated in milliseconds."""
    ground = shapes.quad([-80, -40, -1.7], [80, -40, -1.7], [80, 40, -1.7], [-80, 40, -1.7])
    house = shapes.box([8.0 + seed, 4.0, -1.7], [16.0, 10.0, 4.0])
    car = Triangles.of(shapes.box([-2, -0.9, -1.7], [2, 0.9, -0.2]), Material("car", (1, 0, 0), 1))
    static = [Triangles.of(ground, Material("road", (0.11, 0.12, 0.13), 0.3))]
    static.append(Triangles.of(house, Material("building", (0.7, 0.6, 0.5), 0.45)))
    poses = lambda time_s: rigid(np.eye(3), [9.0 * time_s, 0, 0])  # noqa: E731
    ahead = lambda time_s: rigid(np.eye(3), [12.0 + 8.0 * time_s, -2.0, 0])  # noqa: E731
    actor = Actor("car 1", car.rounded(), ahead)
    return World(Triangles.joined(static).rounded(), (actor,), poses, last_s=33.0)


@pytest.fixture(autouse=True)
def _small_world(monkeypatch) -> None:
    monkeypatch.setattr(simulation, "build_street", small_world)


def quick(out: Path, **options) -> Path:
    """A drive with a coarse scanner and without images."""
    return simulate(out, **{"scanner": COARSE, "images": False, "frames": 2, **options})


def content(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


@pytest.fixture(scope="module")
def drive(tmp_path_factory) -> Path:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(simulation, "build_street", small_world)
        return quick(tmp_path_factory.mktemp("drive"), frames=3)


@pytest.fixture(scope="module")
def full(tmp_path_factory, street) -> Path:
    """One frame of the street as the command writes it: all beams, with its image."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(simulation, "build_street", lambda seed: street)
        return simulate(tmp_path_factory.mktemp("full"), frames=1)


def test_layout_is_kitti_raw(full: Path) -> None:
    assert full.name == "2011_09_26_drive_0001_sync"
    names = set(content(full.parent))
    inside = full.name
    assert names == {
        "calib_cam_to_cam.txt",
        "calib_velo_to_cam.txt",
        "calib_imu_to_velo.txt",
        f"{inside}/simulation.json",
        f"{inside}/world.npz",
        f"{inside}/poses.txt",
        f"{inside}/velodyne_points/timestamps.txt",
        f"{inside}/velodyne_points/data/0000000000.bin",
        f"{inside}/image_02/timestamps.txt",
        f"{inside}/image_02/data/0000000000.png",
    }
    scan = np.fromfile(full / "velodyne_points/data/0000000000.bin", "<f4").reshape(-1, 4)
    assert 110_000 <= len(scan) <= 125_000
    assert np.isfinite(scan).all()
    assert scan[:, 3].min() >= 0
    assert scan[:, 3].max() < 1


def test_the_project_reads_the_calibration_that_was_written(full: Path) -> None:
    frame, rig = open_drive(full)[0], SensorRig()
    assert frame.camera is not None
    np.testing.assert_array_equal(frame.camera.projection, rig.camera().projection)
    assert (frame.camera.width_px, frame.camera.height_px) == (1242, 375)
    np.testing.assert_allclose(frame.cam_from_velo, rig.cam_from_velo, atol=1e-12)
    np.testing.assert_array_equal(frame.pose, np.eye(4))


def test_the_written_image_is_the_rendered_one(tmp_path: Path, monkeypatch, rng) -> None:
    from PIL import Image

    rendered = rng.integers(0, 256, (7, 11, 3), dtype=np.uint8)
    monkeypatch.setattr(simulation, "render", lambda *_: rendered)
    folder = quick(tmp_path, frames=1, images=True)
    with Image.open(folder / "image_02/data/0000000000.png") as picture:
        assert picture.mode == "RGB"
        np.testing.assert_array_equal(np.asarray(picture), rendered)


def test_images_without_pillow_name_the_extra(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "PIL", None)
    with pytest.raises(MissingExtraError, match=r"'pillow'.* pip install 'intervis\[lab\]'"):
        simulate(tmp_path, frames=1)
    assert not list(tmp_path.iterdir())
    quick(tmp_path, frames=1)


def test_the_street_of_a_seed_gives_the_same_bytes(
    full: Path, street_again, tmp_path: Path, monkeypatch
) -> None:
    monkeypatch.setattr(simulation, "build_street", lambda seed: street_again)
    again = content(simulate(tmp_path, frames=1, images=False))
    first = content(full)
    for name in ("velodyne_points/data/0000000000.bin", "world.npz", "poses.txt"):
        assert again[name] == first[name]


def test_same_seed_same_bytes_other_seed_other_scans(drive: Path, tmp_path: Path) -> None:
    again = quick(tmp_path / "again", frames=3)
    assert content(again.parent) == content(drive.parent)
    other = quick(tmp_path / "other", frames=3, seed=1)
    scans = "velodyne_points/data/0000000001.bin"
    assert (other / scans).read_bytes() != (drive / scans).read_bytes()


def test_a_frame_does_not_depend_on_the_number_of_frames(drive: Path, tmp_path: Path) -> None:
    short, long = content(quick(tmp_path, frames=1)), content(drive)
    scan, times = "velodyne_points/data/0000000000.bin", "velodyne_points/timestamps.txt"
    assert short[scan] == long[scan]
    assert long["poses.txt"].startswith(short["poses.txt"])
    assert long[times].startswith(short[times])


def test_poses_and_timestamps(drive: Path) -> None:
    poses = np.loadtxt(drive / "poses.txt").reshape(-1, 3, 4)
    assert len(poses) == 3
    np.testing.assert_array_equal(poses[0], np.eye(4)[:3])
    for number, pose in enumerate(poses):
        checked_pose(pose)
        expected = small_world().vehicle_pose_at(0.1 * number)[:3]
        np.testing.assert_allclose(pose, expected, rtol=0, atol=1e-14)
    lines = (drive / "velodyne_points" / "timestamps.txt").read_text().splitlines()
    assert lines[2] == "2011-09-26 13:02:25.200000000"


def test_load_world_returns_the_world_exactly(drive: Path) -> None:
    world, recorded = small_world(), load_world(drive)
    assert recorded.frame_count == 3
    for number in range(3):
        for loaded, simulated in zip(
            recorded.triangles_at_frame(number), world.triangles_at(0.1 * number), strict=True
        ):
            np.testing.assert_array_equal(loaded, simulated)
    assert [name for name, _ in recorded.actors] == ["car 1"]
    # Scanned again from the recorded world, a frame is the same to the byte.
    points, attributes = COARSE.scan(
        recorded.at_frame(2), recorded.vehicle_poses[2], np.random.default_rng([0, 2])
    )
    kept = (drive / "velodyne_points/data/0000000002.bin").read_bytes()
    assert kitti_writer.scan_bytes(points, attributes["intensity"]) == kept


def test_load_world_returns_the_street_exactly(full: Path, street) -> None:
    recorded = load_world(full)
    np.testing.assert_array_equal(recorded.static.corners, street.static.corners)
    np.testing.assert_array_equal(recorded.static.reflectances, street.static.reflectances)
    assert [name for name, _ in recorded.actors] == [actor.name for actor in street.actors]
    for (_, loaded), actor in zip(recorded.actors, street.actors, strict=True):
        np.testing.assert_array_equal(loaded.corners, actor.triangles.corners)


@pytest.mark.parametrize("number", [-1, 3, 99])
def test_a_recorded_world_has_no_other_frames(drive: Path, number: int) -> None:
    with pytest.raises(DriveError, match="frames 0 to 2"):
        load_world(drive).triangles_at_frame(number)


def test_returns_lie_on_the_world_in_the_frame_of_the_poses(drive: Path) -> None:
    """Rays along the written returns, from the written pose, at the written triangles."""
    recorded = load_world(drive)
    poses = np.loadtxt(drive / "poses.txt").reshape(-1, 3, 4)
    for number in (0, 2):
        scan = np.fromfile(drive / f"velodyne_points/data/{number:010d}.bin", "<f4").reshape(-1, 4)
        points = transform(poses[number], scan[:, :3])
        rays = points - poses[number][:, 3]
        measured_m = np.linalg.norm(rays, axis=1)
        caster = RayCaster(recorded.triangles_at_frame(number)[0])
        ranges, hits = caster.closest(poses[number][:, 3], rays / measured_m[:, None])
        error_m = measured_m[hits >= 0] - ranges[hits >= 0]
        assert (hits >= 0).mean() > 0.999
        # A float32 beam may pass an edge on its other side: a few in a thousand.
        assert (np.abs(error_m) < 0.1).mean() > 0.99
        assert abs(np.median(error_m)) < 0.002
        assert abs(np.percentile(np.abs(error_m), 68.27) - 0.02) < 0.002


def test_labels_name_the_surface_of_each_return(tmp_path: Path, drive: Path) -> None:
    folder = quick(tmp_path, frames=3, labels=True)
    labelled = open_drive(folder)
    for frame, plain in zip(labelled, open_drive(drive), strict=True):
        assert frame.points.tobytes() == plain.points.tobytes()
        assert plain.point_classes is None
        x, _, z = frame.points.T
        car_x = 12.0 - 0.1 * frame.number  # drives 8 m/s, the scanner 9 m/s
        classes = frame.point_classes
        assert set(classes.tolist()) == {40, 50, 252}  # road, building, moving car
        assert np.abs(z[classes == 40] + 1.7).max() < 0.3
        assert x[classes == 50].min() > 7.8 - 0.9 * frame.number
        assert np.abs(x[classes == 252] - car_x).max() < 2.2
        np.testing.assert_array_equal(frame.point_instances, classes == 252)
    before = content(folder)
    (folder / "velodyne_points/labels/0000000001.label").unlink()
    assert content(quick(tmp_path, frames=3, labels=True)) == before
    assert content(quick(tmp_path, frames=3)) == content(drive)


def test_every_surface_and_actor_of_the_street_has_a_class(street: World) -> None:
    objects = np.arange(len(street.actors) + 1)
    labels = np.full(len(objects), LABELS["glass"], np.int8)
    classes = point_labels(street, labels, objects) & 0xFFFF
    assert classes[0] == 10  # a parked car
    kinds = [actor.name.split()[0] for actor in street.actors]
    assert set(zip(kinds, classes[1:].tolist(), strict=True)) == {
        ("car", 252),
        ("bicycle", 253),
        ("person", 254),
    }
    surfaces = np.array(sorted(LABELS.values()), np.int8)
    numbers = point_labels(street, surfaces, np.zeros(len(surfaces), np.int64))
    assert numbers[surfaces == LABELS["none"]] == 0
    assert set(numbers[surfaces != LABELS["none"]].tolist()) <= set(CLASS_NAMES)


def test_labels_are_refused_where_the_layout_has_none(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match="in KITTI's layout only, not in pcd"):
        simulate_drive(tmp_path / "drive", "pcd", frames=1, labels=True)
    assert not (tmp_path / "drive").exists()


def test_a_second_run_keeps_existing_files_and_reports_every_frame(tmp_path: Path) -> None:
    folder = quick(tmp_path)
    before = {path: path.stat().st_mtime_ns for path in folder.rglob("*") if path.is_file()}
    notes: list[str] = []
    assert quick(tmp_path, progress=notes.append) == folder
    after = {path: path.stat().st_mtime_ns for path in folder.rglob("*") if path.is_file()}
    assert after == before
    assert notes == ["frame 0", "frame 1"]


def test_a_missing_frame_is_written_again(tmp_path: Path) -> None:
    folder = quick(tmp_path)
    before = content(folder)
    (folder / "velodyne_points/data/0000000001.bin").unlink()
    quick(tmp_path)
    assert content(folder) == before


def test_fewer_frames_and_another_seed_leave_no_old_files(tmp_path: Path) -> None:
    quick(tmp_path / "a", frames=2)
    folder = quick(tmp_path / "a", frames=1, seed=1)
    assert content(folder) == content(quick(tmp_path / "b", frames=1, seed=1))
    quick(tmp_path / "a", frames=2, seed=1)
    folder = quick(tmp_path / "a", frames=1, seed=1)
    assert content(folder) == content(tmp_path / "b" / "2011_09_26" / folder.name)


def test_another_recording_is_not_changed(tmp_path: Path) -> None:
    """KITTI has a drive of this date and number."""
    scan = Layout(tmp_path).scan(0)
    scan.parent.mkdir(parents=True)
    scan.write_bytes(b"precious")
    with pytest.raises(OutputError, match="was not written by `intervis simulate`"):
        quick(tmp_path)
    assert content(tmp_path) == {str(scan.relative_to(tmp_path)): b"precious"}


def test_another_calibration_is_not_changed(tmp_path: Path) -> None:
    path = tmp_path / "2011_09_26" / "calib_cam_to_cam.txt"
    path.parent.mkdir()
    path.write_text("P_rect_02: of another car\n")
    with pytest.raises(OutputError, match=r"calib_cam_to_cam.txt was not written by"):
        quick(tmp_path)
    assert path.read_text() == "P_rect_02: of another car\n"
    assert len(content(tmp_path)) == 1


@pytest.mark.parametrize("frames", [0, -3, 1.5, True, "4", 100_000])
def test_invalid_numbers_of_frames_are_refused(tmp_path: Path, frames) -> None:
    with pytest.raises(SettingsError, match="frames must be"):
        quick(tmp_path, frames=frames)
    assert not list(tmp_path.iterdir())


def test_numpy_integers_are_accepted(tmp_path: Path, drive: Path) -> None:
    folder = quick(tmp_path, frames=np.int64(3), seed=np.uint8(0))
    assert content(folder) == content(drive)


@pytest.mark.parametrize("seed", [-1, 0.5, False, "x"])
def test_invalid_seeds_are_refused(tmp_path: Path, seed) -> None:
    with pytest.raises(SettingsError, match="seed must be"):
        quick(tmp_path, seed=seed)


def test_out_that_is_a_file_is_an_output_error(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_text("kept")
    with pytest.raises(OutputError, match="cannot"):
        quick(path)
    assert path.read_text() == "kept"


def test_full_disk_leaves_whole_files_only_and_can_be_resumed(
    tmp_path, monkeypatch, drive: Path
) -> None:
    real = os.replace

    def full_disk(source, target):
        if str(target).endswith("0000000001.bin"):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        real(source, target)

    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", full_disk)
        with pytest.raises(OutputError, match=r"0000000001.bin: the disk is full"):
            quick(tmp_path, frames=3)
    left, whole = content(tmp_path), content(drive.parent.parent)
    assert 0 < len(left) < len(whole)
    assert all(whole[name] == body for name, body in left.items())
    assert content(quick(tmp_path, frames=3)) == content(drive)


def test_a_folder_without_a_world_is_a_drive_error(tmp_path: Path) -> None:
    with pytest.raises(DriveError, match="only drives written by `intervis simulate`"):
        load_world(tmp_path)


@pytest.mark.parametrize("body", [b"", b"not a zip", b"PK\x03\x04broken"])
def test_a_broken_world_is_a_drive_error(tmp_path: Path, body: bytes) -> None:
    (tmp_path / "world.npz").write_bytes(body)
    with pytest.raises(DriveError, match=r"cannot read .*world.npz"):
        load_world(tmp_path)


def test_a_world_that_is_an_array_is_a_drive_error(tmp_path: Path) -> None:
    with (tmp_path / "world.npz").open("wb") as file:
        np.save(file, np.zeros(3))
    with pytest.raises(DriveError, match=r"cannot read .*world.npz"):
        load_world(tmp_path)


GOOD_WORLD = {
    "static_triangles": np.zeros((2, 3, 3), np.float32),
    "static_labels": np.array([1, 6], np.int8),
    "static_colours": np.zeros((2, 3), np.float16),
    "static_reflectances": np.zeros(2, np.float16),
    "moving_triangles": np.zeros((3, 3, 3), np.float32),
    "moving_labels": np.full(3, 14, np.int8),
    "moving_colours": np.zeros((3, 3), np.float16),
    "moving_reflectances": np.zeros(3, np.float16),
    "actor_names": np.array(["car 1", "car 2"]),
    "actor_sizes": np.array([1, 2]),
    "actor_poses": np.broadcast_to(np.eye(4), (5, 2, 4, 4)),
    "vehicle_poses": np.broadcast_to(np.eye(4), (5, 4, 4)),
}
BAD_ARRAYS = [
    *((name, value) for name in GOOD_WORLD for value in (np.array(1.0), np.array("x"), None)),
    *((name, GOOD_WORLD[name][:-1]) for name in GOOD_WORLD),
    ("static_triangles", np.full((2, 3, 3), 1e300)),
    ("static_triangles", np.full((2, 3, 3), np.nan)),
    ("static_triangles", np.zeros((2, 9))),
    ("static_labels", np.array([1, 19])),
    ("static_labels", np.array([1.5, 2.0])),
    ("static_labels", np.array([1e300, np.inf])),
    ("static_colours", np.full((2, 3), 1j)),
    ("moving_reflectances", np.full(3, np.inf)),
    ("actor_sizes", np.array([-1, 4])),
    ("actor_sizes", np.array([1.5, 1.5])),
    ("actor_names", np.array([b"car 1", b"car 2"])),
    ("vehicle_poses", np.full((5, 4, 4), np.inf)),
]


def save_world(folder: Path, arrays: dict) -> None:
    np.savez(folder / "world.npz", **{k: v for k, v in arrays.items() if v is not None})


def test_a_world_of_valid_arrays_is_read(tmp_path: Path) -> None:
    save_world(tmp_path, GOOD_WORLD)
    world = load_world(tmp_path)
    assert [(name, len(triangles)) for name, triangles in world.actors] == [
        ("car 1", 1),
        ("car 2", 2),
    ]
    assert world.static.labels.tolist() == [1, 6]
    assert world.frame_count == 5


@pytest.mark.parametrize(("name", "value"), BAD_ARRAYS)
def test_a_world_with_a_wrong_array_is_refused_in_one_sentence(
    tmp_path: Path, name: str, value
) -> None:
    save_world(tmp_path, GOOD_WORLD | {name: value})
    with pytest.raises(DriveError, match=r"^cannot read .*world.npz: .*; simulate the drive again"):
        load_world(tmp_path)


def test_a_world_that_lacks_a_part_is_a_drive_error(tmp_path: Path) -> None:
    np.savez(tmp_path / "world.npz", static_triangles=np.zeros((1, 3, 3)))
    with pytest.raises(DriveError, match=r"cannot read .*world.npz"):
        load_world(tmp_path)


def test_a_drive_with_motion_replaces_one_without(tmp_path: Path) -> None:
    """The house's wall x = 8 ahead: while the vehicle drives 0.9 m, it comes nearer."""
    scan = "velodyne_points/data/0000000001.bin"
    still = (quick(tmp_path) / scan).read_bytes()
    folder = quick(tmp_path, motion_distortion=True)
    assert "motion_distortion" in (folder / simulation.METADATA_NAME).read_text()
    rows = np.frombuffer((folder / scan).read_bytes(), "<f4").reshape(-1, 4)
    faces = rows[(np.abs(rows[:, 0] - (8 - 0.9)) < 0.6) & (rows[:, 1] > 4.2) & (rows[:, 2] > -1)]
    azimuth = np.arctan2(faces[:, 1], faces[:, 0])  # the beams turn to the left, ahead at 0.1 s
    expected = 8 - 9.0 * (0.1 + 0.1 * azimuth / (2 * np.pi))
    assert len(faces) > 20
    assert np.abs(faces[:, 0] - expected).max() < 0.1
    assert np.ptp(expected) > 0.05
    assert (quick(tmp_path) / scan).read_bytes() == still
    assert "motion_distortion" not in (folder / simulation.METADATA_NAME).read_text()
