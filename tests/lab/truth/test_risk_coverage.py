"""Risk and coverage against values computed by hand, all orders of ties, and invariants."""

from itertools import groupby, permutations, product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_answers import answers, columns

from intervis.lab.truth.risk_coverage import risk_coverage
from intervis.lab.truth.scores import average, score

ANSWERS = answers([0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 1.0], most=7)


def all_orders(labels, probability):
    """Each order of the lines by descending sureness; lines of equal sureness in any order."""
    tenths = np.round(10 * probability).astype(int)  # whole numbers: no rounding between ties
    ranked = sorted(range(len(labels)), key=lambda row: -abs(tenths[row] - 5))
    groups = [list(rows) for _, rows in groupby(ranked, key=lambda row: abs(tenths[row] - 5))]
    for parts in product(*(permutations(group) for group in groups)):
        yield [row for part in parts for row in part]


def brute_force(labels, probability, answered):
    """False visible, false occluded among `answered` lines, meaned over the orders of ties."""
    rates = []
    for order in all_orders(labels, probability):
        rows = order[:answered]
        visible = sum(probability[row] >= 0.5 and not labels[row] for row in rows)
        occluded = sum(probability[row] < 0.5 and labels[row] for row in rows)
        rates.append((visible / answered, occluded / answered))
    return np.mean(rates, axis=0)


def test_on_paper():
    # by sureness: right, false occluded, right, false visible, right
    labels = np.array([True, True, False, False, True])
    probability = np.array([0.99, 0.05, 0.1, 0.8, 0.6])
    curve = risk_coverage(labels, probability)
    assert curve.area == pytest.approx((0 + 1 / 2 + 1 / 3 + 2 / 4 + 2 / 5) / 5)
    assert curve.false_rates(0.2) == (0.0, 0.0)
    assert curve.false_rates(0.4) == (0.0, pytest.approx(1 / 2))
    assert curve.false_rates(0.6) == (0.0, pytest.approx(1 / 3))
    assert curve.false_rates(0.8) == pytest.approx((1 / 4, 1 / 4))
    assert curve.false_rates(1.0) == pytest.approx((1 / 5, 1 / 5))
    # half of the third line, which is right: one wrong of 2.5
    assert curve.false_rates(0.5) == (0.0, pytest.approx(1 / 2.5))


@pytest.mark.parametrize("coverage", [0.1, 0.6, 1.0])
def test_a_binary_method_has_its_error_at_every_coverage(coverage):
    labels = np.array([True] * 7 + [False] * 3)
    said = np.array([True] * 6 + [False] + [True] * 2 + [False])  # 1 false occluded, 2 visible
    curve = risk_coverage(labels, said.astype(float))
    assert curve.area == pytest.approx(0.3)
    assert curve.false_rates(coverage) == pytest.approx((0.2, 0.1))


def test_surest_right_answers_are_better_than_surest_wrong_ones():
    labels = np.array([True, True, False])
    assert risk_coverage(labels, np.array([0.9, 0.8, 0.6])).area == pytest.approx(1 / 9)
    assert risk_coverage(labels, np.array([0.6, 0.7, 0.9])).area == pytest.approx(
        (1 + 1 / 2 + 1 / 3) / 3
    )


@given(ANSWERS)
def test_expectations_over_all_orders_of_ties(rows):
    labels, probability = columns(rows)
    curve = risk_coverage(labels, probability)
    total = len(labels)
    risks = [brute_force(labels, probability, answered) for answered in range(1, total + 1)]
    assert curve.area == pytest.approx(np.sum(risks) / total)
    for answered, rates in enumerate(risks, start=1):
        assert curve.false_rates(answered / total) == pytest.approx(tuple(rates))


@given(ANSWERS, st.integers(2, 5))
def test_the_risk_at_full_coverage_is_the_error(rows, copies):
    labels, probability = columns(rows)
    error = np.mean(labels != (probability >= 0.5))
    once = risk_coverage(labels, probability)
    often = risk_coverage(np.tile(labels, copies), np.tile(probability, copies))
    assert sum(once.false_rates(1.0)) == pytest.approx(error)
    assert sum(often.false_rates(1.0)) == pytest.approx(error)


@given(ANSWERS)
def test_swapping_visible_and_occluded_swaps_the_rates(rows):
    labels, probability = columns([row for row in rows if row[1] != 0.5] or [(True, 0.9)])
    curve, mirrored = risk_coverage(labels, probability), risk_coverage(~labels, 1 - probability)
    assert mirrored.area == pytest.approx(curve.area)
    for coverage in (0.3, 0.8):
        assert mirrored.false_rates(coverage)[::-1] == pytest.approx(curve.false_rates(coverage))


def test_without_lines_the_risk_is_undefined():
    curve = risk_coverage(np.empty(0, bool), np.empty(0))
    assert np.isnan([curve.area, *curve.false_rates(0.6)]).all()


def test_scores_hold_the_risks():
    labels, probability = np.array([True] * 16 + [False] * 4), np.full(20, 0.9)
    probability[3], probability[18:] = 0.2, 0.02  # one false occluded, two false visible
    scores = score(labels, probability, np.where(np.arange(20) < 5, -1, 1))
    # the two at 0.02 are right, then 17 lines at 0.9 with two wrong, then the one at 0.2
    assert scores.false_visible_60 == pytest.approx(2 * 10 / 17 / 12)
    assert scores.false_visible_80 == pytest.approx(2 * 14 / 17 / 16)
    assert scores.false_visible_95 == pytest.approx(2 / 19)
    assert [scores.false_occluded_60, scores.false_occluded_95] == [0.0, 0.0]
    assert scores.unknown_probability == pytest.approx((4 * 0.9 + 0.2) / 5)
    assert scores.unknown_visible_fraction == 1.0
    other = score(labels, np.ones(20))
    assert other.aurc == pytest.approx(0.2)
    assert np.isnan(other.unknown_probability)
    assert average([scores, other]).aurc == pytest.approx((scores.aurc + 0.2) / 2)
    assert scores.to_json()["false_visible_80"] == scores.false_visible_80
