"""Manifold auxiliary surface, MAS (paper Sec. 2.2, Eq. 3 to 8).

All lengths are measured in one metric D. The points are whitened once, y = (p - P0) W with W W^T
the inverse covariance, so that the Mahalanobis distance (Eq. 4) is the Euclidean distance between
rows of y; the other metrics differ only in W. In that space every point is attracted by its
neighbours (cohesion, Eq. 3) and repelled by the meta-viewpoint (repulsion, Eq. 6). The displaced
points are then projected to two coordinates that keep their direction as seen from P0.
"""

from dataclasses import dataclass

import numpy as np

from intervis.arrays import BoolArray, Float64Array, FloatArray, IntArray
from intervis.kernels import kernel
from intervis.method.neighbours import nearest_neighbours
from intervis.method.shortest_paths import neighbour_rows, shortest_paths
from intervis.settings import Settings

NEIGHBOURS = 8
"""Neighbours of each point, for the cohesion and for the paths of D'."""

SECTORS = 180
"""Sectors of azimuth, 2 degrees each, in which P0 reaches the nearest point directly."""

SINGULAR = 1e-10
"""A correlation matrix is singular when its eigenvalues differ by more than this ratio; a variance
is zero when it is less than this share of the largest."""

NEAREST_SHARE = 0.5
"""No force reduces a point's ground range to less than this share of it."""


@dataclass(frozen=True, eq=False)
class Surface:
    """The manifold auxiliary surface of V nodes.

    Attributes
    ----------
    metric_position : (V, 3) float64 array
        Positions y relative to P0, in which D is the Euclidean distance; P0 is the origin.
    flow_distance : (V,) float64 array
        D', the length of the shortest path from P0 through the points, in units of D.
    flow_parent : (V,) int64 array
        The node before each node on that path; -1 where P0 reaches the node directly.
    displacement : (V, 3) float64 array
        The resultant force on each point, in units of y.
    chart : (V, 2) float64 array
        Coordinates in the projection in which the mesh is built.
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


def build_surface(points: Float64Array, viewpoint: Float64Array, settings: Settings) -> Surface:
    """The manifold auxiliary surface of sampled points (Eq. 3 to 8).

    Parameters
    ----------
    points : (V, 3) float64 array
        Nodes, sensor frame (z up), metres.
    viewpoint : (3,) float64 array
        Meta-viewpoint P0, sensor frame, metres.
    settings : Settings
        ``metric``, ``chart``, ``cohesion``, ``repulsion`` and ``influence_radius`` are used.
    """
    weight, used = whitening(points, settings.metric)
    y = _times(points - viewpoint, weight)
    neighbours = nearest_neighbours(y, NEIGHBOURS)
    reached = direct_reach(points, viewpoint, y)
    distance, parent = flow_paths(y, neighbours, reached)
    force = cohesion_force(y, neighbours, settings.cohesion) + repulsion_force(
        y, distance, parent, settings.repulsion, settings.influence_radius
    )
    moved_m = _times(force, np.linalg.pinv(weight))
    return Surface(
        metric_position=y,
        flow_distance=distance,
        flow_parent=parent,
        displacement=force,
        chart=chart_coordinates(points, moved_m, viewpoint, settings.chart),
        metric=used,
    )


def _times(rows: Float64Array, matrix: FloatArray) -> Float64Array:
    """Rows (V, 3) times a (3, 3) matrix: without the threads of BLAS, which a busy core delays."""
    product: Float64Array = np.einsum("ij,jk->ik", rows, matrix)
    return product


def whitening(points: Float64Array, metric: str) -> tuple[Float64Array, str]:
    """The matrix W in which a metric is the Euclidean distance, and the metric in force.

    ``mahalanobis`` (Eq. 4): W W^T is the inverse of the sample covariance. Where that is singular
    or badly conditioned, ``normalized`` (Eq. 5) replaces it: each axis is divided by its
    standard deviation, and an axis without variance adds no distance. ``euclidean`` is metres in
    three dimensions, ``ground`` metres over the ground plane.

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
        # Tested and inverted as correlations, so that the result does not depend on the units.
        value, vector = np.linalg.eigh(scale @ covariance @ scale)
        if value[0] > SINGULAR * value[-1]:
            return scale @ vector @ np.diag(1.0 / np.sqrt(value)) @ vector.T, metric
    return scale, "normalized"


def direct_reach(points: Float64Array, viewpoint: Float64Array, y: Float64Array) -> BoolArray:
    """(V,) mask of the points P0 reaches directly: the nearest in each sector of azimuth."""
    reached = np.zeros(len(points), bool)
    if len(points) == 0:
        return reached
    azimuth_rad = np.arctan2(points[:, 1] - viewpoint[1], points[:, 0] - viewpoint[0])
    # Sectors start at the azimuth of the mean point, so that they rotate with the points.
    mean = points.mean(axis=0) - viewpoint
    relative = azimuth_rad - np.arctan2(mean[1], mean[0])
    sector = np.floor((relative / (2 * np.pi) % 1.0) * SECTORS).astype(np.int64)
    nearest = _nearest_of_each(sector, np.einsum("ij,ij->i", y, y), SECTORS)
    reached[nearest[nearest >= 0]] = True
    return reached


