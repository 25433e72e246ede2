"""Poses, times and calibration as other tools write them, and pictures of any size and kind."""

import codecs
import os
import struct

import numpy as np
import pytest
from drive_layouts import (
    OBJECT_CALIBRATION,
    P_RECT_02,
    pose_line,
    write_kitti_object,
    write_kitti_odometry,
    write_kitti_raw,
    write_png,
    write_scan,
    write_text,
)

from intervis.drives import open_drive
from intervis.drives.image_file import image_file_size_px
from intervis.errors import CalibrationError, DriveError

ENCODINGS = {
    "plain": str.encode,
    "byte order mark": lambda text: codecs.BOM_UTF8 + text.encode(),
    "16 bits": lambda text: codecs.BOM_UTF16_LE + text.encode("utf-16-le"),
    "16 bits, high byte first": lambda text: codecs.BOM_UTF16_BE + text.encode("utf-16-be"),
    "carriage returns": lambda text: text.replace("\n", "\r\n").encode(),
}


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_a_mark_before_the_text_is_passed_over(tmp_path, encoding):
    root = write_kitti_odometry(tmp_path)
    write_text(root / "poses.txt", f"{pose_line(0)}\n{pose_line(0, 0, 3)}\n")
    write_text(root / "times.txt", "0.5\n0.6\n")
    for name in ("poses.txt", "times.txt", "calib.txt"):
        text = (root / name).read_text()
        (root / name).write_bytes(ENCODINGS[encoding](text))
    drive = open_drive(root)
    assert drive.camera_names == ("image_0", "image_2", "image_3")  # P0 stands first in the file
    assert np.isclose(drive[1].pose[0, 3], 3)
    assert [frame.timestamp_ns for frame in drive] == [500_000_000, 600_000_000]


def test_a_mark_before_timestamps_and_oxts(tmp_path):
    root = write_kitti_raw(tmp_path)
    for number in range(3):
        path = write_text(root / f"oxts/data/{number:010d}.txt", "")
        path.write_bytes(codecs.BOM_UTF8 + b"48.0 8.0 100 0 0 0 1 1\n")
    times = root / "velodyne_points/timestamps.txt"
    times.write_text("\ufeff2011-09-26 13:02:25\n" + "2011-09-26 13:02:26\n" * 2, encoding="utf-8")
    drive = open_drive(root)
    assert drive[1].timestamp_ns - drive[0].timestamp_ns == 10**9
    assert drive[2].pose is not None


def test_comments_blank_lines_and_whole_matrices_of_poses(tmp_path):
    write_scan(tmp_path / "0.bin", 0)
    write_scan(tmp_path / "1.bin", 1)
    lines = f"# world_from_velo\n\n{pose_line(4)} 0 0 0 1\n  # next\n{pose_line(5)}\n\n"
    write_text(tmp_path / "poses.txt", lines)
    assert [frame.pose[0, 3] for frame in open_drive(tmp_path)] == [4, 5]
    write_text(tmp_path / "poses.txt", f"{pose_line(4)} 0 0 0 2\n{pose_line(5)}\n")
    with pytest.raises(CalibrationError, match=r"line 1: .*last row must be 0 0 0 1"):
        open_drive(tmp_path)


def test_times_since_1970_keep_their_nanoseconds(tmp_path):
    """A float of 1.7e9 seconds is good to 2.4e-7 s: the text is read instead."""
    root = write_kitti_odometry(tmp_path)
    write_text(root / "times.txt", "# seconds\n1700000000.123456789\n1.700000000223456789e9\n")
    drive = open_drive(root)
    assert drive[0].timestamp_ns == 1_700_000_000_123_456_789
    assert drive[1].timestamp_ns == 1_700_000_000_223_456_789


@pytest.mark.parametrize("time", ["1e20", "-1e20", "1e300", "9.3e9", "1e9999"])
def test_times_beyond_64_bits_are_told(tmp_path, time):
    root = write_kitti_odometry(tmp_path)
    write_text(root / "times.txt", f"0.0\n{time}\n")
    with pytest.raises(
        CalibrationError, match=r"times\.txt, line 2: '.*' is (beyond|not a finite)"
    ):
        open_drive(root)


