"""MPCS and Algorithm 1: which points, edges and triangles are intervisible (Sec. 2.3, Eq. 13).

MPCS is the paper's mix-planes calculation structure: the angle and the elevations that decide
whether two neighbouring nodes are intervisible. Every undirected edge is evaluated from both of
its ends. A half edge leads from a node i (its source) to a neighbour j (its target); with E edges,
half edge k and half edge k + E are the two directions of edge k.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from intervis.arrays import BoolArray, Float64Array, Int32Array, IntArray
from intervis.kernels import kernel, thread_count
from intervis.method.shortest_paths import edge_rows, shortest_paths
from intervis.settings import Settings

ANGULAR_NEIGHBOURS = 6
"""Returns that a node is compared with by the criterion ``sight_line``: the mean number of
neighbours of a node in a triangulation."""

OCCLUDER_MARGIN_M, OCCLUDER_MARGIN_SHARE = 0.5, 0.1
"""A return occludes a node when it is nearer to P0 by more than this distance plus this share of
the node's range; otherwise both belong to one surface."""

ROOT = -1
"""Entry of a tree of predecessors for a node that P0 reaches directly."""

NOT_REACHED = -2
"""Entry of a tree of predecessors for a node that the tree does not reach."""


@dataclass(frozen=True, eq=False)
class CriterionResult:
    """Result of Algorithm 1 for V nodes and E edges.

    Attributes
    ----------
    gate : (2E,) bool array
        Half edges that pass line 1: l1 < D_min < l3.
    handed_over : (V,) bool array
        Nodes on a concave boundary, which lines 2 to 4 leave out: their nearest neighbour is
        evaluated in their place, as every other node is.
    half_edge : (2E,) bool array
        Half edges whose target is intervisible from their source (lines 5 to 9).
    node : (V,) bool array
        Intervisibility points: the source of an intervisible half edge, and its target where the
        half edge back passes the gate (lines 7 and 9 add both to the graph).
    edge : (E,) bool array
        Intervisible edges: both ends are intervisibility points, and both half edges pass the
        gate.
    """

    gate: BoolArray
    handed_over: BoolArray
    half_edge: BoolArray
    node: BoolArray
    edge: BoolArray


def apply_criteria(
    points: Float64Array,
    viewpoint: Float64Array,
    edges: IntArray,
    length: Float64Array,
    flow_distance: Float64Array,
    centroid_distance: Float64Array,
    settings: Settings,
    *,
    returns: Float64Array | None = None,
) -> CriterionResult:
    """Algorithm 1 for all nodes at once.

    Parameters
    ----------
    points : (V, 3) float64 array
        Nodes, sensor frame (z up), metres.
    viewpoint : (3,) float64 array
        P0, metres.
    edges : (E, 2) int64 array
    length : (E,) float64 array
        l1 of each edge: D between its ends.
    flow_distance : (V,) float64 array
        l3 of each node: D' from P0.
    centroid_distance : (V,) float64 array
        l_gc: D from each node to the centroid of its subgraph; NaN where it has no triangle.
    settings : Settings
        ``gate``, ``concave_boundary`` and ``criterion`` are used.
    returns : (n_fov, 3) float64 array or None
        All returns in view, for the criterion "sight_line"; None uses the nodes.

    Notes
    -----
    With ``concave_boundary="every"`` lines 2 to 4 never apply: the centroid is a mean of points of
    the star with a weight of 1/3 on the node itself, so l_gc is at most 2/3 of the longest edge.
    With "any" they leave out most nodes.
    """
    nodes = len(points)
    source = np.concatenate([edges[:, 0], edges[:, 1]])
    target = np.concatenate([edges[:, 1], edges[:, 0]])
    l1 = np.concatenate([length, length])
    l_gc = np.nan_to_num(centroid_distance, nan=0.0)

    # Line 1: l1 < D_min < l3.
    if settings.gate == "none":
        passes = np.ones(len(l1), bool)
    else:
        d_min = gate_threshold(source, target, l1, nodes, settings.gate)
        passes = (l1 < d_min[source]) & (d_min[source] < flow_distance[source])

    # Lines 2 to 4: nodes with edges shorter than l_gc lie on a concave boundary.
    shorter = np.bincount(source, l1 < l_gc[source], minlength=nodes)
    every = settings.concave_boundary == "every"
    enough = np.bincount(source, minlength=nodes) if every else 1
    handed_over = (shorter >= enough) & (shorter > 0)

    # Lines 5 to 9, for neighbours farther than l_gc.
    if settings.criterion == "sight_line":
        visible = unoccluded(points, points if returns is None else returns, viewpoint)
        agrees = visible[source] & visible[target]
    else:
        agrees = mix_planes_criterion(points, viewpoint, source, target, settings.criterion)
    half_edge = passes & ~handed_over[source] & (l1 > l_gc[source]) & agrees

    node, edge = np.zeros(nodes, bool), np.empty(len(edges), bool)
    _mark(edges, passes, half_edge, node, edge)
    return CriterionResult(
        gate=passes, handed_over=handed_over, half_edge=half_edge, node=node, edge=edge
    )


