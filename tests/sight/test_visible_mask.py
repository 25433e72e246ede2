"""`visible_mask` beside plain numpy, a loop over all pairs, and scenes worked out on paper."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as st_numpy

import intervis.sight.depth_buffer
from intervis import visible_mask
from intervis.compilation import PARTS
from intervis.drives import Frame, open_drive
from intervis.errors import PointsError, SettingsError
from intervis.lab.speed.numpy_mask import numpy_mask

COORDINATES = st.one_of(
    st.floats(-60, 60, width=32), st.sampled_from([0.0, -0.0, 1.0, -1.0, np.nan, np.inf, 1e12])
)
SCANS = st_numpy.arrays(
    np.float32, st.tuples(st.integers(0, 60), st.sampled_from([3, 4])), elements=COORDINATES
)
VIEWPOINTS = st.lists(
    st.one_of(st.floats(-20, 20), st.sampled_from([0.0, 1.0])), min_size=3, max_size=3
)
OPTIONS = st.fixed_dictionaries(
    {
        "cell_deg": st.sampled_from([0.07, 0.5, 3.3, 10.0]),
        "tolerance_m": st.sampled_from([0.0, 0.3, 5.0]),
        "tolerance_fraction": st.sampled_from([0.0, 0.02, 0.9]),
    }
)


@given(SCANS, VIEWPOINTS, OPTIONS)
def test_the_mask_is_that_of_plain_numpy(scan, viewpoint, options):
    expected = numpy_mask(scan, np.array(viewpoint), **options)
    np.testing.assert_array_equal(visible_mask(scan, viewpoint, **options), expected)
    wide = visible_mask(scan.astype(np.float64), viewpoint, **options)
    np.testing.assert_array_equal(wide, expected)


def street_scan(count=4000, seed=0):
    """(N, 4) float32 ground, walls and posts around the sensor, and rows that are no return."""
    rng = np.random.default_rng(seed)
    points = np.column_stack([rng.uniform(-40, 40, (count, 2)), np.full(count, -1.7)])
    walls, posts = slice(0, count // 2), slice(count // 2, count * 5 // 8)
    points[walls, 1] = np.where(points[walls, 1] > 0, 9.0, -7.0)
    points[walls, 2] = rng.uniform(-1.7, 5.0, count // 2)
    points[posts, :2] = np.round(points[posts, :2] / 8.0) * 8.0 + 1.0
    points[posts, 2] = rng.uniform(-1.7, 2.0, len(points[posts]))
    points[::50] = 0.0
    points[7::200] = np.nan
    return np.column_stack([points, rng.uniform(0, 1, count)]).astype(np.float32)


@pytest.mark.parametrize("threads", ["1", "2", "3"])
def test_blocks_and_threads_change_nothing(threads, monkeypatch):
    scan, viewpoint = street_scan(), np.array([6.0, 1.0, 0.4])
    expected = numpy_mask(scan, viewpoint, cell_deg=3.0)
    assert 0.2 < expected.mean() < 0.8
    monkeypatch.setenv("INTERVIS_THREADS", threads)
    monkeypatch.setattr(intervis.sight.depth_buffer, "LEAST_POINTS", 1000)
    for block in (64, 999, 4000):
        monkeypatch.setattr(intervis.sight.depth_buffer, "BLOCK", block)
        np.testing.assert_array_equal(visible_mask(scan, viewpoint, cell_deg=3.0), expected)


def test_a_point_is_hidden_by_a_nearer_one_in_its_direction_only():
    """Every pair of points: the angle between them decides, beyond doubt at a cell and a half."""
    rng = np.random.default_rng(3)
    towards = rng.normal(size=(300, 3)) * [1, 1, 0.3]
    towards /= np.linalg.norm(towards, axis=1)[:, None]
    scan = np.vstack([towards * rng.uniform(2, 40, (300, 1)) for _ in range(2)])  # pairs in line
    ranges = np.linalg.norm(scan, axis=1)
    seen = visible_mask(scan, [0, 0, 0], cell_deg=2.0, tolerance_m=0.5, tolerance_fraction=0.1)
    directions = scan / ranges[:, None]
    angle_deg = np.degrees(np.arccos(np.clip(directions @ directions.T, -1, 1)))
    nearer = ranges[None, :] < 0.9 * ranges[:, None] - 0.5
    certainly_hidden = (nearer & (angle_deg < 1e-4)).any(axis=1)
    certainly_seen = ~(nearer & (angle_deg < 3.0)).any(axis=1)  # a cell's diagonal
    assert certainly_hidden.sum() > 100
    assert certainly_seen.sum() > 100
    assert not seen[certainly_hidden].any()
    assert seen[certainly_seen].all()


def test_a_wall_hides_what_is_behind_it_and_what_is_lower_than_its_top():
    """A wall at x = 10 m, 2 m high from the eye; at x = 20 m it covers 4 m."""
    y, z = np.meshgrid(np.arange(-5, 5, 0.04), np.arange(-2, 2.001, 0.04))
    wall = np.stack([np.full(y.size, 10.0), y.ravel(), z.ravel()], axis=1)
    targets = [[20, 0, 3.8], [20, 0, 4.4], [20, 9.7, 0], [20, 10.4, 0], [10.5, 0, 0], [12, 0, 0]]
    seen = visible_mask(np.vstack([wall, targets]), [0, 0, 0])
    assert seen[: len(wall)].all()
    # 0.5 m behind is within the tolerance of 1 m and 2 %; 2 m behind is not
    assert seen[len(wall) :].tolist() == [False, True, False, True, True, False]


def test_the_tolerance_is_metres_plus_a_fraction_of_the_farther_range():
    for farther, expected in ((12.9, True), (13.1, False)):  # 10 + 0.4 + 0.2 r = r at r = 13
        points = np.array([[10.0, 0.0, 0.0], [farther, 0.0, 0.0]])
        seen = visible_mask(points, [0, 0, 0], tolerance_m=0.4, tolerance_fraction=0.2)
        assert seen.tolist() == [True, expected]


def test_the_viewpoint_moves_what_is_hidden():
    post, behind = [10.0, 0.0, 0.0], [20.0, 0.0, 0.0]
    assert visible_mask(np.array([post, behind]), [0, 0, 0]).tolist() == [True, False]
    assert visible_mask(np.array([post, behind]), [0, 3, 0]).tolist() == [True, True]
    assert visible_mask(np.array([post, behind]), [30, 0, 0]).tolist() == [False, True]


def test_points_near_the_viewpoint_hide_nothing():
    target = [20.0, 0.0, 0.0]
    assert visible_mask(np.array([[0.39, 0.0, 0.0], target]), [0, 0, 0]).tolist() == [True, True]
    assert visible_mask(np.array([[0.41, 0.0, 0.0], target]), [0, 0, 0]).tolist() == [True, False]
    assert visible_mask(np.array([[3.0, 2.0, 1.0]]), [3.0, 2.0, 1.0]).tolist() == [True]


@pytest.mark.parametrize("nothing", [[0.0, 0, 0], [np.nan, 0, 0], [1, np.inf, 0], [2e9, 0, 0]])
def test_what_is_no_return_is_not_visible_and_hides_nothing(nothing):
    points = np.array([nothing, [20.0, 0.0, 0.0], [1e8, 1e8, 0.0]])
    for viewpoint in ([0, 0, 0], [-5, 0, 0]):
        assert visible_mask(points, viewpoint).tolist() == [False, True, True]


def test_far_coordinates_keep_their_precision():
    scan, viewpoint, there = street_scan(), np.array([6.0, 1.0, 0.4]), [4e6, 6e5, 300.0]
    points = scan[np.isfinite(scan).all(axis=1) & scan[:, :3].any(axis=1), :3].astype(np.float64)
    here = visible_mask(points, viewpoint)
    moved = visible_mask(points + there, viewpoint + there)
    assert (here == moved).mean() > 0.995  # rounding moves some points into the next cell


def test_turning_scan_and_viewpoint_by_a_quarter_changes_nothing():
    scan, viewpoint = street_scan()[:, :3].astype(np.float64), np.array([6.0, 1.0, 0.4])
    quarter = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    here, turned = (
        visible_mask(scan, viewpoint),
        visible_mask(scan @ quarter.T, quarter @ viewpoint),
    )
    assert (here == turned).mean() > 0.97  # cells count in the other direction in each octant


def test_every_layout_of_memory_gives_the_same_and_none_is_changed():
    scan, viewpoint = street_scan(), [6.0, 1.0, 0.4]
    before, expected = scan.copy(), visible_mask(scan, viewpoint)
    frozen = scan.copy()
    frozen.flags.writeable = False
    double = np.repeat(scan, 2, axis=0)
    for same in (np.asfortranarray(scan), frozen, double[::2], scan[:, :3]):
        np.testing.assert_array_equal(visible_mask(same, viewpoint), expected)
    np.testing.assert_array_equal(scan, before)


def test_no_points_have_an_empty_mask():
    for empty in ([], np.empty((0, 3)), np.empty((0, 4), np.float32)):
        mask = visible_mask(empty, [0, 0, 0])
        assert (mask.shape, mask.dtype) == ((0,), np.bool_)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"cell_deg": 0.01}, "cell_deg must be from 0.05 to 10 degrees, got 0.01."),
        ({"cell_deg": 11}, "cell_deg must be from 0.05 to 10 degrees, got 11."),
        ({"cell_deg": "fine"}, "cell_deg must be a finite number (degrees), got 'fine'."),
        ({"tolerance_m": -1.0}, "tolerance_m must be 0 metres or more, got -1.0."),
        ({"tolerance_m": np.nan}, "tolerance_m must be a finite number (metres), got nan."),
        ({"tolerance_fraction": 1.0}, "must be 0 or more and less than 1, got 1.0."),
        ({"tolerance_fraction": -0.1}, "tolerance_fraction must be 0 or more and less than 1"),
    ],
)
def test_impossible_numbers_are_one_sentence(options, said):
    with pytest.raises(SettingsError) as raised:
        visible_mask(np.ones((2, 3)), [0, 0, 0], **options)
    assert said in str(raised.value)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("points", [np.ones(3), np.ones((2, 5)), np.ones((2, 3), int), [[1.0], []]])
def test_malformed_points_are_refused(points):
    with pytest.raises(PointsError):
        visible_mask(points, [0, 0, 0])
    with pytest.raises(PointsError):
        visible_mask(np.ones((2, 3)), [0, 0])


def test_a_frame_in_place_of_its_points_is_told():
    with pytest.raises(PointsError, match=r"pass frame\.points, not the frame"):
        visible_mask(Frame(0, np.ones((2, 3), np.float32)), [0, 0, 0])


def test_warming_up_compiles_the_mask_for_both_types():
    PARTS["sight lines"]()
    kernel = intervis.sight.depth_buffer.place_around
    compiled = len(kernel.signatures)
    for kind in (np.float32, np.float64):
        visible_mask(street_scan().astype(kind), [0, 0, 0])
    assert len(kernel.signatures) == compiled


@pytest.mark.realdata
@pytest.mark.parametrize("name", ["kitti_raw/2011_09_26", "pcd_drive"])
def test_real_scans_are_those_of_plain_numpy(name, shared_data):
    drive = open_drive(shared_data / name)
    points = drive[drive.frame_numbers[0]].points
    for viewpoint in ([5.0, 0.0, 0.0], [20.0, -4.0, 0.3], [0.0, 0.0, 0.0]):
        expected = numpy_mask(points, np.array(viewpoint))
        assert 0.2 < expected.mean() < 0.99
        np.testing.assert_array_equal(visible_mask(points, viewpoint), expected)
