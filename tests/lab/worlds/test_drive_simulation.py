"""Simulated drives in every layout, read back: points, poses, cameras, boxes and times."""

import errno
import math
import os
import sys
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from intervis.drives import Drive, mcap_writer, open_drive
from intervis.drives.drive_writer import FrameRecord, ego_points
from intervis.errors import MissingExtraError, OutputError, SettingsError
from intervis.lab.worlds import drive_simulation, shapes, simulated_drive, simulation
from intervis.lab.worlds.beam_pattern import BeamPattern, terrestrial
from intervis.lab.worlds.drive_simulation import simulate_drive
from intervis.lab.worlds.mounted_scanner import EGO_FROM_VELO, MountedScanner, mounted
from intervis.lab.worlds.mounts import VEHICLE_MOUNTS
from intervis.lab.worlds.presets import PRESETS, Preset
from intervis.lab.worlds.simulated_drive import START_NS, SimulatedDrive, roadside_site
from intervis.lab.worlds.triangles import Material, Triangles
from intervis.lab.worlds.world import Actor, World
from intervis.transform import inverse, rigid, transform

embreex = pytest.importorskip("embreex", reason="embreex, which casts the rays, is not installed")


def vehicle_pose(time_s: float) -> np.ndarray:
    """A vehicle that drives 12 m/s and turns by 20 degrees a second, with roll and pitch."""
    angles = [20.0 * time_s, 1.5 * math.sin(4 * time_s), 1.0 * math.sin(3 * time_s)]
    turn = Rotation.from_euler("ZYX", angles, degrees=True).as_matrix()
    return rigid(turn, [12.0 * time_s, 1.5 * time_s**2, 0.1 * math.sin(time_s)])


@lru_cache
def small_world(seed: int = 0) -> World:
    """Ground, four walls, a house, a car and a person that move."""
    grey = Material("building", (0.7, 0.6, 0.5), 0.45)
    ground = shapes.quad([-90, -60, -1.7], [90, -60, -1.7], [90, 60, -1.7], [-90, 60, -1.7])
    walls = [
        shapes.box([30, -40, -1.7], [31, 40, 9]),
        shapes.box([-31, -40, -1.7], [-30, 40, 9]),
        shapes.box([-30, 20, -1.7], [30, 21, 9]),
        shapes.box([-30, -21, -1.7], [30, -20, 9]),
        shapes.box([8.0 + seed, 8.0, -1.7], [16.0, 14.0, 4.0]),
    ]
    static = [Triangles.of(ground, Material("road", (0.11, 0.12, 0.13), 0.3))]
    static += [Triangles.of(wall, grey) for wall in walls]
    car = Triangles.of(shapes.box([-2.2, -0.9, 0], [2.0, 0.9, 1.5]), Material("car", (1, 0, 0), 1))
    person = Triangles.of(shapes.box([-0.2, -0.3, 0], [0.3, 0.3, 1.7]), grey)
    turn = Rotation.from_euler("z", 170, degrees=True).as_matrix()
    actors = (
        Actor("car 1", car, lambda time_s: rigid(turn, [20.0 - 6 * time_s, -4.0, -1.7])),
        Actor("person 1", person, lambda time_s: rigid(np.eye(3), [9.0, 3.0 - time_s, -1.7])),
    )
    return World(Triangles.joined(static), actors, vehicle_pose, last_s=20.0)


def coarse(name: str, rows: int) -> Preset:
    """A spinning scanner of few beams."""
    rng = np.random.default_rng(rows)
    elevation, azimuth = np.meshgrid(
        np.radians(np.linspace(8, -24, rows)), np.arange(0, 2 * np.pi, 0.025), indexing="ij"
    )
    directions = np.stack(
        [
            np.cos(elevation) * np.cos(azimuth),
            np.cos(elevation) * np.sin(azimuth),
            np.sin(elevation),
        ],
        axis=-1,
    )
    columns = azimuth.shape[1]
    pattern = BeamPattern(
        f"{name} of {rows} rows",
        directions.swapaxes(0, 1).reshape(-1, 3),
        np.tile(np.arange(rows), columns),
        np.repeat(np.arange(columns) * (0.1 / columns), rows),
        rng.uniform(0.01, 0.02, rows * columns),
        *(0.5, 100.0, 0.02, 0.02),
    )
    return Preset(name, "roof", 0.1, lambda time_s: pattern)


