"""A triangulated sheet over the ground that sight lines are followed over, edge by edge."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import Delaunay, QhullError

from intervis.arrays import Float64Array, IntArray
from intervis.kernels import in_parts, kernel
from intervis.method.mesh import Mesh, build_mesh, signed_area, unique_edges


@dataclass(frozen=True, eq=False)
class Sheet:
    """A mesh that lines can be followed over, from each triangle to the next across its edges.

    Attributes
    ----------
    mesh : Mesh
    beyond : (F, 3) int64 array
        The triangle across the edge opposite to each corner, or -1 at the hull.
    corners, first : (3 F,) and (V + 1,) int64 arrays
        Corners 3 f + k where node i sits: corners[first[i]:first[i + 1]].
    place : (V,) int64 array
        The node itself, or the node of the mesh that a copy of its position coincides with.
    """

    mesh: Mesh
    beyond: IntArray
    corners: IntArray
    first: IntArray
    place: IntArray


def build_sheet(chart: Float64Array) -> Sheet:
    """Triangulate chart positions; positions on one line give a chain without triangles."""
    nodes = len(chart)
    extent = float(np.ptp(chart, axis=0).max())
    try:
        if nodes < 3 or extent == 0:
            raise QhullError
        found = Delaunay((chart - chart.mean(axis=0)) / extent)
    except QhullError:
        nothing = np.empty(0, np.int64)
        first = np.zeros(nodes + 1, np.int64)
        return Sheet(build_mesh(chart), nothing.reshape(0, 3), nothing, first, np.arange(nodes))
    triangles = found.simplices.astype(np.int64)
    area = np.abs(signed_area(chart, triangles))
    corners = np.argsort(triangles.ravel(), kind="stable")
    place = np.arange(nodes)
    copies = found.coplanar.astype(np.int64)
    place[copies[:, 0]] = copies[:, 2]
    return Sheet(
        mesh=Mesh(triangles, area, unique_edges(triangles, nodes)),
        beyond=found.neighbors.astype(np.int64),
        corners=corners,
        first=np.searchsorted(triangles.ravel()[corners], np.arange(nodes + 1)),
        place=place,
    )


def obstacles_on_sheet(
    offset: Float64Array, sheet: Sheet, gap_m: float
) -> tuple[IntArray, IntArray]:
    """(V,) crossings above each sight line, and crossings in all."""
    obstacles = np.zeros(len(offset), np.int64)
    crossings = np.zeros(len(offset), np.int64)

    def work(start: int, stop: int) -> None:
        _walk(
            offset,
            sheet.mesh.triangles,
            sheet.beyond,
            sheet.corners,
            sheet.first,
            sheet.place,
            gap_m,
            start,
            stop,
            obstacles,
            crossings,
        )

    in_parts(work, len(offset), least=256)
    return obstacles, crossings


@kernel
def _walk(
    offset: Float64Array,
    triangles: IntArray,
    beyond: IntArray,
    corners: IntArray,
    first: IntArray,
    place: IntArray,
    gap_m: float,
    start: int,
    stop: int,
    obstacles: IntArray,
    crossings: IntArray,
) -> None:
    """Follow the lines from the targets [start, stop) to P0, the origin, from edge to edge.

    Each edge on the way has one end to the right of the line (or on it) and one to the left, and
    each triangle has two such edges or none, so a walk never comes back to a triangle.
    """
    for i in range(start, stop):
        x, y, z = offset[i]
        reach = np.hypot(x, y)
        triangle, opposite = _entered(offset, triangles, corners, first, place[i])
        while triangle >= 0:
            right = triangles[triangle, (opposite + 1) % 3]
            left = triangles[triangle, (opposite + 2) % 3]
            if _side(offset, place[i], right) > 0.0:
                right, left = left, right
            share_home, height = _crossing(offset, place[i], right, left)
            if share_home <= 0.0:
                break  # beyond P0
            if (1.0 - share_home) * reach > gap_m:
                crossings[i] += 1
                if height > share_home * z:
                    obstacles[i] += 1
            triangle = beyond[triangle, opposite]
            if triangle < 0:
                break  # the surface ends here
            third = 0
            while triangles[triangle, third] == right or triangles[triangle, third] == left:
                third += 1
            leaves = left if _side(offset, place[i], triangles[triangle, third]) > 0.0 else right
            opposite = 0
            while triangles[triangle, opposite] != leaves:
                opposite += 1


@kernel
def _entered(
    offset: Float64Array, triangles: IntArray, corners: IntArray, first: IntArray, i: int
) -> tuple[int, int]:
    """The triangle of node i's star that the line to P0 enters, and i's corner in it, or -1."""
    if offset[i, 0] != 0.0 or offset[i, 1] != 0.0:
        for c in range(first[i], first[i + 1]):
            triangle, k = corners[c] // 3, corners[c] % 3
            a = triangles[triangle, (k + 1) % 3]
            b = triangles[triangle, (k + 2) % 3]
            if (_side(offset, i, a) > 0.0) != (_side(offset, i, b) > 0.0):
                share_home, _ = _crossing(offset, i, a, b)
                if share_home < 1.0:
                    return triangle, k
    return -1, -1


@kernel
def _crossing(offset: Float64Array, i: int, a: int, b: int) -> tuple[float, float]:
    """Where the line from node i to P0 crosses the edge from a to b, which straddles it.

    Returns the share of the way that is still ahead (1 at node i, 0 at P0), and the elevation
    interpolated on the edge.
    """
    side_a = _side(offset, i, a)
    along = side_a / (side_a - _side(offset, i, b))
    x = offset[a, 0] + along * (offset[b, 0] - offset[a, 0])
    y = offset[a, 1] + along * (offset[b, 1] - offset[a, 1])
    height = offset[a, 2] + along * (offset[b, 2] - offset[a, 2])
    square = offset[i, 0] * offset[i, 0] + offset[i, 1] * offset[i, 1]
    return (x * offset[i, 0] + y * offset[i, 1]) / square, height


@kernel
def _side(offset: Float64Array, i: int, j: int) -> np.float64:
    """Positive where j lies to the left of the line from node i to P0."""
    to_x, to_y = offset[j, 0] - offset[i, 0], offset[j, 1] - offset[i, 1]
    return np.float64(offset[i, 1] * to_x - offset[i, 0] * to_y)
