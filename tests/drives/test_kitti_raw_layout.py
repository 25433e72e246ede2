"""KITTI raw: frames are matched by number, and matrices equal those worked out by hand."""

import logging
import pickle
import sys
import tracemalloc

import numpy as np
import pytest
from drive_layouts import (
    CAM_TO_CAM,
    pose_line,
    scan_rows,
    write_kitti_raw,
    write_png,
    write_scan,
    write_text,
)

from intervis.cli import exit_code
from intervis.drives import Frame, open_drive
from intervis.drives.image_file import image_file_size_px
from intervis.errors import CalibrationError, DriveError, MissingExtraError, ScanError


def test_a_frame_holds_what_the_files_hold(tmp_path):
    root = write_kitti_raw(tmp_path, images=(0, 1, 2))
    drive = open_drive(root)
    assert (drive.layout, drive.name, len(drive)) == ("kitti_raw", root.name, 3)
    assert drive.frame_numbers == (0, 1, 2)
    assert drive.camera_names == ("image_00", "image_02", "image_03")
    frame = drive[1]
    assert isinstance(frame, Frame)
    assert frame.points.dtype == np.float32
    assert frame.points.flags.c_contiguous
    assert np.array_equal(frame.points, scan_rows(1)[:, :3])
    assert np.array_equal(frame.attributes["intensity"], scan_rows(1)[:, 3])
    assert (frame.camera.name, frame.camera.width_px, frame.camera.height_px) == (
        "image_02",
        64,
        32,
    )
    assert frame.camera.projection[0].tolist() == [700, 0, 600, 35]
    assert drive.camera.name == "image_02"
    assert frame.scan_path == root / "velodyne_points/data/0000000001.bin"
    assert frame.image.shape == (32, 64, 3)
    assert frame.pose is None
    assert frame.timestamp_ns is None


def test_cam_from_velo_is_the_rectifying_rotation_after_the_extrinsics(tmp_path):
    frame = open_drive(write_kitti_raw(tmp_path))[0]
    # By hand: x ahead becomes camera z, less 0.27; then R_rect_00 maps (x, y, z) to (y, -x, z).
    # LiDAR point (10, 2, 1): unrectified (-2, -1.08, 9.73), rectified (-1.08, 2, 9.73).
    seen = frame.cam_from_velo @ [10, 2, 1, 1]
    assert np.allclose(seen, [-1.08, 2.0, 9.73, 1.0], atol=1e-12)


@pytest.mark.parametrize("depth", [0, 1, 2])
def test_the_drive_is_found_from_the_folders_above_it(tmp_path, depth):
    root = write_kitti_raw(tmp_path)
    given = [root, root.parent, root.parent.parent][depth]
    assert open_drive(given).root == root
    assert open_drive(str(given)).root == root


def test_two_drives_of_a_date_must_be_named(tmp_path):
    root = write_kitti_raw(tmp_path)
    write_scan(root.parent / "2011_09_26_drive_0002_sync/velodyne_points/data/0000000000.bin", 0)
    with pytest.raises(DriveError, match=r"holds 2 drives.*drive_0001_sync.*drive_0002_sync"):
        open_drive(root.parent)
    assert len(open_drive(root)) == 3


def test_missing_scans_and_images_shift_no_match(tmp_path):
    # As in drive 2011_09_26_0009, where scans 177 to 180 are missing; here images 3 and 8 too.
    scans = [0, 1, 2, 3, 8, 9]
    root = write_kitti_raw(tmp_path, scans=scans, images=[0, 1, 2, 4, 5, 6, 7, 9])
    times = "".join(f"2011-09-26 13:02:{n:02d}.500000001\n" for n in range(10))
    write_text(root / "velodyne_points/timestamps.txt", times)
    drive = open_drive(root)
    assert drive.frame_numbers == tuple(scans)
    second = int(np.datetime64("2011-09-26T13:02:00", "ns").astype(np.int64))
    for frame in drive:
        assert np.array_equal(frame.points, scan_rows(frame.number)[:, :3])
        assert frame.timestamp_ns == second + frame.number * 10**9 + 500_000_001
        if frame.number in (3, 8):
            assert frame.image_path is None
            assert frame.image is None
        else:
            assert frame.image_path.name == f"{frame.number:010d}.png"
            assert np.all(frame.image == frame.number)


