"""The two methods that the paper compares with (Sec. 4, Table 4): global and interpolation points.

Both draw one sight line from the meta-viewpoint P0 to each point and compare elevations along it.
Global points holds every raw point against every line; interpolation points walks each line over
the triangulated surface of what is in view and compares at every edge of the mesh that the line
crosses. Neither has a surface, a gate or a graph of its own: where a result needs one (TPI counts
edges of a mesh), it is the Delaunay mesh of the same points over the ground plane, and an edge is
intervisible when the sight lines to both of its ends are clear.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from intervis.arrays import (
    BoolArray,
    Float32Array,
    Float64Array,
    IntArray,
    checked_points,
    finite_rows,
)
from intervis.camera import Camera
from intervis.errors import PointsError, SettingsError
from intervis.kernels import in_parts, kernel
from intervis.method import graph
from intervis.method.analysis import (
    Analysis,
    Clock,
    checked_mount,
    field_of_view,
    meta_viewpoint,
)
from intervis.method.criteria import NOT_REACHED, ROOT, intervisible_region
from intervis.method.measures import measure
from intervis.method.mesh import Mesh, build_mesh
from intervis.settings import Settings

CORRIDOR_M = 0.1
"""A raw point this near a line, measured over the ground, is near: beams 0.17 degrees apart leave
no hole in a corridor of this half width nearer than 65 m."""

GAP_M = 0.5
"""The last stretch of a line is not judged: a surface does not hide itself."""

TILE = 4096
"""Raw points held against a part of the lines at once: 48 KiB, which stay in a near cache."""


@dataclass(frozen=True, eq=False)
class SightLines(Analysis):
    """What a method of sight lines says: an `Analysis`, and the lines that it rests on.

    The surface of such a method is flat (its chart is x and y relative to P0), P0 reaches every
    node directly (D' is the ground distance), and the tree has no branches: ``tree_parent`` is -1
    for each node seen and -2 for each other.

    Attributes
    ----------
    method : {"global points", "interpolation points"}
    obstacles : (V,) int64 array
        Raw points, or interpolated positions, that stand over the sight line to each node.
    comparisons : int
        Elevation comparisons made: all of them, no line is left early.
    """

    method: str
    obstacles: IntArray
    comparisons: int

    @property
    def lines_clear(self) -> float:
        """Share of the sight lines that nothing stands over, per cent."""
        return 100.0 * float(np.mean(self.obstacles == 0))


def global_points(
    points: ArrayLike,
    *,
    camera: Camera | None = None,
    cam_from_velo: ArrayLike | None = None,
    viewpoint: ArrayLike | None = None,
    corridor_m: float = CORRIDOR_M,
    gap_m: float = GAP_M,
) -> SightLines:
    """One sight line to each raw point, judged against all raw points near it.

    A raw point hides a target when, over the ground, it lies less than `corridor_m` beside the
    line, before the line's last `gap_m`, and is higher than the line there. Every raw point is
    tested against every line, n_raw squared tests, in single precision.

    Parameters
    ----------
    points : (N, 3) or (N, 4) float array
        Raw scan, sensor frame (x forward, y left, z up), metres; non-finite rows are left out.
    camera, cam_from_velo : Camera and (4, 4) array, or None
        The camera whose centre is the default viewpoint. Nothing is cut away by its view.
    viewpoint : (3,) array or None
        P0, sensor frame, metres; None is the camera's centre (without a camera, the sensor).
    corridor_m, gap_m : float
        Metres.

    Returns
    -------
    SightLines
        Its nodes are all finite returns, so n = n_fov = n_raw and ARR = 0.

    Raises
    ------
    PointsError
        `points` or `viewpoint` are malformed, or no row is finite.
    SettingsError
        `corridor_m` is not positive, or `gap_m` is negative.

    Examples
    --------
    A post 2 m high hides what stands behind it, and not what stands beside.

    >>> scan = np.array([[5.0, 0, 1.0], [10, 0, 0.0], [10, 3, 0.0]])
    >>> global_points(scan).obstacles
    array([0, 1, 0])
    """
    raw = checked_points(points)
    _check_widths(corridor_m, gap_m)
    mount = checked_mount(camera, cam_from_velo)
    clock = Clock()
    nodes = np.flatnonzero(finite_rows(raw))
    if len(nodes) == 0:
        raise PointsError(f"none of the {len(raw)} points is finite: there is nothing to look at.")
    origin = meta_viewpoint(viewpoint, camera, mount)
    position = raw[nodes].astype(np.float64)
    clock.lap("fov")
    clock.lap("sampling")
    chart = np.ascontiguousarray((position - origin)[:, :2])
    clock.lap("S1")
    mesh = build_mesh(chart)
    clock.lap("S2")
    obstacles = _obstacles_among_all(position - origin, corridor_m, gap_m)
    return _result("global points", raw, origin, nodes, mesh, obstacles, len(nodes) ** 2, clock)


def interpolation_points(
    points: ArrayLike,
    *,
    camera: Camera | None = None,
    cam_from_velo: ArrayLike | None = None,
    viewpoint: ArrayLike | None = None,
    settings: Settings | None = None,
    gap_m: float = GAP_M,
) -> SightLines:
    """One sight line to each return in view, compared with the surface between all of them.

    The returns in view are triangulated over the ground plane. A sight line is followed over that
    surface from the target to P0; at every edge of the mesh that it crosses, the surface's
    elevation is interpolated on the edge and compared with the line's. Where the surface ends
    before P0 does (the nearest returns lie metres away), nothing stands in between.

    Parameters
    ----------
    points, camera, cam_from_velo, viewpoint
        As for `intervis.analyze`.
    settings : Settings or None
        Only ``view`` counts.
    gap_m : float
        The last stretch of a line that is not judged, metres.

    Raises
    ------
    PointsError, PoseError, CameraError
        As `intervis.analyze`.
    SettingsError
        `gap_m` is negative.

    Examples
    --------
    A wall over flat ground hides the ground behind it.

    >>> x, y = (axis.ravel() for axis in np.meshgrid(np.arange(4.0, 21), np.arange(-5.0, 6)))
    >>> scan = np.column_stack([x, y, np.where(x == 10, 1.0, -1.7)])
    >>> result = interpolation_points(scan)
    >>> bool(result.node_intervisible[x < 10].all()), bool(result.node_intervisible[x > 12].any())
    (True, False)
    """
    settings = Settings() if settings is None else settings
    raw = checked_points(points)
    _check_widths(CORRIDOR_M, gap_m)
    mount = checked_mount(camera, cam_from_velo)
    clock = Clock()
    in_view = field_of_view(raw, camera, mount, settings.view).index
    origin = meta_viewpoint(viewpoint, camera, mount)
    position = raw[in_view].astype(np.float64)
    clock.lap("fov")
    clock.lap("sampling")
    chart = np.ascontiguousarray((position - origin)[:, :2])
    clock.lap("S1")
    mesh = build_mesh(chart)
    clock.lap("S2")
    obstacles, crossings = _obstacles_on_surface(position - origin, mesh, gap_m)
    return _result(
        "interpolation points",
        raw,
        origin,
        in_view,
        mesh,
        obstacles,
        int(crossings.sum()),
        clock,
    )


def _check_widths(corridor_m: float, gap_m: float) -> None:
    if not (np.isfinite(corridor_m) and corridor_m > 0):
        raise SettingsError(f"corridor_m must be more than 0 metres, got {corridor_m}.")
    if not (np.isfinite(gap_m) and gap_m >= 0):
        raise SettingsError(f"gap_m must be 0 metres or more, got {gap_m}.")


def _result(
    method: str,
    raw: NDArray[np.floating],
    origin: Float64Array,
    nodes: IntArray,
    mesh: Mesh,
    obstacles: IntArray,
    comparisons: int,
    clock: Clock,
) -> SightLines:
    """The result of sight lines in the shape of the paper's own method."""
    position = raw[nodes].astype(np.float64)
    chart = (position - origin)[:, :2]
    seen: BoolArray = obstacles == 0
    edge: BoolArray = seen[mesh.edges[:, 0]] & seen[mesh.edges[:, 1]]
    length = np.linalg.norm(chart[mesh.edges[:, 0]] - chart[mesh.edges[:, 1]], axis=1)
    region = intervisible_region(mesh.triangles, mesh.edges, seen, edge)
    cut = graph.cut(mesh.edges, length, seen)
    clock.lap("S3")
    n_raw = int(finite_rows(raw).sum())
    return SightLines(
        settings=Settings(tau=1, metric="ground", chart="ground", criterion="sight_angle"),
        viewpoint=origin,
        in_view=nodes,
        nodes=nodes,
        node_points=position,
        metric="ground",
        chart=chart,
        flow_distance=np.linalg.norm(chart, axis=1),
        edges=mesh.edges,
        edge_length=length,
        edge_weight=length,
        triangles=mesh.triangles,
        node_intervisible=seen,
        edge_intervisible=edge,
        region=region,
        handed_over=np.zeros(len(nodes), bool),
        tree_parent=np.where(seen, ROOT, NOT_REACHED),
        cut=cut,
        measures=measure(
            n_raw=n_raw,
            n_dropped=len(raw) - n_raw,
            n_fov=len(nodes),
            n=len(nodes),
            elements=len(mesh.triangles),
            edges=len(mesh.edges),
            intervisible=int(edge.sum()),
        ),
        times=clock.times(),
        method=method,
        obstacles=obstacles,
        comparisons=comparisons,
    )


def _obstacles_among_all(offset: Float64Array, corridor_m: float, gap_m: float) -> IntArray:
    """(V,) how many of the V points stand over the sight line to each of them."""
    x, y, z = (np.ascontiguousarray(column, dtype=np.float32) for column in offset.T)
    reach = np.hypot(offset[:, 0], offset[:, 1])
    over_0 = np.divide(1.0, reach, out=np.zeros_like(reach), where=reach > 0)
    ux, uy, slope = ((offset[:, k] * over_0).astype(np.float32) for k in range(3))
    # A touch shorter than the line: in single precision no target stands over its own line.
    judged = (reach * (1.0 - 1e-6) - gap_m).astype(np.float32)
    obstacles = np.zeros(len(offset), np.int64)
    half_width = np.float32(corridor_m)

    def work(start: int, stop: int) -> None:
        _count_over(x, y, z, ux, uy, slope, judged, half_width, start, stop, obstacles)

    in_parts(work, len(offset), least=256)
    return obstacles


@kernel
def _count_over(
    x: Float32Array,
    y: Float32Array,
    z: Float32Array,
    ux: Float32Array,
    uy: Float32Array,
    slope: Float32Array,
    judged: Float32Array,
    half_width: np.float32,
    start: int,
    stop: int,
    obstacles: IntArray,
) -> None:
    """Hold every point against the lines [start, stop).

    A point stands over a line when its least margin is positive: inside the corridor, after P0,
    before the gap, above the line. One minimum and no branch keep the loop on vector units.
    """
    for tile in range(0, x.shape[0], TILE):
        tile_x = x[tile : tile + TILE]
        tile_y = y[tile : tile + TILE]
        tile_z = z[tile : tile + TILE]
        for i in range(start, stop):
            line_x, line_y, line_slope, line_judged = ux[i], uy[i], slope[i], judged[i]
            count = np.int32(0)
            for k in range(tile_x.shape[0]):
                along = line_x * tile_x[k] + line_y * tile_y[k]
                beside = half_width - abs(line_x * tile_y[k] - line_y * tile_x[k])
                between = min(along, line_judged - along)
                above = tile_z[k] - line_slope * along
                margin = min(min(beside, between), above)
                count += np.int32(1) if margin > np.float32(0) else np.int32(0)
            obstacles[i] += count


def _obstacles_on_surface(
    offset: Float64Array, mesh: Mesh, gap_m: float
) -> tuple[IntArray, IntArray]:
    """(V,) crossings above each sight line, and crossings in all."""
    obstacles = np.zeros(len(offset), np.int64)
    crossings = np.zeros(len(offset), np.int64)
    if len(mesh.triangles) == 0:
        return obstacles, crossings
    across = _neighbours_across(mesh.triangles, len(offset))
    corners, first = _corners_of_nodes(mesh.triangles, offset)

    def work(start: int, stop: int) -> None:
        _walk(
            offset, mesh.triangles, across, corners, first, gap_m, start, stop, obstacles, crossings
        )

    in_parts(work, len(offset), least=256)
    return obstacles, crossings


def _neighbours_across(triangles: IntArray, nodes: int) -> IntArray:
    """(F, 3) half edge that lies on the other side of each triangle's edge k to k + 1, or -1.

    Half edge 3 f + k leads from corner k of triangle f to its next corner.
    """
    start, stop = triangles, np.roll(triangles, -1, axis=1)
    key = (np.minimum(start, stop) * nodes + np.maximum(start, stop)).ravel()
    order = np.argsort(key, kind="stable")
    pair = np.flatnonzero(key[order[:-1]] == key[order[1:]])
    across = np.full(len(key), -1)
    across[order[pair]] = order[pair + 1]
    across[order[pair + 1]] = order[pair]
    return across.reshape(-1, 3)


def _corners_of_nodes(triangles: IntArray, offset: Float64Array) -> tuple[IntArray, IntArray]:
    """Corners 3 f + k where each node sits: corners[first[i]:first[i + 1]] for node i.

    A node that the mesh left out as a copy of another position takes the corners of that one.
    """
    nodes = len(offset)
    corner = np.argsort(triangles.ravel(), kind="stable")
    first = np.searchsorted(triangles.ravel()[corner], np.arange(nodes + 1))
    bare = np.flatnonzero(first[1:] == first[:-1])
    if len(bare) == 0:
        return corner, first
    same = np.unique(offset[:, :2], axis=0, return_inverse=True)[1].ravel()
    stand_in = np.arange(nodes)
    held = np.setdiff1d(np.arange(nodes), bare)
    of_position = np.full(same.max() + 1, -1)
    of_position[same[held]] = held
    found = of_position[same[bare]]
    stand_in[bare] = np.where(found >= 0, found, bare)
    counts = (first[1:] - first[:-1])[stand_in]
    starts = np.concatenate([[0], np.cumsum(counts)])
    flat = np.repeat(first[stand_in] - starts[:-1], counts) + np.arange(starts[-1])
    return corner[flat], starts


@kernel
def _walk(
    offset: Float64Array,
    triangles: IntArray,
    across: IntArray,
    corners: IntArray,
    first: IntArray,
    gap_m: float,
    start: int,
    stop: int,
    obstacles: IntArray,
    crossings: IntArray,
) -> None:
    """Follow the lines from the targets [start, stop) to P0, the origin, from edge to edge."""
    for i in range(start, stop):
        x, y, z = offset[i]
        reach = np.hypot(x, y)
        half_edge = _first_crossed(offset, triangles, corners, first, i)
        for _ in range(triangles.shape[0]):
            if half_edge < 0:
                break
            a = triangles[half_edge // 3, half_edge % 3]
            b = triangles[half_edge // 3, (half_edge + 1) % 3]
            side_a = _side(offset, i, a)
            share = side_a / (side_a - _side(offset, i, b))
            cross_x = offset[a, 0] + share * (offset[b, 0] - offset[a, 0])
            cross_y = offset[a, 1] + share * (offset[b, 1] - offset[a, 1])
            cross_z = offset[a, 2] + share * (offset[b, 2] - offset[a, 2])
            left = (cross_x * x + cross_y * y) / (reach * reach)  # 1 at the target, 0 at P0
            if left <= 0.0:
                break
            if (1.0 - left) * reach > gap_m:
                crossings[i] += 1
                if cross_z > left * z:
                    obstacles[i] += 1
            twin = across[half_edge // 3, half_edge % 3]
            if twin < 0:
                break
            # The triangle beyond: the line leaves it on the side that its third corner is not on.
            triangle = twin // 3
            third = (twin + 2) % 3
            if _side(offset, i, triangles[triangle, third]) > 0.0:
                half_edge = 3 * triangle + (twin + 1) % 3
            else:
                half_edge = 3 * triangle + third


@kernel
def _first_crossed(
    offset: Float64Array, triangles: IntArray, corners: IntArray, first: IntArray, i: int
) -> np.int64:
    """The edge opposite to node i in the triangle of its star that the line to P0 enters, or -1."""
    if offset[i, 0] == 0.0 and offset[i, 1] == 0.0:
        return np.int64(-1)
    for c in range(first[i], first[i + 1]):
        triangle, k = corners[c] // 3, corners[c] % 3
        a = triangles[triangle, (k + 1) % 3]
        b = triangles[triangle, (k + 2) % 3]
        if _side(offset, i, a) <= 0.0 and _side(offset, i, b) > 0.0:
            return np.int64(3 * triangle + (k + 1) % 3)
    return np.int64(-1)


@kernel
def _side(offset: Float64Array, i: int, j: int) -> np.float64:
    """Positive where j lies to the left of the line from node i to P0."""
    to_x, to_y = offset[j, 0] - offset[i, 0], offset[j, 1] - offset[i, 1]
    return np.float64(offset[i, 1] * to_x - offset[i, 0] * to_y)
