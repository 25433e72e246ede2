"""Answers do not hang on how a scan is sent, nor on how the scanner is mounted."""

import numpy as np
import pytest
from made_scans import BOXES, GROUND_M, clear, directions, ranges, seen_from, street_scan, turned

from intervis import Scene
from intervis.sight.occupancy_model import DEFAULT_THRESHOLDS

COARSE = {"beams": 32, "step_deg": 0.4}


def free_lines(rng, count):
    """Lines between free points of the street, and whether they are clear."""
    points = rng.uniform([-15, -8, GROUND_M + 0.1], [25, 7, 0.5], (4 * count, 3))
    inside = np.zeros(len(points), bool)
    for box in BOXES:
        inside |= ((points > box[:3] - 0.1) & (points < box[3:] + 0.1)).all(axis=1)
    free = points[~inside]
    return free[:count], free[count : 2 * count]


@pytest.fixture(scope="module")
def scan():
    return street_scan(**COARSE)


@pytest.fixture(scope="module")
def lines():
    return free_lines(np.random.default_rng(5), 1000)


@pytest.fixture(scope="module")
def plain(scan, lines):
    return Scene.from_scan(scan).sight_lines(*lines)


def agreement(sight, plain):
    return float((sight.state == plain.state).mean())


SENT = {
    "copies": lambda scan, rng: np.vstack([scan, scan[::2], scan[::3]]),
    "rows of zeros": lambda scan, rng: np.vstack([scan, np.zeros((2 * len(scan), 3), scan.dtype)]),
    "a stray": lambda scan, rng: np.vstack([np.float32([[9e5, 2e5, 50.0]]), scan]),
    "another order": lambda scan, rng: rng.permutation(scan),
}


@pytest.mark.parametrize("kind", SENT)
def test_answers_do_not_hang_on_how_a_scan_is_sent(kind, scan, lines, plain, rng):
    sight = Scene.from_scan(SENT[kind](scan, rng)).sight_lines(*lines)
    assert agreement(sight, plain) > 0.98


MOUNTS = {
    "turned": turned(0.7, 0.0, 0.0)[:3, :3],
    "upside down": np.diag([1.0, -1.0, -1.0]),
    "rolled by 45 degrees": np.array(
        [[1, 0, 0], [0, np.sqrt(0.5), -np.sqrt(0.5)], [0, np.sqrt(0.5), np.sqrt(0.5)]]
    ),
}


@pytest.mark.parametrize("mount", MOUNTS)
def test_the_same_returns_from_a_scanner_mounted_otherwise(mount, scan, lines, plain):
    """The returns are given in the frame of a turned scanner, together with its pose."""
    pose = np.eye(4)
    pose[:3, :3] = MOUNTS[mount]
    sight = Scene.from_scan(seen_from(pose, scan), pose).sight_lines(*lines)
    assert agreement(sight, plain) > 0.9
    truth = clear(*lines)
    assert truth[sight.visible].mean() > 0.95
    assert (~truth[sight.occluded]).mean() > 0.95


def test_a_shift_of_the_world_changes_nothing(scan, lines, plain):
    shift = np.array([120.0, -45.0, 7.0])
    pose = np.eye(4)
    pose[:3, 3] = shift
    sight = Scene.from_scan(scan, pose).sight_lines(lines[0] + shift, lines[1] + shift)
    assert agreement(sight, plain) > 0.98


def test_a_cut_of_azimuth_changes_no_line_within_what_is_left(scan, lines):
    """Lines from the scanner: they leave no column of the range image."""
    azimuth_deg = np.degrees(np.arctan2(scan[:, 1], scan[:, 0]))
    cut = scan[np.abs(azimuth_deg) < 40.0]
    targets = lines[1]
    inside = np.abs(np.degrees(np.arctan2(targets[:, 1], targets[:, 0]))) < 37.0
    assert inside.sum() > 100
    whole = Scene.from_scan(scan).sight(np.zeros(3), targets[inside])
    left = Scene.from_scan(cut).sight(np.zeros(3), targets[inside])
    moved = np.abs(left.probability - whole.probability)
    assert (moved < 0.01).mean() > 0.99
    # States change where a probability lies that near to a threshold, and hardly anywhere else.
    limits = [limit for limit in DEFAULT_THRESHOLDS if 0.0 < limit < 1.0]
    near = (np.abs(whole.probability[:, None] - limits) < 0.01).any(axis=1)
    assert agreement(left[~near], whole[~near]) > 0.99


def test_a_scanner_sees_its_own_returns_in_every_direction():
    """In a closed room, straight up included."""
    room = np.array([[-8.0, -6.0, -1.8, 8.0, 6.0, 4.0]])
    rays = directions(-60.0, 89.0, 150, 1.0)
    scale = np.abs(np.where(rays > 0, room[0, 3:], -room[0, :3]) / np.maximum(np.abs(rays), 1e-12))
    points = rays * scale.min(axis=1)[:, None]
    sight = Scene.from_scan(points).sight(np.zeros(3), points)
    assert sight.visible.mean() > 0.99


def test_ground_that_nobody_saw_occludes_nothing():
    """A scanner on a roof: lines along the street below its edge were not observed."""
    roof = np.array([[-20.0, -20.0, -13.7, 2.0, 20.0, -1.7]])
    rays = directions(-60.0, 10.0, 64, 0.5)
    range_m = ranges(np.zeros(3), rays, roof, ground_m=-13.7)
    points = rays[range_m < 80.0] * range_m[range_m < 80.0, None]
    y = np.linspace(-10.0, 10.0, 50)
    starts = np.stack([np.full(50, 3.0), y, np.full(50, -12.5)], axis=1)
    ends = np.stack([np.full(50, 7.5), -y, np.full(50, -12.0)], axis=1)
    assert clear(starts, ends, roof, ground_m=-13.7).all()
    assert not Scene.from_scan(points).sight_lines(starts, ends).occluded.any()


def test_a_single_ring_occludes():
    """A wall 5 m ahead, seen by one ring in the plane of the lines."""
    azimuth = np.radians(np.arange(-60.0, 60.0, 0.5))
    ring = np.stack([np.full(len(azimuth), 5.0), 5.0 * np.tan(azimuth), 0.0 * azimuth], axis=1)
    y = np.linspace(-3.0, 3.0, 40)
    starts = np.stack([np.full(40, 1.0), y, np.zeros(40)], axis=1)
    through = np.stack([np.full(40, 9.0), y, np.zeros(40)], axis=1)
    before = np.stack([np.full(40, 4.0), y, np.zeros(40)], axis=1)
    scene = Scene.from_scan(ring)
    assert not scene.sight_lines(starts, through).visible.any()
    assert not scene.sight_lines(starts, before).occluded.any()


def test_lines_leave_the_ground_that_they_end_on(scan):
    """From a metre above the ground to returns of the ground, far away: a grazing angle."""
    on_ground = scan[(np.abs(scan[:, 2] - GROUND_M) < 0.1) & (np.abs(scan[:, 1]) < 2.5)]
    near = on_ground[(on_ground[:, 0] > 8.0) & (on_ground[:, 0] < 20.0)].astype(np.float64)
    start = np.array([1.0, 0.0, GROUND_M + 1.0])
    assert clear(np.broadcast_to(start, near.shape), near + np.array([0.0, 0.0, 0.06])).all()
    sight = Scene.from_scan(scan).sight(start, near)
    assert sight.occluded.mean() < 0.02
