"""``intervis run``: the paper's method over a drive, or over one scan."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from intervis.cli import options
from intervis.cli.terminal import InterruptedRunError, complain, progress, show, tell

if TYPE_CHECKING:
    from intervis.drives import Drive
    from intervis.run.stream import RunSummary, Viewpoint

Source = Annotated[
    Path,
    typer.Argument(
        help="A drive (KITTI raw, odometry, object; a folder of scans) or one scan file."
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


def run(
    source: Source,
    out: Annotated[Path, typer.Option("--out", help="Folder for the results.")],
    tau: Annotated[
        str | None, typer.Option(metavar="K|auto", help="Granularity: number of returns per node.")
    ] = None,
    frames: Annotated[
        str | None,
        typer.Option(metavar="A:B", help="Frame numbers, B not included; also A:, :B or A."),
    ] = None,
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
    report: Annotated[
        bool,
        typer.Option(
            "--report", help="Also write tables, pictures of the middle frame, and an HTML page."
        ),
    ] = False,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Remove an earlier run in --out first.")
    ] = False,
) -> int:
    """Run the method over a drive or one scan.

    Writes one file per frame and a summary, and prints a table of the paper's measures. The same
    command resumes an interrupted run.
    """
    origin = options.viewpoint(viewpoint)
    frame_range = options.frame_range(frames)
    chosen = options.settings(settings, tau, changes or [])

    from intervis.drives import open_drive
    from intervis.run.stream import run_drive, selected_frames

    drive = open_drive(source, camera=camera)
    if report:
        from intervis.run.report import check_report

        check_report(out, out)
    _note_missing_camera(drive, origin)
    total = len(selected_frames(drive.frame_numbers, frame_range))
    try:
        with progress("frames", total) as advance:
            summary = run_drive(
                drive,
                out,
                settings=chosen,
                viewpoint=origin,
                frames=frame_range,
                progress=advance,
                overwrite=overwrite,
            )
    except KeyboardInterrupt:
        command = "the same command" + (" without --overwrite" if overwrite else "")
        raise InterruptedRunError(f"interrupted: {command} resumes the run in {out}.") from None
    show_run(summary)
    if report and summary.frames:
        show_report(drive, summary, out)
    return 1 if summary.failures else 0


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
    from intervis.run.tables import measures_table, times_table

    if summary.frames:
        show(measures_table(summary.frames).as_text())
        show("")
        show(times_table(summary.content["times_s"], len(summary.frames)).as_text())
    dropped = sum(int(record.measures["n_dropped"]) for record in summary.frames)
    if dropped:
        show(f"{dropped} rows that are no return (NaN, infinite, or 0, 0, 0) were ignored.")
    if summary.reused:
        show(f"{summary.reused} of {len(summary.frames)} frames were reused from an earlier run.")
    show(f"Results: {summary.out}")
    for failure in summary.failures:
        complain(f"frame {failure.number} failed: {failure.reason}")
