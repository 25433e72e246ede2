"""A stretch of a run: frames that one worker analyses in order, and writes."""

import logging
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from intervis.errors import IntervisError, MissingExtraError, OutputError, SettingsError
from intervis.method.analysis import Analysis, analyze
from intervis.method.granularity import TauHysteresis
from intervis.run.frame_file import (
    FrameRecord,
    frame_fingerprint,
    frame_path,
    load_record,
    save_frame,
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

    Raises
    ------
    SettingsError, MissingExtraError
        Every frame would fail in the same way.
    OutputError
        A file cannot be written.
    """
    granularity = TauHysteresis(stretch.settings) if chooses_tau(stretch.settings) else None
    compiled = False
    for number in stretch.numbers:
        path = frame_path(stretch.out, number)
        try:
            frame = stretch.drive[number]
            fingerprint = _fingerprint(frame, stretch)
            record, reason = _record_of_earlier_run(path, fingerprint)
            if record is None:
                if not compiled:  # compile the kernels that these frames need before timing
                    _analyze(frame, stretch, granularity)
                    compiled = True
                analysis = _analyze(frame, stretch, granularity)
                sight = _sight(frame, stretch, analysis)
        except (SettingsError, MissingExtraError):
            raise
        except IntervisError as error:
            yield FrameFailure(number, str(error))
        except Exception as error:
            log.debug("frame %d failed", number, exc_info=True)
            yield FrameFailure(number, f"unexpected {type(error).__name__}: {error}")
        else:
            if record is None:
                yield save_frame(
                    *(path, frame, analysis, fingerprint),
                    sight=sight,
                    compress=stretch.compress,
                    remade=reason,
                )
                continue
            if granularity is not None:  # a resumed run chooses tau as an uninterrupted one
                granularity.tau = record.tau
            yield record


def process(stretch: Stretch) -> list[Outcome]:
    """Analyse a stretch, as a worker of an executor does; see `outcomes`."""
    return list(outcomes(stretch))


def _analyze(frame: "Frame", stretch: Stretch, granularity: TauHysteresis | None) -> Analysis:
    return analyze(
        frame.points,
        camera=frame.camera,
        cam_from_velo=frame.cam_from_velo,
        viewpoint=stretch.viewpoint.in_frame(frame),
        settings=stretch.settings,
        tau_for=granularity.choose if granularity is not None else None,
    )


def _sight(frame: "Frame", stretch: Stretch, analysis: Analysis) -> FrameSight | None:
    if stretch.sight is None:
        return None
    start = stretch.sight.start(stretch.drive, frame, analysis.viewpoint)
    return sight_of_scan(frame.points, start, stretch.sight.risk)


def _fingerprint(frame: "Frame", stretch: Stretch) -> str:
    """Digest of the frame and the run; sight lines from the next place depend on its pose."""
    asked: list[object] = []
    if stretch.sight is not None:
        asked.append(stretch.sight.described())
        if stretch.sight.place == "next":
            start = stretch.sight.start(stretch.drive, frame, np.zeros(3))
            asked.append(None if start is None else start.tolist())
    return frame_fingerprint(frame, stretch.settings, stretch.viewpoint.requested, asked)


def _record_of_earlier_run(path: Path, fingerprint: str) -> tuple[FrameRecord | None, str]:
    """The record of a file that still holds the frame; else the reason why the file does not."""
    if not path.exists():
        return None, ""
    try:
        return load_record(path, fingerprint), ""
    except OutputError as error:
        return None, str(error)
