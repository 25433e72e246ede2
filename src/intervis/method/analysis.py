"""The whole method on one screen: from a raw scan to the intervisible region."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from time import perf_counter

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array

from intervis.arguments import function_of, object_of
from intervis.arrays import (
    BoolArray,
    Float64Array,
    FloatArray,
    IntArray,
    checked_place,
    checked_points,
)
from intervis.camera import Camera, default_viewpoint
from intervis.errors import CameraError, PointsError
from intervis.method import graph
from intervis.method.criteria import apply_criteria, intervisible_region, reachable_tree
from intervis.method.field_of_view import AZIMUTH_FOV_DEG, FieldOfView, in_azimuth, in_camera, taken
from intervis.method.granularity import choose_tau
from intervis.method.measures import Measures, Record, measure
from intervis.method.mesh import build_mesh, edge_lengths, star_centroids
from intervis.method.sampling import sample_kernels, sample_radius, sample_stride
from intervis.method.surface import build_surface
from intervis.result_table import result_table, share
from intervis.settings import Settings
from intervis.transform import checked_pose


@dataclass(frozen=True, eq=False)
class StageTimes(Record):
    """Seconds that each stage took, a mapping as well; S1, S2 and S3 are the paper's (Table 3).

    Attributes
    ----------
    fov, sampling : float
        Field of view; sampling.
    S1, S2, S3 : float
        Manifold auxiliary surface; finite elements; spectral analysis and criteria.
    total : float
        The sum: raw scan to region.
    """

    fov: float
    sampling: float
    S1: float
    S2: float
    S3: float
    total: float


@dataclass(frozen=True, eq=False, repr=False)
class Analysis:
    """Intervisibility of one scan: what `analyze` returns. V nodes, E edges, F triangles.

    Attributes
    ----------
    settings : Settings
    viewpoint : (3,) float64 array
        The meta-viewpoint P0, sensor frame, metres.
    in_view : (n_fov,) int64 array
        Rows of the raw scan in the field of view.
    nodes : (V,) int64 array
        Rows of the raw scan that are nodes.
    node_points : (V, 3) float64 array
        Their coordinates, sensor frame, metres.
    metric : str
        The metric in force: ``settings.metric``, or "normalized" for a singular covariance.
    chart : (V, 2) float64 array
        Coordinates of the nodes in the projection in which the mesh is built.
    flow_distance : (V,) float64 array
        D', the length of the shortest path from P0 through the nodes.
    edges : (E, 2) int64 array
        Indices into nodes, smaller one first.
    edge_length : (E,) float64 array
        D between an edge's ends.
    edge_weight : (E,) float64 array
        Weight of each edge in the Laplacian.
    triangles : (F, 3) int64 array
        Indices into nodes.
    node_intervisible, edge_intervisible, region : (V,), (E,), (F,) bool arrays
        Intervisibility points and edges, and the triangles of the intervisible region.
    handed_over : (V,) bool array
        Nodes on a concave boundary (Algorithm 1, lines 2 to 4).
    tree_parent : (V,) int64 array
        The tree of shortest paths from P0 along intervisible edges: the node before each node, -1
        for one that P0 reaches directly, -2 for one that the tree does not reach.
    cut : float
        The decomposition SD (Eq. 12) of the intervisibility points and the rest.
    measures : Measures
    times : StageTimes
    """

    settings: Settings
    viewpoint: Float64Array
    in_view: IntArray
    nodes: IntArray
    node_points: Float64Array
    metric: str
    chart: Float64Array
    flow_distance: Float64Array
    edges: IntArray
    edge_length: Float64Array
    edge_weight: Float64Array
    triangles: IntArray
    node_intervisible: BoolArray
    edge_intervisible: BoolArray
    region: BoolArray
    handed_over: BoolArray
    tree_parent: IntArray
    cut: float
    measures: Measures
    times: StageTimes

    def __repr__(self) -> str:
        return (
            f"<{type(self).__name__}: {len(self.nodes)} nodes, {len(self.edges)} edges,"
            f" {len(self.triangles)} triangles, TPI {self.measures.TPI:.1f} %>"
        )

    def _repr_html_(self) -> str:
        """The paper's counts and measures, as a notebook shows them."""
        rows = {
            "returns in view": f"{len(self.in_view):,}",
            "nodes": f"{len(self.nodes):,}",
            "intervisible nodes": share(int(self.node_intervisible.sum()), len(self.nodes)),
            "intervisible edges": share(int(self.edge_intervisible.sum()), len(self.edges)),
            "triangles of the region": share(int(self.region.sum()), len(self.triangles)),
            **{name: f"{self.measures[name]:.2f} %" for name in ("ARR", "TPI", "DCP")},
            "time": f"{1e3 * self.times.total:.1f} ms",
        }
        return result_table("Intervisibility of one scan", rows)

    @cached_property
    def adjacency(self) -> csr_array:
        """(V, V) sparse adjacency matrix A."""
        return graph.adjacency(self.edges, self.edge_weight, len(self.nodes))

    @property
    def laplacian(self) -> csr_array:
        """(V, V) sparse Laplacian L = D - A (Eq. 9)."""
        return graph.laplacian(self.adjacency)

    @property
    def normalized_laplacian(self) -> csr_array:
        """(V, V) sparse normalised Laplacian (Eq. 10)."""
        return graph.normalized_laplacian(self.adjacency)

    def fiedler_cut(self) -> float:
        """SD (Eq. 12) of the cut by the signs of the Fiedler vector, for comparison with `cut`."""
        return graph.cut(self.edges, self.edge_weight, graph.fiedler_side(self.adjacency))


