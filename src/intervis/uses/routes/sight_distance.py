"""Sight distance along a road: how far a driver sees an object on the road ahead.

Eyes and objects stand on the path at the heights of a standard. All distances are horizontal and
run along the path, not along the sight line. Lines that are unknown are never counted as visible:
`seen_m` ends before the first line that is not visible, `possible_m` before the first one that is
occluded.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from intervis.arguments import object_of
from intervis.arrays import BoolArray, Float64Array, numbers_of
from intervis.errors import PointsError, SettingsError
from intervis.progress import Progress, reporter
from intervis.sight import OCCLUDED, UNKNOWN, VISIBLE, Scene, Sight
from intervis.sight.occupancy_model import DEFAULT_RISK
from intervis.sight.query_checks import finite_number, positive_length
from intervis.uses.routes.route import Route
from intervis.uses.routes.route_file import KMH_PER_MPS
from intervis.uses.routes.sight_standard import SightStandard

NEAREST_M = 5.0
"""Nearer objects are not judged: the vehicle that carried the scanner stood there."""
REACH = 1.5
"""Objects are placed up to this multiple of the largest required distance."""
LEAST_GRADE_M = 10.0
"""Least length over which a grade is taken."""
FASTEST_MPS = 100.0
NO_TARGET = -2
"""State of objects beyond the end of the path."""
MOST_LINES = 50_000_000
"""Lines of a request at most: some 4 GB while they are answered."""

SUFFICIENT, DEFICIENT, UNDECIDED = "sufficient", "deficient", "undecided"


@dataclass(frozen=True, eq=False, repr=False)
class SightDistances:
    """Available and required sight distance at S stations, with D objects ahead of each.

    Attributes
    ----------
    standard : SightStandard
    road : Route
        The path on the road surface, scene frame.
    chainage_m : (S,) float64 array
        Of the stations.
    distance_m : (D,) float64 array
        Of the objects from the station, along the path; rising.
    speed_mps, grade, required_m : (S,) float64 arrays
        Speed; mean grade over the stopping distance; the distance that the standard requires.
    state : (S, D) int8 array
        1 visible, 0 occluded, -1 unknown, -2 beyond the end of the path. With several heights, the
        worst of all lines.
    probability : (S, D) float64 array
        P(visible), the least of all lines; NaN beyond the end of the path.
    blocker : (S, D, 3) float64 array
        As in `intervis.Sight`, of the line with the least probability.
    ignore_m : float
        Hidden or unknown stretches shorter than this do not end the sight distance.
    blocker_class : tuple of S str
        What `ending_blocker` is, where labels say so; empty without labels.
    """

    standard: SightStandard
    road: Route
    chainage_m: Float64Array
    distance_m: Float64Array
    speed_mps: Float64Array
    grade: Float64Array
    required_m: Float64Array
    state: NDArray[np.int8]
    probability: Float64Array
    blocker: Float64Array
    ignore_m: float
    blocker_class: tuple[str, ...] = ()

    def __repr__(self) -> str:
        counts = [f"{int((self.verdict == word).sum())} {word}" for word in VERDICTS]
        return f"<SightDistances: {len(self.chainage_m)} stations, {', '.join(counts)}>"

    @property
    def seen_m(self) -> Float64Array:
        """(S,) distance up to which every object is visible; 0 if the nearest is not."""
        return self._until(self.state != VISIBLE)

    @property
    def possible_m(self) -> Float64Array:
        """(S,) distance up to which no object is occluded: unknown ones may be visible."""
        return self._until((self.state == OCCLUDED) | (self.state == NO_TARGET))

    @property
    def is_bounded(self) -> BoolArray:
        """(S,) whether an occluded object ends `possible_m`, not the end of path or reach."""
        return np.isfinite(self._first_m(self.state == OCCLUDED))

    @property
    def verdict(self) -> NDArray[np.str_]:
        """(S,) what is true of the objects up to the required distance.

        ``sufficient``: all are visible. ``deficient``: one is occluded. ``undecided``: neither, as
        one is unknown or the path ends before.
        """
        tested_m = self.distance_m[-1] + self.step_m
        enough = np.minimum(self._first_m(self.state != VISIBLE), tested_m) > self.required_m
        short = self._first_m(self.state == OCCLUDED) <= self.required_m
        return np.select([enough, short], [SUFFICIENT, DEFICIENT], UNDECIDED)

    @property
    def ends_early(self) -> BoolArray:
        """(S,) whether nothing but the end of the path leaves the verdict undecided."""
        open_m = self._first_m((self.state == OCCLUDED) | (self.state == UNKNOWN))
        is_short = self.chainage_m + self.required_m > self.road.length_m
        is_open = self.verdict == UNDECIDED
        return np.asarray(is_open & is_short & (open_m > self.required_m))

    @property
    def deficit_m(self) -> Float64Array:
        """(S,) required minus possible distance where deficient; 0 where sufficient; else NaN."""
        verdict = self.verdict
        missing_m = self.required_m - self.possible_m
        return np.select([verdict == DEFICIENT, verdict == SUFFICIENT], [missing_m, 0.0], np.nan)

    @property
    def unknown_share(self) -> Float64Array:
        """(S,) of the objects up to the required distance, the share that is unknown."""
        return self._share(self.state == UNKNOWN)

    @property
    def least_probability(self) -> Float64Array:
        """(S,) least P(visible) up to the required distance.

        An upper bound of the probability that all of it is visible.
        """
        within = self._within & (self.state != NO_TARGET)
        return np.asarray(np.where(within, self.probability, np.inf).min(axis=1))

    @property
    def ending_blocker(self) -> Float64Array:
        """(S, 3) blocker of the first occluded object; NaN where there is none."""
        first_m = self._first_m(self.state == OCCLUDED)
        at = np.searchsorted(self.distance_m, np.where(np.isfinite(first_m), first_m, 0.0))
        blocker = self.blocker[np.arange(len(at)), at]
        return np.where(np.isfinite(first_m)[:, None], blocker, np.nan)

    @property
    def step_m(self) -> float:
        """Distance of neighbouring objects: the resolution of the sight distances."""
        return float(self.distance_m[1] - self.distance_m[0]) if len(self.distance_m) > 1 else 0.0

    @property
    def _within(self) -> BoolArray:
        return np.asarray(self.distance_m <= self.required_m[:, None])

    def _share(self, chosen: BoolArray) -> Float64Array:
        within = self._within & (self.state != NO_TARGET)
        return np.asarray((chosen & within).sum(axis=1) / np.maximum(within.sum(axis=1), 1))

    def _until(self, ends: BoolArray) -> Float64Array:
        """(S,) distance of the last object before the first that ends the view; 0 if none is."""
        first_m = self._first_m(ends)
        before = np.searchsorted(self.distance_m, first_m) - 1
        return np.where(before >= 0, self.distance_m[np.maximum(before, 0)], 0.0)

    def _first_m(self, ends: BoolArray) -> Float64Array:
        """(S,) distance of the first object that ends the view; infinite where none does."""
        found = np.full(len(ends), np.inf)
        for nth, row in enumerate(ends):
            for begin, end in runs_of(row):
                last = end == len(row) or self.state[nth, end] == NO_TARGET
                if last or (end - begin) * self.step_m >= self.ignore_m:
                    found[nth] = self.distance_m[begin]
                    break
        return found


VERDICTS = (SUFFICIENT, DEFICIENT, UNDECIDED)


def runs_of(mask: BoolArray) -> list[tuple[int, int]]:
    """Begin and end (exclusive) of each run of true values.

    Examples
    --------
    >>> runs_of(np.array([True, False, True, True]))
    [(0, 1), (2, 4)]
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    return [(int(begin), int(end)) for begin, end in edges.reshape(-1, 2)]


