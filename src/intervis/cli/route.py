"""``intervis route``: when targets and zones come into sight along a route, and are lost."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

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
from intervis.cli.terminal import progress, show

if TYPE_CHECKING:
    from intervis.drives import Drive
    from intervis.uses.routes.route import Route
    from intervis.uses.routes.route_answer import RouteAnswer
    from intervis.uses.routes.survey import Survey

SHOWN_ROWS, HIGHEST_M = 40, 100.0
MOMENTS = ("map", "pose")


def route(
    source: Source,
    targets: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="CSV with x, y, z and maybe name, or a scan file; in the frame of the poses.",
        ),
    ] = None,
    zones: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.geojson",
            help="Polygons with the properties name, low_m and high_m above the ground.",
        ),
    ] = None,
    route_file: RouteFile = None,
    back: Back = False,
    offset: Offset = 0.0,
    extend: Extend = None,
    mount: Mount = None,
    eye: Annotated[
        float | None,
        typer.Option(
            metavar="M", help="Height of the eye above the road; default: the route's places."
        ),
    ] = None,
    step: Annotated[float, typer.Option(metavar="M", help="Distance of the places.")] = 1.0,
    reach: Annotated[
        float, typer.Option("--range", metavar="M", help="Farther targets are out of range.")
    ] = 100.0,
    least: Annotated[
        float,
        typer.Option(metavar="SHARE", help="A zone is in sight if this share of it is visible."),
    ] = 0.5,
    moments: Annotated[
        str,
        typer.Option(
            metavar="map|pose", help="Times of the question: none, or that of the route there."
        ),
    ] = "map",
    frames: Frames = None,
    spacing: Spacing = 0.5,
    hz: Hz = None,
    sensor: SensorName = None,
    risk: Risk = None,
    csv: Annotated[
        Path | None, typer.Option(metavar="FILE.csv", help="Write the sightings.")
    ] = None,
    shares: Annotated[
        Path | None,
        typer.Option(metavar="FILE.csv", help="Write the shares of zones at every place."),
    ] = None,
    geojson: Annotated[
        Path | None, typer.Option(metavar="FILE.geojson", help="Write targets and sightings.")
    ] = None,
    picture: Annotated[
        Path | None, typer.Option(metavar="FILE.png|FILE.svg", help="Draw plan and sightings.")
    ] = None,
) -> None:
    """Tell when targets or zones come into sight on a route.

    For each: from how far, for how long, and what hides it before.
    """
    from intervis.errors import SettingsError

    if (targets is None) == (zones is None):
        raise SettingsError("give either --targets FILE or --zones FILE.geojson.")
    if moments not in MOMENTS:
        raise SettingsError(f"--moments must be one of {', '.join(MOMENTS)}, got {moments!r}.")
    if eye is not None and not 0.0 <= eye <= HIGHEST_M:
        raise SettingsError(f"--eye must be from 0 to {HIGHEST_M:g} m, got {eye}.")
    if mount is not None and eye is None:
        raise SettingsError("--mount tells where the road below --eye is: give --eye, too.")
    if not 0.0 < least <= 1.0:
        raise SettingsError(f"--least must be a share above 0 and up to 1, got {least}.")
    if shares is not None and zones is None:
        raise SettingsError("--shares writes the shares of zones: give --zones FILE.geojson.")
    frame_range = options.frame_range(frames)
    outputs = {"--csv": csv, "--shares": shares, "--geojson": geojson, "--picture": picture}
    options.check_output_files(outputs, [source, targets, zones, route_file])
    options.check_picture_file(picture)

    from intervis.drives import open_drive
    from intervis.uses.routes.route_sight_table import sighting_table
    from intervis.uses.routes.survey import route_on_road

    drive = open_drive(source)
    options.check_drive_kept(drive, outputs.values())
    way = route_of(drive, route_file, hz, extend, offset)
    survey = read_survey(drive, way, frame_range, spacing, hz, sensor)
    eye_m = survey.height_above_road(way) if eye is None else eye
    if eye is not None:
        road = route_on_road(survey, way, mount)
        way = road.with_heights(road.points[:, 2] + eye)
    way = way.reversed() if back else way
    answer = _answer(survey, way, targets, zones, least, step, reach, risk, moments)
    show(f"{drive.name}, {len(survey.frames)} scans, route of {way.length_m:.0f} m.")
    rows = answer.rows
    if rows:
        show(sighting_table(rows[:SHOWN_ROWS]).as_text())
    if len(rows) > SHOWN_ROWS:
        show(f"and {len(rows) - SHOWN_ROWS} more: --csv writes all.")
    show(answer.summary)
    _write(answer, drive, survey, eye_m, outputs)


def _answer(
    survey: "Survey",
    way: "Route",
    targets: Path | None,
    zones: Path | None,
    least: float,
    step_m: float,
    reach_m: float,
    risk: float | None,
    moments: str,
) -> "RouteAnswer":
    from intervis.sight.occupancy_model import DEFAULT_RISK
    from intervis.uses.routes.route_answer import targets_along, zones_along
    from intervis.uses.routes.target_file import check_targets_in_scene, read_targets
    from intervis.uses.routes.zone import read_zones

    with progress("places", len(way.stations(step_m))) as advance:
        asked: Any = {
            "step_m": step_m,
            "max_range_m": reach_m,
            "risk": DEFAULT_RISK if risk is None else risk,
            "at_pose_times": moments == "pose",
            "progress": advance,
        }
        if zones is not None:
            polygons = read_zones(zones)
            for zone in polygons:
                check_targets_in_scene(survey.scene, zone.corners)
            return zones_along(survey.scene, way, polygons, least=least, **asked)
        assert targets is not None
        names, points = read_targets(targets)
        check_targets_in_scene(survey.scene, points)
        return targets_along(survey.scene, way, names, points, **asked)


def _write(
    answer: "RouteAnswer",
    drive: "Drive",
    survey: "Survey",
    eye_m: float,
    outputs: dict[str, Path | None],
) -> None:
    import json

    from intervis.files import write_text
    from intervis.uses.routes.route_sight_table import (
        shares_as_csv,
        sightings_as_csv,
        sightings_as_geojson,
    )

    csv, shares, geojson, picture = outputs.values()
    if csv is not None:
        write_text(csv, sightings_as_csv(answer.rows))
    if shares is not None:
        write_text(shares, shares_as_csv(answer.names, answer.chainage_m, answer.shares))
    if geojson is not None:
        content = sightings_as_geojson(
            *(answer.rows, answer.route, answer.names, answer.geometries, answer.seen_share)
        )
        write_text(geojson, json.dumps(content, allow_nan=False) + "\n")
    if picture is not None:
        from intervis.plots.style import save_figure
        from intervis.uses.routes.route_figure import route_picture

        figure = route_picture(answer, returns_above(drive, survey.frames), eye_m)
        save_figure(figure, picture, picture.suffix[1:].lower())
    for name, path in (
        *(("Sightings", csv), ("Shares", shares)),
        *(("Outlines", geojson), ("Picture", picture)),
    ):
        if path is not None:
            show(f"{name}: {path}")