def analyze(
    points: ArrayLike,
    *,
    camera: Camera | None = None,
    cam_from_velo: ArrayLike | None = None,
    viewpoint: ArrayLike | None = None,
    settings: Settings | None = None,
    tau_for: Callable[[int], int] | None = None,
) -> Analysis:
    """Intervisibility points, edges and region of one scan (Bai, Li and Cen 2021, Sec. 2).

    The region is the paper's, not what the viewpoint sees: its nodes are visible hardly more often
    than others (`docs/accuracy.md`). `intervis.Scene` answers what is visible.

    Parameters
    ----------
    points : (N, 3) or (N, 4) float array
        Raw scan, sensor frame (x forward, y left, z up), metres. Rows that are no return (NaN,
        infinite, beyond 1e9 m, or 0, 0, 0) are left out and counted.
    camera, cam_from_velo : Camera and (4, 4) array, or None
        The camera whose field of view is analysed, and its extrinsics (sensor to rectified camera
        frame). Without a camera, or with ``settings.view`` other than "camera", it is an azimuth
        field of view centred on the sensor's x axis.
    viewpoint : (3,) array or None
        Meta-viewpoint P0, sensor frame, metres; None is the camera's centre or, without a camera,
        the sensor.
    settings : Settings or None
        None is ``Settings()``.
    tau_for : callable or None
        Gives tau for a number of returns in view, and replaces ``settings.tau``.

    Raises
    ------
    PointsError
        `points` or `viewpoint` are malformed, or no return is in view.
    PoseError, CameraError
        `cam_from_velo` is no rigid motion, or only one of `camera` and `cam_from_velo` is given.

    References
    ----------
    L. Bai, Y. Li, M. Cen, "Dynamic Intervisibility Analysis of 3D Point Clouds", ISPRS Int. J.
    Geo-Inf. 10 (11), 782, 2021. https://doi.org/10.3390/ijgi10110782

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> ground = np.column_stack([rng.uniform(5, 40, (500, 2)), np.full(500, -1.7)])
    >>> result = analyze(ground, settings=Settings(tau=5))
    >>> result.measures.n, result.measures.SP == result.measures.N + result.measures.n - 1
    (100, True)
    """
    settings = object_of(Settings() if settings is None else settings, Settings, "settings")
    function_of(tau_for, "tau_for")
    raw = checked_points(points)
    extrinsics = checked_extrinsics(camera, cam_from_velo)
    clock = Clock()

    # Sec. 2.1: the field of view (Eq. 1, 2), and its sampling by a kernel of granularity tau
    view = field_of_view(raw, camera, extrinsics, settings.view)
    origin = meta_viewpoint(viewpoint, camera, extrinsics)
    in_view = taken(raw, view.index)
    clock.lap("fov")
    if tau_for is not None:
        settings = settings.with_changes(tau=tau_for(len(in_view)))
    sampled = _sample(in_view, origin, settings)
    nodes, position = view.index[sampled], in_view[sampled]
    clock.lap("sampling")

    # Sec. 2.2: the manifold auxiliary surface (Eq. 3 to 8)
    surface = build_surface(position, origin, settings)
    clock.lap("S1")

    # Sec. 2.3: finite elements, and the centroid of each node's subgraph (Eq. 14)
    mesh = build_mesh(surface.chart)
    y = surface.metric_position
    length = edge_lengths(mesh.edges, y)
    to_centroid = np.linalg.norm(y - star_centroids(mesh, y), axis=1)
    clock.lap("S2")

    # Sec. 2.3: MPCS and Algorithm 1 (Eq. 13), region, tree, and the cut SD (Eq. 12)
    result = apply_criteria(
        position,
        origin,
        mesh.edges,
        length,
        surface.flow_distance,
        to_centroid,
        settings,
        returns=in_view,
    )
    region = intervisible_region(mesh.triangles, mesh.sides, result.node, result.edge)
    tree = reachable_tree(
        mesh.edges, y, surface.flow_distance, surface.flow_parent, result.node, result.edge
    )
    weight = length if settings.weights == "length" else np.ones(len(length))
    cut = graph.cut(mesh.edges, weight, result.node)
    clock.lap("S3")

    return Analysis(
        settings=settings,
        viewpoint=origin,
        in_view=view.index,
        nodes=nodes,
        node_points=position,
        metric=surface.metric,
        chart=surface.chart,
        flow_distance=surface.flow_distance,
        edges=mesh.edges,
        edge_length=length,
        edge_weight=weight,
        triangles=mesh.triangles,
        node_intervisible=result.node,
        edge_intervisible=result.edge,
        region=region,
        handed_over=result.handed_over,
        tree_parent=tree,
        cut=cut,
        # Eq. 15 to 17
        measures=measure(
            n_raw=view.n_raw,
            n_dropped=view.n_dropped,
            n_fov=len(view.index),
            n=len(nodes),
            elements=len(mesh.triangles),
            edges=len(mesh.edges),
            intervisible=int(result.edge.sum()),
        ),
        times=clock.times(),
    )


