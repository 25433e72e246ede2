"""Orientation and in-circle tests, against rational numbers."""

from fractions import Fraction

import exact_double
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from intervis.delaunay import exact
from intervis.delaunay.predicates import incircle, incircle_by_exact_numbers, turn

whole = st.integers(-40, 40).map(float)
near_one = st.integers(-9, 9).map(lambda k: 1.0 + k * 2.0**-52)
spread = st.builds(lambda m, e: m * 2.0**e, st.integers(-(2**53), 2**53), st.integers(-80, 20))
coordinates = st.one_of(
    whole, near_one, spread, st.floats(-1e7, 1e7).filter(lambda x: x * x > 1e-80)
)


def sign(number) -> int:
    return int(number > 0) - int(number < 0)


def places(count):
    return st.lists(st.tuples(coordinates, coordinates), min_size=count, max_size=count)


@given(places(3))
@settings(max_examples=400)
def test_turn(three):
    assert sign(turn(*np.ravel(three))) == sign(exact_double.turn(*exact_double.exact(three)))


@given(places(2), st.integers(-8, 8), st.integers(-2, 2), st.integers(-2, 2))
@settings(max_examples=300)
def test_turn_of_positions_on_a_line_but_for_the_last_bit(two, eighths, up, right):
    a, b = np.array(two)
    c = a + (b - a) * eighths / 8
    c += exact_double.last_bits(c) * [up, right]
    three = [a, b, c]
    assert sign(turn(*np.ravel(three))) == sign(exact_double.turn(*exact_double.exact(three)))


def expected_inside(four) -> bool:
    return exact_double.inside(*exact_double.exact(four))


def left_turning(four):
    """The same positions, the first three turning left; None if they are on a line."""
    a, b, c, d = four
    side = exact_double.turn(*exact_double.exact([a, b, c]))
    return None if side == 0 else [a, b, c, d] if side > 0 else [a, c, b, d]


@given(places(4))
@settings(max_examples=400)
def test_incircle(four):
    four = left_turning(four)
    if four is not None and tuple(four[3]) not in {tuple(p) for p in four[:3]}:
        assert incircle(*np.ravel(four)) == expected_inside(four)
        assert incircle_by_exact_numbers(*np.ravel(four)) == expected_inside(four)


@given(
    coordinates,
    coordinates,
    st.tuples(whole, whole).filter(any),
    st.permutations([(1, 1), (-1, 1), (-1, -1), (1, -1)]),
    st.tuples(st.integers(-1, 1), st.integers(-1, 1)),
)
@settings(max_examples=400)
def test_incircle_of_corners_of_a_rectangle_but_for_the_last_bit(x, y, half, signs, bits):
    """Four positions on a circle, or as nearly as doubles can be."""
    four = np.array([x, y]) + np.array(half) * signs
    four[3] += exact_double.last_bits(four[3]) * bits
    four = left_turning(four)
    if four is not None and tuple(four[3]) not in {tuple(p) for p in four[:3]}:
        assert incircle(*np.ravel(four)) == expected_inside(four)


@pytest.mark.parametrize("turned", range(4))
def test_of_four_on_a_circle_the_last_lies_outside(turned):
    circle = np.roll([[0.0, 0], [1, 0], [1, 1], [0, 1]], turned, axis=0)
    last = (turned + 2) % 4  # where the corner at 1, 1 went
    # Cut off by the diagonal of its neighbours, or not: whether the fourth is inside
    assert incircle(*circle.ravel()) == (last in (0, 2))


@given(coordinates, coordinates)
def test_sums_and_products_lose_nothing(a, b):
    total, error = exact.two_sum(a, b)
    assert total == a + b
    assert Fraction(total) + Fraction(error) == Fraction(a) + Fraction(b)
    product, error = exact.two_product(a, b)
    assert product == a * b
    assert Fraction(product) + Fraction(error) == Fraction(a) * Fraction(b)


@given(st.lists(coordinates, max_size=12))
def test_expansions_are_exact_sums(numbers):
    sums, end = np.zeros(64), 0
    for number in numbers:
        end = exact._add_product(sums, end, number, number + 1.0)
    squares = [Fraction(number) * Fraction(number + 1.0) for number in numbers]
    assert sum((Fraction(part) for part in sums[:end]), Fraction(0)) == sum(squares)
    assert (np.diff(np.abs(sums[:end])) > 0).all()


@given(coordinates, coordinates, coordinates, coordinates)
@settings(max_examples=200)
def test_pairs_keep_the_bound_of_their_error(a, b, c, d):
    """Their documented relative errors: 7 and 3 times 2^-106."""
    one, other = exact.two_product(a, b), exact.two_product(c, d)
    exact_one, exact_other = (sum(map(Fraction, pair)) for pair in (one, other))
    product = sum(map(Fraction, exact.pair_product(*one, *other)))
    assert abs(product - exact_one * exact_other) <= abs(exact_one * exact_other) * 7 / 2**106
    total = sum(map(Fraction, exact.pair_sum(*one, *other)))
    assert abs(total - exact_one - exact_other) <= abs(exact_one + exact_other) * 3 / 2**106
