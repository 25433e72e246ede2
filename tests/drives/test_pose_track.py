"""Poses between others, and one spacing beyond them: places on a line, on paper."""

import numpy as np
import pytest

from intervis.drives.pose_track import PoseTrack, nearest_time
from intervis.transform import rigid

TIMES_NS = np.array([0, 1000, 3000, 9000])
"""Spacings of 1000 before, of 6000 behind."""
PLACES_M = [0.0, 4.0, 10.0, 40.0]


def track(within_ns=10_000, last=4):
    poses = [rigid(np.eye(3), [place, 1.0, 2.0]) for place in PLACES_M]
    return PoseTrack(TIMES_NS[:last], poses[:last], within_ns)


def place_of(pose):
    return None if pose is None else pose[:3, 3].tolist()


@pytest.mark.parametrize(
    ("time_ns", "at_m", "near_m"),
    [
        (-1001, None, None),
        (-1000, None, -4.0),  # one spacing before, at 4 m in 1000 ns
        (-1, None, -0.004),
        (0, 0.0, 0.0),
        (250, 1.0, 1.0),
        (1000, 4.0, 4.0),
        (2000, 7.0, 7.0),
        (8999, 39.995, 39.995),
        (9000, 40.0, 40.0),
        (9001, None, 40.005),  # 30 m in 6000 ns
        (15_000, None, 70.0),
        (15_001, None, None),
    ],
)
def test_places_at_and_near_a_time(time_ns, at_m, near_m):
    for found, expected in ((track().at(time_ns), at_m), (track().near(time_ns), near_m)):
        if expected is None:
            assert found is None
        else:
            assert place_of(found) == pytest.approx([expected, 1.0, 2.0])


@pytest.mark.parametrize(("within_ns", "is_bridged"), [(6000, True), (5999, False)])
def test_the_widest_gap_that_is_bridged(within_ns, is_bridged):
    one = track(within_ns)
    for found in (one.at(5000), one.near(5000), one.near(9100)):
        assert (found is not None) == is_bridged
    assert place_of(one.at(2000)) == pytest.approx([7.0, 1.0, 2.0])


@pytest.mark.parametrize(("count", "near_m"), [(0, None), (1, None), (2, 5.0), (3, 4.75)])
def test_a_motion_needs_two_poses(count, near_m):
    """At 1250: beyond the first two, a motion of 4 m in 1000 ns; between the second and third."""
    found = track(last=count).near(1250)
    assert place_of(found) == (None if near_m is None else pytest.approx([near_m, 1.0, 2.0]))


@pytest.mark.parametrize(
    ("times_ns", "within_ns"),
    [
        ([], 10**9),
        ([5], 10**9),
        ([0, 333_333_333], 10**9),
        ([0, 400_000_000], 1_200_000_000),
        ([0, 10**9, 5 * 10**9], 7_500_000_000),
    ],
)
def test_poses_are_bridged_over_a_second_or_three_spacings(times_ns, within_ns):
    poses = [np.eye(4)] * len(times_ns)
    assert PoseTrack.over_gaps(np.array(times_ns, np.int64), poses).within_ns == within_ns
    assert PoseTrack(np.array(times_ns, np.int64), poses).within_ns == 1_000_000_000


@pytest.mark.parametrize(
    ("time_ns", "place"),
    [(-51, None), (-50, 0), (0, 0), (49, 0), (51, 1), (149, 1), (151, 2), (250, 2), (251, None)],
)
def test_the_nearest_of_three_times(time_ns, place):
    assert nearest_time([0, 100, 200], time_ns, 50) == place


def test_the_nearest_of_no_times_and_of_one():
    assert nearest_time([], 7, 50) is None
    assert nearest_time([57], 7, 50) == 0
    assert nearest_time([58], 7, 50) is None