def sight_distances(
    scene: Scene,
    road: Route,
    standard: SightStandard,
    *,
    speed_mps: float | None = None,
    step_m: float = 5.0,
    target_step_m: float = 1.0,
    reach_m: float | None = None,
    ignore_m: float = 0.0,
    risk: float = DEFAULT_RISK,
    moments_s: ArrayLike | None = None,
    progress: Progress | None = None,
) -> SightDistances:
    """Sight distance at stations along a path.

    Parameters
    ----------
    scene : Scene
    road : Route
        The path on the road surface, scene frame.
    standard : SightStandard
    speed_mps : float or None
        One speed for all stations; None: those of the route.
    step_m, target_step_m : float
        Distance of the stations, and of the objects ahead of each.
    reach_m : float or None
        Distance of the farthest object; None: 1.5 times the largest required distance.
    ignore_m : float
        Hidden or unknown stretches shorter than this do not end the sight distance.
    risk : float
        See `intervis.Scene.sight`.
    moments_s : (S, K) array or None
        Query times of each station. With several, a line has its best answer: what moved away
        does not hide. None: no particular time.
    progress : Progress or None

    Raises
    ------
    SettingsError
        The route has no speeds and none is given, a number is out of range, or there are too many
        lines.
    PointsError
        The path has no height somewhere, or is too short for an object ahead.
    SceneError
        The scene holds no scan, or its scans have no times and moments are given.
    """
    object_of(scene, Scene, "scene")
    object_of(road, Route, "road")
    object_of(standard, SightStandard, "standard")
    report = reporter(progress)
    if not np.isfinite(road.points).all():
        raise PointsError("the path has places without a height.")
    ignore_m = finite_number("ignore_m", ignore_m, "metres")
    if ignore_m < 0.0:
        raise SettingsError(f"ignore_m must be 0 or more metres, got {ignore_m:g}.")
    chainage_m = road.stations(step_m)
    chainage_m = chainage_m[chainage_m + NEAREST_M <= road.length_m]
    if not len(chainage_m):
        raise PointsError(
            f"the path is {road.length_m:.1f} m long, and objects start {NEAREST_M:g} m ahead."
        )
    speeds = _speeds(road, chainage_m, speed_mps)
    grade = mean_grade(road, chainage_m, standard.stopping_m(speeds))
    required_m = standard.stopping_m(speeds, grade)
    heights = len(standard.eye_m) * len(standard.object_m)
    distance_m = _object_distances(
        road, required_m, reach_m, target_step_m, len(chainage_m) * heights
    )
    moments = None if moments_s is None else numbers_of(moments_s, "moments_s")
    if moments is not None and (
        moments.ndim != 2 or not moments.shape[1] or len(moments) < len(chainage_m)
    ):
        raise SettingsError(f"moments_s needs a row for each of {len(chainage_m)} stations.")
    shape = (len(chainage_m), len(distance_m))
    state, probability = np.full(shape, NO_TARGET, np.int8), np.full(shape, np.nan)
    blocker = np.full((*shape, 3), np.nan)
    for nth, at_m in enumerate(chainage_m):
        ahead = at_m + distance_m <= road.length_m + 1e-9
        asked = None if moments is None else moments[nth]
        objects_m = np.minimum(at_m + distance_m[ahead], road.length_m)
        worst = _worst_of(scene, road, float(at_m), objects_m, standard, risk, asked)
        state[nth, ahead], probability[nth, ahead], blocker[nth, ahead] = worst
        report(f"chainage {at_m:.0f} m")
    return SightDistances(
        *(standard, road, chainage_m, distance_m, speeds, grade, required_m),
        *(state, probability, blocker, ignore_m),
    )


