"""Scores of visibility predictions: correlation, ranking, calibration, coverage and risk.

A score that is not defined for the given points is NaN: the precision of a state that was never
predicted, a correlation where all labels are equal. Averages leave NaN out.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import rankdata

from intervis.arrays import BoolArray, Float64Array, IntArray
from intervis.errors import PointsError
from intervis.lab.truth.risk_coverage import risk_coverage
from intervis.sight import OCCLUDED, UNKNOWN, VISIBLE

BIN_COUNT = 10
"""Number of bins of the reliability diagram, equally wide over 0 to 1."""
MIN_BIN_FRACTION = 0.01
"""`Reliability.max_calibration_error` ignores bins that hold a smaller fraction of the points."""
COVERAGES = (0.6, 0.8, 0.95)
"""Coverages at which the rates of false answers are reported."""


@dataclass(frozen=True, eq=False)
class Reliability:
    """Reliability diagram: the predicted probabilities in ten bins, against the labels.

    Attributes
    ----------
    weight : (10,) float64 array
        Fraction of all points whose probability lies in each bin; the sum is 1.
    mean_probability : (10,) float64 array
        Mean predicted probability of the points in each bin; NaN where it is empty.
    visible_fraction : (10,) float64 array
        Fraction of the points in each bin that are visible; NaN where it is empty.
    """

    weight: Float64Array
    mean_probability: Float64Array
    visible_fraction: Float64Array

    @property
    def calibration_error(self) -> Float64Array:
        """(10,) ``abs(mean_probability - visible_fraction)``; NaN where a bin is empty."""
        return np.abs(self.mean_probability - self.visible_fraction)

    @property
    def max_calibration_error(self) -> float:
        """Largest error of the bins that hold at least 1 % of the points; NaN without points.

        Bins with fewer points are left out, because a few points near one edge can fill such a
        bin and all be wrong together. `max_calibration_error_all_bins` includes them.
        """
        return _maximum(self.calibration_error[self.weight >= MIN_BIN_FRACTION])

    @property
    def max_calibration_error_all_bins(self) -> float:
        """Largest error of all bins that are not empty; NaN without points."""
        return _maximum(self.calibration_error)

    @property
    def expected_calibration_error(self) -> float:
        """Error averaged over the points (ECE); NaN without points."""
        filled = self.weight > 0
        if not filled.any():
            return math.nan
        return float(self.weight[filled] @ self.calibration_error[filled])


@dataclass(frozen=True, eq=False)
class Scores:
    """Scores of the predictions for one set of points.

    Attributes
    ----------
    mcc : float
        Matthews correlation coefficient over all points; a point is predicted visible where its
        probability is at least 0.5.
    auc : float
        Area under the ROC curve of the probability.
    brier : float
        Mean squared difference of the probability and the label (1 or 0).
    coverage : float
        Fraction of points whose state is not "unknown".
    precision_visible, precision_occluded : float
        Fraction of the points with state "visible" ("occluded") for which this is true.
    mcc_answered : float
        Matthews correlation coefficient of the state, over the points whose state is not
        "unknown".
    visible_fraction : float
        Fraction of points that are visible.
    aurc : float
        Area under the risk-coverage curve of the probability: 0 is best. See
        `intervis.lab.truth.risk_coverage`.
    false_visible_60, false_visible_80, false_visible_95 : float
        Fraction of the surest 60, 80 and 95 % of the points that are called visible, and are not.
    false_occluded_60, false_occluded_80, false_occluded_95 : float
        The same for points that are called occluded. The sum of the two is the risk.
    unknown_probability, unknown_visible_fraction : float
        Mean probability of the points with state "unknown", and the fraction of them that are
        visible.
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
    visible_fraction: float
    aurc: float
    false_visible_60: float
    false_visible_80: float
    false_visible_95: float
    false_occluded_60: float
    false_occluded_80: float
    false_occluded_95: float
    unknown_probability: float
    unknown_visible_fraction: float
    count: int
    reliability: Reliability

    def to_json(self) -> dict[str, Any]:
        """The scores by name, with the bins of the reliability diagram; NaN becomes None."""
        bins = self.reliability
        return {
            **{name: number_or_none(getattr(self, name)) for name in _averaged_fields()},
            "count": self.count,
            "reliability": {
                **{
                    field.name: [number_or_none(value) for value in getattr(bins, field.name)]
                    for field in fields(bins)
                },
                "max_calibration_error": number_or_none(bins.max_calibration_error),
                "max_calibration_error_all_bins": number_or_none(
                    bins.max_calibration_error_all_bins
                ),
                "expected_calibration_error": number_or_none(bins.expected_calibration_error),
            },
        }


