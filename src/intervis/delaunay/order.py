"""A spatial order of positions, and the cuts by which it divides the plane.

A bounding square is cut in two halves again and again, across x and across y in turn. The Morton
number of a position tells on which side of each cut it lies. Positions in one of the smallest
cells are divided by a bounding square of their own, so that clusters of any size and distance end
in cells as square as all others; a few positions in one cell are sorted by x, then y.

The order is a depth-first walk through this tree of cuts: all positions on one side of a cut stand
together. Between two consecutive positions stands the cut that separates them.
"""

from math import frexp
from typing import Any

import numpy as np

from intervis.arrays import Float64Array, Int16Array, Int32Array, IntArray
from intervis.kernels import kernel

LARGEST = 200
"""The largest coordinate is scaled to below two to this power. The in-circle test multiplies four
differences of coordinates: 2^(4 x 202) does not overflow."""

SMALLEST = 2.0**-160
"""Scaled coordinates nearer to 0 count as 0, so that no product of four last bits underflows.
They are 10^-108 times the largest coordinate."""

CELLS = 65536
"""Cells along the longer side of a bounding square: 16 cuts across each axis."""

ROW_BITS = 31
"""Bits of a sort key below the 32 bits of the Morton number: the row."""

DIGIT_BITS = 11
DIGITS = 2048
"""Morton numbers are sorted by three digits."""

FEW = 32
"""At most this many positions of one cell are sorted by x, then y."""

SQUARE = 64
"""Cuts are numbered so that a cut made earlier has a larger number. Each bounding square has 64
numbers: `BY_SQUARE` and up are cuts of the square, an even one across x, an odd one across y; the
numbers below are cuts of positions sorted by x, then y."""

BY_SQUARE = 16

DEEPEST = 64
"""More than the bounding squares inside one another: between the largest and the smallest
coordinate lie 412 bits, and each square takes 16 of them."""


@kernel
def spatial_order(
    positions: Float64Array, xy: Float64Array, row: Int32Array, cut: Int16Array, vertex: Int32Array
) -> Any:
    """Order the distinct positions; returns their number M, or -1 for a number that is not finite.

    Parameters
    ----------
    positions : (V, 2) float64 array
    xy : (2 V,) float64 array
        Receives the distinct positions in order, x and y in turn, multiplied by a power of two.
    row : (V,) int32 array
        Receives the row of each of them: of several copies, the lowest.
    cut : (V,) int16 array
        Receives the number of the cut between each of them and the one before; 0 for the first.
    vertex : (V,) int32 array
        Receives the lowest row with the same position, for each row.
    """
    count = len(positions)
    scaled = np.empty((count, 2))
    if not _scale(positions, scaled):
        return -1
    for k in range(count):
        row[k], cut[k] = k, 0
    _divide(scaled, row, cut)

    distinct: Any = 0
    for k in range(count):
        x, y = scaled[row[k], 0], scaled[row[k], 1]
        if distinct > 0 and x == xy[2 * distinct - 2] and y == xy[2 * distinct - 1]:
            vertex[row[k]] = row[distinct - 1]
            continue
        xy[2 * distinct], xy[2 * distinct + 1] = x, y
        vertex[row[k]] = row[k]
        row[distinct], cut[distinct] = row[k], cut[k]
        distinct += 1
    return distinct


