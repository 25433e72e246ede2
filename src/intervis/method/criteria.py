"""MPCS and Algorithm 1: which points, edges and triangles are intervisible (Sec. 2.3, Eq. 13).

Every undirected edge is looked at from both of its ends. A half edge leads from a node i (its
source) to a neighbour j (its target); with E edges, half edge k and half edge k + E are the two
directions of edge k.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from intervis.arrays import BoolArray, Float64Array, IntArray
from intervis.kernels import thread_count

THETA_2_DEG = 90.0
"""The straight dihedral angle between the planes P_i and P_v of the MPCS."""

BESIDE = 6
"""As many neighbours as a node of a triangulation has on average."""

BEFORE_M, BEFORE_SHARE = 0.5, 0.1
"""Nearer by more than this, and this share of the range, is another surface, not the same one."""

ROOT = -1
NOT_REACHED = -2


@dataclass(frozen=True, eq=False)
class Verdict:
    """What Algorithm 1 says of V nodes and E edges.

    Attributes
    ----------
    gate : (2E,) bool array
        Half edges that pass line 1: l1 < D_min < l3.
    handed_over : (V,) bool array
        Nodes on a concave boundary, which are not judged (lines 2 to 4): their nearest neighbour,
        a node like any other, is judged in their place.
    judged : (2E,) bool array
        Half edges whose target is judged intervisible from their source (lines 5 to 9).
    node : (V,) bool array
        Intervisibility points: both ends of a judged half edge, each as far as it passes the gate
        (lines 7 and 9 add the node and its neighbour to the graph).
    edge : (E,) bool array
        Intervisible edges: both ends are intervisibility points, and the gate holds both ways.
    """

    gate: BoolArray
    handed_over: BoolArray
    judged: BoolArray
    node: BoolArray
    edge: BoolArray


def apply_criteria(
    points: Float64Array,
    viewpoint: Float64Array,
    edges: IntArray,
    length: Float64Array,
    flow_distance: Float64Array,
    centroid_distance: Float64Array,
    *,
    gate: str = "degree",
    concave_boundary: str = "every",
    criterion: str = "sight_angle",
    returns: Float64Array | None = None,
) -> Verdict:
    """Algorithm 1 over all nodes at once.

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
    gate, concave_boundary, criterion
        See `intervis.Settings`.
    returns : (n_fov, 3) float64 array or None
        All returns in view, for the criterion "sight_line"; None takes the nodes for them.

    Notes
    -----
    Read as "every edge of the node is shorter than the way to the centroid", lines 2 to 4 never
    apply: the centroid is a mean of points of the star with a weight of 1/3 on the node itself, so
    l_gc is at most 2/3 of the longest edge. Read as "some edge is", they take out most nodes.
    """
    nodes = len(points)
    source = np.concatenate([edges[:, 0], edges[:, 1]])
    target = np.concatenate([edges[:, 1], edges[:, 0]])
    l1 = np.concatenate([length, length])
    l_gc = np.nan_to_num(centroid_distance, nan=0.0)

    # Line 1: the edge is shorter than the threshold of the subgraph, and that than the sight line.
    threshold = shortest_radius(source, l1, nodes, target, gate)
    if gate == "none":
        passes = np.ones(len(l1), bool)
    else:
        passes = (l1 < threshold[source]) & (threshold[source] < flow_distance[source])

    # Lines 2 to 4: edges shorter than the way to the centroid: the node sits on a rim.
    shorter = np.bincount(source, l1 < l_gc[source], minlength=nodes)
    enough = np.bincount(source, minlength=nodes) if concave_boundary == "every" else 1
    handed_over = (shorter >= enough) & (shorter > 0)

    # Lines 5 to 9, for neighbours farther than the centroid.
    if criterion == "sight_line":
        seen = in_sight(points, points if returns is None else returns, viewpoint)
        agrees = seen[source] & seen[target]
    else:
        agrees = mix_planes(points, viewpoint, source, target, criterion)
    judged = passes & ~handed_over[source] & (l1 > l_gc[source]) & agrees

    backward = np.concatenate([passes[len(edges) :], passes[: len(edges)]])
    node = np.zeros(nodes, bool)
    node[source[judged]] = True
    node[target[judged & backward]] = True
    both_ways = passes[: len(edges)] & backward[: len(edges)]
    edge = node[edges[:, 0]] & node[edges[:, 1]] & both_ways
    return Verdict(gate=passes, handed_over=handed_over, judged=judged, node=node, edge=edge)


def mix_planes(
    points: Float64Array,
    viewpoint: Float64Array,
    source: IntArray,
    target: IntArray,
    criterion: str,
) -> BoolArray:
    """(M,) what lines 6 and 8 say of the half edges i to j.

    Beyond i and higher, j is seen over i; in front of i and lower, j does not cover i. Higher is a
    matter of elevation z (``elevation``) or of the angle above the horizon (``sight_angle``).
    """
    theta_1_deg = sight_angle_deg(points, viewpoint, source, target)
    height = elevation_angle_rad(points, viewpoint) if criterion == "sight_angle" else points[:, 2]
    rise = height[target] - height[source]
    seen_over: BoolArray = (theta_1_deg - THETA_2_DEG > 0) & (rise > 0)
    seen_before: BoolArray = (theta_1_deg - THETA_2_DEG < 0) & (rise < 0)
    return seen_over | seen_before


def in_sight(points: Float64Array, returns: Float64Array, viewpoint: Float64Array) -> BoolArray:
    """(V,) nodes that no return stands before: the criterion ``sight_line``.

    Not in the paper. A node is compared with the seven returns that are nearest to its direction
    as seen from P0 (itself and six more), nearest by "the radian between points" instead of over
    the ground: it is in sight when none of them is nearer to P0 by more than 0.5 m and a tenth of
    the node's range.

    Parameters
    ----------
    points : (V, 3) float64 array
        Nodes, metres.
    returns : (n_fov, 3) float64 array
        All returns in view, metres: what stands before a node need not be a node.
    viewpoint : (3,) float64 array
    """
    if len(points) == 0:
        return np.zeros(0, bool)
    range_m, direction = _polar(points, viewpoint)
    return_range_m, return_direction = _polar(returns, viewpoint)
    tree = cKDTree(return_direction, balanced_tree=False, compact_nodes=False)
    beside = tree.query(direction, k=min(BESIDE + 1, len(returns)), workers=thread_count())[1]
    nearest_m = return_range_m[beside].reshape(len(points), -1).min(axis=1)
    clear: BoolArray = nearest_m >= range_m * (1 - BEFORE_SHARE) - BEFORE_M
    return clear


def _polar(points: Float64Array, viewpoint: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Range (V,) and unit direction (V, 3) from the viewpoint."""
    offset = points - viewpoint
    range_m: Float64Array = np.linalg.norm(offset, axis=1)
    return range_m, offset / np.where(range_m > 0, range_m, 1.0)[:, None]


