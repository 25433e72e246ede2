"""``intervis reproduce`` and ``intervis readings``: the paper's experiments on one's own drive."""

from pathlib import Path
from typing import Annotated

import typer

from intervis.cli import options
from intervis.cli.run import CameraName, Source
from intervis.cli.terminal import progress, show, tell


def reproduce(
    source: Source,
    out: Annotated[Path, typer.Option("--out", help="Folder for the report.")],
    frame: Annotated[
        int | None,
        typer.Option("--frame", metavar="N", help="Frame number; the first without it."),
    ] = None,
    global_points: Annotated[
        bool,
        typer.Option(
            "--global-points/--no-global-points",
            help="Hold every return against every sight line, too (seconds a frame).",
        ),
    ] = True,
    steady_frames: Annotated[
        int,
        typer.Option(
            "--steady-frames", metavar="N", min=0, help="Frames over which steadiness is measured."
        ),
    ] = 8,
    settings: Annotated[
        Path | None, typer.Option(metavar="FILE.toml", help="Settings of the method.")
    ] = None,
    camera: CameraName = None,
    changes: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="NAME=VALUE", help="Change one setting; may be repeated."),
    ] = None,
) -> None:
    """Write Tables 2 to 4 and Figures 3 to 10 of the paper, its values beside those measured."""
    chosen = options.settings(settings, None, changes or [])

    from intervis.drives import open_drive
    from intervis.lab.paper.drive_experiment import run_drive, steps_of_drive
    from intervis.lab.paper.report import make_folders, write_paper_report
    from intervis.lab.paper.tables import claims_table, table_2, table_4

    drive = open_drive(source, camera=camera)
    number = drive.frame_numbers[0] if frame is None else frame
    make_folders(out)
    steps = steps_of_drive(drive, number, with_global=global_points, steady_frames=steady_frames)
    with progress("experiments", steps) as advance:
        experiment = run_drive(
            drive,
            number,
            chosen,
            with_global=global_points,
            steady_frames=steady_frames,
            step=advance,
        )
    report = write_paper_report(drive, experiment, out)
    for table in (
        table_2(experiment.frame),
        table_4(experiment.frame),
        claims_table(experiment.claims),
    ):
        show(table.as_text() + "\n")
    for note in (*experiment.notes, *([f"note: {report.missing}"] if report.missing else [])):
        tell(note)
    show(f"Report: {out / 'report.html'}")


def readings(
    sources: Annotated[list[Path], typer.Argument(help="Drives; four frames of each are used.")],
    out: Annotated[Path, typer.Option("--out", help="Folder for the tables.")],
    frames: Annotated[
        int, typer.Option("--frames", metavar="N", min=1, help="Frames of each drive.")
    ] = 4,
) -> None:
    """Hold every reading of what the paper leaves open against its Table 2 (minutes)."""
    from intervis.drives import open_drive
    from intervis.lab.paper.curve import tpi_curve
    from intervis.lab.paper.interpretations import (
        chosen_reading,
        compare_readings,
        consecutive_frames,
        count_geometries,
        spread_frames,
    )
    from intervis.lab.paper.report import make_folders, write_readings
    from intervis.lab.paper.tables import choices_table
    from intervis.settings import Settings

    drives = [open_drive(source) for source in sources]
    make_folders(out, ())
    chosen = [frame for drive in drives for frame in spread_frames(drive, frames)]
    said = [
        f"{drive.name} {', '.join(str(frame.number) for frame in spread_frames(drive, frames))}"
        for drive in drives
    ]
    with progress("readings", count_geometries() + len(chosen)) as advance:
        scores = compare_readings(chosen, consecutive_frames(drives), step=advance)
        curve = tpi_curve(chosen, step=advance)
    reading = chosen_reading(Settings())
    for path in write_readings(scores, curve, reading, said, out):
        tell(f"{path}")
    show(choices_table(scores, reading).as_text())
