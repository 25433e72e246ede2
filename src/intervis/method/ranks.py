"""Rows divided at a rank of their values: the rows of the smallest values first."""

from typing import NamedTuple

import numpy as np

from intervis.arrays import Float64Array, Int32Array, IntArray
from intervis.kernels import kernel

BINS = 256
"""Bins of the histogram in which the rank is looked up."""


class Room(NamedTuple):
    """What `split` needs room for, made once for many calls: see `room_for`."""

    bin_of: Int32Array
    counts: IntArray
    middle: IntArray
    middle_value: Float64Array
    far: IntArray


@kernel
def room_for(rows: int) -> Room:
    """Room to split up to so many rows."""
    return Room(
        np.empty(rows, np.int32),
        np.empty(BINS, np.int64),
        np.empty(rows, np.int64),
        np.empty(rows),
        np.empty(rows, np.int64),
    )


@kernel
def split(
    rows: IntArray, value: Float64Array, low: float, high: float, target: int, room: Room
) -> None:
    """Put the `target` rows of the smallest values first.

    A histogram tells in which bin of values the cut lies; only the few rows in that bin are
    compared with each other. The others are moved without a branch, of which half would be guessed
    wrong.

    Parameters
    ----------
    rows : (n,) int64 array
        Changed in place. Which of several equal values come first is not decreed.
    value : (n,) float64 array
        Value of each row; not moved.
    low, high : float
        Between them the histogram has its bins. The result does not depend on them; the time does.
    target : int
        Less than n.
    room : Room
        For n rows or more.
    """
    bins = min(BINS, len(rows))
    bin_of, counts = room.bin_of[: len(rows)], room.counts[:bins]
    _number(value, low, bins / (high - low) if high > low else 0.0, bins - 1.0, bin_of)
    counts[:] = 0
    for number in bin_of:
        counts[np.uint32(number)] += 1
    cut, below = 0, 0
    while below + counts[cut] <= target:
        below += counts[cut]
        cut += 1

    # What does not belong somewhere is written there too, and written over. Unsigned places need no
    # test for negative ones.
    near, inside, far = np.uint64(0), np.uint64(0), np.uint64(0)
    for k in range(len(rows)):
        number, row = bin_of[k], rows[k]
        rows[near] = room.middle[inside] = room.far[far] = row
        room.middle_value[inside] = value[k]
        near += np.uint64(number < cut)
        inside += np.uint64(number == cut)
        far += np.uint64(number > cut)
    select(room.middle[:inside], room.middle_value[:inside], target - below)
    _copy(room.middle, rows[near : near + inside])
    _copy(room.far, rows[near + inside :])


@kernel
def _number(
    value: Float64Array, low: float, per_unit: float, last: float, bin_of: Int32Array
) -> None:
    """Write the bin of each value; the first and the last bin hold what lies outside as well."""
    for k in range(len(value)):
        place = (value[k] - low) * per_unit
        place = place if place < last else last
        bin_of[k] = np.int32(place if place > 0.0 else 0.0)


@kernel
def _copy(source: IntArray, to: IntArray) -> None:
    for k in range(len(to)):
        to[k] = source[k]


@kernel
def select(rows: IntArray, value: Float64Array, target: int) -> None:
    """Quickselect: sort the smallest values, and their rows, before position `target`."""
    low = 0
    high = len(rows) - 1
    while low < high:
        # The pivot is the median of three, so that sorted and reversed input cost linear time.
        middle = (low + high) // 2
        a, b, c = value[low], value[middle], value[high]
        pivot = max(min(a, b), min(max(a, b), c))
        i = low
        j = high
        while i <= j:
            while value[i] < pivot:
                i += 1
            while value[j] > pivot:
                j -= 1
            if i <= j:
                value[i], value[j] = value[j], value[i]
                rows[i], rows[j] = rows[j], rows[i]
                i += 1
                j -= 1
        if target <= j:
            high = j
        elif target >= i:
            low = i
        else:
            return
