"""Which candidates see which targets: states, probabilities and returns, in batches."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from intervis.arrays import Float32Array, Float64Array
from intervis.errors import SettingsError
from intervis.progress import Progress, silent
from intervis.sight import OCCLUDED, UNKNOWN, VISIBLE, Scene
from intervis.sight.occupancy_model import DEFAULT_RISK
from intervis.uses.sites.candidate import Candidate, check_candidates_in_scene
from intervis.uses.sites.demand import Demand
from intervis.uses.sites.reach import Reach, faces

OUT_OF_REACH = -2
"""State of targets outside of range or field of view, or with too few returns."""
STATES = {
    VISIBLE: "visible",
    OCCLUDED: "occluded",
    UNKNOWN: "unknown",
    OUT_OF_REACH: "out of reach",
}
LINES_AT_ONCE = 500_000
"""Lines of a batch: some 60 MB of ends and answers."""
MOST_LINES = 50_000_000
"""Lines of a request at most: 250 MB of answers."""


@dataclass(frozen=True, eq=False, repr=False)
class Coverage:
    """What each of C candidates sees of T targets.

    Attributes
    ----------
    candidates : tuple of C Candidate
    demand : Demand
        Of T targets.
    reach : Reach
    state : (C, T) int8 array
        1 visible, 0 occluded, -1 unknown, -2 out of reach.
    probability : (C, T) float32 array
        P(visible); 0 out of reach.
    returns : (C,) float64 array
        Expected returns of one sweep on the object, in the weighted mean over all targets: those
        in free sight times P(visible).
    """

    candidates: tuple[Candidate, ...]
    demand: Demand
    reach: Reach
    state: NDArray[np.int8]
    probability: Float32Array
    returns: Float64Array

    def __repr__(self) -> str:
        places, targets = self.state.shape
        return f"<Coverage: {places:,} candidates, {targets:,} targets>"

    @property
    def shares(self) -> dict[str, Float64Array]:
        """(C,) weighted shares of the targets by state: visible, occluded, unknown, out of reach.

        They add up to 1.
        """
        return {
            word: np.array([float(self.demand.weight[row == state].sum()) for row in self.state])
            for state, word in STATES.items()
        }


def coverage(
    scene: Scene,
    candidates: Sequence[Candidate],
    demand: Demand,
    reach: Reach,
    *,
    risk: float = DEFAULT_RISK,
    progress: Progress | None = None,
) -> Coverage:
    """Ask every target within reach from every candidate, at no particular time.

    Parameters
    ----------
    scene : Scene
    candidates : sequence of C Candidate
    demand : Demand
    reach : Reach
        Lines are asked where it has enough returns.
    risk : float
        See `intervis.Scene.sight`.
    progress : Progress or None
        Called after each batch: see `batches`.

    Raises
    ------
    SettingsError
        There are too many lines, or the risk is out of range.
    SceneError, PointsError
        As `check_candidates_in_scene`; the scene holds no scan.
    """
    lines = len(candidates) * len(demand.points)
    if lines > MOST_LINES:
        raise SettingsError(
            f"{len(candidates):,} candidates x {len(demand.points):,} targets are {lines:,} lines,"
            f" and at most {MOST_LINES:,} are answered: take larger cells or fewer candidates."
        )
    check_candidates_in_scene(scene, candidates)
    places = np.array([one.place for one in candidates])
    state = np.full((len(candidates), len(demand.points)), OUT_OF_REACH, np.int8)
    probability = np.zeros(state.shape, np.float32)
    returns = np.zeros(len(candidates))
    for begin, end in batches(len(candidates), len(demand.points)):
        free = np.array([_free_returns(one, demand, reach) for one in candidates[begin:end]])
        row, column = np.nonzero(reach.within(free))
        for first in range(0, len(row), LINES_AT_ONCE):
            part = slice(first, first + LINES_AT_ONCE)
            one, target = begin + row[part], column[part]
            sight = scene.sight_lines(places[one], demand.points[target], risk=risk)
            state[one, target] = sight.state
            probability[one, target] = sight.probability
            expected = free[row[part], target] * sight.probability * demand.weight[target]
            returns += np.bincount(one, expected, minlength=len(candidates))
        (progress or silent)(f"candidate {end} of {len(candidates)}")
    return Coverage(tuple(candidates), demand, reach, state, probability, returns)


def batches(candidates: int, targets: int) -> list[tuple[int, int]]:
    """Begin and end of the candidates that are asked together."""
    step = max(1, LINES_AT_ONCE // max(targets, 1))
    return [(begin, min(begin + step, candidates)) for begin in range(0, candidates, step)]


def _free_returns(one: Candidate, demand: Demand, reach: Reach) -> Float64Array:
    """Returns (T,) in free sight; 0 outside of the horizontal field of view."""
    looked = faces(one.place, one.yaw_deg, one.fov_deg, demand.points)
    return np.where(looked, reach.returns(one.place, demand.points), 0.0)
