"""Process a drive frame by frame: one result file per frame, constant memory, resumable."""

from collections.abc import Generator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from intervis.errors import DriveError, OutputError, SettingsError
from intervis.progress import Progress, reporter
from intervis.run.frame_file import FrameRecord
from intervis.run.frame_sight import SightRequest
from intervis.run.pace import Pace, budget_kept
from intervis.run.run_folder import Shard, finish, run_folder
from intervis.run.stretch import (
    FrameFailure,
    Outcome,
    Stretch,
    outcomes,
    process,
    stretches_of,
)
from intervis.run.summary import describe, summarize
from intervis.run.viewpoint import MetaViewpoint, Viewpoint
from intervis.settings import Settings

if TYPE_CHECKING:
    from intervis.drives import Drive

IN_FLIGHT = 64
"""Stretches that an executor holds at a time: each carries the drive's paths and poses."""

FrameRange = tuple[int | None, int | None]


class WorkersLostError(OutputError):
    """Workers of an executor ended before their work: killed, or out of memory."""


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
        The content of ``summary.json``; ``complete`` is false for a shard, which writes none.

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
    compress: bool = False,
    sight: SightRequest | None = None,
    executor: Executor | None = None,
    shard: Shard | None = None,
) -> RunSummary:
    """Analyse the frames of a drive; write one file per frame, and a summary.

    A frame that an earlier run wrote from the same input with the same settings is not computed
    again; its scan is read to tell. A file that is damaged, or that was made from something else,
    is made again (`FrameRecord.remade`). A frame that fails is listed, and the run continues with
    the next one. While a frame is analysed, the next one is read and the last one written. Stage
    times exclude compilation: the first frame is analysed once before the timed
    analysis.

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
    compress : bool
        Deflate the frame files: less than half as large, but writing one of 20,000 nodes takes
        about seven times as long.
    sight : SightRequest, optional
        Also ask sight lines to every return of each frame, by the scan of that frame alone, and
        write their states and probabilities into the frame's file (`load_sight`). An earlier run
        without them, or with others, is another run.
    executor : concurrent.futures.Executor, optional
        Analyses stretches of 16 frames side by side; its workers write the files. The results are
        those of a run without it. With ``tau="auto"`` the frames depend on each other and are one
        stretch.
    shard : (number, count), optional
        Analyse only the stretches of one shard, numbered from 1; other processes or machines that
        see the same folder may analyse the others at the same time. After them a run without
        `shard` reads all frames and writes the summary.

    Raises
    ------
    OutputError
        `out` cannot be written, the disk is full, another process writes there, workers of the
        executor were lost, or `out` holds a run with other settings or input, or files that
        intervis did not make. Complete files stay, and the same call resumes from them.
    DriveError
        No frame lies in the range, or ``viewpoint="start"`` or sight lines from the next place
        are asked and the drive has no poses.
    SettingsError, PointsError
        A setting, the viewpoint or the shard is invalid.
    MissingExtraError
        Reading the scans needs a package that is not installed.
    """
    out, settings = Path(out), settings or Settings()
    numbers = selected_frames(drive.frame_numbers, frames)
    _check_shard(shard, overwrite=overwrite)
    origin = MetaViewpoint(drive, viewpoint)
    if sight is not None:
        sight.check(drive)
    head = describe(drive, settings, origin.requested, sight)
    stretches = stretches_of(Stretch(drive, numbers, out, settings, origin, compress, sight))
    if shard is not None:
        stretches = stretches[shard[0] - 1 :: shard[1]]
    with run_folder(out, head, settings, shard=shard, overwrite=overwrite):
        pace = Pace(one_by_one=executor is None)
        records, failures = _collected(stretches, executor, pace, reporter(progress))
        content = summarize(
            head,
            records,
            [(failure.number, failure.reason) for failure in failures],
            complete=shard is None,
            rate=pace.as_dict(),
            budget=budget_kept(records, settings),
        )
        if shard is None:
            finish(out, content)
    return RunSummary(out, tuple(records), tuple(failures), content)


def _check_shard(shard: Shard | None, *, overwrite: bool) -> None:
    if shard is None:
        return
    number, count = shard
    if not 1 <= number <= count:
        raise SettingsError(f"a shard is i/n with i from 1 to n, got {number}/{count}.")
    if overwrite:
        raise SettingsError(
            "a shard cannot overwrite a run, which other shards may be writing: run once with"
            " overwrite and without a shard, or choose another folder."
        )


def _collected(
    stretches: Sequence[Stretch], executor: Executor | None, pace: Pace, progress: Progress
) -> tuple[list[FrameRecord], list[FrameFailure]]:
    """The outcomes of stretches, ordered by frame number."""
    records: list[FrameRecord] = []
    failures: list[FrameFailure] = []
    # Closed before the folder is unlocked: a file that is being written is completed.
    with closing(_outcomes(stretches, executor)) as found:
        for outcome in found:
            pace.note(outcome)
            if isinstance(outcome, FrameRecord):
                records.append(outcome)
            else:
                failures.append(outcome)
            progress(f"frame {outcome.number}")
    return sorted(records, key=lambda r: r.number), sorted(failures, key=lambda f: f.number)


def _outcomes(stretches: Sequence[Stretch], executor: Executor | None) -> Generator[Outcome]:
    if executor is None:
        for whole in stretches[:1]:  # joined, so that the first frame alone is analysed twice
            numbers = [number for stretch in stretches for number in stretch.numbers]
            yield from outcomes(replace(whole, numbers=numbers))
        return
    waiting, running = list(reversed(stretches)), set[Future[list[Outcome]]]()
    try:
        while waiting or running:
            while waiting and len(running) < IN_FLIGHT:
                running.add(executor.submit(process, waiting.pop()))
            done, running = wait(running, return_when=FIRST_COMPLETED)
            for future in done:
                yield from future.result()
    except BrokenExecutor:
        raise WorkersLostError(
            "a worker ended before its work was done (killed, or out of memory): the same command"
            " resumes the run."
        ) from None
    finally:
        for future in running:
            future.cancel()


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
