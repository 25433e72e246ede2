"""Rows divided at a rank: against sorting, ties, empty bins and numbers of any size included."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from intervis.method.ranks import BINS, room_for, select, split


def after_split(value, low, high, target, room_rows=None):
    """The rows, named from 100 on."""
    rows = np.arange(len(value)) + 100
    kept = value.copy()
    split(rows, value, low, high, target, room_for(room_rows or len(value)))
    assert value.tolist() == kept.tolist(), "values are not moved"
    return rows - 100


def is_split(rows, value, target):
    """Whether the rows are all there, those of the smallest values first."""
    first = value[rows[:target]]
    return (
        sorted(rows.tolist()) == list(range(len(value)))
        and sorted(first.tolist()) == sorted(value.tolist())[:target]
    )


@given(
    st.integers(0, 2**32 - 1),
    st.integers(1, 4 * BINS),
    st.sampled_from(["normal", "few values", "one value", "clusters", "one far"]),
    st.sampled_from([1e-300, 1.0, 1e300]),
    st.data(),
)
def test_the_smallest_values_come_first(seed, count, kind, scale, data):
    rng = np.random.default_rng(seed)
    value = rng.normal(size=count)
    if kind == "few values":
        value = rng.integers(0, 3, count).astype(float)
    elif kind == "one value":
        value[:] = 0.25
    elif kind == "clusters":
        value = 1e-9 * value + rng.integers(0, 4, count)
    elif kind == "one far":
        value[0] = 1e6
    value *= scale
    target = data.draw(st.integers(0, count - 1))
    rows = after_split(
        value, value.min(), value.max(), target, count + data.draw(st.integers(0, 9))
    )
    assert is_split(rows, value, target)


@given(st.integers(0, 2**32 - 1), st.floats(allow_nan=True), st.floats(allow_nan=True))
def test_bins_anywhere_give_the_same_split(seed, low, high):
    value = np.random.default_rng(seed).normal(size=99)
    for target in (0, 1, 49, 98):
        assert is_split(after_split(value, low, high, target), value, target)


def test_numbers_whose_differences_overflow_are_split_too():
    value = np.array([1.5e308, -1.5e308, 0.0, 1e308, -1e308, 1.0])
    for target in range(6):
        assert is_split(after_split(value, -1.5e308, 1.5e308, target), value, target)


@given(st.lists(st.integers(0, 9), min_size=1, max_size=60), st.data())
def test_select_puts_the_smallest_values_first(values, data):
    value = np.array(values, float)
    rows = np.arange(len(value)) + 100
    target = data.draw(st.integers(0, len(value) - 1))
    select(rows, value, target)
    assert sorted(value[:target].tolist()) == sorted(values)[:target]
    assert value[target] == sorted(values)[target]
    assert (value[:target] <= value[target]).all()
    assert (value[target:] >= value[target]).all()
    assert np.array(values, float)[rows - 100].tolist() == value.tolist(), "rows follow the values"


class Counted(list):
    """A list that counts how often it is read."""

    reads = 0

    def __getitem__(self, index):
        self.reads += 1
        return super().__getitem__(index)


@pytest.mark.parametrize("share", [0.0, 0.3, 0.5, 0.99])
def test_select_takes_linear_time_on_sorted_and_reversed_values(share):
    n = 1000
    for values in (range(n), range(n, 0, -1), [7] * n, [*range(0, n, 2), *range(n, 0, -2)]):
        value, rows = Counted(map(float, values)), list(range(len(values)))
        target = int(share * n)
        getattr(select, "py_func", select)(rows, value, target)
        assert value[target] == sorted(values)[target]
        assert value.reads < 20 * n, "a bad pivot reads half of n * n"
