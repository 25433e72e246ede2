"""Scores against values computed by hand, brute-force counts and invariants."""

import numpy as np
import pytest
from hypothesis import assume, given
from made_answers import answers, columns

from intervis.errors import PointsError
from intervis.lab.truth.scores import (
    area_under_curve,
    average,
    matthews,
    reliability,
    score,
)

ANSWERS = answers([0.0, 0.1, 0.3, 0.5, 0.55, 0.9, 1.0], most=40)


def test_matthews_from_a_table():
    # TP 6, FN 2, FP 1, TN 3: (6*3 - 1*2) / sqrt(7*8*4*5) = 16 / sqrt(1120)
    labels = np.array([True] * 8 + [False] * 4)
    predicted = np.array([True] * 6 + [False] * 2 + [True] + [False] * 3)
    assert matthews(labels, predicted) == pytest.approx(16 / np.sqrt(1120))


@given(ANSWERS)
def test_matthews_is_pearsons_correlation(rows):
    labels, probability = columns(rows)
    predicted = probability >= 0.5
    assume(0 < labels.sum() < len(labels) and 0 < predicted.sum() < len(predicted))
    expected = np.corrcoef(labels.astype(float), predicted.astype(float))[0, 1]
    assert matthews(labels, predicted) == pytest.approx(expected, abs=1e-12)
    assert matthews(labels, ~predicted) == pytest.approx(-expected, abs=1e-12)


def test_matthews_of_equal_values():
    both, ones = np.array([True, False]), np.array([True, True])
    assert matthews(both, ones) == 0.0
    assert matthews(both, ~ones) == 0.0
    assert np.isnan(matthews(ones, both))
    assert np.isnan(matthews(~ones, both))
    assert np.isnan(matthews(ones[:0], ones[:0]))


def test_matthews_of_millions_does_not_overflow():
    labels = np.arange(4_000_000) % 2 == 0
    assert matthews(labels, labels) == 1.0


@given(ANSWERS)
def test_area_is_the_fraction_of_correctly_ranked_pairs(rows):
    labels, probability = columns(rows)
    assume(0 < labels.sum() < len(labels))
    wins = [
        1.0 if a > b else 0.5 if a == b else 0.0
        for a in probability[labels]
        for b in probability[~labels]
    ]
    assert area_under_curve(labels, probability) == pytest.approx(np.mean(wins))


def test_area_of_one_label_is_undefined():
    assert np.isnan(area_under_curve(np.array([True]), np.array([0.5])))


def test_three_states():
    labels = [True, True, False, False, False, True]
    state = [1, 1, 1, 0, -1, -1]
    scores = score(labels, [0.9, 0.8, 0.7, 0.1, 0.4, 0.2], state)
    assert scores.coverage == pytest.approx(4 / 6)
    assert scores.precision_visible == pytest.approx(2 / 3)
    assert scores.precision_occluded == 1.0
    # answered: TP 2, FP 1, TN 1, FN 0: (2*1 - 0) / sqrt(3*2*2*1)
    assert scores.mcc_answered == pytest.approx(2 / np.sqrt(12))
    # all: the first three are predicted visible: TP 2, FN 1, FP 1, TN 2
    assert scores.mcc == pytest.approx((4 - 1) / 9)
    assert scores.brier == pytest.approx((0.01 + 0.04 + 0.49 + 0.01 + 0.16 + 0.64) / 6)
    assert (scores.count, scores.visible_fraction) == (6, 0.5)


def test_without_states_the_coverage_is_complete():
    scores = score([True, False], [0.5, 0.49])
    assert (scores.coverage, scores.mcc, scores.mcc_answered) == (1.0, 1.0, 1.0)


def test_a_state_never_predicted_has_no_precision():
    scores = score([True, False], [0.9, 0.9], [-1, -1])
    assert np.isnan([scores.precision_visible, scores.precision_occluded]).all()
    assert np.isnan(scores.mcc_answered)
    assert scores.coverage == 0.0


