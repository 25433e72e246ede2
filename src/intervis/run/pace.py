"""The pace of a run: how fast frames came, and which of them took longer than the budget."""

from collections.abc import Callable, Sequence
from time import perf_counter
from typing import Any

from intervis.run.frame_file import FrameRecord
from intervis.run.stretch import Outcome, chooses_tau
from intervis.run.summary import spread
from intervis.settings import Settings


class Pace:
    """Times at which the outcomes of a run come, reading and writing of files included.

    Only frames that this run computed count. The first one compiles kernels and is left out, and
    so is one after a frame that failed or that an earlier run had written. A frame comes when the
    next one has been analysed; the last one comes as soon as it is written, and is left out, too.

    Parameters
    ----------
    one_by_one : bool
        Frames come one by one. False: executors return them by stretches, so that the time between
        two frames means nothing; the rate is that of all frames since the beginning.
    clock : function
        Seconds.

    Examples
    --------
    >>> pace = Pace(clock=iter([0.0, 9.0, 9.5, 10.0, 10.01]).__next__)
    >>> for number in range(4):
    ...     pace.note(FrameRecord(number, {}, {}))
    >>> pace.as_dict()["frames_per_s"]
    2.0
    """

    def __init__(
        self, *, one_by_one: bool = True, clock: Callable[[], float] = perf_counter
    ) -> None:
        self._one_by_one, self._clock = one_by_one, clock
        self._start_s = self._last_s = clock()
        self._last_computed = self._ends_with_interval = False
        self._computed = 0
        self._intervals_s: list[float] = []

    def note(self, outcome: Outcome) -> None:
        """Note that an outcome has come."""
        now_s = self._clock()
        computed = isinstance(outcome, FrameRecord) and not outcome.reused
        self._ends_with_interval = computed and self._last_computed
        if self._ends_with_interval:
            self._intervals_s.append(now_s - self._last_s)
        self._computed += computed
        self._last_s, self._last_computed = now_s, computed

    def as_dict(self) -> dict[str, Any] | None:
        """Entry ``rate`` of the summary; None where too few frames were computed."""
        intervals_s = self._intervals_s if self._one_by_one else []
        if self._ends_with_interval:
            intervals_s = intervals_s[:-1]
        frames = len(intervals_s) if self._one_by_one else self._computed
        seconds = sum(intervals_s) if self._one_by_one else self._last_s - self._start_s
        if frames == 0 or seconds <= 0.0:
            return None
        return {
            "frames": frames,
            "seconds": seconds,
            "frames_per_s": frames / seconds,
            "interval_s": spread(intervals_s) if intervals_s else None,
        }


def budget_kept(records: Sequence[FrameRecord], settings: Settings) -> dict[str, Any] | None:
    """Entry ``budget`` of the summary: the frames that took longer; None without a budget.

    The time of a frame is that from its raw scan to its region, ``times_s["total"]``.

    Examples
    --------
    >>> settings = Settings(tau="auto", time_budget_ms=10.0)
    >>> budget_kept([FrameRecord(7, {}, {"total": 0.012}, tau=3)], settings)["missed_frames"]
    [7]
    """
    budget_ms = settings.time_budget_ms
    if budget_ms is None or not chooses_tau(settings):
        return None
    missed = [record.number for record in records if 1e3 * record.times_s["total"] > budget_ms]
    return {
        "budget_ms": budget_ms,
        "frames": len(records),
        "missed": len(missed),
        "missed_frames": missed,
    }