def _object_distances(
    road: Route, required_m: Float64Array, reach_m: float | None, step_m: float, lines: int
) -> Float64Array:
    """Distances (D,) of the objects from a station; `lines` are asked for each of them."""
    if reach_m is None:
        finite = required_m[np.isfinite(required_m)]
        reach_m = REACH * float(finite.max()) if len(finite) else road.length_m
        reach_m = max(reach_m, 2 * NEAREST_M)
    step = positive_length("target_step_m", step_m)
    farthest_m = min(positive_length("reach_m", reach_m), road.length_m)
    if farthest_m < NEAREST_M:
        raise SettingsError(f"reach_m must be {NEAREST_M:g} m or more, where objects start.")
    lines *= int(min((farthest_m - NEAREST_M) / step, 1e12) + 1.0)
    if lines > MOST_LINES:
        raise SettingsError(
            f"{lines:,} lines are asked, and at most {MOST_LINES:,} are answered: take larger steps"
            " or a shorter reach."
        )
    return np.arange(NEAREST_M, farthest_m + 1e-9, step)


def _speeds(road: Route, chainage_m: Float64Array, speed_mps: float | None) -> Float64Array:
    """Speeds (S,) of the stations."""
    if speed_mps is not None:
        speed_mps = finite_number("the speed", speed_mps, "metres per second")
        if not 0.0 < speed_mps <= FASTEST_MPS:
            raise SettingsError(
                f"the speed must be above 0 and up to {KMH_PER_MPS * FASTEST_MPS:g} km/h, got"
                f" {KMH_PER_MPS * speed_mps:.4g} km/h."
            )
        return np.full(len(chainage_m), speed_mps)
    speeds = road.speed_at(chainage_m)
    if not np.isfinite(speeds).all():
        raise SettingsError("the route has no speeds: give one for the whole of it (--speed KM/H).")
    return speeds


