"""``intervis run``: the paper's method over a drive, or over one scan."""

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from intervis.arguments import address_of
from intervis.cli import options
from intervis.cli.survey import Frames
from intervis.cli.terminal import InterruptedRunError, complain, progress, show, tell
from intervis.errors import IntervisError, OutputError, SettingsError

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from intervis.drives import Drive
    from intervis.run.frame_sight import SightRequest
    from intervis.run.run_folder import Shard
    from intervis.run.stream import RunSummary
    from intervis.run.viewpoint import Viewpoint

LAYOUTS = "KITTI, nuScenes, Argoverse 2, ROS bag, folder of scans, ...: docs/drives.md"
Source = Annotated[Path, typer.Argument(help=f"A drive ({LAYOUTS}) or one scan file.")]
Sources = Annotated[
    list[Path],
    typer.Argument(
        metavar="SOURCE...",
        help=f"Drives ({LAYOUTS}) or scan files. The results of several stand in folders of their"
        " own names below --out.",
    ),
]
CameraName = Annotated[
    str | None, typer.Option("--camera", help="Camera of the drive, for example image_02.")
]
SettingsFile = Annotated[
    Path | None, typer.Option(metavar="FILE.toml", help="Settings of the method.")
]
SettingChanges = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="NAME=VALUE", help="Change one setting; may be repeated."),
]


@dataclass(frozen=True)
class _Request:
    """What is asked of every drive of a run."""

    options: dict[str, Any]
    report: bool
    workers: int
    executor: str | None
    shard: "Shard | None"


def run(
    sources: Sources,
    out: Annotated[Path, typer.Option("--out", help="Folder for the results.")],
    tau: Annotated[
        str | None, typer.Option(metavar="K|auto", help="Granularity: number of returns per node.")
    ] = None,
    budget: Annotated[
        float | None,
        typer.Option(
            metavar="MS",
            help="Choose tau for each frame so that raw scan to region takes no longer than MS"
            " milliseconds; frames that take longer are listed.",
        ),
    ] = None,
    frames: Frames = None,
    viewpoint: Annotated[
        str,
        typer.Option(
            metavar="X,Y,Z|camera|sensor|start",
            help="Viewpoint P0: coordinates in the sensor frame, metres; camera: the camera centre;"
            " sensor: the sensor; start: the camera centre of the first frame, transformed by the"
            " poses.",
        ),
    ] = "camera",
    settings: SettingsFile = None,
    camera: CameraName = None,
    changes: SettingChanges = None,
    sight: Annotated[
        bool,
        typer.Option(
            "--sight",
            help="Also write state and probability of the sight line to every return of each"
            " frame, by its scan alone.",
        ),
    ] = False,
    sight_from: Annotated[
        str | None,
        typer.Option(
            metavar="viewpoint|next",
            help="Where these lines start: --viewpoint (default), or the scanner of the next"
            " frame.",
        ),
    ] = None,
    risk: Annotated[
        float | None,
        typer.Option(
            metavar="R",
            help="How often visible and occluded of --sight may each be wrong, 0.001 to 0.2;"
            " default: 0.05.",
        ),
    ] = None,
    report: Annotated[
        bool,
        typer.Option(
            "--report", help="Also write tables, pictures of the middle frame, and an HTML page."
        ),
    ] = False,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Remove an earlier run in --out first.")
    ] = False,
    compress: Annotated[
        bool, typer.Option("--compress", help="Deflate the frame files: smaller, and slower.")
    ] = False,
    workers: Annotated[
        int, typer.Option(metavar="N", help="Analyse frames side by side in N processes.")
    ] = 1,
    executor: Annotated[
        str | None,
        typer.Option(
            metavar="dask|dask:ADDRESS",
            help="Use dask workers: N of this machine, or those of a scheduler.",
        ),
    ] = None,
    shard: Annotated[
        str | None,
        typer.Option(
            metavar="I/N",
            help="Analyse one of N parts of the frames; other processes may analyse the others.",
        ),
    ] = None,
) -> int:
    """Run the method over drives or scans.

    Writes one file per frame and a summary, and prints a table of the paper's measures. The same
    command resumes an interrupted run.
    """
    request = _Request(
        {
            "viewpoint": options.viewpoint(viewpoint),
            "frames": options.frame_range(frames),
            "settings": options.settings(settings, tau, changes or [], budget),
            "overwrite": overwrite,
            "compress": compress,
            "sight": _sight_request(sight, sight_from, risk),
        },
        report,
        workers,
        _executor_name(executor),
        options.shard(shard),
    )
    if report and request.shard is not None:
        raise SettingsError(
            "a shard has no report: run the command without --shard after the shards."
        )
    _note_idle_workers(request)
    if len(sources) == 1:
        return _run_one(sources[0], out, camera, request)
    from intervis.drives import open_drive

    for source in sources:
        open_drive(source, camera=camera)  # a mistake is told before the work, not after a drive
    failed = False
    for place, (source, folder) in enumerate(zip(sources, _folders(sources, out), strict=True)):
        name = address_of(source) or source
        show(f"{name}:" if place == 0 else f"\n{name}:")
        try:
            failed |= bool(_run_one(source, folder, camera, request, place))
        except SettingsError:
            raise  # every drive would fail in the same way
        except IntervisError as error:
            complain(f"{name}: {error}")
            failed = True
    return 1 if failed else 0