def test_the_error_for_an_unknown_number_names_the_range_and_the_nearest(tmp_path):
    drive = open_drive(write_kitti_raw(tmp_path, scans=[2, 3, 8, 9]))
    for number, nearest in [(5, "3 and 8"), (0, "2"), (12, "9"), (-1, "2")]:
        with pytest.raises(
            DriveError, match=rf"no frame {number}: its 4 frames .* 2 to 9, nearest {nearest}\."
        ):
            drive[number]
    for wrong in ("3", 3.0, slice(0, 2)):
        with pytest.raises(DriveError, match="a frame number must be an integer"):
            drive[wrong]
    assert drive[np.int64(8)].number == 8
    assert 8 in drive
    assert 5 not in drive


def test_a_truncated_scan_fails_alone_and_only_when_it_is_read(tmp_path):
    root = write_kitti_raw(tmp_path)
    bad = root / "velodyne_points/data/0000000001.bin"
    bad.write_bytes(bad.read_bytes()[:-3])
    drive = open_drive(root)
    frames = iter(drive)
    assert next(frames).number == 0
    with pytest.raises(ScanError, match=r"0000000001\.bin is truncated: its 77 bytes .* 16"):
        next(frames)
    assert drive[2].number == 2


def test_nan_rows_stay_where_the_file_has_them(tmp_path):
    root = write_kitti_raw(tmp_path)
    rows = scan_rows(0)
    rows[2, 1] = np.nan
    rows[3, 0] = np.inf
    rows.tofile(root / "velodyne_points/data/0000000000.bin")
    assert np.array_equal(open_drive(root)[0].points, rows[:, :3], equal_nan=True)


def test_other_files_are_ignored_and_two_of_one_number_refused(tmp_path):
    root = write_kitti_raw(tmp_path)
    write_text(root / "velodyne_points/data/._0000000000.bin", "a hidden file of a file manager")
    write_text(root / "velodyne_points/data/notes.txt", "")
    assert open_drive(root).frame_numbers == (0, 1, 2)
    write_scan(root / "velodyne_points/data/1.bin", 1)
    with pytest.raises(DriveError, match=r"two files .* number 1: 0000000001\.bin and 1\.bin"):
        open_drive(root)


def test_a_camera_is_chosen_by_name_or_number(tmp_path):
    root = write_kitti_raw(tmp_path, images=(0, 1, 2))
    for asked in ("image_03", "3", "03"):
        drive = open_drive(root, camera=asked)
        assert drive.camera.name == "image_03"
        assert drive.camera.projection[0, 3] == -350
        assert drive[0].image_path is None
    with pytest.raises(
        DriveError, match="no camera 'image_07'; available cameras: image_00, image_02, image_03"
    ):
        open_drive(root, camera="image_07")


def test_the_only_camera_with_images_is_the_default(tmp_path):
    root = write_kitti_raw(tmp_path, images=(0,), camera="image_00")
    drive = open_drive(root)
    assert drive.camera.name == "image_00"
    assert drive[0].image_path is not None


def test_images_of_another_size_cause_one_warning(tmp_path, caplog):
    root = write_kitti_raw(tmp_path)
    for number in range(3):
        write_png(root / f"image_02/data/{number:010d}.png", 40, 20)
    with caplog.at_level(logging.WARNING):
        drive = open_drive(root)
        frames = list(drive)
    assert len(caplog.records) == 1
    assert "40 x 20 pixels, but its calibration gives 64 x 32" in caplog.text
    assert frames[0].camera.width_px == 64
    assert frames[0].image.shape == (20, 40, 3)


def test_the_size_of_a_png_is_two_big_endian_numbers_of_four_bytes(tmp_path):
    path = tmp_path / "large.png"
    header = b"\x89PNG\r\n\x1a\n" + bytes([0, 0, 0, 13]) + b"IHDR"
    path.write_bytes(header + bytes([1, 2, 3, 4, 5, 6, 7, 8]))
    assert image_file_size_px(path) == (0x01020304, 0x05060708)
    path.write_bytes(header + bytes([1, 2, 3, 4, 5, 6, 7, 8, 9, 10]))  # what follows is not read
    assert image_file_size_px(path) == (0x01020304, 0x05060708)
    with pytest.raises(DriveError, match=r"cannot read the image .*gone\.png: No such file"):
        image_file_size_px(tmp_path / "gone.png")
    for content in (
        b"",
        header,
        header + bytes(7),
        b"x" * 24,
        header.replace(b"IHDR", b"IDAT") + bytes(8),
    ):
        path.write_bytes(content)
        with pytest.raises(DriveError, match="neither a PNG nor a JPEG image"):
            image_file_size_px(path)