def score(visible: ArrayLike, probability: ArrayLike, state: ArrayLike | None = None) -> Scores:
    """Score the predictions for K points.

    Parameters
    ----------
    visible : (K,) bool array
        The labels.
    probability : (K,) float array
        Predicted probability of being visible, 0 to 1; a binary prediction gives 1 and 0.
    state : (K,) int array, optional
        1 visible, 0 occluded, -1 unknown. Without it a point is visible where its probability is
        at least 0.5, and occluded elsewhere.

    Raises
    ------
    PointsError
        The arrays differ in length, a probability is outside 0 to 1, or a state has another value.

    Examples
    --------
    >>> scores = score([True, True, False, False], [0.9, 0.4, 0.2, 0.1], [1, -1, 0, 0])
    >>> round(scores.mcc, 3), scores.auc, scores.coverage, scores.mcc_answered
    (0.577, 1.0, 0.75, 1.0)
    """
    labels, probabilities, states = _checked(visible, probability, state)
    answered = states != UNKNOWN
    predicted_visible, predicted_occluded = states == VISIBLE, states == OCCLUDED
    curve = risk_coverage(labels, probabilities)
    false_rates = [curve.false_rates(coverage) for coverage in COVERAGES]
    return Scores(
        mcc=matthews(labels, probabilities >= 0.5),
        auc=area_under_curve(labels, probabilities),
        brier=mean_or_nan((probabilities - labels) ** 2),
        coverage=mean_or_nan(answered),
        precision_visible=mean_or_nan(labels[predicted_visible]),
        precision_occluded=mean_or_nan(~labels[predicted_occluded]),
        mcc_answered=matthews(labels[answered], predicted_visible[answered]),
        visible_fraction=mean_or_nan(labels),
        aurc=curve.area,
        false_visible_60=false_rates[0][0],
        false_visible_80=false_rates[1][0],
        false_visible_95=false_rates[2][0],
        false_occluded_60=false_rates[0][1],
        false_occluded_80=false_rates[1][1],
        false_occluded_95=false_rates[2][1],
        unknown_probability=mean_or_nan(probabilities[~answered]),
        unknown_visible_fraction=mean_or_nan(labels[~answered]),
        count=len(labels),
        reliability=reliability(labels, probabilities),
    )


def average(scores: Sequence[Scores]) -> Scores:
    """Mean scores over query sets with equal weights; counts are summed.

    The bins of the reliability diagrams are pooled with equal weights as well. The calibration
    errors are those of the pooled bins, not means of the query sets' errors.

    Examples
    --------
    >>> one, other = score([True, False], [1, 0]), score([True, False], [0, 1])
    >>> average([one, other]).mcc, average([one, other]).count
    (0.0, 4)
    """
    if not scores:
        return score([], [])
    means = {
        name: mean_of_known([getattr(one, name) for one in scores]) for name in _averaged_fields()
    }
    return Scores(
        **means,
        count=sum(one.count for one in scores),
        reliability=_pooled([one.reliability for one in scores if one.count]),
    )


def matthews(labels: BoolArray, predictions: BoolArray) -> float:
    """Matthews correlation coefficient of two (K,) bool arrays.

    0 where all predictions are equal; NaN where all labels are equal, where it is not defined.
    Matthews, Biochim. Biophys. Acta 405 (1975) 442-451, doi:10.1016/0005-2795(75)90109-9.

    Examples
    --------
    >>> labels = np.array([True, True, False, False])
    >>> matthews(labels, np.array([True, False, False, False]))
    0.577...
    """
    total, positive, predicted = len(labels), int(labels.sum()), int(predictions.sum())
    if positive in (0, total):
        return math.nan
    if predicted in (0, total):
        return 0.0
    true_positive = int((labels & predictions).sum())
    # The covariance of two 0/1 variables over the product of their standard deviations, in
    # integers as far as possible: the products exceed float precision for millions of points.
    covariance = float(true_positive * total - positive * predicted)
    variances = float(positive * (total - positive)) * float(predicted * (total - predicted))
    return covariance / math.sqrt(variances)


