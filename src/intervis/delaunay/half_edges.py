"""From edges around vertices to half edges of triangles, edges and areas, in the caller's rows."""

from typing import Any

import numpy as np

from intervis.arrays import Float64Array, Int32Array, IntArray
from intervis.delaunay.divide import FACE, ORIGIN, OUTSIDE, PREVIOUS, USED, get, put
from intervis.delaunay.predicates import turn
from intervis.kernels import kernel


@kernel
def mark_outside(links: Int32Array, hull: int) -> Any:
    """Mark the edges that have the outside on their left; how many there are.

    Parameters
    ----------
    links : (4 E,) int32 array
        See `divide`.
    hull : int
        One of these edges.
    """
    outside: Any = 0
    edge = hull
    while outside == 0 or edge != hull:
        put(links, edge, FACE, OUTSIDE)
        outside += 1
        edge = get(links, edge ^ 1, PREVIOUS)
    return outside


@kernel
def write_half_edges(
    links: Int32Array, row: Int32Array, start: Int32Array, opposite: Int32Array
) -> None:
    """Number the triangles in the order of their first edges, and write their half edges.

    Parameters
    ----------
    links : (4 E,) int32 array
        With the outside marked.
    row : (M,) int32 array
        The caller's row of each vertex.
    start, opposite : (3 F,) int32 arrays
        Receive the row at which each half edge starts, and the half edge on the other side of the
        same edge, -1 on the hull.
    """
    half: Any = 0
    for edge in range(len(links) // 4):
        if get(links, edge, FACE) != USED:
            continue
        side = edge
        for _ in range(3):
            put(links, side, FACE, half + 1)  # 0 is for edges that are not in use
            start[half] = row[get(links, side, ORIGIN)]
            twin = get(links, side ^ 1, FACE) - 1
            if twin >= 0:
                opposite[half], opposite[twin] = twin, half
            else:
                opposite[half] = -1
            half += 1
            side = get(links, side ^ 1, PREVIOUS)


@kernel
def write_edges(
    start: Int32Array, opposite: Int32Array, nodes: int, edges: IntArray, side: Int32Array
) -> None:
    """Write each edge once, smaller row first, sorted; and the edge of each half edge.

    Parameters
    ----------
    start, opposite : (3 F,) int32 arrays
        Half edges.
    nodes : int
        Rows are smaller than this.
    edges : (E, 2) int64 array
    side : (3 F,) int32 array
    """
    # Counting sorts by the larger row, then by the smaller one, which keeps the order of the first.
    count = len(edges)
    lower, upper = np.empty(count + 1, np.int32), np.empty(count + 1, np.int32)
    of_half = np.empty(count + 1, np.int32)
    of_lower, of_upper = np.zeros(nodes + 1, np.int32), np.zeros(nodes + 1, np.int32)
    found: Any = 0
    for half in range(0, len(start), 3):
        for side_of_three in range(3):
            a, b = start[half + side_of_three], start[half + (side_of_three + 1) % 3]
            # Not if the twin comes later. Always written, since half of all tests would be guessed
            # wrong; what is not wanted is written over.
            wanted = np.int64(opposite[half + side_of_three] < half + side_of_three)
            lower[found], upper[found] = min(a, b), max(a, b)
            of_half[found] = half + side_of_three
            of_lower[min(a, b) + 1] += wanted
            of_upper[max(a, b) + 1] += wanted
            found += wanted
    for k in range(nodes):
        of_lower[k + 1] += of_lower[k]
        of_upper[k + 1] += of_upper[k]
    by_upper = np.empty((count, 3), np.int32)
    for k in range(count):
        to = of_upper[upper[k]]
        of_upper[upper[k]] += 1
        by_upper[to, 0], by_upper[to, 1], by_upper[to, 2] = lower[k], upper[k], of_half[k]
    for k in range(count):
        to = of_lower[by_upper[k, 0]]
        of_lower[by_upper[k, 0]] += 1
        edges[to, 0], edges[to, 1] = by_upper[k, 0], by_upper[k, 1]
        here = by_upper[k, 2]
        side[here] = to
        if opposite[here] >= 0:
            side[opposite[here]] = to


@kernel
def write_areas(positions: Float64Array, triangles: Int32Array, area: Float64Array) -> None:
    """Write the areas of triangles that turn left.

    Parameters
    ----------
    positions : (V, 2) float64 array
    triangles : (F, 3) int32 array
    area : (F,) float64 array
    """
    for k in range(len(triangles)):
        a, b, c = triangles[k, 0], triangles[k, 1], triangles[k, 2]
        double = turn(
            positions[a, 0],
            positions[a, 1],
            positions[b, 0],
            positions[b, 1],
            positions[c, 0],
            positions[c, 1],
        )
        area[k] = 0.5 * double
