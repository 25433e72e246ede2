"""``intervis reproduce`` and ``intervis interpretations``: the paper's experiments on a drive."""

from pathlib import Path
from typing import Annotated

import typer

from intervis.cli import options
from intervis.cli.run import CameraName, SettingChanges, SettingsFile, Source
from intervis.cli.terminal import progress, show, tell


def reproduce(
    source: Source,
    out: Annotated[Path, typer.Option("--out", help="Folder for the report.")],
    frame: Annotated[
        int | None,
        typer.Option("--frame", metavar="N", help="Frame number; default: the first."),
    ] = None,
    global_points: Annotated[
        bool,
        typer.Option(
            "--global-points/--no-global-points",
            help="Also run global points: every return against every sight line, seconds a frame.",
        ),
    ] = True,
    consecutive_frames: Annotated[
        int,
        typer.Option(
            "--consecutive-frames",
            metavar="N",
            min=0,
            help="Frames over which temporal consistency is measured.",
        ),
    ] = 8,
    settings: SettingsFile = None,
    camera: CameraName = None,
    changes: SettingChanges = None,
) -> None:
    """Reproduce the tables and figures of the paper.

    Tables 2 to 4 and Figures 3 to 10, with the printed values beside.
    """
    chosen = options.settings(settings, None, changes or [])

    from intervis.drives import open_drive
    from intervis.lab.paper.drive_experiment import run_drive, steps_of_drive
    from intervis.lab.paper.report import check_folder, make_folders, write_paper_report
    from intervis.lab.paper.tables import table_2, table_4

    drive = open_drive(source, camera=camera)
    number = drive.frame_numbers[0] if frame is None else frame
    _ = drive[number]  # raises before a folder is made
    check_folder(out)
    make_folders(out)
    steps = steps_of_drive(
        drive, number, with_global=global_points, consecutive_frames=consecutive_frames
    )
    with progress("experiments", steps) as advance:
        experiment = run_drive(
            drive,
            number,
            chosen,
            with_global=global_points,
            consecutive_frames=consecutive_frames,
            progress=advance,
        )
    report = write_paper_report(drive, experiment, out)
    for table in (table_2(experiment.frame), table_4(experiment.frame)):
        show(table.as_text() + "\n")
    for claim in experiment.claims:
        show(claim.as_text())
    for note in (*experiment.notes, *([f"note: {report.missing}"] if report.missing else [])):
        tell(note)
    show(f"\nReport: {out / 'report.html'}")


def interpretations(
    sources: Annotated[list[Path], typer.Argument(help="Drives.")],
    out: Annotated[Path, typer.Option("--out", help="Folder for the tables.")],
    frames: Annotated[
        int,
        typer.Option(
            "--frames", metavar="N", min=1, help="Frames of each drive, from first to last."
        ),
    ] = 4,
) -> None:
    """Compare interpretations of the paper with its Table 2.

    Every interpretation of its open choices, which takes minutes.
    """
    from intervis.drives import open_drive
    from intervis.lab.paper.curve import tpi_curve
    from intervis.lab.paper.interpretation_tables import choices_table
    from intervis.lab.paper.interpretations import (
        compare_interpretations,
        consecutive_frames,
        count_geometries,
        interpretation_of,
        spread_frames,
    )
    from intervis.lab.paper.report import make_folders, write_interpretations
    from intervis.settings import Settings

    drives = [open_drive(source) for source in sources]
    make_folders(out, ())
    chosen = [frame for drive in drives for frame in spread_frames(drive, frames)]
    names = [
        f"{drive.name} {', '.join(str(frame.number) for frame in spread_frames(drive, frames))}"
        for drive in drives
    ]
    with progress("interpretations", count_geometries() + len(chosen)) as advance:
        scores = compare_interpretations(chosen, consecutive_frames(drives), progress=advance)
        curve = tpi_curve(chosen, progress=advance)
    default = interpretation_of(Settings())
    for path in write_interpretations(scores, curve, default, names, out):
        tell(f"{path}")
    show(choices_table(scores, default).as_text())
