"""The answer: which places to take, what they see together, and how good the choice is."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from intervis.arrays import Float64Array
from intervis.progress import Progress
from intervis.sight import OCCLUDED, UNKNOWN, VISIBLE, Scene
from intervis.sight.occupancy_model import DEFAULT_RISK
from intervis.uses.sites.candidate import Candidate
from intervis.uses.sites.choice import Choice, Method, check_count, choose
from intervis.uses.sites.coverage import OUT_OF_REACH, STATES, Coverage, coverage
from intervis.uses.sites.demand import Demand
from intervis.uses.sites.objective import Combination, Objective, check_combination
from intervis.uses.sites.reach import Reach


@dataclass(frozen=True, eq=False, repr=False)
class Siting:
    """Chosen places among C candidates for T targets.

    Attributes
    ----------
    coverage : Coverage
    views : int
        By so many sites is each target to be seen.
    combine : str
        See `Objective`.
    certain : bool
        Only lines that are called visible counted.
    choice : Choice
    state : (T,) int8 array
        Of the chosen set: see `set_state`.
    probability : (T,) float64 array
        That `views` of the chosen sites or more see the target.
    attainable : float
        Worth of all candidates together.
    """

    coverage: Coverage
    views: int
    combine: Combination
    certain: bool
    choice: Choice
    state: NDArray[np.int8]
    probability: Float64Array
    attainable: float

    def __repr__(self) -> str:
        count, of = len(self.choice.sites), len(self.coverage.candidates)
        return f"<Siting: {count} of {of:,} candidates, worth {self.choice.value:.3f}>"

    @property
    def sites(self) -> tuple[Candidate, ...]:
        """The chosen candidates, in the order of the choice."""
        return tuple(self.coverage.candidates[nth] for nth in self.choice.sites)

    @property
    def shares(self) -> dict[str, float]:
        """Weighted shares of the targets by state of the chosen set; they add up to 1."""
        return self._shares(np.ones(len(self.state), np.bool_))

    def zone_shares(self, nth: int) -> dict[str, float]:
        """The same for one zone; NaN where its targets weigh nothing."""
        return self._shares(self.coverage.demand.zone == nth)

    @property
    def enough(self) -> float:
        """Weighted probability that `views` of the chosen sites or more see a target."""
        return float(self.coverage.demand.weight @ self.probability)

    @property
    def returns(self) -> float:
        """Expected returns on the object of one sweep of all chosen sites, in the weighted mean."""
        return float(self.coverage.returns[list(self.choice.sites)].sum())

    def _shares(self, chosen: NDArray[np.bool_]) -> dict[str, float]:
        weight = self.coverage.demand.weight
        total = float(weight[chosen].sum())
        return {
            word: float(weight[chosen & (self.state == state)].sum()) / total if total else np.nan
            for state, word in STATES.items()
        }


def set_state(state: NDArray[np.int8], views: int = 1) -> NDArray[np.int8]:
    """State (T,) of targets for a set of sites, from those for each site (S, T).

    ``visible`` if so many sites see the target. ``unknown`` if so many see it or may see it.
    ``occluded`` if so many reach it, ``out of reach`` otherwise.

    Examples
    --------
    >>> from intervis.uses.sites.coverage import STATES
    >>> two_sites = np.array([[1, 0, -1, 0, -2], [0, 0, 0, -2, -2]], np.int8)
    >>> [STATES[int(one)] for one in set_state(two_sites)]
    ['visible', 'occluded', 'unknown', 'occluded', 'out of reach']
    >>> [STATES[int(one)] for one in set_state(two_sites, views=2)]
    ['occluded', 'occluded', 'occluded', 'out of reach', 'out of reach']
    """
    seen = (state == VISIBLE).sum(axis=0)
    possible = seen + (state == UNKNOWN).sum(axis=0)
    reached = (state != OUT_OF_REACH).sum(axis=0)
    return np.select(
        [seen >= views, possible >= views, reached >= views],
        [VISIBLE, UNKNOWN, OCCLUDED],
        OUT_OF_REACH,
    ).astype(np.int8)


def choose_sites(
    covered: Coverage,
    count: int,
    *,
    views: int = 1,
    combine: Combination = "best",
    certain: bool = False,
    method: Method = "auto",
) -> Siting:
    """Choose places by what the candidates see.

    Parameters
    ----------
    covered : Coverage
    count : int
        Number of places.
    views, combine
        See `Objective`.
    certain : bool
        Count only lines that are called visible, with their probability: what is unknown counts as
        not seen.
    method
        See `choose`.

    Raises
    ------
    SettingsError, PointsError
        As `choose` and `Objective`.
    """
    probability = covered.probability
    if certain:
        probability = np.where(covered.state == VISIBLE, probability, np.float32(0.0))
    objective = Objective(probability, covered.demand.weight, views, combine)
    choice = choose(objective, count, method)
    chosen = list(choice.sites)
    return Siting(
        covered,
        views,
        combine,
        certain,
        choice,
        set_state(covered.state[chosen], views),
        objective.views_of(chosen).enough,
        objective.value(list(range(len(objective)))),
    )


def best_sites(
    scene: Scene,
    candidates: Sequence[Candidate],
    demand: Demand,
    count: int,
    *,
    reach: Reach,
    views: int = 1,
    combine: Combination = "best",
    certain: bool = False,
    method: Method = "auto",
    risk: float = DEFAULT_RISK,
    progress: Progress | None = None,
) -> Siting:
    """Choose places that see the most of the targets; `coverage`, then `choose_sites`."""
    check_count(len(candidates), count, views, method)
    check_combination(combine)
    covered = coverage(scene, candidates, demand, reach, risk=risk, progress=progress)
    return choose_sites(
        covered, count, views=views, combine=combine, certain=certain, method=method
    )
