"""Argoverse 2, from a log written by hand, and a real one."""

import json
import pickle
import sys
from pathlib import Path

import numpy as np
import pytest
from argoverse_writer import (
    CAMERA,
    DOWN,
    LASERS,
    POINTS,
    TIMES_NS,
    UP,
    motions,
    write_log,
    write_table,
)
from scipy.spatial.transform import Rotation

from intervis.cli import exit_code
from intervis.drives import open_drive
from intervis.drives.argoverse_tables import motions_of
from intervis.errors import CalibrationError, DriveError, MissingExtraError, ScanError
from intervis.transform import transform

pytest.importorskip("pyarrow", reason="pyarrow (extra argoverse) is not installed")
UPPER = [0, 2, 4]
"""Rows of the upper scanner: lasers 0, 31 and 5."""


@pytest.mark.parametrize("place", ["val/7fab", "val", ""])
def test_a_log_holds_what_its_files_hold(tmp_path, place):
    write_log(tmp_path / "val/7fab")
    drive = open_drive(tmp_path / place)
    assert (drive.layout, drive.name, drive.frame_numbers) == ("argoverse", "7fab", (0, 1))
    frame = drive[1]
    assert frame.timestamp_ns == TIMES_NS[1]
    assert frame.attributes["row"].tolist() == UPPER
    assert frame.attributes["laser_number"].tolist() == LASERS[UPPER].tolist()
    assert frame.attributes["intensity"].dtype == np.uint8
    # The upper scanner stands at (1.35, 0, 1.64), turned by 10 degrees to the left.
    x, y, z = POINTS[0] + np.array([-1.35, 0, 1 - 1.64])
    c, s = np.cos(np.radians(10)), np.sin(np.radians(10))
    assert np.allclose(frame.points[0], [c * x + s * y, -s * x + c * y, z], atol=1e-5)
    # In the city: the vehicle at (100, 202, 3) looks along y.
    assert np.allclose(frame.pose[:3, 3], [100, 203.35, 4.64])
    x, y, z = POINTS[0] + np.array([0, 0, 1])
    assert np.allclose(transform(frame.pose, frame.points)[0], [100 - y, 202 + x, 3 + z])


def test_each_scanner_has_its_own_place(tmp_path):
    write_log(tmp_path)
    upper, lower = open_drive(tmp_path)[0].scans
    assert (upper.name, lower.name) == ("up_lidar", "down_lidar")
    assert lower.attributes["row"].tolist() == [1, 3, 5]
    # The lower one hangs upside down; its points are turned back: x forward, y left, z up.
    assert np.allclose(lower.points[0], POINTS[1] - [1.35, 0, 1.53], atol=1e-5)
    assert np.allclose(lower.pose[:3, 3], [100, 201.35, 4.53])
    both = np.concatenate([transform(scan.pose, scan.points) for scan in (upper, lower)])
    x, y, z = POINTS[[0, 2, 4, 1, 3, 5]].T
    assert np.allclose(both, np.column_stack([100 - y, 200 + x, 3 + z]), atol=1e-5)


def test_masks_stand_in_the_logs_own_vehicle_frame(tmp_path, capsys):
    write_log(tmp_path / "log")
    drive = open_drive(tmp_path / "log")
    assert np.allclose(transform(drive.ego_from_velo, drive[0].points), POINTS[UPPER], atol=1e-5)
    command = ["masks", str(tmp_path / "log"), "--out", str(tmp_path / "m"), "--no-cameras"]
    command += ["--layout", "occ3d-nuscenes", "--frames", "0"]
    assert exit_code(command) == 0
    said = capsys.readouterr().out
    assert "Scanner at (1.35, 0.00, 1.64) m in the vehicle's frame, as the drive says." in said
    stated = json.loads((tmp_path / "m" / "masks.json").read_text())["grid_from_velo"]
    assert np.allclose(stated, drive.ego_from_velo)


