"""Signs of orientation and in-circle determinants without rounding error.

`predicates` calls these functions where its fast tests cannot decide. They evaluate a determinant
at most twice:

1. in pairs of doubles (106 bits), which decides unless the determinant is zero or nearly so, and
   also then if no operation was rounded, as for the positions of a grid;
2. as an expansion: an exact sum of doubles that do not overlap, smallest first. Adding a double
   to an expansion and multiplying two doubles are exact operations (Dekker 1971; Shewchuk,
   "Adaptive Precision Floating-Point Arithmetic and Fast Robust Geometric Predicates", 1997).

This holds where no product overflows or underflows: `order` scales the positions so that none
does. It relies on rounding to nearest after each operation, so fast-math is forbidden here.
"""

from typing import Any

import numpy as np

from intervis.arrays import Float64Array
from intervis.kernels import kernel

SPLITTER = 134217729.0
"""2^27 + 1 splits a double into two halves of 26 bits."""

PAIR_BOUND = 2.0**-98
"""Bound of the error of a determinant in pairs of doubles, as a share of the sum of the absolute
values of its terms. A product of pairs has a relative error below 7 x 2^-106, a sum below
3 x 2^-106; together they stay below 40 x 2^-106."""

MINOR = 16
"""Most doubles in the expansion of a 2 x 2 minor or a squared length: 8 products of two each."""


@kernel
def two_sum(a: float, b: float) -> tuple[float, float]:
    """The rounded sum, and its rounding error."""
    total = a + b
    b_part = total - a
    return total, (a - (total - b_part)) + (b - b_part)


@kernel
def two_product(a: float, b: float) -> tuple[float, float]:
    """The rounded product, and its rounding error."""
    product = a * b
    big = SPLITTER * a
    a_high = big - (big - a)
    a_low = a - a_high
    big = SPLITTER * b
    b_high = big - (big - b)
    b_low = b - b_high
    error = ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low
    return product, error


@kernel
def pair_product(a: float, a_low: float, b: float, b_low: float) -> tuple[float, float]:
    """Product of two pairs; exact if both low parts are 0."""
    product, error = two_product(a, b)
    error += a * b_low + a_low * b
    total = product + error
    return total, error - (total - product)


@kernel
def pair_sum(a: float, a_low: float, b: float, b_low: float) -> tuple[float, float]:
    """Sum of two pairs; exact if both low parts are 0."""
    total, error = two_sum(a, b)
    low, low_error = two_sum(a_low, b_low)
    error += low
    high = total + error
    error = (error - (high - total)) + low_error
    total = high + error
    return total, error - (total - high)


@kernel
def exact_turn(ax: float, ay: float, bx: float, by: float, cx: float, cy: float) -> float:
    """A number with the sign of (a - c) x (b - c); 0 if the three are collinear."""
    acx, acx_low = two_sum(ax, -cx)
    acy, acy_low = two_sum(ay, -cy)
    bcx, bcx_low = two_sum(bx, -cx)
    bcy, bcy_low = two_sum(by, -cy)
    det, _, size, lost = _minor(acx, acx_low, acy, acy_low, bcx, bcx_low, bcy, bcy_low)
    if lost == 0.0 or abs(det) > PAIR_BOUND * size:
        return det
    sums = np.empty(MINOR)
    end = _minor_expansion(sums, acx, acx_low, acy, acy_low, bcx, bcx_low, bcy, bcy_low)
    return sums[end - 1] if end > 0 else 0.0


@kernel
def exact_incircle(
    ax: float, ay: float, bx: float, by: float, cx: float, cy: float, dx: float, dy: float
) -> float:
    """A number with the sign of the in-circle determinant; 0 if the four lie on one circle."""
    adx, adx_low = two_sum(ax, -dx)
    ady, ady_low = two_sum(ay, -dy)
    bdx, bdx_low = two_sum(bx, -dx)
    bdy, bdy_low = two_sum(by, -dy)
    cdx, cdx_low = two_sum(cx, -dx)
    cdy, cdy_low = two_sum(cy, -dy)
    first, first_low, size, lost = _term(
        adx, adx_low, ady, ady_low, bdx, bdx_low, bdy, bdy_low, cdx, cdx_low, cdy, cdy_low
    )
    second, second_low, more_size, more_lost = _term(
        bdx, bdx_low, bdy, bdy_low, cdx, cdx_low, cdy, cdy_low, adx, adx_low, ady, ady_low
    )
    third, third_low, most_size, most_lost = _term(
        cdx, cdx_low, cdy, cdy_low, adx, adx_low, ady, ady_low, bdx, bdx_low, bdy, bdy_low
    )
    both, both_low = pair_sum(first, first_low, second, second_low)
    det, _ = pair_sum(both, both_low, third, third_low)
    lost += more_lost + most_lost + abs(both_low)
    if lost == 0.0 or abs(det) > PAIR_BOUND * (size + more_size + most_size):
        return det

    sums, lift, minor = np.empty(6 * MINOR * MINOR), np.empty(MINOR), np.empty(MINOR)
    end: Any = np.int64(0)
    for _ in range(3):
        lifts = _square_expansion(lift, adx, adx_low, ady, ady_low)
        minors = _minor_expansion(minor, bdx, bdx_low, bdy, bdy_low, cdx, cdx_low, cdy, cdy_low)
        for i in range(lifts):
            for j in range(minors):
                end = _add_product(sums, end, lift[i], minor[j])
        adx, adx_low, bdx, bdx_low, cdx, cdx_low = bdx, bdx_low, cdx, cdx_low, adx, adx_low
        ady, ady_low, bdy, bdy_low, cdy, cdy_low = bdy, bdy_low, cdy, cdy_low, ady, ady_low
    return sums[end - 1] if end > 0 else 0.0


