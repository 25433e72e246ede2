"""Folders of scans, single scans, paths without a drive, fingerprints and reprs."""

import hashlib
import json
import logging
import shutil

import numpy as np
import pytest
from drive_layouts import (
    CAM_TO_CAM,
    VELO_TO_CAM,
    pose_line,
    scan_rows,
    write_kitti_odometry,
    write_kitti_raw,
    write_scan,
    write_text,
)

from intervis.drives import open_drive
from intervis.errors import CalibrationError, DriveError, ScanError


@pytest.mark.parametrize("place", ["pcd", "scans"])
def test_the_folder_of_the_scans_alone_has_the_poses_beside_it(tmp_path, place):
    drive_path = tmp_path / "street"
    for number in (1, 2):
        write_scan(drive_path / place / f"{number}.bin", number)
    assert open_drive(drive_path / place).name == place  # nothing lies beside it
    write_text(drive_path / "poses.txt", "\n".join(pose_line(n) for n in (1, 2)))
    whole, below = open_drive(drive_path), open_drive(drive_path / place)
    assert below.fingerprint() == whole.fingerprint()
    assert [frame.pose[0, 3] for frame in below] == [1.0, 2.0]


def test_a_folder_of_scans_beside_other_scans_stays_alone(tmp_path):
    """The drive above reads ``pcd``: its poses are of those scans."""
    for place in ("pcd", "scans"):
        write_scan(tmp_path / place / "1.bin", 1)
    write_text(tmp_path / "poses.txt", pose_line(1))
    assert open_drive(tmp_path / "pcd").poses is not None
    assert open_drive(tmp_path / "scans").poses is None


@pytest.mark.parametrize("place", ["", "scans"])
def test_scans_are_numbered_by_their_names(tmp_path, place):
    for number in (10, 9, 300):
        write_scan(tmp_path / place / f"scan_{number}.bin", number)
    write_text(tmp_path / "poses.txt", "\n".join(pose_line(n) for n in (9, 10, 300)))
    write_text(tmp_path / place / "readme.txt", "not a scan")
    drive = open_drive(tmp_path)
    assert (drive.layout, drive.frame_numbers) == ("scan_folder", (9, 10, 300))
    for frame in drive:
        assert np.array_equal(frame.points, scan_rows(frame.number)[:, :3])
        assert frame.pose[0, 3] == frame.number
        assert frame.camera is None
    with pytest.raises(DriveError, match="has no camera '2'; available cameras: none"):
        open_drive(tmp_path, camera="2")


@pytest.mark.parametrize("names", [("b", "a", "c"), ("x1_v2", "x2_v2", "x3_v2"), ("1", "b", "2")])
def test_names_without_unique_numbers_are_taken_in_order_with_a_warning(tmp_path, caplog, names):
    for number, name in enumerate(sorted(names)):
        write_scan(tmp_path / f"{name}.bin", number)
    drive = open_drive(tmp_path)
    assert "contain no frame numbers that increase" in caplog.text
    assert drive.frame_numbers == (0, 1, 2)
    for frame in drive:
        assert np.array_equal(frame.points, scan_rows(frame.number)[:, :3])


def test_scans_named_by_timestamps_are_in_the_order_of_time(tmp_path):
    """The last digits are milliseconds: they are unique and start anew each second."""
    names = ["2021-10-26-16-21-29-868", "2021-10-26-16-21-29-968", "2021-10-26-16-21-30-068"]
    for number, name in enumerate(names):
        write_scan(tmp_path / f"{name}.bin", number)
    write_text(tmp_path / "poses.txt", "\n".join(pose_line(n) for n in range(3)))
    drive = open_drive(tmp_path)
    assert drive.frame_numbers == (0, 1, 2)
    for frame in drive:
        assert frame.scan_path.stem == names[frame.number]
        assert np.array_equal(frame.points, scan_rows(frame.number)[:, :3])
        assert frame.pose[0, 3] == frame.number


@pytest.mark.parametrize("path", [None, 5, b"drive", "~nobody-of-this-name/drive", "a\0b"])
def test_what_is_no_path_is_a_drive_error(path):
    with pytest.raises(DriveError):
        open_drive(path)


