"""The street: the same for the same seed, with the stated dimensions, and free to drive."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from intervis.lab.worlds import shapes
from intervis.lab.worlds.street import terrain
from intervis.lab.worlds.street.centreline import Centreline
from intervis.lab.worlds.street.layout import build_street
from intervis.lab.worlds.triangles import LABELS, Material, Triangles
from intervis.transform import checked_pose, inverse, transform


def below(street, snapshot, points_velo, time_s: float):
    """Height (N,) of points above the surface below them, and the label of that surface."""
    pose = street.vehicle_pose_at(time_s)
    down = np.tile(-pose[:3, 2], (len(points_velo), 1))
    ranges, hits = snapshot.caster.closest(transform(pose, np.asarray(points_velo)), down)
    return ranges, snapshot.labels[hits]


def test_same_seed_same_street_other_seed_another(street, street_again) -> None:
    one, two, other = street, street_again, build_street(5)
    np.testing.assert_array_equal(one.static.corners, two.static.corners)
    np.testing.assert_array_equal(one.static.reflectances, two.static.reflectances)
    for mine, yours in zip(one.actors, two.actors, strict=True):
        np.testing.assert_array_equal(mine.triangles.corners, yours.triangles.corners)
        np.testing.assert_array_equal(mine.pose_at(1.3), yours.pose_at(1.3))
    assert one.static.corners.shape != other.static.corners.shape


def test_world_frame_is_the_first_sensor_frame(street) -> None:
    np.testing.assert_array_equal(street.vehicle_pose_at(0.0), np.eye(4))
    np.testing.assert_allclose(street.vehicle_pose_at(1e-9), np.eye(4), atol=1e-7)


def test_vehicle_drives_at_eight_to_ten_metres_a_second(street) -> None:
    poses = np.array([street.vehicle_pose_at(0.1 * number) for number in range(330)])
    for pose in poses:
        checked_pose(pose)
    steps = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1)
    assert steps.min() > 0.78
    assert steps.max() < 1.0
    # It moves along its heading within 1.5 degrees, with small accelerations.
    heading = np.einsum("fi,fi->f", np.diff(poses[:, :3, 3], axis=0), poses[:-1, :3, 0]) / steps
    assert heading.min() > np.cos(np.radians(1.5))
    assert np.linalg.norm(np.diff(poses[:, :3, 3], 2, axis=0), axis=1).max() < 0.05


@pytest.mark.parametrize("time_s", [0.0, 3.3, 11.0, 30.0])
def test_sensor_is_173_cm_above_the_road(street, time_s: float) -> None:
    height, label = below(street, street.at(time_s), [[0.0, 0, 0]], time_s)
    assert abs(height[0] - 1.73) < 0.02
    assert label[0] in (LABELS["road"], LABELS["marking"])


def test_profile_of_the_street(street) -> None:
    """Cross-section of the street: road, kerb, pavement."""
    # Straight down from 0.3 m above the road (below cars' bellies there is road as well), at a
    # place without furniture; the vehicle is 1.9 m right of the middle.
    snapshot = street.at(0.0)
    offsets = np.array([0.0, 1.4, 3.0, 5.96, 6.5, 7.6])
    places = np.stack([np.full(6, -3.0), offsets + 1.9, np.full(6, -1.73 + 0.3)], axis=1)
    height, label = below(street, snapshot, places, 0.0)
    step = 0.3 - height
    names = [next(name for name, value in LABELS.items() if value == part) for part in label]
    assert names[:3] == ["road"] * 3
    assert names[3:] == ["kerb", "sidewalk", "sidewalk"]
    np.testing.assert_allclose(step[:3], 0.0, atol=0.02)
    np.testing.assert_allclose(step[3:], 0.12, atol=0.03)


def test_the_route_is_free(street) -> None:
    """No triangle except the road's is inside the box of the vehicle, in any frame."""
    times_s = np.arange(0, 337, 5) * 0.1  # 4.4 m apart, for a box of 4.8 m
    poses = [street.vehicle_pose_at(time_s) for time_s in times_s]
    standing = ~np.isin(street.static.labels, [LABELS["road"], LABELS["marking"]])
    static = street.static.corners[standing]
    near = cKDTree(static[:, 0]).query_ball_point([pose[:3, 3] for pose in poses], 12.0)
    for time_s, pose, rows in zip(times_s, poses, near, strict=True):
        moving = [transform(a.pose_at(time_s), a.triangles.corners) for a in street.actors]
        local = transform(inverse(pose), np.concatenate([static[rows], *moving]))
        middles = np.concatenate([local.reshape(-1, 3), local.mean(axis=1)])
        inside = (np.abs(middles[:, 0]) < 2.4) & (np.abs(middles[:, 1]) < 1.0)
        assert not (inside & (middles[:, 2] < 0.4)).any(), time_s


