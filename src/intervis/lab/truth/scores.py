"""Scores of answers about visibility: correlation, ranking, probability, and the honest "unknown".

A score that the points cannot give is NaN, never 0 or 1: a precision of nothing said, a
correlation where the truth holds one kind of point only. Averages pass NaN over.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike

from intervis.arrays import BoolArray, Float64Array, IntArray
from intervis.errors import PointsError

BIN_COUNT = 10
"""Bins of the reliability plot, equally wide over 0 to 1."""
FILLED_SHARE = 0.01
"""A bin counts as filled with this share of all points; see `Reliability.largest_gap`."""
VISIBLE, OCCLUDED, UNKNOWN = 1, 0, -1
"""The three answers, as `intervis.Sight.state` writes them."""


@dataclass(frozen=True, eq=False)
class Reliability:
    """How often points were visible that were said to be so with a probability.

    Attributes
    ----------
    weight : (10,) float64 array
        Share of all points whose probability fell into each bin; sums to 1.
    said : (10,) float64 array
        Mean probability of the points in each bin; NaN where it is empty.
    true : (10,) float64 array
        Share of them that was visible; NaN where it is empty.
    """

    weight: Float64Array
    said: Float64Array
    true: Float64Array

    @property
    def gap(self) -> Float64Array:
        """(10,) distance of what was said from what was true; NaN where a bin is empty."""
        return np.abs(self.said - self.true)

    @property
    def largest_gap(self) -> float:
        """Largest gap of the bins that hold at least 1 % of all points; NaN without points.

        Emptier bins are left out because a handful of points beside one edge can fill them and
        all be wrong together; `largest_gap_of_all` counts those too.
        """
        return _largest(self.gap[self.weight >= FILLED_SHARE])

    @property
    def largest_gap_of_all(self) -> float:
        """Largest gap of all bins that hold any point; NaN without points."""
        return _largest(self.gap)

    @property
    def mean_gap(self) -> float:
        """Gap averaged over the points ("expected calibration error"); NaN without points."""
        filled = self.weight > 0
        return float(self.weight[filled] @ self.gap[filled]) if filled.any() else float("nan")


@dataclass(frozen=True, eq=False)
class Scores:
    """How good the answers to a set of points are.

    Attributes
    ----------
    mcc : float
        Matthews correlation with every point answered: visible from a probability of 0.5 on.
    auc : float
        Area under the ROC curve of the probability.
    brier : float
        Mean squared distance of the probability from the truth (1 or 0).
    coverage : float
        Share of points whose answer was not "unknown".
    precision_visible, precision_occluded : float
        Share of what was called visible (occluded) that was.
    mcc_answered : float
        Matthews correlation of the three-valued answer over the points that it does not call
        "unknown".
    visible_share : float
        Share of points that were visible in truth.
    count : int
        Number of points.
    reliability : Reliability
    """

    mcc: float
    auc: float
    brier: float
    coverage: float
    precision_visible: float
    precision_occluded: float
    mcc_answered: float
    visible_share: float
    count: int
    reliability: Reliability


def score(visible: ArrayLike, probability: ArrayLike, state: ArrayLike | None = None) -> Scores:
    """Score the answers to K points.

    Parameters
    ----------
    visible : (K,) bool array
        The truth.
    probability : (K,) float array
        Of being visible, 0 to 1; a yes-or-no answer gives 1 and 0.
    state : (K,) int array, optional
        1 visible, 0 occluded, -1 unknown; without it every point counts as answered, visible from
        a probability of 0.5 on.

    Raises
    ------
    PointsError
        The arrays do not match, a probability is not within 0 to 1, or a state is none of the
        three.

    Examples
    --------
    >>> scores = score([True, True, False, False], [0.9, 0.4, 0.2, 0.1], [1, -1, 0, 0])
    >>> round(scores.mcc, 3), scores.auc, scores.coverage, scores.mcc_answered
    (0.577, 1.0, 0.75, 1.0)
    """
    truth, sure, said = _checked(visible, probability, state)
    answered = said != UNKNOWN
    called_visible, called_occluded = said == VISIBLE, said == OCCLUDED
    return Scores(
        mcc=matthews(truth, sure >= 0.5),
        auc=area_under_curve(truth, sure),
        brier=_mean((sure - truth) ** 2),
        coverage=_mean(answered),
        precision_visible=_mean(truth[called_visible]),
        precision_occluded=_mean(~truth[called_occluded]),
        mcc_answered=matthews(truth[answered], called_visible[answered]),
        visible_share=_mean(truth),
        count=len(truth),
        reliability=reliability(truth, sure),
    )


def average(scores: Sequence[Scores]) -> Scores:
    """Scores averaged over pairs of poses, each pair counting the same; counts are summed.

    The bins of the reliability plot are pooled (each pair's points weighing 1 in all) before the
    gaps are taken: a gap is a property of the answers together.

    Examples
    --------
    >>> one, other = score([True, False], [1, 0]), score([True, False], [0, 1])
    >>> average([one, other]).mcc, average([one, other]).count
    (0.0, 4)
    """
    if not scores:
        return score([], [])
    means = {
        field.name: _mean_of_numbers([getattr(one, field.name) for one in scores])
        for field in fields(Scores)
        if field.name not in ("count", "reliability")
    }
    return Scores(
        **means,
        count=sum(one.count for one in scores),
        reliability=_pooled([one.reliability for one in scores if one.count]),
    )


def matthews(truth: BoolArray, said: BoolArray) -> float:
    """Matthews correlation coefficient of two (K,) bool arrays.

    0 where everything was called the same; NaN where the truth itself is all of one kind, for
    then nothing can correlate with it. Matthews, BBA 405 (1975) 442-451.

    Examples
    --------
    >>> matthews(np.array([True, True, False, False]), np.array([True, False, False, False]))
    0.577...
    """
    total, positive, called = len(truth), int(truth.sum()), int(said.sum())
    if positive in (0, total):
        return float("nan")
    if called in (0, total):
        return 0.0
    both = int((truth & said).sum())
    # the covariance of two 0/1 variables over the product of their deviations, in integers
    spread = float(positive * (total - positive)) * float(called * (total - called))
    return float(both * total - positive * called) / float(np.sqrt(spread))


def area_under_curve(truth: BoolArray, probability: Float64Array) -> float:
    """Chance that a visible point has a higher probability than a hidden one; ties count half.

    NaN where the truth is all of one kind.

    Examples
    --------
    >>> area_under_curve(np.array([True, False, False]), np.array([0.5, 0.5, 0.1]))
    0.75
    """
    positive = int(truth.sum())
    negative = len(truth) - positive
    if positive == 0 or negative == 0:
        return float("nan")
    _, place, share = np.unique(probability, return_inverse=True, return_counts=True)
    last = np.cumsum(share)
    rank = (last - (share - 1) / 2.0)[place]  # mean rank of equal probabilities, from 1
    wins = float(rank[truth].sum()) - positive * (positive + 1) / 2.0
    return wins / positive / negative


def reliability(truth: BoolArray, probability: Float64Array) -> Reliability:
    """Bin (K,) probabilities in ten; a bin holds its lower edge, the last its upper one too.

    Examples
    --------
    >>> bins = reliability(np.array([True, False, True]), np.array([0.95, 0.9, 1.0]))
    >>> print(bins.weight[9], bins.said[9].round(2), bins.true[9].round(2))
    1.0 0.95 0.67
    """
    place: IntArray = np.minimum((probability * BIN_COUNT).astype(np.int64), BIN_COUNT - 1)
    share = np.bincount(place, minlength=BIN_COUNT).astype(np.float64)
    said = np.bincount(place, probability, BIN_COUNT)
    true = np.bincount(place, truth, BIN_COUNT)
    with np.errstate(invalid="ignore"):
        return Reliability(share / max(1, len(truth)), said / share, true / share)


def _pooled(parts: Sequence[Reliability]) -> Reliability:
    if not parts:
        return reliability(np.empty(0, dtype=bool), np.empty(0))
    weight = np.sum([part.weight for part in parts], axis=0)
    said = np.sum([np.nan_to_num(part.said) * part.weight for part in parts], axis=0)
    true = np.sum([np.nan_to_num(part.true) * part.weight for part in parts], axis=0)
    with np.errstate(invalid="ignore"):
        return Reliability(weight / max(1, len(parts)), said / weight, true / weight)


def _checked(
    visible: ArrayLike, probability: ArrayLike, state: ArrayLike | None
) -> tuple[BoolArray, Float64Array, IntArray]:
    truth = np.asarray(visible, dtype=bool)
    sure = np.asarray(probability, dtype=np.float64)
    said = np.where(sure >= 0.5, VISIBLE, OCCLUDED) if state is None else np.asarray(state)
    if truth.ndim != 1 or not truth.shape == sure.shape == said.shape:
        raise PointsError(
            "visible, probability and state must be of one length,"
            f" got the shapes {truth.shape}, {sure.shape} and {said.shape}."
        )
    if not ((sure >= 0) & (sure <= 1)).all():
        raise PointsError("probability must lie within 0 to 1 everywhere.")
    if not np.isin(said, (VISIBLE, OCCLUDED, UNKNOWN)).all():
        raise PointsError("state must be 1 (visible), 0 (occluded) or -1 (unknown) everywhere.")
    return truth, sure, said.astype(np.int64)


def _mean(values: BoolArray | Float64Array) -> float:
    return float(values.mean()) if len(values) else float("nan")


def _mean_of_numbers(values: Sequence[float]) -> float:
    known = [value for value in values if not np.isnan(value)]
    return float(np.mean(known)) if known else float("nan")


def _largest(gaps: Float64Array) -> float:
    known = gaps[~np.isnan(gaps)]
    return float(known.max()) if len(known) else float("nan")