@pytest.fixture(autouse=True)
def _small_world(monkeypatch) -> None:
    for module in (drive_simulation, simulation):
        monkeypatch.setattr(module, "build_street", small_world)
    rows = {"hdl-32e": 24, "vlp-16": 16, "hdl-64e": 20, "os1-128": 40, "qt64": 18}
    for name in rows:
        monkeypatch.setitem(PRESETS, name, coarse(name, rows[name]))
    monkeypatch.setattr(simulated_drive, "_IMAGE_PX", (64, 36))
    monkeypatch.setattr(simulated_drive, "_FOCAL_PX", 40.0)


SCANNERS = {
    "nuscenes": ("hdl-32e", "qt64@left", "vlp-16@under"),
    "argoverse2": ("hdl-32e@roof", "vlp-16@under"),
    "pcd": ("hdl-64e",),
    "mcap": ("os1-128", "ring@front"),
}


def truth(layout: str, motion: bool = False, seed: int = 0) -> SimulatedDrive:
    """What the drive of a layout is made of, simulated once more."""
    scanners = [mounted(text) for text in SCANNERS[layout]]
    cameras = layout in ("nuscenes", "argoverse2", "mcap")
    return SimulatedDrive.of(small_world(seed), scanners, seed=seed, cameras=cameras, motion=motion)


def written(out: Path, layout: str, frames: int = 3, **options) -> Drive:
    path = simulate_drive(out / layout, layout, SCANNERS[layout], frames=frames, **options)
    return open_drive(path)


def same_frame(found: np.ndarray, true: np.ndarray) -> np.ndarray:
    """The whole right angles by which the frame of a reader differs from the scanner's."""
    axes = inverse(found)[:3, :3] @ true[:3, :3]
    assert np.allclose(axes, np.round(axes), atol=1e-9)
    assert np.allclose(found[:3, 3], true[:3, 3], rtol=0, atol=1e-6)
    return np.round(axes)


def scans_by_time(frame: FrameRecord, drive: SimulatedDrive):
    for scanner, scan in zip(drive.rig.scanners, frame.scans, strict=True):
        yield scan, frame.world_from_ego @ scanner.ego_from_velo


@pytest.mark.parametrize("layout", ["nuscenes", "pcd", "mcap"])
@pytest.mark.parametrize("motion", [False, True])
def test_points_poses_and_times_are_read_back(layout: str, motion: bool, tmp_path: Path) -> None:
    drive = written(tmp_path, layout, images=False, motion_distortion=motion)
    true = truth(layout, motion)
    assert drive.frame_numbers == (0, 1, 2)
    for number in drive.frame_numbers:
        frame, record = drive[number], true.frame(number)
        assert frame.timestamp_ns == record.time_ns == START_NS + number * 100_000_000
        assert len(frame.scans) == len(SCANNERS[layout])
        origins = {tuple(np.round(scan.pose[:3, 3], 6)): scan for scan in frame.scans}
        for scan, pose in scans_by_time(record, true):
            found = origins[tuple(np.round(pose[:3, 3], 6))]
            axes = same_frame(found.pose, pose)
            assert found.timestamp_ns == record.time_ns
            assert np.array_equal(found.points, (scan.points @ axes.T).astype(np.float32))
            intensity = np.round(255 * scan.intensity) if layout == "nuscenes" else scan.intensity
            assert np.array_equal(found.attributes["intensity"], intensity)
            if scan.ring is not None:
                assert np.array_equal(found.attributes["ring"], scan.ring)
            if layout != "nuscenes" and motion:
                assert np.array_equal(found.attributes["t"], scan.offset_ns)
            else:
                assert "t" not in found.attributes


