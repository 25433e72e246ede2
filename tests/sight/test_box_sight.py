"""Objects in boxes: surfaces by geometry on paper, and shares by lines asked one by one."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from intervis.errors import PointsError, PoseError
from intervis.sight import Scene
from intervis.sight.box_surface import GROWN_M, facing_surfaces
from intervis.transform import inverse, rigid, transform

CAR_M = np.array([4.2, 1.8, 1.5])


def posed(x: float, y: float, z: float = -1.0, yaw_deg: float = 0.0) -> np.ndarray:
    return rigid(Rotation.from_euler("z", yaw_deg, degrees=True).as_matrix(), [x, y, z])


def wall(x_m: float, y_m: tuple[float, float], top_m: float = 0.5) -> np.ndarray:
    y, z = np.meshgrid(np.arange(*y_m, 0.05), np.arange(-1.8, top_m, 0.05))
    return np.stack([np.full(y.size, x_m), y.ravel(), z.ravel()], axis=1)


def street(*walls: np.ndarray) -> np.ndarray:
    """Walls on the ground of a scanner 1.8 m high, and a wall behind everything."""
    azimuth, range_m = np.meshgrid(np.radians(np.arange(-60, 60, 0.3)), np.geomspace(3, 40, 60))
    ground = np.stack([range_m * np.cos(azimuth), range_m * np.sin(azimuth)], axis=-1).reshape(
        -1, 2
    )
    points = [np.column_stack([ground, np.full(len(ground), -1.8)]), *walls]
    points.append(wall(45.0, (-60, 60), 6.0))
    every = np.concatenate(points)
    # What a scanner at the origin sees: the nearest return of each direction of 0.3 degrees.
    azimuth_deg = np.degrees(np.arctan2(every[:, 1], every[:, 0]))
    elevation_deg = np.degrees(np.arctan2(every[:, 2], np.hypot(every[:, 0], every[:, 1])))
    cell = np.floor(azimuth_deg / 0.3) * 10_000 + np.floor(elevation_deg / 0.3)
    order = np.lexsort((np.linalg.norm(every, axis=1), cell))
    first = np.append(True, np.diff(cell[order]) != 0)
    return every[order[first]]


@given(
    yaw_deg=st.floats(-180, 180),
    centre=st.tuples(*[st.floats(-30, 30)] * 3),
    size=st.tuples(*[st.floats(0.2, 8)] * 3),
    viewpoint=st.tuples(*[st.floats(-30, 30)] * 3),
)
@settings(deadline=None)
def test_points_lie_on_faces_that_face_the_viewpoint(yaw_deg, centre, size, viewpoint) -> None:
    pose, start = posed(*centre, yaw_deg), np.array(viewpoint)
    found = facing_surfaces(start, pose[None], np.array([size]))
    middle = pose @ rigid(np.eye(3), [0, 0, GROWN_M / 2])  # it is not grown downwards
    half_m = np.array(size) / 2 + GROWN_M * np.array([1, 1, 0.5])
    local, seen_from = (transform(inverse(middle), p) for p in (found.points, start))
    if (np.abs(seen_from) <= half_m).all():
        assert len(found.points) == 0
        return
    assert found.share.sum() == pytest.approx(1.0)
    assert (np.abs(local) <= half_m + 1e-9).all()
    on_face = np.abs(np.abs(local) - half_m) < 1e-9
    assert (on_face.sum(axis=1) == 1).all()
    # The line to a point stays outside the box: just before its end it is outside.
    before = local + 1e-6 * (seen_from - local)
    assert (np.abs(before) > half_m).any(axis=1).all()


def test_shares_follow_the_solid_angle() -> None:
    """Two faces of a cube, seen from 45 degrees, take equal shares; a near face takes more."""
    cube = np.full((1, 3), 2.0)
    found = facing_surfaces(np.array([-7.0, -7.0, 0.1]), np.eye(4)[None], cube)
    left = np.isclose(found.points[:, 0], -1.2)
    assert found.share[left].sum() == pytest.approx(0.5)
    # From 3 m away the middle of a face takes more than its corners, by the cube of the cosine.
    near = facing_surfaces(np.array([-3.0, 0, 0.1]), np.eye(4)[None], cube)
    range_m = np.linalg.norm(near.points - [-3.0, 0, 0.1], axis=1)
    np.testing.assert_allclose(near.share * range_m**3, near.share[0] * range_m[0] ** 3)
    # Exact: a face of 2 a x 2 b at distance d takes 4 asin(a b / sqrt((a^2 + d^2) (b^2 + d^2))).
    for distance_m in (1.8, 28.8):
        start = np.array([-1.2 - distance_m, 0, 0.1])
        one = facing_surfaces(start, np.eye(4)[None], cube)
        range_m = np.linalg.norm(one.points - start, axis=1)
        solid_angle = (distance_m / range_m**3).sum() * 2.4 * 2.2 / len(one.points)
        a, b, d = 1.2, 1.1, distance_m
        exact = 4 * np.arcsin(a * b / np.sqrt((a * a + d * d) * (b * b + d * d)))
        assert solid_angle == pytest.approx(exact, rel=5e-3)


def test_shares_are_means_over_lines_asked_one_by_one() -> None:
    scene = Scene.from_scan(street(wall(12.0, (-1.0, 9.0))))
    poses = np.array([posed(18, 1.0), posed(20, -5, yaw_deg=40.0), posed(8, 2), posed(25, 6)])
    seen = scene.sight_boxes([0, 0, 0.2], poses, np.tile(CAR_M, (4, 1)))
    for k, pose in enumerate(poses):
        surface = facing_surfaces(np.array([0, 0, 0.2]), pose[None], CAR_M[None])
        lines = [scene.sight([0, 0, 0.2], point[None]) for point in surface.points]
        state = np.array([line.state[0] for line in lines])
        probability = np.array([line.probability[0] for line in lines])
        assert seen.lines[k] == len(lines)
        for share, value in ((seen.visible, 1), (seen.occluded, 0), (seen.unknown, -1)):
            assert share[k] == pytest.approx(surface.share[state == value].sum())
        assert seen.probability[k] == pytest.approx(surface.share @ probability)
    total = seen.visible + seen.occluded + seen.unknown
    np.testing.assert_allclose(total, 1.0)


def test_a_wall_hides_the_car_behind_it_and_half_of_one_beside_it() -> None:
    """The wall ends at y = 0: seen from the origin, it hides the left half of a car ahead."""
    scene = Scene.from_scan(street(wall(10.0, (0.0, 9.0), 1.0)))
    poses = np.array([posed(20, 4), posed(20, 0), posed(20, -4)])
    seen = scene.sight_boxes([0.0, 0, 0], poses, np.tile(CAR_M, (3, 1)))
    assert seen.occluded[0] > 0.95
    assert seen.visible[2] > 0.95
    assert 0.35 < seen.visible[1] < 0.6
    assert 0.3 < seen.occluded[1] < 0.6
    # What hides them stands at x = 10.
    np.testing.assert_allclose(seen.blocker[:2, 0], 10.0, atol=0.3)
    assert np.isnan(seen.blocker[2]).all()


def test_the_own_returns_of_a_car_do_not_hide_it() -> None:
    back = wall(18.0, (-0.9, 0.9), -0.3)  # the back of a car whose box reaches from 17.9 to 22.1
    scene = Scene.from_scan(street(back))
    seen = scene.sight_boxes([0.0, 0, 0], [posed(20, 0, -1.05)], [CAR_M])
    assert seen.visible[0] > 0.9
    assert seen.occluded[0] < 0.05


def test_a_box_around_the_viewpoint_has_no_share() -> None:
    scene = Scene.from_scan(street())
    seen = scene.sight_boxes([0, 0, 0], [np.eye(4), posed(10, 0)], [CAR_M, CAR_M])
    assert np.isnan([seen.visible[0], seen.occluded[0], seen.unknown[0], seen.probability[0]]).all()
    assert seen.lines[0] == 0
    assert seen.visible[1] > 0.9
    assert repr(seen) == "<BoxSight: 2 boxes, 1 at least half visible>"


def test_no_boxes_have_an_answer() -> None:
    seen = Scene.from_scan(street()).sight_boxes([0, 0, 0], np.empty((0, 4, 4)), np.empty((0, 3)))
    assert len(seen) == 0


@pytest.mark.parametrize(
    ("poses", "sizes", "error", "message"),
    [
        ([np.eye(4)], [[4, 2, -1]], PointsError, "positive and finite"),
        ([np.eye(4)], [[4, 2, np.nan]], PointsError, "positive and finite"),
        ([np.eye(4)], [[4, 2, 1], [4, 2, 1]], PointsError, "1 poses and 2 sizes"),
        ([2 * np.eye(4)], [[4, 2, 1]], PoseError, "no? ?rigid motion|not a rigid motion"),
    ],
)
def test_boxes_that_make_no_sense_are_told(poses, sizes, error, message) -> None:
    with pytest.raises(error, match=message):
        Scene.from_scan(street()).sight_boxes([0, 0, 0], poses, sizes)


def test_boxes_need_a_size_each():
    with pytest.raises(ValueError, match="is longer than"):
        facing_surfaces(np.zeros(3), np.eye(4)[None], np.ones((2, 3)))
