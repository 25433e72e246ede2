"""Divide and conquer: triangulations of neighbouring cells, merged along the cut between them.

Why this algorithm (Guibas and Stolfi 1985, with the alternating cuts of Dwyer 1987): it needs no
other tests than `turn` and `incircle`, which are exact, so it is right for every input: nothing
depends on rounded distances, centres or angles, as it does in algorithms that sweep a hull
outwards. It takes O(n log n) time in the worst case, and the cells keep its work in cache.

Edges are directed and come in pairs: ``edge ^ 1`` is the same edge, reversed. Four integers
describe each edge: the next and the previous edge around its origin, counter-clockwise; its
origin; and the half edge that it becomes in the result. A triangulation is known by an edge of its
hull that has the outside on its left or, if it is a single vertex v, by ``~v``.
"""

from typing import Any

import numpy as np

from intervis.arrays import Float64Array, Int16Array, Int32Array, IntArray
from intervis.delaunay.order import BY_SQUARE, DEEPEST, SQUARE, place
from intervis.delaunay.predicates import incircle, turn
from intervis.kernels import kernel

# numba compiles a kernel again for each plain number that it is called with. These are typed.
NEXT, PREVIOUS, ORIGIN, FACE = (np.int64(number) for number in range(4))
"""Places among the four integers of an edge."""

LAST_CUT = 32767
"""A number above those of all cuts."""

UNUSED, USED, OUTSIDE = np.int64(0), np.int64(-1), np.int64(-2)
"""What the fourth integer of an edge says before the triangles are numbered. It is USED for an edge
of the triangulation, OUTSIDE if the outside lies on its left. Edges that are not in use form a
list: NEXT is the distance to the next one, less two. So zeros are a list of all edges in turn."""


@kernel
def part_bounds(cut: Int16Array, most: int) -> IntArray:
    """First vertices of parts that can be triangulated on their own, and the end of the last.

    All cuts made before a certain one separate parts, so that their number is less than 2 `most`.
    """
    made = np.zeros(LAST_CUT + 1, np.int64)
    for k in range(1, len(cut)):
        made[cut[k]] += 1
    first = LAST_CUT
    parts: Any = 1
    while first > 0 and parts < most:
        first -= 1
        parts += made[first]
    bounds = np.empty(parts + 1, np.int64)
    bounds[0], bounds[parts] = 0, len(cut)
    part: Any = 1
    for k in range(1, len(cut)):
        if cut[k] >= first:
            bounds[part] = k
            part += 1
    return bounds


@kernel
def divide(
    links: Int32Array,
    xy: Float64Array,
    leaf: IntArray,
    cut: Int16Array,
    bounds: IntArray,
    hull: IntArray,
    free: IntArray,
    start: int,
    stop: int,
) -> None:
    """Merge the leaves of each of the parts [start, stop).

    A cut is undone when the next one was made before it: then both of its sides are complete.

    Parameters
    ----------
    links : (24 M,) int32 array
        Four integers for each directed edge; see `UNUSED`. M vertices have at most 3 M edges.
    xy : (2 M,) float64 array
        Coordinates of the vertices.
    leaf : (K,) int64 array
        Triangulations in spatial order.
    cut : (K,) int16 array
        The cut between each of them and the one before; see `order.spatial_order`.
    bounds : (P + 1,) int64 array
        Part p holds the leaves from bounds[p] to bounds[p + 1].
    hull : (P,) int64 array
        Receives the triangulation of each part.
    free : (P,) int64 array
        The first edge that each part may use, in a list of its own; receives what is left of it.
    """
    waiting = np.empty(DEEPEST * SQUARE, np.int64)
    cuts = np.empty(DEEPEST * SQUARE, np.int64)
    for part in range(start, stop):
        depth: Any = 0
        unused = free[part]
        for k in range(bounds[part], bounds[part + 1] + 1):
            number = np.int64(cut[k]) if k < bounds[part + 1] else LAST_CUT
            while depth > 1 and cuts[depth - 1] <= number:
                depth -= 1
                waiting[depth - 1], unused = _merge(
                    links, xy, waiting[depth - 1], waiting[depth], cuts[depth], unused
                )
            if k < bounds[part + 1]:
                waiting[depth], cuts[depth] = leaf[k], number
                depth += 1
        hull[part], free[part] = waiting[0], unused


@kernel
def join_unused(links: Int32Array, bounds: IntArray, free: IntArray) -> Any:
    """Join the lists of unused edges of parts that had six edges for each vertex; the first."""
    first: Any = 0
    for part in range(len(free)):
        edge = free[part]
        while edge < 6 * bounds[part + 1]:  # behind its last edge, a part has none left
            following = edge + 2 + get(links, edge, NEXT)
            put(links, edge, NEXT, first - edge - 2)
            edge, first = following, edge
    return first


