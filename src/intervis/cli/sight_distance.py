"""``intervis sightdistance``: how far ahead a driver sees the road, against a standard."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from intervis.cli import options
from intervis.cli.run import Source
from intervis.cli.survey import (
    Back,
    Extend,
    Frames,
    Hz,
    Mount,
    Offset,
    Risk,
    RouteFile,
    SensorName,
    Spacing,
    read_survey,
    returns_above,
    route_of,
)
from intervis.cli.terminal import progress, show, tell

if TYPE_CHECKING:
    from intervis.arrays import Float64Array
    from intervis.drives import Drive
    from intervis.uses.routes.route import Route
    from intervis.uses.routes.sight_distance import SightDistances
    from intervis.uses.routes.survey import Survey

KMH_PER_MPS = 3.6


def sightdistance(
    source: Source,
    standard: Annotated[
        str, typer.Option(metavar="aashto|dmrb|austroads", help="Heights and braking.")
    ] = "aashto",
    speed: Annotated[
        float | None,
        typer.Option(metavar="KM/H", help="Speed everywhere; default: the speed of the route."),
    ] = None,
    eye: Annotated[
        str | None, typer.Option(metavar="M[,M]", help="Heights of the eye above the road.")
    ] = None,
    object_height: Annotated[
        str | None,
        typer.Option("--object", metavar="M[,M]", help="Heights of the object above the road."),
    ] = None,
    reaction: Annotated[
        float | None, typer.Option(metavar="S", help="Time until the brakes work, seconds.")
    ] = None,
    braking: Annotated[
        float | None, typer.Option(metavar="SHARE", help="Deceleration as a share of gravity.")
    ] = None,
    route_file: RouteFile = None,
    back: Back = False,
    offset: Offset = 0.0,
    extend: Extend = None,
    mount: Mount = None,
    step: Annotated[float, typer.Option(metavar="M", help="Distance of the stations.")] = 5.0,
    object_step: Annotated[
        float, typer.Option(metavar="M", help="Distance of the objects ahead of a station.")
    ] = 1.0,
    reach: Annotated[
        float | None,
        typer.Option(metavar="M", help="Farthest object; default: 1.5 times the required."),
    ] = None,
    ignore: Annotated[
        float, typer.Option(metavar="M", help="Shorter hidden stretches do not end the sight.")
    ] = 0.0,
    moments: Annotated[
        str,
        typer.Option(
            metavar="map|pose|any",
            help="Times of the question: none; that of the route at the station; or any at which a"
            " scan was taken near, so that what moved away does not hide.",
        ),
    ] = "map",
    frames: Frames = None,
    spacing: Spacing = 0.5,
    hz: Hz = None,
    sensor: SensorName = None,
    risk: Risk = None,
    csv: Annotated[
        Path | None, typer.Option(metavar="FILE.csv", help="Write the stations.")
    ] = None,
    geojson: Annotated[
        Path | None,
        typer.Option(metavar="FILE.geojson", help="Write path, hidden stretches and blockers."),
    ] = None,
    picture: Annotated[
        Path | None,
        typer.Option(metavar="FILE.png|FILE.svg", help="Draw chart over chainage, and plan."),
    ] = None,
    worst: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="Draw the places with the largest deficits."),
    ] = None,
) -> None:
    """Compare sight distances of a road with a standard.

    Objects are placed ahead on the path; all distances run along it. What is unknown is counted
    apart and never as visible.
    """
    from intervis.uses.routes.sight_standard import standard_named

    chosen = standard_named(standard).changed(
        eye_m=options.heights(eye, "--eye"),
        object_m=options.heights(object_height, "--object"),
        reaction_s=reaction,
        braking=braking,
    )
    frame_range = options.frame_range(frames)
    outputs = {"--csv": csv, "--geojson": geojson, "--picture": picture}
    _check(moments, outputs, worst, [source, route_file])

    from intervis.drives import open_drive
    from intervis.sight.occupancy_model import DEFAULT_RISK
    from intervis.uses.routes.sight_distance import sight_distances
    from intervis.uses.routes.survey import classes_of, route_on_road

    drive = open_drive(source)
    options.check_drive_kept(drive, outputs.values())
    route = route_of(drive, route_file, hz, extend, offset)
    survey = read_survey(drive, route, frame_range, spacing, hz, sensor)
    road = route_on_road(survey, route, mount)
    road = road.reversed() if back else road
    with progress("stations", len(road.stations(step))) as advance:
        found = sight_distances(
            survey.scene,
            road,
            chosen,
            speed_mps=None if speed is None else speed / KMH_PER_MPS,
            step_m=step,
            target_step_m=object_step,
            reach_m=reach,
            ignore_m=ignore,
            risk=DEFAULT_RISK if risk is None else risk,
            moments_s=_moments(moments, survey, road, step),
            progress=advance,
        )
    found = replace(found, blocker_class=classes_of(drive, survey, found.ending_blocker))
    show(f"{drive.name}, {len(survey.frames)} scans, path of {road.length_m:.0f} m; {chosen.note}")
    _show(found)
    _tell_hidden_eyes(found, survey)
    _write(found, survey, drive, csv, geojson, picture, worst)


MOMENTS = ("map", "pose", "any")
SHOWN_ROWS = 60
MOST_PICTURES, NEAR_SCANS = 6, 3
"""Pictures of the worst places at most, and scans that are drawn in each."""


def _check(
    moments: str,
    outputs: dict[str, Path | None],
    worst: Path | None,
    inputs: Sequence[Path | None],
) -> None:
    """Check before the work what can be checked."""
    from intervis.errors import SettingsError

    if moments not in MOMENTS:
        raise SettingsError(f"--moments must be one of {', '.join(MOMENTS)}, got {moments!r}.")
    options.check_output_files(outputs, inputs)
    options.check_picture_file(outputs["--picture"])
    if worst is not None:
        options.check_no_input(worst, inputs)
        from intervis.files import make_folder
        from intervis.plots.style import require_matplotlib

        require_matplotlib()
        make_folder(worst)


def _show(found: "SightDistances") -> None:
    from intervis.uses.routes.sight_distance_table import station_table, summary

    table = station_table(found)
    show(replace(table, rows=table.rows[:SHOWN_ROWS]).as_text())
    if len(table.rows) > SHOWN_ROWS:
        show(f"and {len(table.rows) - SHOWN_ROWS} more: --csv writes all.")
    show(summary(found))


def _tell_hidden_eyes(found: "SightDistances", survey: "Survey") -> None:
    """Say at which stations the eye stands in an obstacle or behind one."""
    from intervis.uses.routes.survey import hidden_eyes

    eyes = found.road.above(found.chainage_m, min(found.standard.eye_m))
    hidden = found.chainage_m[hidden_eyes(survey.scene, eyes)]
    if len(hidden):
        tell(
            f"note: at {len(hidden)} of {len(eyes)} stations, the first at chainage"
            f" {hidden[0]:.0f} m, no scan sees the eye: it stands in an obstacle or behind one;"
            " --offset moves the path, --eye the eye."
        )


def _moments(name: str, survey: "Survey", road: "Route", step_m: float) -> "Float64Array | None":
    """Query times of the stations."""
    from intervis.errors import SettingsError
    from intervis.uses.routes.survey import has_times, moments_near, moments_of_poses

    if name == "map":
        return None
    if not has_times(survey.scene):
        raise SettingsError(f"--moments {name} needs times of the scans: give them with --hz.")
    chainage_m = road.stations(step_m)
    choose = moments_of_poses if name == "pose" else moments_near
    return choose(survey, road, chainage_m)


def _write(
    found: "SightDistances",
    survey: "Survey",
    drive: "Drive",
    csv: Path | None,
    geojson: Path | None,
    picture: Path | None,
    worst: Path | None,
) -> None:
    import json

    from intervis.files import write_text
    from intervis.uses.routes.sight_distance_table import as_csv, geojson_of

    if csv is not None:
        write_text(csv, as_csv(found))
    if geojson is not None:
        write_text(geojson, json.dumps(geojson_of(found), allow_nan=False) + "\n")
    if picture is not None:
        from intervis.plots.style import save_figure
        from intervis.uses.routes.sight_distance_figure import sight_distance_picture

        figure = sight_distance_picture(found, returns_above(drive, survey.frames))
        save_figure(figure, picture, picture.suffix[1:].lower())
    if worst is not None:
        _draw_worst(found, survey, drive, worst)
    for name, path in (("Stations", csv), ("Outlines", geojson), ("Picture", picture)):
        if path is not None:
            show(f"{name}: {path}")


def _draw_worst(found: "SightDistances", survey: "Survey", drive: "Drive", folder: Path) -> None:
    """One picture for each of the worst places."""
    import numpy as np

    from intervis.plots.style import save_figure
    from intervis.uses.routes.sight_distance_table import worst_stations
    from intervis.uses.routes.sight_place_figure import place_picture

    stations = worst_stations(found, MOST_PICTURES)
    places = survey.scene.poses[:, :2, 3]
    with progress("pictures", len(stations)) as advance:
        for nth in stations:
            station = found.road.at(found.chainage_m[nth])
            order = np.argsort(np.linalg.norm(places - station[:2], axis=1), kind="stable")
            near = [survey.frames[k] for k in order[:NEAR_SCANS]]
            figure = place_picture(found, nth, returns_above(drive, near), drive[near[0]])
            path = folder / f"chainage_{found.chainage_m[nth]:05.0f}.png"
            save_figure(figure, path)
            advance(path.name)
    if stations:
        show(f"Worst places: {len(stations)} pictures in {folder}")
    else:
        show("No station is deficient: there is no worst place to draw.")
