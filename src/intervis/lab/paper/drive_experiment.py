"""The paper's experiments on a drive: one frame in full, temporal consistency, claims."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from intervis.errors import IntervisError
from intervis.lab.paper.claims import Claim, check_claims
from intervis.lab.paper.experiment import FrameExperiment, run_frame, steps_of_frame
from intervis.lab.paper.temporal_consistency import TemporalConsistency, follow_drive
from intervis.progress import Progress
from intervis.settings import Settings

if TYPE_CHECKING:
    from intervis.drives import Drive

CONSECUTIVE_FRAMES = 8
"""Frames over which temporal consistency is measured."""

LEFT_OUT = "Temporal consistency is left out: "


@dataclass(frozen=True, eq=False)
class DriveExperiment:
    """Results of the experiments on a drive.

    Attributes
    ----------
    number : int
        The frame of the tables and figures.
    frame : FrameExperiment
    consistency : tuple of TemporalConsistency
        One for each method; empty where it could not be measured.
    claims : tuple of Claim
    notes : tuple of str
        What is missing or different, and why.
    """

    number: int
    frame: FrameExperiment
    consistency: tuple[TemporalConsistency, ...]
    claims: tuple[Claim, ...]
    notes: tuple[str, ...]


def steps_of_drive(
    drive: "Drive", number: int, *, with_global: bool, consecutive_frames: int
) -> int:
    """How often `run_drive` calls its progress callback."""
    followed, _ = consecutive_numbers(drive, number, consecutive_frames)
    return steps_of_frame(with_global=with_global) + len(followed)


def run_drive(
    drive: "Drive",
    number: int,
    settings: Settings | None = None,
    *,
    with_global: bool = True,
    consecutive_frames: int = CONSECUTIVE_FRAMES,
    progress: Progress | None = None,
) -> DriveExperiment:
    """Run every experiment on one frame, and temporal consistency over the frames from it on.

    Raises
    ------
    IntervisError
        The drive has no such frame, or the frame has no return that a method can use.
    """
    frame = run_frame(drive[number], settings, with_global=with_global, progress=progress)
    numbers, missing = consecutive_numbers(drive, number, consecutive_frames)
    notes, consistency = list(frame.notes), tuple[TemporalConsistency, ...]()
    if missing:
        notes.append(missing)
    if numbers:
        try:
            consistency = tuple(
                follow_drive(
                    drive, numbers, frame.settings, with_global=with_global, progress=progress
                )
            )
        except IntervisError as error:
            notes.append(f"{LEFT_OUT}{error}")
    return DriveExperiment(
        number=number,
        frame=frame,
        consistency=consistency,
        claims=tuple(check_claims(frame, consistency)),
        notes=tuple(notes),
    )


def consecutive_numbers(
    drive: "Drive", number: int, count: int
) -> tuple[Sequence[int], str | None]:
    """Consecutive frames with poses, or the reason why there are none.

    At most `count` frames from `number` on; where those are fewer than two, at most `count` frames
    up to `number`.
    """
    if count < 2:
        return (), LEFT_OUT + "it was not requested."
    if len(drive) < 2:
        return (), LEFT_OUT + "there is a single frame."
    if not drive.poses:
        return (), LEFT_OUT + "the frames have no poses."
    posed = [n for n in drive.frame_numbers if n in drive.poses]
    later = [n for n in posed if n >= number][:count]
    numbers = later if len(later) >= 2 else [n for n in posed if n <= number][-count:]
    if len(numbers) < 2:
        return (), LEFT_OUT + "fewer than two frames have poses."
    return numbers, None
