"""Finite elements: Delaunay triangles in the mesh's projection (paper Sec. 2.3, Eq. 14).

The projection in which the mesh is built is named `chart` here and in `intervis.Settings`.
"""

from dataclasses import dataclass

import numpy as np

from intervis.arrays import Float64Array, Int32Array, IntArray
from intervis.delaunay import triangulate
from intervis.kernels import kernel

SLIVER = 1e-12
"""Positions are collinear when no triangle is larger than this share of the extent squared."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """Finite elements over V nodes.

    Attributes
    ----------
    triangles : (F, 3) int64 array
        Nodes of each finite element, counter-clockwise in the projection.
    area : (F,) float64 array
        Area S_k of each in the projection, positive (Eq. 14).
    edges : (E, 2) int64 array
        Unique undirected edges, smaller node first, sorted.
    sides : (F, 3) int32 array
        Row in `edges` of the side from each corner of each element to the next corner.
    """

    triangles: IntArray
    area: Float64Array
    edges: IntArray
    sides: Int32Array


def build_mesh(chart: Float64Array) -> Mesh:
    """Delaunay triangulation of projected positions.

    With n distinct positions of which h lie on the convex hull, also between its corners, it has
    N = 2n - 2 - h triangles and E = N + n - 1 edges. The triangulation is exact
    (`intervis.delaunay`): no triangle is without area, and they cover the convex hull. Of several
    nodes at one position only the lowest has edges. Where all positions are collinear (to within
    `SLIVER`), or fewer than three, there is no triangle: the edges join each position to the next
    along the line.

    Parameters
    ----------
    chart : (V, 2) float64 array

    Examples
    --------
    >>> square = np.array([[0.0, 0], [1, 0], [0, 1], [1.1, 1.1]])
    >>> mesh = build_mesh(square)
    >>> len(mesh.triangles), len(mesh.edges), float(mesh.area.sum().round(3))
    (2, 5, 1.1)
    """
    found = triangulate(chart)
    area = found.areas(chart)
    if area.size and area.max() > SLIVER * np.ptp(chart, axis=0).max() ** 2:
        return Mesh(found.triangles.astype(np.int64), area, *found.edges_and_sides())
    return chain_mesh(chart)


def chain_mesh(chart: Float64Array) -> Mesh:
    """Positions along a line: no triangles, and edges between consecutive distinct positions.

    Parameters
    ----------
    chart : (V, 2) float64 array

    Examples
    --------
    >>> chain_mesh(np.array([[3.0, 3], [1, 1], [2, 2]])).edges.tolist()
    [[0, 2], [1, 2]]
    """
    pairs = np.empty((0, 2), np.int64)
    if len(chart):
        # np.unique sorts by the first coordinate, then by the second: the order along the line.
        order = np.unique(chart, axis=0, return_index=True)[1]
        pairs = np.sort(np.column_stack([order[:-1], order[1:]]), axis=1)
    edges = pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]
    return Mesh(np.empty((0, 3), np.int64), np.empty(0), edges, np.empty((0, 3), np.int32))


def star_centroids(mesh: Mesh, position: Float64Array) -> Float64Array:
    """(V, k) centroid G_c of each node's subgraph, its star of triangles (Eq. 14).

    The mean of the triangles' centroids, weighted by their areas in the projection; NaN for a node
    without triangles.

    Parameters
    ----------
    mesh : Mesh
    position : (V, k) float64 array
        Positions of the nodes: the projected ones for Eq. 14 as printed, or
        `Surface.metric_position`, in which D is the Euclidean distance.
    """
    centroid, area = np.zeros(position.shape), np.zeros(len(position))
    _add_up(mesh.triangles, mesh.area, np.ascontiguousarray(position), centroid, area)
    with np.errstate(invalid="ignore"):
        return np.asarray(centroid / area[:, None])


def edge_lengths(edges: IntArray, position: Float64Array) -> Float64Array:
    """(E,) distance between the ends of each edge.

    Parameters
    ----------
    edges : (E, 2) int64 array
    position : (V, 3) float64 array

    Examples
    --------
    >>> edge_lengths(np.array([[0, 1]]), np.array([[0.0, 0, 0], [3, 4, 0]])).tolist()
    [5.0]
    """
    length = np.empty(len(edges))
    _measure(edges, np.ascontiguousarray(position), length)
    return length


@kernel
def _measure(edges: IntArray, position: Float64Array, length: Float64Array) -> None:
    """Write the length of each edge."""
    for k in range(len(edges)):
        a, b = edges[k, 0], edges[k, 1]
        dx = position[a, 0] - position[b, 0]
        dy = position[a, 1] - position[b, 1]
        dz = position[a, 2] - position[b, 2]
        length[k] = np.sqrt(dx * dx + dy * dy + dz * dz)


@kernel
def _add_up(
    triangles: IntArray,
    area: Float64Array,
    position: Float64Array,
    weighted: Float64Array,
    total: Float64Array,
) -> None:
    """Add the area of each triangle, and its centroid times its area, to its three corners."""
    for k in range(len(triangles)):
        a, b, c = triangles[k, 0], triangles[k, 1], triangles[k, 2]
        for axis in range(position.shape[1]):
            part = area[k] * ((position[a, axis] + position[b, axis] + position[c, axis]) / 3.0)
            weighted[a, axis] += part
            weighted[b, axis] += part
            weighted[c, axis] += part
        total[a] += area[k]
        total[b] += area[k]
        total[c] += area[k]