def test_the_vehicle_moves_between_sweep_and_image(tmp_path):
    write_log(tmp_path)
    drive = open_drive(tmp_path)
    frame = drive[0]
    assert frame.image_path.stem == str(TIMES_NS[0] + 50_000_000)
    assert (frame.camera.width_px, frame.camera.height_px) == (1550, 2048)
    assert frame.camera.projection.tolist() == [
        [1776, 0, 777, 0],
        [0, 1775, 1013, 0],
        [0, 0, 1, 0],
    ]
    # In 50 ms the vehicle drives half a metre: the camera stands 0.25 + 0.5 m ahead of the scanner
    # and 0.24 m below it. Ahead in the vehicle is turned by -10 degrees for the scanner.
    c, s = np.cos(np.radians(10)), np.sin(np.radians(10))
    assert np.allclose(frame.cam_from_velo @ [10 * c, -10 * s, 0, 1], [0, -0.24, 9.25, 1])
    assert drive[1].image_path is not None  # 50.2 ms before it


def test_a_sweep_between_poses_has_an_interpolated_one(tmp_path):
    write_log(tmp_path)
    turns = [Rotation.from_euler("z", angle, degrees=True) for angle in (0, 90)]
    write_table(
        tmp_path / "city_SE3_egovehicle.feather",
        timestamp_ns=np.array([TIMES_NS[0], TIMES_NS[0] + 400_768_000]),
        **motions((turns[0], [0, 0, 0]), (turns[1], [4, 8, 0])),
    )
    # The second sweep, 100.196 ms later, lies at 0.25001 of the way.
    drive = open_drive(tmp_path)
    share = 100_196_000 / 400_768_000
    scanner = np.array([1.35, 0, 1.64])
    turn = Rotation.from_euler("z", 90 * share, degrees=True)
    assert np.allclose(drive[1].pose[:3, 3], turn.apply(scanner) + np.array([4, 8, 0]) * share)
    assert drive[0].pose is not None


@pytest.mark.parametrize("times_ns", [[1, 2], [TIMES_NS[0] - 10**12, TIMES_NS[1] + 10**12]])
def test_poses_that_do_not_cover_a_sweep_leave_it_without(tmp_path, times_ns):
    write_log(tmp_path)
    still = (Rotation.identity(), [0, 0, 0])
    write_table(
        tmp_path / "city_SE3_egovehicle.feather",
        timestamp_ns=np.array(times_ns),
        **motions(still, still),
    )
    drive = open_drive(tmp_path)
    assert drive.poses is None
    assert drive[0].pose is None
    assert [scan.pose for scan in drive[0].scans] == [None, None]
    assert drive[0].camera is not None


def test_a_log_without_cameras_and_poses(tmp_path):
    write_log(tmp_path)
    (tmp_path / "calibration/intrinsics.feather").unlink()
    (tmp_path / "city_SE3_egovehicle.feather").unlink()
    drive = open_drive(tmp_path)
    assert (drive.camera, drive.poses) == (None, None)
    assert len(drive[0].points) == 3
    with pytest.raises(DriveError, match="no camera 'stereo'; available cameras: none"):
        open_drive(tmp_path, camera="stereo")


def test_of_several_logs_one_must_be_named(tmp_path):
    write_log(tmp_path / "val/a")
    write_log(tmp_path / "val/b")
    with pytest.raises(DriveError, match=r"holds 2 drives; .*: a, b\."):
        open_drive(tmp_path / "val")