@pytest.mark.parametrize("motion", [False, True])
def test_argoverse_holds_points_in_the_vehicle_at_the_sweep_time(motion, tmp_path) -> None:
    feather = pytest.importorskip("pyarrow.feather", reason="pyarrow is not installed")
    drive = written(tmp_path, "argoverse2", images=False, motion_distortion=motion)
    true = truth("argoverse2", motion)
    for number in drive.frame_numbers:
        frame, record = drive[number], true.frame(number)
        assert frame.timestamp_ns == record.time_ns
        table = feather.read_table(frame.scan_path)
        stored = np.column_stack([table[axis].to_numpy() for axis in "xyz"])
        assert stored.dtype == np.float16
        expected, lasers = [], []
        for first, scanner, scan in zip((0, 32), true.rig.scanners, record.scans, strict=True):
            in_ego = transform(scanner.ego_from_velo, scan.points)
            if motion:  # each from the place of the vehicle at its own time
                times_s = number * 0.1 + 1e-9 * scan.offset_ns
                ego_from_world = inverse(true.world_from_ego(number * 0.1))
                moves = {t: ego_from_world @ true.world_from_ego(t) for t in np.unique(times_s)}
                in_ego = np.array(
                    [transform(moves[t], p) for t, p in zip(times_s, in_ego, strict=True)]
                )
            expected.append(in_ego)
            lasers.append(scan.ring + first)
        if motion:
            # Between poses 10 ms apart, in float32: far less than a step of a 16-bit float.
            steps = np.spacing(np.abs(np.concatenate(expected)).astype(np.float16))
            off = np.abs(stored.astype(float) - np.concatenate(expected))
            assert (off <= 0.51 * steps.astype(float) + 2e-4).all()
            moved = np.concatenate(
                [
                    ego_points(scanner, scan, record)
                    - transform(scanner.ego_from_velo, scan.points)
                    for scanner, scan in zip(true.rig.scanners, record.scans, strict=True)
                ]
            )
            assert np.linalg.norm(moved, axis=1).max() > 1.0
        else:
            assert np.array_equal(stored, np.concatenate(expected).astype(np.float16))
        assert np.array_equal(table["laser_number"].to_numpy(), np.concatenate(lasers))
        offsets = np.concatenate([np.zeros(len(s.points)) if s.offset_ns is None else s.offset_ns
                                  for s in record.scans])  # fmt: skip
        assert np.array_equal(table["offset_ns"].to_numpy(), offsets)
        for found, (_, pose) in zip(frame.scans, scans_by_time(record, true), strict=True):
            same_frame(found.pose, pose)
        assert sum(len(scan.points) for scan in frame.scans) == len(stored)


