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
from scipy.spatial import Delaunay, QhullError

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
from intervis.method.mesh import Mesh, build_mesh, signed_area, unique_edges
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
    mesh = _sheet(chart).mesh
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
    sheet = _sheet(chart)
    clock.lap("S2")
    obstacles, crossings = _obstacles_on_surface(position - origin, sheet, gap_m)
    return _result(
        "interpolation points",
        raw,
        origin,
        in_view,
        sheet.mesh,
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


@dataclass(frozen=True, eq=False)
class _Sheet:
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


def _sheet(chart: Float64Array) -> _Sheet:
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
        return _Sheet(build_mesh(chart), nothing.reshape(0, 3), nothing, first, np.arange(nodes))
    triangles = found.simplices.astype(np.int64)
    area = np.abs(signed_area(chart, triangles))
    corners = np.argsort(triangles.ravel(), kind="stable")
    place = np.arange(nodes)
    copies = found.coplanar.astype(np.int64)
    place[copies[:, 0]] = copies[:, 2]
    return _Sheet(
        mesh=Mesh(triangles, area, unique_edges(triangles, nodes)),
        beyond=found.neighbors.astype(np.int64),
        corners=corners,
        first=np.searchsorted(triangles.ravel()[corners], np.arange(nodes + 1)),
        place=place,
    )


def _obstacles_on_surface(
    offset: Float64Array, sheet: _Sheet, gap_m: float
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
