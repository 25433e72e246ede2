"""Divide and conquer: triangulations of neighbouring cells, merged along the cut between them.

Why this algorithm (Guibas and Stolfi 1985, with the alternating cuts of Dwyer 1987): it needs no
other tests than `turn` and `incircle`, which are exact, so it is right for every input: nothing
depends on rounded distances, centres or angles, as it does in algorithms that sweep a hull
outwards. It takes O(n log n) time in the worst case, and the cells keep its work in cache.

Edges are directed and come in pairs: ``edge ^ 1`` is the same edge, reversed. Four integers
describe each edge: the next and the previous edge around its origin, counter-clockwise; its
origin; and one that the result uses. A triangulation is known by an edge of its hull that has the
outside on its left or, if it is a single vertex v, by ``~v``.
"""

from typing import Any

import numpy as np

from intervis.arrays import Float64Array, Int16Array, Int32Array
from intervis.delaunay.order import BY_SQUARE, SQUARE
from intervis.delaunay.predicates import incircle, turn
from intervis.kernels import kernel

NEXT, PREVIOUS, ORIGIN, FACE = 0, 1, 2, 3
"""Places among the four integers of an edge."""

LAST_CUT = 32767
"""A number above those of all cuts."""

NONE = -1
"""No edge; as origin: the edge is not in use."""


@kernel
def divide(
    links: Int32Array, xy: Float64Array, cut: Int16Array, start: int, stop: int
) -> tuple[int, int, int]:
    """Triangulate the vertices [start, stop).

    Parameters
    ----------
    links : (24 M,) int32 array
        Four integers for each directed edge. Vertices have at most three edges each: those of
        these vertices are written from edge 6 start on.
    xy : (2 M,) float64 array
    cut : (M,) int16 array
        See `order.spatial_order`.

    Returns
    -------
    The triangulation, the first unused edge, and the edge behind the last.
    """
    waiting = np.empty(stop - start + 1, np.int64)
    cuts = np.empty(stop - start + 1, np.int64)
    depth: Any = 0
    unused: Any = NONE
    top: Any = 6 * start
    for v in range(start, stop + 1):
        number = np.int64(cut[v]) if v < stop else LAST_CUT
        while depth > 1 and cuts[depth - 1] <= number:
            depth -= 1
            waiting[depth - 1], unused, top = merge(
                links, xy, waiting[depth - 1], waiting[depth], cuts[depth], unused, top
            )
        if v < stop:
            waiting[depth], cuts[depth] = ~v, number
            depth += 1
    return waiting[0], unused, top


@kernel
def merge(
    links: Int32Array,
    xy: Float64Array,
    first: int,
    second: int,
    number: int,
    unused: int,
    top: int,
) -> tuple[int, int, int]:
    """Merge the triangulations on the two sides of a cut.

    `first` lies left of a cut across x, or below a cut across y; the words left and right are
    meant as for a cut across x. New edges come from the list of unused edges or, if it is empty,
    from `top` on.

    Returns
    -------
    The triangulation, the first unused edge, and the edge behind the last.
    """
    across_y = (number & (SQUARE - 1)) >= BY_SQUARE and (number & 1) == 1
    left, right = _lower_tangent(links, xy, first, second, across_y)
    l: Any = ~left if left < 0 else np.int64(links[4 * left + ORIGIN])
    r: Any = ~right if right < 0 else np.int64(links[4 * right + ORIGIN])
    lx, ly, rx, ry = xy[2 * l], xy[2 * l + 1], xy[2 * r], xy[2 * r + 1]

    # The base runs from the right vertex r to the left vertex l; what lies below it is done.
    base, unused, top = _new_edge(links, unused, top, r, l)
    if right < 0:
        links[4 * base + NEXT] = links[4 * base + PREVIOUS] = base
    else:
        _insert(links, base, right)
    if left < 0:
        links[4 * (base ^ 1) + NEXT] = links[4 * (base ^ 1) + PREVIOUS] = base ^ 1
    else:
        _insert(links, base ^ 1, np.int64(links[4 * left + NEXT]))

    while True:
        # The neighbour of l that forms the next triangle, if the other side has no better one.
        a_edge = np.int64(links[4 * (base ^ 1) + NEXT])
        a = np.int64(links[4 * (a_edge ^ 1) + ORIGIN])
        ax, ay = xy[2 * a], xy[2 * a + 1]
        a_above = turn(lx, ly, rx, ry, ax, ay) > 0.0
        if a_above:
            while True:
                edge = np.int64(links[4 * a_edge + NEXT])
                if edge == base ^ 1:
                    break
                c = np.int64(links[4 * (edge ^ 1) + ORIGIN])
                cx, cy = xy[2 * c], xy[2 * c + 1]
                if not incircle(lx, ly, rx, ry, ax, ay, cx, cy):
                    break
                unused = _remove(links, a_edge, unused)
                a_edge, a, ax, ay = edge, c, cx, cy
        b_edge = np.int64(links[4 * base + PREVIOUS])
        b = np.int64(links[4 * (b_edge ^ 1) + ORIGIN])
        bx, by = xy[2 * b], xy[2 * b + 1]
        b_above = turn(lx, ly, rx, ry, bx, by) > 0.0
        if b_above:
            while True:
                edge = np.int64(links[4 * b_edge + PREVIOUS])
                if edge == base:
                    break
                c = np.int64(links[4 * (edge ^ 1) + ORIGIN])
                cx, cy = xy[2 * c], xy[2 * c + 1]
                if not incircle(lx, ly, rx, ry, bx, by, cx, cy):
                    break
                unused = _remove(links, b_edge, unused)
                b_edge, b, bx, by = edge, c, cx, cy
        if not a_above and not b_above:
            return base ^ 1, unused, top
        if not a_above or (b_above and incircle(ax, ay, lx, ly, rx, ry, bx, by)):
            edge, unused, top = _new_edge(links, unused, top, b, l)
            _insert(links, edge, b_edge ^ 1)
            _insert(links, edge ^ 1, np.int64(links[4 * (base ^ 1) + NEXT]))
            r, rx, ry = b, bx, by
        else:
            edge, unused, top = _new_edge(links, unused, top, r, a)
            _insert(links, edge, base)
            _insert(links, edge ^ 1, np.int64(links[4 * (a_edge ^ 1) + NEXT]))
            l, lx, ly = a, ax, ay
        base = edge


