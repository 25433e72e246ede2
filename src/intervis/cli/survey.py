"""Options and readers of commands that use the scans of a whole drive, and a route through them."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from intervis.cli.terminal import progress

if TYPE_CHECKING:
    from collections.abc import Sequence

    from intervis.arrays import Float64Array
    from intervis.drives import Drive
    from intervis.uses.routes.route import Route
    from intervis.uses.routes.survey import Survey

Frames = Annotated[
    str | None,
    typer.Option(
        metavar="A:B", help="Frame numbers A to B - 1 to use; also A:, :B or A; default: all."
    ),
]
RouteFile = Annotated[
    Path | None,
    typer.Option(
        "--route",
        metavar="FILE",
        help="Poses of KITTI or TUM, or way points as CSV with x, y and maybe z, speed_kmh,"
        " time_s, in the frame of the drive's poses; default: the way of the scanner.",
    ),
]
Back = Annotated[bool, typer.Option("--back", help="Travel the route backwards.")]
Offset = Annotated[float, typer.Option(metavar="M", help="Move the path to the left, metres.")]
Extend = Annotated[
    float | None, typer.Option(metavar="M", help="Continue the route straight at its end.")
]
Mount = Annotated[
    float | None,
    typer.Option(
        metavar="M",
        help="Height of the route's places above the road; default: the scans show the road.",
    ),
]
Spacing = Annotated[
    float, typer.Option(metavar="M", help="Least distance between scans that are used.")
]
Hz = Annotated[
    float | None, typer.Option(metavar="F", help="Scans a second, where the drive has no times.")
]
SensorName = Annotated[
    str | None,
    typer.Option(
        "--sensor",
        metavar="NAME",
        help="HDL-64E, HDL-32E, VLP-16, OS1-128 or generic: sharper than what is derived from each"
        " scan.",
    ),
]
Risk = Annotated[
    float | None,
    typer.Option(
        metavar="R",
        help="How often visible and occluded may each be wrong, 0.001 to 0.2; default: 0.05.",
    ),
]
SHOWN_SCANS, SHOWN_RETURNS = 12, 250_000
"""So many scans, and of their returns some so many, are drawn from above."""


def route_of(
    drive: "Drive",
    path: Path | None,
    hz: float | None,
    extend_m: float | None = None,
    offset_m: float = 0.0,
) -> "Route":
    """The route of a file, or the way of the drive's scanner; longer, and moved to the left."""
    from intervis.uses.routes.route_file import drive_start_s, read_route, route_of_drive

    route = route_of_drive(drive, hz) if path is None else read_route(path, drive_start_s(drive))
    route = route.extended(extend_m) if extend_m is not None else route
    return route.shifted(offset_m) if offset_m else route


def read_survey(
    drive: "Drive",
    route: "Route",
    frames: tuple[int | None, int | None] | None,
    spacing_m: float,
    hz: float | None,
    sensor: str | None,
) -> "Survey":
    """The scans of the chosen frames; the route must not leave them."""
    from intervis.run.stream import selected_frames
    from intervis.uses.routes.survey import check_route_in_survey, survey_of

    numbers = selected_frames(drive.frame_numbers, frames)
    with progress("scans", len(numbers)) as advance:
        survey = survey_of(
            drive,
            route,
            numbers=numbers,
            spacing_m=spacing_m,
            scans_per_s=hz,
            sensor=sensor,
            progress=advance,
        )
    check_route_in_survey(survey, route)
    return survey


def frame_of_coordinates(drive: "Drive") -> str:
    """Whose frame the coordinates of a scene of the drive are in, for messages."""
    return "in the frame of its poses" if drive.poses else "in the frame of its scan"


def returns_above(drive: "Drive", numbers: "Sequence[int]") -> "Float64Array":
    """(N, 3) returns of some of the frames, for pictures; frame of the poses, metres."""
    import numpy as np

    from intervis.arrays import finite_rows
    from intervis.transform import transform
    from intervis.uses.routes.survey import poses_in_scene

    every = max(1, -(-len(numbers) // SHOWN_SCANS))
    parts = []
    for number, pose in poses_in_scene(drive, numbers[::every]).items():
        frame = drive[number]
        points = frame.points[finite_rows(frame.points), :3]
        parts.append(
            transform(
                pose,
                points[:: max(1, len(points) * min(len(numbers), SHOWN_SCANS) // SHOWN_RETURNS)],
            )
        )
    return np.concatenate(parts)