def test_a_time_with_an_endless_exponent_is_zero(tmp_path):
    root = write_kitti_odometry(tmp_path)
    write_text(root / "times.txt", f"0.0\n1e-{'9' * 60}\n")
    assert open_drive(root)[1].timestamp_ns == 0


@pytest.mark.parametrize(
    ("year", "held"),
    [
        ("0001", False),
        ("1677", False),
        ("1678", True),
        ("2261", True),
        ("2262", False),
        ("9999", False),
    ],
)
def test_years_that_64_bits_of_nanoseconds_do_not_hold_are_told(tmp_path, year, held):
    root = write_kitti_raw(tmp_path)
    text = f"{year}-12-31 13:02:25\n" * 3
    write_text(root / "velodyne_points/timestamps.txt", text)
    if held:
        moment = np.datetime64(open_drive(root)[0].timestamp_ns, "ns")
        assert str(moment).startswith(f"{year}-12-31T13:02:25")
        return
    with pytest.raises(CalibrationError, match="is not a date and time from 1678 to 2261"):
        open_drive(root)


@pytest.mark.parametrize("entry", ["1e300", "-1e155", "1e10"])
@pytest.mark.parametrize("place", range(12))
def test_huge_numbers_in_poses_are_told_without_a_warning(tmp_path, entry, place):
    write_scan(tmp_path / "0.bin", 0)
    words = pose_line(0).split()
    words[place] = entry
    write_text(tmp_path / "poses.txt", " ".join(words))
    with pytest.raises(CalibrationError, match=r"line 1: the pose has a number beyond 1e\+09"):
        open_drive(tmp_path)


@pytest.mark.parametrize("place", range(12))
def test_huge_numbers_in_a_projection_are_told(tmp_path, place):
    words = P_RECT_02.split()
    words[place] = "1e200"
    root = write_kitti_object(tmp_path)
    text = OBJECT_CALIBRATION.replace(f"P2: {P_RECT_02}", f"P2: {' '.join(words)}")
    write_text(root / "calib/000000.txt", text)
    with pytest.raises(CalibrationError, match=r"line 2: .*entries up to"):
        open_drive(root)[0]


@pytest.mark.parametrize("record", ["48 1e300 1 0 0 0", "48 8 1e300 0 0 0", "48 8 1 1e300 0 0"])
def test_huge_numbers_in_oxts_are_told(tmp_path, record):
    root = write_kitti_raw(tmp_path)
    for number in range(3):
        write_text(root / f"oxts/data/{number:010d}.txt", record)
    with pytest.raises(CalibrationError, match="line 1: expected latitude, longitude"):
        open_drive(root)


@pytest.mark.parametrize("camera", ["9" * 5000, "image_" + "9" * 5000, "٣" * 5000, "", "image_"])
def test_no_such_camera_however_it_is_written(tmp_path, camera):
    root = write_kitti_raw(tmp_path)
    with pytest.raises(DriveError, match="has no camera") as caught:
        open_drive(root, camera=camera)
    assert len(str(caught.value)) < 400
    with pytest.raises(DriveError, match="a camera must be a name"):
        open_drive(root, camera=2)


def test_a_key_of_5000_digits_is_no_camera(tmp_path):
    root = write_kitti_odometry(tmp_path)
    text = (root / "calib.txt").read_text()
    write_text(root / "calib.txt", text + f"P{'9' * 5000}: {P_RECT_02}\n")
    assert open_drive(root).camera_names == ("image_0", "image_2", "image_3")


def test_a_size_of_1e300_pixels_is_told(tmp_path):
    root = write_kitti_raw(tmp_path)
    path = root.parent / "calib_cam_to_cam.txt"
    path.write_text(path.read_text().replace("S_rect_02: 64 32", "S_rect_02: 1e300 32"))
    with pytest.raises(CalibrationError, match="1 to 100000 pixels a side, got 1000000000 x 32"):
        open_drive(root)


