"""Scan buffer: bounded, refined by later scans, and without ghosts for ever."""

import numpy as np
from made_scans import BOXES, GROUND_M, street_scan, turned

from intervis.sight import OCCLUDED, VISIBLE, Scene

CAR = np.array([[4.0, -3.0, GROUND_M, 6.0, -1.2, 0.4]])
WITH_CAR = np.vstack([BOXES, CAR])
BEFORE, BEHIND = np.array([2.0, -2.1, -0.6]), np.array([9.0, -2.1, -0.6])
COARSE = {"beams": 32, "step_deg": 0.4}


def state(scene: Scene) -> int:
    return int(scene.sight(BEFORE, BEHIND[None]).state[0])


def test_what_was_free_and_is_now_blocked_is_blocked():
    scene = Scene()
    for number in range(8):
        scene.add(street_scan(seed=number, **COARSE))
    assert state(scene) == VISIBLE
    for number in range(2):
        scene.add(street_scan(boxes=WITH_CAR, seed=20 + number, **COARSE))
    assert state(scene) == OCCLUDED


def test_a_car_that_left_leaves_no_ghost_for_ever():
    scene = Scene()
    for number in range(8):
        scene.add(street_scan(boxes=WITH_CAR, seed=number, **COARSE))
    assert state(scene) == OCCLUDED
    for number in range(6):
        scene.add(street_scan(seed=20 + number, **COARSE))
    assert state(scene) == VISIBLE


def test_a_moment_asks_the_scans_of_that_time():
    """The car came for a while: before, meanwhile and after are three different answers."""
    scene = Scene()
    for number in range(12):
        boxes = WITH_CAR if 4 <= number < 8 else BOXES
        scene.add(street_scan(boxes=boxes, seed=number, **COARSE), None, 0.5 * number)
    for moment_s, expected in ((0.5, VISIBLE), (2.8, OCCLUDED), (5.0, VISIBLE)):
        sight = scene.sight(BEFORE, BEHIND[None], moment_s=moment_s)
        assert sight.state[0] == expected, moment_s
        lines = scene.sight_lines(BEFORE[None], BEHIND[None], moment_s=moment_s)
        assert lines.probability[0] == sight.probability[0]
        _, _, near = scene.sight_within([BEFORE], [BEHIND], 50.0, moment_s=moment_s)
        assert near.probability[0] == sight.probability[0]


def test_stamps_may_come_in_any_order(rng):
    forward, backward = Scene(max_scans=5), Scene(max_scans=5)
    scans = [street_scan(boxes=WITH_CAR if n < 3 else BOXES, seed=n, **COARSE) for n in range(5)]
    for scene, numbers in ((forward, range(5)), (backward, reversed(range(5)))):
        for n in numbers:
            scene.add(scans[n], None, 0.5 * n)
    assert backward.timestamps_s.tolist() == [0.0, 0.5, 1.0, 1.5, 2.0]
    targets = rng.uniform([-5, -5, -1.5], [15, 5, 1.0], (500, 3))
    for moment_s in (None, 0.1, 2.4):
        one, other = (
            scene.sight(BEFORE, targets, moment_s=moment_s) for scene in (forward, backward)
        )
        assert np.array_equal(one.probability, other.probability)
    backward.add(street_scan(seed=9, **COARSE), None, 9.0)
    assert backward.timestamps_s.tolist() == [0.5, 1.0, 1.5, 2.0, 9.0], "the oldest one goes"


def test_a_second_pose_sees_behind_what_hid_from_the_first():
    a, b = np.array([12.0, 2.0, -0.8]), np.array([12.0, 6.5, -0.8])  # behind the first parked car
    scene = Scene()
    scene.add(street_scan(seed=0))
    assert scene.sight(a, b[None]).state[0] != VISIBLE
    for number, x in enumerate((11.0, 13.0, 12.0)):
        pose = turned(0.0, x, 0.0)
        scene.add(street_scan(pose, seed=1 + number), pose)
    assert scene.sight(a, b[None]).state[0] == VISIBLE


