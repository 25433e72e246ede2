"""KITTI tracking, labels of points, and sequences of the DynamicMap benchmark."""

import numpy as np
import pytest
from drive_layouts import (
    P_RECT_02,
    P_RECT_03,
    TR,
    scan_rows,
    write_kitti_object,
    write_kitti_odometry,
    write_kitti_raw,
    write_png,
    write_scan,
    write_text,
)

from intervis.drives import open_drive
from intervis.drives.point_labels import CLASS_NAMES
from intervis.errors import CalibrationError, DriveError, ScanError

# As in the tracking set: colons after the projections, none after the other keys.
CALIBRATION = (
    f"P0: {P_RECT_02}\nP2: {P_RECT_02}\nP3: {P_RECT_03}\nR_rect 0 1 0 -1 0 0 0 0 1\n"
    f"Tr_velo_cam {TR}\nTr_imu_velo 1 0 0 -0.81 0 1 0 0.32 0 0 1 -0.8\n"
)


def write_tracking(folder, sequences=("0000", "0004"), scans=(0, 2)):
    base = folder / "training"
    for sequence in sequences:
        for number in scans:
            write_scan(base / "velodyne" / sequence / f"{number:06d}.bin", number)
            write_png(base / "image_02" / sequence / f"{number:06d}.png", 62, 18)
        write_text(base / "calib" / f"{sequence}.txt", CALIBRATION)
    return base


@pytest.mark.parametrize("above", [False, True])
def test_a_tracking_sequence_holds_what_its_files_hold(tmp_path, above):
    base = write_tracking(tmp_path, sequences=("0004",))
    drive = open_drive(base if above else base / "velodyne" / "0004")
    assert (drive.layout, drive.name, drive.frame_numbers) == ("kitti_tracking", "0004", (0, 2))
    assert drive.camera_names == ("image_00", "image_02", "image_03")
    frame = drive[2]
    assert np.array_equal(frame.points, scan_rows(2)[:, :3])
    assert frame.image_path.name == "000002.png"
    assert (frame.camera.name, frame.camera.width_px) == ("image_02", 62)
    # R_rect maps (x, y, z) to (y, -x, z), after Tr_velo_cam: by hand.
    assert np.allclose(frame.cam_from_velo @ [10, 2, 1, 1], [-1.08, 2, 9.73, 1])
    assert open_drive(drive.root, camera="3").camera.projection[0, 3] == -350


def test_of_several_tracking_sequences_one_must_be_named(tmp_path):
    base = write_tracking(tmp_path)
    with pytest.raises(DriveError, match=r"holds 2 drives; .*: velodyne/0000, velodyne/0004"):
        open_drive(base)
    assert open_drive(base / "velodyne/0000").name == "0000"


def test_line_k_of_a_tracking_sequences_oxts_is_frame_k(tmp_path):
    """The IMU drives 10 m north a frame; the LiDAR stands (0.81, -0.32, 0.8) from it."""
    base = write_tracking(tmp_path)
    degrees_of_10_m = np.degrees(10 / 6_378_137.0)
    lines = [f"{n * degrees_of_10_m:.12f} 0 50 0 0 {np.pi / 2} 1 1 1" for n in range(4)]
    write_text(base / "oxts/0000.txt", "\n".join(lines))
    drive = open_drive(base / "velodyne/0000")
    # Yaw 90 degrees: the IMU's x looks north, so the LiDAR is 0.81 m north of it and 0.32 m east.
    assert np.allclose(drive[0].pose[:3, 3], [0.32, 0.81, 0.8], atol=1e-6)
    assert np.allclose(drive[2].pose[:3, 3], [0.32, 20.81, 0.8], atol=1e-4)
    assert np.allclose(drive[2].pose[:3, 0], [0, 1, 0])
    write_text(base / "oxts/0000.txt", "1 2\n")
    with pytest.raises(CalibrationError, match=r"0000\.txt, line 1: expected latitude"):
        open_drive(base / "velodyne/0000")


def test_a_tracking_sequence_without_imu_extrinsics_has_no_poses(tmp_path, caplog):
    base = write_tracking(tmp_path)
    text = CALIBRATION.partition("Tr_imu")[0]
    write_text(base / "calib/0000.txt", text)
    write_text(base / "oxts/0000.txt", "48 8 1 0 0 0\n" * 3)
    assert open_drive(base / "velodyne/0000").poses is None
    assert "has no line Tr_imu_velo" in caplog.text


def test_a_tracking_sequence_may_lack_its_calibration_only_without_images(tmp_path):
    base = write_tracking(tmp_path, sequences=("0000",))
    (base / "calib/0000.txt").unlink()
    with pytest.raises(CalibrationError, match=r"0000\.txt is missing"):
        open_drive(base / "velodyne/0000")
    for path in (base / "image_02/0000").iterdir():
        path.unlink()
    (base / "image_02/0000").rmdir()
    write_text(base / "oxts/0000.txt", "48 8 1 0 0 0\n" * 3)
    drive = open_drive(base / "velodyne/0000")
    assert drive.layout == "kitti_tracking"
    assert (drive.camera, drive.poses) == (None, None)


