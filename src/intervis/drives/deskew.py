"""Points of a moving scanner as from one place: each is moved by the motion until the scan's time.

A spinning scanner takes 0.05 to 0.1 s for a turn; at 30 m/s its returns come from places up to 3 m
apart. Where each return has a time and the poses have times, each return is moved into the
scanner's frame at the scan's time.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from intervis.arrays import Float32Array, Float64Array
from intervis.drives.pose_track import PoseTrack
from intervis.errors import DriveError
from intervis.transform import inverse

TIME_NAMES = (
    *("time_s", "offset_ns", "t", "time", "timestamp"),
    *("offset_time", "time_offset", "time_stamp", "timestamps"),
)
"""Names of the times of points in files, drivers and messages."""

SWEEP_S = (2e-3, 2.0)
"""A sweep takes that long: which of ns, us, ms and s the times are in follows from their span."""

UNITS_NS = (1, 1_000, 1_000_000, 1_000_000_000)

SINCE_START_S = 1e4
"""Smaller times count from the scan's time; larger ones are on the clock of the scan's time."""

MOST_STEPS = 2048
"""More times of a sweep are rounded to so many steps: below 1 mm at 30 m/s."""


def point_times_ns(
    attributes: Mapping[str, NDArray[Any]], timestamp_ns: int | None
) -> NDArray[np.int64] | None:
    """Times (N,) of points on the clock of the scan's time; None where none are given.

    Parameters
    ----------
    attributes : mapping of str to (N,) array
        Of the points; one of `TIME_NAMES` holds their times, in ns, us, ms or s, since the scan's
        time or since another start.
    timestamp_ns : int or None
        The scan's time. None: times that count from it have no meaning.

    Raises
    ------
    DriveError
        The times are no numbers, span no sweep in any unit, or lie more than a sweep from the
        scan's time.

    Examples
    --------
    Microseconds since the start of a sweep of 0.1 s:

    >>> point_times_ns({"t": np.array([0, 50_000, 100_000])}, 7_000_000_000)
    array([7000000000, 7050000000, 7100000000])
    """
    name = next((name for name in TIME_NAMES if name in attributes), None)
    if name is None or np.ndim(attributes[name]) != 1 or not len(attributes[name]):
        return None
    values = np.asarray(attributes[name])
    if values.dtype.kind not in "fiu":
        raise DriveError(f"the times {name!r} of the points are no numbers.")
    finite = np.isfinite(values)
    if not finite.any():
        return None
    first = values[finite].min()
    elapsed = np.where(finite, values, first) - first
    if timestamp_ns is not None and not values[finite].any():  # all at the scan's time
        return np.full(len(values), timestamp_ns, np.int64)
    unit_ns = _unit_ns(float(elapsed.max()), name)
    elapsed_ns = np.round(elapsed.astype(np.float64) * unit_ns).astype(np.int64)
    if abs(float(first)) * unit_ns < SINCE_START_S * 1e9:
        if timestamp_ns is None:
            return None
        return np.asarray(timestamp_ns + round(float(first) * unit_ns) + elapsed_ns)
    first_ns = int(first) * unit_ns + round(float(first - np.floor(first)) * unit_ns)
    if timestamp_ns is not None and abs(first_ns - timestamp_ns) > SWEEP_S[1] * 1e9:
        raise DriveError(
            f"the times {name!r} of the points begin {abs(first_ns - timestamp_ns) / 1e9:.1f} s"
            " from the scan's time: they are on another clock."
        )
    return np.asarray(first_ns + elapsed_ns)


def _unit_ns(span: float, name: str) -> int:
    """The unit in which a span is that of a sweep."""
    for unit_ns in UNITS_NS:
        if SWEEP_S[0] <= span * unit_ns * 1e-9 < SWEEP_S[1]:
            return unit_ns
    raise DriveError(
        f"the times {name!r} of the points span {span:g}: in none of ns, us, ms and s is that a"
        " sweep of 2 ms to 2 s."
    )


def deskewed_points(
    points: Float32Array, times_ns: NDArray[np.int64], track: PoseTrack, timestamp_ns: int
) -> Float32Array:
    """The points in the scanner's frame at the scan's time.

    Parameters
    ----------
    points : (N, 3) float32 array
        Each in the scanner's frame at its own time, metres.
    times_ns : (N,) int64 array
    track : PoseTrack
        World from the scanner. Before its first pose and after its last one the motion goes on as
        it was, for one spacing of the poses.
    timestamp_ns : int

    Raises
    ------
    DriveError
        The poses do not cover the times.

    Examples
    --------
    A scanner moves forward by 10 m in a second. It saw one wall at the beginning and at the end of
    0.1 s, 5 and 4 m away:

    >>> from intervis.transform import rigid
    >>> times_ns = np.array([0, 10**9])
    >>> track = PoseTrack(times_ns, [np.eye(4), rigid(np.eye(3), [10.0, 0, 0])])
    >>> points = np.array([[5.0, 0, 0], [4.0, 0, 0]], np.float32)
    >>> deskewed_points(points, np.array([0, 100_000_000]), track, 0)[:, 0]
    array([5., 5.], dtype=float32)
    """
    steps_ns, which = np.unique(times_ns, return_inverse=True)
    if len(steps_ns) > MOST_STEPS:
        first_ns, step_ns = int(steps_ns[0]), -(-int(np.ptp(steps_ns)) // MOST_STEPS)
        steps, which = np.unique((times_ns - first_ns) // step_ns, return_inverse=True)
        steps_ns = first_ns + steps * step_ns + step_ns // 2
    at_scan = inverse(_pose_at(track, timestamp_ns))
    motions = np.array([at_scan @ _pose_at(track, int(time_ns)) for time_ns in steps_ns])
    moved = np.einsum("nij,nj->ni", motions[which, :3, :3], points.astype(np.float64))
    return np.asarray(moved + motions[which, :3, 3], dtype=np.float32)


def _pose_at(track: PoseTrack, time_ns: int) -> Float64Array:
    pose = track.near(time_ns)
    if pose is None:
        raise DriveError(
            "the poses do not cover the time of the scan: points can be moved only between poses,"
            " and one spacing beyond them."
        )
    return pose
