"""``intervis site``: where to put roadside scanners or cameras."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from intervis.cli import options
from intervis.cli.run import Source
from intervis.cli.survey import (
    Frames,
    Risk,
    SensorName,
    frame_of_coordinates,
    returns_above,
)
from intervis.cli.terminal import progress, show

if TYPE_CHECKING:
    from intervis.drives import Drive
    from intervis.sight import Scene
    from intervis.uses.sites.candidate import Candidate
    from intervis.uses.sites.demand import Demand
    from intervis.uses.sites.reach import Reach
    from intervis.uses.sites.siting import Siting

ABOVE_GROUND_M = 0.3
"""Returns lower above the ground are not drawn."""
WAY = "way"
FIELD_DEG = "-22.5,22.5"
"""Of --beam-spacing, where --field is not given."""


def site(
    source: Source,
    count: Annotated[int, typer.Option("-k", "--count", metavar="K", help="Places to choose.")] = 1,
    zones: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.geojson",
            help="What is to be seen: polygons with the properties name, low_m and high_m above the"
            " ground, and weight of a square metre.",
        ),
    ] = None,
    targets: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Instead of zones: CSV with x, y, z and maybe weight, or a scan."
        ),
    ] = None,
    candidates: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="CSV, JSON or GeoJSON points with x, y, and maybe name, z or height, yaw_deg,"
            " fov_deg.",
        ),
    ] = None,
    along: Annotated[
        str | None,
        typer.Option(
            metavar="FILE|way",
            help="Candidates along a polyline: way points or poses, or the way of the scanner.",
        ),
    ] = None,
    offset: Annotated[
        str, typer.Option(metavar="M,...", help="Offsets to the left of --along, metres.")
    ] = "0",
    within: Annotated[
        Path | None, typer.Option(metavar="FILE.geojson", help="Candidates within polygons.")
    ] = None,
    every: Annotated[
        float, typer.Option(metavar="M", help="Distance of candidates of --along and --within.")
    ] = 5.0,
    mast: Annotated[
        float, typer.Option(metavar="M", help="Height above the ground, where none is given.")
    ] = 5.0,
    cell: Annotated[float, typer.Option(metavar="M", help="Edge of the cells of zones.")] = 1.0,
    users: Annotated[
        str | None,
        typer.Option(
            metavar="labels|FILE.csv",
            help="Weigh targets by road users: the drive's labelled boxes, or x, y and maybe"
            " weight.",
        ),
    ] = None,
    background: Annotated[
        float | None,
        typer.Option(metavar="SHARE", help="Weight that --users leaves everywhere; default: 0.1."),
    ] = None,
    scanner: Annotated[
        str, typer.Option(metavar="NAME", help="Scanner at the places; a preset as of --sensor.")
    ] = "OS1-128",
    beam_spacing: Annotated[
        str | None,
        typer.Option(
            metavar="AZ,EL", help="Instead: degrees between beams or pixels; needs --range."
        ),
    ] = None,
    field: Annotated[
        str | None,
        typer.Option(
            metavar="LOW,HIGH",
            help="Elevations that --beam-spacing covers, degrees; default: -22.5,22.5.",
        ),
    ] = None,
    reach: Annotated[
        float | None, typer.Option("--range", metavar="M", help="Default: that of the scanner.")
    ] = None,
    thing: Annotated[
        str,
        typer.Option("--object", metavar="car|bicycle|pedestrian|L,W,H", help="Expected returns."),
    ] = "car",
    least_returns: Annotated[
        float, typer.Option(metavar="N", help="With fewer returns a target is out of reach.")
    ] = 10.0,
    views: Annotated[
        int, typer.Option(metavar="M", help="By so many places each target is to be seen.")
    ] = 1,
    combine: Annotated[
        str, typer.Option(metavar="best|independent", help="How several places add up.")
    ] = "best",
    certain: Annotated[
        bool, typer.Option("--certain", help="Count only lines that are called visible.")
    ] = False,
    method: Annotated[
        str, typer.Option(metavar="auto|greedy|exact", help="auto: exact for small problems.")
    ] = "auto",
    frames: Frames = None,
    spacing: Annotated[
        float, typer.Option(metavar="M", help="Least distance between scans that are used.")
    ] = 0.5,
    sensor: SensorName = None,
    risk: Risk = None,
    csv: Annotated[
        Path | None, typer.Option(metavar="FILE.csv", help="Write all candidates.")
    ] = None,
    json: Annotated[
        Path | None, typer.Option(metavar="FILE.json", help="Write the whole answer.")
    ] = None,
    geojson: Annotated[
        Path | None, typer.Option(metavar="FILE.geojson", help="Write candidates and zones.")
    ] = None,
    picture: Annotated[
        Path | None, typer.Option(metavar="FILE.png|FILE.svg", help="Draw the plan.")
    ] = None,
) -> None:
    """Choose places for roadside scanners or cameras.

    Of all candidates it takes those that together see the most of the zones. Prints what each
    place and all together see, do not see and may see, the returns to expect on an object, and
    how far the choice may be from the best one.
    """
    from intervis.errors import SettingsError

    if (zones is None) == (targets is None):
        raise SettingsError("give either --zones FILE.geojson or --targets FILE.")
    if sum(one is not None for one in (candidates, along, within)) != 1:
        raise SettingsError(
            "give candidates by one of --candidates FILE, --along FILE|way and --within FILE."
        )
    if background is not None and users is None:
        raise SettingsError("--background is about the weights of --users: give --users, too.")
    if not 0.0 <= mast <= 1000.0:
        raise SettingsError(f"--mast must be from 0 to 1000 m, got {mast}.")
    frame_range = options.frame_range(frames)
    outputs = {"--csv": csv, "--json": json, "--geojson": geojson, "--picture": picture}
    files = [Path(one) for one in (along, users) if one not in (None, WAY, "labels")]
    options.check_output_files(outputs, [source, zones, targets, candidates, within, *files])
    options.check_picture_file(picture)
    reached = _reach(scanner, beam_spacing, field, reach, thing, least_returns)
    offsets_m = options.numbers(offset, "--offset", "metres to the left, as 5 or -6.5,5")

    from intervis.drives import open_drive
    from intervis.run.stream import selected_frames
    from intervis.sight.occupancy_model import DEFAULT_RISK
    from intervis.uses.sites.choice import check_count
    from intervis.uses.sites.coverage import batches
    from intervis.uses.sites.demand import BACKGROUND
    from intervis.uses.sites.siting import best_sites

    kept = BACKGROUND if background is None else background

    drive = open_drive(source)
    options.check_drive_kept(drive, outputs.values())
    numbers = selected_frames(drive.frame_numbers, frame_range)
    scene, used = _scene(drive, numbers, spacing, sensor)
    places = _candidates(drive, scene, candidates, along, within, offsets_m, every, mast)
    check_count(len(places), count, views, method)
    demand = _demand(drive, used, scene, zones, targets, cell, users, kept)
    with progress("candidates", len(batches(len(places), len(demand.points)))) as advance:
        chosen: Any = {"views": views, "combine": combine, "method": method, "certain": certain}
        chosen["risk"] = DEFAULT_RISK if risk is None else risk
        found = best_sites(scene, places, demand, count, reach=reached, progress=advance, **chosen)
    _show(found, drive, len(used))
    settings = {"drive": drive.name, "frames": used, "mast_m": mast, "cell_m": cell}
    settings |= {"risk": chosen["risk"], "users": users, "background": kept}
    _write(found, drive, scene, used, settings, outputs)


def _reach(
    scanner: str,
    beam_spacing: str | None,
    field: str | None,
    range_m: float | None,
    thing: str,
    least_returns: float,
) -> "Reach":
    from dataclasses import replace

    from intervis.errors import SettingsError
    from intervis.sight.query_checks import positive_length
    from intervis.sight.sensor import sensor_named
    from intervis.uses.sites.reach import Reach, object_size, scanner_with

    far_m = None if range_m is None else positive_length("--range", range_m)
    if beam_spacing is None:
        if field is not None:
            raise SettingsError(
                "--field is about the beams of --beam-spacing: give --beam-spacing, too."
            )
        sensor = sensor_named(scanner)
        if far_m is not None:
            sensor = replace(sensor, max_range_m=far_m, min_range_m=0.0)
    else:
        pairs = {"--beam-spacing": beam_spacing, "--field": field or FIELD_DEG}
        values = [
            options.numbers(text, name, "two angles, degrees") for name, text in pairs.items()
        ]
        if [len(one) for one in values] != [2, 2]:
            raise SettingsError("--beam-spacing is AZ,EL and --field LOW,HIGH, in degrees.")
        if far_m is None:
            raise SettingsError("--beam-spacing describes a scanner of its own: give its --range.")
        sensor = scanner_with((values[0][0], values[0][1]), (values[1][0], values[1][1]), far_m)
    return Reach(sensor, object_size(thing), least_returns)


def _scene(
    drive: "Drive", numbers: list[int], spacing_m: float, sensor: str | None
) -> "tuple[Scene, list[int]]":
    """The scene of the scans that are a distance apart, and their numbers."""
    from intervis.uses.routes.survey import scene_of_drive, spaced

    used = spaced(drive, numbers, spacing_m)
    with progress("scans", len(used)) as advance:
        return scene_of_drive(drive, used, sensor=sensor, progress=advance), used


def _candidates(
    drive: "Drive",
    scene: "Scene",
    file: Path | None,
    along: str | None,
    within: Path | None,
    offsets_m: tuple[float, ...],
    every_m: float,
    mast_m: float,
) -> "list[Candidate]":
    from intervis.cli.survey import route_of
    from intervis.uses.routes.zone import read_zones
    from intervis.uses.sites.candidate import candidates_along, candidates_within
    from intervis.uses.sites.candidate_file import read_candidates

    if file is not None:
        return read_candidates(file, scene, mast_m)
    if within is not None:
        return candidates_within(scene, read_zones(within), every_m, mast_m=mast_m)
    route = route_of(drive, None if along in (None, WAY) else Path(str(along)), None)
    return candidates_along(scene, route, every_m, offsets_m=offsets_m, mast_m=mast_m)


def _demand(
    drive: "Drive",
    numbers: list[int],
    scene: "Scene",
    zones: Path | None,
    targets: Path | None,
    cell_m: float,
    users: str | None,
    background: float,
) -> "Demand":
    from intervis.uses.routes.target_file import check_targets_in_scene, read_targets
    from intervis.uses.routes.zone import read_zones
    from intervis.uses.sites.candidate_file import read_users, read_weights
    from intervis.uses.sites.demand import (
        demand_of_points,
        demand_of_zones,
        labelled_users,
        weighted_by_users,
    )

    if zones is not None:
        polygons = read_zones(zones)
        for zone in polygons:
            check_targets_in_scene(scene, zone.corners)
        demand = demand_of_zones(scene, polygons, cell_m)
    else:
        assert targets is not None
        _, points = read_targets(targets)
        check_targets_in_scene(scene, points)
        weight = read_weights(targets) if targets.suffix.lower() == ".csv" else None
        demand = demand_of_points(points, weight)
    if users is None:
        return demand
    if users == "labels":
        return weighted_by_users(demand, labelled_users(drive, numbers), None, background)
    places, weight = read_users(Path(users))
    return weighted_by_users(demand, places, weight, background)


def _show(found: "Siting", drive: "Drive", scans: int) -> None:
    from intervis.uses.sites.reach import OBJECTS
    from intervis.uses.sites.site_table import site_table, summary_of, zone_table

    covered = found.coverage
    sensor, size_m = covered.reach.sensor, covered.reach.size_m
    things = {size: name for name, size in OBJECTS.items()}
    counts = {"scan": scans, "candidate": len(covered.candidates), "target": len(found.state)}
    parts = [f"{count:,} {what}{'s' if count != 1 else ''}" for what, count in counts.items()]
    where = frame_of_coordinates(drive)
    show(f"{drive.name}, {parts[0]}; {', '.join(parts[1:])}; coordinates {where}.")
    show(site_table(found).as_text())
    if len(covered.demand.zones) > 1:
        show("\n" + zone_table(found).as_text())
    thing = things.get(size_m, " x ".join(f"{edge:g}" for edge in size_m) + " m")
    show(
        f"\nReturns: of a sweep of {sensor.name} ({sensor.beams} beams, {sensor.lowest_deg:g} to"
        f" {sensor.highest_deg:g} degrees, {sensor.max_range_m:g} m) on an object ({thing}) that"
        f" stands anywhere; below {covered.reach.least_returns:g} in free sight a target is out of"
        " reach."
    )
    demand = covered.demand
    if demand.users:
        show(
            f"Weights: {demand.users:,} places of road users, {demand.users_outside:,} of them not"
            " at a target."
        )
    show(summary_of(found))


def _write(
    found: "Siting",
    drive: "Drive",
    scene: "Scene",
    used: list[int],
    settings: dict[str, Any],
    outputs: dict[str, Path | None],
) -> None:
    from intervis.files import write_text
    from intervis.uses.sites.site_table import (
        candidates_as_csv,
        siting_as_geojson,
        siting_as_json,
    )

    csv, json, geojson, picture = outputs.values()
    if csv is not None:
        write_text(csv, candidates_as_csv(found))
    if json is not None:
        write_text(json, siting_as_json(found, settings))
    if geojson is not None:
        write_text(geojson, siting_as_geojson(found))
    if picture is not None:
        from intervis.plots.style import save_figure
        from intervis.uses.routes.zone import GROUND_SCANS
        from intervis.uses.sites.site_figure import siting_picture

        returns = returns_above(drive, used)
        above_m = returns[:, 2] - scene.ground_height(returns[:, :2], GROUND_SCANS)
        figure = siting_picture(found, returns[above_m > ABOVE_GROUND_M])
        save_figure(figure, picture, picture.suffix[1:].lower())
    for name, path in (
        *(("Candidates", csv), ("Answer", json)),
        *(("Outlines", geojson), ("Picture", picture)),
    ):
        if path is not None:
            show(f"{name}: {path}")
