"""Sight distances as rows: table, CSV and GeoJSON."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from intervis.arrays import Float64Array
from intervis.plots.tables import Table
from intervis.sight import OCCLUDED, VISIBLE
from intervis.uses.routes.route_file import KMH_PER_MPS
from intervis.uses.routes.sight_distance import DEFICIENT, SUFFICIENT, SightDistances, runs_of


@dataclass(frozen=True, eq=False)
class StationSight:
    """What one station sees along the path; metres, NaN where not known.

    Attributes
    ----------
    chainage_m : float
    place : (3,) float64 array
        On the road, scene frame.
    speed_kmh, grade_percent : float
    required_m, seen_m, possible_m, deficit_m : float
        See `SightDistances`.
    is_bounded : bool
        Whether an occluded object ends `possible_m`; otherwise it is a lower bound.
    verdict : str
    unknown_share, least_probability : float
    blocker : (3,) float64 array
    blocker_chainage_m, blocker_offset_m, blocker_height_m : float
        Along the path, to its left, and above the road there.
    blocker_class : str
        Where labels tell; otherwise empty.
    """

    chainage_m: float
    place: Float64Array
    speed_kmh: float
    grade_percent: float
    required_m: float
    seen_m: float
    possible_m: float
    is_bounded: bool
    verdict: str
    deficit_m: float
    unknown_share: float
    least_probability: float
    blocker: Float64Array
    blocker_chainage_m: float
    blocker_offset_m: float
    blocker_height_m: float
    blocker_class: str


@dataclass(frozen=True, eq=False)
class HiddenStretch:
    """A stretch of the path that a station does not see, though it sees farther ones.

    Attributes
    ----------
    chainage_m : float
        Of the station.
    from_m, to_m : float
        Distance of its first and last hidden object from the station.
    blocker : (3,) float64 array
        Of its first object; NaN where no single surface decides.
    """

    chainage_m: float
    from_m: float
    to_m: float
    blocker: Float64Array


def stations_of(found: SightDistances) -> list[StationSight]:
    """The stations in the order of travel."""
    road, blocker = found.road, found.ending_blocker
    blocker_m, offset_m = road.locate(blocker[:, :2])
    height_m = blocker[:, 2] - road.at(blocker_m)[:, 2]
    columns = (
        *(found.chainage_m, road.at(found.chainage_m), KMH_PER_MPS * found.speed_mps),
        *(100 * found.grade, found.required_m, found.seen_m, found.possible_m),
        *(found.is_bounded, found.verdict, found.deficit_m, found.unknown_share),
        *(found.least_probability, blocker, blocker_m, offset_m, height_m),
        found.blocker_class or [""] * len(found.chainage_m),
    )
    return [StationSight(*row) for row in zip(*columns, strict=True)]


def hidden_stretches(found: SightDistances) -> list[HiddenStretch]:
    """Occluded stretches behind which objects are visible again, by station and distance."""
    stretches = []
    for nth, row in enumerate(found.state):
        seen = np.flatnonzero(row == VISIBLE)
        for begin, end in runs_of(row == OCCLUDED):
            if len(seen) and seen[-1] >= end:
                stretches.append(
                    HiddenStretch(
                        float(found.chainage_m[nth]),
                        float(found.distance_m[begin]),
                        float(found.distance_m[end - 1]),
                        found.blocker[nth, begin],
                    )
                )
    return stretches


def worst_stations(found: SightDistances, count: int) -> list[int]:
    """Indices of the deficient stations with the largest deficits, at most `count`.

    Of neighbours in one run of deficient stations only the worst is taken.
    """
    short = found.verdict == DEFICIENT
    deficit_m = np.where(short, found.deficit_m, 0.0)
    worst = [begin + int(deficit_m[begin:end].argmax()) for begin, end in runs_of(short)]
    return sorted(worst, key=lambda nth: -deficit_m[nth])[:count]


def station_table(found: SightDistances) -> Table:
    """One row for each station."""
    heads = (
        *("chainage, m", "speed, km/h", "grade", "required, m", "seen, m", "possible, m"),
        *("verdict", "deficit, m", "unknown", "least P", "blocker: chainage, offset, height"),
    )
    rows = tuple(
        (
            f"{one.chainage_m:.0f}",
            f"{one.speed_kmh:.0f}",
            f"{one.grade_percent:+.1f} %",
            f"{one.required_m:.0f}",
            f"{one.seen_m:.0f}",
            f"{one.possible_m:.0f}" + ("" if one.is_bounded else "+"),
            one.verdict,
            "-" if math.isnan(one.deficit_m) else f"{one.deficit_m:.0f}",
            f"{100 * one.unknown_share:.0f} %",
            f"{100 * one.least_probability:.0f} %",
            _blocker_text(one),
        )
        for one in stations_of(found)
    )
    return Table("Sight distance", heads, rows)


def _blocker_text(one: StationSight) -> str:
    if math.isnan(one.blocker_chainage_m):
        return "-"
    place = (
        f"{one.blocker_chainage_m:.0f}, {one.blocker_offset_m:+.1f}, {one.blocker_height_m:.1f} m"
    )
    return f"{one.blocker_class} {place}" if one.blocker_class else place


NUMBERS = (
    *("chainage_m", "speed_kmh", "grade_percent", "required_m", "seen_m", "possible_m"),
    *("deficit_m", "unknown_share", "least_probability"),
    *("blocker_chainage_m", "blocker_offset_m", "blocker_height_m"),
)


def as_csv(found: SightDistances) -> str:
    """One row for each station; what is not defined is empty."""
    heads = ["x", "y", "z", *NUMBERS, "is_bounded", "verdict", "blocker_class"]
    lines = [",".join([*heads, "blocker_x", "blocker_y", "blocker_z"])]
    for one in stations_of(found):
        values = [*one.place, *(getattr(one, name) for name in NUMBERS)]
        blocker = [_cell(value) for value in one.blocker]
        words = [str(int(one.is_bounded)), one.verdict, one.blocker_class.replace(",", " ")]
        lines.append(",".join([*map(_cell, values), *words, *blocker]))
    return "\n".join(lines) + "\n"


def _cell(value: float) -> str:
    return f"{value:.9g}" if math.isfinite(value) else ""


def summary(found: SightDistances) -> str:
    """One or two sentences on the whole path."""
    verdict = found.verdict
    counts = {word: int((verdict == word).sum()) for word in (SUFFICIENT, DEFICIENT)}
    rest = len(verdict) - sum(counts.values())
    text = (
        f"{len(verdict)} stations: {counts[SUFFICIENT]} sufficient, {counts[DEFICIENT]} deficient,"
        f" {rest} undecided."
    )
    hidden = hidden_stretches(found)
    if hidden:
        stations = len({one.chainage_m for one in hidden})
        text += f" {len(hidden)} hidden stretches reappear, seen from {stations} stations."
    early = int(found.ends_early.sum())
    if early:
        text += (
            f" {early} of the undecided see all of the path, which ends before the required"
            " distance: --extend M continues it."
        )
    return text


def geojson_of(found: SightDistances) -> dict[str, Any]:
    """Pieces of the path, hidden stretches and blockers as a GeoJSON feature collection.

    Coordinates are metres in the frame of the poses, not longitude and latitude.
    """
    standard = found.standard
    return {
        "type": "FeatureCollection",
        "coordinates": "metres in the frame of the drive's poses",
        "standard": standard.name,
        "eye_m": list(standard.eye_m),
        "object_m": list(standard.object_m),
        "reaction_s": standard.reaction_s,
        "braking": round(standard.braking, 6),
        "note": standard.note,
        "features": [*_pieces(found), *_hidden_features(found)],
    }


def _pieces(found: SightDistances) -> list[dict[str, Any]]:
    """A line for the path from each station to the next, and a point for its blocker."""
    features = []
    stations = stations_of(found)
    ends = [*(one.chainage_m for one in stations[1:]), found.road.length_m]
    for one, end_m in zip(stations, ends, strict=True):
        numbers = {name: _rounded(getattr(one, name)) for name in NUMBERS}
        flags = {"verdict": one.verdict, "is_bounded": bool(one.is_bounded)}
        path = _path(found, one.chainage_m, end_m)
        features.append(_feature("LineString", path, {"kind": "station", **numbers, **flags}))
        if math.isfinite(one.blocker[0]):
            properties = {
                "kind": "blocker",
                "of_chainage_m": _rounded(one.chainage_m),
                "class": one.blocker_class or None,
            }
            features.append(_feature("Point", one.blocker.round(3).tolist(), properties))
    return features


def _hidden_features(found: SightDistances) -> list[dict[str, Any]]:
    features = []
    for one in hidden_stretches(found):
        begin_m, end_m = one.chainage_m + one.from_m, one.chainage_m + one.to_m
        properties = {
            "kind": "hidden stretch",
            "of_chainage_m": _rounded(one.chainage_m),
            "from_m": _rounded(one.from_m),
            "to_m": _rounded(one.to_m),
        }
        path = _path(found, begin_m, max(end_m, begin_m + 0.5 * found.step_m))
        features.append(_feature("LineString", path, properties))
    return features


def _path(found: SightDistances, begin_m: float, end_m: float) -> list[list[float]]:
    own = found.road.chainage_m
    inner = own[(own > begin_m) & (own < end_m)]
    where = np.minimum(np.concatenate([[begin_m], inner, [end_m]]), found.road.length_m)
    path: list[list[float]] = found.road.at(where).round(3).tolist()
    return path


def _feature(kind: str, coordinates: Any, properties: dict[str, Any]) -> dict[str, Any]:
    geometry = {"type": kind, "coordinates": coordinates}
    return {"type": "Feature", "geometry": geometry, "properties": properties}


def _rounded(value: float) -> float | None:
    return round(float(value), 3) if math.isfinite(value) else None