@kernel
def _scale(positions: Float64Array, scaled: Float64Array) -> bool:
    """Multiply by a power of two, which is exact; False if a number is not finite."""
    largest, total = 0.0, 0.0
    for k in range(len(positions)):
        x, y = abs(positions[k, 0]), abs(positions[k, 1])
        largest = max(largest, x, y)
        total += 0.0 * x + 0.0 * y  # NaN if either is NaN or infinite
    if total != 0.0:
        return False
    power = LARGEST - frexp(largest)[1]
    first = 2.0 ** (power // 2)  # in two steps, since 2^power may overflow
    second = 2.0 ** (power - power // 2)
    for k in range(len(positions)):
        for axis in range(2):
            value = positions[k, axis] * first * second
            scaled[k, axis] = value if abs(value) >= SMALLEST else 0.0
    return True


@kernel
def _divide(scaled: Float64Array, row: Int32Array, cut: Int16Array) -> None:
    """Put rows in order, and write the cut before each of them but the first."""
    count = len(row)
    key, other = np.empty(count, np.int64), np.empty(count, np.int64)
    histogram = np.empty((3, DIGITS), np.int64)
    # Cells of two positions or more that are not yet divided
    starts, stops = np.empty(count // 2 + 1, np.int64), np.empty(count // 2 + 1, np.int64)
    depths = np.empty(count // 2 + 1, np.int64)
    starts[0], stops[0], depths[0] = 0, count, 0
    left: Any = 1
    while left > 0:
        left -= 1
        start, stop, depth = starts[left], stops[left], depths[left]
        if stop - start <= FEW:
            _sort_few(scaled, row, cut, start, stop, (DEEPEST - depth) * SQUARE)
            continue
        if not _number(scaled, row, key, histogram, start, stop):
            continue  # copies of one position
        sorted_keys = _sort(key, other, histogram, start, stop)
        cell = start
        for k in range(start, stop):
            row[k] = sorted_keys[k] & ((1 << ROW_BITS) - 1)
            if k == start:
                continue
            apart = (sorted_keys[k] ^ sorted_keys[k - 1]) >> ROW_BITS
            if apart > 0:
                cut[k] = (DEEPEST - depth) * SQUARE + BY_SQUARE + frexp(float(apart))[1] - 1
                if k - cell > 1:
                    starts[left], stops[left], depths[left] = cell, k, depth + 1
                    left += 1
                cell = k
        if stop - cell > 1:
            starts[left], stops[left], depths[left] = cell, stop, depth + 1
            left += 1


@kernel
def _number(
    scaled: Float64Array,
    row: Int32Array,
    key: IntArray,
    histogram: IntArray,
    start: int,
    stop: int,
) -> bool:
    """Write sort keys, and how often each digit occurs; False if all positions are the same."""
    x_low, y_low = scaled[row[start], 0], scaled[row[start], 1]
    x_high, y_high = x_low, y_low
    for k in range(start, stop):
        x, y = scaled[row[k], 0], scaled[row[k], 1]
        x_low, x_high = min(x_low, x), max(x_high, x)
        y_low, y_high = min(y_low, y), max(y_high, y)
    side = max(x_high - x_low, y_high - y_low)
    if side == 0.0:
        return False
    histogram.fill(0)
    per_unit = CELLS / side
    for k in range(start, stop):
        # Rounding is monotonic: positions in different columns or rows of cells are in this order.
        column = min(np.int64((scaled[row[k], 0] - x_low) * per_unit), CELLS - 1)
        line = min(np.int64((scaled[row[k], 1] - y_low) * per_unit), CELLS - 1)
        morton = _spread(column) | (_spread(line) << 1)
        key[k] = (morton << ROW_BITS) | np.int64(row[k])
        for digit in range(3):
            histogram[digit, (morton >> (digit * DIGIT_BITS)) & (DIGITS - 1)] += 1
    return True


@kernel
def _spread(bits: int) -> int:
    """Put a zero before each of 16 bits."""
    bits = (bits | (bits << 8)) & 0x00FF00FF
    bits = (bits | (bits << 4)) & 0x0F0F0F0F
    bits = (bits | (bits << 2)) & 0x33333333
    return (bits | (bits << 1)) & 0x55555555


@kernel
def _sort(key: IntArray, other: IntArray, histogram: IntArray, start: int, stop: int) -> IntArray:
    """Sort keys by their Morton numbers, digit by digit; the array that holds the result."""
    for digit in range(3):
        shift = ROW_BITS + digit * DIGIT_BITS
        place = histogram[digit]
        begin = np.int64(start)
        for d in range(DIGITS):
            begin, place[d] = begin + place[d], begin
        for k in range(start, stop):
            d = (key[k] >> shift) & (DIGITS - 1)
            other[place[d]] = key[k]
            place[d] += 1
        key, other = other, key
    return key


@kernel
def _sort_few(
    scaled: Float64Array, row: Int32Array, cut: Int16Array, start: int, stop: int, number: int
) -> None:
    """Sort a few rows by x, then y, copies by row, and cut them in halves again and again."""
    for k in range(start + 1, stop):
        moved = row[k]
        x, y = scaled[moved, 0], scaled[moved, 1]
        place: Any = k
        while place > start:
            before = row[place - 1]
            if scaled[before, 0] < x or (scaled[before, 0] == x and scaled[before, 1] <= y):
                break
            row[place] = before
            place -= 1
        row[place] = moved
    for k in range(1, stop - start):
        halvings = 0
        while (k >> halvings) & 1 == 0:
            halvings += 1
        cut[start + k] = number + halvings
