"""Masks of many frames of a drive as files: whole, resumable, one frame in memory at a time."""

from __future__ import annotations  # help() shows the names of the array types

from collections import Counter
from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from intervis.drives import Drive
from intervis.errors import IntervisError, OutputError, SettingsError
from intervis.progress import Progress, reporter
from intervis.uses.voxels.drive_masks import MaskSettings, frame_masks, later_frames
from intervis.uses.voxels.mask_folder import described, mask_folder
from intervis.uses.voxels.mask_input import MaskInput
from intervis.uses.voxels.mask_layouts import FrameName, MaskLayout
from intervis.uses.voxels.mask_record import fault_of, read_record, write_frame
from intervis.uses.voxels.masks import Masks


@dataclass(frozen=True, eq=False)
class MaskFrame:
    """What became of a frame.

    Attributes
    ----------
    number : int
    masks : Masks or None
        None where the frame was reused, or failed.
    reused : bool
        True where an earlier run had already written the files.
    remade : str
        Why files of an earlier run were replaced; empty if they were not.
    failure : str
        Why the frame has no files; empty if it has.
    """

    number: int
    masks: Masks | None = None
    reused: bool = False
    remade: str = ""
    failure: str = ""


@dataclass(frozen=True, eq=False)
class MaskRun:
    """Frames whose masks are written into a folder.

    Attributes
    ----------
    drive : Drive
    numbers : sequence of int
        Of the frames.
    layout : MaskLayout
    settings : MaskSettings
    cameras : mapping of str to Drive
        As `intervis.uses.voxels.drive_masks.drive_cameras` returns it.
    """

    drive: Drive
    numbers: Sequence[int]
    layout: MaskLayout
    settings: MaskSettings
    cameras: Mapping[str, Drive] = field(default_factory=dict)

    @property
    def steps(self) -> int:
        """How often `write` reports progress."""
        return sum(self._steps_of(number) for number in self.numbers)

    def write(self, out: Path, progress: Progress | None = None) -> Generator[MaskFrame]:
        """Write the files of each frame, and yield what became of it.

        Frames that an earlier run wrote from the same input with the same settings are not made
        again; their scans are read to tell. A frame that fails is told, and the next one follows;
        where the first one fails, as all would by a mistake in the settings, its error is raised.

        Parameters
        ----------
        out : Path
            The folder; created if it does not exist.
        progress : callable, optional
            Called after each scan of a frame, and after the frame.

        Raises
        ------
        OutputError
            See `intervis.uses.voxels.mask_folder.mask_folder`; or a file cannot be written, was not
            made by intervis, or the labels do not fit the layout.
        DriveError, ScanError, SettingsError
            As `intervis.uses.voxels.drive_masks.frame_masks` for the first frame.
        """
        advance = reporter(progress)
        text = described(self.drive, self.layout.name, self.settings, self.cameras)
        inputs = MaskInput(self.drive, self.settings.later, self.cameras, text)
        with mask_folder(out, text):
            for nth, name in enumerate(frame_names(self.drive, self.numbers)):
                counted = _Counted(advance, self._steps_of(name.number))
                try:
                    frame = self._frame(out, name, inputs, counted)
                except (SettingsError, OutputError):
                    raise
                except IntervisError as error:
                    if nth == 0:
                        raise
                    frame = MaskFrame(name.number, failure=str(error))
                counted.finish(f"frame {name.number}")
                yield frame

    def _frame(
        self, out: Path, name: FrameName, inputs: MaskInput, progress: Progress
    ) -> MaskFrame:
        """Write a frame, unless an earlier run has."""
        fingerprint = inputs.fingerprint(name)
        earlier = read_record(out, name.number)
        fault = "" if earlier is None else fault_of(out, earlier, fingerprint)
        if earlier is not None and not fault:
            return MaskFrame(name.number, reused=True)
        masks = frame_masks(self.drive, name.number, self.settings, self.cameras, progress)
        write_frame(out, name.number, fingerprint, self.layout.write(name, masks))
        return MaskFrame(name.number, masks, remade=fault)

    def _steps_of(self, number: int) -> int:
        return 2 + len(later_frames(self.drive, number, self.settings.later))


def frame_names(drive: Drive, numbers: Sequence[int]) -> list[FrameName]:
    """How files of frames are named: by the scan's file, unless another scan has that name too."""
    names = Counter(path.name for path in drive.scan_paths.values())
    return [
        FrameName(drive.name, number, name if names[name] == 1 else f"{number:06d}")
        for number, name in ((number, drive.scan_paths[number].name) for number in numbers)
    ]


class _Counted:
    """A progress callback that is called a fixed number of times for a frame."""

    def __init__(self, progress: Progress, steps: int) -> None:
        self._progress, self._left = progress, steps

    def __call__(self, note: str) -> None:
        if self._left > 1:  # the last one is that of the whole frame
            self._left -= 1
            self._progress(note)

    def finish(self, note: str) -> None:
        """Make up for the steps that were left out."""
        while self._left > 0:
            self._left -= 1
            self._progress(note)
