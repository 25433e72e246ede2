"""``intervis objects``: which share of each labelled object is visible."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from intervis.cli import options
from intervis.cli.run import CameraName, Source
from intervis.cli.sight import FROM, point_in_frame
from intervis.cli.survey import Frames
from intervis.cli.terminal import progress, show

if TYPE_CHECKING:
    from intervis.uses.objects import ObjectSight


def objects(
    source: Source,
    frames: Frames = None,
    start: Annotated[str, FROM] = "sensor",
    csv: Annotated[
        Path | None,
        typer.Option(metavar="FILE.csv", help="Write the numbers of --json as a table."),
    ] = None,
    json_file: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Write all numbers as JSON.")
    ] = None,
    picture: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.png|FILE.svg", help="Draw the boxes of the first frame that has some."
        ),
    ] = None,
    camera: CameraName = None,
) -> None:
    """Measure the visible share of labelled objects.

    One scan of each frame is asked. Shares are of the solid angle of the faces of the object's box.
    Where labels say how far an object is occluded, a second table compares.
    """
    frame_range = options.frame_range(frames)
    place = options.place(start, "--from")
    options.check_output_files({"--csv": csv, "--json": json_file, "--picture": picture}, [source])
    options.check_picture_file(picture)

    from intervis.drives import open_drive
    from intervis.errors import DriveError
    from intervis.files import write_text
    from intervis.run.stream import selected_frames
    from intervis.uses.objects import (
        agreement_table,
        object_csv,
        object_table,
        objects_of_frame,
    )
    from intervis.uses.registration import registered_scene

    drive = open_drive(source, camera=camera)
    options.check_drive_kept(drive, [csv, json_file, picture])
    numbers = selected_frames(drive.frame_numbers, frame_range)
    found: list[ObjectSight] = []
    drawn = picture is None
    with progress("frames", len(numbers)) as advance:
        for number in numbers:
            frame = drive[number]
            if frame.boxes:
                scene = registered_scene(drive, frame, ())
                viewpoint = point_in_frame(frame, place, "--from")
                of_frame = objects_of_frame(frame, scene, viewpoint)
                found += of_frame
                if picture is not None and not drawn:
                    from intervis.plots.style import save_figure
                    from intervis.uses.object_figure import object_picture

                    figure = object_picture(frame, of_frame, viewpoint)
                    save_figure(figure, picture, picture.suffix[1:].lower())
                    drawn = True
            advance(f"frame {number}")
    if not found:
        raise DriveError(f"no frame of {drive.name} has labelled objects: choose a labelled drive.")
    table, agreement = object_table(found), agreement_table(found)
    show(table.as_text())
    if agreement.rows:
        show("\n" + agreement.as_text())
    if csv is not None:
        write_text(csv, object_csv(found))
    if json_file is not None:
        import json

        content = [one.to_json() for one in found]
        write_text(json_file, json.dumps(content, indent=1, allow_nan=False) + "\n")
    for name, path in (("Table", csv), ("Numbers", json_file), ("Picture", picture)):
        if path is not None:
            show(f"{name}: {path}")