def test_an_invalid_image_is_an_error_only_when_it_is_decoded(tmp_path, caplog):
    root = write_kitti_raw(tmp_path, images=(0, 1))
    (root / "image_02/data/0000000000.png").write_bytes(b"\x89PNG\r\n\x1a\nthat is all")
    drive = open_drive(root)
    assert not caplog.records  # the size is read from the second image
    with pytest.raises(DriveError, match=r"the image .*0000000000\.png is neither a PNG"):
        _ = drive[0].image
    assert drive[1].image.shape == (32, 64, 3)


def test_without_calibration_and_images_the_drive_opens_without_a_camera(tmp_path):
    root = write_kitti_raw(tmp_path)
    (root.parent / "calib_velo_to_cam.txt").unlink()
    drive = open_drive(root)
    assert drive.camera is None
    assert drive.camera_names == ()
    assert drive[0].camera is None
    assert drive[0].cam_from_velo is None
    with pytest.raises(DriveError, match="has no camera 'image_02'; available cameras: none"):
        open_drive(root, camera="image_02")


@pytest.mark.parametrize("file", ["calib_cam_to_cam.txt", "calib_velo_to_cam.txt"])
def test_images_without_calibration_name_the_missing_file(tmp_path, file):
    root = write_kitti_raw(tmp_path, images=(0,))
    (root.parent / file).unlink()
    with pytest.raises(CalibrationError, match=f"calibration file .*{file} is missing"):
        open_drive(root)


@pytest.mark.parametrize(
    ("file", "old", "new", "message"),
    [
        ("calib_velo_to_cam.txt", "T: 0", "T: zero", r"line 3: 'zero' is not a finite number"),
        ("calib_velo_to_cam.txt", "T: 0", "T: nan", r"line 3: 'nan' is not a finite number"),
        ("calib_velo_to_cam.txt", "T: 0", "T: 0 0", r"line 3: T needs 3 numbers, it has 4"),
        ("calib_velo_to_cam.txt", "T: 0", "T; 0", r"line 3: expected KEY: numbers, got 'T; 0 -0"),
        ("calib_velo_to_cam.txt", "T: 0", "U: 0", r"has no line 'T'"),
        ("calib_velo_to_cam.txt", "R: 0 -1", "R: 0 1", r"line 2: R is not a rigid motion"),
        ("calib_velo_to_cam.txt", "R: 0 -1", "R: 0 -2", r"line 2: R is not a rigid motion"),
        ("calib_cam_to_cam.txt", "R_rect_00: 0", "R_rect_00: 5", r"line 4: R_rect_00 is not a r"),
        (
            "calib_cam_to_cam.txt",
            "S_rect_02: 64",
            "S_rect_02: 0",
            r"line 8: .* must have 1 to 100000 pixels",
        ),
        (
            "calib_cam_to_cam.txt",
            "P_rect_02: 7.0e+02",
            "P_rect_02: 0",
            r"line 8: .* rank three",
        ),
        (
            "calib_cam_to_cam.txt",
            "P_rect_03: 7.0e+02",
            "P_rect_03: \x00\xff",
            r"line 10: .* not a finite num",
        ),
    ],
)
def test_a_line_that_does_not_parse_is_named(tmp_path, file, old, new, message):
    root = write_kitti_raw(tmp_path)
    path = root.parent / file
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new))
    with pytest.raises(CalibrationError, match=message) as caught:
        open_drive(root)
    assert file in str(caught.value)


def test_a_camera_that_is_not_used_may_lack_its_lines(tmp_path):
    root = write_kitti_raw(tmp_path)
    kept = [line for line in CAM_TO_CAM.splitlines() if "S_rect_03" not in line]
    write_text(root.parent / "calib_cam_to_cam.txt", "\n".join(kept))
    assert open_drive(root).camera.name == "image_02"
    with pytest.raises(CalibrationError, match="has no line 'S_rect_03'"):
        open_drive(root, camera="image_03")