def test_numbered_names_log_nothing(tmp_path, caplog):
    write_scan(tmp_path / "17.bin", 17)
    with caplog.at_level(logging.INFO):
        assert open_drive(tmp_path).frame_numbers == (17,)
    assert not caplog.records


def test_kitti_calibration_in_the_folder_is_used(tmp_path):
    write_scan(tmp_path / "scans/000000.bin", 0)
    write_text(tmp_path / "calib_cam_to_cam.txt", CAM_TO_CAM)
    with pytest.raises(CalibrationError, match=r"calib_velo_to_cam\.txt is missing"):
        open_drive(tmp_path)
    write_text(tmp_path / "calib_velo_to_cam.txt", VELO_TO_CAM)
    frame = open_drive(tmp_path)[0]
    assert (frame.camera.name, frame.camera.width_px) == ("image_02", 64)
    assert np.allclose(frame.cam_from_velo @ [10, 2, 1, 1], [-1.08, 2, 9.73, 1])
    assert frame.image is None
    assert open_drive(tmp_path, camera="image_03").camera.name == "image_03"


def test_mixed_formats_are_refused(tmp_path):
    write_scan(tmp_path / "0.bin", 0)
    write_scan(tmp_path / "1.bin", 0)
    np.save(tmp_path / "2.npy", np.zeros((3, 3)))
    with pytest.raises(DriveError, match=r"holds scans of several formats \(2 \.bin, 1 \.npy\)"):
        open_drive(tmp_path)


@pytest.mark.parametrize("line", ["1 2 3", "0 0 0 0 0 0 0 0 0 0 0 0"])
def test_bad_poses_of_a_folder_name_the_line(tmp_path, line):
    write_scan(tmp_path / "0.bin", 0)
    write_text(tmp_path / "poses.txt", line)
    with pytest.raises(CalibrationError, match=r"poses\.txt, line 1:"):
        open_drive(tmp_path)


def test_empty_poses_do_not_fit(tmp_path):
    write_scan(tmp_path / "0.bin", 0)
    write_text(tmp_path / "poses.txt", "")
    with pytest.raises(CalibrationError, match=r"poses\.txt has 0 lines"):
        open_drive(tmp_path)


def test_a_single_scan_is_frame_0(tmp_path):
    write_scan(tmp_path / "000042.bin", 3)
    drive = open_drive(tmp_path / "000042.bin")
    assert (drive.layout, drive.name, drive.frame_numbers) == ("single_scan", "000042.bin", (0,))
    assert np.array_equal(drive[0].points, scan_rows(3)[:, :3])
    assert drive.poses is None
    with pytest.raises(DriveError, match="no camera 'image_02': it is a single scan"):
        open_drive(tmp_path / "000042.bin", camera="image_02")


# --- paths without a drive ---


def test_nothing_there(tmp_path):
    with pytest.raises(DriveError, match=r"there is nothing at .*gone: check the path\.$"):
        open_drive(tmp_path / "gone")


def test_an_empty_folder(tmp_path):
    with pytest.raises(DriveError, match=r"^the folder .* is empty\.$"):
        open_drive(tmp_path)


def test_a_file_of_another_kind(tmp_path):
    with pytest.raises(DriveError, match=r"notes\.txt is not a scan: its name must end in .*\.bin"):
        open_drive(write_text(tmp_path / "notes.txt", "hello"))


def test_an_unknown_folder_names_the_expected_and_the_found_files(tmp_path):
    for number in range(12):
        write_text(tmp_path / f"{number:02d}.xyz", "")
    with pytest.raises(DriveError) as caught:
        open_drive(tmp_path)
    message = str(caught.value)
    for word in ("KITTI raw", "KITTI odometry", "KITTI object", "scans/", ".npy", ".pcd", ".ply"):
        assert word in message
    assert message.endswith("Found: 00.xyz, 01.xyz, 02.xyz, 03.xyz, 04.xyz, 05.xyz, 06.xyz, "
                            "07.xyz, ....")  # fmt: skip