@kernel
def _lower_tangent(
    links: Int32Array, xy: Float64Array, first: int, second: int, across_y: bool
) -> tuple[int, int]:
    """The hull edges at the two vertices that the line below both hulls touches.

    The left one has the outside on its left, the right one on its right. A single vertex stands
    for itself.
    """
    left: Any = _extreme(links, xy, first, across_y, 1.0)
    right: Any = _extreme(links, xy, second, across_y, -1.0)
    if left < 0:
        l: Any = ~left
        l_next: Any = l
    else:
        l, l_next = np.int64(links[4 * left + ORIGIN]), np.int64(links[4 * (left ^ 1) + ORIGIN])
    if right < 0:
        r: Any = ~right
        r_next: Any = r
    else:
        right = np.int64(links[4 * right + NEXT])
        r, r_next = np.int64(links[4 * right + ORIGIN]), np.int64(links[4 * (right ^ 1) + ORIGIN])
    lx, ly, rx, ry = xy[2 * l], xy[2 * l + 1], xy[2 * r], xy[2 * r + 1]
    while True:
        if left >= 0 and turn(lx, ly, xy[2 * l_next], xy[2 * l_next + 1], rx, ry) > 0.0:
            left = np.int64(links[4 * (left ^ 1) + PREVIOUS])
            l, l_next = l_next, np.int64(links[4 * (left ^ 1) + ORIGIN])
            lx, ly = xy[2 * l], xy[2 * l + 1]
        elif right >= 0 and turn(rx, ry, xy[2 * r_next], xy[2 * r_next + 1], lx, ly) < 0.0:
            right = np.int64(links[4 * (right ^ 1) + NEXT])
            r, r_next = r_next, np.int64(links[4 * (right ^ 1) + ORIGIN])
            rx, ry = xy[2 * r], xy[2 * r + 1]
        else:
            return left, right


@kernel
def _extreme(
    links: Int32Array, xy: Float64Array, edge: int, across_y: bool, sign: float
) -> Any:
    """Of a hull, the edge at the last vertex by x, then y, or by y, then -x; the first for -1."""
    if edge < 0:
        return edge
    vertex = np.int64(links[4 * edge + ORIGIN])
    main = xy[2 * vertex + across_y]
    minor = xy[2 * vertex + 1 - across_y]
    minor_sign = -sign if across_y else sign
    turned = False
    while True:
        if turned:  # counter-clockwise along the hull
            other = np.int64(links[4 * edge + NEXT]) ^ 1
        else:
            other = np.int64(links[4 * (edge ^ 1) + PREVIOUS])
        vertex = np.int64(links[4 * other + ORIGIN])
        ahead = sign * (xy[2 * vertex + across_y] - main)
        if ahead > 0.0 or (
            ahead == 0.0 and minor_sign * (xy[2 * vertex + 1 - across_y] - minor) > 0.0
        ):
            edge = other
            main, minor = xy[2 * vertex + across_y], xy[2 * vertex + 1 - across_y]
        elif turned:
            return edge
        else:
            turned = True


@kernel
def _new_edge(
    links: Int32Array, unused: int, top: int, origin: int, target: int
) -> tuple[int, int, int]:
    """An edge that is in use but not yet around its ends, the first unused edge, and the top."""
    if unused == NONE:
        edge = top
        top += 2
    else:
        edge = unused
        unused = np.int64(links[4 * edge + NEXT])
    links[4 * edge + ORIGIN] = origin
    links[4 * (edge ^ 1) + ORIGIN] = target
    return edge, unused, top


@kernel
def _insert(links: Int32Array, edge: int, following: int) -> None:
    """Put an edge before another one, counter-clockwise around their origin."""
    before = np.int64(links[4 * following + PREVIOUS])
    links[4 * edge + NEXT] = following
    links[4 * edge + PREVIOUS] = before
    links[4 * before + NEXT] = edge
    links[4 * following + PREVIOUS] = edge


@kernel
def _remove(links: Int32Array, edge: int, unused: int) -> int:
    """Take an edge away from both ends; the first unused edge."""
    for side in range(2):
        following = np.int64(links[4 * (edge ^ side) + NEXT])
        before = np.int64(links[4 * (edge ^ side) + PREVIOUS])
        links[4 * before + NEXT] = following
        links[4 * following + PREVIOUS] = before
        links[4 * (edge ^ side) + ORIGIN] = NONE
    edge &= ~1
    links[4 * edge + NEXT] = unused
    return edge
