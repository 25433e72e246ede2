"""A drive replayed in real time through a `Stream`, and how long its scans and answers take."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from intervis.arguments import is_count, shown
from intervis.arrays import Float64Array, finite_rows
from intervis.drives import Drive, Frame
from intervis.errors import DriveError, SettingsError
from intervis.kernels import thread_count
from intervis.live.stream import Stream
from intervis.progress import Progress, reporter
from intervis.sight.query_checks import rate_of
from intervis.transform import transform

TARGET_SHARES = (0.5, 1.5)
"""Targets lie on the way from the sensor to a return, at such shares of its range."""

LATE_S = 0.005
"""A scan that is pushed so much later than it was due is late."""


@dataclass(frozen=True, eq=False)
class Replay:
    """What a replay took, for each of F frames, in seconds.

    Attributes
    ----------
    numbers : tuple of int
        The frames that were replayed.
    ingest_s : (F,) array
        From a scan's points to the scene that holds it.
    sight_s : (F,) array
        The sight lines of one scan.
    delay_s : (F,) array
        From the moment at which a scan was due to its answers: what a vehicle would wait.
    late : int
        Number of scans that were pushed later than they were due.
    skipped : mapping of int to str
        Frames that were not replayed, and why.
    sights : int
        Sight lines for each scan.
    scans_per_s : float
        Mean rate of the scans.
    """

    numbers: tuple[int, ...]
    ingest_s: Float64Array
    sight_s: Float64Array
    delay_s: Float64Array
    late: int
    skipped: Mapping[int, str]
    sights: int
    scans_per_s: float

    def as_dict(self) -> dict[str, Any]:
        """All of it for a JSON file: quantiles in milliseconds."""
        return {
            "schema": 1,
            "frames": len(self.numbers),
            "scans_per_s": round(self.scans_per_s, 3),
            "sights_per_scan": self.sights,
            "threads": thread_count(),
            **{name: quantiles_ms(getattr(self, f"{name[:-3]}_s")) for name in QUANTITIES},
            "late": self.late,
            "skipped": {str(number): reason for number, reason in self.skipped.items()},
        }


QUANTITIES = {
    "ingest_ms": "ingest of a scan",
    "sight_ms": "sight lines of a scan",
    "delay_ms": "from the scan's time to its answers",
}
"""What is measured, by its name in a JSON file."""


def quantiles_ms(values_s: Float64Array) -> dict[str, float]:
    """Median, 99th percentile and maximum in milliseconds."""
    p50, p99 = (float(1e3 * np.percentile(values_s, share)) for share in (50, 99))
    largest = float(1e3 * values_s.max())
    return {"p50": round(p50, 3), "p99": round(p99, 3), "max": round(largest, 3)}


def replay(
    drive: Drive,
    numbers: Sequence[int],
    *,
    rate: float = 1.0,
    scans_per_s: float | None = None,
    sights: int = 5000,
    stream: Stream | None = None,
    progress: Progress | None = None,
    clock: Callable[[], float] = time.perf_counter,
    sleep: Callable[[float], None] = time.sleep,
) -> Replay:
    """Push the scans of a drive at their times, and ask sight lines after each.

    The lines run from the sensor to random points around its returns. A frame is read before it is
    due; that does not count. Kernels are compiled before the first one.

    Parameters
    ----------
    drive : Drive
    numbers : sequence of int
        Frame numbers.
    rate : float
        How many times faster than it was recorded.
    scans_per_s : float, optional
        Rate of the scans where the drive has no times; at `rate` 1.
    sights : int
        Sight lines for each scan.
    stream : Stream, optional
        Where the scans go; default: a new one.
    progress : function, optional
    clock, sleep : functions
        Seconds now, and waiting for some seconds.

    Raises
    ------
    DriveError
        The drive has no poses, or no times and no `scans_per_s` is given, or none of its frames
        could be replayed.
    SettingsError
        A number is out of range.
    """
    rate = rate_of("rate", rate)
    scans_per_s = None if scans_per_s is None else rate_of("the scans a second", scans_per_s)
    if not is_count(sights):
        raise SettingsError(f"sights must be a whole number of 1 or more, got {shown(sights)}.")
    due_s = _due_times_s(drive, numbers, rate, scans_per_s)
    if not drive.poses:
        raise DriveError(f"{drive.name} has no poses: a replay registers its scans by them.")
    stream = Stream() if stream is None else stream
    rng = np.random.default_rng(0)
    taken: list[tuple[float, float, float]] = []
    skipped: dict[int, str] = {}
    done, late, start_s = [], 0, None
    for number in numbers:
        frame = _readable(drive, number, skipped)
        if frame is not None:
            targets = _targets(frame, sights, rng)
            if start_s is None:
                _compile(frame, targets)
                start_s = clock() - due_s[number]
            due = start_s + due_s[number]
            sleep(max(0.0, due - clock()))
            began = clock()
            late += began > due + LATE_S
            stream.push(frame.points, frame.pose, due_s[number] * rate)
            pushed = clock()
            assert frame.pose is not None
            stream.sight(frame.pose[:3, 3], targets)
            answered = clock()
            taken.append((pushed - began, answered - pushed, answered - due))
            done.append(number)
        reporter(progress)(f"frame {number}")
    if not done:
        reason = next(iter(skipped.values()), "it has none")
        raise DriveError(f"no frame of {drive.name} could be replayed: {reason}")
    span_s = due_s[done[-1]] - due_s[done[0]]
    mean = (len(done) - 1) / span_s if span_s > 0 else 0.0
    ingest_s, sight_s, delay_s = np.array(taken).T
    return Replay(tuple(done), ingest_s, sight_s, delay_s, late, skipped, sights, mean)


def _due_times_s(
    drive: Drive, numbers: Sequence[int], rate: float, scans_per_s: float | None
) -> dict[int, float]:
    """When each frame is due, seconds after the first; never before the frame before it."""
    if scans_per_s is not None:
        return {number: nth / (scans_per_s * rate) for nth, number in enumerate(numbers)}
    if any(number not in drive.timestamps_ns for number in numbers):
        raise DriveError(
            f"{drive.name} has no times: give the rate of its scans, for example --hz 10."
        )
    times_ns = np.array([drive.timestamps_ns[number] for number in numbers], np.int64)
    due_s = np.maximum.accumulate(1e-9 * (times_ns - times_ns[0]).astype(np.float64) / rate)
    return dict(zip(numbers, due_s.tolist(), strict=True))


def _readable(drive: Drive, number: int, skipped: dict[int, str]) -> Frame | None:
    """A frame with a pose and returns; None, and the reason, where it is none."""
    try:
        frame = drive[number]
    except DriveError as error:
        skipped[number] = str(error)
        return None
    if frame.pose is None:
        skipped[number] = "its pose is not known."
    elif not finite_rows(frame.points).any():
        skipped[number] = "it has no returns."
    return None if number in skipped else frame


def _targets(frame: Frame, count: int, rng: np.random.Generator) -> Float64Array:
    """(count, 3) points on the ways to random returns of a scan, before and behind them."""
    points = frame.points[finite_rows(frame.points)]
    chosen = points[rng.integers(0, len(points), count)].astype(np.float64)
    assert frame.pose is not None
    return transform(frame.pose, chosen * rng.uniform(*TARGET_SHARES, (count, 1)))


def _compile(frame: Frame, targets: Float64Array) -> None:
    """Compile all kernels: with the frame in a stream of its own."""
    stream = Stream()
    for time_s in (0.0, 0.1):
        stream.push(frame.points, frame.pose, time_s)
        stream.sight(targets[0], targets)
