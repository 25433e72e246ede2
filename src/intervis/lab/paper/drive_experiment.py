"""A drive through the paper's experiments: one frame in full, and the frames around it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from intervis.errors import IntervisError
from intervis.lab.paper.claims import Claim, check_claims
from intervis.lab.paper.experiment import (
    FrameExperiment,
    Step,
    run_frame,
    steps_of_frame,
)
from intervis.lab.paper.temporal_consistency import Steadiness, follow_drive
from intervis.settings import Settings

if TYPE_CHECKING:
    from intervis.drives import Drive

STEADY_FRAMES = 8
"""Consecutive frames over which steadiness is measured."""


@dataclass(frozen=True, eq=False)
class DriveExperiment:
    """What one drive gives.

    Attributes
    ----------
    number : int
        The frame of the tables and figures.
    frame : FrameExperiment
    steady : tuple of Steadiness
        One for each method; empty where it could not be measured.
    claims : tuple of Claim
    notes : tuple of str
        What is missing or different, and why.
    """

    number: int
    frame: FrameExperiment
    steady: tuple[Steadiness, ...]
    claims: tuple[Claim, ...]
    notes: tuple[str, ...]


def steps_of_drive(drive: "Drive", number: int, *, with_global: bool, steady_frames: int) -> int:
    """How many units of work `run_drive` tells of."""
    followed, _ = steady_numbers(drive, number, steady_frames)
    return steps_of_frame(with_global=with_global) + len(followed)


def run_drive(
    drive: "Drive",
    number: int,
    settings: Settings | None = None,
    *,
    with_global: bool = True,
    steady_frames: int = STEADY_FRAMES,
    step: Step = lambda note: None,
) -> DriveExperiment:
    """One frame through every experiment, and steadiness over the frames from it on.

    Raises
    ------
    IntervisError
        The drive has no such frame, or it holds nothing to work on.
    """
    frame = run_frame(drive[number], settings, with_global=with_global, step=step)
    numbers, missing = steady_numbers(drive, number, steady_frames)
    notes, steady = list(frame.notes), tuple[Steadiness, ...]()
    if missing:
        notes.append(missing)
    if numbers:
        try:
            steady = tuple(
                follow_drive(drive, numbers, frame.settings, with_global=with_global, step=step)
            )
        except IntervisError as error:
            notes.append(f"Steadiness from frame to frame is left out: {error}")
    return DriveExperiment(
        number=number,
        frame=frame,
        steady=steady,
        claims=tuple(check_claims(frame, steady)),
        notes=tuple(notes),
    )


def steady_numbers(drive: "Drive", number: int, count: int) -> tuple[Sequence[int], str | None]:
    """Consecutive frames with poses from `number` on (or up to it), or why there are none."""
    reason = "Steadiness from frame to frame is left out: "
    if count < 2:
        return (), reason + "it was not asked for."
    if len(drive) < 2:
        return (), reason + "there is a single frame."
    if not drive.poses:
        return (), reason + "the frames have no poses."
    posed = [n for n in drive.frame_numbers if n in drive.poses]
    later = [n for n in posed if n >= number][:count]
    numbers = later if len(later) >= 2 else [n for n in posed if n <= number][-count:]
    if len(numbers) < 2:
        return (), reason + "fewer than two frames have poses."
    return numbers, None
