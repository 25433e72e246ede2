"""The output folder of a run, read back: its frames, its request, and the drive it was made of."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from intervis.arguments import is_count
from intervis.arrays import checked_point
from intervis.errors import DriveError, IntervisError, OutputError
from intervis.run.frame_file import frame_path
from intervis.run.frame_sight import SightRequest
from intervis.run.stored_frame import StoredFrame, load_stored_frame
from intervis.run.stretch import input_fingerprint
from intervis.run.summary import read_summary
from intervis.settings import Settings

if TYPE_CHECKING:
    from intervis.drives import Drive, Frame

FRAME_NAME = re.compile(r"\d{10,}\.npz")
"""See `frame_path`; numbers that are times are longer."""

IDENTIFYING = {
    "layout": "layout",
    "frames": "number of frames",
    "camera": "camera",
    "scan_bytes": "size of the scans",
    "digest": "digest",
}
"""Entries of `Drive.fingerprint` that a drive keeps when its folder is moved or renamed, in words;
the most telling first."""


@dataclass(frozen=True, eq=False)
class StoredRun:
    """What a run left in its output folder.

    Attributes
    ----------
    folder : Path
    name : str
        Of the drive.
    numbers : tuple of int
        Numbers of the frames that have a file, sorted.
    failures : mapping of int to str
        Frames without a result, and why.
    is_complete : bool
        False where the run was cut short, or still runs.
    source : str
        Where the drive was; empty where the run does not say.
    input : mapping
        `Drive.fingerprint` of the drive.
    settings : Settings
    viewpoint : str or list of float
        As it was asked for.
    sight : SightRequest or None
    version : str
        Of the intervis that made it.
    """

    folder: Path
    name: str
    numbers: tuple[int, ...]
    failures: Mapping[int, str]
    is_complete: bool
    source: str
    input: Mapping[str, Any]
    settings: Settings
    viewpoint: str | list[float]
    sight: SightRequest | None
    version: str

    def frame(self, number: int) -> StoredFrame:
        """What is stored of one frame.

        Raises
        ------
        OutputError
            Its file is damaged, or is not of this version.
        """
        return load_stored_frame(frame_path(self.folder, number))

    def drive(self, given: Path | None = None) -> "Drive":
        """The drive that was run, where it was or at a given place.

        Raises
        ------
        DriveError
            There is none, or it is not the same any more.
        """
        from intervis.drives import open_drive

        source = given or self.source
        if not source:
            raise DriveError("the run does not say where its drive was")
        camera = self.input.get("camera")
        try:
            drive = open_drive(source, camera=camera if isinstance(camera, str) else None)
            now = drive.fingerprint()
        except IntervisError as error:
            reason = str(error).removesuffix(": check the path.").rstrip(".")
            raise DriveError(reason) from None
        for name, words in IDENTIFYING.items():
            if now[name] != self.input.get(name):
                raise DriveError(
                    f"{source} is not the drive of the run any more: the {words} differs"
                )
        return drive

    def is_made_of(self, drive: "Drive", frame: "Frame", stored: StoredFrame) -> bool:
        """Whether the results of a frame were made of this scan, pose and camera."""
        try:
            now = input_fingerprint(drive, frame, self.settings, self.viewpoint, self.sight)
        except DriveError:
            return False
        return now == stored.fingerprint


def is_run(folder: Path) -> bool:
    """Whether a folder looks like the output of a run, be it whole or not."""
    frames = folder / "frames"
    try:
        return frames.is_dir() and ((folder / "summary.json").is_file() or bool(_numbers(frames)))
    except OSError:  # it may not be read
        return False


def runs_below(folder: Path) -> list[str]:
    """Names of the folders in a folder that look like runs: of several drives at once."""
    try:
        return sorted(child.name for child in folder.iterdir() if is_run(child))
    except OSError:  # no folder, or it may not be read
        return []


def read_run(folder: Path) -> StoredRun:
    """Read the output folder of a run.

    Raises
    ------
    OutputError
        It is none, or its summary is missing or damaged, or it holds no frame.
    """
    path = folder / "summary.json"
    try:
        summary = read_summary(path)
    except OutputError as error:
        raise OutputError(str(error).split(": choose")[0].rstrip(".") + ".") from None
    if summary is None:
        raise OutputError(
            f"{folder} holds frames of a run whose summary.json is missing: the same command"
            " with --overwrite makes it again."
        )
    try:
        numbers = _numbers(folder / "frames")
    except OSError as error:
        raise OutputError(f"cannot read {folder / 'frames'}: {error.strerror}.") from None
    if not numbers:
        raise OutputError(f"{folder} holds a run without frames: there is nothing to show.")
    try:
        return _run_of(folder, summary, numbers)
    except (IntervisError, AttributeError, KeyError, TypeError, ValueError):
        raise OutputError(f"{path} is damaged: its entries are not those of a run.") from None


def _run_of(folder: Path, summary: Mapping[str, Any], numbers: tuple[int, ...]) -> StoredRun:
    asked, source, viewpoint = summary.get("sight"), summary.get("source"), summary["viewpoint"]
    if not isinstance(viewpoint, str):
        viewpoint = checked_point(viewpoint).tolist()
    if not is_count(summary["input"]["frames"]):
        raise ValueError("the number of frames is none")
    return StoredRun(
        folder=folder,
        name=str(summary["input"]["name"]),
        numbers=numbers,
        failures={int(one["number"]): str(one["reason"]) for one in summary["failures"]},
        is_complete=summary["complete"] is True,
        source=source if isinstance(source, str) else "",
        input=dict(summary["input"]),
        settings=Settings(**summary["settings"]),
        viewpoint=viewpoint,
        sight=None if asked is None else SightRequest(asked["from"], float(asked["risk"])),
        version=str(summary["intervis"]),
    )


def _numbers(frames: Path) -> tuple[int, ...]:
    """Numbers of the frame files in a folder."""
    names = [path.name for path in frames.iterdir()]
    return tuple(sorted(int(name[:-4]) for name in names if FRAME_NAME.fullmatch(name)))
