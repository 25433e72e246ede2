"""KITTI-360: files are made from chosen places of vehicle, cameras and scanner."""

import numpy as np
import pytest
from drive_layouts import write_text
from kitti_360_writer import (
    NAME,
    POSE_FROM_CAM,
    POSE_FROM_VELO,
    RECTIFYING,
    WORLD_FROM_POSE,
    write_drive,
)
from scipy.spatial.transform import Rotation

from intervis.drives import open_drive
from intervis.errors import CalibrationError, DriveError
from intervis.transform import inverse, transform


@pytest.mark.parametrize("cam0", [False, True])
def test_poses_are_those_of_the_scanner(tmp_path, cam0):
    root = write_drive(tmp_path / "KITTI-360", cam0=cam0)
    for path in (root, root.parent, tmp_path / "KITTI-360", tmp_path):
        drive = open_drive(path)
        assert (drive.layout, drive.frame_numbers) == ("kitti_360", (0, 1, 2, 3, 4))
    for number in (0, 1, 3):
        expected = WORLD_FROM_POSE[number] @ POSE_FROM_VELO
        assert np.allclose(drive[number].pose, expected, rtol=0, atol=1e-6)
    # Frame 2, between 1 and 3: its scanner is a quarter of the way, as its time says.
    before, after = drive[1].pose, drive[3].pose
    assert np.allclose(drive[2].pose[:3, 3], 0.75 * before[:3, 3] + 0.25 * after[:3, 3])
    turn = Rotation.from_matrix(before[:3, :3].T @ after[:3, :3]).magnitude()
    quarter = Rotation.from_matrix(before[:3, :3].T @ drive[2].pose[:3, :3]).magnitude()
    assert quarter == pytest.approx(turn / 4)
    assert drive[4].pose is None  # nothing is extrapolated
    assert drive[2].timestamp_ns - drive[1].timestamp_ns == 50_000_000


@pytest.mark.parametrize("name", ["image_00", "image_01"])
def test_a_place_ahead_is_seen_where_the_camera_s_place_says(tmp_path, name):
    drive = open_drive(write_drive(tmp_path), camera=name)
    frame = drive[1]
    ahead = np.array([[12.0, 1.5, -0.5], [30.0, -4.0, 1.0]])  # in the frame of poses
    in_velo = transform(inverse(POSE_FROM_VELO), ahead)
    seen = transform(frame.cam_from_velo, in_velo)
    in_cam = transform(inverse(POSE_FROM_CAM[name]), ahead)
    rectified = in_cam @ RECTIFYING[name[-2:]][:3, :3].T
    assert np.allclose(seen, rectified, rtol=0, atol=1e-6)
    u, v, w = frame.camera.projection @ np.column_stack([seen, np.ones(2)]).T
    assert np.allclose(u / w, 12 + 20 * rectified[:, 0] / rectified[:, 2])
    assert np.allclose(v / w, 8 + 20 * rectified[:, 1] / rectified[:, 2])
    assert (frame.camera.width_px, frame.camera.height_px) == (24, 16)


def test_the_camera_with_images_is_chosen(tmp_path):
    drive = open_drive(write_drive(tmp_path))
    assert drive.camera_name == "image_01"
    assert drive.camera_names == ("image_00", "image_01")
    assert drive[0].image.shape == (16, 24, 3)
    with pytest.raises(DriveError, match="no camera '2'; available cameras: image_00, image_01"):
        open_drive(tmp_path, camera="2")


def test_scans_alone_are_a_drive(tmp_path):
    root = write_drive(tmp_path, images=False)
    for folder in ("calibration", "data_poses"):
        for path in (tmp_path / folder).rglob("*.txt"):
            path.unlink()
    drive = open_drive(root)
    assert (drive.layout, drive.camera, drive.poses) == ("kitti_360", None, None)
    assert len(drive[3].points)


@pytest.mark.parametrize(
    ("file", "text", "reason"),
    [
        ("calibration/calib_cam_to_velo.txt", None, "calib_cam_to_velo.txt is missing"),
        ("calibration/calib_cam_to_velo.txt", "1 2 3", "a pose needs 12 numbers"),
        ("calibration/calib_cam_to_velo.txt", "", "has 0 lines; expected one"),
        ("calibration/calib_cam_to_pose.txt", "a: 1", "has no line 'image_01'"),
        ("calibration/perspective.txt", "P_rect_00: 1", "P_rect_00 needs 12 numbers"),
        (f"data_poses/{NAME}/poses.txt", "0.5 " + "1 " * 12, "expected a frame number"),
        (f"data_poses/{NAME}/poses.txt", "1 0 0 0", "a pose needs 12 numbers"),
        (f"data_poses/{NAME}/poses.txt", "-1 " + "1 " * 12, "expected a frame number"),
    ],
)
def test_damaged_files_are_told(tmp_path, file, text, reason):
    root = write_drive(tmp_path)
    (tmp_path / file).unlink() if text is None else write_text(tmp_path / file, text)
    with pytest.raises(CalibrationError, match=reason) as caught:
        open_drive(root)
    assert "\n" not in str(caught.value)


def test_a_frame_number_that_comes_twice_is_told(tmp_path):
    root = write_drive(tmp_path, stated=(0, 1, 1))
    with pytest.raises(
        CalibrationError, match=r"poses.txt, line 3: expected a frame number of its"
    ):
        open_drive(root)


def test_times_may_go_on_behind_the_last_scan(tmp_path):
    root = write_drive(tmp_path)
    times = root / "velodyne_points/timestamps.txt"
    times.write_text(times.read_text() + "2013-05-28 08:46:11.000000000\n")
    drive = open_drive(root)
    assert drive.frame_numbers == (0, 1, 2, 3, 4)
    assert drive[4].timestamp_ns - drive[0].timestamp_ns == 400_000_000