def test_of_many_drives_the_first_eight_are_listed(tmp_path):
    for number in range(10):
        write_scan(tmp_path / f"drive_{number}_sync/velodyne_points/data/0000000000.bin", 0)
    with pytest.raises(DriveError) as caught:
        open_drive(tmp_path)
    shown = ", ".join(f"drive_{number}_sync" for number in range(8))
    assert str(caught.value).endswith(f"holds 10 drives; give the path of one of them: {shown}.")


def test_nine_found_files_are_eight_and_more(tmp_path):
    for number in range(9):
        write_text(tmp_path / f"{number}.xyz", "")
    with pytest.raises(DriveError, match=r"Found: 0\.xyz, .*, 7\.xyz, \.\.\.\.$"):
        open_drive(tmp_path)


def test_a_folder_that_may_not_be_read_is_told_in_a_sentence(tmp_path, monkeypatch):
    def refused(folder):
        raise PermissionError(13, "Permission denied", str(folder))

    monkeypatch.setattr(type(tmp_path), "iterdir", refused)
    with pytest.raises(DriveError, match=rf"^cannot read {tmp_path}: Permission denied\.$"):
        open_drive(tmp_path)


def test_eight_found_files_are_listed_completely(tmp_path):
    for number in range(8):
        write_text(tmp_path / f"{number}.xyz", "")
    with pytest.raises(DriveError, match=r"Found: 0\.xyz, .*, 7\.xyz\.$"):
        open_drive(tmp_path)


def test_a_scan_that_vanishes_after_opening(tmp_path):
    write_scan(tmp_path / "0.bin", 0)
    write_scan(tmp_path / "1.bin", 1)
    drive = open_drive(tmp_path)
    (tmp_path / "1.bin").unlink()
    with pytest.raises(ScanError, match=r"cannot read the scan .*1\.bin: No such file"):
        drive[1]
    with pytest.raises(DriveError, match=r"cannot read .*1\.bin: No such file"):
        drive.fingerprint()


# --- fingerprint ---


def test_fingerprint_is_json_and_the_same_in_another_place(tmp_path):
    root = write_kitti_raw(tmp_path / "here", images=(0, 1))
    write_text(root / "poses.txt", "\n".join(pose_line(n) for n in range(3)))
    fingerprint = open_drive(root).fingerprint()
    assert json.loads(json.dumps(fingerprint)) == fingerprint
    assert fingerprint["layout"] == "kitti_raw"
    assert (fingerprint["frames"], fingerprint["first"], fingerprint["last"]) == (3, 0, 2)
    assert fingerprint["scan_bytes"] == 3 * 80
    assert fingerprint["camera"] == "image_02"
    shutil.copytree(tmp_path / "here", tmp_path / "there")
    assert open_drive(tmp_path / "there").fingerprint() == fingerprint


@pytest.mark.parametrize("change", ["content", "size", "number", "calibration", "pose", "image"])
def test_fingerprint_notices_a_changed_input(tmp_path, change):
    root = write_kitti_raw(tmp_path, images=(0, 1))
    poses = write_text(root / "poses.txt", "\n".join(pose_line(n) for n in range(3)))
    before = open_drive(root).fingerprint()
    scan = root / "velodyne_points/data/0000000001.bin"
    if change == "content":
        write_scan(scan, 7)
    elif change == "size":
        write_scan(scan, 1, count=6)
    elif change == "number":
        scan.rename(scan.with_name("0000000009.bin"))
    elif change == "calibration":
        path = root.parent / "calib_cam_to_cam.txt"
        path.write_text(path.read_text().replace("7.0e+02", "7.1e+02"))
    elif change == "pose":
        poses.write_text(poses.read_text().replace("1 0 0 2 ", "1 0 0 3 "))
    else:
        (root / "image_02/data/0000000001.png").unlink()
    assert open_drive(root).fingerprint()["digest"] != before["digest"]


