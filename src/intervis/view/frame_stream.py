"""Frames of a drive, judged a few at a time, for everything that shows them."""

import logging
from collections import deque
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, Protocol

from intervis.arrays import Float64Array
from intervis.drives import Drive
from intervis.errors import ScanError
from intervis.kernels import thread_count
from intervis.progress import Progress, reporter
from intervis.view.frame_judge import frame_judge
from intervis.view.judged_frame import JudgedFrame
from intervis.view.view_request import ViewRequest, fixed_place_world, viewpoint_in_frame

log = logging.getLogger(__name__)

MOST_THREADS = 4
"""Frames that are judged at a time: each takes some 100 MB."""


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
    report = reporter(progress)
    fixed_world = None
    if request.is_fixed:
        fixed_world = fixed_place_world(drive[numbers[0]], request.viewpoint)

    def prepared(number: int) -> list[Any]:
        judged = judged_frame(drive, number, request, fixed_world)
        return [sink.prepare(judged) for sink in sinks]

    threads = min(thread_count(), MOST_THREADS)
    waiting, begun = deque(numbers), deque[tuple[int, Future[list[Any]]]]()
    taken, unreadable = 0, None
    with ThreadPoolExecutor(threads) as pool:
        try:
            while waiting or begun:
                # One more than there are threads, so that none waits for a sink.
                while waiting and len(begun) <= threads:
                    begun.append((waiting[0], pool.submit(prepared, waiting.popleft())))
                number, one = begun.popleft()
                try:
                    parts = one.result()
                except ScanError as error:
                    log.warning("frame %d is left out: %s", number, error)
                    unreadable = unreadable or error
                else:
                    taken += 1
                    for sink, part in zip(sinks, parts, strict=True):
                        sink.add(part)
                report(f"frame {number}")
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    if unreadable is not None and not taken:
        raise unreadable


def judged_frame(
    drive: Drive, number: int, request: ViewRequest, fixed_world: Float64Array | None = None
) -> JudgedFrame:
    """One frame of a drive as the requested viewpoint sees it.

    Parameters
    ----------
    drive : Drive
    number : int
    request : ViewRequest
    fixed_world : (3,) float64 array or None
        A viewpoint in world coordinates instead of that of the request.

    Raises
    ------
    DriveError
        The frame cannot be read, has no camera or no pose where the request needs one.
    """
    judge = frame_judge(drive, number, request)
    viewpoint = viewpoint_in_frame(judge.frame, request.viewpoint, fixed_world)
    return judge.judged(viewpoint)
