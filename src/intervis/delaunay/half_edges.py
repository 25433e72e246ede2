"""From edges around vertices to the half edges of triangles, in the rows of the caller."""

from typing import Any

import numpy as np

from intervis.arrays import Int32Array
from intervis.delaunay.divide import FACE, NEXT, NONE, ORIGIN, PREVIOUS
from intervis.kernels import kernel


@kernel
def mark_outside(links: Int32Array, hull: int) -> Any:
    """Mark the sides of edges that lie outside, and leave all others unmarked; how many do.

    Parameters
    ----------
    links : (4 E,) int32 array
        See `divide`.
    hull : int
        An edge with the outside on its left.
    """
    for edge in range(len(links) // 4):
        links[4 * edge + FACE] = NONE
    outside: Any = 0
    edge = hull
    while outside == 0 or edge != hull:
        links[4 * edge + FACE] = OUTSIDE
        outside += 1
        edge = np.int64(links[4 * (edge ^ 1) + PREVIOUS])
    return outside


OUTSIDE = -2


@kernel
def write_half_edges(
    links: Int32Array, row: Int32Array, start: Int32Array, opposite: Int32Array
) -> Any:
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
        if links[4 * edge + ORIGIN] == NONE or links[4 * edge + FACE] != NONE:
            continue
        side = edge
        for _ in range(3):
            links[4 * side + FACE] = half
            start[half] = row[links[4 * side + ORIGIN]]
            twin = links[4 * (side ^ 1) + FACE]
            if twin >= 0:
                opposite[half] = twin
                opposite[twin] = half
            else:
                opposite[half] = -1
            half += 1
            side = np.int64(links[4 * (side ^ 1) + PREVIOUS])
    return half
