"""Targets or zones along a whole route: one answer that tables, files and pictures are made of."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from intervis.arguments import flag_of, object_of, objects_of
from intervis.arrays import Float64Array
from intervis.errors import PointsError, SettingsError
from intervis.progress import Progress
from intervis.sight import VISIBLE, Scene
from intervis.sight.occupancy_model import DEFAULT_RISK
from intervis.sight.query_checks import finite_number, targets_of
from intervis.uses.routes.route import Route
from intervis.uses.routes.route_sight import route_sight, zone_sight
from intervis.uses.routes.route_sight_table import SightingRow, sighting_rows
from intervis.uses.routes.zone import Zone

SHARES = ("visible", "occluded", "unknown", "probability")


@dataclass(frozen=True, eq=False, repr=False)
class RouteAnswer:
    """What P places of a route see of M targets or zones.

    Attributes
    ----------
    route : Route
        Of the eyes, scene frame.
    chainage_m, time_s : (P,) float64 arrays
    names : tuple of M str
    middles : (M, 3) float64 array
    zones : tuple of M Zone, or empty
        Empty where points were asked.
    state : (P, M) int8 array
        As in `intervis.uses.RouteSight`.
    shares : mapping of str to (P, M) float64 array
        Of zones: visible, occluded, unknown, probability; empty for points.
    """

    route: Route
    chainage_m: Float64Array
    time_s: Float64Array
    names: tuple[str, ...]
    middles: Float64Array
    zones: tuple[Zone, ...]
    state: NDArray[np.int8]
    shares: dict[str, Float64Array]

    def __repr__(self) -> str:
        places, targets = self.state.shape
        kind = "zones" if self.zones else "targets"
        return f"<RouteAnswer: {places:,} places, {targets:,} {kind}>"

    @property
    def rows(self) -> list[SightingRow]:
        """All sightings, by target and place."""
        eyes = self.route.at(self.chainage_m)
        return sighting_rows(
            self.state, self.names, self.middles, eyes, self.chainage_m, self.time_s
        )

    @property
    def seen_share(self) -> Float64Array:
        """(M,) share of the places that see each target, or enough of each zone."""
        return np.asarray((self.state == VISIBLE).mean(axis=0))

    @property
    def geometries(self) -> list[dict[str, Any]]:
        """GeoJSON geometry of each target or zone."""
        if not self.zones:
            return [
                {"type": "Point", "coordinates": place.round(3).tolist()} for place in self.middles
            ]
        return [
            {
                "type": "Polygon",
                "coordinates": [np.vstack([z.corners, z.corners[:1]]).round(3).tolist()],
            }
            for z in self.zones
        ]

    @property
    def summary(self) -> str:
        """One or two sentences."""
        seen = self.seen_share
        kind = "zones" if self.zones else "targets"
        text = (
            f"{int((seen > 0).sum()):,} of {len(seen):,} {kind} come into sight,"
            f" {int((seen == 1).sum()):,} are in sight all the way."
        )
        if self.zones:
            best = self.shares["visible"].max(axis=0)
            shown = ", ".join(
                f"{name} {100 * share:.0f} %"
                for name, share in zip(self.names[:10], best, strict=False)
            )
            text += f" Largest visible shares: {shown}."
        return text


def targets_along(
    scene: Scene,
    route: Route,
    names: Sequence[str],
    targets: Float64Array,
    *,
    step_m: float = 1.0,
    max_range_m: float = 100.0,
    risk: float = DEFAULT_RISK,
    at_pose_times: bool = False,
    progress: Progress | None = None,
) -> RouteAnswer:
    """Ask targets from all places of a route.

    Parameters
    ----------
    scene : Scene
    route : Route
        Of the eyes, scene frame.
    names : sequence of M str
    targets : (M, 3) float64 array
        Scene frame, metres.
    step_m : float
        Distance of the places.
    max_range_m, risk, progress
        See `route_sight`.
    at_pose_times : bool
        Ask each place at the route's time there; otherwise at no particular time.

    Raises
    ------
    SettingsError
        The route has no times where they are asked; or as `route_sight`.
    PointsError, SceneError
        As `route_sight`.
    """
    object_of(route, Route, "route")
    names, targets = objects_of(names, str, "names"), targets_of(targets)
    is_timed = flag_of(at_pose_times, "at_pose_times")
    if len(names) != len(targets):
        raise PointsError(f"{len(targets)} targets need as many names, got {len(names)}.")
    chainage_m = route.stations(step_m)
    seen = route_sight(
        scene,
        route.at(chainage_m),
        targets,
        max_range_m=max_range_m,
        risk=risk,
        moments_s=_moments(route, chainage_m) if is_timed else None,
        progress=progress,
    )
    time_s = route.time_at(chainage_m)
    return RouteAnswer(route, chainage_m, time_s, tuple(names), targets, (), seen.state, {})


def zones_along(
    scene: Scene,
    route: Route,
    zones: Sequence[Zone],
    *,
    least: float = 0.5,
    step_m: float = 1.0,
    max_range_m: float = 100.0,
    risk: float = DEFAULT_RISK,
    at_pose_times: bool = False,
    progress: Progress | None = None,
) -> RouteAnswer:
    """Ask zones from all places of a route; one is in sight if the share `least` of it is.

    Arguments and errors as `targets_along` and `zone_sight`.
    """
    object_of(route, Route, "route")
    zones, is_timed = objects_of(zones, Zone, "zones"), flag_of(at_pose_times, "at_pose_times")
    if not 0.0 <= finite_number("least", least, "a share") <= 1.0:
        raise SettingsError(f"least must be a share from 0 to 1, got {least:g}.")
    chainage_m = route.stations(step_m)
    seen = zone_sight(
        scene,
        route.at(chainage_m),
        zones,
        max_range_m=max_range_m,
        risk=risk,
        moments_s=_moments(route, chainage_m) if is_timed else None,
        progress=progress,
    )
    corners = np.array([zone.corners.mean(axis=0) for zone in zones])
    height_m = np.array([0.5 * (zone.low_m + zone.high_m) for zone in zones])
    middles = np.column_stack([corners, scene.ground_height(corners) + height_m])
    shares = {name: getattr(seen, name) for name in SHARES}
    return RouteAnswer(
        *(route, chainage_m, route.time_at(chainage_m), tuple(zone.name for zone in zones)),
        *(middles, tuple(zones), seen.states(least), shares),
    )


def _moments(route: Route, chainage_m: Float64Array) -> Float64Array:
    time_s = route.time_at(chainage_m)
    if not np.isfinite(time_s).all():
        raise SettingsError("the route has no times at which to ask.")
    return time_s
