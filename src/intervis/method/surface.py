"""Manifold auxiliary surface, MAS (paper Sec. 2.2, Eq. 3 to 8).

One metric D measures everything. Whitening once, y = (p - P0) W with W W^T the inverse covariance,
makes the Mahalanobis distance (Eq. 4) a plain distance between rows of y; the other metrics are
the same with another W. In that space every point is pulled by its surroundings (cohesion, Eq. 3)
and pushed away from the meta-viewpoint (repulsion, Eq. 6), and the moved points are given two
coordinates in a chart that keeps their direction as seen from P0.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from intervis.arrays import BoolArray, Float64Array, IntArray
from intervis.kernels import kernel, thread_count

NEIGHBOURS = 8
"""Surrounding points that pull one point, and that the flow may go on to from it."""

SECTORS = 180
"""Directions of azimuth in which P0 reaches the nearest point directly."""

SINGULAR = 1e-10
"""Correlations whose eigenvalues differ by more than this ratio count as singular, and a variance
of less than this share of the largest counts as none."""

NEAREST_SHARE = 0.5
"""No force may shrink a point's ground range to less than this share of it."""


@dataclass(frozen=True, eq=False)
class Surface:
    """The manifold auxiliary surface of V nodes.

    Attributes
    ----------
    metric_position : (V, 3) float64 array
        Positions y relative to P0 in which D is the plain distance; P0 is the origin.
    flow_distance : (V,) float64 array
        D', the shortest path from P0 through the points, in units of D.
    flow_parent : (V,) int64 array
        The node before each node on that path; -1 where P0 reaches the node directly.
    displacement : (V, 3) float64 array
        The resultant force on each point, in units of y.
    chart : (V, 2) float64 array
        The two coordinates in which the mesh is built.
    metric : str
        The metric in force: "normalized" where "mahalanobis" was asked for and the covariance is
        singular.
    """

    metric_position: Float64Array
    flow_distance: Float64Array
    flow_parent: IntArray
    displacement: Float64Array
    chart: Float64Array
    metric: str


def build_surface(
    points: Float64Array,
    viewpoint: Float64Array,
    *,
    metric: str = "ground",
    chart: str = "ground",
    cohesion: float = 0.1,
    repulsion: float = 0.1,
    influence_radius: float | None = None,
) -> Surface:
    """The manifold auxiliary surface of sampled points (Eq. 3 to 8).

    Parameters
    ----------
    points : (V, 3) float64 array
        Nodes, sensor frame (z up), metres.
    viewpoint : (3,) float64 array
        Meta-viewpoint P0, sensor frame, metres.
    metric, chart, cohesion, repulsion, influence_radius
        See `intervis.Settings`.
    """
    weight, used = whitening(points, metric)
    y = (points - viewpoint) @ weight
    neighbours = nearest_neighbours(y)
    reached = direct_reach(points, viewpoint, y)
    distance, parent = flow_paths(y, neighbours, reached)
    force = cohesion_force(y, neighbours, cohesion) + repulsion_force(
        y, distance, parent, repulsion, influence_radius
    )
    moved_m = force @ np.linalg.pinv(weight)
    return Surface(
        metric_position=y,
        flow_distance=distance,
        flow_parent=parent,
        displacement=force,
        chart=chart_coordinates(points, moved_m, viewpoint, chart),
        metric=used,
    )


def whitening(points: Float64Array, metric: str) -> tuple[Float64Array, str]:
    """The matrix W that makes a metric a plain distance, and the metric in force.

    ``mahalanobis`` (Eq. 4): W W^T is the inverse of the sample covariance; where that is singular
    or badly conditioned, ``normalized`` (Eq. 5) takes over: each axis divided by its standard
    deviation (an axis without spread carries no distance). ``euclidean`` is plain metres and
    ``ground`` plain metres over the ground plane.

    Examples
    --------
    >>> whitening(np.eye(3), "ground")[0].diagonal()
    array([1., 1., 0.])
    """
    if metric == "euclidean":
        return np.eye(3), metric
    if metric == "ground":
        return np.diag([1.0, 1.0, 0.0]), metric
    if len(points) < 2:
        return np.eye(3), "euclidean"
    covariance = np.cov(points.T)
    variance = covariance.diagonal()
    spread = variance > SINGULAR * variance.max()
    scale = np.diag(np.divide(1.0, np.sqrt(variance), out=np.zeros(3), where=spread))
    if metric == "mahalanobis":
        # Judged and inverted as correlations: whether it is singular must not hang on the units.
        value, vector = np.linalg.eigh(scale @ covariance @ scale)
        if value[0] > SINGULAR * value[-1]:
            return scale @ vector @ np.diag(1.0 / np.sqrt(value)) @ vector.T, metric
    return scale, "normalized"


