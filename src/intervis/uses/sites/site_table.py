"""A siting as table, CSV, JSON and GeoJSON."""

import json
import math
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from intervis.plots.tables import Table
from intervis.result_table import percent
from intervis.uses.sites.coverage import STATES
from intervis.uses.sites.siting import Siting

COORDINATES = "metres in the frame of the drive's poses, or of its one scan"


def site_table(found: Siting) -> Table:
    """One row for each chosen place, in the order of the choice, and one for all together."""
    covered, rows, total = found.coverage, [], 0.0
    shares = covered.shares
    for rank, (nth, gain) in enumerate(zip(found.choice.sites, found.choice.gains, strict=True), 1):
        one = covered.candidates[nth]
        total += gain
        rows.append(
            (
                one.name,
                str(rank),
                ", ".join(f"{value:.1f}" for value in one.place),
                f"{100 * gain:.1f} %",
                f"{100 * total:.1f} %",
                *(percent(shares[word][nth]) for word in STATES.values()),
                f"{covered.returns[nth]:.0f}",
            )
        )
    together = [percent(value) for value in found.shares.values()]
    rows.append(("together", "", "", "", "", *together, f"{found.returns:.0f}"))
    heads = ("place", "nth", "x, y, z", "adds", "covered", *STATES.values(), "returns")
    return Table("Places", heads, tuple(rows))


def zone_table(found: Siting) -> Table:
    """Shares of each zone by state of the chosen set."""
    zones = found.coverage.demand.zones
    rows = tuple(
        (zone.name, f"{zone.area_m2:.0f}", *map(percent, found.zone_shares(nth).values()))
        for nth, zone in enumerate(zones)
    )
    return Table("Zones, seen by all chosen places", ("zone", "m2", *STATES.values()), rows)


def summary_of(found: Siting) -> str:
    """What the numbers mean, and how good the choice is, in sentences."""
    choice, views = found.choice, found.views
    if views == 1:
        worth = f"A target is seen with a probability of {100 * choice.value:.1f} %"
    else:
        worth = (
            f"Of the {views} views of each target {100 * choice.value:.1f} % are met; a target has"
            f" all of them with a probability of {100 * found.enough:.1f} %"
        )
    worth += {
        "best": " or more, whatever the sites have in common.",
        "independent": ", if the sites fail independently.",
    }[found.combine]
    if found.certain:
        worth += " Lines that are unknown counted as not seen."
    chosen, count = len(choice.sites), len(found.coverage.candidates)
    if chosen == count:
        return f"{worth} All candidates are chosen."
    others = "No other candidate reaches" if chosen == 1 else f"No other {chosen} candidates reach"
    proof = f"{others} more."
    if choice.method != "exact":
        proof = (
            f"{others} more than {100 * choice.bound:.1f} %, so the best choice is at most"
            f" {100 / choice.share_of_best - 100:.1f} % better."
        )
    return f"{worth} {proof} All {count} candidates together reach {100 * found.attainable:.1f} %."


def _candidate_rows(found: Siting) -> list[dict[str, Any]]:
    """All candidates: place, shares, returns; rank and gain of those chosen."""
    covered, shares = found.coverage, found.coverage.shares
    weight = covered.demand.weight
    ranks = {nth: rank for rank, nth in enumerate(found.choice.sites, start=1)}
    rows = []
    for nth, one in enumerate(covered.candidates):
        rank = ranks.get(nth)
        rows.append(
            {
                "name": one.name,
                **dict(zip("xyz", (round(float(v), 3) for v in one.place), strict=True)),
                "yaw_deg": one.yaw_deg,
                "fov_deg": one.fov_deg,
                "rank": rank,
                "gain": None if rank is None else _rounded(found.choice.gains[rank - 1]),
                **{_key(word): _rounded(float(shares[word][nth])) for word in STATES.values()},
                "probability": _rounded(float(weight @ covered.probability[nth])),
                "returns": _rounded(float(covered.returns[nth])),
            }
        )
    return rows


def candidates_as_csv(found: Siting) -> str:
    """One row for each candidate; rank and gain are empty for those not chosen."""
    rows = _candidate_rows(found)
    cells = tuple(
        tuple("" if value is None else str(value) for value in row.values()) for row in rows
    )
    return Table("", tuple(rows[0]), cells).as_csv()


def siting_as_json(found: Siting, settings: Mapping[str, Any]) -> str:
    """The whole answer: settings, choice, set, zones, and all candidates.

    Parameters
    ----------
    found : Siting
    settings : mapping
        Of the request, written as they are.
    """
    choice, reach = found.choice, found.coverage.reach
    content = {
        "coordinates": COORDINATES,
        "settings": {
            **settings,
            "views": found.views,
            "combine": found.combine,
            "certain": found.certain,
            "scanner": asdict(reach.sensor),
            "object_size_m": list(reach.size_m),
            "least_returns": reach.least_returns,
        },
        "targets": len(found.state),
        "sites": [one.name for one in found.sites],
        "method": choice.method,
        "value": _rounded(choice.value),
        "bound": _rounded(choice.bound),
        "share_of_best": _rounded(choice.share_of_best),
        "attainable": _rounded(found.attainable),
        "enough": _rounded(found.enough),
        "returns": _rounded(found.returns),
        "shares": _keyed(found.shares),
        "zones": [
            {"name": zone.name, "area_m2": _rounded(zone.area_m2), **_keyed(found.zone_shares(nth))}
            for nth, zone in enumerate(found.coverage.demand.zones)
        ],
        "candidates": _candidate_rows(found),
    }
    return json.dumps(content, indent=1, allow_nan=False) + "\n"


def siting_as_geojson(found: Siting) -> str:
    """Candidates as points and zones as polygons, with their shares; coordinates in metres."""
    features = []
    for row in _candidate_rows(found):
        properties = {"kind": "candidate", "chosen": row["rank"] is not None} | row
        place = [properties.pop(axis) for axis in "xyz"]
        features.append(_feature("Point", place, properties))
    for nth, zone in enumerate(found.coverage.demand.zones):
        ring = [*zone.corners.round(3).tolist(), zone.corners[0].round(3).tolist()]
        properties = {"kind": "zone", "name": zone.name, "weight": zone.weight}
        properties |= {"low_m": zone.low_m, "high_m": zone.high_m}
        features.append(_feature("Polygon", [ring], properties | _keyed(found.zone_shares(nth))))
    content = {"type": "FeatureCollection", "coordinates": COORDINATES, "features": features}
    return json.dumps(content, allow_nan=False) + "\n"


def _feature(kind: str, coordinates: Any, properties: dict[str, Any]) -> dict[str, Any]:
    geometry = {"type": kind, "coordinates": coordinates}
    return {"type": "Feature", "geometry": geometry, "properties": properties}


def _keyed(shares: Mapping[str, float]) -> dict[str, float | None]:
    return {_key(word): _rounded(value) for word, value in shares.items()}


def _key(word: str) -> str:
    return word.replace(" ", "_")


def _rounded(value: float) -> float | None:
    return round(float(value), 6) if math.isfinite(value) else None
