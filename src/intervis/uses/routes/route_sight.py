"""What a route sees: when each target or zone comes into sight, and when it is lost."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from intervis.arguments import object_of
from intervis.arrays import BoolArray, Float32Array, Float64Array, IntArray
from intervis.errors import PointsError, SceneError, SettingsError
from intervis.progress import Progress, reporter
from intervis.sight import OCCLUDED, UNKNOWN, VISIBLE, Scene
from intervis.sight.occupancy_model import DEFAULT_RISK
from intervis.sight.query_checks import positive_length
from intervis.uses.routes.sight_distance import runs_of
from intervis.uses.routes.zone import Zone

OUT_OF_RANGE = -2
"""State of targets that are farther than the range."""
WORDS = {VISIBLE: "visible", OCCLUDED: "occluded", UNKNOWN: "unknown", OUT_OF_RANGE: "out of range"}
LINES_AT_ONCE = 1_000_000
MOST_LINES = 200_000_000
"""Lines of a request at most: 1 GB of answers."""


@dataclass(frozen=True, eq=False, repr=False)
class RouteSight:
    """States of M targets from P places of a route.

    Attributes
    ----------
    eyes : (P, 3) float64 array
        Scene frame, metres.
    targets : (M, 3) float64 array
    state : (P, M) int8 array
        1 visible, 0 occluded, -1 unknown, -2 out of range.
    probability : (P, M) float32 array
        P(visible); NaN out of range.
    """

    eyes: Float64Array
    targets: Float64Array
    state: NDArray[np.int8]
    probability: Float32Array

    def __repr__(self) -> str:
        places, targets = self.state.shape
        return f"<RouteSight: {places:,} places, {targets:,} targets>"


def route_sight(
    scene: Scene,
    eyes: Float64Array,
    targets: Float64Array,
    *,
    max_range_m: float = 100.0,
    risk: float = DEFAULT_RISK,
    moments_s: Float64Array | None = None,
    progress: Progress | None = None,
) -> RouteSight:
    """Ask every target from every place of a route.

    Parameters
    ----------
    scene : Scene
    eyes : (P, 3) float64 array
        Scene frame, metres.
    targets : (M, 3) float64 array
        Those that are not finite are unknown.
    max_range_m : float
        Farther targets are out of range.
    risk : float
        See `intervis.Scene.sight`.
    moments_s : (P,) float64 array or None
        Query time of each place. None: no particular time.
    progress : Progress or None
        Called after each batch of places: see `batches`.

    Raises
    ------
    SettingsError
        There are too many lines; or as `intervis.Scene.sight`.
    PointsError, SceneError
        As `intervis.Scene.sight`.
    """
    object_of(scene, Scene, "scene")
    range_m, report = positive_length("max_range_m", max_range_m), reporter(progress)
    lines = len(eyes) * len(targets)
    if lines > MOST_LINES:
        raise SettingsError(
            f"{len(eyes):,} places x {len(targets):,} targets are {lines:,} lines, and at most"
            f" {MOST_LINES:,} are answered: take larger steps or fewer targets."
        )
    state = np.empty((len(eyes), len(targets)), np.int8)
    probability = np.empty(state.shape, np.float32)
    order = _by_direction(eyes, targets)
    in_order = targets[order]
    for begin, end in batches(len(eyes), len(targets), moments_s is not None):
        part = slice(begin, end)
        moment_s = None if moments_s is None else float(moments_s[begin])
        sight = scene.sight(eyes[part], in_order, max_range_m=range_m, risk=risk, moment_s=moment_s)
        with np.errstate(over="ignore"):
            far = np.linalg.norm(in_order - eyes[part, None], axis=2) > range_m
        state[part, order] = np.where(far, OUT_OF_RANGE, sight.state)
        probability[part, order] = sight.probability
        report(f"place {end} of {len(eyes)}")
    return RouteSight(eyes, targets, state, probability)


def _by_direction(eyes: Float64Array, targets: Float64Array) -> IntArray:
    """Order (M,) of the targets around the route: neighbouring lines read the same pixels."""
    x, y = (targets - eyes.mean(axis=0)).T[:2] if len(eyes) else targets.T[:2]
    return np.argsort(np.arctan2(y, x), kind="stable")


def batches(places: int, targets: int, with_moments: bool) -> list[tuple[int, int]]:
    """Begin and end of the places that are asked together: one by one where each has a time."""
    step = 1 if with_moments else max(1, LINES_AT_ONCE // max(targets, 1))
    return [(begin, min(begin + step, places)) for begin in range(0, places, step)]


@dataclass(frozen=True)
class Sighting:
    """A stretch of the route from which a target, or enough of a zone, is visible.

    Attributes
    ----------
    target : int
        Index of the target or zone.
    first, last : int
        Places of the route.
    before, after : str
        State at the place before and after: ``occluded``, ``unknown``, ``out of range``, or
        ``start`` and ``end`` of the route. After ``unknown`` it may have been visible earlier.
    """

    target: int
    first: int
    last: int
    before: str
    after: str


def sightings(state: NDArray[np.int8], close_gaps: int = 0) -> list[Sighting]:
    """Runs of visible places of each target, by target and place.

    Parameters
    ----------
    state : (P, M) int8 array
        As in `RouteSight`.
    close_gaps : int
        Gaps of so many places or fewer are no loss.

    Examples
    --------
    >>> state = np.array([[1, -1], [0, 1], [1, 1]], np.int8)
    >>> [(one.target, one.first, one.last, one.before) for one in sightings(state)]
    [(0, 0, 0, 'start'), (0, 2, 2, 'occluded'), (1, 1, 2, 'unknown')]
    """
    found = []
    for target in np.flatnonzero((state == VISIBLE).any(axis=0)):
        column = state[:, target]
        for first, end in _closed(runs_of(column == VISIBLE), close_gaps):
            before = WORDS[int(column[first - 1])] if first else "start"
            after = WORDS[int(column[end])] if end < len(column) else "end"
            found.append(Sighting(int(target), first, end - 1, before, after))
    return found


def _closed(runs: list[tuple[int, int]], gap: int) -> list[tuple[int, int]]:
    """Runs joined over short gaps."""
    joined = runs[:1]
    for begin, end in runs[1:]:
        if begin - joined[-1][1] <= gap:
            joined[-1] = (joined[-1][0], end)
        else:
            joined.append((begin, end))
    return joined


@dataclass(frozen=True, eq=False)
class ZoneSight:
    """Shares of Z zones from P places of a route.

    Attributes
    ----------
    visible, occluded, unknown, probability : (P, Z) float64 arrays
        Shares of the points of each zone with these states, and mean of P(visible). Points out of
        range are unknown; points without ground below are left out.
    """

    visible: Float64Array
    occluded: Float64Array
    unknown: Float64Array
    probability: Float64Array

    def states(self, least: float) -> NDArray[np.int8]:
        """(P, Z) visible where the visible share is `least` or more, else what may hide it.

        Unknown where the unknown points decide, occluded otherwise.
        """
        maybe = self.visible + self.unknown >= least
        return np.select([self.visible >= least, maybe], [VISIBLE, UNKNOWN], OCCLUDED).astype(
            np.int8
        )


def zone_sight(
    scene: Scene,
    eyes: Float64Array,
    zones: Sequence[Zone],
    *,
    max_range_m: float = 100.0,
    risk: float = DEFAULT_RISK,
    moments_s: Float64Array | None = None,
    progress: Progress | None = None,
) -> ZoneSight:
    """Which share of each zone is visible from every place of a route; arguments as `route_sight`.

    Raises
    ------
    SceneError
        The scene shows no ground below a zone.
    SettingsError, PointsError
        As `route_sight`.
    """
    object_of(scene, Scene, "scene")
    if not zones:
        raise PointsError("no zone is given.")
    parts = [zone.samples(scene) for zone in zones]
    parts = [part[np.isfinite(part).all(axis=1)] for part in parts]
    for zone, part in zip(zones, parts, strict=True):
        if not len(part):
            raise SceneError(f"the scene shows no ground below zone {zone.name!r}.")
    seen = route_sight(
        scene,
        eyes,
        np.concatenate(parts),
        max_range_m=max_range_m,
        risk=risk,
        moments_s=moments_s,
        progress=progress,
    )
    bounds = np.cumsum([0, *map(len, parts)])
    pieces = [slice(*pair) for pair in pairwise(bounds)]
    return ZoneSight(
        _share(seen.state == VISIBLE, pieces),
        _share(seen.state == OCCLUDED, pieces),
        _share((seen.state == UNKNOWN) | (seen.state == OUT_OF_RANGE), pieces),
        np.column_stack([np.nan_to_num(seen.probability[:, p]).mean(axis=1) for p in pieces]),
    )


def _share(chosen: BoolArray, pieces: list[slice]) -> Float64Array:
    return np.column_stack([chosen[:, piece].mean(axis=1) for piece in pieces])