@kernel
def _minor(
    ax: float,
    ax_low: float,
    ay: float,
    ay_low: float,
    bx: float,
    bx_low: float,
    by: float,
    by_low: float,
) -> tuple[float, float, float, float]:
    """The pair a x b, the sum of its absolute terms, and 0 if nothing was rounded before."""
    left, left_low = pair_product(ax, ax_low, by, by_low)
    right, right_low = pair_product(ay, ay_low, bx, bx_low)
    det, det_low = pair_sum(left, left_low, -right, -right_low)
    lost = abs(ax_low) + abs(ay_low) + abs(bx_low) + abs(by_low) + abs(left_low) + abs(right_low)
    return det, det_low, abs(left) + abs(right), lost


@kernel
def _term(
    ax: float,
    ax_low: float,
    ay: float,
    ay_low: float,
    bx: float,
    bx_low: float,
    by: float,
    by_low: float,
    cx: float,
    cx_low: float,
    cy: float,
    cy_low: float,
) -> tuple[float, float, float, float]:
    """The pair |a|^2 (b x c), the sum of its absolute terms, and 0 if nothing was rounded."""
    minor, minor_low, size, lost = _minor(bx, bx_low, by, by_low, cx, cx_low, cy, cy_low)
    x, x_low = pair_product(ax, ax_low, ax, ax_low)
    y, y_low = pair_product(ay, ay_low, ay, ay_low)
    lift, lift_low = pair_sum(x, x_low, y, y_low)
    term, term_low = pair_product(lift, lift_low, minor, minor_low)
    lost += abs(x_low) + abs(y_low) + abs(lift_low) + abs(minor_low) + abs(term_low)
    return term, term_low, lift * size, lost


@kernel
def _minor_expansion(
    sums: Float64Array,
    ax: float,
    ax_low: float,
    ay: float,
    ay_low: float,
    bx: float,
    bx_low: float,
    by: float,
    by_low: float,
) -> int:
    """Write the expansion of a x b; its length."""
    end = _add_product(sums, np.int64(0), ax_low, by_low)
    end = _add_product(sums, end, -ay_low, bx_low)
    end = _add_product(sums, end, ax, by_low)
    end = _add_product(sums, end, ax_low, by)
    end = _add_product(sums, end, -ay, bx_low)
    end = _add_product(sums, end, -ay_low, bx)
    end = _add_product(sums, end, ax, by)
    return _add_product(sums, end, -ay, bx)


@kernel
def _square_expansion(sums: Float64Array, x: float, x_low: float, y: float, y_low: float) -> int:
    """Write the expansion of x^2 + y^2; its length."""
    end = _add_product(sums, np.int64(0), x_low, x_low)
    end = _add_product(sums, end, y_low, y_low)
    end = _add_product(sums, end, 2.0 * x, x_low)
    end = _add_product(sums, end, 2.0 * y, y_low)
    end = _add_product(sums, end, x, x)
    return _add_product(sums, end, y, y)


@kernel
def _add_product(sums: Float64Array, end: int, a: float, b: float) -> int:
    """Add a product to the expansion sums[:end]; its new length."""
    product, error = two_product(a, b)
    return _add(sums, _add(sums, end, error), product)


@kernel
def _add(sums: Float64Array, end: int, term: float) -> int:
    """Add a double to the expansion sums[:end], leaving zeros out; its new length."""
    kept: Any = 0
    carried = term
    for k in range(end):
        carried, error = two_sum(carried, sums[k])
        if error != 0.0:
            sums[kept] = error
            kept += 1
    if carried != 0.0:
        sums[kept] = carried
        kept += 1
    return kept