def _sight_request(wanted: bool, start: str | None, risk: float | None) -> "SightRequest | None":
    from intervis.run.frame_sight import SightRequest

    if not wanted:
        for option, value in (("--sight-from", start), ("--risk", risk)):
            if value is not None:
                raise SettingsError(f"{option} is about the sight lines of --sight: give --sight.")
        return None
    given: dict[str, Any] = {"place": start, "risk": risk}
    return SightRequest(**{name: value for name, value in given.items() if value is not None})


def _folders(sources: Sequence[Path], out: Path) -> list[Path]:
    """A folder below `out` for each of several sources, by its name."""
    names = [source.resolve().name for source in sources]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise OutputError(
            f"several of the drives are called {twice[0]}, and their results would meet in one"
            " folder: run them one by one, with an --out for each."
        )
    return [out / name for name in names]


def _run_one(source: Path, out: Path, camera: str | None, request: _Request, place: int = 0) -> int:
    """Run the method over one drive; `place` is its number among several."""
    from intervis.drives import open_drive
    from intervis.run.stream import selected_frames

    drive = open_drive(source, camera=camera)
    options.check_no_input(out, [drive.root])
    if request.report:
        from intervis.run.report import check_report

        check_report(out, out)
    _note_missing_camera(drive, request.options["viewpoint"])
    total = len(selected_frames(drive.frame_numbers, request.options["frames"]))
    try:
        summary = _run_drive(drive, out, total, request, place)
    except KeyboardInterrupt:
        command = "the same command"
        command += " without --overwrite" if request.options["overwrite"] else ""
        raise InterruptedRunError(f"interrupted: {command} resumes the run in {out}.") from None
    show_run(summary)
    if request.shard is not None:
        number, count = request.shard
        show(f"Shard {number} of {count}: the command without --shard writes the summary.")
    if request.report and summary.frames:
        show_report(drive, summary, out)
    return 1 if summary.failures else 0


def _run_drive(
    drive: "Drive", out: Path, total: int, request: _Request, place: int
) -> "RunSummary":
    """Run a drive, with new workers where some were lost."""
    from intervis.run.stream import WorkersLostError, run_drive

    shard = request.shard
    if shard is not None:  # of short drives, each has its first stretch in another shard
        shard = ((shard[0] - 1 - place) % shard[1] + 1, shard[1])
    chosen = dict(request.options)
    for attempts_left in (2, 1, 0):
        try:
            with _executor(request) as executor, progress("frames", total) as advance:
                return run_drive(
                    drive, out, progress=advance, executor=executor, shard=shard, **chosen
                )
        except WorkersLostError:
            if not attempts_left:
                raise
            tell("note: a worker ended before its work was done; new ones go on.")
            chosen["overwrite"] = False  # what there is now is of this run
    raise AssertionError("the last attempt returns or raises")