@pytest.mark.parametrize(
    ("file", "columns", "message"),
    [
        ("calibration/egovehicle_SE3_sensor", {"sensor_name": ["up_lidar"]}, "has no column qw"),
        ("calibration/egovehicle_SE3_sensor", {"qw": [1.0]}, "has no column sensor_name"),
        ("calibration/intrinsics", {"sensor_name": ["a"], "fx_px": [1.0]}, "has no column fy_px"),
        ("city_SE3_egovehicle", {"qw": [1.0]}, "has no times in whole nanoseconds"),
        ("city_SE3_egovehicle", {"timestamp_ns": [1], "qw": ["x"]}, "has no column qx"),
    ],
)
def test_tables_without_their_columns_are_told(tmp_path, file, columns, message):
    write_log(tmp_path)
    write_table(tmp_path / f"{file}.feather", **columns)
    with pytest.raises(CalibrationError, match=rf"{file}\.feather {message}"):
        open_drive(tmp_path)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"qw": [0.0] * 3, "qx": [0.0] * 3, "qy": [0.0] * 3, "qz": [0.0] * 3},
            "are not a quaternion",
        ),
        ({"tx_m": [np.nan, 0, 0]}, "needs finite numbers in"),
        ({"tx_m": [1e300, 0, 0]}, "needs finite numbers in"),
        ({"tx_m": ["a", "b", "c"]}, "needs finite numbers in"),
        ({"sensor_name": ["two\nlines", "a", "b"]}, "a sensor_name that is not a plain name"),
        ({"sensor_name": ["up_lidar", "a", "b"]}, "has no row for down_lidar"),
    ],
)
def test_places_that_are_none_are_told(tmp_path, changes, message):
    write_log(tmp_path)
    still = (Rotation.identity(), [0, 0, 0])
    columns = {"sensor_name": ["ring_front_center", "up_lidar", "down_lidar"],
               **motions(still, still, still), **changes}  # fmt: skip
    write_table(tmp_path / "calibration/egovehicle_SE3_sensor.feather", **columns)
    with pytest.raises(CalibrationError, match=message):
        open_drive(tmp_path)


def test_texts_whose_offsets_lead_out_of_the_file_are_told(tmp_path):
    """Found by fuzzing: the process was ended."""
    write_log(tmp_path)
    path = tmp_path / "calibration/egovehicle_SE3_sensor.feather"
    content = path.read_bytes()
    ends = np.array([17, 25, 35], "<i4")  # of the three names, one after the other
    assert ends.tobytes() in content
    damaged = np.array([17, 0x7F000019, 35], "<i4").tobytes()
    path.write_bytes(content.replace(ends.tobytes(), damaged))
    with pytest.raises(CalibrationError, match="is not a readable Feather file"):
        open_drive(tmp_path)


@pytest.mark.parametrize("content", [b"", b"ARROW1", b"not a table" * 9])
def test_a_sweep_that_is_no_table_fails_alone(tmp_path, content):
    write_log(tmp_path)
    path = tmp_path / f"sensors/lidar/{TIMES_NS[0]}.feather"
    path.write_bytes(content)
    drive = open_drive(tmp_path)
    with pytest.raises(ScanError, match="is not a readable Feather file") as caught:
        drive[0]
    assert "\n" not in str(caught.value)
    assert len(drive[1].points) == 3


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ({"x": [1.0]}, "has no y z"),
        ({"x": [1.0], "": [1.0]}, "its columns need different names"),
        ({"x": [1.0], "y": [1.0], "z": [1.0]}, "has no column laser_number"),
        ({"x": [1.0], "y": [1.0], "z": [1.0], "laser_number": ["a"]}, "needs numbers in x, y, z"),
        ({"x": [1.0], "y": [1.0], "z": [1.0], "laser_number": [40]}, "holds no points"),
    ],
)
def test_sweeps_without_their_columns_are_told(tmp_path, columns, message):
    write_log(tmp_path)
    write_table(tmp_path / f"sensors/lidar/{TIMES_NS[0]}.feather", **columns)
    with pytest.raises(ScanError, match=message):
        open_drive(tmp_path)[0]


def test_a_log_can_be_pickled(tmp_path):
    write_log(tmp_path)
    frame = pickle.loads(pickle.dumps(pickle.loads(pickle.dumps(open_drive(tmp_path)))[1]))
    assert len(frame.scans) == 2


def test_without_pyarrow_the_extra_is_named(tmp_path, monkeypatch):
    write_log(tmp_path)
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'intervis\[argoverse\]'"):
        open_drive(tmp_path)


@pytest.mark.realdata
def test_a_real_log_splits_into_two_scanners_of_32_beams(shared_data):
    """From the right place each laser keeps its elevation; from the other one it does not."""
    drive = open_drive(shared_data / "av2")
    assert len(drive) == 2
    for number, count in ((0, 99_229), (1, 99_466)):
        upper, lower = drive[number].scans
        assert len(upper.points) + len(lower.points) == count
        for own, other in ((upper, lower), (lower, upper)):
            assert len(np.unique(own.attributes["laser_number"])) == 32
            moved = own.points + (own.pose[:3, 3] - other.pose[:3, 3])[2] * np.array([0, 0, 1])
            assert 1.8 * elevation_spread(own, own.points) < elevation_spread(own, moved)


