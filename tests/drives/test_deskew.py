"""Deskewing: returns of a moving scanner against the walls that they lie on."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from intervis import open_drive
from intervis.drives.deskew import deskewed_points, point_times_ns
from intervis.drives.frame import Frame
from intervis.drives.pose_track import PoseTrack
from intervis.errors import DriveError
from intervis.transform import inverse, rigid, transform

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"
SWEEP_NS = 100_000_000


def pose_of(time_s: float) -> np.ndarray:
    """World from a scanner that drives at 20 m/s and turns by 30 degrees a second."""
    turn = Rotation.from_euler("z", 30.0 * time_s, degrees=True).as_matrix()
    return rigid(turn, [20.0 * time_s, 1.0, 1.8])


def sweep(start_ns: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points in the world, the same in the scanner's frame at their times, and the times."""
    rng = np.random.default_rng(4)
    world = rng.uniform([-20, -20, 0], [40, 20, 6], (500, 3))
    times_ns = start_ns + np.sort(rng.integers(0, SWEEP_NS, 500))
    seen = [transform(inverse(pose_of(1e-9 * t)), p) for t, p in zip(times_ns, world, strict=True)]
    return world, np.array(seen, np.float32), times_ns


TRACK_NS = np.arange(0, 10**9 + 1, 10**8)
TRACK = PoseTrack(TRACK_NS, [pose_of(1e-9 * t) for t in TRACK_NS])


@pytest.mark.parametrize("start_ns", [300_000_000, 930_000_000])  # the second ends past the poses
def test_returns_come_to_lie_where_they_were(start_ns: int) -> None:
    world, seen, times_ns = sweep(start_ns)
    frame = Frame(
        0,
        seen,
        {"time": 1e-9 * (times_ns - start_ns)},
        pose=pose_of(1e-9 * start_ns),
        timestamp_ns=start_ns,
        pose_track=TRACK,
    )
    skewed, deskewed = (transform(frame.pose, p) for p in (seen, frame.deskewed()))
    assert np.linalg.norm(skewed - world, axis=1).max() > 1.5
    # Positions go straight between poses 0.1 s apart, rotations exactly: below 1 mm here.
    assert np.linalg.norm(deskewed - world, axis=1).max() < 2e-3
    assert np.array_equal(frame.points, seen)


def test_many_times_are_rounded_below_a_millimetre() -> None:
    times_ns = 300_000_000 + np.arange(0, SWEEP_NS, 20_000)  # 5,000 of them
    seen = np.zeros((len(times_ns), 3), np.float32)
    at_scan = inverse(pose_of(0.3))
    path = [(at_scan @ pose_of(1e-9 * t))[:3, 3] for t in times_ns]
    found = deskewed_points(seen, times_ns, TRACK, 300_000_000)
    assert np.linalg.norm(found - path, axis=1).max() < 2e-3


def test_a_scan_beyond_the_poses_is_told() -> None:
    _, seen, times_ns = sweep(1_050_000_000)
    with pytest.raises(DriveError, match="do not cover the time"):
        deskewed_points(seen, times_ns, TRACK, 1_050_000_000)


@given(
    span_s=st.floats(2.1e-3, 1.9),
    unit=st.sampled_from([1e9, 1e6, 1e3, 1.0]),
    start_s=st.sampled_from([0.0, -0.05, 1_234.5, 1.6e9]),
    shift_s=st.floats(-0.5, 0.5),
)
def test_the_span_tells_the_unit(
    span_s: float, unit: float, start_s: float, shift_s: float
) -> None:
    offsets_s = np.array([0.0, 0.25, 1.0]) * span_s
    absolute = start_s == 1.6e9
    timestamp_ns = round((start_s + shift_s) * 1e9) if absolute else 77 * 10**9
    expected = (start_s + offsets_s) * 1e9 + (0 if absolute else timestamp_ns)
    if start_s == 1_234.5 and unit == 1e9:
        return  # on no clock of a scan: counts from a time that is not known
    found = point_times_ns({"timestamp": (start_s + offsets_s) * unit}, timestamp_ns)
    assert found is not None
    tolerance_ns = 1e9 * np.spacing(start_s + 2.0) * 4 + 2
    np.testing.assert_allclose(found, expected, rtol=0, atol=tolerance_ns)


def test_whole_nanoseconds_keep_every_digit() -> None:
    stamp = 1_700_000_000_123_456_789
    times = np.array([stamp, stamp + 1, stamp + 99_999_999], np.uint64)
    found = point_times_ns({"t": times}, stamp)
    assert found is not None
    assert found.tolist() == times.tolist()


