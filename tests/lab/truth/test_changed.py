"""What changed between two scans, worked out on walls and posts."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from intervis.lab.truth.dynamic import changed_between, seen_through
from intervis.transform import inverse, transform

HERE = np.eye(4)


def wall(x=10.0, y=0.0, half=3.0, half_up=1.5, step=0.05):
    across, up = (grid.ravel() for grid in np.mgrid[-half:half:step, -half_up:half_up:step])
    return np.stack([np.full(up.size, x), y + across, up], axis=1)


def scan_of(place, blocks):
    """A scan from a place (3,): a wall, and blocks (x, y, half width) that hide some of it."""
    nearest = wall() - place
    for x, y, half in blocks:
        front = wall(x, y, half, 0.5) - place
        shrunk = nearest * ((x - place[0]) / nearest[:, :1])
        behind = (np.abs(shrunk[:, 1] + place[1] - y) < half) & (np.abs(shrunk[:, 2]) < 0.5)
        behind &= nearest[:, 0] > x - place[0]
        nearest = np.vstack([nearest[~behind], front])
    pose = np.eye(4)
    pose[:3, 3] = place
    return nearest, pose


def test_the_same_scan_sees_through_nothing_of_its_own():
    scan, pose = scan_of(np.zeros(3), [(5.0, 0.5, 0.4)])
    assert not seen_through(scan, pose, scan, pose).any()


def test_what_drove_off_was_seen_through_and_what_stands_was_not():
    before, pose = scan_of(np.zeros(3), [(5.0, -1.0, 0.3), (5.0, 1.0, 0.3)])
    after, later = scan_of(np.array([0.5, 0.2, 0.0]), [(5.0, 1.0, 0.3)])
    gone = seen_through(before, pose, after, later)
    left_block = (before[:, 0] == 5.0) & (before[:, 1] < 0)
    assert gone[left_block].all()
    assert not gone[~left_block].any()
    assert not seen_through(after, later, before, pose).any()


def test_lines_past_what_left_and_past_what_came_have_changed():
    before, pose = scan_of(np.zeros(3), [(5.0, -1.0, 0.3)])
    after, later = scan_of(np.array([0.5, 0.0, 0.0]), [(5.0, 1.0, 0.3)])
    viewpoint = later[:3, 3]
    targets = np.array([[9.9, -2.1, 0.0], [9.9, 2.1, 0.0], [9.9, 0.0, 0.0], [4.0, -0.777, 0.0]])
    changed = changed_between(viewpoint, targets, before, pose, after, later)
    assert changed.tolist() == [True, True, False, False]


@settings(max_examples=20)
@given(turn=st.floats(-3.0, 3.0), x=st.floats(-50.0, 50.0), y=st.floats(-50.0, 50.0))
def test_the_world_may_be_turned_and_moved(turn, x, y):
    c, s = np.cos(turn), np.sin(turn)
    world = np.array([[c, -s, 0, x], [s, c, 0, y], [0, 0, 1, 1.0], [0, 0, 0, 1]])
    before, pose = scan_of(np.zeros(3), [(5.0, -1.0, 0.3)])
    after, later = scan_of(np.array([0.5, 0.0, 0.0]), [])
    one = seen_through(before, pose, after, later)
    other = seen_through(before, world @ pose, after, world @ later)
    assert one.any()
    assert (one != other).mean() < 0.002  # ties at the edge of a degree may fall either way


@pytest.mark.parametrize("empty", [np.empty((0, 3)), np.full((4, 3), np.nan)])
def test_nothing_scanned_changes_nothing(empty):
    scan, pose = scan_of(np.zeros(3), [])
    assert not seen_through(empty, pose, scan, pose).any()
    assert not seen_through(scan, pose, empty, pose).any()
    targets = transform(inverse(pose), scan)
    assert not changed_between(np.zeros(3), targets, scan, pose, empty, HERE).any()