def shortest_radius(
    source: IntArray, l1: Float64Array, nodes: int, target: IntArray, reading: str
) -> Float64Array:
    """(V,) D_min, "the minimum degree of the adjacency matrix of the subgraph", in one reading.

    ``degree`` is the weighted degree of the node, the row sum of its edge lengths: the reading
    that reproduces the paper's Table 2. ``mean`` and ``shortest`` take the mean and the shortest
    edge of the star, ``star_minimum`` the least weighted degree among the node and its neighbours.
    """
    degree = np.bincount(source, l1, minlength=nodes).astype(np.float64)
    if reading == "mean":
        return degree / np.maximum(np.bincount(source, minlength=nodes), 1)
    if reading in ("shortest", "star_minimum"):
        least: Float64Array = degree.copy() if reading == "star_minimum" else np.full(nodes, np.inf)
        np.minimum.at(least, source, degree[target] if reading == "star_minimum" else l1)
        return least
    return degree


def sight_angle_deg(
    points: Float64Array, viewpoint: Float64Array, source: IntArray, target: IntArray
) -> Float64Array:
    """(M,) theta_1 (Eq. 13): the angle at i between the directions to P0 and to j, 0 to 180.

    Where P0 or j coincides with i the angle is not defined: NaN, which no criterion accepts.
    """
    to_viewpoint = viewpoint - points[source]
    to_neighbour = points[target] - points[source]
    dot = np.einsum("ij,ij->i", to_viewpoint, to_neighbour)
    norms = np.linalg.norm(to_viewpoint, axis=1) * np.linalg.norm(to_neighbour, axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        theta_1_deg: Float64Array = np.rad2deg(np.arccos(np.clip(dot / norms, -1.0, 1.0)))
    return theta_1_deg


def elevation_angle_rad(points: Float64Array, viewpoint: Float64Array) -> Float64Array:
    """(V,) elevation angle of each point as seen from the viewpoint."""
    offset = points - viewpoint
    return np.arctan2(offset[:, 2], np.hypot(offset[:, 0], offset[:, 1]))


def intervisible_region(
    triangles: IntArray, edges: IntArray, node: BoolArray, edge: BoolArray
) -> BoolArray:
    """(F,) triangles with three intervisibility points and at least two intervisible edges."""
    if len(triangles) == 0:
        return np.zeros(0, bool)
    nodes = len(node)
    start, stop = triangles, np.roll(triangles, -1, axis=1)
    key = np.minimum(start, stop) * nodes + np.maximum(start, stop)
    which = np.searchsorted(edges[:, 0] * nodes + edges[:, 1], key)
    region: BoolArray = node[triangles].all(axis=1) & (edge[which].sum(axis=1) >= 2)
    return region


def reachable_tree(
    edges: IntArray,
    length: Float64Array,
    flow_distance: Float64Array,
    flow_parent: IntArray,
    node: BoolArray,
    edge: BoolArray,
) -> IntArray:
    """The tree of shortest ways from P0 along intervisible edges, outward.

    It starts at the intervisibility points that P0 reaches directly (where there are none, at the
    nearest one).

    Returns
    -------
    (V,) int64 array
        The node before each node; -1 for a node the tree starts at, -2 for one it does not reach.
    """
    count = len(node)
    parent = np.full(count, NOT_REACHED)
    starts = np.flatnonzero(node & (flow_parent < 0))
    if not len(starts) and node.any():
        starts = np.flatnonzero(node)[[np.argmin(flow_distance[node])]]
    if not len(starts):
        return parent
    chosen = edges[edge]
    # P0 joins the graph as one more node; a way of length 0 would read as no edge.
    way = np.maximum(flow_distance[starts], np.finfo(np.float64).tiny)
    row = np.concatenate([chosen[:, 0], np.full(len(starts), count)])
    column = np.concatenate([chosen[:, 1], starts])
    weight = np.concatenate([np.maximum(length[edge], np.finfo(np.float64).tiny), way])
    graph = csr_array((weight, (row, column)), shape=(count + 1, count + 1))
    before = dijkstra(graph, directed=False, indices=count, return_predecessors=True)[1][:count]
    reached = before >= 0
    parent[reached] = np.where(before[reached] == count, ROOT, before[reached])
    return parent
