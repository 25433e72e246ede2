"""Process a drive frame by frame: one result file per frame, constant memory, resumable."""

import logging
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from intervis.arrays import Float64Array, checked_point
from intervis.errors import (
    DriveError,
    IntervisError,
    MissingExtraError,
    OutputError,
    SettingsError,
)
from intervis.files import write_text
from intervis.method.analysis import Analysis, analyze
from intervis.method.granularity import TauHysteresis
from intervis.progress import Progress, silent
from intervis.run.frame_file import FrameRecord, frame_path, load_record, save_frame
from intervis.run.summary import (
    as_json,
    describe,
    differences,
    read_summary,
    same_results,
    summarize,
)
from intervis.settings import Settings
from intervis.transform import inverse, transform

if TYPE_CHECKING:
    from intervis.drives import Drive, Frame

log = logging.getLogger(__name__)

NamedViewpoint = Literal["camera", "sensor", "start"]
Viewpoint = NamedViewpoint | Sequence[float]
FrameRange = tuple[int | None, int | None]


@dataclass(frozen=True)
class FrameFailure:
    """A frame without a result, and the error message as its reason."""

    number: int
    reason: str


@dataclass(frozen=True)
class RunSummary:
    """Result of a run.

    Attributes
    ----------
    out : Path
        Output folder: ``summary.json``, ``settings.toml``, ``frames/NUMBER.npz``.
    frames : tuple of FrameRecord
        The frames with a result, ordered by number; includes those of earlier runs.
    failures : tuple of FrameFailure
        The frames without a result.
    content : mapping
        The content of ``summary.json``.

    Examples
    --------
    >>> RunSummary(Path("out"), (), (FrameFailure(3, "frame 3 is truncated."),), {})
    <RunSummary: 0 frames, 1 failed, in out>
    """

    out: Path
    frames: tuple[FrameRecord, ...]
    failures: tuple[FrameFailure, ...]
    content: Mapping[str, Any]

    @property
    def reused(self) -> int:
        """Number of frames that an earlier run had already written."""
        return sum(record.reused for record in self.frames)

    def __repr__(self) -> str:
        parts = [f"{len(self.frames)} frame{'' if len(self.frames) == 1 else 's'}"]
        if self.reused:
            parts.append(f"{self.reused} reused")
        if self.failures:
            parts.append(f"{len(self.failures)} failed")
        return f"<RunSummary: {', '.join(parts)}, in {self.out}>"


def run_drive(
    drive: "Drive",
    out: Path | str,
    *,
    settings: Settings | None = None,
    viewpoint: Viewpoint = "camera",
    frames: FrameRange | None = None,
    progress: Progress | None = None,
    overwrite: bool = False,
) -> RunSummary:
    """Analyse the frames of a drive; write one file per frame, and a summary.

    Frames that an earlier run with the same input and settings wrote are read, not computed again.
    A frame that fails is listed, and the run continues with the next one. Stage times exclude
    compilation: the first frame is analysed once before the timed analysis.

    Parameters
    ----------
    drive : Drive
        From `intervis.open_drive`.
    out : Path
        Output folder; created if it does not exist.
    settings : Settings, optional
        Settings of the method. With ``tau="auto"`` tau is chosen per frame, with hysteresis.
    viewpoint : {"camera", "sensor", "start"} or three numbers
        P0 of every frame: the camera centre (the sensor if the drive has no camera); the sensor;
        the camera centre of the drive's first frame, transformed into each frame by the poses; or
        coordinates in the sensor frame, metres.
    frames : (first, stop), optional
        Frame numbers ``first <= number < stop``; None leaves an end open.
    progress : callable, optional
        Called after each frame, reused and failed ones included, with ``"frame NUMBER"``.
    overwrite : bool
        Remove an earlier run from `out` instead of raising `OutputError`.

    Raises
    ------
    OutputError
        `out` cannot be written, the disk is full, or `out` holds a run with other settings or
        input. Complete files stay, and the same call resumes from them.
    DriveError
        No frame lies in the range, or ``viewpoint="start"`` and the drive has no poses.
    SettingsError, PointsError
        A setting, or the viewpoint, is invalid.
    MissingExtraError
        Reading the scans needs a package that is not installed.
    """
    out, settings = Path(out), settings or Settings()
    numbers = selected_frames(drive.frame_numbers, frames)
    progress = progress or silent
    origin = _MetaViewpoint(drive, viewpoint)
    head = describe(drive, settings, origin.requested)
    _prepare(out, head, settings, overwrite=overwrite)
    records: list[FrameRecord] = []
    failures: list[FrameFailure] = []
    for outcome in _outcomes(drive, numbers, out, settings, origin):
        if isinstance(outcome, FrameRecord):
            records.append(outcome)
        else:
            failures.append(outcome)
        progress(f"frame {outcome.number}")
    content = summarize(head, records, [(f.number, f.reason) for f in failures])
    _finish(out, content)
    return RunSummary(out, tuple(records), tuple(failures), content)


def selected_frames(numbers: Sequence[int], frames: FrameRange | None) -> list[int]:
    """Frame numbers in a range ``first <= number < stop``.

    Raises
    ------
    DriveError
        No frame lies in the range.

    Examples
    --------
    >>> selected_frames([0, 1, 5, 9], (1, 9))
    [1, 5]
    """
    first, stop = frames or (None, None)
    chosen = [
        number
        for number in numbers
        if (first is None or number >= first) and (stop is None or number < stop)
    ]
    if not chosen:
        if not len(numbers):
            raise DriveError("the drive has no frames.")
        requested = f"{'' if first is None else first}:{'' if stop is None else stop}"
        raise DriveError(
            f"no frame lies in the range {requested} (the end is not included): the drive has"
            f" {len(numbers)} frames, from {min(numbers)} to {max(numbers)}."
        )
    return chosen