@kernel
def _mark(
    edges: IntArray, passes: BoolArray, half_edge: BoolArray, node: BoolArray, edge: BoolArray
) -> None:
    """Mark intervisibility points and write which edges are intervisible."""
    count = len(edges)
    for k in range(count):
        i, j = edges[k]
        there, back = half_edge[k], half_edge[k + count]
        node[i] |= there | (back & passes[k])
        node[j] |= back | (there & passes[k + count])
    for k in range(count):
        edge[k] = node[edges[k, 0]] & node[edges[k, 1]] & passes[k] & passes[k + count]


def mix_planes_criterion(
    points: Float64Array,
    viewpoint: Float64Array,
    source: IntArray,
    target: IntArray,
    criterion: str,
) -> BoolArray:
    """(M,) whether line 6 or line 8 holds for each half edge from i to j.

    Line 6: j lies beyond i and higher, so it is visible over i. Line 8: j lies in front of i and
    lower, so it does not occlude i. Heights are elevations z (``elevation``) or elevation angles
    (``sight_angle``).
    """
    height = elevation_angle_rad(points, viewpoint) if criterion == "sight_angle" else points[:, 2]
    holds = np.empty(len(source), bool)
    _decide(points, viewpoint, np.ascontiguousarray(height), source, target, holds)
    return holds


@kernel
def _decide(
    points: Float64Array,
    viewpoint: Float64Array,
    height: Float64Array,
    source: IntArray,
    target: IntArray,
    holds: BoolArray,
) -> None:
    """Write whether line 6 or line 8 holds.

    theta_1 (Eq. 13) is the angle at i between the directions to P0 and to j; theta_2 is a right
    angle, that between the planes P_i and P_v of the MPCS. theta_1 is smaller than theta_2 where
    the scalar product of the two directions is positive, and larger where it is negative.
    """
    for k in range(len(source)):
        i, j = source[k], target[k]
        product = 0.0
        for axis in range(3):
            to_viewpoint = viewpoint[axis] - points[i, axis]
            product += to_viewpoint * (points[j, axis] - points[i, axis])
        rise = height[j] - height[i]
        # Without "and" and "or": half of their branches would be guessed wrong.
        holds[k] = ((product < 0.0) & (rise > 0.0)) | ((product > 0.0) & (rise < 0.0))


def unoccluded(points: Float64Array, returns: Float64Array, viewpoint: Float64Array) -> BoolArray:
    """(V,) nodes that no return occludes, seen from P0: the criterion ``sight_line``.

    Not in the paper. A node is compared with the seven returns nearest to its direction from P0
    (itself and six more). It is occluded when one of them is nearer to P0 by more than 0.5 m plus
    a tenth of the node's range.

    Parameters
    ----------
    points : (V, 3) float64 array
        Nodes, metres.
    returns : (n_fov, 3) float64 array
        All returns in view, metres: what occludes a node need not be a node.
    viewpoint : (3,) float64 array
    """
    if len(points) == 0:
        return np.zeros(0, bool)
    range_m, direction = _polar(points, viewpoint)
    return_range_m, return_direction = _polar(returns, viewpoint)
    tree = cKDTree(return_direction, balanced_tree=False, compact_nodes=False)
    count = min(ANGULAR_NEIGHBOURS + 1, len(returns))
    near = tree.query(direction, k=count, workers=thread_count())[1]
    nearest_m = return_range_m[near].reshape(len(points), -1).min(axis=1)
    clear: BoolArray = nearest_m >= range_m * (1 - OCCLUDER_MARGIN_SHARE) - OCCLUDER_MARGIN_M
    return clear


