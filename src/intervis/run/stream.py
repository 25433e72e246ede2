"""A drive in, results out, frame by frame: constant memory, and it goes on where it stopped."""

import logging
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from intervis.arrays import Float64Array, checked_point, checked_points
from intervis.errors import DriveError, IntervisError, OutputError, SettingsError
from intervis.files import write_text
from intervis.method.analysis import Analysis, analyze, field_of_view
from intervis.method.granularity import TauHysteresis
from intervis.run.frame_file import FrameRecord, frame_path, load_record, save_frame
from intervis.run.summary import (
    as_json,
    describe,
    differences,
    read_summary,
    summarize,
    tells_the_same,
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
    """A frame that gave no result, and why, in one sentence."""

    number: int
    sentence: str


@dataclass(frozen=True)
class RunSummary:
    """What a run did.

    Attributes
    ----------
    out : Path
        Its folder: ``summary.json``, ``settings.toml``, ``frames/NUMBER.npz``.
    frames : tuple of FrameRecord
        The frames that went well, those of earlier runs among them, by number.
    failures : tuple of FrameFailure
        The frames that did not.
    content : mapping
        What ``summary.json`` holds.
    """

    out: Path
    frames: tuple[FrameRecord, ...]
    failures: tuple[FrameFailure, ...]
    content: Mapping[str, Any]

    @property
    def reused(self) -> int:
        """How many frames an earlier run had already written."""
        return sum(record.reused for record in self.frames)


def run(
    drive: "Drive",
    out: Path | str,
    *,
    settings: Settings | None = None,
    viewpoint: Viewpoint = "camera",
    frames: FrameRange | None = None,
    on_frame: Callable[[FrameRecord | FrameFailure], None] | None = None,
    overwrite: bool = False,
) -> RunSummary:
    """Analyse the frames of a drive and write one file for each, and a summary.

    A frame that an earlier run with the same input and settings wrote is read, not made again; a
    frame that fails is listed, and the next one has its turn. Stage times are those of compiled
    kernels: the first frame is analysed once before the clock counts.

    Parameters
    ----------
    drive : Drive
        As `intervis.open_drive` gives it.
    out : Path
        Folder of the results, made where it does not exist.
    settings : Settings, optional
        Of the method.
    viewpoint : {"camera", "sensor", "start"} or three numbers
        P0 of every frame: the camera's centre (the sensor where there is no camera), the sensor,
        the camera's place in the drive's first frame carried along by the poses, or coordinates
        in metres in the sensor's frame.
    frames : (first, stop), optional
        Frame numbers ``first <= number < stop``; None leaves an end open.
    on_frame : callable, optional
        Called after each frame with its `FrameRecord` or `FrameFailure`.
    overwrite : bool
        Remove what an earlier run left in `out`, instead of refusing to mix it with this one.

    Raises
    ------
    OutputError
        `out` cannot be written, the disk is full, or it holds a run with other settings or input.
        What is complete stays, and the same call goes on from there.
    DriveError
        No frame lies in the range, or ``viewpoint="start"`` and the drive has no poses.
    SettingsError, PointsError
        A setting, or the viewpoint, is impossible.
    """
    out, settings = Path(out), settings or Settings()
    numbers = selected_frames(drive.frame_numbers, frames)
    place = _Place(drive, viewpoint)
    head = describe(drive, settings, place.asked)
    _prepare(out, head, settings, overwrite=overwrite)
    records: list[FrameRecord] = []
    failures: list[FrameFailure] = []
    for outcome in _outcomes(drive, numbers, out, settings, place):
        if isinstance(outcome, FrameRecord):
            records.append(outcome)
        else:
            failures.append(outcome)
        if on_frame is not None:
            on_frame(outcome)
    content = summarize(head, records, [(f.number, f.sentence) for f in failures])
    _finish(out, content)
    return RunSummary(out, tuple(records), tuple(failures), content)


def selected_frames(numbers: Sequence[int], frames: FrameRange | None) -> list[int]:
    """The frame numbers that lie in a range ``first <= number < stop``.

    Raises
    ------
    DriveError
        None does.

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
        asked = f"{'' if first is None else first}:{'' if stop is None else stop}"
        raise DriveError(
            f"no frame lies in the range {asked} (the end is not included): the drive has"
            f" {len(numbers)} frames, from {min(numbers)} to {max(numbers)}."
        )
    return chosen


class _Place:
    """Where P0 is in each frame, in the sensor's coordinates of that frame."""

    def __init__(self, drive: "Drive", viewpoint: Viewpoint) -> None:
        self.asked: str | list[float]
        self._fixed: Float64Array | None = None
        self._world: Float64Array | None = None
        if not isinstance(viewpoint, str):
            self._fixed = checked_point(viewpoint)
            self.asked = self._fixed.tolist()
            return
        self.asked = viewpoint
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
        """(3,) metres, or None for the place of the camera."""
        if self._world is None:
            return self._fixed
        if frame.pose is None:
            raise DriveError(
                f"frame {frame.number} has no pose, so the drive's first viewpoint cannot be"
                " carried along to it."
            )
        return transform(inverse(frame.pose), self._world)


class _Granularity:
    """The settings of each frame: with ``tau="auto"`` a number is chosen, and held while it can."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        chooses = settings.tau == "auto" and settings.sampling != "radius"
        self._steady = TauHysteresis(settings) if chooses else None

    def settings_for(self, frame: "Frame") -> Settings:
        """The settings of the next frame."""
        if self._steady is None:
            return self._settings
        points = checked_points(frame.points)
        view = field_of_view(points, frame.camera, frame.cam_from_velo, self._settings.view)
        return self._settings.with_changes(tau=self._steady.choose(len(view.index)))

    def follow(self, record: FrameRecord) -> None:
        """Go on from a frame of an earlier run, so that a resumed run ends like a whole one."""
        if self._steady is not None:
            self._steady.tau = record.tau


def start_viewpoint_world(drive: "Drive") -> Float64Array:
    """(3,) the camera's centre (the sensor, without a camera) in the drive's first frame, world.

    Raises
    ------
    DriveError
        The first frame has no pose.
    """
    first = drive[min(drive.frame_numbers)]
    if first.pose is None:
        raise DriveError(
            "the viewpoint 'start' is carried along by the poses, and this drive has none:"
            " choose camera, sensor or coordinates."
        )
    return transform(first.pose, first.viewpoint_velo)


def _outcomes(
    drive: "Drive", numbers: Sequence[int], out: Path, settings: Settings, place: _Place
) -> Iterator[FrameRecord | FrameFailure]:
    warm, granularity = False, _Granularity(settings)
    for number in numbers:
        path = frame_path(out, number)
        record = _record_of_earlier_run(path)
        if record is not None:
            granularity.follow(record)
            yield record
            continue
        try:
            frame = drive[number]
            chosen = granularity.settings_for(frame)
            if not warm:  # compile what this drive needs, so that the times below are honest
                _analyze(frame, chosen, place)
                warm = True
            analysis = _analyze(frame, chosen, place)
        except SettingsError:
            raise  # it would fail for every frame: the request is wrong, not the frame
        except IntervisError as error:
            yield FrameFailure(number, str(error))
        except Exception as error:
            log.debug("frame %d failed", number, exc_info=True)
            yield FrameFailure(number, f"unexpected {type(error).__name__}: {error}")
        else:
            yield save_frame(path, frame, analysis)


def _analyze(frame: "Frame", settings: Settings, place: _Place) -> Analysis:
    return analyze(
        frame.points,
        camera=frame.camera,
        cam_from_velo=frame.cam_from_velo,
        viewpoint=place.in_frame(frame),
        settings=settings,
    )


def _record_of_earlier_run(path: Path) -> FrameRecord | None:
    if not path.exists():
        return None
    try:
        return load_record(path)
    except OutputError as error:
        log.warning("%s It is made again.", error)
        return None


def _prepare(out: Path, head: Mapping[str, Any], settings: Settings, *, overwrite: bool) -> None:
    """Make the folder ready, and refuse one that holds another run."""
    try:
        if out.exists() and not out.is_dir():
            raise OutputError(f"{out} is a file: choose a folder for the results.")
        if overwrite:
            _remove_run(out)
        earlier = read_summary(out / "summary.json")
        if earlier is None and any((out / "frames").glob("*.npz")):
            raise OutputError(
                f"{out} holds frames of a run whose summary.json is missing, so nobody can tell"
                " what they were made from: choose another folder, or overwrite it."
            )
        (out / "frames").mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"cannot write in {out}: {(error.strerror or '').lower()}.") from None
    if earlier is None:
        write_text(out / "settings.toml", settings.to_toml())
        write_text(out / "summary.json", as_json(summarize(head, [], [], complete=False)))
        return
    differing = differences(earlier, head)
    if differing:
        raise OutputError(
            f"{out} holds another run ({'; '.join(differing)}): choose another folder, or"
            " overwrite it."
        )


def _remove_run(out: Path) -> None:
    """Remove the files that a run writes, and nothing else."""
    for pattern in ("summary.json", "settings.toml", "frames/*.npz", "frames/.*.npz.part"):
        for path in out.glob(pattern):
            path.unlink()


def _finish(out: Path, content: Mapping[str, Any]) -> None:
    """Write the summary, unless the one that is there tells the same."""
    path = out / "summary.json"
    earlier = read_summary(path)
    if earlier is None or not tells_the_same(earlier, content):
        write_text(path, as_json(content))