@pytest.mark.parametrize(
    ("layout", "cameras"),
    [
        ("nuscenes", {"front": "CAM_FRONT", "rear": "CAM_BACK"}),
        ("argoverse2", {"front": "ring_front_center", "rear": "ring_rear_left"}),
        ("mcap", {"front": "camera_front", "rear": "camera_rear"}),
    ],
)
def test_cameras_and_images_are_read_back(layout, cameras, tmp_path: Path) -> None:
    if layout == "argoverse2":
        pytest.importorskip("pyarrow", reason="pyarrow is not installed")
    opened = written(tmp_path, layout)
    true = truth(layout)
    assert set(opened.camera_names) == set(cameras.values())
    for nth, (name, channel) in enumerate(cameras.items()):
        drive = open_drive(opened.root, camera=channel)
        for number in drive.frame_numbers:
            frame, record = drive[number], true.frame(number)
            model = true.rig.cameras[nth]
            assert model.name == name
            assert np.allclose(frame.camera.projection, model.camera.projection, rtol=0, atol=1e-9)
            assert (frame.camera.width_px, frame.camera.height_px) == (64, 36)
            image = record.images[nth]
            assert image.time_ns == record.time_ns + 20_000_000
            # From the world to the camera at the time of its image, the vehicle having moved.
            cam_from_world = inverse(image.world_from_ego @ model.ego_from_cam)
            assert np.allclose(
                frame.cam_from_velo @ inverse(frame.pose), cam_from_world, rtol=0, atol=1e-6
            )
            if frame.image_path is not None:  # else it lies in the recording
                assert str(image.time_ns // 1000) in frame.image_path.name
            difference = np.abs(frame.image.astype(int) - image.pixels)
            assert np.median(difference) <= 6  # JPEG
            assert frame.image.std() > 10


@pytest.mark.parametrize("layout", ["nuscenes", "argoverse2"])
def test_boxes_are_read_back(layout: str, tmp_path: Path) -> None:
    if layout == "argoverse2":
        pytest.importorskip("pyarrow", reason="pyarrow is not installed")
    names = {
        "nuscenes": {"car": "vehicle.car", "person": "human.pedestrian.adult"},
        "argoverse2": {"car": "REGULAR_VEHICLE", "person": "PEDESTRIAN"},
    }[layout]
    drive, true = written(tmp_path, layout, frames=6, images=False), truth(layout)
    tracks: dict[str, set[str]] = {}
    for number in (0, 5) if layout == "nuscenes" else range(6):
        frame, world = drive[number], small_world()
        found = {box.category: box for box in frame.boxes}
        assert set(found) == set(names.values())
        for actor in world.actors:
            box = found[names[actor.name.split()[0]]]
            tracks.setdefault(box.category, set()).add(box.track)
            corners = transform(actor.pose_at(number * 0.1), actor.triangles.corners).reshape(-1, 3)
            in_box = transform(inverse(frame.pose @ box.velo_from_box), corners)
            assert np.allclose(np.abs(in_box), box.size_m / 2, rtol=0, atol=1e-6)
            ahead = actor.pose_at(number * 0.1)[:3, 0]
            assert np.allclose((frame.pose @ box.velo_from_box)[:3, 0], ahead, atol=1e-9)
            inside = 0
            for scan in frame.scans:
                points = transform(inverse(frame.pose @ box.velo_from_box),
                                   transform(scan.pose, scan.points))  # fmt: skip
                inside += (np.abs(points) <= box.size_m / 2).all(axis=1).sum()
            assert abs(box.returns - inside) <= 2  # at the faces, by the last bit
            assert inside > 0
        assert len(frame.boxes) == len(true.frame(number).boxes) == 2
    assert all(len(track) == 1 for track in tracks.values())
    if layout == "nuscenes":
        assert drive[1].boxes == ()


@pytest.mark.parametrize("layout", ["pcd", "mcap"])
def test_deskewed_sweeps_agree_with_a_sweep_without_motion(layout, tmp_path, monkeypatch) -> None:
    """Each deskewed return against what a scanner at the frame's pose measures in its direction."""
    exact = coarse("hdl-64e", 20)
    pattern = exact.sweep_at(0.0)
    still = BeamPattern(*(pattern.name, pattern.directions, pattern.ring, pattern.time_s),
                        *(pattern.spacing_rad, 0.5, 100.0, 0.0, 0.0))  # fmt: skip
    monkeypatch.setitem(PRESETS, "hdl-64e", Preset("hdl-64e", "roof", 0.1, lambda time_s: still))
    path = simulate_drive(
        tmp_path / "out", layout, ["hdl-64e"], frames=4, images=False, motion_distortion=True
    )
    drive, world = open_drive(path), small_world()
    for number in (0, 1, 2):
        frame = drive[number]
        record = SimulatedDrive.of(world, [mounted("hdl-64e")], motion=True).frame(number)
        assert np.array_equal(frame.point_times_ns, frame.timestamp_ns + record.scans[0].offset_ns)
        errors = {}
        snapshot = world.at(number * 0.1)
        for name, points in (("measured", frame.points), ("deskewed", frame.deskewed())):
            world_points = transform(frame.pose, points)
            rays = world_points - frame.pose[:3, 3]
            range_m = np.linalg.norm(rays, axis=1)
            rays /= range_m[:, None]
            expected_m, hit = snapshot.caster.closest(frame.pose[:3, 3], rays)
            static = (hit >= 0) & (hit < len(world.static))
            # Across the surface: along a grazing ray a small angle makes a large difference.
            cosines = np.abs(np.einsum("ij,ij->i", rays, snapshot.normals[hit]))
            errors[name] = (cosines * np.abs(range_m - expected_m))[static]
        assert len(errors["deskewed"]) > 3000
        assert np.quantile(errors["deskewed"], 0.95) < 0.02
        assert np.quantile(errors["measured"], 0.95) > 0.5
        assert np.median(errors["deskewed"]) < 0.003


def test_without_motion_all_points_have_the_time_of_the_scan(tmp_path: Path) -> None:
    pytest.importorskip("pyarrow", reason="pyarrow is not installed")
    frame = written(tmp_path, "argoverse2", frames=1, images=False)[0]
    assert (frame.point_times_ns == frame.timestamp_ns).all()


# --- scanners and mounts ---


@pytest.mark.parametrize("name", sorted(PRESETS))
def test_every_preset_scans_from_its_mount(name: str) -> None:
    scanner = mounted(name)
    world = small_world()
    at = lambda time_s: vehicle_pose(time_s) @ inverse(EGO_FROM_VELO)  # noqa: E731
    points, attributes = scanner.sweep(world, at, 0.2, np.random.default_rng(0), motion=False)
    beams = len(scanner.preset.sweep_at(0.2).directions)
    assert 0.03 * beams < len(points) <= beams
    assert np.isfinite(points).all()
    pose = at(0.2) @ scanner.ego_from_scanner
    caster = world.at(0.2).caster
    rays = transform(pose, points) - pose[:3, 3]
    range_m = np.linalg.norm(rays, axis=1)
    expected_m, _ = caster.closest(pose[:3, 3], rays / range_m[:, None])
    off = np.abs(range_m - expected_m)
    assert np.quantile(off, 0.9) < 2.5 * scanner.preset.sweep_at(0.2).noise_m + 1e-4
    assert ("ring" in attributes) == (name != "livox")


def test_a_rosette_does_not_repeat_itself() -> None:
    first, second = (PRESETS["livox"].sweep_at(time_s).directions for time_s in (0.0, 0.1))
    assert np.abs(first - second).max() > 0.1
    whole = PRESETS["livox"].sweep_at(0.0).time_s[-1]
    assert 0.09 < whole < 0.1


def test_beams_into_the_own_vehicle_give_no_return() -> None:
    """A scanner on the roof: rays marched through the two boxes in small steps."""
    scanner = MountedScanner(PRESETS["hdl-64e"], "roof", VEHICLE_MOUNTS["roof"].ego_from_scanner)
    directions = scanner.preset.sweep_at(0.0).directions[::7]
    blocked = scanner._hits_vehicle(directions)
    along = scanner.ego_from_scanner[:3, 3] + np.linspace(0, 6, 2401)[:, None, None] * directions
    inside = np.zeros(along.shape[:2], bool)
    for lower, upper in (
        ((-1.0, -0.9, 0.25), (3.7, 0.9, 0.95)),
        ((-0.9, -0.75, 0.95), (1.9, 0.75, 1.5)),
    ):
        inside |= ((along > lower) & (along < upper)).all(axis=-1)
    marched = inside.any(axis=0)
    assert 0.02 < marched.mean() < 0.5
    assert (marched == blocked).mean() > 0.99
    assert not (marched & ~blocked).any()


@pytest.mark.parametrize("text", ["vlp-16@mast", "terrestrial"])
def test_scanners_beside_the_street_stand_still(text: str, tmp_path: Path, monkeypatch) -> None:
    rough = Preset("terrestrial", "tripod", 120.0, lambda time_s: terrestrial(4.0))
    monkeypatch.setitem(PRESETS, "terrestrial", rough)
    path = simulate_drive(tmp_path / "out", "pcd", [text], frames=2, motion_distortion=True)
    drive = open_drive(path)
    assert np.array_equal(drive[0].pose, drive[1].pose)
    site = roadside_site(small_world())
    height_m = {"vlp-16@mast": 6.0, "terrestrial": 1.8}[text]
    assert np.allclose(drive[0].pose[:3, 3] - site[:3, 3], [0, 0, height_m])
    assert np.isclose(site[2, 3], -1.7)  # on the ground
    assert drive[1].timestamp_ns - drive[0].timestamp_ns == (
        100_000_000 if "mast" in text else 120_000_000_000
    )


# --- bad input ---


@pytest.mark.parametrize(
    ("layout", "scanners", "message"),
    [
        ("rosbag", (), r"no layout 'rosbag': choose from kitti, nuscenes, argoverse2, pcd, mcap"),
        ("pcd", ("hdl-65",), r"no scanner 'hdl-65': choose from at128, hdl-32e"),
        ("pcd", ("hdl-64e@bonnet",), r"no mount 'bonnet': choose from roof, under, left"),
        ("pcd", ("hdl-64e", "vlp-16@front"), r"PCD files takes one scanner, not 2"),
        ("kitti", ("hdl-64e", "vlp-16@front"), r"KITTI's layout takes one scanner, not 2"),
        ("kitti", ("vlp-16@mast",), r"KITTI's layout is that of a vehicle"),
        ("argoverse2", ("hdl-32e",), r"takes two scanners .*, not 1"),
        ("argoverse2", ("os1-128@roof", "vlp-16@under"), r"1 to 32 rows; .* has 40"),
        ("nuscenes", ("hdl-32e", "vlp-16"), r"hdl-32e and vlp-16 cannot both stand at roof"),
        ("mcap", ("hdl-32e", "vlp-16@mast"), r"on the vehicle and beside the street"),
        ("mcap", ("terrestrial@roof",), r"terrestrial takes 120 s for a scan"),
    ],
)
def test_what_a_layout_cannot_hold_is_refused(layout, scanners, message, tmp_path) -> None:
    with pytest.raises(SettingsError, match=message):
        simulate_drive(tmp_path / "out", layout, scanners)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("frames", [0, -2, 1.5, True, "3", 100_000])
def test_numbers_of_frames_are_checked(frames, tmp_path) -> None:
    with pytest.raises(SettingsError, match="frames must be"):
        simulate_drive(tmp_path / "out", "pcd", frames=frames)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("layout", ["nuscenes", "argoverse2", "pcd", "mcap"])
def test_files_of_others_are_not_changed(layout: str, tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "mine.txt").write_text("mine")
    with pytest.raises(OutputError, match="holds files already and was not changed"):
        simulate_drive(tmp_path / "out", layout, frames=1)
    assert [path.name for path in tmp_path.rglob("*")] == ["out", "mine.txt"]
    with pytest.raises(OutputError, match="is a file and was not changed"):
        simulate_drive(tmp_path / "out" / "mine.txt", layout, frames=1)


@pytest.mark.parametrize("layout", ["nuscenes", "argoverse2", "pcd", "mcap"])
def test_a_full_disk_leaves_nothing(layout: str, tmp_path: Path, monkeypatch) -> None:
    if layout == "argoverse2":
        pytest.importorskip("pyarrow", reason="pyarrow is not installed")
    real = SimulatedDrive.frame

    def full(drive: SimulatedDrive, number: int) -> FrameRecord:
        if number == 1:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return real(drive, number)

    monkeypatch.setattr(SimulatedDrive, "frame", full)
    with pytest.raises(OutputError, match="the disk is full"):
        simulate_drive(tmp_path / "out", layout, SCANNERS[layout], frames=2, images=False)
    assert not list(tmp_path.iterdir())


def test_an_interruption_leaves_nothing_and_an_empty_folder_is_taken(tmp_path) -> None:
    (tmp_path / "out").mkdir()

    def interrupt(note: str) -> None:
        (scan,) = tmp_path.rglob(".out.*.part/000000.pcd")
        assert scan.read_bytes().startswith(b"# .PCD")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        simulate_drive(tmp_path / "out", "pcd", frames=3, progress=interrupt)
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
    assert not list((tmp_path / "out").iterdir())
    notes: list[str] = []
    simulate_drive(tmp_path / "out", "pcd", frames=2, progress=notes.append)
    assert notes == ["frame 0", "frame 1"]
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        *("000000.pcd", "000001.pcd", "poses.txt", "times.txt", "simulation.json")
    }


