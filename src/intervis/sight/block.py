"""A block: the marks of a few sight lines, laid out one after another for the engine's passes."""

from typing import NamedTuple

import numpy as np

from intervis.arrays import Float64Array, IntArray
from intervis.kernels import kernel
from intervis.sight.atlas import Memory, choose_scans, to_sensor
from intervis.sight.evidence import Model
from intervis.sight.moved import scan_across

MOST_MARKS = 2048
"""Longer lines get longer pieces."""
EIGHT = 8
"""Marks of a line are rounded up to a multiple of this."""
BLOCK_MARKS, BLOCK_LINES = 512, 64
"""Lines are taken together until they have so many marks, or are so many: within fast memory."""

# Rows of a block's numbers about its marks. What one scan shows of them: horizontal range, the
# lower of two cells of its chart, its value and the upper one's, the place between the two (-1
# off the chart), an entry of the table of odds. What all scans say: summed log-odds, least gap
# before a seen surface and least depth behind one or distance from one that is met (inf with
# none), the scan that says the latter. Above the nearest scan's ground: the height, and an entry
# of the ground or of a table. How deep they lie behind the surfaces of the nearest scan and of the
# one across; and whether something that moved stood there (1), has gone or is yet to come (-1).
RHO, CELL, LOW, HIGH, SHARE, ENTRY, ODDS, GAP, NEAR, SCAN, HEIGHT, PLACE = range(12)
BY_NEAREST, BY_ACROSS, MOVED = 12, 13, 14
# The same rows, once the odds are known: the exponent's parts by what was seen there, marks that
# no scan saw, those of them that lie behind a surface, clearance of open space.
SEEN, OPEN, HIDDEN, UNSEEN, SHADOW, CLEAR = ODDS, RHO, SHARE, LOW, CELL, HIGH
# Columns of a block's numbers about its lines: share of the line at its first mark and from one
# mark to the next, a piece's length; in the frame of the sensor whose scan has the word, the
# line's first end and the way to the second one, each from its column on for three; that scan
# and its chart; the direction from the nearest scan to the one across, how much of that way lies
# before the line's end, and the rank of the one across (0: there is none).
FIRST, STEP, PIECE, START, ALONG = 0, 1, 2, 3, 6
THE_SCAN, UNIT_M, OFFSET, COLUMNS, ROWS, SLOPE_FROM, ROWS_PER_SLOPE = range(9, 16)
WAY, ACROSS = 16, 19


class Block(NamedTuple):
    """The working memory of one thread: a few lines that are judged together.

    `marks` (15, W) and `lines` (B, 20): see the names of their rows and columns above. `span`
    (B, 3): each line's first mark, the mark after its last one, and the same rounded up;
    `chosen` (B, K): the scans with a say, nearest first.
    """

    marks: Float64Array
    lines: Float64Array
    span: IntArray
    chosen: IntArray


@kernel
def new_block(memory: Memory, model: Model) -> Block:
    """Working memory for lines through a memory under a model."""
    scans = min(len(memory.offset), model.weights.shape[1])
    # rows that start a multiple of 4096 bytes apart would drive each other out of fast memory
    width = BLOCK_MARKS + MOST_MARKS + 3 * EIGHT
    return Block(
        np.empty((15, width)),
        np.empty((BLOCK_LINES, 20)),
        np.empty((BLOCK_LINES, 3), np.int64),
        np.empty((BLOCK_LINES, scans), np.int64),
    )


@kernel
def lay_out(
    memory: Memory,
    first: Float64Array,
    second: Float64Array,
    begin: int,
    model: Model,
    block: Block,
) -> int:
    """Lay out the marks of the lines from `begin` on; how many lines find room."""
    chosen = block.chosen
    rank = np.empty(chosen.shape[1])
    at = 0
    count = 0
    while count < min(BLOCK_LINES, len(first) - begin) and at < BLOCK_MARKS:
        a, b = first[begin + count], second[begin + count]
        length = np.sqrt((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2 + (b[2] - a[2]) ** 2)
        pieces = int(min(max(np.ceil(length / model.mark_m), 1.0), float(MOST_MARKS)))
        piece = length / pieces
        # Marks up to end_m from the ends: the first kept one is the first beyond it.
        skipped = (pieces + 1) // 2
        if length > 2.0 * model.end_m:
            skipped = min(int(np.floor(model.end_m / piece + 0.5)), skipped)
        marks = max(pieces - 2 * skipped, 0)
        line, span = block.lines[count], block.span[count]
        line[FIRST], line[STEP], line[PIECE] = skipped + 0.5, 1.0 / pieces, piece
        span[0], span[1], span[2] = at, at + marks, at + (marks + EIGHT - 1) // EIGHT * EIGHT
        chosen[count, 0], line[ACROSS] = 0, 0.0
        if len(memory.position) > 1:
            choose_scans(memory, a, b, chosen[count], rank)
            line[ACROSS] = scan_across(memory, a, b, chosen[count], line[WAY : WAY + 3])
        at = span[2]
        count += 1
    return count


@kernel
def turn_to_scan(
    memory: Memory,
    n: int,
    first: Float64Array,
    second: Float64Array,
    begin: int,
    count: int,
    block: Block,
) -> None:
    """Give the n-th scan of each line the word."""
    for i in range(count):
        k, line = block.chosen[i, n], block.lines[i]
        g, a, b = memory.sensor_from_scene[k], first[begin + i], second[begin + i]
        to_sensor(g, a, b, line[START : START + 3], line[ALONG : ALONG + 3])
        line[THE_SCAN], line[UNIT_M], line[OFFSET] = k, memory.unit_m[k], memory.offset[k]
        line[COLUMNS], line[ROWS] = memory.columns[k], memory.rows[k]
        line[SLOPE_FROM], line[ROWS_PER_SLOPE] = memory.slope_from[k], memory.rows_per_slope[k]