# --- pipes and devices ---


@pytest.mark.parametrize(
    "place",
    [
        "velodyne_points/data/0000000001.bin",
        "image_02/data/0000000001.png",
        "poses.txt",
        "velodyne_points/timestamps.txt",
        "../calib_cam_to_cam.txt",
    ],
)
def test_a_pipe_among_the_files_hangs_nothing(tmp_path, place):
    root = write_kitti_raw(tmp_path, images=(0, 1))
    path = root / place
    path.unlink(missing_ok=True)
    os.mkfifo(path)

    def read_all():
        drive = open_drive(root)
        frame = drive[1]
        _ = frame.image
        return drive.fingerprint(), frame

    if place in ("poses.txt", "velodyne_points/timestamps.txt"):  # optional files: not there
        _, frame = read_all()
        assert (frame.pose, frame.timestamp_ns) == (None, None)
        return
    with pytest.raises(DriveError, match="is a pipe or a device, not a file"):
        read_all()


@pytest.mark.parametrize("ending", [".bin", ".npy", ".pcd", ".ply", ".pcd.bin"])
def test_a_pipe_in_a_folder_of_scans_is_no_scan(tmp_path, ending):
    write_scan(tmp_path / "0.bin", 0)
    os.mkfifo(tmp_path / f"1{ending}")
    assert open_drive(tmp_path).frame_numbers == (0,)
    with pytest.raises(DriveError):
        open_drive(tmp_path / f"1{ending}")


# --- images ---


def jpeg(width_px, height_px, marker=0xC0, before=b""):
    """The header of a JPEG: an APP0 segment, what is given, and the segment with the size."""
    frame = struct.pack(">BBHBHHB", 0xFF, marker, 17, 8, height_px, width_px, 3) + bytes(9)
    return b"\xff\xd8\xff\xe0" + struct.pack(">H", 16) + bytes(14) + before + frame


TABLE = b"\xff\xc4" + struct.pack(">H", 30) + b"\xff\xc0" * 14  # holds what looks like a frame


@pytest.mark.parametrize("marker", [0xC0, 0xC1, 0xC2, 0xC9, 0xCF])
@pytest.mark.parametrize("before", [b"", b"\xff\xff", TABLE, b"\xff\xdb\x00\x03\x07"])
def test_the_size_of_a_jpeg_is_in_its_frame_segment(tmp_path, marker, before):
    path = tmp_path / "a.jpg"
    path.write_bytes(jpeg(1280, 721, marker, before))
    assert image_file_size_px(path) == (1280, 721)


@pytest.mark.parametrize(
    "content",
    [
        b"\xff\xd8",
        b"\xff\xd8\xff",
        b"\xff\xd8" + b"\xff" * 50,
        b"\xff\xd8\xff\xe0\x00\x00",
        jpeg(5, 5)[:24],
        b"\xff\xd8" + b"\xff\xe0\x00\x02" * 2000,
        b"\xff\xd8 no marker here",
    ],
)
def test_a_damaged_jpeg_has_no_size(tmp_path, content):
    path = tmp_path / "a.jpg"
    path.write_bytes(content)
    with pytest.raises(DriveError, match="neither a PNG nor a JPEG image"):
        image_file_size_px(path)


@pytest.mark.parametrize("ending", ["png", "jpg", "jpeg", "JPG", "PNG"])
@pytest.mark.parametrize("layout", ["object", "odometry", "raw"])
def test_pictures_of_any_kind_and_size_are_found(tmp_path, ending, layout):
    image = pytest.importorskip("PIL.Image", reason="Pillow (extra plots) is not installed")
    write = {
        "object": write_kitti_object,
        "odometry": write_kitti_odometry,
        "raw": lambda folder: write_kitti_raw(folder, images=(0,)),
    }[layout]
    root = write(tmp_path)
    folder = next(iter(root.glob("image_0?/data" if layout == "raw" else "image_2")))
    for path in folder.iterdir():
        path.unlink()
    size = (64, 32) if layout == "raw" else (1280, 720)
    digits = 10 if layout == "raw" else 6
    image.new("RGB", size).save(folder / f"{0:0{digits}d}.{ending}")
    frame = open_drive(root)[0]
    assert (frame.camera.width_px, frame.camera.height_px) == size
    assert frame.image.shape == (size[1], size[0], 3)