def area_under_curve(labels: BoolArray, probability: Float64Array) -> float:
    """Area under the ROC curve (K points): how often a visible point ranks above an occluded one.

    Ties count half. NaN where all labels are equal.

    Examples
    --------
    >>> area_under_curve(np.array([True, False, False]), np.array([0.5, 0.5, 0.1]))
    0.75
    """
    positive = int(labels.sum())
    negative = len(labels) - positive
    if positive == 0 or negative == 0:
        return math.nan
    rank_sum = float(rankdata(probability)[labels].sum())  # mean ranks of ties, from 1
    return (rank_sum - positive * (positive + 1) / 2.0) / positive / negative


def reliability(labels: BoolArray, probability: Float64Array) -> Reliability:
    """Reliability diagram of K points; bins are closed below and open above, the last is closed.

    Examples
    --------
    >>> bins = reliability(np.array([True, False, True]), np.array([0.95, 0.9, 1.0]))
    >>> print(bins.weight[9], bins.mean_probability[9].round(2), bins.visible_fraction[9].round(2))
    1.0 0.95 0.67
    """
    bin_index: IntArray = np.minimum((probability * BIN_COUNT).astype(np.int64), BIN_COUNT - 1)
    count = np.bincount(bin_index, minlength=BIN_COUNT).astype(np.float64)
    probability_sum = np.bincount(bin_index, probability, BIN_COUNT)
    visible_count = np.bincount(bin_index, labels, BIN_COUNT)
    with np.errstate(invalid="ignore"):
        return Reliability(
            count / max(1, len(labels)), probability_sum / count, visible_count / count
        )


def _pooled(parts: Sequence[Reliability]) -> Reliability:
    """The diagrams together, each with weight 1."""
    if not parts:
        return reliability(np.empty(0, dtype=bool), np.empty(0))
    weight = np.sum([part.weight for part in parts], axis=0)
    probability = np.sum([np.nan_to_num(part.mean_probability) * part.weight for part in parts], 0)
    visible = np.sum([np.nan_to_num(part.visible_fraction) * part.weight for part in parts], 0)
    with np.errstate(invalid="ignore"):
        return Reliability(weight / len(parts), probability / weight, visible / weight)


def _checked(
    visible: ArrayLike, probability: ArrayLike, state: ArrayLike | None
) -> tuple[BoolArray, Float64Array, IntArray]:
    labels = np.asarray(visible, dtype=bool)
    probabilities = np.asarray(probability, dtype=np.float64)
    if state is None:
        states = np.where(probabilities >= 0.5, VISIBLE, OCCLUDED)
    else:
        states = np.asarray(state)
    if labels.ndim != 1 or not labels.shape == probabilities.shape == states.shape:
        raise PointsError(
            "visible, probability and state must be of one length,"
            f" got the shapes {labels.shape}, {probabilities.shape} and {states.shape}."
        )
    if not ((probabilities >= 0) & (probabilities <= 1)).all():
        raise PointsError("probability must lie within 0 to 1 everywhere.")
    if not np.isin(states, (VISIBLE, OCCLUDED, UNKNOWN)).all():
        raise PointsError("state must be 1 (visible), 0 (occluded) or -1 (unknown) everywhere.")
    return labels, probabilities, states.astype(np.int64)


def _averaged_fields() -> list[str]:
    """The fields of `Scores` that are single numbers and can be averaged."""
    return [field.name for field in fields(Scores) if field.name not in ("count", "reliability")]


def mean_or_nan(values: BoolArray | Float64Array) -> float:
    """Mean of (K,) values; NaN without values."""
    return float(values.mean()) if len(values) else math.nan


def mean_of_known(values: Sequence[float]) -> float:
    """Mean of the values that are not NaN; NaN without any."""
    known = [value for value in values if not math.isnan(value)]
    return float(np.mean(known)) if known else math.nan


def number_or_none(value: float) -> float | None:
    """A finite number, or None: JSON has no NaN."""
    return float(value) if math.isfinite(value) else None


def _maximum(errors: Float64Array) -> float:
    known = errors[~np.isnan(errors)]
    return float(known.max()) if len(known) else math.nan
