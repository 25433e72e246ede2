"""Sightings along a route as rows: table, CSV and GeoJSON."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from intervis.arrays import Float64Array
from intervis.plots.tables import Table
from intervis.uses.routes.route import Route
from intervis.uses.routes.route_sight import sightings


@dataclass(frozen=True)
class SightingRow:
    """When a target comes into sight and when it is lost; metres, seconds, NaN where not known.

    Attributes
    ----------
    name : str
    nth : int
        Of this target's sightings, from 1.
    from_m, to_m : float
        Chainage of the first and the last place that sees it.
    length_m : float
    from_s, to_s : float
        Time at these places.
    first_range_m, last_range_m, nearest_m : float
        Distance from the eye to the target at these places, and the least in between.
    before, after : str
        See `Sighting`.
    """

    name: str
    nth: int
    from_m: float
    to_m: float
    length_m: float
    from_s: float
    to_s: float
    first_range_m: float
    last_range_m: float
    nearest_m: float
    before: str
    after: str


def sighting_rows(
    state: NDArray[np.int8],
    names: Sequence[str],
    targets: Float64Array,
    eyes: Float64Array,
    chainage_m: Float64Array,
    time_s: Float64Array,
    close_gaps: int = 0,
) -> list[SightingRow]:
    """Rows of all sightings, by target and place.

    Parameters
    ----------
    state : (P, M) int8 array
    names : sequence of M str
    targets : (M, 3) float64 array
        Scene frame; of zones their middles.
    eyes : (P, 3) float64 array
    chainage_m, time_s : (P,) float64 arrays
    close_gaps : int
        See `sightings`.
    """
    rows: list[SightingRow] = []
    for one in sightings(state, close_gaps):
        range_m = np.linalg.norm(eyes[one.first : one.last + 1] - targets[one.target], axis=1)
        again = bool(rows) and rows[-1].name == names[one.target]
        rows.append(
            SightingRow(
                names[one.target],
                rows[-1].nth + 1 if again else 1,
                *(float(chainage_m[one.first]), float(chainage_m[one.last])),
                float(chainage_m[one.last] - chainage_m[one.first]),
                *(float(time_s[one.first]), float(time_s[one.last])),
                *(float(range_m[0]), float(range_m[-1]), float(range_m.min())),
                *(one.before, one.after),
            )
        )
    return rows


HEADS = (
    *("target", "nth", "from, m", "to, m", "for, m", "for, s", "first range, m", "nearest, m"),
    *("last range, m", "before", "after"),
)


def sighting_table(rows: Sequence[SightingRow], title: str = "Sightings") -> Table:
    """One row for each sighting."""
    cells = tuple(
        (
            row.name,
            str(row.nth),
            f"{row.from_m:.0f}",
            f"{row.to_m:.0f}",
            f"{row.length_m:.0f}",
            "-" if math.isnan(row.from_s) else f"{row.to_s - row.from_s:.1f}",
            f"{row.first_range_m:.1f}",
            f"{row.nearest_m:.1f}",
            f"{row.last_range_m:.1f}",
            row.before,
            row.after,
        )
        for row in rows
    )
    return Table(title, HEADS, cells)


NUMBERS = (
    *("from_m", "to_m", "length_m", "from_s", "to_s"),
    *("first_range_m", "last_range_m", "nearest_m"),
)


def sightings_as_csv(rows: Sequence[SightingRow]) -> str:
    """One row for each sighting, unrounded; what is not known is empty."""
    heads = ("target", "nth", *NUMBERS, "before", "after")
    cells = tuple(
        (
            row.name,
            str(row.nth),
            *(_cell(getattr(row, name)) for name in NUMBERS),
            row.before,
            row.after,
        )
        for row in rows
    )
    return Table("", heads, cells).as_csv()


def shares_as_csv(
    names: Sequence[str], chainage_m: Float64Array, shares: dict[str, Float64Array]
) -> str:
    """Shares (P, Z) of zones, one row for each place of the route."""
    heads = ("chainage_m", *(f"{name} {word}" for name in names for word in shares))
    cells = tuple(
        (
            _cell(at_m),
            *(_cell(values[nth, z]) for z in range(len(names)) for values in shares.values()),
        )
        for nth, at_m in enumerate(chainage_m)
    )
    return Table("", heads, cells).as_csv()


def _cell(value: float) -> str:
    return f"{value:.9g}" if math.isfinite(value) else ""


def sightings_as_geojson(
    rows: Sequence[SightingRow],
    route: Route,
    names: Sequence[str],
    shapes: Sequence[dict[str, Any]],
    seen_share: Float64Array,
) -> dict[str, Any]:
    """Targets or zones, and the stretch of the route of each sighting; coordinates in metres.

    Parameters
    ----------
    rows : sequence of SightingRow
    route : Route
    names : sequence of M str
    shapes : sequence of M GeoJSON geometries
    seen_share : (M,) float64 array
        Share of the places of the route that see each.
    """
    features: list[dict[str, Any]] = []
    for name, shape, share in zip(names, shapes, seen_share, strict=True):
        properties = {
            "kind": "target",
            "name": name,
            "VISIBLE": int(share > 0),
            "seen_share": round(float(share), 4),
        }
        features.append({"type": "Feature", "geometry": shape, "properties": properties})
    for row in rows:
        where = np.unique(np.linspace(row.from_m, max(row.to_m, row.from_m + 0.01), 20))
        line = route.at(np.minimum(where, route.length_m)).round(3).tolist()
        numbers = {name: _rounded(getattr(row, name)) for name in NUMBERS}
        properties = {"kind": "sighting", "name": row.name, "nth": row.nth, **numbers}
        properties |= {"before": row.before, "after": row.after}
        geometry = {"type": "LineString", "coordinates": line}
        features.append({"type": "Feature", "geometry": geometry, "properties": properties})
    return {
        "type": "FeatureCollection",
        "coordinates": "metres in the frame of the drive's poses",
        "features": features,
    }


def _rounded(value: float) -> float | None:
    return round(float(value), 3) if math.isfinite(value) else None
