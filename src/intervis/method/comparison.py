"""The two methods that the paper compares with (Sec. 4, Table 4): global and interpolation points.

Both draw a sight line from the meta-viewpoint P0 to each point and compare elevations along it.
Global points compares every raw point with every line. Interpolation points walks along each line
over the triangulated returns in view and compares at every edge of the mesh that the line crosses.
Neither method defines a mesh or a graph. Where a measure needs one (TPI counts edges), it is the
Delaunay mesh of the same points over the ground plane, and an edge is intervisible when the sight
lines to both of its ends are clear.
"""

from __future__ import annotations

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
    checked_extrinsics,
    field_of_view,
    meta_viewpoint,
)
from intervis.method.criteria import NOT_REACHED, ROOT, intervisible_region
from intervis.method.line_buffer import obstacles_in_buffer
from intervis.method.measures import measure
from intervis.method.mesh import Mesh
from intervis.method.tin_walk import build_tin, obstacles_on_tin
from intervis.settings import Settings

BUFFER_M = 0.1
"""Half width of the line buffer. Beams 0.17 degrees apart are 0.2 m apart at 65 m: up to there a
buffer that crosses a surface holds returns of it."""

TARGET_MARGIN_M = 0.5
"""Nearer to the target than this nothing is compared, so that a surface does not occlude itself."""


@dataclass(frozen=True, eq=False, repr=False)
class SightLines(Analysis):
    """Result of a method that compares sight lines: an `Analysis`, and the comparisons behind it.

    The surface of such a method is flat (``chart`` is x and y relative to P0), P0 reaches every
    node directly (D' is the ground distance), and the tree has no branches: ``tree_parent`` is -1
    for a node whose sight line is clear and -2 for any other.

    Attributes
    ----------
    method : {"global points", "interpolation points"}
    obstacles : (V,) int64 array
        Raw points, or interpolated positions, above the sight line to each node.
    comparisons : int
        Comparisons of elevation. Every line is compared to its end, also after an obstacle.
    """

    method: str
    obstacles: IntArray
    comparisons: int

    @property
    def lines_clear(self) -> float:
        """Share of the sight lines without an obstacle, per cent."""
        return 100.0 * float(np.mean(self.obstacles == 0))


def global_points(
    points: ArrayLike,
    *,
    camera: Camera | None = None,
    cam_from_velo: ArrayLike | None = None,
    viewpoint: ArrayLike | None = None,
    buffer_m: float = BUFFER_M,
    target_margin_m: float = TARGET_MARGIN_M,
) -> SightLines:
    """One sight line to each raw point, compared with all raw points.

    A raw point occludes a target when, over the ground, it lies less than `buffer_m` beside the
    line and at least `target_margin_m` before the target, and is higher than the line there. Every
    raw point is compared with every line: n_raw squared comparisons, in single precision.

    Parameters
    ----------
    points : (N, 3) or (N, 4) float array
        Raw scan, sensor frame (x forward, y left, z up), metres; rows that are no return
        are left out.
    camera, cam_from_velo : Camera and (4, 4) array, or None
        The camera whose centre is the default viewpoint. Its field of view is not used.
    viewpoint : (3,) array or None
        P0, sensor frame, metres; None is the camera's centre (without a camera, the sensor).
    buffer_m, target_margin_m : float
        Metres.

    Returns
    -------
    SightLines
        Its nodes are all returns, so n = n_fov = n_raw and ARR = 0.

    Raises
    ------
    PointsError
        `points` or `viewpoint` are malformed, or no row is a return.
    PoseError, CameraError
        As `intervis.analyze`.
    SettingsError
        `buffer_m` is not positive, or `target_margin_m` is negative.

    Examples
    --------
    A point 1 m above the sensor occludes the point behind it, and not the point 3 m beside that.

    >>> scan = np.array([[5.0, 0, 1.0], [10, 0, 0.0], [10, 3, 0.0]])
    >>> global_points(scan).obstacles
    array([0, 1, 0])
    """
    raw = checked_points(points)
    _check_lengths(buffer_m, target_margin_m)
    extrinsics = checked_extrinsics(camera, cam_from_velo)
    clock = Clock()
    nodes = field_of_view(raw, None, None, "circle").index
    origin = meta_viewpoint(viewpoint, camera, extrinsics)
    position = raw[nodes].astype(np.float64)
    clock.lap("fov")
    clock.lap("sampling")
    ground = np.ascontiguousarray((position - origin)[:, :2])
    clock.lap("S1")
    mesh = build_tin(ground).mesh
    clock.lap("S2")
    obstacles = obstacles_in_buffer(position - origin, buffer_m, target_margin_m)
    return _result("global points", raw, origin, nodes, mesh, obstacles, len(nodes) ** 2, clock)


