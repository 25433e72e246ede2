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
    Float64Array,
    IntArray,
    checked_points,
)
from intervis.camera import Camera
from intervis.errors import SettingsError
from intervis.method import graph
from intervis.method.analysis import (
    Analysis,
    Clock,
    checked_mount,
    field_of_view,
    meta_viewpoint,
)
from intervis.method.corridor import obstacles_among_all
from intervis.method.criteria import NOT_REACHED, ROOT, intervisible_region
from intervis.method.measures import measure
from intervis.method.mesh import Mesh
from intervis.method.sheet import build_sheet, obstacles_on_sheet
from intervis.settings import Settings

CORRIDOR_M = 0.1
"""A raw point this near a line, measured over the ground, is near: beams 0.17 degrees apart leave
no hole in a corridor of this half width nearer than 65 m."""

GAP_M = 0.5
"""The last stretch of a line is not judged: a surface does not hide itself."""


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
        Raw scan, sensor frame (x forward, y left, z up), metres; rows that are no return
        are left out.
    camera, cam_from_velo : Camera and (4, 4) array, or None
        The camera whose centre is the default viewpoint. Nothing is cut away by its view.
    viewpoint : (3,) array or None
        P0, sensor frame, metres; None is the camera's centre (without a camera, the sensor).
    corridor_m, gap_m : float
        Metres.

    Returns
    -------
    SightLines
        Its nodes are all returns, so n = n_fov = n_raw and ARR = 0.

    Raises
    ------
    PointsError
        `points` or `viewpoint` are malformed, or no row is a return.
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
    nodes = field_of_view(raw, None, None, "circle").index
    origin = meta_viewpoint(viewpoint, camera, mount)
    position = raw[nodes].astype(np.float64)
    clock.lap("fov")
    clock.lap("sampling")
    chart = np.ascontiguousarray((position - origin)[:, :2])
    clock.lap("S1")
    mesh = build_sheet(chart).mesh
    clock.lap("S2")
    obstacles = obstacles_among_all(position - origin, corridor_m, gap_m)
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
    sheet = build_sheet(chart)
    clock.lap("S2")
    obstacles, crossings = obstacles_on_sheet(position - origin, sheet, gap_m)
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
    n_raw = field_of_view(raw, None, None, "circle").n_raw
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
