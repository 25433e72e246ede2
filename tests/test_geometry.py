"""Cameras, rigid motions and the checks of arrays that callers pass in."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from intervis.arrays import checked_point, checked_points, finite_rows
from intervis.camera import Camera, default_viewpoint
from intervis.errors import CameraError, PointsError, PoseError
from intervis.transform import ROTATION_TOLERANCE, checked_pose, inverse, rigid, transform

PROJECTION = np.array([[700.0, 0, 600, 45], [0, 710, 180, -0.3], [0, 0, 1, 0.005]])
TURNED = Rotation.from_euler("zyx", [40, -20, 10], degrees=True).as_matrix()

# --- cameras ---


def test_a_camera_gives_its_intrinsics_and_its_own_matrix():
    given = PROJECTION.copy()
    camera = Camera(given, 1242, 375, name="image_02")
    assert (camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px) == (700, 710, 600, 180)
    given[:] = 0
    assert np.array_equal(camera.projection, PROJECTION)
    with pytest.raises(ValueError, match="read-only"):
        camera.projection[0, 0] = 1
    assert repr(camera) == "Camera(width_px=1242, height_px=375, name='image_02')"


def test_cameras_compare_by_identity_because_arrays_have_no_truth_value():
    camera, same = Camera(PROJECTION, 10, 10), Camera(PROJECTION, 10, 10)
    assert camera != same
    assert len({camera, same}) == 2


def test_the_centre_projects_to_zero():
    centre_cam = Camera(PROJECTION, 1242, 375).centre_cam
    assert np.allclose(PROJECTION @ [*centre_cam, 1], 0, atol=1e-10)


def test_the_default_viewpoint_is_the_centre_in_the_sensor_frame():
    camera, cam_from_velo = Camera(PROJECTION, 1242, 375), rigid(TURNED, [0.1, -0.2, 0.3])
    viewpoint_velo = default_viewpoint(camera, cam_from_velo)
    assert np.allclose(PROJECTION @ cam_from_velo @ [*viewpoint_velo, 1], 0, atol=1e-10)
    assert default_viewpoint(None, cam_from_velo).tolist() == [0, 0, 0]
    assert default_viewpoint(camera, None).tolist() == [0, 0, 0]


@pytest.mark.parametrize(
    ("projection", "size_px", "message"),
    [
        (PROJECTION[:, :3], (10, 10), r"finite \(3, 4\) matrix, got shape \(3, 3\)"),
        (np.where(PROJECTION == 600, np.nan, PROJECTION), (10, 10), "finite"),
        ("fisheye", (10, 10), "matrix of numbers"),
        ([[1, 2], [3]], (10, 10), "matrix of numbers"),
        (PROJECTION * [[0], [1], [1]], (10, 10), "rank three"),
        (PROJECTION, (0, 10), "must have 1 to 100000 pixels a side, got 0 x 10"),
        (PROJECTION, (10, 0), "must have 1 to 100000 pixels a side, got 10 x 0"),
        (PROJECTION, (10**9, 10), "got 1000000000 x 10"),
        (PROJECTION, (np.nan, 10), "got nan x 10"),
        (PROJECTION * 1e150, (10, 10), "entries up to 1e"),
    ],
)
def test_an_invalid_camera_is_refused(projection, size_px, message):
    with pytest.raises(CameraError, match=message):
        Camera(projection, *size_px)


def test_an_image_of_one_pixel_is_valid():
    assert Camera(PROJECTION, 1, 1).width_px == 1


# --- rigid motions ---


def test_a_pose_of_three_rows_gets_its_last_row_and_is_copied():
    pose = rigid(TURNED, [1, 2, 3])
    checked = checked_pose(pose[:3])
    assert np.array_equal(checked, pose)
    same = checked_pose(pose)
    same[:] = 0
    assert pose[0, 3] == 1


def changed(row, column, value):
    pose = rigid(TURNED, [1, 2, 3])
    pose[row, column] = value
    return pose


@pytest.mark.parametrize(
    ("pose", "message"),
    [
        (np.eye(3), r"shape \(4, 4\) or \(3, 4\), got \(3, 3\)"),
        (np.zeros((2, 4, 4)), "shape"),
        ("north", "4x4 matrix of numbers"),
        ([[1, 2], [3]], "4x4 matrix of numbers"),
        (changed(1, 3, np.nan), "NaN or infinite"),
        (changed(1, 3, np.inf), "NaN or infinite"),
        (np.diag([1.0, 1, -1, 1]), "must be a rotation"),
        (np.diag([1 + ROTATION_TOLERANCE, 1, 1, 1]), "must be a rotation"),
        (changed(3, 3, 1.1), "last row must be 0 0 0 1"),
        (changed(3, 0, 0.1), "last row must be 0 0 0 1"),
    ],
)
def test_what_is_not_a_rigid_motion_is_refused(pose, message):
    with pytest.raises(PoseError, match=f"^cam_from_velo .*{message}"):
        checked_pose(pose, "cam_from_velo")


def test_rotations_printed_with_seven_digits_pass():
    rounded = rigid(np.round(TURNED, 7), [0, 0, 0])
    assert np.array_equal(checked_pose(rounded), rounded)


def test_transforms_agree_with_scipy_and_invert(rng):
    points = rng.normal(size=(5, 7, 3)) * 50
    pose = rigid(TURNED, [1, 2, 3])
    expected = Rotation.from_matrix(TURNED).apply(points.reshape(-1, 3)) + np.array([1, 2, 3])
    moved = transform(pose, points.astype(np.float32))
    assert moved.dtype == np.float64
    assert np.allclose(moved.reshape(-1, 3), expected, atol=1e-5)
    assert np.allclose(transform(inverse(pose), transform(pose, points)), points, atol=1e-12)


# --- arrays ---


@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_checked_points_are_a_view_of_the_coordinates(kind):
    rows = np.arange(8, dtype=kind).reshape(2, 4)
    checked = checked_points(rows)
    assert checked.dtype == kind
    assert np.shares_memory(checked, rows)
    assert checked.tolist() == [[0, 1, 2], [4, 5, 6]]
    assert checked_points(rows[:, :3]).shape == (2, 3)


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (np.zeros((3, 2)), r"targets must have the shape \(N, 3\) or \(N, 4\), got \(3, 2\)"),
        (np.zeros((3, 5)), "shape"),
        (np.zeros(3), "shape"),
        (np.zeros((1, 3, 3)), "shape"),
        (np.zeros((3, 3), int), "targets must be float32 or float64 metres, got int64"),
        (np.zeros((3, 3), np.float16), "got float16"),
    ],
)
def test_other_arrays_of_points_are_refused(points, message):
    with pytest.raises(PointsError, match=message):
        checked_points(points, "targets")


def test_a_checked_point_is_a_copy():
    given = np.array([1.0, 2, 3])
    checked_point(given)[:] = 0
    assert given.tolist() == [1, 2, 3]


@pytest.mark.parametrize(
    "point",
    [(0, 0), (0, 0, 0, 0), (0, 0, np.nan), (0, -np.inf, 0), "abc", ("x", "y", "z"), [[1, 2, 3]]],
)
def test_other_points_are_refused(point):
    with pytest.raises(PointsError, match="viewpoint must be three"):
        checked_point(point)


@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_finite_rows_agree_with_a_look_at_each_coordinate(kind):
    values = np.array([0, np.nan, np.inf, -np.inf, 3e8, -2e8, np.finfo(kind).max], kind)
    rows = np.stack(np.meshgrid(values, values, values), axis=-1).reshape(-1, 3)
    assert np.array_equal(finite_rows(rows), (np.abs(rows) < 5e8).all(axis=1))
