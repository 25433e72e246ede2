"""Finite elements: Delaunay triangles in the mesh's projection (paper Sec. 2.3, Eq. 14).

The projection in which the mesh is built is named `chart` here and in `intervis.Settings`.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import Delaunay, QhullError

from intervis.arrays import Float64Array, IntArray

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
    """

    triangles: IntArray
    area: Float64Array
    edges: IntArray


def build_mesh(chart: Float64Array) -> Mesh:
    """Delaunay triangulation of projected positions.

    With n distinct positions of which h lie on the convex hull it has N = 2n - 2 - h triangles and
    E = N + n - 1 edges. Of several nodes at one position only one has edges. Triangles without
    area between collinear positions are kept, so that the mesh has no holes. Where all positions
    are collinear, or fewer than three, there is no triangle: the edges join each position to the
    next along the line.

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
    if found is not None:
        triangles = found.simplices.astype(np.int64)
        area = signed_area(chart, triangles)
        triangles[area < 0] = triangles[area < 0][:, ::-1]
        if np.abs(area).max() > SLIVER * _extent(chart) ** 2:
            return Mesh(triangles, np.abs(area), unique_edges(triangles, len(chart)))
    return Mesh(np.empty((0, 3), np.int64), np.empty(0), _chain(chart))


def triangulate(chart: Float64Array) -> Delaunay | None:
    """Delaunay triangulation after scaling to unit extent; None where Qhull finds no triangle.

    Parameters
    ----------
    chart : (V, 2) float64 array
    """
    if len(chart) < 3 or not _extent(chart) > 0:
        return None
    try:
        return Delaunay((chart - chart.mean(axis=0)) / _extent(chart))
    except QhullError:  # all positions are collinear
        return None


def _extent(chart: Float64Array) -> float:
    """The longer side of the bounding box."""
    return float(np.ptp(chart, axis=0).max())


def signed_area(chart: Float64Array, triangles: IntArray) -> Float64Array:
    """(F,) S_k of Eq. 14: ((x2 - x1)(y3 - y1) - (x3 - x1)(y2 - y1)) / 2."""
    x, y = chart[triangles, 0], chart[triangles, 1]
    along_1, along_2 = x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]
    across_1, across_2 = y[:, 1] - y[:, 0], y[:, 2] - y[:, 0]
    area: Float64Array = (along_1 * across_2 - along_2 * across_1) / 2
    return area


def unique_edges(triangles: IntArray, nodes: int) -> IntArray:
    """(E, 2) undirected edges of triangles, each once, smaller node first, sorted.

    Examples
    --------
    >>> unique_edges(np.array([[0, 1, 2], [2, 1, 3]]), 4).tolist()
    [[0, 1], [0, 2], [1, 2], [1, 3], [2, 3]]
    """
    start = triangles.ravel()
    stop = np.roll(triangles, -1, axis=1).ravel()
    key = np.unique(np.minimum(start, stop) * nodes + np.maximum(start, stop))
    return np.column_stack([key // nodes, key % nodes]) if nodes else np.empty((0, 2), np.int64)


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
    nodes, width = position.shape
    weighted = position[mesh.triangles].mean(axis=1) * mesh.area[:, None]
    corner = mesh.triangles.ravel()
    area = np.bincount(corner, np.repeat(mesh.area, 3), minlength=nodes)
    with np.errstate(invalid="ignore"):
        return np.column_stack(
            [
                np.bincount(corner, np.repeat(weighted[:, k], 3), minlength=nodes) / area
                for k in range(width)
            ]
        )


def _chain(chart: Float64Array) -> IntArray:
    """Edges between consecutive distinct positions along the line that they lie on."""
    if len(chart) < 2:
        return np.empty((0, 2), np.int64)
    # np.unique sorts by the first coordinate, then by the second: the order along the line.
    order = np.unique(chart, axis=0, return_index=True)[1]
    pairs = np.sort(np.column_stack([order[:-1], order[1:]]), axis=1)
    return pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]