def nearest_neighbours(y: Float64Array) -> IntArray:
    """(V, K) rows of the nearest other points, K = min(8, V - 1); the surroundings of each."""
    count = min(NEIGHBOURS, len(y) - 1)
    if count < 1:
        return np.empty((len(y), 0), np.int64)
    workers = thread_count() if len(y) > 4096 else 1
    found = cKDTree(y).query(y, k=count + 1, workers=workers)[1]
    # A point is its own nearest neighbour, save among copies of itself, where any may come first.
    found = found.astype(np.int64)
    own = found == np.arange(len(y))[:, None]
    own[~own.any(axis=1), -1] = True
    others: IntArray = found[~own].reshape(len(y), count)
    return others


def direct_reach(points: Float64Array, viewpoint: Float64Array, y: Float64Array) -> BoolArray:
    """(V,) mask of the points P0 reaches directly: the nearest in its sector of azimuth."""
    reached = np.zeros(len(points), bool)
    if len(points) == 0:
        return reached
    azimuth_rad = np.arctan2(points[:, 1] - viewpoint[1], points[:, 0] - viewpoint[0])
    # Sectors count from the middle of the view, so that turning the world turns them along.
    middle = points.mean(axis=0) - viewpoint
    turned = azimuth_rad - np.arctan2(middle[1], middle[0])
    sector = np.floor((turned / (2 * np.pi) % 1.0) * SECTORS).astype(np.int64)
    order = np.lexsort((np.einsum("ij,ij->i", y, y), sector))
    first = np.unique(sector[order], return_index=True)[1]
    reached[order[first]] = True
    return reached


def flow_paths(
    y: Float64Array, neighbours: IntArray, reached: BoolArray
) -> tuple[Float64Array, IntArray]:
    """Shortest paths D' from P0 (the origin of y) through the points, and the node before each.

    Edge lengths are D. P0 is joined to the points it reaches directly. A group of points that no
    path leads to is joined to P0 at its nearest point: nothing else stands between.
    """
    distance, parent = _shortest_paths(y, *_both_ways(neighbours), np.flatnonzero(reached))
    return distance, parent


def cohesion_force(y: Float64Array, neighbours: IntArray, scale: float) -> Float64Array:
    """Cohesion (Eq. 3): a pull of size alpha D towards the middle of the surrounding points."""
    if neighbours.shape[1] == 0:
        return np.zeros_like(y)
    pull: Float64Array = scale * (y[neighbours].mean(axis=1) - y)
    return pull


def repulsion_force(
    y: Float64Array,
    distance: Float64Array,
    parent: IntArray,
    scale: float,
    radius: float | None = None,
) -> Float64Array:
    """Repulsion (Eq. 6): beta (1/D' - 1/R) / D'^2 along the gradient of D', zero beyond R.

    beta is given in units of R^4, so that the force scales with the scene. It is lowered where it
    would push the nearest point past the ones behind it: order along the flow is kept.
    """
    if len(y) == 0:
        return np.zeros_like(y)
    radius = float(np.median(distance)) if radius is None else radius
    rho = distance / radius if radius > 0 else np.ones_like(distance)
    before = np.where((parent >= 0)[:, None], y[parent], 0.0)
    step = y - before
    length = np.linalg.norm(step, axis=1)
    inside = (rho < 1.0) & (rho > 0.0) & (length > 0.0)
    force = np.zeros_like(y)
    if not inside.any():
        return force
    r = rho[inside]
    # rho + beta (rho^-3 - rho^-2) rises everywhere if it rises at the smallest rho.
    steepest = float((3 * r**-4 - 2 * r**-3).max())
    beta = min(scale, 0.5 / steepest)
    size = beta * (1.0 / r - 1.0) / r**2 * radius
    force[inside] = (size / length[inside])[:, None] * step[inside]
    return force