def test_reliability_bins_and_edges():
    bins = reliability(np.array([True, False, True, True]), np.array([0.1, 0.19, 1.0, 0.0]))
    np.testing.assert_allclose(bins.weight, [0.25, 0.5, 0, 0, 0, 0, 0, 0, 0, 0.25])
    np.testing.assert_allclose(bins.mean_probability[[0, 1, 9]], [0.0, 0.145, 1.0])
    np.testing.assert_allclose(bins.visible_fraction[[0, 1, 9]], [1.0, 0.5, 1.0])
    assert np.isnan(bins.mean_probability[2:9]).all()
    assert np.isnan(bins.calibration_error[2:9]).all()
    assert bins.max_calibration_error == 1.0
    assert bins.expected_calibration_error == pytest.approx(0.25 * 1 + 0.5 * 0.355)


def test_the_maximum_error_ignores_nearly_empty_bins():
    labels = np.concatenate([np.zeros(995, bool), np.ones(5, bool)])
    probability = np.concatenate([np.full(995, 0.02), np.full(5, 0.35)])
    bins = reliability(labels, probability)
    assert bins.max_calibration_error == pytest.approx(0.02)
    assert bins.max_calibration_error_all_bins == pytest.approx(0.65)


@pytest.mark.parametrize(("small", "expected"), [(9, 0.02), (10, 0.65)])
def test_the_maximum_error_includes_bins_from_one_percent_on(small, expected):
    labels = np.arange(1000) < small
    bins = reliability(labels, np.where(labels, 0.35, 0.02))
    assert bins.max_calibration_error == pytest.approx(expected)


@given(ANSWERS)
def test_reliability_keeps_all_points(rows):
    labels, probability = columns(rows)
    bins = reliability(labels, probability)
    assert bins.weight.sum() == pytest.approx(1)
    assert np.nansum(bins.weight * bins.mean_probability) == pytest.approx(probability.mean())
    assert np.nansum(bins.weight * bins.visible_fraction) == pytest.approx(labels.mean())
    # the calibration part of the Brier score cannot exceed it
    assert (
        np.nansum(bins.weight * bins.calibration_error**2)
        <= np.mean((probability - labels) ** 2) + 1e-12
    )


def test_averages_weight_query_sets_equally():
    large = score([True, False] * 50, [1.0, 0.0] * 50)
    small = score([True, False], [0.0, 1.0])
    mean = average([large, small])
    assert (mean.mcc, mean.auc, mean.brier, mean.count) == (0.0, 0.5, 0.5, 102)
    np.testing.assert_allclose(mean.reliability.visible_fraction[[0, 9]], [0.5, 0.5])
    np.testing.assert_allclose(mean.reliability.weight[[0, 9]], [0.5, 0.5])


def test_averages_leave_nan_out():
    one = score([True, False], [1.0, 0.0], [1, -1])
    other = score([True, False], [1.0, 0.0], [-1, 0])
    mean = average([one, other])
    assert (mean.precision_visible, mean.precision_occluded) == (1.0, 1.0)
    assert mean.coverage == 0.5


def test_nothing_scored():
    for scores in (score([], []), average([]), average([score([], [])])):
        assert scores.count == 0
        assert np.isnan([scores.mcc, scores.auc, scores.brier, scores.coverage]).all()
        assert np.isnan(scores.reliability.max_calibration_error)
        assert np.isnan(scores.reliability.expected_calibration_error)


@pytest.mark.parametrize(
    ("labels", "probability", "state", "message"),
    [
        ([True], [0.5, 0.5], None, "one length"),
        ([[True]], [[0.5]], None, "one length"),
        ([True], [1.5], None, "0 to 1"),
        ([True], [np.nan], None, "0 to 1"),
        ([True], [0.5], [2], "state"),
        ([True], [0.5], [0, 1], "one length"),
    ],
)
def test_bad_predictions_are_refused(labels, probability, state, message):
    with pytest.raises(PointsError, match=message):
        score(labels, probability, state)


def test_nothing_scored_has_empty_bins():
    nothing = average([score([], []), score([], [])])
    assert nothing.reliability.weight.tolist() == [0.0] * 10
    assert np.isnan(nothing.reliability.max_calibration_error)
    assert nothing.count == 0