def interpolation_points(
    points: ArrayLike,
    *,
    camera: Camera | None = None,
    cam_from_velo: ArrayLike | None = None,
    viewpoint: ArrayLike | None = None,
    settings: Settings | None = None,
    target_margin_m: float = TARGET_MARGIN_M,
) -> SightLines:
    """One sight line to each return in view, compared with the surface between all of them.

    The returns in view are triangulated over the ground plane. A sight line is followed over that
    surface from the target to P0. At every edge of the mesh that it crosses, the surface's
    elevation is interpolated on the edge and compared with the line's. Between the edge of the
    surface and P0 (the nearest returns are metres away) nothing is compared.

    Parameters
    ----------
    points, camera, cam_from_velo, viewpoint
        As for `intervis.analyze`.
    settings : Settings or None
        Only ``view`` is used.
    target_margin_m : float
        Crossings nearer to the target than this, over the ground, are not compared; metres.

    Raises
    ------
    PointsError, PoseError, CameraError
        As `intervis.analyze`.
    SettingsError
        `target_margin_m` is negative.

    Examples
    --------
    A wall on flat ground occludes the ground behind it.

    >>> x, y = (axis.ravel() for axis in np.meshgrid(np.arange(4.0, 21), np.arange(-5.0, 6)))
    >>> scan = np.column_stack([x, y, np.where(x == 10, 1.0, -1.7)])
    >>> result = interpolation_points(scan)
    >>> bool(result.node_intervisible[x < 10].all()), bool(result.node_intervisible[x > 12].any())
    (True, False)
    """
    settings = Settings() if settings is None else settings
    raw = checked_points(points)
    _check_lengths(BUFFER_M, target_margin_m)
    extrinsics = checked_extrinsics(camera, cam_from_velo)
    clock = Clock()
    in_view = field_of_view(raw, camera, extrinsics, settings.view).index
    origin = meta_viewpoint(viewpoint, camera, extrinsics)
    position = raw[in_view].astype(np.float64)
    clock.lap("fov")
    clock.lap("sampling")
    ground = np.ascontiguousarray((position - origin)[:, :2])
    clock.lap("S1")
    tin = build_tin(ground)
    clock.lap("S2")
    obstacles, crossings = obstacles_on_tin(position - origin, tin, target_margin_m)
    return _result(
        "interpolation points",
        raw,
        origin,
        in_view,
        tin.mesh,
        obstacles,
        int(crossings.sum()),
        clock,
    )


def _check_lengths(buffer_m: float, target_margin_m: float) -> None:
    if not (np.isfinite(buffer_m) and buffer_m > 0):
        raise SettingsError(f"buffer_m must be more than 0 metres, got {buffer_m}.")
    if not (np.isfinite(target_margin_m) and target_margin_m >= 0):
        raise SettingsError(f"target_margin_m must be 0 metres or more, got {target_margin_m}.")


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
    """The result as an `Analysis`, so that it has the measures of the paper's own method."""
    position = raw[nodes].astype(np.float64)
    ground = (position - origin)[:, :2]
    clear: BoolArray = obstacles == 0
    edge: BoolArray = clear[mesh.edges[:, 0]] & clear[mesh.edges[:, 1]]
    length = np.linalg.norm(ground[mesh.edges[:, 0]] - ground[mesh.edges[:, 1]], axis=1)
    region = intervisible_region(mesh.triangles, mesh.sides, clear, edge)
    cut = graph.cut(mesh.edges, length, clear)
    clock.lap("S3")
    n_raw = field_of_view(raw, None, None, "circle").n_raw
    return SightLines(
        settings=Settings(tau=1, metric="ground", chart="ground", criterion="sight_angle"),
        viewpoint=origin,
        in_view=nodes,
        nodes=nodes,
        node_points=position,
        metric="ground",
        chart=ground,
        flow_distance=np.linalg.norm(ground, axis=1),
        edges=mesh.edges,
        edge_length=length,
        edge_weight=length,
        triangles=mesh.triangles,
        node_intervisible=clear,
        edge_intervisible=edge,
        region=region,
        handed_over=np.zeros(len(nodes), bool),
        tree_parent=np.where(clear, ROOT, NOT_REACHED),
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