def flow_paths(
    y: Float64Array, neighbours: IntArray, reached: BoolArray
) -> tuple[Float64Array, IntArray]:
    """Shortest paths from P0 (the origin of y) through the points: D', and the node before each.

    Edges join each point to its neighbours, in both directions; their lengths are D. P0 is joined
    to the points in `reached`. Of a group of points that no path leads to, P0 is joined to the
    nearest.

    Parameters
    ----------
    y : (V, 3) float64 array
    neighbours : (V, K) int64 array
    reached : (V,) bool array

    Returns
    -------
    distance : (V,) float64 array
        D'.
    parent : (V,) int64 array
        The node before each node; -1 where P0 is. Of several paths of one length it is the node
        with the least D', then with the smallest number.
    """
    starts, columns = neighbour_rows(neighbours)
    return shortest_paths(y, starts, columns, np.flatnonzero(reached), True)


def cohesion_force(y: Float64Array, neighbours: IntArray, scale: float) -> Float64Array:
    """Cohesion (Eq. 3): a force of size alpha D towards the mean of the neighbours."""
    if neighbours.shape[1] == 0:
        return np.zeros_like(y)
    force = np.empty_like(y)
    _pull(np.ascontiguousarray(y), neighbours, scale, force)
    return force


def repulsion_force(
    y: Float64Array,
    distance: Float64Array,
    parent: IntArray,
    scale: float,
    radius: float | None,
) -> Float64Array:
    """Repulsion (Eq. 6): beta (1/D' - 1/R) / D'^2 along the gradient of D', zero beyond R.

    `scale` is beta in units of R^4, so that the force scales with the scene. It is lowered where
    it would move the nearest point past the ones behind it, so that the order along the flow is
    kept. `radius` is R; None is the median D'.
    """
    if len(y) == 0:
        return np.zeros_like(y)
    radius = float(np.median(distance)) if radius is None else radius
    rho = distance / radius if radius > 0 else np.ones_like(distance)
    step, length = np.empty(y.shape), np.empty(len(y))
    _last_steps(np.ascontiguousarray(y), parent, step, length)
    inside = (rho < 1.0) & (rho > 0.0) & (length > 0.0)
    if not inside.any():
        return np.zeros_like(y)
    r = rho[inside]
    # rho + beta (rho^-3 - rho^-2) increases everywhere if it increases at the smallest rho.
    steepest = float((3 * r**-4 - 2 * r**-3).max())
    beta = min(scale, 0.5 / steepest)
    share = np.zeros(len(y))  # the size of the force, in lengths of the step
    share[inside] = beta * (1.0 / r - 1.0) / r**2 * radius / length[inside]
    return np.asarray(share[:, None] * step)


def chart_coordinates(
    points: Float64Array, moved_m: Float64Array, viewpoint: Float64Array, chart: str
) -> Float64Array:
    """Project the displaced points to two coordinates, keeping their azimuth as seen from P0.

    Parameters
    ----------
    points, moved_m : (V, 3) float64 arrays
        Nodes, and their displacement by the forces, metres.
    viewpoint : (3,) float64 array
    chart : {"ground", "angles", "polar"}
        ``ground``: x and y relative to P0, metres. ``angles``: azimuth and elevation seen from
        P0, radians (no displacement changes them). ``polar``: azimuth and the logarithm of ground
        range. The projections with an azimuth are cut behind the viewpoint, at azimuth pi.

    Returns
    -------
    (V, 2) float64 array
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


@kernel
def _nearest_of_each(group: IntArray, square: Float64Array, groups: int) -> IntArray:
    """The row of the least number in each group, the lowest of several; -1 for an empty group."""
    nearest = np.full(groups + 1, -1, np.int64)  # an angle of -0 may be rounded up to a whole turn
    for k in range(len(group)):
        best = nearest[group[k]]
        if best < 0 or square[k] < square[best]:
            nearest[group[k]] = k
    return nearest


@kernel
def _last_steps(
    y: Float64Array, parent: IntArray, step: Float64Array, length: Float64Array
) -> None:
    """Write the last step of the path to each point, from its parent or from P0, and its length."""
    for i in range(len(y)):
        x0 = y0 = z0 = 0.0
        if parent[i] >= 0:
            x0, y0, z0 = y[parent[i]]
        dx, dy, dz = y[i, 0] - x0, y[i, 1] - y0, y[i, 2] - z0
        step[i, 0], step[i, 1], step[i, 2] = dx, dy, dz
        length[i] = np.sqrt(dx * dx + dy * dy + dz * dz)


@kernel
def _pull(y: Float64Array, neighbours: IntArray, scale: float, force: Float64Array) -> None:
    """Write the force towards the mean of the neighbours."""
    rows, count = neighbours.shape
    for i in range(rows):
        for axis in range(3):
            total = 0.0
            for k in range(count):
                total += y[neighbours[i, k], axis]
            force[i, axis] = scale * (total / count - y[i, axis])
