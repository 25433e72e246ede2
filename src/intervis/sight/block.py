"""A block: the marks of a few sight lines, laid out one after another for the engine's passes."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from intervis.arrays import Float64Array, IntArray
from intervis.kernels import kernel
from intervis.sight.atlas import Memory, index_of, to_sensor
from intervis.sight.chart import Int16Array
from intervis.sight.occupancy_model import Model

MOST_MARKS = 2048
"""Longer lines get longer pieces."""
EIGHT = 8
"""Marks of a line are rounded up to a multiple of this."""
BLOCK_MARKS, BLOCK_LINES = 512, 64
"""Lines are taken together until they have so many marks, or are so many: within fast memory."""

# Rows of a block's numbers about its marks. What one scan shows of them: horizontal range, the
# place between two rows of its chart (-1 off the chart), how deep they lie behind its surface (no
# number where it saw none; the nearest scan and the one across have rows of their own). What all
# scans say: summed log-odds, least gap before a seen surface and least depth behind one or
# distance from one that is met (inf with none), the rank of the scan that says the latter. The
# height above the nearest scan's ground; whether something that moved stood there (1), has gone or
# is yet to come (-1); and the share of the line that lies before them.
RHO, SHARE, DEPTH, BY_NEAREST, BY_ACROSS, ODDS, GAP, NEAR, RANK, HEIGHT, MOVED, PART = range(12)
# The same rows, once the odds are known: the exponent's parts by what was seen there, marks that
# no scan saw, those of them that lie behind a surface, clearance of open space.
SEEN, OPEN, HIDDEN, UNSEEN, SHADOW, CLEAR = ODDS, RHO, SHARE, DEPTH, BY_ACROSS, BY_NEAREST
# Rows of places in tables, which no sum is made of: narrow, so that a block stays in the fastest
# memory. The lower of two cells of the scan's chart, an entry of the table of odds, an entry of
# the ground or of another table; and the values of the two cells.
CELL, ENTRY, PLACE = range(3)
LOW, HIGH = range(2)
# Columns of a block's numbers about its lines: share of the line at its first mark and from one
# mark to the next, a piece's length; in the frame of the sensor whose scan has the word, the
# line's first end and the way to the second one, each from its column on for three; the direction
# from the nearest scan to the one across, how much of that way lies before the line's end, and
# the rank of the one across (0: there is none).
FIRST, STEP, PIECE, START, ALONG, WAY, ACROSS = 0, 1, 2, 3, 6, 9, 12
Int32Array = NDArray[np.int32]


class Block(NamedTuple):
    """The working memory of one thread: a few lines that are judged together.

    `marks` (12, W), `places` (3, W), `values` (2, W) and `lines` (B, 13): see the names of their
    rows and columns above. `span` (B, 3): each line's first mark, the mark after its last one, and
    the same rounded up; `chosen` (B, K): the scans with a say, nearest first; `runs` (B, 3): first
    mark and the one after the last of those that ask the same scan, and that scan. `away` (S,) and
    `rank` (K,): how far scans are; `charts` (S, 18): the index of the atlas.
    """

    marks: Float64Array
    places: Int32Array
    values: Int16Array
    lines: Float64Array
    span: IntArray
    chosen: IntArray
    runs: IntArray
    away: Float64Array
    rank: Float64Array
    charts: Float64Array


@kernel
def new_block(memory: Memory, model: Model) -> Block:
    """Working memory for lines through a memory under a model."""
    scans = min(len(memory.offset), model.weights.shape[1])
    # rows that start a multiple of 4096 bytes apart would drive each other out of fast memory
    width = BLOCK_MARKS + MOST_MARKS + 3 * EIGHT
    return Block(
        np.empty((12, width)),
        np.empty((3, width), np.int32),
        np.empty((2, width), np.int16),
        np.empty((BLOCK_LINES, ACROSS + 1)),
        np.empty((BLOCK_LINES, 3), np.int64),
        np.zeros((BLOCK_LINES, scans), np.int64),
        np.empty((BLOCK_LINES, 3), np.int64),
        np.empty(len(memory.offset)),
        np.empty(scans),
        index_of(memory),
    )


@kernel
def in_eights(begin: int, end: int) -> int:
    """How many marks lie in between, where that is a multiple of eight.

    A compiler that sees as much, here by the shifts, keeps nothing at hand for a rest.
    """
    return (end - begin) >> 3 << 3


@kernel
def lay_out(
    first: Float64Array,
    second: Float64Array,
    begin: int,
    mark_m: float,
    end_m: float,
    lines: Float64Array,
    span: IntArray,
) -> int:
    """Lay out the marks of the lines from `begin` on; how many lines find room."""
    at = 0
    count = 0
    while count < min(BLOCK_LINES, len(first) - begin) and at < BLOCK_MARKS:
        a, b = first[begin + count], second[begin + count]
        length = np.sqrt((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2 + (b[2] - a[2]) ** 2)
        pieces = int(min(max(np.ceil(length / mark_m), 1.0), float(MOST_MARKS)))
        piece = length / pieces
        # Marks up to end_m from the ends: the first kept one is the first beyond it.
        skipped = (pieces + 1) // 2
        if length > 2.0 * end_m:
            skipped = min(int(np.floor(end_m / piece + 0.5)), skipped)
        marks = max(pieces - 2 * skipped, 0)
        lines[count, FIRST], lines[count, STEP] = skipped + 0.5, 1.0 / pieces
        lines[count, PIECE] = piece
        span[count, 0], span[count, 1] = at, at + marks
        at += (marks + EIGHT - 1) // EIGHT * EIGHT
        span[count, 2] = at
        count += 1
    return count


@kernel
def turn_to_scan(n: int, first: Float64Array, second: Float64Array, block: Block) -> int:
    """Give the n-th scan of each line the word; how many runs of marks ask the same scan."""
    lines, span, runs = block.lines, block.span, block.runs
    count = 0
    for i in range(len(first)):
        k, line = block.chosen[i, n], lines[i]
        chart = block.charts[k]
        to_sensor(chart, first[i], second[i], line[START : START + 3], line[ALONG : ALONG + 3])
        if count == 0 or runs[count - 1, 2] != k:
            runs[count, 0], runs[count, 2] = span[i, 0], k
            count += 1
        runs[count - 1, 1] = span[i, 2]
    return count