class _MetaViewpoint:
    """P0 of each frame, in the sensor frame of that frame."""

    def __init__(self, drive: "Drive", viewpoint: Viewpoint) -> None:
        self.requested: str | list[float]
        self._fixed: Float64Array | None = None
        self._world: Float64Array | None = None
        if not isinstance(viewpoint, str):
            self._fixed = checked_point(viewpoint)
            self.requested = self._fixed.tolist()
            return
        self.requested = viewpoint
        if viewpoint == "sensor":
            self._fixed = np.zeros(3)
        elif viewpoint == "start":
            self._world = start_viewpoint_world(drive)
        elif viewpoint != "camera":
            raise SettingsError(
                f"the viewpoint must be camera, sensor, start or three coordinates,"
                f" got {viewpoint!r}."
            )

    def in_frame(self, frame: "Frame") -> Float64Array | None:
        """(3,) metres; None stands for the camera centre."""
        if self._world is None:
            return self._fixed
        if frame.pose is None:
            raise DriveError(
                f"frame {frame.number} has no pose, so the viewpoint 'start' cannot be"
                " transformed into it."
            )
        return transform(inverse(frame.pose), self._world)


def start_viewpoint_world(drive: "Drive") -> Float64Array:
    """(3,) world coordinates of the camera centre (or sensor) in the drive's first frame, metres.

    Raises
    ------
    DriveError
        The first frame has no pose.
    """
    first = drive[min(drive.frame_numbers)]
    if first.pose is None:
        raise DriveError(
            "the viewpoint 'start' needs poses, and this drive has none: choose camera, sensor"
            " or coordinates."
        )
    return transform(first.pose, first.viewpoint_velo)


def _outcomes(
    drive: "Drive", numbers: Sequence[int], out: Path, settings: Settings, origin: _MetaViewpoint
) -> Iterator[FrameRecord | FrameFailure]:
    chooses_tau = settings.tau == "auto" and settings.sampling != "radius"
    granularity = TauHysteresis(settings) if chooses_tau else None
    compiled = False
    for number in numbers:
        path = frame_path(out, number)
        record = _record_of_earlier_run(path)
        if record is not None:
            if granularity is not None:  # a resumed run chooses tau as an uninterrupted one
                granularity.tau = record.tau
            yield record
            continue
        try:
            frame = drive[number]
            if not compiled:  # compile the kernels that this drive needs before timing
                _analyze(frame, settings, origin, granularity)
                compiled = True
            analysis = _analyze(frame, settings, origin, granularity)
        except (SettingsError, MissingExtraError):
            raise  # every frame would fail in the same way
        except IntervisError as error:
            yield FrameFailure(number, str(error))
        except Exception as error:
            log.debug("frame %d failed", number, exc_info=True)
            yield FrameFailure(number, f"unexpected {type(error).__name__}: {error}")
        else:
            yield save_frame(path, frame, analysis)


def _analyze(
    frame: "Frame", settings: Settings, origin: _MetaViewpoint, granularity: TauHysteresis | None
) -> Analysis:
    return analyze(
        frame.points,
        camera=frame.camera,
        cam_from_velo=frame.cam_from_velo,
        viewpoint=origin.in_frame(frame),
        settings=settings,
        tau_for=granularity.choose if granularity is not None else None,
    )


def _record_of_earlier_run(path: Path) -> FrameRecord | None:
    if not path.exists():
        return None
    try:
        return load_record(path)
    except OutputError as error:
        log.warning("%s The frame is computed again.", error)
        return None


def _prepare(out: Path, head: Mapping[str, Any], settings: Settings, *, overwrite: bool) -> None:
    """Prepare the output folder; raise where it holds another run."""
    try:
        if out.exists() and not out.is_dir():
            raise OutputError(f"{out} is a file: choose a folder for the results.")
        if overwrite:
            _remove_run(out)
        earlier = read_summary(out / "summary.json")
        if earlier is None and any((out / "frames").glob("*.npz")):
            raise OutputError(
                f"{out} holds frames of a run whose summary.json is missing, so their input and"
                " settings are unknown: choose another folder, or overwrite it."
            )
        chosen = settings.to_toml()
        if earlier is None and _differs(out / "settings.toml", chosen):
            raise OutputError(
                f"{out / 'settings.toml'} was not written by a run of these settings and was not"
                " changed: choose another folder."
            )
        (out / "frames").mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"cannot write in {out}: {(error.strerror or '').lower()}.") from None
    if earlier is None:
        write_text(out / "settings.toml", chosen)
        write_text(out / "summary.json", as_json(summarize(head, [], [], complete=False)))
        return
    differing = differences(earlier, head)
    if differing:
        raise OutputError(
            f"{out} holds another run ({'; '.join(differing)}): choose another folder, or"
            " overwrite it."
        )


def _differs(path: Path, content: str) -> bool:
    """Whether a file exists and holds something else."""
    return path.exists() and path.read_bytes() != content.encode()


def _remove_run(out: Path) -> None:
    """Remove the files of a run, if there is one, and no others."""
    if not ((out / "summary.json").exists() or any((out / "frames").glob("*.npz"))):
        return
    for pattern in ("summary.json", "settings.toml", "frames/*.npz", "frames/.*.npz.part"):
        for path in out.glob(pattern):
            path.unlink()


def _finish(out: Path, content: Mapping[str, Any]) -> None:
    """Write the summary, unless the file already holds the same results."""
    path = out / "summary.json"
    earlier = read_summary(path)
    if earlier is None or not same_results(earlier, content):
        write_text(path, as_json(content))