def mean_grade(road: Route, chainage_m: Float64Array, over_m: Float64Array) -> Float64Array:
    """Mean grade (S,) of the path over lengths (S,) ahead of chainages, rise over run.

    It is the work of gravity over that length. Near the end of the path: over its last part.
    """
    end = np.minimum(chainage_m + np.maximum(over_m, LEAST_GRADE_M), road.length_m)
    begin = np.maximum(np.minimum(chainage_m, end - LEAST_GRADE_M), 0.0)
    rise_m = road.at(end)[:, 2] - road.at(begin)[:, 2]
    return np.asarray(rise_m / np.maximum(end - begin, 1e-9))


Worst = tuple[NDArray[np.int8], Float64Array, Float64Array]


def _worst_of(
    scene: Scene,
    road: Route,
    station_m: float,
    objects_m: Float64Array,
    standard: SightStandard,
    risk: float,
    moments_s: Float64Array | None,
) -> Worst:
    """State (D,), probability (D,), blocker (D, 3) at D chainages: the worst over all heights."""
    pairs = [(eye_m, object_m) for eye_m in standard.eye_m for object_m in standard.object_m]
    lines = len(pairs)
    ends = np.stack([road.above(objects_m, object_m) for _, object_m in pairs])
    starts = np.empty_like(ends)
    for nth, (eye_m, _) in enumerate(pairs):
        starts[nth] = road.above(station_m, eye_m)
    sight = best_of_moments(scene, starts.reshape(-1, 3), ends.reshape(-1, 3), risk, moments_s)
    state = sight.state.reshape(lines, -1)
    probability = sight.probability.reshape(lines, -1)
    rank = np.where(state == OCCLUDED, 0, np.where(state == UNKNOWN, 1, 2))
    worst = (rank + np.clip(probability, 0.0, 1.0) / 2.0).argmin(axis=0)
    column = np.arange(len(objects_m))
    blocker = sight.blocker.reshape(lines, -1, 3)
    return state[worst, column], probability.min(axis=0), blocker[worst, column]


def best_of_moments(
    scene: Scene,
    starts: Float64Array,
    ends: Float64Array,
    risk: float,
    moments_s: Float64Array | None,
) -> Sight:
    """Sight lines (L,), each with its most probable answer over several query times."""
    if moments_s is None:
        return scene.sight_lines(starts, ends, risk=risk)
    at = [scene.sight_lines(starts, ends, risk=risk, moment_s=float(t)) for t in moments_s]
    if len(at) == 1:
        return at[0]
    best = np.argmax([one.probability for one in at], axis=0)
    line = np.arange(len(starts))
    return Sight(
        np.array([one.state for one in at])[best, line],
        np.array([one.probability for one in at])[best, line],
        np.array([one.blocker for one in at])[best, line],
        np.array([one.clearance for one in at])[best, line],
        np.array([one.observed for one in at])[best, line],
    )