def _executor(request: _Request) -> "AbstractContextManager[Executor | None]":
    from intervis.run.workers import dask_workers, process_workers

    if request.executor is not None:
        address = request.executor.removeprefix("dask").removeprefix(":")
        return dask_workers(address or None, request.workers)
    return process_workers(request.workers) if request.workers != 1 else nullcontext()


def _executor_name(given: str | None) -> str | None:
    if given is not None and given != "dask" and not given.startswith("dask:"):
        raise SettingsError(f"--executor must be dask or dask:ADDRESS, got {given!r}.")
    return given


def _note_idle_workers(request: _Request) -> None:
    from intervis.run.stretch import chooses_tau

    is_shared = request.workers != 1 or request.executor is not None
    if is_shared and chooses_tau(request.options["settings"]):
        tell(
            "note: tau of a frame follows the frames before, so one worker analyses a drive, and"
            " more are idle; of several drives --shard analyses some side by side."
        )


def _note_missing_camera(drive: "Drive", viewpoint: "Viewpoint") -> None:
    if drive.camera is None and viewpoint in ("camera", "start"):
        tell("note: this drive has no camera, so the viewpoint is the sensor.")


def show_report(
    drive: "Drive",
    summary: "RunSummary",
    out: Path,
    *,
    source_note: str = "",
) -> None:
    """Write pictures, tables and a page, and print their paths."""
    from intervis.run.report import report_run, report_steps

    with progress("report", report_steps(drive)) as advance:
        report = report_run(
            drive,
            summary,
            out,
            source_note=source_note,
            progress=advance,
        )
    for path in report.paths[1:]:
        show(f"Report: {path}")
    show(f"Page: {report.paths[0]}")
    if report.missing is not None:
        tell(f"note: {report.missing}")


def show_run(summary: "RunSummary") -> None:
    """Print the measures and stage times of a run, and its failed frames."""
    from intervis.run.tables import measures_table, pace_table, times_table

    if summary.frames:
        show(measures_table(summary.frames).as_text())
        show("")
        show(times_table(summary.content["times_s"], len(summary.frames)).as_text())
        pace = pace_table(summary.content)
        if pace is not None:
            show("\n" + pace.as_text())
    dropped = sum(int(record.measures["n_dropped"]) for record in summary.frames)
    if dropped:
        show(f"{dropped} rows that are no return (NaN, infinite, or 0, 0, 0) were ignored.")
    if summary.reused:
        show(f"{summary.reused} of {len(summary.frames)} frames were reused from an earlier run.")
    for record in summary.frames:
        if record.remade:
            tell(f"note: frame {record.number} was computed again: {record.remade}")
    shares = [record.sight for record in summary.frames if record.sight is not None]
    if shares:
        show(_sight_line(shares))
    show(f"Results: {summary.out}")
    for failure in summary.failures:
        complain(f"frame {failure.number} failed: {failure.reason}")


def _sight_line(shares: "Sequence[Mapping[str, float]]") -> str:
    """Mean shares of the returns by state, over the frames that have sight lines."""
    asked = [one for one in shares if one["visible"] == one["visible"]]
    without = len(shares) - len(asked)
    parts = []
    if asked:
        words = [
            f"{100 * sum(one[word] for one in asked) / len(asked):.1f} % {word}"
            for word in asked[0]
        ]
        over = f"{len(asked)} frame{'' if len(asked) == 1 else 's'}"
        parts.append(f"{', '.join(words)} in the mean over {over}.")
    if without:
        parts.append(f"{without} without: there is no next frame.")
    return f"Sight lines to every return: {' '.join(parts)}"