def test_actors_keep_apart(street) -> None:
    """Cars and the cyclist never overlap."""
    cars = [actor for actor in street.actors if not actor.name.startswith("person")]
    for number in range(0, 337, 3):
        places = np.array([actor.pose_at(0.1 * number)[:3, 3] for actor in cars])
        gap = np.linalg.norm(places[:, None] - places[None], axis=2)
        along = np.abs((places[:, None] - places[None])[..., 0])
        close = (gap < 1.9) & (along < 4.0)
        assert not np.triu(close, 1).any(), number


def test_all_classes_and_actors_are_present(street, street_snapshot) -> None:
    for name in LABELS:
        if name != "none":
            assert (street_snapshot.labels == LABELS[name]).any(), name
    assert street_snapshot.labels.min() > 0
    names = [actor.name.split()[0] for actor in street.actors]
    assert names.count("car") >= 5
    assert names.count("person") >= 10
    assert street.last_s * 8.8 >= 200
    moved = street.at(1.7).triangles - street_snapshot.triangles
    still = street_snapshot.objects == 0
    assert not moved[still].any()
    for number in range(1, len(street.actors) + 1):
        own = street_snapshot.objects == number
        assert 0.5 < np.linalg.norm(moved[own], axis=2).max() < 12


def test_normals_of_a_snapshot_rotate_with_its_actors(street) -> None:
    snapshot = street.at(2.0)
    corners = snapshot.triangles
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1)
    solid = length > 1e-7
    np.testing.assert_allclose(
        normal[solid] / length[solid, None], snapshot.normals[solid], atol=1e-5
    )


def test_bridge_spans_the_road_with_room_under_it(street) -> None:
    centreline = Centreline(-110.0, 430.0)
    bridge = terrain.Bridge()
    caster = street.at(0.0).caster
    start = centreline.points(0.0, -1.9, 1.73)
    road = centreline.points(bridge.s, 0.0, 0.5) - start
    ranges, hits = caster.closest(road, [0.0, 0, 1.0])
    assert street.static.labels[hits[0]] == LABELS["bridge"]
    assert abs(ranges[0] + 0.5 - bridge.clearance_m) < 0.05
    ranges, _ = caster.closest(np.add(road, [0, 0, 20.0]), [0.0, 0, -1.0])
    assert abs(20.5 - ranges[0] - bridge.top_m) < 0.05


def test_centreline_lengths(rng) -> None:
    centreline = Centreline(-20.0, 120.0)
    s = np.arange(-20, 120, 0.01)
    points = centreline.points(s)
    level = np.linalg.norm(np.diff(points[:, :2], axis=0), axis=1)
    np.testing.assert_allclose(level, 0.01, rtol=1e-3)
    np.testing.assert_array_equal(centreline.points(0.0), [0.0, 0.0, 0.0])
    beyond = np.linalg.norm(
        np.diff(centreline.points([120.0, 130.0, 150.0])[:, :2], axis=0), axis=1
    )
    np.testing.assert_allclose(beyond, [10.0, 20.0], rtol=1e-3)
    pose = centreline.pose(33.0, 1.5, 0.2, 0.3)
    checked_pose(pose)
    np.testing.assert_allclose(pose[:3, 3], centreline.points(33.0, 1.5, 0.2))
    # The slope is the height's derivative.
    at = rng.uniform(0, 120, 50)
    difference = (centreline.height(at + 1e-4) - centreline.height(at - 1e-4)) / 2e-4
    np.testing.assert_allclose(centreline.slope(at), difference, atol=1e-5)


def test_rounding_twice_is_rounding_once(street) -> None:
    rng = np.random.default_rng(0)
    triangles = Triangles.of(rng.normal(size=(9, 3, 3)), Material("car", (0.1, 0.2, 0.3), 0.7))
    once = triangles.speckled(rng, 0.3).rounded()
    twice = once.rounded()
    np.testing.assert_array_equal(once.corners, twice.corners)
    np.testing.assert_array_equal(once.colours, twice.colours)
    np.testing.assert_array_equal(street.static.corners, street.static.corners.astype(np.float32))


def test_grids_face_up() -> None:
    s, d = np.arange(4.0)[:, None], np.arange(3.0)
    points = np.stack(np.broadcast_arrays(s, d, 0.0), axis=-1)
    pieces = shapes.grid(points)
    normal = np.cross(pieces[:, 1] - pieces[:, 0], pieces[:, 2] - pieces[:, 0])
    np.testing.assert_allclose(normal, np.tile([0, 0, 1.0], (12, 1)))
