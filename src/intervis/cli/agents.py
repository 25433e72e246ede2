"""``intervis agents``: who sees whom, frame by frame."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from intervis.cli import options
from intervis.cli.run import Source
from intervis.cli.survey import (
    Frames,
    Hz,
    Risk,
    SensorName,
    frame_of_coordinates,
    returns_above,
)
from intervis.cli.terminal import progress, show

if TYPE_CHECKING:
    from intervis.drives import Drive
    from intervis.sight import Scene
    from intervis.uses.agents.mutual_sight import Agent, MutualSight

SHOWN_NAMES, SHOWN_PAIRS = 8, 40


def agents(
    source: Source,
    file: Annotated[
        Path | None,
        typer.Option(
            "--agents",
            metavar="FILE.csv",
            help="Agents with name, x, y, and maybe z or height above the ground, yaw_deg, fov_deg,"
            " range_m, frame, and length, width, tall of a body; in the frame of the poses.",
        ),
    ] = None,
    labelled: Annotated[
        bool, typer.Option("--labelled", help="The labelled objects of the drive are agents.")
    ] = False,
    categories: Annotated[
        list[str] | None,
        typer.Option(
            "--category", metavar="NAME", help="Labelled objects to take; may be repeated."
        ),
    ] = None,
    scanner: Annotated[
        bool, typer.Option("--scanner/--no-scanner", help="The drive's scanner is an agent.")
    ] = True,
    reach: Annotated[
        float, typer.Option("--range", metavar="M", help="How far labelled objects see.")
    ] = 100.0,
    frames: Frames = None,
    hz: Hz = None,
    sensor: SensorName = None,
    risk: Risk = None,
    csv: Annotated[Path | None, typer.Option(metavar="FILE.csv", help="Write the pairs.")] = None,
    every: Annotated[
        Path | None,
        typer.Option("--every", metavar="FILE.csv", help="Write every pair of every frame."),
    ] = None,
    picture: Annotated[
        Path | None,
        typer.Option(metavar="FILE.png|FILE.svg", help="Draw the first frame, and the matrix."),
    ] = None,
) -> None:
    """Tell which agents see each other, and why not.

    Agents are cars, roadside units, people. Each frame is asked at its own time, if the scans have
    times.
    """
    from intervis.errors import SettingsError

    if file is None and not labelled:
        raise SettingsError("give agents as --agents FILE.csv, or the labels with --labelled.")
    frame_range = options.frame_range(frames)
    outputs = {"--csv": csv, "--every": every, "--picture": picture}
    options.check_output_files(outputs, [source, file])
    options.check_picture_file(picture)

    from intervis.drives import open_drive
    from intervis.run.stream import selected_frames
    from intervis.sight.occupancy_model import DEFAULT_RISK
    from intervis.uses.agents.agents_table import matrix_table, pair_table, pairs_of
    from intervis.uses.agents.mutual_sight import mutual_sight
    from intervis.uses.routes.survey import has_times, scene_of_drive

    drive = open_drive(source)
    options.check_drive_kept(drive, outputs.values())
    numbers = selected_frames(drive.frame_numbers, frame_range)
    with progress("scans", len(numbers)) as advance:
        scene = scene_of_drive(drive, numbers, scans_per_s=hz, sensor=sensor, progress=advance)
    taken = tuple(categories or ()) if labelled else None
    all_agents = _agents(drive, scene, numbers, file, taken, scanner, reach)
    time_s = scene.timestamps_s if has_times(scene) else None
    found = mutual_sight(
        scene, all_agents, numbers, time_s, risk=DEFAULT_RISK if risk is None else risk
    )
    frames_read = f"{len(numbers)} frame{'s' if len(numbers) != 1 else ''}"
    show(f"{drive.name}, {frames_read}; coordinates {frame_of_coordinates(drive)}.")
    if len(all_agents) <= SHOWN_NAMES:
        show(matrix_table(found).as_text() + "\n")
    rows = pairs_of(found)
    show(pair_table(rows[:SHOWN_PAIRS]).as_text())
    if len(rows) > SHOWN_PAIRS:
        show(f"and {len(rows) - SHOWN_PAIRS} more: --csv writes all.")
    _write(found, drive, numbers, csv, every, picture)


def _agents(
    drive: "Drive",
    scene: "Scene",
    numbers: list[int],
    file: Path | None,
    categories: tuple[str, ...] | None,
    scanner: bool,
    reach_m: float,
) -> "list[Agent]":
    from intervis.errors import DriveError
    from intervis.uses.agents.agent_file import labelled_agents, read_agents, scanner_agent

    found = [scanner_agent(drive, numbers)] if scanner else []
    if file is not None:
        found += read_agents(file, scene)
    if categories is not None:
        boxes = labelled_agents(drive, numbers, range_m=reach_m, categories=categories)
        if not boxes:
            there = sorted({box.category for number in numbers for box in drive[number].boxes})
            if not there:
                raise DriveError(f"{drive.name} has no labelled objects in these frames.")
            raise DriveError(
                f"{drive.name} has no labelled {' or '.join(categories)}: choose from"
                f" {', '.join(there)}."
            )
        found += boxes
    return found


def _write(
    found: "MutualSight",
    drive: "Drive",
    numbers: list[int],
    csv: Path | None,
    every: Path | None,
    picture: Path | None,
) -> None:
    from intervis.files import write_text
    from intervis.uses.agents.agents_table import frames_as_csv, pairs_as_csv, pairs_of

    if csv is not None:
        write_text(csv, pairs_as_csv(pairs_of(found)))
    if every is not None:
        write_text(every, frames_as_csv(found))
    if picture is not None:
        from intervis.plots.style import save_figure
        from intervis.uses.agents.agents_figure import agents_picture

        figure = agents_picture(found, returns_above(drive, numbers[:1]))
        save_figure(figure, picture, picture.suffix[1:].lower())
    for name, path in (("Pairs", csv), ("Every frame", every), ("Picture", picture)):
        if path is not None:
            show(f"{name}: {path}")
