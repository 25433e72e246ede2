"""A stretch of a run: frames that one worker analyses in order, and writes.

While a frame is analysed, one thread reads the next one and another writes the file of the last
one. Kernels, file system and digests release the interpreter lock; kernels spread over plain
threads, so any thread may call them (`intervis.kernels`). Two scans are held at a time. With one
thread, as in a worker of many, all is done in turn.
"""

import logging
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from intervis.errors import IntervisError, MissingExtraError, OutputError, SettingsError
from intervis.kernels import thread_count
from intervis.method.analysis import Analysis, analyze
from intervis.method.granularity import TauHysteresis
from intervis.run.frame_file import (
    FrameFile,
    FrameRecord,
    frame_file,
    frame_fingerprint,
    frame_path,
    load_record,
)
from intervis.run.frame_sight import FrameSight, SightRequest, sight_of_scan
from intervis.run.viewpoint import MetaViewpoint
from intervis.settings import Settings

if TYPE_CHECKING:
    from intervis.drives import Drive, Frame

log = logging.getLogger(__name__)

FRAMES = 16
"""Frames of a stretch: seconds of work, so that a lost worker costs little."""


@dataclass(frozen=True)
class FrameFailure:
    """A frame without a result, and the error message as its reason."""

    number: int
    reason: str


Outcome = FrameRecord | FrameFailure


@dataclass(frozen=True)
class Stretch:
    """Frames to analyse in order, and all that a worker in another process needs for it.

    Attributes
    ----------
    drive : Drive
        The drive.
    numbers : sequence of int
        Frame numbers.
    out : Path
        Output folder of the run.
    settings : Settings
        Settings of the method.
    viewpoint : MetaViewpoint
        P0 of the frames.
    compress : bool
        Deflate the frame files.
    sight : SightRequest or None
        Sight lines to ask in every frame.
    """

    drive: "Drive"
    numbers: Sequence[int]
    out: Path
    settings: Settings
    viewpoint: MetaViewpoint
    compress: bool = False
    sight: SightRequest | None = None


def stretches_of(whole: Stretch, frames: int = FRAMES) -> list[Stretch]:
    """Parts of a stretch that do not depend on each other.

    With ``tau="auto"`` the tau of a frame depends on the frame before it: the part is the whole.
    """
    if chooses_tau(whole.settings):
        return [whole]
    starts = range(0, len(whole.numbers), frames)
    return [replace(whole, numbers=whole.numbers[k : k + frames]) for k in starts]


def chooses_tau(settings: Settings) -> bool:
    """Whether tau is chosen for each frame."""
    return settings.tau == "auto" and settings.sampling != "radius"


def outcomes(stretch: Stretch) -> Iterator[Outcome]:
    """Analyse the frames of a stretch, write their files, and yield what became of each.

    A frame whose file was written from the same input with the same settings is not computed again.
    An outcome is yielded when its file is written. Where the iteration ends early, a file that is
    being written is completed.

    Raises
    ------
    SettingsError, MissingExtraError
        Every frame would fail in the same way.
    OutputError
        A file cannot be written.
    """
    files = ThreadPoolExecutor(2, "intervis-files") if thread_count() > 1 else _InTurn()
    behind: Future[FrameRecord] | None = None
    try:
        ahead, analyst = _Ahead(stretch, files), _Analyst(stretch)
        for number in stretch.numbers:
            outcome = analyst.outcome(number, ahead)
            if behind is not None:
                yield behind.result()
                behind = None
            if isinstance(outcome, FrameFile):
                behind = files.submit(outcome.write)
            else:
                yield outcome
        if behind is not None:
            yield behind.result()
    finally:
        if behind is not None:
            wait([behind])
        files.shutdown(wait=True, cancel_futures=True)  # also while a frame is read


def process(stretch: Stretch) -> list[Outcome]:
    """Analyse a stretch, as a worker of an executor does; see `outcomes`."""
    return list(outcomes(stretch))


@dataclass(frozen=True, eq=False)
class _ReadFrame:
    """A frame, the digest of its input, and the record of an earlier run or why there is none."""

    frame: "Frame"
    fingerprint: str
    earlier: FrameRecord | None
    remade: str


class _InTurn(Executor):
    """Does what is submitted at once."""

    def submit(self, work: Callable[..., Any], /, *arguments: Any, **options: Any) -> "Future[Any]":
        """Do it; an error is that of the result."""
        done: Future[Any] = Future()
        try:
            done.set_result(work(*arguments, **options))
        except Exception as error:
            done.set_exception(error)
        return done


