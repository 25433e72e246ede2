"""The choice of sites: lazy greedy with its bound, and branch and bound for small problems."""

import heapq
import math
from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np

from intervis.errors import SettingsError
from intervis.uses.sites.objective import Objective, Views

Method = Literal["auto", "greedy", "exact"]
METHODS: tuple[str, ...] = get_args(Method)
GREEDY_SHARE = 1.0 - 1.0 / math.e
"""A greedy set is worth this share of the best one or more (Nemhauser, Wolsey, Fisher 1978)."""
FEW_SETS = 100_000
"""``auto`` proves the best set where there are no more sets than this."""
MOST_WORK = {"auto": 1e9, "exact": 2e10}
"""Targets that a search looks at before it stops without a proof: some seconds, some minutes."""
LEAST_WORK = 1000
"""A gain takes as long as that of so many targets, however few there are."""
DEEPEST = 300
"""Larger sets are not searched: the search calls itself once for each place."""
ROUNDING = 1e-12


@dataclass(frozen=True)
class Choice:
    """Chosen candidates.

    Attributes
    ----------
    sites : tuple of k int
        Indices of candidates: in the order of the greedy choice, or ordered so that each adds the
        most to those before it.
    gains : tuple of k float
        What each adds to the worth of those before it; their sum is `value`.
    value : float
        Worth of the set (see `Objective`), 0 to 1.
    bound : float
        No set of k candidates is worth more.
    method : str
        ``greedy`` or ``exact``; ``exact`` where the set is proven to be the best.
    evaluations : int
        Number of gains that were computed.
    """

    sites: tuple[int, ...]
    gains: tuple[float, ...]
    value: float
    bound: float
    method: str
    evaluations: int

    @property
    def share_of_best(self) -> float:
        """The set is worth this share of the best one or more."""
        if self.bound <= 0.0:
            return 1.0
        proven = min(self.value / self.bound, 1.0)
        return max(proven, GREEDY_SHARE)  # an exact search starts from the greedy set


def choose(objective: Objective, count: int, method: Method = "auto") -> Choice:
    """The `count` candidates that are worth most together.

    Parameters
    ----------
    objective : Objective
    count : int
    method : {"auto", "greedy", "exact"}
        ``greedy`` adds the candidate with the largest gain, again and again. ``exact`` searches
        all sets by branch and bound; where that takes too long, the best set found is returned
        with ``method="greedy"`` and its bound. ``auto`` is exact up to `FEW_SETS` sets.

    Raises
    ------
    SettingsError
        `count` is less than 1, than the views that are asked, or more than the candidates.

    Examples
    --------
    The candidate with the largest gain sees the middle; two others see everything:

    >>> seen = np.array([[0, 1, 1, 1, 1, 0], [1, 1, 1, 0, 0, 0], [0, 0, 0, 1, 1, 1]], np.float32)
    >>> world = Objective(seen, np.ones(6))
    >>> [(choose(world, 2, how).sites, round(choose(world, 2, how).value, 3))
    ...  for how in ("greedy", "exact")]
    [((0, 1), 0.833), ((1, 2), 1.0)]
    """
    check_count(len(objective), count, objective.views, method)
    found = greedy_choice(objective, count)
    if count == len(objective):
        return replace(found, bound=found.value, method="exact")
    few = math.comb(len(objective), count) <= FEW_SETS
    if count <= DEEPEST and (method == "exact" or (method == "auto" and few)):
        return _Search(objective, count, found, MOST_WORK[method]).run()
    return found


def check_count(candidates: int, count: int, views: int = 1, method: str = "auto") -> None:
    """Raise where so many places cannot be chosen.

    Raises
    ------
    SettingsError
        As `choose`.
    """
    if method not in METHODS:
        raise SettingsError(f"the method must be one of {', '.join(METHODS)}, got {method!r}.")
    if not 1 <= count <= candidates:
        raise SettingsError(
            f"{count} places cannot be chosen from {candidates} candidates: give a number from 1 to"
            f" {candidates}."
        )
    if not 1 <= views <= count:
        raise SettingsError(
            f"views must be from 1 to the number of places, {count}, got {views}: choose more"
            " places, or ask for fewer views."
        )