def chart_coordinates(
    points: Float64Array, moved_m: Float64Array, viewpoint: Float64Array, chart: str
) -> Float64Array:
    """Two coordinates for each displaced point, its direction as seen from P0 kept.

    Parameters
    ----------
    points, moved_m : (V, 3) float64 arrays
        Nodes, and how far the forces move them, metres.
    viewpoint : (3,) float64 array
    chart : {"ground", "angles", "polar"}
        ``ground``: x and y relative to P0, metres. ``angles``: azimuth and elevation seen from
        P0, radians. ``polar``: azimuth and the logarithm of ground range. The two charts with an
        azimuth are cut open behind the viewpoint, at azimuth pi.
    """
    offset = points - viewpoint
    ground_range = np.hypot(offset[:, 0], offset[:, 1])
    azimuth_rad = np.arctan2(offset[:, 1], offset[:, 0])
    if chart == "angles":
        return np.column_stack([azimuth_rad, np.arctan2(offset[:, 2], ground_range)])
    outward = np.column_stack([np.cos(azimuth_rad), np.sin(azimuth_rad)])
    along = np.einsum("ij,ij->i", moved_m[:, :2], outward)
    displaced = np.maximum(ground_range + along, NEAREST_SHARE * ground_range)
    if chart == "polar":
        tiny = np.finfo(np.float64).tiny
        return np.column_stack([azimuth_rad, np.log(np.maximum(displaced, tiny))])
    ground: Float64Array = displaced[:, None] * outward
    return ground


def _both_ways(neighbours: IntArray) -> tuple[IntArray, IntArray]:
    """The neighbour relation made symmetric, as row starts and columns."""
    count, width = neighbours.shape
    row = np.repeat(np.arange(count), width)
    column = neighbours.ravel()
    rows = np.concatenate([row, column])
    columns = np.concatenate([column, row])
    order = np.argsort(rows, kind="stable")
    starts = np.searchsorted(rows[order], np.arange(count + 1))
    return starts, columns[order]


@kernel
def _shortest_paths(
    y: Float64Array, starts: IntArray, columns: IntArray, reached: IntArray
) -> tuple[Float64Array, IntArray]:
    """Dijkstra's algorithm from the origin, with a binary heap."""
    n = y.shape[0]
    direct = np.empty(n)
    for i in range(n):
        direct[i] = np.sqrt(y[i, 0] ** 2 + y[i, 1] ** 2 + y[i, 2] ** 2)
    nearest_first = np.argsort(direct)
    distance = np.full(n, np.inf)
    parent = np.full(n, -1, np.int64)
    done = np.zeros(n, np.bool_)
    heap_key = np.empty(columns.shape[0] + n + 1)
    heap_node = np.empty(columns.shape[0] + n + 1, np.int64)
    size = 0
    for i in reached:
        distance[i] = direct[i]
        size = _push(heap_key, heap_node, size, direct[i], i)
    next_direct = 0
    while True:
        if size == 0:
            while next_direct < n and done[nearest_first[next_direct]]:
                next_direct += 1
            if next_direct == n:
                return distance, parent
            i = nearest_first[next_direct]
            distance[i] = direct[i]
            size = _push(heap_key, heap_node, size, direct[i], i)
        i = heap_node[0]
        size = _pop(heap_key, heap_node, size)
        if done[i]:
            continue
        done[i] = True
        for k in range(starts[i], starts[i + 1]):
            j = columns[k]
            if done[j]:
                continue
            length = np.sqrt(
                (y[i, 0] - y[j, 0]) ** 2 + (y[i, 1] - y[j, 1]) ** 2 + (y[i, 2] - y[j, 2]) ** 2
            )
            if distance[i] + length < distance[j]:
                distance[j] = distance[i] + length
                parent[j] = i
                size = _push(heap_key, heap_node, size, distance[j], j)


@kernel
def _push(key: Float64Array, node: IntArray, size: int, new_key: float, new_node: int) -> int:
    at = size
    while at > 0:
        above = (at - 1) // 2
        if key[above] <= new_key:
            break
        key[at] = key[above]
        node[at] = node[above]
        at = above
    key[at] = new_key
    node[at] = new_node
    return size + 1


@kernel
def _pop(key: Float64Array, node: IntArray, size: int) -> int:
    size -= 1
    last_key = key[size]
    last_node = node[size]
    at = 0
    while True:
        below = 2 * at + 1
        if below >= size:
            break
        if below + 1 < size and key[below + 1] < key[below]:
            below += 1
        if key[below] >= last_key:
            break
        key[at] = key[below]
        node[at] = node[below]
        at = below
    key[at] = last_key
    node[at] = last_node
    return size
