"""Frames of a drive, judged a few at a time, for everything that shows them."""

import logging
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, Protocol

from intervis.arrays import Float64Array
from intervis.drives import Drive
from intervis.errors import OutputError, ScanError
from intervis.kernels import thread_count
from intervis.progress import Progress, reporter
from intervis.view.frame_judge import MOST_THREADS, ReadFrame, cached_reader, frame_judge
from intervis.view.judged_frame import JudgedFrame
from intervis.view.view_request import ViewRequest, fixed_place_world, viewpoint_in_frame

log = logging.getLogger(__name__)


class FrameSink(Protocol):
    """Takes judged frames: a page or a recording."""

    def prepare(self, judged: JudgedFrame) -> Any:
        """What the sink needs of a frame; called in one of several threads."""

    def add(self, prepared: Any) -> None:
        """Take what `prepare` made; called in the order of the frames."""


def judge_frames(
    drive: Drive,
    numbers: Sequence[int],
    request: ViewRequest,
    sinks: Sequence[FrameSink],
    progress: Progress | None = None,
) -> None:
    """Judge frames of a drive, each once, and hand them to all sinks in order.

    Only a few frames are in memory at a time. Scans that cannot be read are left out, with a
    warning.

    Parameters
    ----------
    drive : Drive
    numbers : sequence of int
        Frame numbers, one or more.
    request : ViewRequest
    sinks : sequence of FrameSink
    progress : callable, optional
        Called after each frame.

    Raises
    ------
    DriveError
        A frame lacks the camera or the pose that the request needs, or no scan can be read.
    """
    fixed_world = None
    if request.is_fixed:
        fixed_world = fixed_place_world(drive[numbers[0]], request.viewpoint)
    read = cached_reader(drive, request)
    stream_frames(
        lambda number: judged_frame(drive, number, request, fixed_world, read),
        numbers,
        sinks,
        progress,
    )


def stream_frames(
    judge: Callable[[int], JudgedFrame],
    numbers: Sequence[int],
    sinks: Sequence[FrameSink],
    progress: Progress | None = None,
) -> list[int]:
    """Judge a few frames at a time, ahead of the sinks, which take them in order.

    Parameters
    ----------
    judge : callable
        The judged frame of a number; called in one of several threads. Frames for which it raises
        `ScanError` (the scan) or `OutputError` (the file of a run) are left out, with a warning.
    numbers : sequence of int
    sinks : sequence of FrameSink
    progress : callable, optional

    Returns
    -------
    list of int
        The frames that were left out.

    Raises
    ------
    ScanError, OutputError
        All frames are left out: of the first one.
    """
    report = reporter(progress)

    def prepared(number: int) -> list[Any]:
        judged = judge(number)
        return [sink.prepare(judged) for sink in sinks]

    threads = min(thread_count(), MOST_THREADS)
    waiting, begun = deque(numbers), deque[tuple[int, Future[list[Any]]]]()
    left_out: dict[int, ScanError | OutputError] = {}
    with ThreadPoolExecutor(threads) as pool:
        try:
            while waiting or begun:
                # One more than there are threads, so that none waits for a sink.
                while waiting and len(begun) <= threads:
                    begun.append((waiting[0], pool.submit(prepared, waiting.popleft())))
                number, one = begun.popleft()
                try:
                    parts = one.result()
                except (ScanError, OutputError) as error:
                    log.warning("frame %d is left out: %s", number, error)
                    left_out[number] = error
                else:
                    for sink, part in zip(sinks, parts, strict=True):
                        sink.add(part)
                report(f"frame {number}")
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    if left_out and len(left_out) == len(numbers):
        raise next(iter(left_out.values()))
    return list(left_out)


def judged_frame(
    drive: Drive,
    number: int,
    request: ViewRequest,
    fixed_world: Float64Array | None = None,
    read: ReadFrame | None = None,
) -> JudgedFrame:
    """One frame of a drive as the requested viewpoint sees it.

    Parameters
    ----------
    drive : Drive
    number : int
    request : ViewRequest
    fixed_world : (3,) float64 array or None
        A viewpoint in world coordinates instead of that of the request.
    read : callable or None
        Reads a frame of the drive; see `cached_reader`.

    Raises
    ------
    DriveError
        The frame cannot be read, has no camera or no pose where the request needs one.
    """
    judge = frame_judge(drive, number, request, read)
    viewpoint = viewpoint_in_frame(judge.frame, request.viewpoint, fixed_world)
    return judge.judged(viewpoint)
