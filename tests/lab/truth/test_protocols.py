"""Which scans each protocol gives to a method, and which it hides."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from intervis.errors import DriveError, SettingsError
from intervis.lab.truth.protocols import PROTOCOLS, checked_protocol, input_frames
from intervis.transform import rigid


def drive(*x_m, first=0):
    return {first + n: rigid(np.eye(3), [x, 0, 0]) for n, x in enumerate(x_m)}


def test_single_gives_one_scan():
    assert input_frames("single", drive(0, 1, 2, 3), 1, 3) == (1,)


def test_past_ends_with_scan_i_and_hides_the_reference():
    poses = drive(0, 1, 2, 3, 4)
    assert input_frames("past", poses, 2, 4) == (0, 1, 2)
    assert input_frames("past", poses, 4, 1) == (0, 2, 3, 4)


def test_map_leaves_out_scans_within_two_metres():
    poses = drive(0, 1, 2, 2.999, 4, 5, 6.1)
    assert input_frames("map", poses, 0, 4) == (0, 1, 2, 6)
    # distance in any direction; exactly 2 m is far enough
    assert input_frames("map", drive(0, 2, 4), 0, 1) == (0, 2)


def test_map_hides_scan_i_where_it_is_near():
    assert input_frames("map", drive(0, 1, 5), 0, 1) == (2,)


def test_frame_numbers_are_not_positions():
    poses = drive(0, 3, 6, first=177)
    assert input_frames("past", poses, 178, 179) == (177, 178)


@given(
    x=st.lists(st.floats(-20, 20), min_size=2, max_size=12),
    data=st.data(),
    protocol=st.sampled_from(PROTOCOLS),
)
def test_the_reference_is_never_an_input(x, data, protocol):
    poses = drive(*x)
    i = data.draw(st.sampled_from(sorted(poses)))
    j = data.draw(st.sampled_from(sorted(poses)).filter(lambda n: n != i))
    inputs = input_frames(protocol, poses, i, j)
    assert j not in inputs
    assert list(inputs) == sorted(set(inputs))
    if protocol == "past":
        assert max(inputs) == i
    if protocol == "map":
        assert all(abs(x[n] - x[j]) >= 2.0 for n in inputs)


def test_wrong_requests():
    with pytest.raises(SettingsError, match="single, past, map"):
        checked_protocol("future")
    with pytest.raises(DriveError, match="own reference"):
        input_frames("single", drive(0, 1), 1, 1)
    with pytest.raises(DriveError, match="frame 7 has no pose"):
        input_frames("single", drive(0, 1), 1, 7)