def test_fingerprint_hashes_the_middle_of_each_scan_as_documented(tmp_path):
    # 1001 points are 16016 bytes: the middle 4096 of them start at (16016 - 4096) / 2 = 5960.
    root = write_kitti_raw(tmp_path, scans=(0, 2), images=(2,))
    for number, count in ((0, 1001), (2, 3)):
        write_scan(root / f"velodyne_points/data/{number:010d}.bin", number, count=count)
    image_bytes = (root / "image_02/data/0000000002.png").stat().st_size
    names = ("calib_cam_to_cam.txt", "calib_velo_to_cam.txt")
    content = b"scan 0 16016\n" + scan_rows(0, 1001).tobytes()[5960 : 5960 + 4096]
    content += b"scan 2 48\n" + scan_rows(2, 3).tobytes()
    content += f"image 2 {image_bytes}\n".encode()
    for name in names:
        content += f"file {name}\n".encode() + (root.parent / name).read_bytes()
    assert open_drive(root).fingerprint()["digest"] == hashlib.sha256(content).hexdigest()


# --- reprs and viewpoint ---


def test_reprs_summarize_the_content_in_one_line(tmp_path):
    root = write_kitti_raw(tmp_path, scans=(0, 1, 2, 1500), images=(0,))
    start = f"<Drive {root.name}: KITTI raw, 4 frames 0-1500, camera image_02"
    assert repr(open_drive(root)) == f"{start}>"
    write_text(root / "poses.txt", "\n".join(pose_line(n) for n in range(4)))
    write_text(root / "velodyne_points/timestamps.txt", "2011-09-26 13:02:25\n" * 4)
    drive = open_drive(root)
    assert repr(drive) == f"{start}, poses, timestamps>"
    assert repr(drive[0]) == "<Frame 0: 5 points, camera image_02, image, pose, timestamp>"
    assert repr(drive[1]) == "<Frame 1: 5 points, camera image_02, pose, timestamp>"
    write_scan(tmp_path / "17.bin", 17, count=1234)
    single = open_drive(tmp_path / "17.bin")
    assert repr(single) == "<Drive 17.bin: single scan, frame 0>"
    assert repr(single[0]) == "<Frame 0: 1,234 points>"


def test_the_default_viewpoint_is_the_cameras_centre_or_the_sensor(tmp_path):
    # By hand. P_rect_03's last column is -350 = -700 * 0.5: the camera is 0.5 m along x of the
    # rectified frame. R_rect_00 maps (x, y, z) to (y, -x, z): 0.5 m along the unrectified y, which
    # points down. Unrectified camera 0 is 0.27 m ahead of the LiDAR and 0.08 m below it.
    root = write_kitti_raw(tmp_path)
    assert np.allclose(open_drive(root, camera="3")[0].viewpoint_velo, [0.27, 0, -0.08 - 0.5])
    write_scan(tmp_path / "0.bin", 0)
    assert open_drive(tmp_path / "0.bin")[0].viewpoint_velo.tolist() == [0, 0, 0]


@pytest.mark.parametrize("name", ["calib.txt", "poses.txt", "times.txt"])
def test_the_fingerprint_of_a_sequence_sees_each_of_its_text_files(tmp_path, name):
    root = write_kitti_odometry(tmp_path)
    write_text(root / "poses.txt", f"{pose_line(0)}\n{pose_line(1)}\n")
    write_text(root / "times.txt", "0.0\n0.1\n")
    before = open_drive(root).fingerprint()["digest"]
    text = (root / name).read_text()
    changed = {"calib.txt": text + "\n", "poses.txt": f"{pose_line(0)}\n{pose_line(2)}\n"}
    write_text(root / name, changed.get(name, "0.0\n0.2\n"))
    assert open_drive(root).fingerprint()["digest"] != before


def test_a_folder_with_half_a_calibration_is_told_in_a_sentence(tmp_path):
    write_scan(tmp_path / "1.bin", 1)
    write_text(tmp_path / "calib_cam_to_cam.txt", CAM_TO_CAM)
    with pytest.raises(CalibrationError, match=r"calib_velo_to_cam\.txt is missing"):
        open_drive(tmp_path)


def test_a_folder_with_a_calibration_names_its_camera(tmp_path):
    write_scan(tmp_path / "1.bin", 1)
    write_text(tmp_path / "calib_cam_to_cam.txt", CAM_TO_CAM)
    write_text(tmp_path / "calib_velo_to_cam.txt", VELO_TO_CAM)
    drive = open_drive(tmp_path)
    assert drive.camera_name in drive.camera_names
    assert drive.fingerprint()["camera"] == drive.camera_name
