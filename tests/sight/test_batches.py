"""Lines laid out in batches, the choice of scans and their look-up: numbers worked out by hand."""

import numpy as np
import pytest

from intervis.sight.kernels.batch import BRACKETED, FIRST, INCREMENT, STEP_M, lay_out
from intervis.sight.kernels.dynamics import find_bracketing
from intervis.sight.kernels.march import order_ends
from intervis.sight.kernels.packed_scans import choose_scans


def laid_out(lengths, begin=0, step_m=0.25, end_margin_m=0.375):
    """Lines of these lengths along x: how many fit, their columns and their offsets."""
    first = np.zeros((len(lengths), 3))
    second = first + [[length, 0.0, 0.0] for length in lengths]
    lines, offsets = np.full((64, BRACKETED + 1), np.nan), np.full((64, 3), -1)
    count = lay_out(first, second, begin, step_m, end_margin_m, lines, offsets)
    return count, lines[:count], offsets[:count].tolist()


@pytest.mark.parametrize(
    ("length_m", "steps", "skipped"),
    [
        (3.0, 12, 2),  # the margin of 0.375 m is one and a half steps: two midpoints lie in it
        (3.1, 13, 2),  # steps of 0.238 m: midpoints 0.12, 0.36 (left out), 0.60 m
        (0.75, 3, 2),  # no longer than its margins: no sample
        (0.8, 4, 2),  # midpoints 0.1, 0.3, 0.5, 0.7 m: all within 0.375 m of an end
        (0.9, 4, 2),
        (1.1, 5, 2),  # midpoint 0.55 m is the only one
        (0.5, 2, 1),
        (0.2, 1, 1),
        (0.0, 1, 1),
        (512.0, 2048, 2),
        (1024.0, 2048, 1),  # longer lines have longer steps, of 0.5 m: only 0.25 m is left out
    ],
)
def test_a_line_has_equal_steps_and_no_samples_within_its_margins(length_m, steps, skipped):
    count, lines, offsets = laid_out([length_m])
    assert count == 1
    assert lines[0, INCREMENT] == 1.0 / steps
    assert lines[0, STEP_M] == pytest.approx(length_m / steps)
    assert lines[0, FIRST] == skipped + 0.5
    samples = max(steps - 2 * skipped, 0)
    assert offsets == [[0, samples, -(-samples // 8) * 8]]


def test_the_length_of_a_line_counts_all_three_axes():
    first, second = np.array([[1.0, 2.0, 3.0]]), np.array([[3.0, 5.0, 9.0]])  # 2, 3, 6: 7 m
    lines, offsets = np.empty((64, BRACKETED + 1)), np.empty((64, 3), np.int64)
    assert lay_out(first, second, 0, 0.25, 0.375, lines, offsets) == 1
    assert lines[0, STEP_M] == 0.25
    assert offsets[0].tolist() == [0, 24, 24]


def test_lines_follow_each_other_at_multiples_of_eight():
    _, lines, offsets = laid_out([3.0, 3.25, 5.0, 0.0, 3.0], begin=1)
    assert offsets == [[0, 9, 16], [16, 32, 32], [32, 32, 32], [32, 40, 40]]
    assert lines[:, STEP_M].tolist() == [0.25, 0.25, 0.0, 0.25]


def test_a_batch_is_closed_at_512_samples_or_64_lines():
    assert laid_out([3.0] * 100)[0] == 64
    assert laid_out([3.0] * 100, begin=60)[0] == 40
    assert laid_out([129.0] * 3)[0] == 1, "512 samples fill it"
    assert laid_out([127.0] * 3)[0] == 2, "504 samples leave room for one more line"
    assert laid_out([0.0] * 100)[0] == 64


def chosen_for(position_x, a_x, b_x, count, age_cost_m=None):
    """Scans chosen for lines along x, by scans along x."""
    position = np.zeros((len(position_x), 3))
    position[:, 0] = position_x
    a, b = np.zeros((len(a_x), 3)), np.zeros((len(b_x), 3))
    a[:, 0], b[:, 0] = a_x, b_x
    cost = np.zeros(len(position)) if age_cost_m is None else np.array(age_cost_m)
    chosen = np.full((len(a), count), -1)
    choose_scans(position, cost, a, b, chosen, np.empty(len(position)), np.empty(count))
    return chosen.tolist()


def test_scans_are_chosen_by_half_metres_and_the_newest_first():
    x = [0.0, 0.4, 0.5, 0.9, 1.0, -0.6]
    # from 0: in steps of half a metre 0, 0, 1, 1, 2, 1
    assert chosen_for(x, [0.0], [50.0], 6) == [[1, 0, 5, 3, 2, 4]]
    assert chosen_for(x, [0.0], [50.0], 4) == [[1, 0, 5, 3]]
    assert chosen_for(x, [50.0], [0.0], 2) == [[1, 0]], "the nearer end counts"
    # 0.5 m for its age takes scan 1 out of the first step
    assert chosen_for(x, [0.0], [50.0], 3, [0.0, 0.5, 0.0, 0.0, 0.0, 0.0]) == [[0, 5, 3]]


def test_each_line_has_its_own_scans_whatever_the_line_before_had():
    x = [0.0, 10.0, 20.0, 30.0]
    a = [1.0, 2.0, 29.0, 29.0, 11.0, 1.0]
    expected = [[0, 1], [0, 1], [3, 2], [3, 2], [1, 2], [0, 1]]
    assert chosen_for(x, a, a, 2) == expected


def test_the_distance_of_a_scan_counts_all_three_axes():
    position = np.array([[2.0, 3.0, 6.0], [0.0, 6.9, 0.0], [-7.4, 0.0, 0.0]])  # 7, 6.9 and 7.4 m
    a, b = np.zeros((1, 3)), np.full((1, 3), 90.0)
    chosen = np.empty((1, 3), np.int64)
    choose_scans(position, np.zeros(3), a, b, chosen, np.empty(3), np.empty(3))
    assert chosen.tolist() == [[1, 2, 0]]
    choose_scans(position, np.zeros(3), b, a, chosen, np.empty(3), np.empty(3))
    assert chosen.tolist() == [[1, 2, 0]]


@pytest.mark.parametrize(("apart_m", "rank"), [(0.5, 1.0), (0.49, 0.0)])
def test_scans_that_bracket_a_query_are_half_a_metre_apart(apart_m, rank):
    position = np.array([[0.0, 0.0, 0.0], [apart_m, 0.0, 0.0]])
    a, b = np.array([[0.25, 0.0, 0.0]]), np.array([[9.0, 9.0, 0.0]])
    table = np.full((1, BRACKETED + 1), np.nan)
    find_bracketing(position, np.full(2, np.nan), a, b, np.array([[0, 1]]), table)
    assert table[0, 12] == rank
    assert table[0, 9:12].tolist() == pytest.approx([1.0, 0.0, 0.25 / apart_m])


def test_a_query_time_outside_the_scans_is_decided_by_the_nearest():
    position = np.array([[0.0, 0.0, 0.0], [4.0, 3.0, 0.0], [8.0, 6.0, 0.0]])
    a, b = np.zeros((1, 3)), np.ones((1, 3))
    chosen, table = np.array([[0, 1, 2]]), np.empty((1, BRACKETED + 1))
    find_bracketing(position, np.array([-1.0, -2.0, -3.0]), a, b, chosen, table)
    assert table[0, 12] == -1.0
    find_bracketing(position, np.array([-1.0, -2.0, 3.0]), a, b, chosen, table)
    assert table[0, 12] == 2.0
    assert table[0, 9:12].tolist() == pytest.approx([0.8, 0.6, 0.25])  # 1 of 4 seconds
    # a scan taken at the query time: nothing lies on the other side of it
    find_bracketing(position, np.array([0.0, -2.0, 3.0]), a, b, chosen, table)
    assert table[0, 12] == -1.0


@pytest.mark.parametrize(
    ("a", "b"),
    [
        ([0.0, 5.0, 5.0], [1.0, 0.0, 0.0]),
        ([1.0, 0.0, 5.0], [1.0, 2.0, 0.0]),
        ([1.0, 2.0, -3.0], [1.0, 2.0, 3.0]),
        ([1.0, 2.0, 3.0], [1.0, 2.0, 3.0]),
    ],
)
def test_the_ends_of_a_line_are_ordered_by_x_then_y_then_z(a, b):
    for ends in ((a, b), (b, a)):
        first, second = (np.array([end]) for end in ends)
        order_ends(first, second)
        assert [first[0].tolist(), second[0].tolist()] == [a, b]
