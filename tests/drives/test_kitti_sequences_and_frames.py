"""KITTI odometry and KITTI object."""

import logging
import shutil

import numpy as np
import pytest
from drive_layouts import (
    IDENTITY_LINE,
    OBJECT_CALIBRATION,
    pose_line,
    scan_rows,
    write_kitti_object,
    write_kitti_odometry,
    write_png,
    write_scan,
    write_text,
)

from intervis.drives import open_drive
from intervis.errors import CalibrationError, DriveError

# --- odometry ---


def test_a_sequence_holds_what_its_files_hold(tmp_path):
    root = write_kitti_odometry(tmp_path, scans=(0, 2))
    write_text(root / "times.txt", "0.0\n1.037875e-01\n2.074e-01\n3.1e-01\n")
    drive = open_drive(root)
    assert (drive.layout, drive.name, drive.frame_numbers) == ("kitti_odometry", "04", (0, 2))
    assert drive.camera_names == ("image_0", "image_2", "image_3")
    frame = drive[2]
    assert np.array_equal(frame.points, scan_rows(2)[:, :3])
    assert frame.timestamp_ns == 207_400_000
    assert frame.image_path.name == "000002.png"
    assert frame.pose is None
    # The calibration has no image size: it is read from an image.
    assert (frame.camera.width_px, frame.camera.height_px) == (62, 18)
    assert frame.camera.projection[0, 3] == 35
    # LiDAR point (10, 2, 1) in the camera, which is 0.27 m ahead and 0.08 m below: by hand.
    assert np.allclose(frame.cam_from_velo @ [10, 2, 1, 1], [-2, -1.08, 9.73, 1])
    assert open_drive(root, camera="image_3").camera.projection[0, 3] == -350


def test_camera_poses_become_lidar_poses(tmp_path):
    # By hand. The camera drives 10 m ahead and turns 90 degrees to the right: its z axis then lies
    # along the old x, its x along the old -z. The LiDAR is 0.27 m behind and 0.08 m above the
    # camera: after the turn 0.27 m to the left of it. So the LiDAR is at
    # (0.27 + 10, 0 + 0.27, 0), and looks along -y.
    root = write_kitti_odometry(tmp_path)
    turned = "0 0 1 0 0 1 0 0 -1 0 0 10"
    write_text(tmp_path / "poses/04.txt", f"{IDENTITY_LINE}\n{turned}\n")
    drive = open_drive(root)
    assert np.allclose(drive[0].pose, np.eye(4), atol=1e-12)
    expected = [[0, 1, 0, 10.27], [-1, 0, 0, 0.27], [0, 0, 1, 0], [0, 0, 0, 1]]
    assert np.allclose(drive[1].pose, expected, atol=1e-12)


@pytest.mark.parametrize("kept", ["calib.txt", "times.txt"])
def test_a_folder_of_any_name_is_a_sequence_by_its_calibration_or_its_times(tmp_path, kept):
    root = write_kitti_odometry(tmp_path).rename(tmp_path / "drive")
    for path in root.iterdir():
        if path.name not in (kept, "velodyne"):
            shutil.rmtree(path) if path.is_dir() else path.unlink()
    write_text(root / kept, (root / kept).read_text() if (root / kept).exists() else "0\n0.1\n")
    drive = open_drive(root)
    assert (drive.layout, drive.name) == ("kitti_odometry", "drive")
    assert (0 in drive.timestamps_ns) == (kept == "times.txt")


def test_line_k_of_the_poses_is_frame_k_even_where_scans_are_missing_at_the_end(tmp_path):
    root = write_kitti_odometry(tmp_path, scans=(1, 3))
    lines = "\n".join(pose_line(0, 0, 10 * n) for n in range(9))
    write_text(root / "poses.txt", lines)  # SemanticKITTI's place
    drive = open_drive(root)
    assert np.isclose(drive[1].pose[0, 3], 10)
    assert np.isclose(drive[3].pose[0, 3], 30)
    write_text(root / "poses.txt", "\n".join([pose_line(0)] * 3))
    with pytest.raises(
        CalibrationError, match=r"poses\.txt has 3 lines; expected 2 \(.*\) or 4 \("
    ):
        open_drive(root)


def test_the_only_sequence_is_found_from_above_and_of_two_one_must_be_named(tmp_path):
    root = write_kitti_odometry(tmp_path)
    assert open_drive(tmp_path).root == root
    assert open_drive(tmp_path / "sequences").root == root
    write_kitti_odometry(tmp_path, name="05")
    with pytest.raises(DriveError, match=r"holds 2 drives; .*: sequences/04, sequences/05\."):
        open_drive(tmp_path)