def elevation_spread(scan, points):
    """Median over the lasers of the interquartile range of elevation, degrees."""
    range_m = np.linalg.norm(points, axis=1)
    elevation_deg = np.degrees(np.arcsin(points[:, 2] / range_m))
    spreads = []
    for laser in np.unique(scan.attributes["laser_number"]):
        own = (scan.attributes["laser_number"] == laser) & (range_m > 3)
        spreads.append(np.subtract(*np.quantile(elevation_deg[own], [0.75, 0.25])))
    return np.median(spreads)


def test_attributes_are_the_columns_of_numbers_beside_the_coordinates(tmp_path):
    write_log(tmp_path)
    columns = {"x": [1.0], "y": [2.0], "z": [3.0], "laser_number": [0], "tag": ["a"], "t": [7]}
    write_table(tmp_path / f"sensors/lidar/{TIMES_NS[0]}.feather", **columns)
    frame = open_drive(tmp_path)[0]
    assert sorted(frame.attributes) == ["laser_number", "row", "t"]
    assert frame.camera.name == "ring_front_center"


@pytest.mark.parametrize(("letters", "valid"), [(99, True), (100, False)])
def test_letters_of_the_name_of_a_sensor(tmp_path, letters, valid):
    write_log(tmp_path)
    table = tmp_path / "calibration/egovehicle_SE3_sensor.feather"
    names = ["ring_front_center", "up_lidar", "down_lidar", "x" * letters]
    write_table(table, sensor_name=names, **motions(CAMERA, UP, DOWN, DOWN))
    if valid:
        assert len(open_drive(tmp_path)) == 2
    else:
        with pytest.raises(CalibrationError, match="not a plain name"):
            open_drive(tmp_path)


def test_times_since_1970_have_19_digits(tmp_path):
    pytest.importorskip("pyarrow", reason="pyarrow (extra argoverse) is not installed")
    log = write_log(tmp_path)
    sweep = log / "sensors" / "lidar" / f"{TIMES_NS[0]}.feather"
    sweep.rename(sweep.with_name("1700000000000000000.feather"))
    (sweep.parent / "9999999999999999999.feather").write_bytes(b"no time: beyond 64 bits")
    assert list(open_drive(log).timestamps_ns.values()) == [TIMES_NS[1], 1700000000000000000]


@pytest.mark.parametrize(
    ("error", "reason"),
    [(RuntimeError("first line.\nsecond"), "first line"), (RuntimeError(), "RuntimeError")],
)
def test_what_pyarrow_raises_becomes_one_sentence(tmp_path, monkeypatch, error, reason):
    from pyarrow import feather

    def fail(*_, **__):
        raise error

    write_log(tmp_path)
    drive = open_drive(tmp_path)
    monkeypatch.setattr(feather, "read_table", fail)
    with pytest.raises(ScanError) as caught:
        drive[0]
    assert str(caught.value).endswith(f"is not a readable Feather file: {reason}.")


@pytest.mark.parametrize(
    ("quaternion", "place_m", "message"),
    [
        ((1.1e-3, 0, 0, 0), (0, 0, 0), None),
        ((0, 999.0, 0, 0), (0, -0.99e9, 0), None),
        ((0, 0, 1e-3, 0), (0, 0, 0), "are not a quaternion"),
        ((0, 0, 0, 1e3), (0, 0, 0), "are not a quaternion"),
        ((1, 0, 0, 0), (1e9, 0, 0), "needs finite numbers"),
        ((1, 0, 0, 0), (0, 0, -1e9), "needs finite numbers"),
    ],
)
def test_limits_of_a_motion_in_a_table(quaternion, place_m, message):
    names = ("qw", "qx", "qy", "qz", "tx_m", "ty_m", "tz_m")
    rows = np.array([(*quaternion, *place_m)], [(name, float) for name in names])
    if message is None:
        (motion,) = motions_of(Path("a"), rows)
        assert motion[:3, 3].tolist() == list(place_m)
        assert np.allclose(abs(motion[:3, :3]), np.eye(3))
    else:
        with pytest.raises(CalibrationError, match=message):
            motions_of(Path("a"), rows)
