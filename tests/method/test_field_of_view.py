"""Eq. 1 and 2 against values by hand, a plain loop and the real calibration."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from intervis import Camera, open_drive
from intervis.method.field_of_view import image_from_velo, in_azimuth, in_camera, taken

# x right, y down, z forward from x forward, y left, z up
CAM_FROM_VELO = np.array([[0.0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]])


def camera(baseline_m: float = 0.0) -> Camera:
    """F = 100, principal point off centre at (70, 20) in a 100 x 50 image."""
    return Camera(
        np.array([[100.0, 0, 70, -100 * baseline_m], [0, 100, 20, 0], [0, 0, 1, 0]]), 100, 50
    )


def test_equation_2_projects_with_the_real_principal_point():
    # (x, y, z) = (10, 2, -1): 2 m to the left is 20 px left of column 70, 1 m down 10 px below.
    homogeneous = image_from_velo(camera(), CAM_FROM_VELO) @ [10.0, 2.0, -1.0, 1.0]
    assert np.allclose(homogeneous[:2] / homogeneous[2], [50.0, 30.0])


def test_baseline_shifts_the_pixel_by_focal_length_times_baseline_over_depth():
    homogeneous = image_from_velo(camera(0.5), CAM_FROM_VELO) @ [10.0, 0.0, 0.0, 1.0]
    assert np.allclose(homogeneous[:2] / homogeneous[2], [70.0 - 100 * 0.5 / 10, 20.0])


@pytest.mark.parametrize(
    ("point", "in_view"),
    [
        (
            (10.0, 6.999, 0.0),
            True,
        ),  # column 0.01: inside, though a symmetric field of view has 50 px
        ((10.0, 7.001, 0.0), False),  # column -0.01
        ((10.0, -2.999, 0.0), True),  # column 99.99
        ((10.0, -3.0, 0.0), False),  # column 100, one past the last
        ((10.0, 0.0, 2.0), True),  # row 0
        ((10.0, 0.0, 2.001), False),
        ((10.0, 0.0, -2.999), True),
        ((10.0, 0.0, -3.0), False),  # row 50
        ((-10.0, 0.0, 0.0), False),  # behind: its quotient would land on the principal point
        ((0.0, 0.0, 0.0), False),  # at the camera: no direction
    ],
)
def test_edges_of_the_image(point, in_view):
    found = in_camera(np.array([point]), camera(), CAM_FROM_VELO)
    assert (len(found.index) == 1) == in_view


def test_points_that_are_not_finite_are_dropped_and_counted():
    points = np.array([[5.0, 0, 0], [np.nan, 0, 0], [5, np.inf, 0], [0, 0, 0], [6, 0, 0]])
    for found in (in_camera(points, camera(), CAM_FROM_VELO), in_azimuth(points, 360.0)):
        assert found.index.tolist() == [0, 4]
        assert (found.n_raw, found.n_dropped) == (2, 3)


@given(st.integers(0, 2**32 - 1), st.sampled_from([np.float32, np.float64]))
def test_equals_a_plain_loop(seed, dtype):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(200, 3)).astype(dtype) * 20
    lens = camera(0.3)
    found = in_camera(points, lens, CAM_FROM_VELO)
    expected = []
    for row, point in enumerate(points.astype(np.float64)):
        x, y, depth = -point[1], -point[2], point[0]
        if depth <= 0:
            continue
        u, v = 100 * (x - 0.3) / depth + 70, 100 * y / depth + 20
        if 0 <= u < 100 and 0 <= v < 50:
            expected.append(row)
    assert found.index.tolist() == expected


@given(st.floats(1, 359), st.integers(0, 2**32 - 1))
def test_an_azimuth_field_of_view_is_centred_on_the_x_axis(fov_deg, seed):
    points = np.random.default_rng(seed).normal(size=(50, 3))
    found = in_azimuth(points, fov_deg)
    azimuth_deg = np.rad2deg(np.arctan2(points[:, 1], points[:, 0]))
    assert found.index.tolist() == np.flatnonzero(np.abs(azimuth_deg) <= fov_deg / 2).tolist()


@pytest.mark.realdata
def test_real_frames_have_the_known_number_of_returns_in_view(shared_data):
    # Counted once with an independent projection; see the paper's 20,008 of 125,148.
    raw = open_drive(shared_data / "kitti_raw/2011_09_26/2011_09_26_drive_9001_sync")[0]
    found = in_camera(raw.points, raw.camera, raw.cam_from_velo)
    assert (found.n_raw, len(found.index)) == (114_278, 16_333)
    objects = open_drive(shared_data / "kitti_object")[2]
    found = in_camera(objects.points, objects.camera, objects.cam_from_velo)
    assert (found.n_raw, len(found.index)) == (126_891, 20_210)


PLAIN_CAMERA = Camera(np.array([[100.0, 0, 50, 0], [0, 100, 40, 0], [0, 0, 1, 0]]), 100, 80)


@pytest.mark.parametrize(
    ("point", "seen"),
    [
        # at 5 m: u = 50 - 20 y and v = 40 - 20 z
        ([5.0, 2.5, 0], True),  # u = 0
        ([5.0, 2.51, 0], False),
        ([5.0, -2.49, 0], True),
        ([5.0, -2.5, 0], False),  # u = width
        ([5.0, 0, 2.0], True),  # v = 0
        ([5.0, 0, 2.01], False),
        ([5.0, 0, -1.99], True),
        ([5.0, 0, -2.0], False),  # v = height
        ([0.25, 0, 0], True),
        ([-5.0, 0, 0], False),
        ([-5.0, 2.5, 2.0], False),
        ([0.0, -1, -1], False),  # no depth
    ],
)
def test_the_border_of_the_image(point, seen):
    found = in_camera(np.array([point]), PLAIN_CAMERA, CAM_FROM_VELO)
    assert found.index.tolist() == ([0] if seen else [])
    assert (found.n_raw, found.n_dropped) == (1, 0)


@pytest.mark.parametrize(
    ("row", "is_return"),
    [
        ([0.0, 0, 0], False),
        ([1.0, 0, 0], True),
        ([0.0, 1, 0], True),
        ([0.0, 0, 1], True),
        ([np.nan, 1, 1], False),
        ([1, np.inf, -np.inf], False),
        ([1, 1, np.inf], False),
    ],
)
def test_rows_that_are_no_return_are_dropped(row, is_return):
    rows = np.array([row, [5.0, 0, 0]])
    found = in_azimuth(rows, 360.0)
    assert found.index.tolist() == ([0, 1] if is_return else [1])
    assert (found.n_raw, found.n_dropped) == (1 + is_return, 1 - is_return)
    seen = in_camera(rows, PLAIN_CAMERA, CAM_FROM_VELO)
    assert (seen.n_raw, seen.n_dropped) == (1 + is_return, 1 - is_return)
    assert seen.index[-1] == 1


def test_azimuths_on_the_border_are_in_view():
    points = np.array([[5.0, 5, 0], [5, -5, 1], [4.99, 5, 0], [5, -5.01, 0], [5, 0, 9], [-5, 0, 0]])
    assert in_azimuth(points, 90.0).index.tolist() == [0, 1, 4]
    assert in_azimuth(points, 360.0).index.tolist() == [0, 1, 2, 3, 4, 5]
    assert in_azimuth(points, 180.0).index.tolist() == [0, 1, 2, 3, 4]


@pytest.mark.parametrize("kind", [np.float32, np.float64])
@pytest.mark.parametrize("columns", [3, 4])
def test_points_are_taken_as_numpy_takes_them(rng, kind, columns):
    points = rng.normal(size=(50, columns)).astype(kind)[:, :3]
    for index in (np.flatnonzero(rng.random(50) < 0.4), np.empty(0, np.int64)):
        found, expected = taken(points, index), points[index].astype(np.float64)
        assert (found.shape, found.dtype) == (expected.shape, expected.dtype)
        assert (found == expected).all()
