"""TIN walk: sight lines followed over a triangulated irregular network, from edge to edge."""

from dataclasses import dataclass

import numpy as np

from intervis.arrays import Float64Array, IntArray
from intervis.delaunay import triangulate
from intervis.kernels import in_parts, kernel
from intervis.method.line_buffer import LINES_PER_PART
from intervis.method.mesh import Mesh, chain_mesh


@dataclass(frozen=True, eq=False)
class Tin:
    """A mesh with the adjacency that a walk along a line needs. V nodes, F triangles.

    Attributes
    ----------
    mesh : Mesh
    neighbours : (F, 3) int64 array
        The triangle across the edge opposite to each corner; -1 where that edge is on the hull.
    star_corners, star_offsets : (3 F,) and (V + 1,) int64 arrays
        Corner 3 f + k is the k-th corner of triangle f. The corners at node i are
        ``star_corners[star_offsets[i]:star_offsets[i + 1]]``.
    vertex : (V,) int64 array
        The vertex of the mesh at each node's position: the node itself or, for a copy of a
        position, the lowest node there.
    """

    mesh: Mesh
    neighbours: IntArray
    star_corners: IntArray
    star_offsets: IntArray
    vertex: IntArray


def build_tin(ground: Float64Array) -> Tin:
    """Triangulate positions over the ground plane; collinear positions give no triangle.

    Parameters
    ----------
    ground : (V, 2) float64 array
        Metres.
    """
    found = triangulate(ground)
    triangles = found.triangles.astype(np.int64)
    mesh = chain_mesh(ground)
    if len(triangles):
        mesh = Mesh(triangles, found.areas(ground), *found.edges_and_sides())
    node = triangles.ravel()
    corners = np.argsort(node, kind="stable")
    offsets = np.searchsorted(node[corners], np.arange(len(ground) + 1))
    # Half edge 3 f + k starts at corner k: the edge opposite to corner k starts at corner k + 1.
    opposite = np.roll(found.opposite.reshape(-1, 3), -1, axis=1)
    return Tin(
        mesh=mesh,
        neighbours=opposite.astype(np.int64) // 3,
        star_corners=corners,
        star_offsets=offsets,
        vertex=found.vertex.astype(np.int64),
    )


def obstacles_on_tin(
    offset: Float64Array, tin: Tin, target_margin_m: float
) -> tuple[IntArray, IntArray]:
    """(V,) edges crossed above the sight line from P0 to each node, and edges crossed in all.

    Parameters
    ----------
    offset : (V, 3) float64 array
        Nodes of the TIN relative to P0, z up, metres.
    tin : Tin
    target_margin_m : float
        Crossings nearer to the target than this, over the ground, are not compared.
    """
    obstacles = np.zeros(len(offset), np.int64)
    crossings = np.zeros(len(offset), np.int64)

    def work(start: int, stop: int) -> None:
        _walk(
            offset,
            tin.mesh.triangles,
            tin.neighbours,
            tin.star_corners,
            tin.star_offsets,
            tin.vertex,
            target_margin_m,
            start,
            stop,
            obstacles,
            crossings,
        )

    in_parts(work, len(offset), least=LINES_PER_PART)
    return obstacles, crossings


@kernel
def _walk(
    offset: Float64Array,
    triangles: IntArray,
    neighbours: IntArray,
    star_corners: IntArray,
    star_offsets: IntArray,
    vertex: IntArray,
    target_margin_m: float,
    start: int,
    stop: int,
    obstacles: IntArray,
    crossings: IntArray,
) -> None:
    """Follow the lines from the targets [start, stop) to P0, the origin, from edge to edge.

    Each crossed edge has one end right of the line (or on it) and one end left of it. A triangle
    has two such edges or none, so a walk never enters a triangle twice.
    """
    for i in range(start, stop):
        x, y, z = offset[i]
        reach = np.hypot(x, y)
        triangle, opposite = _first_triangle(
            offset, triangles, star_corners, star_offsets, vertex[i]
        )
        while triangle >= 0:
            right = triangles[triangle, (opposite + 1) % 3]
            left = triangles[triangle, (opposite + 2) % 3]
            if _side(offset, vertex[i], right) > 0.0:
                right, left = left, right
            fraction, height = _crossing(offset, vertex[i], right, left)
            if fraction <= 0.0:
                break  # behind P0
            if (1.0 - fraction) * reach > target_margin_m:
                crossings[i] += 1
                if height > fraction * z:
                    obstacles[i] += 1
            triangle = neighbours[triangle, opposite]
            if triangle < 0:
                break  # outside the hull
            third = 0
            while triangles[triangle, third] == right or triangles[triangle, third] == left:
                third += 1
            # The next edge joins the third corner and the end on its other side.
            leaves = left if _side(offset, vertex[i], triangles[triangle, third]) > 0.0 else right
            opposite = 0
            while triangles[triangle, opposite] != leaves:
                opposite += 1


@kernel
def _first_triangle(
    offset: Float64Array,
    triangles: IntArray,
    star_corners: IntArray,
    star_offsets: IntArray,
    i: int,
) -> tuple[int, int]:
    """The triangle of node i's star that the line to P0 enters, and i's corner in it, or -1."""
    if offset[i, 0] != 0.0 or offset[i, 1] != 0.0:
        for c in range(star_offsets[i], star_offsets[i + 1]):
            triangle, k = star_corners[c] // 3, star_corners[c] % 3
            a = triangles[triangle, (k + 1) % 3]
            b = triangles[triangle, (k + 2) % 3]
            if (_side(offset, i, a) > 0.0) != (_side(offset, i, b) > 0.0):
                fraction, _ = _crossing(offset, i, a, b)
                if fraction < 1.0:
                    return triangle, k
    return -1, -1


@kernel
def _crossing(offset: Float64Array, i: int, a: int, b: int) -> tuple[float, float]:
    """Where the line from P0 to node i crosses the edge from a to b, whose ends it separates.

    Returns the fraction of the line at the crossing (0 at P0, 1 at node i) and the elevation
    interpolated on the edge, relative to P0.
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
    """Positive where node j lies left of the line from node i to P0."""
    to_x, to_y = offset[j, 0] - offset[i, 0], offset[j, 1] - offset[i, 1]
    return np.float64(offset[i, 1] * to_x - offset[i, 0] * to_y)
