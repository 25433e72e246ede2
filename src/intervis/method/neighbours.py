"""Nearest neighbours of every point of a set, block by block.

The points are divided again and again at the median of their widest coordinate, until blocks of
`BLOCK` points are left. The points of a block look for their neighbours together: they pass over
all blocks whose bounding box is farther than the worst neighbour that any of them has so far.

Ties are decreed: of several points at one distance, copies included, the lowest row is nearer.
"""

from typing import Any

import numpy as np

from intervis.arrays import Float64Array, IntArray
from intervis.errors import PointsError
from intervis.kernels import in_parts, kernel
from intervis.method.ranks import room_for, split

BLOCK = 16
"""Points of a block."""

DEEPEST = 64
"""More than the levels of the tree of blocks: each level halves the number of blocks."""

WORTH_A_THREAD = 128
"""Blocks that are worth a thread."""


def nearest_neighbours(points: Float64Array, count: int) -> IntArray:
    """(V, K) rows of the nearest other points of each point, the nearest first.

    Parameters
    ----------
    points : (V, 3) float64 array
        Finite coordinates.
    count : int
        Neighbours wanted; K is V - 1 where there are not so many.

    Raises
    ------
    PointsError
        A coordinate is not finite.

    Examples
    --------
    >>> nearest_neighbours(np.array([[0.0, 0, 0], [1, 0, 0], [1, 0, 0], [9, 0, 0]]), 2)
    array([[1, 2],
           [2, 0],
           [1, 0],
           [1, 2]])
    """
    if not np.isfinite(points).all():
        raise PointsError("points must be finite: leave the other rows out.")
    rows = len(points)
    count = max(0, min(count, rows - 1))
    found = np.empty((rows, count), np.int64)
    if count == 0:
        return found
    points = np.ascontiguousarray(points, np.float64)
    order = np.arange(rows)
    blocks = (rows + BLOCK - 1) // BLOCK
    boxes = np.empty((2 << (blocks - 1).bit_length(), 6))
    _divide(points, order, boxes)
    columns = np.ascontiguousarray(points[order].T)

    def work(start: int, stop: int) -> None:
        _search(columns, order, boxes, start, stop, found)

    in_parts(work, blocks, least=WORTH_A_THREAD)
    return found


@kernel
def _divide(points: Float64Array, order: IntArray, boxes: Float64Array) -> None:
    """Sort `order` into blocks, and write the bounding boxes of the tree's nodes.

    Node n has the children 2 n and 2 n + 1; the root is 1. A box is three least and three greatest
    coordinates.
    """
    rows = len(order)
    value, room = np.empty(rows), room_for(rows)
    # Node, its first block, and its number of blocks; an explicit stack instead of recursion.
    stack = np.empty((DEEPEST, 3), np.int64)
    stack[0, 0], stack[0, 1], stack[0, 2] = 1, 0, (rows + BLOCK - 1) // BLOCK
    depth: Any = 1
    while depth > 0:
        depth -= 1
        node, first, blocks = stack[depth, 0], stack[depth, 1], stack[depth, 2]
        own = order[first * BLOCK : min((first + blocks) * BLOCK, rows)]
        widest, extent = 0, -1.0
        for axis in range(3):
            least, greatest = np.inf, -np.inf
            for k in range(len(own)):
                least = min(least, points[own[k], axis])
                greatest = max(greatest, points[own[k], axis])
            boxes[node, axis], boxes[node, 3 + axis] = least, greatest
            if greatest - least > extent:
                widest, extent = axis, greatest - least
        if blocks == 1:
            continue
        near = blocks // 2
        for k in range(len(own)):
            value[k] = points[own[k], widest]
        low, high = boxes[node, widest], boxes[node, 3 + widest]
        split(own, value[: len(own)], low, high, near * BLOCK, room)
        stack[depth, 0], stack[depth, 1], stack[depth, 2] = 2 * node, first, near
        depth += 1
        stack[depth, 0], stack[depth, 1] = 2 * node + 1, first + near
        stack[depth, 2] = blocks - near
        depth += 1


