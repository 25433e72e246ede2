"""What a Delaunay triangulation must be, in rational numbers: nothing here is ever rounded."""

from collections import Counter
from fractions import Fraction
from itertools import combinations

import numpy as np

Point = tuple[Fraction, Fraction]


def exact(positions) -> list[Point]:
    return [(Fraction(float(x)), Fraction(float(y))) for x, y in positions]


def turn(a: Point, b: Point, c: Point) -> Fraction:
    """Twice the area of a triangle, positive if it turns left."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def incircle(a: Point, b: Point, c: Point, d: Point) -> Fraction:
    """Positive if d lies inside the circle through a, b, c, which turn left."""
    rows = [(p[0] - d[0], p[1] - d[1]) for p in (a, b, c)]
    (ax, ay), (bx, by), (cx, cy) = rows
    al, bl, cl = (x * x + y * y for x, y in rows)
    return al * (bx * cy - by * cx) + bl * (cx * ay - cy * ax) + cl * (ax * by - ay * bx)


def inside(a: Point, b: Point, c: Point, d: Point) -> bool:
    """Whether d lies inside; of four on one circle, the last by x, then y, lies outside.

    That is the sign of the lifted volume after the last one's square is raised a little.
    """
    det = incircle(a, b, c, d)
    if det != 0:
        return det > 0
    last = max(a, b, c, d)
    if d == last:
        return False
    others = {a: (d, b, c), b: (a, d, c), c: (a, b, d)}[last]
    return turn(*others) > 0


def hull(points: list[Point]) -> list[Point]:
    """Corners of the convex hull, counter-clockwise (Andrew's monotone chain)."""
    chains = []
    for ordered in (sorted(set(points)), sorted(set(points), reverse=True)):
        chain: list[Point] = []
        for point in ordered:
            while len(chain) > 1 and turn(chain[-2], chain[-1], point) <= 0:
                chain.pop()
            chain.append(point)
        chains.append(chain[:-1])
    return chains[0] + chains[1]


def double_area(polygon: list[Point]) -> Fraction:
    return sum(
        (
            a[0] * b[1] - a[1] * b[0]
            for a, b in zip(polygon, polygon[1:] + polygon[:1], strict=True)
        ),
        Fraction(0),
    )


def on_hull(points: list[Point]) -> int:
    """How many distinct positions lie on the convex hull, also between its corners."""
    corners = hull(points)
    sides = list(zip(corners, corners[1:] + corners[:1], strict=True))
    return sum(
        any(turn(a, b, p) == 0 and min(a, b) <= p <= max(a, b) for a, b in sides)
        for p in set(points)
    )


def check(positions, triangles, opposite, vertex) -> None:
    """All that makes a triangulation the Delaunay triangulation of its positions."""
    points = exact(positions)
    first: dict[Point, int] = {}
    for row, point in enumerate(points):
        first.setdefault(point, row)
    assert vertex.tolist() == [first[point] for point in points]

    # complete: N = 2 n - 2 - h, all positions used, the area of the hull exactly
    corners = [tuple(points[row] for row in triangle) for triangle in triangles.tolist()]
    flat = all(turn(*three) == 0 for three in combinations(hull(points), 3)) or len(first) < 3
    if flat:
        assert not corners
        return
    assert len(corners) == 2 * len(first) - 2 - on_hull(points)
    assert {row for triangle in triangles.tolist() for row in triangle} == set(first.values())
    areas = [turn(*three) for three in corners]
    assert all(area > 0 for area in areas)
    assert sum(areas) == double_area(hull(points))

    # half edges: each directed edge once, its opposite runs the other way
    start = triangles.ravel().tolist()
    stop = [start[e + 1 if e % 3 < 2 else e - 2] for e in range(len(start))]
    assert max(Counter(zip(start, stop, strict=True)).values()) == 1
    there = {(a, b): e for e, (a, b) in enumerate(zip(start, stop, strict=True))}
    assert opposite.tolist() == [there.get((b, a), -1) for a, b in zip(start, stop, strict=True)]

    # the empty circle at each inner edge, ties as decreed: then it is empty of all positions
    for e, twin in enumerate(opposite.tolist()):
        if twin > e:
            across = stop[twin + 1 if twin % 3 < 2 else twin - 2]
            assert not inside(*corners[e // 3], points[across])


def all_triangles(positions) -> set[tuple[int, ...]]:
    """The triangles by definition: three positions that turn left, and no other one inside."""
    points = exact(positions)
    rows = sorted({points.index(point) for point in points})
    found = set()
    for three in combinations(rows, 3):
        a, b, c = (points[row] for row in three)
        area = turn(a, b, c)
        if area == 0:
            continue
        b, c = (b, c) if area > 0 else (c, b)
        if not any(inside(a, b, c, points[row]) for row in rows if row not in three):
            found.add(three)
    return found


def last_bits(values: np.ndarray) -> np.ndarray:
    """Distance to the next doubles; of values near 0 that of 1e-40: smaller ones may count as 0."""
    return np.spacing(np.maximum(np.abs(values), 1e-40))