def test_as_many_poses_as_scans_are_one_for_each_scan(tmp_path):
    root = write_kitti_raw(tmp_path, scans=[0, 2, 5])
    write_text(root / "poses.txt", "\n".join(pose_line(x) for x in (0, 20, 50)) + "\n\n")
    drive = open_drive(root)
    assert {n: drive[n].pose[0, 3] for n in drive.frame_numbers} == {0: 0, 2: 20, 5: 50}
    assert drive[5].pose.shape == (4, 4)


def test_poses_up_to_the_last_number_are_one_for_each_frame_number(tmp_path):
    root = write_kitti_raw(tmp_path, scans=[0, 2, 5])
    write_text(root / "poses.txt", "\n".join(pose_line(10 * n) for n in range(6)))
    drive = open_drive(root)
    assert {n: drive[n].pose[0, 3] for n in drive.frame_numbers} == {0: 0, 2: 20, 5: 50}


@pytest.mark.parametrize("count", [1, 2, 4, 5, 7])
def test_a_count_of_poses_that_fits_neither_is_refused(tmp_path, count):
    root = write_kitti_raw(tmp_path, scans=[0, 2, 5])
    write_text(root / "poses.txt", "\n".join([pose_line(0)] * count))
    with pytest.raises(
        CalibrationError, match=rf"poses\.txt has {count} lines; expected 3 \(.*\) or 6 \("
    ):
        open_drive(root)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("1 0 0 0 0 1 0 0 0 0 1", "line 2: a pose needs 12 numbers, this line has 11"),
        ("1 0 0 0 0 1 0 0 0 0 -1 0", "line 2: pose is not a rigid motion"),
        ("2 0 0 0 0 2 0 0 0 0 2 0", "line 2: pose is not a rigid motion"),
        ("1 0 0 x 0 1 0 0 0 0 1 0", "line 2: 'x' is not a finite number"),
        ("1 0 0 inf 0 1 0 0 0 0 1 0", "line 2: 'inf' is not a finite number"),
        ("", r"poses\.txt has 2 lines"),
    ],
)
def test_a_bad_pose_is_named_with_its_line(tmp_path, line, message):
    root = write_kitti_raw(tmp_path)
    write_text(root / "poses.txt", "\n".join([pose_line(0), line, pose_line(2)]))
    with pytest.raises(CalibrationError, match=message):
        open_drive(root)


def test_matrices_of_a_frame_are_copies(tmp_path):
    root = write_kitti_raw(tmp_path)
    write_text(root / "poses.txt", "\n".join(pose_line(x) for x in range(3)))
    drive = open_drive(root)
    frame = drive[1]
    frame.pose[:] = 0
    frame.cam_from_velo[:] = 0
    assert drive[1].pose[0, 3] == 1
    assert drive[1].cam_from_velo[3, 3] == 1


def oxts(latitude_deg, longitude_deg, altitude_m=100.0, roll=0.0, pitch=0.0, yaw=0.0):
    return f"{latitude_deg:.12f} {longitude_deg:.12f} {altitude_m} {roll} {pitch} {yaw} 1 2 3 4\n"