def test_argoverse_without_pyarrow_names_the_extra(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(MissingExtraError, match=r"intervis\[argoverse\]"):
        simulate_drive(tmp_path / "out", "argoverse2", frames=1)
    assert not list(tmp_path.iterdir())


def test_the_same_seed_gives_the_same_bytes(tmp_path: Path) -> None:
    for name, seed in (("a", 0), ("b", 0), ("c", 1)):
        simulate_drive(tmp_path / name, "mcap", frames=2, seed=seed)
    first, again, other = ((tmp_path / name / mcap_writer.FILE_NAME).read_bytes() for name in "abc")
    assert first == again
    assert first != other


# --- KITTI ---


@pytest.mark.parametrize("motion", [False, True])
def test_kitti_takes_another_scanner_on_its_mount(motion: bool, tmp_path: Path) -> None:
    path = simulate_drive(
        tmp_path, "kitti", ["vlp-16@front"], frames=2, images=False, motion_distortion=motion
    )
    drive = open_drive(path)
    true = SimulatedDrive.of(small_world(), [mounted("vlp-16@front")], motion=motion)
    for number in (0, 1):
        frame = drive[number]
        pose = true.world_from_ego(number * 0.1) @ VEHICLE_MOUNTS["front"].ego_from_scanner
        assert np.allclose(frame.pose, pose, rtol=0, atol=1e-6)
        points, _ = mounted("vlp-16@front").sweep(
            small_world(), true.world_from_ego, number * 0.1, np.random.default_rng([0, number]),
            motion=motion,
        )  # fmt: skip
        assert np.array_equal(frame.points, points)
        # The camera stays where it is on the vehicle.
        velo_from_front = inverse(vehicle_pose(0.1 * number)) @ pose
        expected = simulation.SensorRig().cam_from_velo @ velo_from_front
        assert np.allclose(frame.cam_from_velo, expected, rtol=0, atol=1e-9)