def _polar(points: Float64Array, viewpoint: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Range (V,) and unit direction (V, 3) from the viewpoint."""
    offset = points - viewpoint
    range_m: Float64Array = np.linalg.norm(offset, axis=1)
    return range_m, offset / np.where(range_m > 0, range_m, 1.0)[:, None]


def gate_threshold(
    source: IntArray, target: IntArray, l1: Float64Array, nodes: int, gate: str
) -> Float64Array:
    """(V,) D_min, "the minimum degree of the adjacency matrix of the subgraph", of each node.

    ``degree`` is the weighted degree of the node, the row sum of its edge lengths: the
    interpretation that reproduces the paper's Table 2. ``mean`` and ``shortest`` are the mean and
    the shortest edge of the star, ``star_minimum`` the least weighted degree of the node and its
    neighbours.
    """
    degree = np.bincount(source, l1, minlength=nodes).astype(np.float64)
    if gate == "mean":
        return degree / np.maximum(np.bincount(source, minlength=nodes), 1)
    if gate == "shortest":
        shortest = np.full(nodes, np.inf)
        np.minimum.at(shortest, source, l1)
        return shortest
    if gate == "star_minimum":
        least = degree.copy()
        np.minimum.at(least, source, degree[target])
        return least
    return degree


def elevation_angle_rad(points: Float64Array, viewpoint: Float64Array) -> Float64Array:
    """(V,) elevation angle of each point as seen from the viewpoint."""
    offset = points - viewpoint
    return np.arctan2(offset[:, 2], np.hypot(offset[:, 0], offset[:, 1]))


def intervisible_region(
    triangles: IntArray, sides: Int32Array, node: BoolArray, edge: BoolArray
) -> BoolArray:
    """(F,) triangles with three intervisibility points and at least two intervisible edges.

    Parameters
    ----------
    triangles : (F, 3) int64 array
    sides : (F, 3) int32 array
        Row of the edges of each triangle in `edge`.
    node, edge : (V,) and (E,) bool arrays
    """
    region = np.empty(len(triangles), bool)
    _select_region(triangles, sides, node, edge, region)
    return region


@kernel
def _select_region(
    triangles: IntArray, sides: Int32Array, node: BoolArray, edge: BoolArray, region: BoolArray
) -> None:
    """Write which triangles belong to the region."""
    for k in range(len(triangles)):
        points, edges = 0, 0
        for corner in range(3):
            points += node[triangles[k, corner]]
            edges += edge[sides[k, corner]]
        region[k] = points == 3 and edges >= 2


def reachable_tree(
    edges: IntArray,
    position: Float64Array,
    flow_distance: Float64Array,
    flow_parent: IntArray,
    node: BoolArray,
    edge: BoolArray,
) -> IntArray:
    """The tree of shortest paths from P0 along intervisible edges.

    Its roots are the intervisibility points that P0 reaches directly or, where there are none, the
    one with the least flow distance.

    Parameters
    ----------
    edges : (E, 2) int64 array
    position : (V, 3) float64 array
        `Surface.metric_position`.
    flow_distance, flow_parent : (V,) float64 and int64 arrays
    node, edge : (V,) and (E,) bool arrays

    Returns
    -------
    (V,) int64 array
        The node before each node; -1 for a root, -2 for a node that the tree does not reach. Of
        several paths of one length, the node with the shortest path from P0 comes before, then
        the one with the smallest number.
    """
    roots = np.flatnonzero(node & (flow_parent < 0))
    if not len(roots) and node.any():
        roots = np.flatnonzero(node)[[np.argmin(flow_distance[node])]]
    starts, columns = edge_rows(edges, edge, len(node))
    distance, before = shortest_paths(position, starts, columns, roots, False)
    return np.where(np.isfinite(distance), before, NOT_REACHED)
