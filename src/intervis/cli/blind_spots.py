"""``intervis blindspots``: ground around a place where something could stand unseen."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from intervis.cli import options
from intervis.cli.run import CameraName, Source
from intervis.cli.sight import FROM, FrameNumber, point_in_frame
from intervis.cli.terminal import progress, show

if TYPE_CHECKING:
    from intervis.uses.visibility_grid import VisibilityGrid

SHOWN_SPOTS = 20


def blindspots(
    source: Source,
    frame: FrameNumber = None,
    start: Annotated[str, FROM] = "sensor",
    reach: Annotated[float, typer.Option(metavar="M", help="How far to look, metres.")] = 40.0,
    cell: Annotated[float, typer.Option(metavar="M", help="Edge of a cell, metres.")] = 0.4,
    height: Annotated[
        float, typer.Option(metavar="M", help="Height above ground that must be seen, metres.")
    ] = 1.0,
    geojson: Annotated[
        Path | None, typer.Option(metavar="FILE.geojson", help="Write the outlines.")
    ] = None,
    grid_file: Annotated[
        Path | None,
        typer.Option("--grid", metavar="FILE.npz|FILE.pgm", help="Write the grid of cells."),
    ] = None,
    picture: Annotated[
        Path | None, typer.Option(metavar="FILE.png|FILE.svg", help="Draw the grid from above.")
    ] = None,
    steadiness: Annotated[
        str | None,
        typer.Option(
            metavar="A:B",
            help="Instead: how much ground changes between blind and visible from each frame to"
            " the next, and why.",
        ),
    ] = None,
    camera: CameraName = None,
) -> None:
    """List ground that a place does not see, from one scan.

    A blind spot is connected ground that is occluded or unknown. Each spot has its area, its
    nearest distance, what could hide in it, and what hides it.
    """
    place = options.place(start, "--from")
    if steadiness is not None:
        _show_steadiness(
            *(source, camera, steadiness, place, reach, cell, height),
            other=(frame, geojson, grid_file, picture),
        )
        return
    options.check_output_files(
        {"--geojson": geojson, "--grid": grid_file, "--picture": picture}, [source]
    )
    outputs = [geojson, grid_file, picture]
    if grid_file is not None and grid_file.suffix.lower() == ".pgm":
        outputs.append(grid_file.with_suffix(".yaml"))
        options.check_output_file(outputs[-1], [source])
    options.check_picture_file(picture)

    import json

    import numpy as np

    from intervis.drives import open_drive
    from intervis.files import write_text
    from intervis.uses.blind_spots import blind_spots, geojson_of, spot_table
    from intervis.uses.grid_file import check_grid_file, save_grid
    from intervis.uses.registration import registered_scene
    from intervis.uses.visibility_grid import visibility_grid

    check_grid_file(grid_file)
    drive = open_drive(source, camera=camera)
    options.check_drive_kept(drive, outputs)
    now = drive[drive.frame_numbers[0] if frame is None else frame]
    with progress("blind spots", 3) as advance:
        scene = registered_scene(drive, now, ())
        advance("scan")
        viewpoint = point_in_frame(now, place, "--from")
        grid = visibility_grid(
            scene, viewpoint, now.points, reach_m=reach, cell_m=cell, height_m=height
        )
        advance("cells")
        spots = blind_spots(grid)
        advance("spots")
    show(f"{drive.name}, frame {now.number}; coordinates in its sensor frame. {_shares(grid)}")
    if np.isfinite(grid.ground_m).any():
        show(spot_table(spots[:SHOWN_SPOTS]).as_text())
    if len(spots) > SHOWN_SPOTS:
        show(f"and {len(spots) - SHOWN_SPOTS} more, farther away: --geojson writes all.")
    if geojson is not None:
        write_text(geojson, json.dumps(geojson_of(spots, grid), allow_nan=False) + "\n")
    if grid_file is not None:
        save_grid(grid_file, grid)
    if picture is not None:
        from intervis.plots.style import save_figure
        from intervis.uses.grid_figure import grid_picture

        save_figure(grid_picture(grid, spots), picture, picture.suffix[1:].lower())
    for name, path in (("Outlines", geojson), ("Grid", grid_file), ("Picture", picture)):
        if path is not None:
            show(f"{name}: {path}")


def _show_steadiness(
    source: Path,
    camera: str | None,
    frames: str,
    place: "str | tuple[float, float, float]",
    reach_m: float,
    cell_m: float,
    height_m: float,
    other: "tuple[object, ...]",
) -> None:
    from intervis.drives import open_drive
    from intervis.errors import SettingsError
    from intervis.run.stream import selected_frames
    from intervis.uses.steadiness import flip_table, flips_of_drive

    if any(option is not None for option in other):
        raise SettingsError(
            "--steadiness prints a table: leave out --frame, --geojson, --grid and --picture."
        )
    frame_range = options.frame_range(frames, "--steadiness")
    drive = open_drive(source, camera=camera)
    numbers = selected_frames(drive.frame_numbers, frame_range)
    viewpoint = point_in_frame(drive[numbers[0]], place, "--from")
    with progress("frames", len(numbers) - 1) as advance:
        found = flips_of_drive(
            *(drive, numbers),
            viewpoint=viewpoint,
            reach_m=reach_m,
            cell_m=cell_m,
            height_m=height_m,
            progress=advance,
        )
    show(f"{drive.name}, {len(numbers)} frames.")
    show(flip_table(found, numbers).as_text())


def _shares(grid: "VisibilityGrid") -> str:
    import numpy as np

    from intervis.uses.visibility_grid import GROUND_WITHIN_M

    known = np.isfinite(grid.ground_m)
    near = f"ground below the scanner within {GROUND_WITHIN_M:g} m"
    if not known.any():
        return f"No cell has {near}: nothing is judged."
    visible, occluded = (100 * float(np.mean(grid.state[known] == value)) for value in (1, 0))
    without = 100 * float(np.mean(~known))
    left_out = f" {without:.0f} % have no {near} and are left out." if without else ""
    return f"Of the cells judged {visible:.0f} % are visible, {occluded:.0f} % occluded.{left_out}"
