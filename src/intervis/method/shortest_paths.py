"""Shortest paths from P0 through points: Dijkstra's algorithm, with a heap of its own.

P0 is the origin. The points that can follow a point on a path are given as the columns of its row:
``columns[starts[i]:starts[i + 1]]``; each pair is given in both directions.
"""

from typing import Any

import numpy as np

from intervis.arrays import BoolArray, Float64Array, Int32Array, IntArray
from intervis.kernels import kernel

CHILDREN = 4
"""Of an entry of the heap: fewer levels than with two, and the children lie side by side."""


@kernel
def shortest_paths(
    position: Float64Array,
    starts: IntArray,
    columns: Int32Array,
    roots: IntArray,
    join_islands: bool,
) -> tuple[Float64Array, IntArray]:
    """The length of the shortest path from P0 to each point, and the point before it.

    Parameters
    ----------
    position : (V, 3) float64 array
        Relative to P0. A path is as long as its straight parts.
    starts, columns : (V + 1,) int64 and (M,) int32 arrays
        The points that follow each point.
    roots : (R,) int64 array
        Points that P0 reaches directly.
    join_islands : bool
        Whether P0 also reaches the nearest point of a group that no path leads to.

    Returns
    -------
    distance : (V,) float64 array
        Infinite where no path leads.
    before : (V,) int64 array
        -1 where P0 or nothing comes before. Of several paths of one length, the point with the
        least distance comes before, then the one with the smallest number.
    """
    points = position.shape[0]
    distance, before = np.full(points, np.inf), np.full(points, -1, np.int64)
    # A point is entered again when a shorter path is found; the older entry is passed over then.
    key, point = np.empty(len(columns) + points), np.empty(len(columns) + points, np.int64)
    size: Any = np.int64(0)
    for root in roots:
        distance[root] = _between(position, root, 0.0, 0.0, 0.0)
        size = _push(key, point, size, distance[root], root)
    # What no path has led to when that heap is empty for the first time waits in another one.
    island_key, island = np.empty(points), np.empty(points, np.int64)
    islands: Any = np.int64(-1 if join_islands else 0)
    i: Any
    j: Any
    while True:
        if size > 0:
            first_key, i = key[0], point[0]
            size = _pop(key, point, size)
            if first_key > distance[i]:
                continue
        else:
            if islands < 0:
                islands = _enter_islands(position, distance, island_key, island)
            if islands == 0:
                return distance, before
            direct, i = island_key[0], island[0]
            islands = _pop(island_key, island, islands)
            if distance[i] < np.inf:
                continue
            distance[i] = direct
        x, y, z = position[i]
        for k in range(starts[i], starts[i + 1]):
            j = np.int64(columns[k])
            through_i = distance[i] + _between(position, j, x, y, z)
            if through_i < distance[j]:
                distance[j] = through_i
                before[j] = i
                size = _push(key, point, size, distance[j], j)


@kernel
def _enter_islands(
    position: Float64Array, distance: Float64Array, key: Float64Array, point: IntArray
) -> Any:
    """Enter all points that no path has led to into a heap; its size."""
    size: Any = np.int64(0)
    for i in range(len(distance)):
        if distance[i] == np.inf:
            size = _push(key, point, size, _between(position, i, 0.0, 0.0, 0.0), i)
    return size


@kernel
def neighbour_rows(neighbours: IntArray) -> tuple[IntArray, Int32Array]:
    """The neighbour relation in both directions: offset of each row, and columns.

    The columns of a row are its own neighbours, then the rows whose neighbour it is.
    """
    rows, width = neighbours.shape
    starts = np.zeros(rows + 1, np.int64)
    for i in range(rows):
        starts[i + 1] += width
        for k in range(width):
            starts[neighbours[i, k] + 1] += 1
    for i in range(rows):
        starts[i + 1] += starts[i]
    columns, free = np.empty(starts[rows], np.int32), starts[:-1] + width
    for i in range(rows):
        for k in range(width):
            j = neighbours[i, k]
            columns[starts[i] + k] = j
            columns[free[j]] = i
            free[j] += 1
    return starts, columns


@kernel
def edge_rows(edges: IntArray, chosen: BoolArray, points: int) -> tuple[IntArray, Int32Array]:
    """The chosen edges in both directions: offset of each row, and columns."""
    starts = np.zeros(points + 1, np.int64)
    for k in range(len(edges)):
        starts[edges[k, 0] + 1] += chosen[k]
        starts[edges[k, 1] + 1] += chosen[k]
    for i in range(points):
        starts[i + 1] += starts[i]
    columns, free = np.empty(starts[points], np.int32), starts[:-1].copy()
    for k in range(len(edges)):
        if chosen[k]:
            i, j = edges[k]
            columns[free[i]], columns[free[j]] = j, i
            free[i] += 1
            free[j] += 1
    return starts, columns


@kernel
def _between(position: Float64Array, i: int, x: float, y: float, z: float) -> float:
    """Distance of a point from a place."""
    return float(
        np.sqrt((x - position[i, 0]) ** 2 + (y - position[i, 1]) ** 2 + (z - position[i, 2]) ** 2)
    )


@kernel
def _earlier(key: float, point: int, other_key: float, other: int) -> bool:
    return key < other_key or (key == other_key and point < other)


@kernel
def _push(key: Float64Array, point: IntArray, size: int, new_key: float, new_point: int) -> Any:
    """Enter a point into a heap of a size; the new size."""
    place: Any = size
    while place > 0:
        parent = (place - 1) // CHILDREN
        if not _earlier(new_key, new_point, key[parent], point[parent]):
            break
        key[place], point[place] = key[parent], point[parent]
        place = parent
    key[place], point[place] = new_key, new_point
    return size + 1


@kernel
def _pop(key: Float64Array, point: IntArray, size: int) -> Any:
    """Take the first entry out of a heap of a size; the new size."""
    size -= 1
    last_key, last_point = key[size], point[size]
    place: Any = 0
    child: Any = 1
    while child < size:
        for other in range(child + 1, min(child + CHILDREN, size)):
            if _earlier(key[other], point[other], key[child], point[child]):
                child = other
        if not _earlier(key[child], point[child], last_key, last_point):
            break
        key[place], point[place] = key[child], point[child]
        place, child = child, CHILDREN * child + 1
    key[place], point[place] = last_key, last_point
    return size