class Clock:
    """Stage times of one run."""

    def __init__(self) -> None:
        self._last = perf_counter()
        self._laps: dict[str, float] = {}

    def lap(self, stage: str) -> None:
        """Record the seconds since the previous lap as the time of this stage."""
        now = perf_counter()
        self._laps[stage] = now - self._last
        self._last = now

    def times(self) -> StageTimes:
        """All laps and their sum."""
        return StageTimes(**self._laps, total=sum(self._laps.values()))


def checked_extrinsics(
    camera: Camera | None, cam_from_velo: ArrayLike | None
) -> Float64Array | None:
    """The camera's extrinsics as a (4, 4) rigid motion; None without a camera.

    Raises
    ------
    CameraError
        Only one of the two is given.
    PoseError
        `cam_from_velo` is no rigid motion.
    """
    if camera is None and cam_from_velo is None:
        return None
    if cam_from_velo is None:
        raise CameraError(
            "a camera needs its extrinsics: pass cam_from_velo, the 4x4 matrix from the sensor's"
            " to the rectified camera's frame."
        )
    if camera is None:
        raise CameraError(
            "cam_from_velo is given without a camera: pass the camera too, or leave both out."
        )
    object_of(camera, Camera, "camera")
    return checked_pose(cam_from_velo, "cam_from_velo")


def field_of_view(
    raw: FloatArray, camera: Camera | None, cam_from_velo: Float64Array | None, view: str
) -> FieldOfView:
    """The returns in the camera's image or in the named azimuth field of view.

    Parameters
    ----------
    raw : (N, 3) float array
        Raw scan, sensor frame, metres.
    camera, cam_from_velo : Camera and (4, 4) float64 array, or None
    view : str
        ``settings.view``. "camera" without a camera is the full circle.

    Raises
    ------
    PointsError
        No return is in view.
    """
    if view == "camera" and camera is not None and cam_from_velo is not None:
        found = in_camera(raw, camera, cam_from_velo)
        where = f"of the camera {camera.name!r}"
    else:
        fov_deg = AZIMUTH_FOV_DEG.get(view, AZIMUTH_FOV_DEG["circle"])
        found = in_azimuth(raw, fov_deg)
        where = f"in the {fov_deg:.0f} degrees around the x axis"
    if len(found.index) == 0:
        raise PointsError(
            f"no return is in view {where}: of {len(raw)} rows {found.n_raw} are returns; check"
            " cam_from_velo and that x points forward, y left and z up."
        )
    return found


def meta_viewpoint(
    viewpoint: ArrayLike | None, camera: Camera | None, cam_from_velo: Float64Array | None
) -> Float64Array:
    """P0: the given viewpoint, else the camera's centre, else the sensor."""
    if viewpoint is not None:
        return checked_place(viewpoint)
    return default_viewpoint(camera, cam_from_velo)


def _sample(in_view: Float64Array, viewpoint: Float64Array, settings: Settings) -> IntArray:
    if settings.sampling == "radius":
        return sample_radius(in_view, settings.radius_m, viewpoint)
    tau = choose_tau(len(in_view), settings) if settings.tau == "auto" else settings.tau
    if settings.sampling == "stride":
        return sample_stride(len(in_view), tau)
    return sample_kernels(in_view, tau, viewpoint)