# --- labels ---

LABELS = np.array([10, 40, 252 | 3 << 16, 0, 99 | 65535 << 16], "<u4")


def write_labels(path, labels=LABELS):
    path.parent.mkdir(parents=True, exist_ok=True)
    labels.tofile(path)
    return path


@pytest.mark.parametrize("place", ["odometry", "folder", "beside", "single", "object", "raw"])
def test_labels_are_classes_and_instances(tmp_path, place):
    if place == "odometry":
        root = write_kitti_odometry(tmp_path)
        write_labels(root / "labels/000001.label")
    elif place == "raw":
        root = write_kitti_raw(tmp_path)
        write_labels(root / "velodyne_points/labels/0000000001.label")
    elif place == "object":
        root = write_kitti_object(tmp_path, scans=(0, 1))
        write_labels(root / "labels/000001.label")
    else:
        root = tmp_path / "velodyne"
        write_scan(root / "000000.bin", 0)
        write_scan(root / "000001.bin", 1)
        write_labels(
            tmp_path / "labels/000001.label" if place == "folder" else root / "000001.label"
        )
    frame = open_drive(root / "000001.bin")[0] if place == "single" else open_drive(root)[1]
    assert frame.point_classes.tolist() == [10, 40, 252, 0, 99]
    assert frame.point_instances.tolist() == [0, 0, 3, 0, 65535]
    assert frame.point_classes.dtype == np.uint16
    assert "labels" in repr(frame)
    if place != "single":
        assert open_drive(root)[0].point_classes is None
        assert open_drive(root)[0].point_instances is None


@pytest.mark.parametrize("content", [b"", b"\0" * 16, b"\0" * 19, b"\0" * 24])
def test_labels_that_do_not_fit_are_told_when_they_are_asked_for(tmp_path, content):
    root = write_kitti_odometry(tmp_path)
    path = write_labels(root / "labels/000001.label")
    path.write_bytes(content)
    frame = open_drive(root)[1]
    assert len(frame.points) == 5
    for name in ("point_classes", "point_instances"):
        with pytest.raises(
            ScanError, match=rf"000001\.label have {len(content)} bytes, .* need 20"
        ):
            getattr(frame, name)
    path.unlink()
    with pytest.raises(ScanError, match="cannot read the labels"):
        _ = frame.point_classes


@pytest.mark.realdata
def test_a_semantickitti_scan_has_its_labels(shared_data):
    frame = open_drive(shared_data / "semantickitti")[0]
    assert len(frame.points) == 123_389
    # By the data set's own table: 40 road, 50 building, 70 vegetation, 80 pole, 252 moving car.
    classes, counts = np.unique(frame.point_classes, return_counts=True)
    assert {40, 50, 70, 80, 252} <= set(classes.tolist())
    road = frame.points[frame.point_classes == 40]
    assert -2.5 < np.median(road[:, 2]) < -1.2  # below the scanner on the roof
    assert counts.sum() == 123_389


# --- the DynamicMap benchmark ---


def test_scans_of_a_dynamicmap_sequence_are_those_in_pcd(tmp_path):
    header = "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH {}\nDATA binary\n"

    def write(path, points):
        path.parent.mkdir(parents=True, exist_ok=True)
        content = np.asarray(points, "<f4")
        path.write_bytes(header.format(len(content)).encode() + content.tobytes())

    for name in ("gt_cloud.pcd", "raw_map.pcd"):
        write(tmp_path / name, np.ones((50, 3)))
    for number in (4390, 4391):
        write(tmp_path / f"pcd/{number:06d}.pcd", np.full((7, 3), number))
    drive = open_drive(tmp_path)
    assert drive.frame_numbers == (4390, 4391)
    assert drive[4391].points[0].tolist() == [4391] * 3


def test_the_classes_of_semantickitti_are_those_of_its_development_kit():
    """As ``config/semantic-kitti.yaml`` lists them, beside 0 for "unlabeled"."""
    written = """
        1 outlier; 10 car; 11 bicycle; 13 bus; 15 motorcycle; 16 on-rails; 18 truck;
        20 other-vehicle; 30 person; 31 bicyclist; 32 motorcyclist; 40 road; 44 parking;
        48 sidewalk; 49 other-ground; 50 building; 51 fence; 52 other-structure; 60 lane-marking;
        70 vegetation; 71 trunk; 72 terrain; 80 pole; 81 traffic-sign; 99 other-object;
        252 moving-car; 253 moving-bicyclist; 254 moving-person; 255 moving-motorcyclist;
        256 moving-on-rails; 257 moving-bus; 258 moving-truck; 259 moving-other-vehicle
    """
    pairs = [entry.split() for entry in written.split(";")]
    assert {name: int(number) for number, name in pairs} == {
        name: number for number, name in CLASS_NAMES.items()
    }