class _Ahead:
    """The frames of a stretch, read by another thread, one ahead of the one that is taken."""

    def __init__(self, stretch: Stretch, files: Executor) -> None:
        self._stretch, self._files = stretch, files
        self._numbers = iter(stretch.numbers)
        self._next: Future[_ReadFrame] | None = self._started()

    def take(self) -> _ReadFrame:
        """The next frame, or the error that reading it raised."""
        taken = self._next
        assert taken is not None, "more frames are taken than there are"
        wait([taken])
        self._next = self._started()
        return taken.result()

    def _started(self) -> "Future[_ReadFrame] | None":
        number = next(self._numbers, None)
        return None if number is None else self._files.submit(_read, self._stretch, number)


def _read(stretch: Stretch, number: int) -> _ReadFrame:
    """Read a frame, and what an earlier run left of it."""
    frame = stretch.drive[number]
    fingerprint = input_fingerprint(
        stretch.drive, frame, stretch.settings, stretch.viewpoint.requested, stretch.sight
    )
    path = frame_path(stretch.out, number)
    return _ReadFrame(frame, fingerprint, *_record_of_earlier_run(path, fingerprint))


class _Analyst:
    """Analyses the frames of a stretch in order: tau of a frame may depend on those before."""

    def __init__(self, stretch: Stretch) -> None:
        self._stretch = stretch
        self._granularity = (
            TauHysteresis(stretch.settings) if chooses_tau(stretch.settings) else None
        )
        self._compiled = False

    def outcome(self, number: int, ahead: _Ahead) -> Outcome | FrameFile:
        """Take a frame and analyse it, unless an earlier run has: the file is yet to be written."""
        try:
            read = ahead.take()
            if read.earlier is not None:
                self._learn(read.earlier)
                return read.earlier
            if not self._compiled:  # compile the kernels that these frames need before timing
                self._analyze(read.frame)
                self._compiled = True
            analysis = self._analyze(read.frame)
            file = frame_file(
                frame_path(self._stretch.out, number),
                read.frame,
                analysis,
                read.fingerprint,
                sight=_sight(read.frame, self._stretch, analysis),
                compress=self._stretch.compress,
                remade=read.remade,
            )
        except (SettingsError, MissingExtraError):
            raise
        except IntervisError as error:
            return FrameFailure(number, str(error))
        except Exception as error:
            log.debug("frame %d failed", number, exc_info=True)
            return FrameFailure(number, f"unexpected {type(error).__name__}: {error}")
        self._learn(file.record)
        return file

    def _analyze(self, frame: "Frame") -> Analysis:
        return analyze(
            frame.points,
            camera=frame.camera,
            cam_from_velo=frame.cam_from_velo,
            viewpoint=self._stretch.viewpoint.in_frame(frame),
            settings=self._stretch.settings,
            tau_for=self._granularity.choose if self._granularity is not None else None,
        )

    def _learn(self, record: FrameRecord) -> None:
        """Note tau and time of a frame: a resumed run chooses tau as an uninterrupted one."""
        if self._granularity is not None and record.tau is not None:
            self._granularity.learn(
                int(record.measures["n_fov"]), record.tau, 1e3 * record.times_s["total"]
            )


def _sight(frame: "Frame", stretch: Stretch, analysis: Analysis) -> FrameSight | None:
    if stretch.sight is None:
        return None
    start = stretch.sight.start(stretch.drive, frame, analysis.viewpoint)
    return sight_of_scan(frame.points, start, stretch.sight.risk)


def input_fingerprint(
    drive: "Drive",
    frame: "Frame",
    settings: Settings,
    viewpoint: str | Sequence[float],
    sight: SightRequest | None,
) -> str:
    """Digest of a frame and a run; sight lines from the next place depend on its pose.

    Parameters
    ----------
    drive : Drive
    frame : Frame
    settings : Settings
    viewpoint : str or sequence of float
        As it was asked for.
    sight : SightRequest or None

    Raises
    ------
    DriveError
        Sight lines from the next place are asked, and a pose is missing.
    """
    asked: list[object] = []
    if sight is not None:
        asked.append(sight.described())
        if sight.place == "next":
            start = sight.start(drive, frame, np.zeros(3))
            asked.append(None if start is None else start.tolist())
    return frame_fingerprint(frame, settings, viewpoint, asked)


def _record_of_earlier_run(path: Path, fingerprint: str) -> tuple[FrameRecord | None, str]:
    """The record of a file that still holds the frame; else the reason why the file does not."""
    if not path.exists():
        return None, ""
    try:
        return load_record(path, fingerprint), ""
    except OutputError as error:
        return None, str(error)
