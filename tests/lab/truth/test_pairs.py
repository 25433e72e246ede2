"""Default pairs of frames, and pairs parsed from text."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from intervis import open_drive
from intervis.errors import DriveError, SettingsError
from intervis.lab.truth.pairs import checked_poses, default_pairs, parsed_pairs
from intervis.lab.truth.protocols import distance_m
from intervis.transform import rigid

PUBLIC = ((0, 5), (0, 10), (0, 20), (10, 2), (5, 21), (20, 5))


def along(x_m, first=0):
    return {first + n: rigid(np.eye(3), [x, 0, 0]) for n, x in enumerate(x_m)}


@pytest.mark.realdata
def test_the_public_pairs_are_the_default_pairs(shared_data):
    drive = open_drive(shared_data / "pcd_drive")
    assert default_pairs(drive.poses) == PUBLIC


@given(
    steps=st.lists(st.floats(0, 3), min_size=1, max_size=200),
    first=st.integers(0, 1000),
)
def test_pairs_are_4_to_16_m_apart(steps, first):
    poses = along(np.cumsum(steps), first)
    pairs = default_pairs(poses)
    assert pairs == default_pairs(dict(reversed(poses.items())))
    assert len(set(pairs)) == len(pairs) <= 24
    for i, j in pairs:
        assert 3.0 <= distance_m(poses[i], poses[j]) <= 20.0


def test_two_frames_give_a_pair():
    assert default_pairs(along([0.0, 4.0])) == ((0, 1),)


def test_long_drives_are_covered_from_start_to_end():
    pairs = default_pairs(along(0.8 * np.arange(1000)))
    assert len(pairs) == 24
    assert min(min(pair) for pair in pairs) == 0
    assert max(max(pair) for pair in pairs) > 970


def test_a_standing_drive_has_no_pairs():
    assert default_pairs(along(np.zeros(50))) == ()
    assert default_pairs(along([0.0])) == ()
    assert default_pairs({}) == ()


@pytest.mark.parametrize("text", ["", "0", "0:", ":5", "0-5", "0:5,", "0:5;1:6", "a:b", "-1:5"])
def test_wrong_pairs_are_refused(text):
    with pytest.raises(SettingsError, match="0:5,0:10"):
        parsed_pairs(text)


@pytest.mark.parametrize("poses", [None, {}, {3: np.eye(4)}])
def test_poses_are_required(poses):
    with pytest.raises(DriveError, match=r"poses\.txt"):
        checked_poses(poses, "drive")