def test_odometry_calibration_may_be_missing_only_where_nothing_needs_it(tmp_path):
    root = write_kitti_odometry(tmp_path)
    (root / "calib.txt").unlink()
    with pytest.raises(CalibrationError, match=r"calib\.txt is missing"):
        open_drive(root)
    for image in (root / "image_2").iterdir():
        image.unlink()
    (root / "image_2").rmdir()
    drive = open_drive(root)
    assert drive.camera is None
    assert drive[1].cam_from_velo is None
    write_text(tmp_path / "poses/04.txt", IDENTITY_LINE + "\n" + IDENTITY_LINE)
    with pytest.raises(CalibrationError, match=r"calib\.txt is missing"):
        open_drive(root)


def test_without_images_kittis_size_is_used_and_logged(tmp_path, caplog):
    root = write_kitti_odometry(tmp_path)
    for image in (root / "image_2").iterdir():
        image.unlink()
    with caplog.at_level(logging.INFO):
        camera = open_drive(root).camera
    assert (camera.width_px, camera.height_px) == (1242, 375)
    assert "1242 x 375" in caplog.text


def test_times_keep_nanoseconds(tmp_path):
    root = write_kitti_odometry(tmp_path)
    write_text(root / "times.txt", "-1.5\n1.037875019e-01\n")
    drive = open_drive(root)
    assert [drive[n].timestamp_ns for n in (0, 1)] == [-1_500_000_000, 103_787_502]


@pytest.mark.parametrize(
    ("file", "text", "message"),
    [
        ("times.txt", "0.0\nsoon\n", r"times\.txt, line 2: 'soon' is not a finite number"),
        ("times.txt", "0.0\n1 2\n", r"times\.txt, line 2: expected one time in seconds"),
        ("times.txt", "0.0\n1\n2\n", None),
        ("times.txt", "0.0\n", r"times\.txt has 1 lines"),
        ("calib.txt", "P2: 1 2\n", r"calib\.txt, line 1: P2 needs 12 numbers, it has 2"),
    ],
)
def test_invalid_odometry_metadata_files(tmp_path, file, text, message):
    root = write_kitti_odometry(tmp_path)
    write_text(root / file, text)
    if message is None:
        assert open_drive(root)[1].timestamp_ns == 10**9
        return
    with pytest.raises(CalibrationError, match=message):
        open_drive(root)


def test_a_sequence_without_scans(tmp_path):
    root = write_kitti_odometry(tmp_path, scans=())
    (root / "velodyne").mkdir()
    with pytest.raises(DriveError, match=r"holds no scans; expected files: velodyne/\*\.bin"):
        open_drive(root)


def test_a_sequence_names_its_camera_and_its_fingerprint_sees_each_text_file(tmp_path):
    root = write_kitti_odometry(tmp_path)
    write_text(tmp_path / "poses/04.txt", f"{IDENTITY_LINE}\n{pose_line(1)}\n")
    times = write_text(root / "times.txt", "0.0\n0.1\n")
    drive = open_drive(root, camera="3")
    assert drive.camera_name == "image_3"
    before = drive.fingerprint()
    assert before["camera"] == "image_3"
    for path in (root / "calib.txt", tmp_path / "poses/04.txt", times):
        text = path.read_text()
        path.write_text(text + "\n")  # blank lines at the end: the same values
        assert open_drive(root, camera="3").fingerprint()["digest"] != before["digest"], path
        path.write_text(text)
    assert open_drive(root, camera="3").fingerprint() == before


def test_a_calibration_without_cameras_still_serves_the_poses(tmp_path):
    root = write_kitti_odometry(tmp_path)
    for image in (root / "image_2").iterdir():
        image.unlink()
    (root / "image_2").rmdir()
    write_text(root / "calib.txt", "Tr: 0 -1 0 0 0 0 -1 -0.08 1 0 0 -0.27\n")
    write_text(tmp_path / "poses/04.txt", f"{IDENTITY_LINE}\n{pose_line(0, 0, 10)}\n")
    drive = open_drive(root)
    assert drive.camera is None
    assert drive.camera_names == ()
    assert np.allclose(drive[1].pose[:3, 3], [10, 0, 0])


# --- object ---


@pytest.mark.parametrize("above", [False, True])
def test_object_frames_have_their_own_cameras(tmp_path, above):
    root = write_kitti_object(tmp_path)
    other = OBJECT_CALIBRATION.replace("P2: 7.0e+02", "P2: 6.5e+02")
    write_text(root / "calib/000003.txt", other)
    drive = open_drive(tmp_path if above else root)
    assert (drive.layout, drive.frame_numbers) == ("kitti_object", (0, 3))
    assert [drive[n].camera.fx_px for n in (0, 3)] == [700, 650]
    assert [drive[n].camera.width_px for n in (0, 3)] == [60, 63]  # from each frame's image
    assert drive.camera.fx_px == 700
    assert drive[3].pose is None
    assert np.array_equal(drive[3].points, scan_rows(3)[:, :3])
    # R0_rect maps (x, y, z) to (y, -x, z), after Tr_velo_to_cam: by hand.
    assert np.allclose(drive[3].cam_from_velo @ [10, 2, 1, 1], [-1.08, 2, 9.73, 1])
    assert open_drive(root, camera="image_3")[3].camera.projection[0, 3] == -350


