"""``intervis run``: the paper's method over a drive, or over one scan."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from intervis.cli import options
from intervis.cli.terminal import complain, progress, show, tell

if TYPE_CHECKING:
    from intervis.drives import Drive
    from intervis.run.stream import RunSummary, Viewpoint

Source = Annotated[Path, typer.Argument(help="A drive (KITTI raw, odometry, object, PCD) or scan.")]
CameraName = Annotated[
    str | None, typer.Option("--camera", help="Camera of the drive, for example image_02.")
]


def run(
    source: Source,
    out: Annotated[Path, typer.Option("--out", help="Folder for the results.")],
    tau: Annotated[
        str | None, typer.Option(metavar="K|auto", help="Returns that one node stands for.")
    ] = None,
    frames: Annotated[
        str | None,
        typer.Option(metavar="A:B", help="Frame numbers, B not included; also A:, :B or A."),
    ] = None,
    viewpoint: Annotated[
        str,
        typer.Option(
            metavar="X,Y,Z|camera|sensor|start",
            help="Where one looks from: metres in the sensor's frame; the camera; the sensor; or"
            " the camera's place in the first frame, carried along by the poses.",
        ),
    ] = "camera",
    settings: Annotated[
        Path | None, typer.Option(metavar="FILE.toml", help="Settings of the method.")
    ] = None,
    camera: CameraName = None,
    changes: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="NAME=VALUE", help="Change one setting; may be repeated."),
    ] = None,
    report: Annotated[
        bool,
        typer.Option("--report", help="Draw the middle frame, and write tables and a page."),
    ] = False,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Remove an earlier run from --out first.")
    ] = False,
) -> int:
    """Run the method over a drive or one scan.

    Writes a file for each frame and a summary, and prints a table in the paper's terms. A run
    that was stopped goes on where it stopped when the same command is given again.
    """
    place = options.viewpoint(viewpoint)
    asked_frames = options.frame_range(frames)
    chosen = options.settings(settings, tau, changes or [])

    from intervis.drives import open_drive
    from intervis.run.stream import run as run_drive
    from intervis.run.stream import selected_frames

    drive = open_drive(source, camera=camera)
    _mention_missing_camera(drive, place)
    total = len(selected_frames(drive.frame_numbers, asked_frames))
    try:
        with progress("frames", total) as advance:
            summary = run_drive(
                drive,
                out,
                settings=chosen,
                viewpoint=place,
                frames=asked_frames,
                on_frame=lambda outcome: advance(f"frame {outcome.number}"),
                overwrite=overwrite,
            )
    except KeyboardInterrupt:
        complain(f"interrupted; the same command goes on from where it stopped in {out}.")
        raise typer.Exit(130) from None
    show_run(summary)
    if report and summary.frames:
        show_report(drive, summary, out)
    return 1 if summary.failures else 0


def _mention_missing_camera(drive: "Drive", place: "Viewpoint") -> None:
    if drive.camera is None and place in ("camera", "start"):
        tell("note: this drive has no camera, so the viewpoint is the sensor.")


def show_report(
    drive: "Drive",
    summary: "RunSummary",
    out: Path,
    *,
    source_note: str = "",
    with_sight: bool = False,
) -> None:
    """Draw pictures, write tables and a page, and print where they are."""
    from intervis.run.report import report_run

    with progress("report", 1) as advance:
        report = report_run(drive, summary, out, source_note=source_note, with_sight=with_sight)
        advance("done")
    for path in report.paths[1:]:
        show(f"Report: {path}")
    show(f"Page: {report.paths[0]}")
    if report.missing is not None:
        tell(f"note: {report.missing}")


def show_run(summary: "RunSummary") -> None:
    """Print what a run measured, how long it took, and what failed."""
    from intervis.plots.tables import measures_table, times_table

    if summary.frames:
        show(measures_table(summary.frames).as_text())
        show("")
        show(times_table(summary.content["times_s"], len(summary.frames)).as_text())
    dropped = sum(int(record.measures["n_dropped"]) for record in summary.frames)
    if dropped:
        show(f"{dropped} rows that are no return (NaN, infinite, or 0, 0, 0) were left out.")
    if summary.reused:
        show(f"{summary.reused} of {len(summary.frames)} frames were there from an earlier run.")
    show(f"Results: {summary.out}")
    for failure in summary.failures:
        complain(f"frame {failure.number} failed: {failure.sentence}")
