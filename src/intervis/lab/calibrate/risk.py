"""Thresholds of the words "visible" and "occluded" by conformal risk control.

The calibration units are whole scans (cells of the matrix, pairs of a drive), because the lines of
one scan depend on each other. Of the lines of unit i that lean to the word (P on its side of 0.5),
let W_i(t) be the fraction that a threshold t calls visible (occluded) although it is not. W_i falls
with t. For a level b the threshold

    t(b) = the smallest t with (sum of W_i(t) + 1) / (n + 1) <= b

has an expected W of at most b on a new unit, if the n units and the new one are exchangeable
(Angelopoulos, Bates, Fisch, Lei, Schuster: Conformal risk control, ICLR 2024). A risk r means b = r
C, with the fraction C of these lines that are called so, taken from the units at the threshold:
then, of the lines that are called visible (occluded), at most the fraction r is expected to be
wrong. The bound thus holds for scans like those of the calibration, as a mean over scans and not
for each one, and up to the sampling error of C.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from intervis.arrays import BoolArray, Float64Array

RISKS = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2)
NEVER = 2.0
"""A threshold that no probability reaches."""
CANDIDATES = np.unique(
    np.concatenate([np.linspace(0.5, 0.95, 91), 1.0 - np.geomspace(0.05, 1e-5, 100)])
)


class Unit(NamedTuple):
    """The N lines of one scan that lean to a word: how sure it is (N,), and whether it is right."""

    sureness: Float64Array
    right: BoolArray


def thresholds(units: Sequence[Unit], risks: Sequence[float] = RISKS) -> list[float]:
    """The smallest threshold of sureness for each risk; `NEVER` where none is low enough.

    Examples
    --------
    A hundred scans whose answers are right from a sureness of 0.7 on:

    >>> sureness = np.linspace(0.5, 1.0, 501)
    >>> unit = Unit(sureness, sureness > 0.7)
    >>> low, high = thresholds([unit] * 100, (0.001, 0.05))
    >>> low, round(high, 2)
    (2.0, 0.69)
    """
    wrong, called = np.zeros((2, len(units), len(CANDIDATES)))
    for i, unit in enumerate(units):
        count = max(len(unit.sureness), 1)
        called[i] = _at_least(unit.sureness, CANDIDATES) / count
        wrong[i] = _at_least(unit.sureness[~unit.right], CANDIDATES) / count
    bound = (wrong.sum(axis=0) + 1.0) / (len(units) + 1)
    coverage = called.mean(axis=0)
    found = [np.flatnonzero(bound <= risk * coverage) for risk in risks]
    return [float(CANDIDATES[rows[0]]) if len(rows) else NEVER for rows in found]


def _at_least(values: Float64Array, limits: Float64Array) -> Float64Array:
    """How many values are not below each limit."""
    below = np.searchsorted(np.sort(values), limits, side="left")
    return np.asarray(len(values) - below, dtype=np.float64)
