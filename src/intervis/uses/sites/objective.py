"""What a set of sites is worth: the weighted share of the targets that it sees."""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from intervis.arrays import Float32Array, Float64Array
from intervis.errors import PointsError, SettingsError

Combination = Literal["best", "independent"]
"""How the probabilities of several sites combine; see `Objective`."""
COMBINATIONS: tuple[str, ...] = get_args(Combination)


def check_combination(combine: str) -> None:
    """Raise where there is no such combination.

    Raises
    ------
    SettingsError
        It is none of `COMBINATIONS`.
    """
    if combine not in COMBINATIONS:
        raise SettingsError(f"combine must be one of {', '.join(COMBINATIONS)}, got {combine!r}.")


@dataclass(frozen=True, eq=False)
class Objective:
    """The worth of sets of C candidates that look at T targets.

    N is the number of chosen sites that see a target. The worth of a set is the weighted mean over
    the targets of E[min(N, views)] / views: the share of the wanted views that is met, from 0 to 1.
    With one view it is the weighted probability that a target is seen at all. It never falls when
    a site is added, and a site adds less to a larger set (monotone and submodular, under both
    combinations), as the bound of the greedy choice requires.

    Parameters
    ----------
    probability : (C, T) float32 array
        P(visible) of each target from each candidate, 0 where it is out of reach.
    weight : (T,) float64 array
        Of the targets, not negative; its sum becomes 1.
    views : int
        By so many sites is each target to be seen.
    combine : {"best", "independent"}
        ``best``: as if sites failed together; N >= j has the j-th largest probability of the
        target. Of all dependences with these probabilities it gives the least worth, so the true
        worth is as large or larger. ``independent``: as if sites failed independently.

    Raises
    ------
    PointsError
        Shapes that do not fit, probabilities outside 0 to 1, or weights that are negative, not
        finite, or all 0.
    SettingsError
        `views` is less than 1, or there is no such combination.

    Examples
    --------
    >>> seen = np.array([[0.5, 0.0], [0.5, 0.8]], np.float32)
    >>> round(Objective(seen, np.ones(2)).value([0, 1]), 3)  # (0.5 + 0.8) / 2
    0.65
    >>> round(Objective(seen, np.ones(2), combine="independent").value([0, 1]), 3)
    0.775
    """

    probability: Float32Array
    weight: Float64Array
    views: int = 1
    combine: Combination = "best"

    def __post_init__(self) -> None:
        probability, weight = np.asarray(self.probability), np.asarray(self.weight, np.float64)
        if probability.ndim != 2 or weight.shape != probability.shape[1:]:
            raise PointsError(
                f"{probability.shape} probabilities need a weight for each column, got"
                f" {weight.shape}."
            )
        if not ((probability >= 0.0) & (probability <= 1.0)).all():
            raise PointsError("probabilities must be from 0 to 1; out of reach is 0, not NaN.")
        if not ((weight >= 0.0) & np.isfinite(weight)).all() or not weight.sum() > 0.0:
            raise PointsError("the weights of targets must be 0 or more, finite, and not all 0.")
        if self.views < 1:
            raise SettingsError(f"views must be 1 or more, got {self.views}.")
        check_combination(self.combine)
        object.__setattr__(self, "probability", probability.astype(np.float32, copy=False))
        object.__setattr__(self, "weight", weight / weight.sum())

    def __len__(self) -> int:
        return len(self.probability)

    def empty(self) -> "Views":
        """The views of no site."""
        state = np.zeros((len(self.weight), self.views))
        if self.combine == "independent":
            state[:, 0] = 1.0
            return Views(self, state, np.ones(len(self.weight)))
        return Views(self, state, np.zeros(len(self.weight)))

    def views_of(self, chosen: "list[int]") -> "Views":
        """The views of a set of candidates."""
        views = self.empty()
        for nth in chosen:
            views = views.with_site(nth)
        return views

    def value(self, chosen: "list[int]") -> float:
        """Worth of a set of candidates, from 0 to 1."""
        views, total = self.empty(), 0.0
        for nth in chosen:
            total += views.gain(nth)
            views = views.with_site(nth)
        return total


@dataclass(frozen=True, eq=False)
class Views:
    """How a set of sites sees each target; adding a site makes another one.

    Attributes
    ----------
    objective : Objective
    state : (T, views) float64 array
        ``best``: the largest probabilities, rising. ``independent``: P(N = 0), P(N = 1), ...
    room : (T,) float64 array
        What decides the gain: the views-th largest probability, or P(N < views). A site never
        raises the gain of another one, to the last bit, because sums of rounded numbers rise with
        their terms.
    """

    objective: Objective
    state: Float64Array
    room: Float64Array

    def gain(self, nth: int) -> float:
        """What candidate `nth` would add to the worth."""
        own = self.objective.probability[nth].astype(np.float64)
        if self.objective.combine == "independent":
            more = own * self.room
        else:
            more = np.maximum(own - self.room, 0.0)
        # A sum in a fixed order, unlike that of a library for matrices.
        return float((self.objective.weight * more).sum()) / self.objective.views

    def with_site(self, nth: int) -> "Views":
        """The views with one more site."""
        own = self.objective.probability[nth].astype(np.float64)
        if self.objective.combine == "best":
            state = self.state.copy()
            state[:, 0] = np.maximum(state[:, 0], own)
            state.sort(axis=1)
            return Views(self.objective, state, state[:, 0].copy())
        state = self.state * (1.0 - own[:, None])
        state[:, 1:] += self.state[:, :-1] * own[:, None]
        room = np.maximum(self.room - own * self.state[:, -1], 0.0)
        return Views(self.objective, state, room)

    @property
    def enough(self) -> Float64Array:
        """(T,) probability that `views` sites or more see each target."""
        if self.objective.combine == "independent":
            return np.asarray(1.0 - self.room)
        return self.room