def test_of_two_pictures_of_a_frame_the_png_counts(tmp_path):
    root = write_kitti_object(tmp_path)
    (root / "image_2/000000.jpg").write_bytes(jpeg(99, 98))
    (root / "image_2/000000.PNG").unlink(missing_ok=True)
    assert open_drive(root)[0].image_path.name == "000000.png"
    write_png(root / "image_2/0.png", 5, 5)
    with pytest.raises(DriveError, match=r"two files in .* have the number 0"):
        open_drive(root)


@pytest.mark.parametrize(
    ("centre", "size_px", "warned"),
    [
        ((609.6, 172.9), (1242, 375), False),  # KITTI's own
        ((621.0, 187.0), (1242, 375), False),
        ((633.9, 192.9), (1242, 375), False),
        ((584.1, 163.1), (1242, 375), False),
        ((634.0, 178.0), (1268, 356), True),  # from 25 by 15 pixels away on
        ((609.0, 163.0), (1218, 326), True),
        ((640, 360), (1280, 720), True),
        ((609.6, 300.0), (1219, 600), True),
        ((960.5, 604.25), (1921, 1208), True),
    ],
)
def test_without_pictures_the_principal_point_tells_their_size(
    tmp_path, caplog, centre, size_px, warned
):
    root = write_kitti_odometry(tmp_path)
    for path in (root / "image_2").iterdir():
        path.unlink()
    u, v = centre
    matrix = f"P2: 700 0 {u} 0 0 700 {v} 0 0 0 1 0\nTr: 1 0 0 0 0 1 0 0 0 0 1 0\n"
    write_text(root / "calib.txt", matrix)
    camera = open_drive(root).camera
    assert (camera.width_px, camera.height_px) == size_px
    assert ("there are no images of image_2" in caplog.text) == warned


def damaged(image, kind):
    """A PNG of 40 x 20 pixels with one thing wrong."""
    content = bytearray(image)
    if kind == "huge":
        content[16:24] = struct.pack(">II", 60_000, 60_000)
    elif kind == "endless":
        content[16:24] = struct.pack(">II", 2**31 - 1, 2**31 - 1)
    elif kind == "empty":
        content[16:24] = bytes(8)
    elif kind == "chunk":
        place = content.index(b"IDAT")
        content[place : place + 4] = b"\x00\xff\x01\x02"
    elif kind == "data":
        place = content.index(b"IDAT") + 6
        content[place : place + 4] = b"\xff" * 4
    else:
        del content[40:]
    return bytes(content)


@pytest.mark.parametrize("kind", ["huge", "endless", "empty", "chunk", "data", "cut"])
def test_a_damaged_picture_costs_its_own_sentence(tmp_path, kind):
    pytest.importorskip("PIL", reason="Pillow (extra plots) is not installed")
    root = write_kitti_raw(tmp_path, images=(0, 1))
    path = root / "image_02/data/0000000001.png"
    path.write_bytes(damaged(path.read_bytes(), kind))
    drive = open_drive(root)
    with pytest.raises(DriveError, match=r"the image .*0000000001\.png") as caught:
        _ = drive[1].image
    assert "\n" not in str(caught.value)
    assert drive[0].image.shape == (32, 64, 3)


# --- numbers of frames ---


def test_names_of_more_digits_than_a_number_has_are_no_frame_numbers(tmp_path, caplog):
    long = "9" * 40
    root = write_kitti_raw(tmp_path / "raw")
    write_scan(root / f"velodyne_points/data/{long}.bin", 0)
    assert open_drive(root).frame_numbers == (0, 1, 2)
    write_scan(tmp_path / f"folder/a{long}.bin", 0)
    assert open_drive(tmp_path / "folder").frame_numbers == (0,)
    assert "contain no frame numbers that increase" in caplog.text