@kernel
def _side(links: Int32Array, xy: Float64Array, edge: int, vertex: int) -> float:
    """Positive if a vertex lies left of an edge, 0 if on its line."""
    ax, ay = place(xy, get(links, edge, ORIGIN))
    bx, by = place(xy, get(links, edge ^ 1, ORIGIN))
    x, y = place(xy, vertex)
    return turn(ax, ay, bx, by, x, y)


@kernel
def _triangle(links: Int32Array, edge: int, vertex: int, free: int) -> tuple[int, int]:
    """Join a single edge and a vertex on its left; an edge of the hull, and the unused edge."""
    second, free = _new_edge(links, free, get(links, edge ^ 1, ORIGIN), vertex)
    third, free = _new_edge(links, free, vertex, get(links, edge, ORIGIN))
    _close(links, edge, third ^ 1)
    _close(links, second, edge ^ 1)
    _close(links, third, second ^ 1)
    return edge ^ 1, free


@kernel
def _close(links: Int32Array, one: int, other: int) -> None:
    """Make two edges (or one) all that leave their origin."""
    put(links, one, NEXT, other)
    put(links, one, PREVIOUS, other)
    put(links, other, NEXT, one)
    put(links, other, PREVIOUS, one)


@kernel
def _merge(
    links: Int32Array,
    xy: Float64Array,
    first: int,
    second: int,
    number: int,
    free: int,
) -> tuple[int, int]:
    """Merge the triangulations on the two sides of a cut.

    `first` lies left of a cut across x, or below a cut across y; the words left and right are
    meant as for a cut across x.

    Returns
    -------
    The triangulation, and the first edge that is not in use.
    """
    if first < 0 and second < 0:
        edge, free = _new_edge(links, free, ~first, ~second)
        _close(links, edge, edge)
        _close(links, edge ^ 1, edge ^ 1)
        return edge, free
    if first < 0 or second < 0:
        single, edge = (~first, second) if first < 0 else (~second, first)
        if get(links, edge, NEXT) == edge and get(links, edge ^ 1, NEXT) == edge ^ 1:
            side = _side(links, xy, edge, single)
            if side != 0.0:
                return _triangle(links, edge if side > 0.0 else edge ^ 1, single, free)

    across_y = (number & (SQUARE - 1)) >= BY_SQUARE and (number & 1) == 1
    left_edge, right_edge = _lower_tangent(links, xy, first, second, across_y)
    left: Any = _vertex(links, left_edge)
    right: Any = _vertex(links, right_edge)
    lx, ly = place(xy, left)
    rx, ry = place(xy, right)

    # The base runs from the right vertex to the left one. What lies below it is complete.
    base, free = _new_edge(links, free, right, left)
    if right_edge < 0:
        _close(links, base, base)
    else:
        _insert(links, base, right_edge)
    if left_edge < 0:
        _close(links, base ^ 1, base ^ 1)
    else:
        _insert(links, base ^ 1, get(links, left_edge, NEXT))
    while True:
        # The third corner of the next triangle is a neighbour a of the left vertex or b of the
        # right one: the neighbour above the base whose circle with the base holds none of the
        # others. Edges to corners inside the circle are removed. Both sides are written out: a
        # kernel for one of them is not inlined, and the calls cost half as much time again.
        edge = base ^ 1
        a_edge = get(links, edge, NEXT)
        ax, ay = place(xy, get(links, a_edge ^ 1, ORIGIN))
        a_above = turn(lx, ly, rx, ry, ax, ay) > 0.0
        while a_above:
            following = get(links, a_edge, NEXT)
            if following == edge:
                break
            x, y = place(xy, get(links, following ^ 1, ORIGIN))
            if not incircle(lx, ly, rx, ry, ax, ay, x, y):
                break
            free = _remove(links, a_edge, free)
            a_edge, ax, ay = following, x, y
        b_edge = get(links, base, PREVIOUS)
        bx, by = place(xy, get(links, b_edge ^ 1, ORIGIN))
        b_above = turn(lx, ly, rx, ry, bx, by) > 0.0
        while b_above:
            following = get(links, b_edge, PREVIOUS)
            if following == base:
                break
            x, y = place(xy, get(links, following ^ 1, ORIGIN))
            if not incircle(lx, ly, rx, ry, bx, by, x, y):
                break
            free = _remove(links, b_edge, free)
            b_edge, bx, by = following, x, y
        if not a_above and not b_above:
            return base ^ 1, free
        if not a_above or (b_above and incircle(ax, ay, lx, ly, rx, ry, bx, by)):
            right, rx, ry = get(links, b_edge ^ 1, ORIGIN), bx, by
            edge, free = _new_edge(links, free, right, left)
            _insert(links, edge, b_edge ^ 1)
            _insert(links, edge ^ 1, get(links, base ^ 1, NEXT))
        else:
            left, lx, ly = get(links, a_edge ^ 1, ORIGIN), ax, ay
            edge, free = _new_edge(links, free, right, left)
            _insert(links, edge, base)
            _insert(links, edge ^ 1, get(links, a_edge ^ 1, NEXT))
        base = edge