def test_an_invalid_calibration_fails_its_own_frame_only(tmp_path):
    root = write_kitti_object(tmp_path, scans=(0, 1, 2))
    write_text(root / "calib/000000.txt", OBJECT_CALIBRATION.replace("R0_rect: 0", "R0_rect: o"))
    (root / "calib/000002.txt").unlink()
    drive = open_drive(root)
    with pytest.raises(CalibrationError, match=r"000000\.txt, line 4: 'o' is not a finite number"):
        drive[0]
    with pytest.raises(CalibrationError, match=r"000002\.txt is missing"):
        drive[2]
    assert drive[1].camera.fx_px == 700
    assert drive.camera.width_px == 61  # of the first frame with a readable calibration
    assert drive.fingerprint()["camera"] == "image_2"


def test_every_calibration_is_invalid(tmp_path):
    root = write_kitti_object(tmp_path)
    for path in (root / "calib").iterdir():
        path.write_text("nothing")
    drive = open_drive(root)
    with pytest.raises(CalibrationError, match=r"000003\.txt, line 1: expected KEY: numbers"):
        drive[3]
    with pytest.raises(CalibrationError, match=r"000000\.txt, line 1: expected KEY: numbers"):
        _ = drive.camera


def test_object_images_without_calibration(tmp_path):
    root = write_kitti_object(tmp_path)
    for path in (root / "calib").iterdir():
        path.unlink()
    with pytest.raises(CalibrationError, match="images but no calibration; each frame needs a"):
        open_drive(root)


def test_an_object_frame_without_its_image(tmp_path):
    root = write_kitti_object(tmp_path)
    (root / "image_2/000003.png").unlink()
    frame = open_drive(root)[3]
    assert frame.image_path is None
    assert (frame.camera.width_px, frame.camera.height_px) == (60, 20)  # of the nearest image
    (root / "image_2/000000.png").write_bytes(b"no image")
    with pytest.raises(DriveError, match=r"000000\.png is neither a PNG nor a JPEG image"):
        open_drive(root)[0]


def test_testing_is_found_where_there_is_no_training(tmp_path):
    write_kitti_object(tmp_path).rename(tmp_path / "testing")
    assert open_drive(tmp_path).name == "testing"


def test_folders_of_scans_alone_are_no_object_drive(tmp_path):
    """Neither calibration nor images beside velodyne: nothing says that it is KITTI object."""
    write_scan(tmp_path / "velodyne/000004.bin", 4)
    with pytest.raises(DriveError, match="is not a drive of a known layout"):
        open_drive(tmp_path)
    (tmp_path / "image_2").mkdir()
    with pytest.raises(CalibrationError, match="images but no calibration"):
        open_drive(tmp_path)


def test_calibrations_and_images_without_scans_are_no_object_drive(tmp_path):
    (tmp_path / "calib").mkdir()
    with pytest.raises(DriveError, match="is not a drive of a known layout"):
        open_drive(tmp_path)


def test_an_object_drive_names_its_camera_and_its_fingerprint_sees_each_calibration(tmp_path):
    root = write_kitti_object(tmp_path)
    drive = open_drive(root, camera="3")
    assert drive.camera_name == "image_3"
    before = drive.fingerprint()
    assert before["camera"] == "image_3"
    for number in (0, 3):
        path = root / f"calib/{number:06d}.txt"
        text = path.read_text()
        path.write_text(text + "\n")
        assert open_drive(root, camera="3").fingerprint()["digest"] != before["digest"], path
        path.write_text(text)


def test_object_without_scans(tmp_path):
    root = write_kitti_object(tmp_path, scans=())
    (root / "velodyne").mkdir(parents=True)
    (root / "calib").mkdir()
    with pytest.raises(DriveError, match="holds no scans"):
        open_drive(root)


def test_object_scans_alone_open_without_a_camera(tmp_path):
    write_scan(tmp_path / "velodyne/000004.bin", 4)
    (tmp_path / "calib").mkdir()
    drive = open_drive(tmp_path)
    assert drive.camera is None
    assert drive[4].camera is None
    write_png(tmp_path / "image_2/000004.png", 4, 4)
    with pytest.raises(CalibrationError, match="images but no calibration"):
        open_drive(tmp_path)
