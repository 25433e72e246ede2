"""Finite elements: Delaunay triangles over the surface's chart (paper Sec. 2.3, Eq. 14)."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import Delaunay, QhullError

from intervis.arrays import Float64Array, IntArray

SLIVER = 1e-12
"""A triangulation whose largest triangle is less than this share of the chart's extent squared lies
on one line."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """Finite elements over V nodes.

    Attributes
    ----------
    triangles : (F, 3) int64 array
        Nodes of each finite element, counter-clockwise in the chart.
    area : (F,) float64 array
        Area S_k of each in the chart, positive (Eq. 14).
    edges : (E, 2) int64 array
        Unique undirected edges, smaller node first, sorted.
    """

    triangles: IntArray
    area: Float64Array
    edges: IntArray


def build_mesh(chart: Float64Array) -> Mesh:
    """Delaunay triangulation of chart positions.

    With n distinct positions of which h lie on the hull it has N = 2n - 2 - h triangles and
    E = N + n - 1 edges. Copies of a position stay without edges, save the first that the
    triangulation takes. Slivers between positions on one line are kept, so that the mesh has no
    holes. Where all positions lie on one line (or are fewer than three) there is no triangle but a
    chain of edges from each to the next.

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
    extent = float(np.ptp(chart, axis=0).max()) if len(chart) else 0.0
    if len(chart) >= 3 and extent > 0:
        try:
            found = Delaunay((chart - chart.mean(axis=0)) / extent).simplices.astype(np.int64)
        except QhullError:  # all positions on one line
            found = np.empty((0, 3), np.int64)
        area = signed_area(chart, found)
        found[area < 0] = found[area < 0][:, ::-1]
        if len(found) and np.abs(area).max() > SLIVER * extent**2:
            return Mesh(found, np.abs(area), unique_edges(found, len(chart)))
    return Mesh(np.empty((0, 3), np.int64), np.empty(0), _chain(chart))


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

    The area-weighted mean of the triangles' centroids, with areas from the chart and positions in
    whatever coordinates are asked for; NaN for a node without triangles.

    Parameters
    ----------
    mesh : Mesh
    position : (V, k) float64 array
        Positions of the nodes: the chart for Eq. 14 as printed, or `Surface.metric_position`, in
        which D is the plain distance.
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
    distinct = np.unique(chart, axis=0, return_index=True)[1]
    order = distinct  # np.unique sorts by the first coordinate, then by the second
    pairs = np.column_stack([order[:-1], order[1:]])
    pairs = np.sort(pairs, axis=1)
    return pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]
