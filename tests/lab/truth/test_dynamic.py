"""Dynamic returns and sight lines between two scans of walls and posts."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from intervis.lab.truth.dynamic import dynamic_lines, dynamic_returns
from intervis.transform import inverse, transform

HERE = np.eye(4)


def wall(x=10.0, y=0.0, half=3.0, half_up=1.5, step=0.05):
    sideways, up = (grid.ravel() for grid in np.mgrid[-half:half:step, -half_up:half_up:step])
    return np.stack([np.full(up.size, x), y + sideways, up], axis=1)


def scan_of(place, blocks):
    """A scan from a place (3,): a wall, and blocks (x, y, half width) that occlude parts of it."""
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


def test_a_scan_has_no_dynamic_returns_against_itself():
    scan, pose = scan_of(np.zeros(3), [(5.0, 0.5, 0.4)])
    assert not dynamic_returns(scan, pose, scan, pose).any()


def test_an_object_that_left_is_dynamic_and_one_that_stays_is_not():
    before, pose = scan_of(np.zeros(3), [(5.0, -1.0, 0.3), (5.0, 1.0, 0.3)])
    after, later = scan_of(np.array([0.5, 0.2, 0.0]), [(5.0, 1.0, 0.3)])
    disappeared = dynamic_returns(before, pose, after, later)
    left_block = (before[:, 0] == 5.0) & (before[:, 1] < 0)
    assert disappeared[left_block].all()
    assert not disappeared[~left_block].any()
    assert not dynamic_returns(after, later, before, pose).any()


def test_lines_past_disappeared_and_appeared_objects_are_dynamic():
    before, pose = scan_of(np.zeros(3), [(5.0, -1.0, 0.3)])
    after, later = scan_of(np.array([0.5, 0.0, 0.0]), [(5.0, 1.0, 0.3)])
    viewpoint = later[:3, 3]
    targets = np.array([[9.9, -2.1, 0.0], [9.9, 2.1, 0.0], [9.9, 0.0, 0.0], [4.0, -0.777, 0.0]])
    dynamic = dynamic_lines(viewpoint, targets, before, pose, after, later)
    assert dynamic.tolist() == [True, True, False, False]


def fan(angles_deg, range_m):
    """Returns around the x axis, at angles from it in degrees."""
    angles = np.radians(np.asarray(angles_deg, float))
    return np.column_stack([np.cos(angles), np.sin(angles), np.zeros(len(angles))]) * range_m


AHEAD = np.array([[20.0, 0, 0]])


@pytest.mark.parametrize(
    ("other", "expected"),
    [
        (fan(np.linspace(-0.9, 0.9, 6), 30.0), True),
        (fan(np.linspace(-0.9, 0.9, 5), 30.0), False),  # too few beams
        # beams at 1 degree or farther are ignored
        (fan([*np.linspace(-0.9, 0.9, 5), 0.99], 30.0), True),
        (fan([*np.linspace(-0.9, 0.9, 5), 1.01], 30.0), False),
        (np.vstack([fan(np.linspace(-0.9, 0.9, 6), 30.0), fan([0.99], 19.0)]), False),
        (np.vstack([fan(np.linspace(-0.9, 0.9, 6), 30.0), fan([1.01], 19.0)]), True),
        # beyond: 1 m + 2 % of the range
        (fan(np.linspace(-0.9, 0.9, 6), 21.39), False),
        (fan(np.linspace(-0.9, 0.9, 6), 21.41), True),
        # the 24 nearest beams decide
        (np.vstack([fan(np.linspace(-0.8, 0.8, 23), 30.0), fan([0.9], 19.0)]), False),
        (np.vstack([fan(np.linspace(-0.8, 0.8, 24), 30.0), fan([0.9], 19.0)]), True),
    ],
)
def test_limits_of_dynamic_returns(other, expected):
    assert dynamic_returns(AHEAD, HERE, other, HERE).tolist() == [expected]


@pytest.mark.parametrize(
    ("obstacle", "expected"),
    [
        (fan([0.39], 10.0), True),
        (fan([0.41], 10.0), False),
        (fan([0.1], 19.9), True),
        (fan([0.1], 20.1), False),  # behind the target
    ],
)
def test_limits_of_dynamic_lines(obstacle, expected):
    # scan i holds the obstacle alone; all beams of scan j around it end 50 m away
    scan_j = fan(np.linspace(-0.5, 0.9, 15), 50.0)
    found = dynamic_lines(np.zeros(3), AHEAD, obstacle, HERE, scan_j, HERE)
    assert found.tolist() == [expected]
    swapped = dynamic_lines(np.zeros(3), AHEAD, scan_j, HERE, obstacle, HERE)
    assert swapped.tolist() == [expected]


@settings(max_examples=20)
@given(turn=st.floats(-3.0, 3.0), x=st.floats(-50.0, 50.0), y=st.floats(-50.0, 50.0))
def test_the_result_does_not_depend_on_the_world_frame(turn, x, y):
    c, s = np.cos(turn), np.sin(turn)
    world = np.array([[c, -s, 0, x], [s, c, 0, y], [0, 0, 1, 1.0], [0, 0, 0, 1]])
    before, pose = scan_of(np.zeros(3), [(5.0, -1.0, 0.3)])
    after, later = scan_of(np.array([0.5, 0.0, 0.0]), [])
    one = dynamic_returns(before, pose, after, later)
    other = dynamic_returns(before, world @ pose, after, world @ later)
    assert one.any()
    assert (one != other).mean() < 0.002  # rounding decides at the 1 degree limit


@pytest.mark.parametrize("empty", [np.empty((0, 3)), np.full((4, 3), np.nan)])
def test_empty_scans_have_no_dynamic_returns(empty):
    scan, pose = scan_of(np.zeros(3), [])
    assert not dynamic_returns(empty, pose, scan, pose).any()
    assert not dynamic_returns(scan, pose, empty, pose).any()
    targets = transform(inverse(pose), scan)
    assert not dynamic_lines(np.zeros(3), targets, scan, pose, empty, HERE).any()
