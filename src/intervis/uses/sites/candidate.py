"""Candidates: places where a scanner or a camera could be mounted."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from intervis.arrays import Float64Array, checked_point
from intervis.errors import PointsError, SceneError, SettingsError
from intervis.sight import Scene
from intervis.sight.query_checks import finite_number, positive_length
from intervis.uses.routes.route import Route
from intervis.uses.routes.survey import distance_to_scans
from intervis.uses.routes.target_file import FARTHEST_M
from intervis.uses.routes.zone import GROUND_SCANS, Zone

MAST_M = 5.0
"""Height of a mast above the ground, unless told."""
MOST_CANDIDATES = 20_000
ROUGH_GROUND_M = 0.5
"""A candidate may lie so far below the ground that the scans show, a mean over a square metre."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """A place for a scanner or a camera.

    Attributes
    ----------
    name : str
    place : (3,) float64 array
        Of the scanner, scene frame, metres.
    yaw_deg, fov_deg : float
        Where it looks, counter-clockwise from x, and its horizontal field of view.

    Raises
    ------
    PointsError
        The place is not finite, or the field of view is not above 0 and up to 360 degrees.

    Examples
    --------
    >>> Candidate("mast", [1, 2, 6]).place.tolist()
    [1.0, 2.0, 6.0]
    """

    name: str
    place: Float64Array
    yaw_deg: float = 0.0
    fov_deg: float = 360.0

    def __init__(
        self, name: str, place: ArrayLike, yaw_deg: float = 0.0, fov_deg: float = 360.0
    ) -> None:
        if not (math.isfinite(yaw_deg) and 0.0 < fov_deg <= 360.0):
            raise PointsError(
                f"candidate {name!r} needs a finite yaw and a field of view above 0 and up to 360"
                f" degrees, got {yaw_deg} and {fov_deg}."
            )
        object.__setattr__(self, "name", name)
        object.__setattr__(self, "place", checked_point(place, f"the place of candidate {name!r}"))
        object.__setattr__(self, "yaw_deg", float(yaw_deg))
        object.__setattr__(self, "fov_deg", float(fov_deg))


def candidates_along(
    scene: Scene,
    route: Route,
    every_m: float,
    *,
    offsets_m: Sequence[float] = (0.0,),
    mast_m: float = MAST_M,
) -> list[Candidate]:
    """Candidates on masts along a route, at each offset to its left.

    Those where the scene shows no ground, or that are farther than 150 m from every scan, are left
    out. Names are offset and chainage, as ``+6.0 at 40``.

    Raises
    ------
    SceneError
        None is left.
    SettingsError
        `every_m` is not positive, an offset is not finite, or the height of the mast is negative or
        not finite.
    PointsError
        There are too many.
    """
    names, places = [], []
    for offset_m in offsets_m:
        finite_number("offset", offset_m, "metres")
        way = route.shifted(offset_m) if offset_m else route
        chainage_m = way.stations(every_m)
        names += [f"{offset_m:+g} at {at_m:.6g}" for at_m in chainage_m]
        places.append(way.at(chainage_m)[:, :2])
    return _on_masts(scene, names, np.concatenate(places), mast_m)


def candidates_within(
    scene: Scene, zones: Sequence[Zone], every_m: float, *, mast_m: float = MAST_M
) -> list[Candidate]:
    """Candidates on masts in the cells, of an edge of `every_m`, of polygons.

    Those without ground and outside of the scene are left out, as by `candidates_along`. Names are
    those of the polygon and a number.

    Raises
    ------
    SceneError, SettingsError, PointsError
        As `candidates_along`.
    """
    every_m = positive_length("the distance of candidates", every_m)
    cells = [zone.cells(every_m) for zone in zones]
    names = [
        f"{zone.name} {nth}"
        for zone, places in zip(zones, cells, strict=True)
        for nth in range(1, len(places) + 1)
    ]
    return _on_masts(scene, names, np.concatenate(cells), mast_m)


def _on_masts(
    scene: Scene, names: Sequence[str], xy: Float64Array, mast_m: float
) -> list[Candidate]:
    mast_m = finite_number("the height of the mast", mast_m, "metres")
    if mast_m < 0.0:
        raise SettingsError(f"the height of the mast must be 0 m or more, got {mast_m:g}.")
    if len(xy) > MOST_CANDIDATES:
        raise PointsError(
            f"{len(xy):,} candidates are more than {MOST_CANDIDATES:,}: take them farther apart."
        )
    z_m = scene.ground_height(xy, GROUND_SCANS) + mast_m
    kept = np.isfinite(z_m) & (distance_to_scans(scene, xy) <= FARTHEST_M)
    if not kept.any():
        raise SceneError(
            "none of the candidates has ground that the scans show: put them near the scans, in the"
            " frame of the drive's poses."
        )
    return [Candidate(names[nth], [*xy[nth], z_m[nth]]) for nth in np.flatnonzero(kept).tolist()]


def check_candidates_in_scene(scene: Scene, candidates: Sequence[Candidate]) -> None:
    """Raise where candidates lie outside of the scene or below its ground, or two have one name.

    Raises
    ------
    SceneError
        One is farther than 150 m from every scan, or lies more than `ROUGH_GROUND_M` below the
        ground; the message names it.
    PointsError
        Two have one name, or there is none or too many.
    """
    if not 1 <= len(candidates) <= MOST_CANDIDATES:
        raise PointsError(
            f"candidates must be 1 to {MOST_CANDIDATES:,} in number, got {len(candidates):,}."
        )
    places = np.array([one.place for one in candidates])
    away_m = distance_to_scans(scene, places)
    if (away_m > FARTHEST_M).any():
        nth = int(np.argmax(away_m > FARTHEST_M))
        raise SceneError(
            f"candidate {candidates[nth].name!r} lies {away_m[nth]:,.0f} m from every scan, and"
            f" {FARTHEST_M:g} m are allowed: give its place in the frame of the drive's poses, or"
            " leave it out."
        )
    above_m = places[:, 2] - scene.ground_height(places[:, :2], GROUND_SCANS)
    if (above_m < -ROUGH_GROUND_M).any():  # nor is NaN, where the scans show no ground
        nth = int(np.argmax(above_m < -ROUGH_GROUND_M))
        raise SceneError(
            f"candidate {candidates[nth].name!r} lies {-above_m[nth]:.1f} m below the ground that"
            " the scans show: give its z in the frame of the drive's poses, or its height above the"
            " ground."
        )
    seen: set[str] = set()
    for one in candidates:
        if one.name in seen:
            raise PointsError(f"two candidates are called {one.name!r}: give each its own name.")
        seen.add(one.name)
