"""Delaunay triangulation: from positions to half edges."""

from dataclasses import dataclass

import numpy as np

from intervis.arrays import Float64Array, Int32Array, IntArray
from intervis.delaunay.divide import divide, join_unused, part_bounds
from intervis.delaunay.half_edges import mark_outside, write_areas, write_edges, write_half_edges
from intervis.delaunay.order import spatial_order
from intervis.errors import PointsError
from intervis.kernels import in_parts

PARTS = 16
"""Parts that are triangulated on their own, at least. The result does not depend on threads."""

WORTH_PARTS = 8192
"""Fewer vertices are one part."""


@dataclass(frozen=True, eq=False)
class Triangulation:
    """Triangles as half edges: half edge 3 k + i runs from corner i of triangle k to the next one.

    V positions, M of them distinct, h of those on the convex hull, also between its corners. There
    are F = 2 M - 2 - h triangles and F + M - 1 edges; none of the triangles is without area. If all
    positions are collinear, F is 0.

    Attributes
    ----------
    triangles : (F, 3) int32 array
        Rows of the positions, counter-clockwise.
    opposite : (3 F,) int32 array
        The half edge that runs the other way between the same positions; -1 on the hull.
    vertex : (V,) int32 array
        The lowest row with the same position, which stands for it in `triangles`.
    """

    triangles: Int32Array
    opposite: Int32Array
    vertex: Int32Array

    def edges(self) -> IntArray:
        """(E, 2) the sides of the triangles, each once, smaller row first, sorted.

        Examples
        --------
        >>> triangulate(np.array([[0.0, 0], [1, 0], [0, 1], [1, 1]])).edges().tolist()
        [[0, 1], [0, 2], [1, 2], [1, 3], [2, 3]]
        """
        return self.edges_and_sides()[0]

    def edges_and_sides(self) -> tuple[IntArray, Int32Array]:
        """The edges, and (F, 3) the row in them of each side of each triangle.

        Side i of a triangle runs from its corner i to the next one.

        Examples
        --------
        >>> found = triangulate(np.array([[0.0, 0], [1, 0], [0, 1], [1, 1]]))
        >>> found.triangles.tolist(), found.edges_and_sides()[1].tolist()
        ([[2, 0, 1], [1, 3, 2]], [[1, 0, 2], [3, 4, 2]])
        """
        outside = int(np.count_nonzero(self.opposite < 0))
        edges = np.empty(((len(self.opposite) + outside) // 2, 2), np.int64)
        sides = np.empty(self.triangles.shape, np.int32)
        start, count = self.triangles.ravel(), len(self.vertex)
        write_edges(start, self.opposite, count, edges, sides.reshape(-1))
        return edges, sides

    def areas(self, positions: Float64Array) -> Float64Array:
        """(F,) area of each triangle, positive also where rounding would make it 0 or less.

        Parameters
        ----------
        positions : (V, 2) float64 array
            The positions that were triangulated.
        """
        area = np.empty(len(self.triangles))
        write_areas(np.ascontiguousarray(positions, np.float64), self.triangles, area)
        return area


def triangulate(positions: Float64Array) -> Triangulation:
    """The Delaunay triangulation of positions in the plane, without rounding errors.

    No position lies inside the circle around a triangle: exactly, for any positions whose
    coordinates differ by less than 108 orders of magnitude (smaller ones count as 0). Of four
    positions on one circle, the last in the order of x, then y, lies outside, so the triangles
    depend neither on the order of the rows nor on the number of threads.

    Parameters
    ----------
    positions : (V, 2) float64 array

    Raises
    ------
    PointsError
        A coordinate is not finite.

    Examples
    --------
    >>> square = np.array([[0.0, 0], [1, 0], [0, 1], [1, 1]])
    >>> found = triangulate(square)
    >>> found.triangles.tolist(), found.opposite.tolist()
    ([[2, 0, 1], [1, 3, 2]], [-1, -1, 5, -1, -1, 2])
    """
    count = len(positions)
    xy, cut = np.empty(2 * count), np.empty(count, np.int16)
    row, vertex = np.empty(count, np.int32), np.empty(count, np.int32)
    distinct = spatial_order(np.ascontiguousarray(positions, np.float64), xy, row, cut, vertex)
    if distinct < 0:
        raise PointsError("positions to triangulate must be finite; leave other rows out.")
    if distinct < 3:
        return Triangulation(np.empty((0, 3), np.int32), np.empty(0, np.int32), vertex)

    links = np.zeros(24 * distinct, np.int32)
    cut = cut[:distinct]
    bounds = part_bounds(cut, PARTS if distinct >= WORTH_PARTS else 1)
    hulls, free = np.empty(len(bounds) - 1, np.int64), 6 * bounds[:-1]
    leaves = ~np.arange(distinct)

    def work(start: int, stop: int) -> None:
        divide(links, xy, leaves, cut, bounds, hulls, free, start, stop)

    in_parts(work, len(hulls), least=1)
    hull, rest = np.empty(1, np.int64), np.array([join_unused(links, bounds, free)])
    divide(links, xy, hulls, cut[bounds[:-1]], np.array([0, len(hulls)]), hull, rest, 0, 1)
    faces = 2 * distinct - 2 - mark_outside(links, hull[0])
    start, opposite = np.empty(3 * faces, np.int32), np.empty(3 * faces, np.int32)
    write_half_edges(links, row, start, opposite)
    return Triangulation(start.reshape(-1, 3), opposite, vertex)
