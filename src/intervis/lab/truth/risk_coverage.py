"""Risk and coverage: how often a method is wrong among the answers of which it is surest.

Sort the lines by sureness, ``abs(probability - 0.5)``. The *risk at coverage c* is the fraction of
wrong answers among the surest c of all lines, where a line is called visible from a probability of
0.5 on. AURC is the mean of the risk over the coverages 1/K, 2/K, ..., 1 (El-Yaniv, Wiener: On the
foundations of noise-free selective classification, JMLR 11, 2010; Geifman, Uziel, El-Yaniv:
Bias-reduced uncertainty estimation for deep neural classifiers, ICLR 2019).

Lines of equal sureness have no order. All values are expectations over their random order, which
are exact and need no draw: a binary method, whose lines are all equally sure, has the risk of its
error at every coverage.
"""

from dataclasses import dataclass

import numpy as np

from intervis.arrays import BoolArray, Float64Array

SURENESS_DIGITS = 9
"""Sureness is rounded to so many digits: 0.3 and 0.7 are equally sure."""


@dataclass(frozen=True, eq=False)
class RiskCoverage:
    """Expected counts of wrong answers among the k surest of K lines.

    Attributes
    ----------
    count : (G + 1,) float64 array
        Number of lines in the surest groups, ascending from 0 to K. The lines of one group are
        equally sure.
    false_visible, false_occluded : (G + 1,) float64 arrays
        Of these lines, the number called visible (occluded) that are not. Between two groups the
        expected number is linear in k.
    """

    count: Float64Array
    false_visible: Float64Array
    false_occluded: Float64Array

    def false_rates(self, coverage: float) -> tuple[float, float]:
        """False visible and false occluded among the surest lines, as fractions of these lines.

        Their sum is the risk. NaN without lines.

        Parameters
        ----------
        coverage : float
            Fraction of all lines, above 0 and up to 1.
        """
        answered = coverage * self.count[-1]
        if answered == 0:
            return float("nan"), float("nan")
        visible, occluded = (
            float(np.interp(answered, self.count, wrong) / answered)
            for wrong in (self.false_visible, self.false_occluded)
        )
        return visible, occluded

    @property
    def area(self) -> float:
        """AURC, the mean risk over all coverages; NaN without lines."""
        total = int(self.count[-1])
        if total == 0:
            return float("nan")
        answered = np.arange(1, total + 1)
        wrong = np.interp(answered, self.count, self.false_visible + self.false_occluded)
        return float(np.mean(wrong / answered))


def risk_coverage(labels: BoolArray, probability: Float64Array) -> RiskCoverage:
    """Wrong answers by sureness, for K lines.

    Parameters
    ----------
    labels : (K,) bool array
        Whether the targets are visible.
    probability : (K,) float64 array
        Predicted probability of being visible.

    Examples
    --------
    The surest of four lines is right, the next one wrong, and of the last two, which are equally
    sure, one is wrong. The risks are 0, 1/2, 1.5/3 and 2/4:

    >>> curve = risk_coverage(np.array([True, False, True, True]), np.array([1, 0.9, 0.7, 0.3]))
    >>> curve.area, curve.false_rates(0.5), curve.false_rates(1.0)
    (0.375, (0.5, 0.0), (0.25, 0.25))
    """
    called_visible = probability >= 0.5
    sureness = np.round(np.abs(probability - 0.5), SURENESS_DIGITS)
    _, group, size = np.unique(-sureness, return_inverse=True, return_counts=True)
    wrong = labels != called_visible

    def running(selected: BoolArray) -> Float64Array:
        counts = np.bincount(group, selected, len(size))
        return np.concatenate([[0.0], np.cumsum(counts)])

    return RiskCoverage(
        np.concatenate([[0.0], np.cumsum(size)]),
        running(wrong & called_visible),
        running(wrong & ~called_visible),
    )