@kernel
def _search(
    columns: Float64Array,
    order: IntArray,
    boxes: Float64Array,
    first_block: int,
    last_block: int,
    found: IntArray,
) -> None:
    """Write the neighbours of the points of some blocks.

    Parameters
    ----------
    columns : (3, V) float64 array
        Coordinates in the order of the blocks.
    order : (V,) int64 array
        Row of each.
    boxes : (nodes, 6) float64 array
        See `_divide`.
    first_block, last_block : int
        The blocks, the last one not included.
    found : (V, K) int64 array
    """
    rows, count = found.shape
    blocks = (rows + BLOCK - 1) // BLOCK
    square, row = np.empty((BLOCK, count)), np.empty((BLOCK, count), np.int64)
    scratch = np.empty(BLOCK)
    own = np.empty(6)
    stack = np.empty((DEEPEST, 3), np.int64)
    for block in range(first_block, last_block):
        start, stop = block * BLOCK, min((block + 1) * BLOCK, rows)
        for axis in range(3):
            own[axis], own[3 + axis] = np.inf, -np.inf
            for k in range(start, stop):
                own[axis] = min(own[axis], columns[axis, k])
                own[3 + axis] = max(own[3 + axis], columns[axis, k])
        square[:], row[:] = np.inf, rows
        _compare(columns, order, start, stop, start, stop, own, scratch, square, row)
        worst = _worst(square, stop - start)
        stack[0, 0], stack[0, 1], stack[0, 2] = 1, 0, blocks
        depth: Any = 1
        while depth > 0:
            depth -= 1
            node, first, size = stack[depth, 0], stack[depth, 1], stack[depth, 2]
            if _between(own, boxes[node]) > worst:
                continue
            if size == 1:
                if first != block:
                    begin, end = first * BLOCK, min((first + 1) * BLOCK, rows)
                    _compare(
                        columns, order, start, stop, begin, end, boxes[node], scratch, square, row
                    )
                    worst = _worst(square, stop - start)
                continue
            near = size // 2
            left_first = _between(own, boxes[2 * node]) <= _between(own, boxes[2 * node + 1])
            for turn in range(2):  # what is pushed last is looked at first
                stack[depth, 0] = 2 * node
                stack[depth, 1], stack[depth, 2] = first, near
                if left_first == (turn == 0):
                    stack[depth, 0] = 2 * node + 1
                    stack[depth, 1], stack[depth, 2] = first + near, size - near
                depth += 1
        for k in range(start, stop):
            for n in range(count):
                found[order[k], n] = row[k - start, n]


@kernel
def _compare(
    columns: Float64Array,
    order: IntArray,
    start: int,
    stop: int,
    begin: int,
    end: int,
    box: Float64Array,
    scratch: Float64Array,
    square: Float64Array,
    row: IntArray,
) -> None:
    """Enter the points [begin, end), which lie in a box, as neighbours of [start, stop)."""
    last = square.shape[1] - 1
    # Of slices the compiler knows that no index is negative.
    other_x, other_y, other_z = columns[0, begin:end], columns[1, begin:end], columns[2, begin:end]
    for i in range(start, stop):
        x, y, z = columns[0, i], columns[1, i], columns[2, i]
        outside_x = max(box[0] - x, x - box[3], 0.0)
        outside_y = max(box[1] - y, y - box[4], 0.0)
        outside_z = max(box[2] - z, z - box[5], 0.0)
        near, rows_of_it = square[i - start], row[i - start]
        if outside_x**2 + outside_y**2 + outside_z**2 > near[last]:
            continue
        for k in range(len(other_x)):
            dx, dy, dz = other_x[k] - x, other_y[k] - y, other_z[k] - z
            scratch[k] = dx * dx + dy * dy + dz * dz
        for j in range(begin, end):
            distance = scratch[j - begin]
            if distance > near[last] or j == i:
                continue
            candidate = order[j]
            if distance == near[last] and candidate > rows_of_it[last]:
                continue
            place = last
            while place > 0 and (
                near[place - 1] > distance
                or (near[place - 1] == distance and rows_of_it[place - 1] > candidate)
            ):
                near[place], rows_of_it[place] = near[place - 1], rows_of_it[place - 1]
                place -= 1
            near[place], rows_of_it[place] = distance, candidate


@kernel
def _worst(square: Float64Array, points: int) -> Any:
    """The largest square of the distance to a last neighbour."""
    worst: Any = 0.0
    for k in range(points):
        worst = max(worst, square[k, -1])
    return worst


@kernel
def _between(a: Float64Array, b: Float64Array) -> Any:
    """Square of the distance between two boxes."""
    total: Any = 0.0
    for axis in range(3):
        gap = max(a[axis] - b[3 + axis], b[axis] - a[3 + axis], 0.0)
        total += gap * gap
    return total