def greedy_choice(objective: Objective, count: int) -> Choice:
    """Lazy greedy: a gain is computed again only where its last value is the largest (Minoux 1978).

    The choice is that of the plain greedy method: of equal gains the first candidate's.
    """
    views = objective.empty()
    heap = [(-views.gain(nth), nth) for nth in range(len(objective))]
    heapq.heapify(heap)
    first = -np.array(sorted(gain for gain, _ in heap)[:count])
    evaluations, sites, gains = len(heap), list[int](), list[float]()
    while len(sites) < count:
        _, nth = heapq.heappop(heap)
        fresh = (-views.gain(nth), nth)
        evaluations += 1
        if heap and fresh > heap[0]:
            heapq.heappush(heap, fresh)
            continue
        sites.append(nth)
        gains.append(-fresh[0])
        views = views.with_site(nth)
    value = math.fsum(gains)
    # Those of the best set that are missing add no more than the largest gains do, one by one.
    last = sorted((views.gain(nth) for _, nth in heap), reverse=True)[:count]
    bound = min(math.fsum(first), value + math.fsum(last), value / GREEDY_SHARE, 1.0)
    evaluations += len(heap)
    return Choice(tuple(sites), tuple(gains), value, max(bound, value), "greedy", evaluations)


class _Search:
    """Depth first branch and bound: sets in the order of their gains, pruned by their bound."""

    def __init__(self, objective: Objective, count: int, start: Choice, most_work: float) -> None:
        self._objective, self._count, self._start = objective, count, start
        self._best, self._sites = start.value, start.sites
        self._most = int(most_work / max(len(objective.weight), LEAST_WORK))
        self._evaluations = start.evaluations

    def run(self) -> Choice:
        """The best set, proven where the search came to its end."""
        proven = self._extend(self._objective.empty(), (), 0.0, list(range(len(self._objective))))
        sites, gains = self._ordered(self._sites)
        value = math.fsum(gains)
        if not proven:
            bound = max(self._start.bound, value)
            return Choice(sites, gains, value, bound, "greedy", self._evaluations)
        return Choice(sites, gains, value, value, "exact", self._evaluations)

    def _extend(self, views: Views, sites: tuple[int, ...], value: float, left: list[int]) -> bool:
        """Look at all sets that extend some sites by some of the candidates left."""
        missing = self._count - len(sites)
        if self._evaluations > self._most:
            return False
        gains = sorted(((views.gain(nth), -nth) for nth in left), reverse=True)
        self._evaluations += len(left)
        if missing == 1:
            if value + gains[0][0] > self._best + ROUNDING:
                self._best, self._sites = value + gains[0][0], (*sites, -gains[0][1])
            return True
        for place in range(len(gains) - missing + 1):
            bound = value + math.fsum(gain for gain, _ in gains[place : place + missing])
            if bound <= self._best + ROUNDING:
                return True  # nor do the branches after it reach more
            gain, nth = gains[place][0], -gains[place][1]
            rest = [-other for _, other in gains[place + 1 :]]
            if not self._extend(views.with_site(nth), (*sites, nth), value + gain, rest):
                return False
        return True

    def _ordered(self, chosen: tuple[int, ...]) -> tuple[tuple[int, ...], tuple[float, ...]]:
        """The set, each site the one that adds the most to those before it, and the gains."""
        views, left = self._objective.empty(), sorted(chosen)
        sites, gains = list[int](), list[float]()
        while left:
            gain, nth = max((views.gain(nth), -nth) for nth in left)
            sites.append(-nth)
            gains.append(gain)
            left.remove(-nth)
            views = views.with_site(-nth)
        return tuple(sites), tuple(gains)