def test_memory_is_bounded_and_forgets_the_oldest_and_farthest():
    scene = Scene(max_scans=5)
    for number in range(12):
        pose = turned(0.0, 3.0 * number, 0.0)
        scene.add(street_scan(pose, **COARSE), pose)
        assert len(scene) <= 5
    assert scene.poses[:, 0, 3].tolist() == [21.0, 24.0, 27.0, 30.0, 33.0]


def test_a_near_old_scan_stays_where_a_far_younger_one_is_evicted():
    """Age alone would evict the first scan, distance alone the third."""
    scene = Scene(max_scans=4)
    for x in (0.0, 5.0, 60.0, 1.0, 2.0):
        pose = turned(0.0, x, 0.0)
        scene.add(street_scan(pose, **COARSE), pose)
    # age/max + distance/max from x = 2: 1 + 2/58, 3/4 + 3/58, 2/4 + 1, 1/4 + 1/58
    assert scene.poses[:, 0, 3].tolist() == [0.0, 5.0, 1.0, 2.0]


def test_memory_is_bounded_in_bytes():
    one = Scene()
    one.add(street_scan(**COARSE))
    scene = Scene(max_bytes=7 * one.bytes // 2)
    for number in range(8):
        pose = turned(0.0, 2.0 * number, 0.0)
        scene.add(street_scan(pose, **COARSE), pose)
        assert scene.bytes <= scene._buffer.max_bytes
    assert len(scene) == 3, "three and a half scans fit"


def test_forgetting_leaves_the_others_as_they_were(rng):
    """Answers after a long drive are those of a fresh scene with the scans that are left."""
    poses = [turned(0.1 * number, 2.0 * number, 0.3 * number) for number in range(9)]
    scans = [street_scan(pose, seed=n, **COARSE) for n, pose in enumerate(poses)]
    scans[4] = street_scan(poses[4], beams=48, step_deg=0.3)  # of another size
    scene = Scene(max_scans=4)
    for scan, pose in zip(scans, poses, strict=True):
        scene.add(scan, pose)
    fresh = Scene()
    for kept in scene.poses:
        number = next(n for n, pose in enumerate(poses) if np.array_equal(pose, kept))
        fresh.add(scans[number], poses[number])
    a, b = rng.normal(0, 15, (2, 500, 3)) * [1, 1, 0.1]
    assert np.array_equal(scene.sight_lines(a, b).probability, fresh.sight_lines(a, b).probability)


def test_a_scan_added_twice_counts_once(rng):
    scan, targets = street_scan(**COARSE), rng.normal(0, 15, (200, 3))
    once, twice = Scene.from_scan(scan), Scene.from_scan(scan)
    twice.add(scan)
    assert len(twice) == 1
    assert np.array_equal(
        once.sight([1.0, 0, 0], targets).probability, twice.sight([1.0, 0, 0], targets).probability
    )


def test_poses_move_the_scene(rng):
    """The same scan seen in a turned and shifted frame gives the same answers there."""
    scan, targets = street_scan(**COARSE), rng.normal(0, 15, (300, 3))
    pose = turned(np.pi / 2, 5.0, -3.0)
    here = Scene.from_scan(scan).sight([2.0, 1.0, 0.0], targets)
    moved = targets @ pose[:3, :3].T + pose[:3, 3]
    viewpoint = pose[:3, :3] @ [2.0, 1.0, 0.0] + pose[:3, 3]
    there = Scene.from_scan(scan, pose).sight(viewpoint, moved)
    # the ends may be ordered the other way round, and a return on the border of a cell of the
    # ground map may fall into the next one
    apart = np.abs(there.probability - here.probability)
    assert (apart < 2e-3).mean() > 0.99
    assert apart.max() < 0.05
    assert (there.state == here.state).mean() > 0.99