def test_oxts_straight_north(tmp_path):
    # By hand. The sphere's radius is 6378137 m, so 1e-5 degrees of latitude are 1.1131949 m north
    # (the projection has scale 1 at the first record). Heading north, the IMU's x is north and
    # its y west; the LiDAR is 0.81 m ahead, 0.32 m right and 0.80 m above the IMU.
    root = write_kitti_raw(tmp_path, scans=[0, 1, 3])
    for number in (0, 1, 2, 3):
        text = oxts(49 + number * 1e-5, 8.4, yaw=np.pi / 2)
        write_text(root / f"oxts/data/{number:010d}.txt", text)
    drive = open_drive(root)
    for number in drive.frame_numbers:
        pose = drive[number].pose
        north_m = 0.81 + number * 1.1131949
        assert np.allclose(pose[:3, 3], [0.32, north_m, 0.80], atol=1e-5)
        assert np.allclose(pose[:3, :3], [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-12)


def test_oxts_straight_east_uphill(tmp_path):
    # By hand: 1e-5 degrees of longitude at 60 degrees north are half as long, 0.5565975 m. A nose
    # lifted by 30 degrees is a pitch of -30 in the IMU's convention (y left, right-handed).
    root = write_kitti_raw(tmp_path, scans=[0, 1])
    write_text(root.parent / "calib_imu_to_velo.txt", "R: 1 0 0 0 1 0 0 0 1\nT: 0 0 0\n")
    for number in (0, 1):
        text = oxts(60, 8.4 + number * 1e-5, 100 + 0.5 * number, pitch=-np.pi / 6)
        write_text(root / f"oxts/data/{number:010d}.txt", text)
    pose = open_drive(root)[1].pose
    assert np.allclose(pose[:3, 3], [0.5565975, 0, 0.5], atol=1e-6)
    assert np.allclose(pose[:3, 0], [np.cos(np.pi / 6), 0, 0.5], atol=1e-12)


def test_oxts_rotates_by_roll_first_and_yaw_last(tmp_path):
    # Roll and yaw are 90 degrees. The roll turns the IMU's z axis to -y, and the yaw turns -y to +x
    # (east). With the yaw first, the axis would end along -y.
    root = write_kitti_raw(tmp_path, scans=[0])
    write_text(root / "oxts/data/0000000000.txt", oxts(49, 8, roll=np.pi / 2, yaw=np.pi / 2))
    pose = open_drive(root)[0].pose
    assert np.allclose(pose[:3, 2], [1, 0, 0], atol=1e-12)


def test_oxts_with_gaps_leave_frames_without_a_pose(tmp_path):
    root = write_kitti_raw(tmp_path)
    for number in (1, 2):
        write_text(root / f"oxts/data/{number:010d}.txt", oxts(49, 8))
    drive = open_drive(root)
    assert drive[0].pose is None
    assert np.allclose(drive[1].pose[:3, 3], [0.81, -0.32, 0.80])


def test_poses_txt_takes_precedence_over_oxts(tmp_path):
    root = write_kitti_raw(tmp_path)
    write_text(root / "oxts/data/0000000000.txt", "broken")
    write_text(root / "poses.txt", "\n".join(pose_line(x) for x in (7, 8, 9)))
    assert open_drive(root)[2].pose[0, 3] == 9


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("49 8 100 0 0\n", "line 1: expected latitude, longitude"),
        ("", "line 1: expected latitude, longitude"),
        ("91 8 100 0 0 0\n", "line 1: expected latitude, longitude"),
        ("49 8 high 0 0 0\n", "line 1: 'high' is not a finite number"),
    ],
)
def test_a_bad_oxts_record_is_named(tmp_path, text, message):
    root = write_kitti_raw(tmp_path)
    write_text(root / "oxts/data/0000000001.txt", text)
    with pytest.raises(CalibrationError, match=rf"0000000001\.txt, {message}"):
        open_drive(root)


def test_oxts_without_imu_extrinsics_name_the_missing_file(tmp_path):
    root = write_kitti_raw(tmp_path)
    write_text(root / "oxts/data/0000000000.txt", oxts(49, 8))
    (root.parent / "calib_imu_to_velo.txt").unlink()
    with pytest.raises(CalibrationError, match=r"calib_imu_to_velo\.txt is missing"):
        open_drive(root)


def test_timestamps_as_many_as_scans_and_blank_lines(tmp_path):
    root = write_kitti_raw(tmp_path, scans=[4, 6])
    path = write_text(
        root / "velodyne_points/timestamps.txt", "\n2011-09-26 13:02:25.967790592\n\n"
    )
    drive = open_drive(root)
    assert drive[4].timestamp_ns is None
    assert drive[4].timestamp_s is None
    assert drive[6].timestamp_ns == 1_317_042_145_967_790_592
    path.write_text("2011-09-26 13:02:25\n" * 3)
    with pytest.raises(CalibrationError, match=r"timestamps\.txt has 3 lines"):
        open_drive(root)


@pytest.mark.parametrize("line", ["yesterday", "2011-13-26 13:02:25", "NaT", "now", "1317042145"])
def test_an_invalid_timestamp_is_named(tmp_path, line):
    root = write_kitti_raw(tmp_path)
    text = f"2011-09-26 13:02:25\n{line}\n2011-09-26 13:02:26\n"
    write_text(root / "velodyne_points/timestamps.txt", text)
    with pytest.raises(CalibrationError, match=rf"timestamps\.txt, line 2: '{line}' is not a date"):
        open_drive(root)