@kernel
def _lower_tangent(
    links: Int32Array, xy: Float64Array, first: int, second: int, across_y: bool
) -> tuple[int, int]:
    """The hull edges at the two vertices that the line below both hulls touches.

    The left one has the outside on its left, the right one on its right. A single vertex stands
    for itself.
    """
    left: Any = _last(links, xy, first, across_y, 1.0)
    right: Any = _last(links, xy, second, across_y, -1.0)
    if right >= 0:
        right = get(links, right, NEXT)
    while True:
        if left >= 0 and _side(links, xy, left, _vertex(links, right)) > 0.0:
            left = get(links, left ^ 1, PREVIOUS)
        elif right >= 0 and _side(links, xy, right, _vertex(links, left)) < 0.0:
            right = get(links, right ^ 1, NEXT)
        else:
            return left, right


@kernel
def _vertex(links: Int32Array, edge: int) -> Any:
    """The origin of an edge, or the single vertex."""
    return get(links, edge, ORIGIN) if edge >= 0 else ~edge


@kernel
def _last(links: Int32Array, xy: Float64Array, edge: int, across_y: bool, sign: float) -> Any:
    """Of a hull, the edge at the last vertex in the order of `_rank`, which has one maximum."""
    if edge < 0:
        return edge
    main, minor = _rank(xy, get(links, edge, ORIGIN), across_y, sign)
    turned = False
    while True:
        # Counter-clockwise along the hull if turned, clockwise before
        other = get(links, edge, NEXT) ^ 1 if turned else get(links, edge ^ 1, PREVIOUS)
        other_main, other_minor = _rank(xy, get(links, other, ORIGIN), across_y, sign)
        if other_main > main or (other_main == main and other_minor > minor):
            edge, main, minor = other, other_main, other_minor
        elif turned:
            return edge
        else:
            turned = True


@kernel
def _rank(xy: Float64Array, vertex: int, across_y: bool, sign: float) -> tuple[float, float]:
    """What orders vertices: x, then y or, for a cut across y, y, then -x; reversed for sign -1."""
    x, y = place(xy, vertex)
    if across_y:
        return sign * y, -sign * x
    return sign * x, sign * y


@kernel
def _new_edge(links: Int32Array, free: int, origin: int, target: int) -> tuple[int, int]:
    """An edge that is not yet around its ends, and the next edge that is not in use."""
    following = free + 2 + get(links, free, NEXT)
    put(links, free, ORIGIN, origin)
    put(links, free, FACE, USED)
    put(links, free ^ 1, ORIGIN, target)
    put(links, free ^ 1, FACE, USED)
    return free, following


@kernel
def _insert(links: Int32Array, edge: int, following: int) -> None:
    """Put an edge before another one, counter-clockwise around their origin."""
    before = get(links, following, PREVIOUS)
    put(links, edge, NEXT, following)
    put(links, edge, PREVIOUS, before)
    put(links, before, NEXT, edge)
    put(links, following, PREVIOUS, edge)


@kernel
def _remove(links: Int32Array, edge: int, free: int) -> int:
    """Take an edge away from both of its ends; the first edge not in use."""
    for side in range(2):
        following = get(links, edge ^ side, NEXT)
        before = get(links, edge ^ side, PREVIOUS)
        put(links, before, NEXT, following)
        put(links, following, PREVIOUS, before)
        put(links, edge ^ side, FACE, UNUSED)
    edge = edge & ~1
    put(links, edge, NEXT, free - edge - 2)
    return edge


@kernel
def get(links: Int32Array, edge: int, which: Any) -> Any:
    """One of the four integers of an edge. An unsigned index needs no test for negative ones."""
    return np.int64(links[np.uint64(4 * edge + which)])


@kernel
def put(links: Int32Array, edge: int, which: Any, value: Any) -> None:
    """Change one of the four integers of an edge."""
    links[np.uint64(4 * edge + which)] = value
