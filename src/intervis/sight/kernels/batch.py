"""A batch: the samples of a few sight lines, laid out for passes over contiguous rows."""

from typing import NamedTuple

import numpy as np

from intervis.arrays import Float64Array, Int16Array, Int32Array, IntArray
from intervis.kernels import kernel
from intervis.sight.kernels.packed_scans import PackedScans, descriptors_of, to_sensor_frame
from intervis.sight.kernels.parameters import OccupancyModel

MAX_SAMPLES = 2048
"""Samples of a line at most; longer lines get longer steps."""
LANES = 8
"""The number of samples of a line is rounded up to a multiple of this."""
BATCH_SAMPLES, BATCH_LINES = 512, 64
"""A batch is closed at so many samples or lines: its rows then stay in the level-1 cache."""

# Rows of `Batch.samples`. Of the scan at hand: planar range, fractional position between
# two rows of its range image (-1: outside the image), depth behind its surface (NaN: unobserved);
# the nearest scan and the bracketing scan keep their depths in rows of their own. Over all scans:
# sum of log-odds; smallest distance in front of an observed surface, and smallest absolute depth at
# or behind one (inf: none), with the rank of the scan it comes from. Height above the nearest
# scan's ground; dynamic state (1 occupied, -1 left or not yet reached, 0 static); position along
# the line from 0 to 1.
RANGE, FRACTION, DEPTH, BY_NEAREST, BY_BRACKETING, LOG_ODDS = range(6)
GAP, NEAR, RANK, HEIGHT, DYNAMIC, POSITION = range(6, 12)
# The same rows after classification: occupancy of samples at surfaces, in free and in unobserved
# space; flags of unobserved samples and of those behind a surface; clearance in free space.
SURFACE, FREE, UNOBSERVED = LOG_ODDS, RANGE, FRACTION
IS_UNOBSERVED, IN_OCCLUDED_SPACE, CLEARANCE = DEPTH, BY_BRACKETING, BY_NEAREST
# Rows of `Batch.places` (indices into tables): the lower of two pixels of the range image, an entry
# of the depth table, an entry of the ground map or another table. Rows of `Batch.values`: the two
# pixels' values.
PIXEL, ENTRY, PLACE = range(3)
LOW, HIGH = range(2)
# Columns of `Batch.lines`: position of the first sample and increment per sample (0 to 1 along the
# line), length of a step in metres; start and vector of the line in the frame of the scan at hand
# (three columns each); unit vector (x, y) from the nearest scan to the bracketing one and the
# fraction of that way or time that had passed (three columns); rank of the bracketing scan, and
# whether it lies on the other side of a query time.
FIRST, INCREMENT, STEP_M, START, ALONG, DIRECTION, BRACKETING, BRACKETED = 0, 1, 2, 3, 6, 9, 12, 13


class Batch(NamedTuple):
    """Working memory of one thread.

    `samples` (12, W), `places` (3, W), `values` (2, W) and `lines` (B, 14): see the row and column
    names above. `offsets` (B, 3): a line's first sample, one past its last, and the latter padded
    to `LANES`. `chosen` (B, K): the contributing scans, nearest first. `runs` (B, 3): first sample,
    one past the last, and scan, of consecutive samples that read the same scan. `distance` (S,) and
    `chosen_distance` (K,): scratch of `choose_scans`. `descriptors` (S, 28): see `packed_scans`.
    """

    samples: Float64Array
    places: Int32Array
    values: Int16Array
    lines: Float64Array
    offsets: IntArray
    chosen: IntArray
    runs: IntArray
    distance: Float64Array
    chosen_distance: Float64Array
    descriptors: Float64Array


@kernel
def new_batch(scans: PackedScans, model: OccupancyModel) -> Batch:
    """Working memory for lines through these scans."""
    count = min(len(scans.offset), model.tables.scan_weights.shape[1])
    # A width that is a multiple of 4096 bytes would map all rows to the same cache sets.
    width = BATCH_SAMPLES + MAX_SAMPLES + 3 * LANES
    return Batch(
        np.empty((12, width)),
        np.empty((3, width), np.int32),
        np.empty((2, width), np.int16),
        np.zeros((BATCH_LINES, BRACKETED + 1)),
        np.empty((BATCH_LINES, 3), np.int64),
        np.zeros((BATCH_LINES, count), np.int64),
        np.empty((BATCH_LINES, 3), np.int64),
        np.empty(len(scans.offset)),
        np.empty(count),
        descriptors_of(scans),
    )


@kernel
def padded_count(begin: int, end: int) -> int:
    """Number of samples between two padded offsets.

    The shifts tell the compiler that it is a multiple of `LANES`, so that it emits no scalar
    remainder loop.
    """
    return (end - begin) >> 3 << 3


@kernel
def lay_out(
    first: Float64Array,
    second: Float64Array,
    begin: int,
    step_m: float,
    end_margin_m: float,
    lines: Float64Array,
    offsets: IntArray,
) -> int:
    """Lay out the samples of the lines from `begin` on; return how many lines fit."""
    at = 0
    count = 0
    while count < min(BATCH_LINES, len(first) - begin) and at < BATCH_SAMPLES:
        a, b = first[begin + count], second[begin + count]
        length = np.sqrt((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2 + (b[2] - a[2]) ** 2)
        steps = int(min(max(np.ceil(length / step_m), 1.0), float(MAX_SAMPLES)))
        step = length / steps
        # Samples within the end margin are left out at both ends.
        skipped = (steps + 1) // 2
        if length > 2.0 * end_margin_m:
            skipped = min(int(np.floor(end_margin_m / step + 0.5)), skipped)
        samples = max(steps - 2 * skipped, 0)
        lines[count, FIRST], lines[count, INCREMENT] = skipped + 0.5, 1.0 / steps
        lines[count, STEP_M] = step
        offsets[count, 0], offsets[count, 1] = at, at + samples
        at += (samples + LANES - 1) // LANES * LANES
        offsets[count, 2] = at
        count += 1
    return count


@kernel
def select_scan(n: int, first: Float64Array, second: Float64Array, batch: Batch) -> int:
    """Transform each line to the frame of its n-th scan; return the number of `runs`."""
    lines, offsets, runs = batch.lines, batch.offsets, batch.runs
    count = 0
    for i in range(len(first)):
        k, line = batch.chosen[i, n], lines[i]
        descriptor = batch.descriptors[k]
        to_sensor_frame(
            descriptor, first[i], second[i], line[START : START + 3], line[ALONG : ALONG + 3]
        )
        if count == 0 or runs[count - 1, 2] != k:
            runs[count, 0], runs[count, 2] = offsets[i, 0], k
            count += 1
        runs[count - 1, 1] = offsets[i, 2]
    return count
