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


def ring_at(x):
    """A small scan at (x, 0, 0): one ring, 10 m around."""
    azimuth = np.radians(np.arange(0.0, 360.0, 2.0))
    ring = np.stack([10 * np.cos(azimuth), 10 * np.sin(azimuth), 0 * azimuth], axis=1)
    return ring, turned(0.0, x, 0.0)


def test_a_scene_holds_64_scans_unless_told_otherwise():
    scene = Scene()
    for x in range(66):
        scene.add(*ring_at(0.5 * x))
    assert len(scene) == 64


def test_one_scan_is_kept_however_little_memory_is_allowed():
    scene = Scene(max_bytes=1)
    for x in range(3):
        scene.add(*ring_at(x))
        assert len(scene) == 1
    assert scene.poses[0, 0, 3] == 2.0


def test_the_pool_grows_by_half():
    """Slots for 1, 2, 4 and 7 scans, and no more than the scene may hold."""
    alone = Scene()
    alone.add(*ring_at(0.0))
    ground_bytes = 128 * 128 * 4
    slot_bytes = alone.bytes - ground_bytes
    scene = Scene(max_scans=6)
    slots = []
    for x in range(8):
        scene.add(*ring_at(x))
        slots.append((scene.bytes - len(scene) * ground_bytes) / slot_bytes)
    assert slots == [1, 2, 4, 4, 6, 6, 6, 6]


def test_packed_scans_are_those_of_the_scene():
    scene = Scene()
    for x in (3.0, 5.0, 9.0):
        scene.add(*ring_at(x), 10.0 * x)
    packed = scene.packed_scans()
    assert packed.position.tolist() == [[3.0, 0, 0], [5.0, 0, 0], [9.0, 0, 0]]
    assert packed.sensor_from_scene.shape == (3, 3, 4)
    assert packed.sensor_from_scene[1, :, 3].tolist() == [-5.0, 0, 0]
    assert packed.age_cost_m.tolist() == [0.0] * 3
    assert np.isnan(packed.time_offset_s).all()
    timed = scene.packed_scans(60.0)
    assert timed.time_offset_s.tolist() == [-30.0, -10.0, 30.0]
    assert timed.age_cost_m.tolist() == [600.0, 200.0, 600.0]  # 20 m a second


def test_scans_at_poses_a_micrometre_apart_are_one():
    ring, pose = ring_at(0.0)
    for apart_m, scans in ((0.9e-6, 1), (1.1e-6, 2)):
        scene = Scene()
        scene.add(ring, pose)
        moved = pose.copy()
        moved[1, 3] -= apart_m
        scene.add(ring, moved)
        assert len(scene) == scans
    scene = Scene()
    scene.add(ring, pose)
    scene.add(1.01 * ring, pose)
    scene.add(ring[:-1], pose)
    assert len(scene) == 3, "other returns at the same pose"


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
    assert (apart < 2e-3).mean() >= 0.99
    assert apart.max() < 0.05
    assert (there.state == here.state).mean() > 0.98


def test_scans_without_returns_change_no_answer(rng):
    """A blank scan and one whose returns are all too near take no weight from the others."""
    targets = rng.normal(0, 12, (500, 3)) * [1, 1, 0.1]
    scene, with_blanks = Scene(sensor="HDL-64E"), Scene(sensor="HDL-64E")
    with_blanks.add(np.empty((0, 3)), turned(0.0, 0.1, 0.0), 0.05)
    for number in range(3):
        pose = turned(0.0, 0.5 * number, 0.0)
        scene.add(street_scan(pose, seed=number, **COARSE), pose, 0.1 * number)
        with_blanks.add(street_scan(pose, seed=number, **COARSE), pose, 0.1 * number)
        with_blanks.add(rng.normal(0, 1e-3, (200, 3)), pose, 0.1 * number + 0.04)
    assert len(with_blanks) > len(scene)
    for moment_s in (None, 0.12):
        one = scene.sight(BEFORE, targets, moment_s=moment_s)
        other = with_blanks.sight(BEFORE, targets, moment_s=moment_s)
        assert np.array_equal(one.probability, other.probability)
        assert np.array_equal(one.state, other.state)


def test_a_scene_of_blank_scans_knows_nothing():
    scene = Scene()
    scene.add(np.empty((0, 3)))
    assert scene.sight(BEFORE, BEHIND[None]).observed[0] == 0.0