@pytest.mark.parametrize(
    ("frame", "message"),
    [
        (Frame(3, np.zeros((2, 3), np.float32)), "needs a time of the scan and of each point"),
        (
            Frame(3, np.zeros((2, 3), np.float32), {"t": np.array([0, 5 * 10**7])}),
            "needs a time of the scan and of each point",
        ),
        (
            Frame(3, np.zeros((2, 3), np.float32), {"t": np.array([0, 5 * 10**7])}, timestamp_ns=1),
            "fewer than two poses",
        ),
        (
            Frame(
                3,
                np.zeros((2, 3), np.float32),
                {"t": np.array([5, 5])},
                timestamp_ns=1,
                pose_track=TRACK,
            ),
            "is that a sweep",
        ),
        (
            Frame(
                3,
                np.zeros((2, 3), np.float32),
                {"time": np.array([1e9, 1e9 + 0.1])},
                timestamp_ns=5 * 10**18,
            ),
            "on another clock",
        ),
    ],
)
def test_what_cannot_be_deskewed_is_told_in_a_sentence(frame: Frame, message: str) -> None:
    with pytest.raises(DriveError, match=message):
        frame.deskewed()


def test_points_that_were_moved_already_stay() -> None:
    points = np.ones((2, 3), np.float32)
    assert Frame(0, points, is_deskewed=True).deskewed() is points


@pytest.mark.realdata
def test_times_of_a_real_sweep() -> None:
    path = DATA / "opencalib" / "lidar2lidar" / "0001" / "top.pcd"
    if not path.is_file():
        pytest.skip(f"{path} is absent")
    drive = open_drive(path)
    frame = drive[drive.frame_numbers[0]]
    times_ns = frame.point_times_ns
    assert times_ns is not None
    assert 0.08e9 < np.ptp(times_ns) < 0.12e9  # ten turns a second


def test_times_that_are_all_zero_are_the_time_of_the_scan() -> None:
    assert point_times_ns({"offset_ns": np.zeros(3, np.int32)}, 7).tolist() == [7, 7, 7]
    with pytest.raises(DriveError, match="span 0"):
        point_times_ns({"offset_ns": np.full(3, 5)}, 7)
    with pytest.raises(DriveError, match="span 0"):
        point_times_ns({"offset_ns": np.zeros(3)}, None)


@pytest.mark.parametrize(
    ("span", "unit_ns"),
    [
        (2_000_000, 1),
        (1_999_999_999, 1),
        (1_999_999, 1_000),  # in ns too short for a sweep
        (2_000, 1_000),
        (1_999, 1_000_000),
        (2, 1_000_000),
        (1.999, 1_000_000_000),
        (0.002, 1_000_000_000),
        (2_000_000_000, None),
        (0.0019, None),
    ],
)
def test_a_sweep_takes_two_milliseconds_to_two_seconds(span: float, unit_ns: int | None) -> None:
    attributes = {"t": np.array([0, span])}
    if unit_ns is None:
        with pytest.raises(DriveError, match="in none of ns, us, ms and s"):
            point_times_ns(attributes, 7)
    else:
        assert point_times_ns(attributes, 7).tolist() == [7, 7 + round(span * unit_ns)]


@pytest.mark.parametrize(("start_s", "counts"), [(9_999, True), (10_000, False)])
def test_times_up_to_ten_thousand_seconds_count_from_the_scan(start_s: int, counts: bool) -> None:
    times = {"t": start_s * 10**9 + np.array([0, 10**8])}
    if counts:
        assert point_times_ns(times, 5).tolist() == (times["t"] + 5).tolist()
        assert point_times_ns(times, None) is None
    else:
        assert point_times_ns(times, None).tolist() == times["t"].tolist()
        assert point_times_ns(times, (start_s - 2) * 10**9).tolist() == times["t"].tolist()
        with pytest.raises(DriveError, match=r"begin 2\.0 s from the scan's time"):
            point_times_ns(times, (start_s - 2) * 10**9 - 1)


def test_a_point_without_a_time_has_that_of_the_first() -> None:
    seconds = np.array([0.05, np.nan, 0.02, 0.1, 0.0])
    times_ns = point_times_ns({"time": seconds}, 10**9)
    assert times_ns.tolist() == [10**9 + t * 10**7 for t in (5, 0, 2, 10, 0)]
