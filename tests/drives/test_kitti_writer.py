"""What is written in KITTI's raw layout: bytes and lines worked out by hand, and read again."""

import struct

import numpy as np
from drive_layouts import CAM_TO_CAM, VELO_TO_CAM, write_png, write_text

from intervis.drives import open_drive
from intervis.drives.kitti_writer import Layout, pose_text, scan_bytes, timestamp_text


def test_the_paths_are_kittis(tmp_path):
    layout = Layout(tmp_path)
    assert layout.date == tmp_path / "2011_09_26"
    assert layout.drive == layout.date / "2011_09_26_drive_0001_sync"
    assert layout.scan(12) == layout.drive / "velodyne_points/data/0000000012.bin"
    assert layout.image(3) == layout.drive / "image_02/data/0000000003.png"
    assert layout.labels(3) == layout.drive / "velodyne_points/labels/0000000003.label"
    kinds = (layout.scan, layout.labels, layout.image)
    assert layout.expected(2) == {path(number) for path in kinds for number in (0, 1)}
    assert layout.expected(0) == set()


def test_a_scan_is_four_little_endian_floats_a_return():
    points = np.array([[1.5, -2.0, 0.25], [3.0, 4.0, -5.5]], np.float32)
    found = scan_bytes(points, np.array([0.5, 1.0], np.float32))
    assert found == struct.pack("<8f", 1.5, -2.0, 0.25, 0.5, 3.0, 4.0, -5.5, 1.0)
    assert scan_bytes(np.empty((0, 3), np.float32), np.empty(0, np.float32)) == b""


def test_poses_are_the_upper_three_rows_one_line_a_frame():
    pose = np.eye(4)
    pose[:3, 3] = [1.0, -2.5, 1.0 / 3.0]
    lines = pose_text(np.stack([np.eye(4), pose])).split("\n")
    assert lines[2:] == [""], "each line is ended"
    assert [float(word) for word in lines[0].split(" ")] == [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0]
    # 16 digits: the value read is the value written
    assert [float(word) for word in lines[1].split(" ")][3::4] == [1.0, -2.5, 1.0 / 3.0]


def test_times_start_at_kittis_day_and_advance_by_the_period():
    assert timestamp_text(3, 0.25).splitlines() == [
        "2011-09-26 13:02:25.000000000",
        "2011-09-26 13:02:25.250000000",
        "2011-09-26 13:02:25.500000000",
    ]
    assert timestamp_text(1, 0.25).endswith("\n")


def test_frame_files_are_scans_and_images_whole_or_half_written(tmp_path):
    layout = Layout(tmp_path)
    names = ("0000000001.bin", "0000000000.bin", ".0000000002.bin.0a1b.part", "1.bin", "notes.txt")
    for name in names:
        write_text(layout.scan(0).parent / name, "")
    write_text(layout.image(5), "")
    (layout.image(5).parent / "0000000006.png").mkdir()
    # sorted by path: the folder of images first, a leading dot before digits
    assert layout.frame_files() == [
        layout.image(5),
        layout.scan(0).parent / ".0000000002.bin.0a1b.part",
        layout.scan(0),
        layout.scan(1),
    ]


def test_what_is_written_is_read(tmp_path):
    layout, count = Layout(tmp_path), 3
    write_text(layout.date / "calib_cam_to_cam.txt", CAM_TO_CAM)
    write_text(layout.date / "calib_velo_to_cam.txt", VELO_TO_CAM)
    points = np.arange(count * 6, dtype=np.float32).reshape(count, 2, 3)
    poses = np.stack([np.eye(4)] * count)
    poses[:, 0, 3] = [0.0, 1.25, 2.5]
    for number in range(count):
        layout.scan(number).parent.mkdir(parents=True, exist_ok=True)
        layout.scan(number).write_bytes(
            scan_bytes(points[number], np.array([0.5, 0.25], np.float32))
        )
        write_png(layout.image(number), 64, 32)
    write_text(layout.drive / "poses.txt", pose_text(poses))
    write_text(layout.drive / "velodyne_points/timestamps.txt", timestamp_text(count, 0.1))
    drive = open_drive(tmp_path)
    assert drive.root == layout.drive
    for number in range(count):
        frame = drive[number]
        assert np.array_equal(frame.points, points[number])
        assert frame.attributes["intensity"].tolist() == [0.5, 0.25]
        assert np.array_equal(frame.pose, poses[number])
        assert frame.image_path == layout.image(number)
        assert frame.timestamp_ns - drive[0].timestamp_ns == number * 100_000_000