def test_a_drive_without_scans_names_the_expected_files(tmp_path):
    root = write_kitti_raw(tmp_path, scans=())
    (root / "velodyne_points").mkdir(parents=True)
    with pytest.raises(
        DriveError, match=r"holds no scans; expected files: velodyne_points/data/\*\.bin"
    ):
        open_drive(root)


def test_a_drive_can_be_pickled(tmp_path):
    drive = pickle.loads(pickle.dumps(open_drive(write_kitti_raw(tmp_path, images=(0,)))))
    assert np.array_equal(drive[2].points, scan_rows(2)[:, :3])
    assert drive[2].camera.name == "image_02"


def test_a_drive_of_any_length_takes_the_memory_of_a_few_frames(tmp_path):
    root = write_kitti_raw(tmp_path, scans=range(40))
    for path in (root / "velodyne_points/data").iterdir():
        np.ones((20_000, 4), np.float32).tofile(path)  # 320 kB each, 12.8 MB in all
    tracemalloc.start()
    try:
        assert sum(len(frame.points) for frame in open_drive(root)) == 800_000
        peak_bytes = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak_bytes < 2_500_000


def test_times_after_the_last_scan_are_those_of_frames_without_a_scan(tmp_path):
    """Line k is frame k: the drive ends before its times do."""
    root = write_kitti_raw(tmp_path, scans=[1, 2])
    times = "".join(f"2011-09-26 13:02:{n:02d}\n" for n in range(5))
    write_text(root / "velodyne_points/timestamps.txt", times)
    drive = open_drive(root)
    second = int(np.datetime64("2011-09-26T13:02:00", "ns").astype(np.int64))
    assert [drive[n].timestamp_ns for n in (1, 2)] == [second + 10**9, second + 2 * 10**9]


def test_calibration_files_that_are_no_text_are_told_in_a_sentence(tmp_path):
    root = write_kitti_raw(tmp_path)
    path = root.parent / "calib_velo_to_cam.txt"
    path.write_bytes(b"R: \xff\xfe\n")
    with pytest.raises(CalibrationError, match=r"calib_velo_to_cam\.txt, line 1: .* finite number"):
        open_drive(root)
    path.unlink()
    path.mkdir()
    for name in ("calib_cam_to_cam.txt", "calib_imu_to_velo.txt"):
        assert (root.parent / name).is_file()
    write_png(root / "image_02/data/0000000000.png", 64, 32)
    with pytest.raises(CalibrationError, match=r"cannot read .*calib_velo_to_cam\.txt: Is a dir"):
        open_drive(root)


def test_decoding_an_image_without_pillow_names_the_extra(tmp_path, monkeypatch):
    frame = open_drive(write_kitti_raw(tmp_path, images=(0,)))[0]
    monkeypatch.setitem(sys.modules, "PIL", None)
    with pytest.raises(MissingExtraError, match="pillow"):
        _ = frame.image


def test_seconds_are_the_nanoseconds():
    points = np.zeros((1, 3), np.float32)
    assert Frame(0, points, timestamp_ns=1_500_000_000).timestamp_s == 1.5
    assert Frame(0, points).timestamp_s is None


def test_no_output_over_calibration_beside_the_drive(tmp_path, capsys):
    """The calibration of KITTI raw stands in the folder above, and is hard to tell by its path."""
    drive = write_kitti_raw(tmp_path)
    calibration = drive.parent / "calib_velo_to_cam.txt"
    (tmp_path / "other.txt").hardlink_to(calibration)
    before = calibration.read_bytes()
    for path in (calibration, drive / ".." / calibration.name, tmp_path / "other.txt"):
        for command in (
            ["site", "--along", "way", "--targets", "no.csv", "--csv"],
            ["blindspots", "--geojson"],
            ["objects", "--csv"],
            ["replay", "--json"],
        ):
            assert exit_code([command[0], str(drive), *command[1:], str(path)]) == 2
            error = capsys.readouterr().err
            assert "which this command reads and never changes" in error
            assert error.count("\n") == 1
            assert calibration.read_bytes() == before
