"""The choices that the paper's text leaves open, compared by measurement.

Every combination of metric, chart, sampling, gate, concave boundary and criterion runs over real
frames at the ten granularities of Table 2. Two things are measured: the difference of TPI to the
table (on other frames than the paper's, so a few points are expected), and how constant TPI and
region are along a drive.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise, product
from math import ceil
from typing import TYPE_CHECKING, NamedTuple, get_args

import numpy as np

from intervis.arrays import BoolArray, Float64Array, IntArray
from intervis.lab.paper import printed_values
from intervis.lab.paper.temporal_consistency import (
    GroundRegion,
    ground_region,
    mean_known,
    overlap,
    sample_std,
)
from intervis.method.analysis import checked_extrinsics, field_of_view, meta_viewpoint
from intervis.method.criteria import CriterionResult, apply_criteria, intervisible_region
from intervis.method.measures import two_point_intervisibility
from intervis.method.mesh import Mesh, build_mesh, star_centroids
from intervis.method.sampling import sample_kernels, sample_radius, sample_stride
from intervis.method.surface import Surface, build_surface
from intervis.progress import Progress, reporter
from intervis.settings import Chart, Gate, Metric, Sampling, Settings

if TYPE_CHECKING:
    from intervis.drives import Drive, Frame

METRICS: tuple[str, ...] = get_args(Metric)
CHARTS: tuple[str, ...] = get_args(Chart)
SAMPLINGS: tuple[str, ...] = get_args(Sampling)
GATES: tuple[str, ...] = get_args(Gate)
CONCAVE_BOUNDARIES = ("every", "any")
GATE_ONLY = "gate only"
CRITERIA = ("elevation", "sight_angle", "sight_line", GATE_ONLY)
"""What lines 6 and 8 of Algorithm 1 compare; "gate only" applies line 1 and skips lines 2 to 9."""

CONSECUTIVE_FRAMES = 6
"""Frames over which the consistency of an interpretation is measured."""

BISECTIONS = 12
"""Steps to find the radius that gives as many nodes as a granularity."""


class Interpretation(NamedTuple):
    """One way to settle the paper's open choices."""

    metric: str
    chart: str
    sampling: str
    gate: str
    concave_boundary: str
    criterion: str


@dataclass(frozen=True, eq=False)
class InterpretationScore:
    """Measurements of one interpretation.

    Attributes
    ----------
    interpretation : Interpretation
    TPI : (frames, 10) float64 array
        At the granularities of Table 2, for each frame.
    TPI_std : float
        Sample standard deviation of TPI at tau = 35 along the drive, points; NaN without one.
    iou : float
        Mean overlap of the region of consecutive frames at tau = 35; NaN without a drive.
    """

    interpretation: Interpretation
    TPI: Float64Array
    TPI_std: float
    iou: float

    @property
    def difference(self) -> float:
        """Mean absolute difference to Table 2 over all frames and granularities, points."""
        return float(np.abs(self.TPI - _table_2()).mean())

    @property
    def difference_of_mean(self) -> float:
        """Mean absolute difference of the frames' mean TPI to Table 2, points."""
        return float(np.abs(self.TPI.mean(axis=0) - _table_2()).mean())

    @property
    def greatest_of_mean(self) -> float:
        """Greatest absolute difference of the frames' mean TPI to Table 2, points."""
        return float(np.abs(self.TPI.mean(axis=0) - _table_2()).max())


def _table_2() -> Float64Array:
    return np.array([row.TPI for row in printed_values.TABLE_2.values()])


@dataclass(frozen=True, eq=False)
class _Geometry:
    """One frame, sampled, charted and meshed: the input of Algorithm 1."""

    points: Float64Array
    viewpoint: Float64Array
    returns: Float64Array
    mesh: Mesh
    surface: Surface
    length: Float64Array
    to_centroid: Float64Array


def compare_interpretations(
    frames: Sequence["Frame"],
    consecutive: Sequence["Frame"] = (),
    *,
    metrics: Sequence[str] = METRICS,
    charts: Sequence[str] = CHARTS,
    samplings: Sequence[str] = SAMPLINGS,
    progress: Progress | None = None,
) -> list[InterpretationScore]:
    """Measure every interpretation over every frame, nearest to Table 2 first.

    Parameters
    ----------
    frames : sequence of Frame
        Compared with Table 2.
    consecutive : sequence of Frame
        Consecutive frames with poses, for temporal consistency; may be empty.
    metrics, charts, samplings : sequences of str
        The geometries to run: metrics times charts times samplings. Every interpretation of
        Algorithm 1 runs on each.
    progress : callable, optional
        Called after each geometry.
    """
    progress = reporter(progress)
    views = [_View(frame) for frame in frames]
    drive = [_View(frame) for frame in consecutive]
    scores = []
    for sampling in samplings:
        for metric, chart in product(metrics, charts):
            scores += _scores(views, drive, metric, chart, sampling)
            progress(f"{sampling}, {metric}, {chart}")
    return sorted(scores, key=lambda score: score.difference)


def count_geometries() -> int:
    """How often `compare_interpretations` calls its progress callback by default."""
    return len(METRICS) * len(CHARTS) * len(SAMPLINGS)


def interpretation_of(settings: Settings) -> Interpretation:
    """The interpretation that settings select."""
    return Interpretation(*(getattr(settings, name) for name in Interpretation._fields))


def spread_frames(drive: "Drive", count: int) -> "list[Frame]":
    """At most `count` frames of a drive, spread evenly from its first to its last."""
    numbers = drive.frame_numbers
    places = np.linspace(0, len(numbers) - 1, min(count, len(numbers))).round().astype(int)
    return [drive[numbers[place]] for place in places]


def consecutive_frames(drives: "Sequence[Drive]", count: int = CONSECUTIVE_FRAMES) -> "list[Frame]":
    """The first frames of the first drive that has poses; empty where no drive has."""
    for drive in drives:
        if drive.poses and len(drive) > 1:
            posed = [number for number in drive.frame_numbers if number in drive.poses]
            return [drive[number] for number in posed[:count]]
    return []


class _View:
    """The returns in view of a frame; the nodes of each sampling are computed once."""

    def __init__(self, frame: "Frame") -> None:
        mount = checked_extrinsics(frame.camera, frame.cam_from_velo)
        name = "camera" if frame.camera is not None else "front"
        index = field_of_view(frame.points, frame.camera, mount, name).index
        self.viewpoint = meta_viewpoint(None, frame.camera, mount)
        self.returns = frame.points[index].astype(np.float64)
        self.pose = frame.pose
        self._nodes: dict[tuple[str, int], IntArray] = {}

    def nodes(self, sampling: str, tau: int) -> IntArray:
        if (sampling, tau) not in self._nodes:
            self._nodes[sampling, tau] = self._sample(sampling, tau)
        return self._nodes[sampling, tau]

    def _sample(self, sampling: str, tau: int) -> IntArray:
        if sampling == "kernel":
            return sample_kernels(self.returns, tau, self.viewpoint)
        if sampling == "stride":
            return sample_stride(len(self.returns), tau)
        return radius_nodes(self.returns, tau, self.viewpoint)


def radius_nodes(points: Float64Array, tau: int, viewpoint: Float64Array) -> IntArray:
    """Nodes of balls whose radius is chosen to give about ceil(n / tau) of them."""
    wanted = ceil(len(points) / tau)
    low_m, high_m = 1e-3, float(np.ptp(points, axis=0).max())
    best = sample_radius(points, high_m, viewpoint)
    # A smaller radius gives more nodes, with few exceptions: bisect on a logarithmic scale.
    for _ in range(BISECTIONS):
        radius_m = float(np.sqrt(low_m * high_m))
        found = sample_radius(points, radius_m, viewpoint)
        if abs(len(found) - wanted) < abs(len(best) - wanted):
            best = found
        if len(found) > wanted:
            low_m = radius_m
        else:
            high_m = radius_m
    return best


def _scores(
    views: Sequence[_View], drive: Sequence[_View], metric: str, chart: str, sampling: str
) -> list[InterpretationScore]:
    """Score every interpretation of Algorithm 1 on one geometry."""
    interpretations = [
        Interpretation(metric, chart, sampling, *rest)
        for rest in product(GATES, CONCAVE_BOUNDARIES, CRITERIA)
        if rest[1] == "every" or rest[2] != GATE_ONLY
    ]
    tpi = {one: np.empty((len(views), len(printed_values.TAUS))) for one in interpretations}
    for row, view in enumerate(views):
        for column, tau in enumerate(printed_values.TAUS):
            geometry = _geometry(view, metric, chart, sampling, tau)
            for one, result in _results(geometry, interpretations):
                tpi[one][row, column] = _tpi(geometry, result.edge)
    tpi_along: dict[Interpretation, list[float]] = {one: [] for one in interpretations}
    regions: dict[Interpretation, list[GroundRegion]] = {one: [] for one in interpretations}
    for view in drive:
        assert view.pose is not None
        geometry = _geometry(view, metric, chart, sampling, printed_values.TAU_TABLE_4)
        mesh = geometry.mesh
        for one, result in _results(geometry, interpretations):
            tpi_along[one].append(_tpi(geometry, result.edge))
            region = intervisible_region(mesh.triangles, mesh.sides, result.node, result.edge)
            regions[one].append(ground_region(geometry.points, mesh.triangles, region, view.pose))
    return [
        InterpretationScore(one, tpi[one], sample_std(tpi_along[one]), _mean_iou(regions[one]))
        for one in interpretations
    ]


def _geometry(view: _View, metric: str, chart: str, sampling: str, tau: int) -> _Geometry:
    points = view.returns[view.nodes(sampling, tau)]
    surface = build_surface(points, view.viewpoint, Settings(metric=metric, chart=chart))
    mesh = build_mesh(surface.chart)
    y = surface.metric_position
    return _Geometry(
        points=points,
        viewpoint=view.viewpoint,
        returns=view.returns,
        mesh=mesh,
        surface=surface,
        length=np.linalg.norm(y[mesh.edges[:, 0]] - y[mesh.edges[:, 1]], axis=1),
        to_centroid=np.linalg.norm(y - star_centroids(mesh, y), axis=1),
    )


def _results(
    geometry: _Geometry, interpretations: Sequence[Interpretation]
) -> Iterator[tuple[Interpretation, CriterionResult]]:
    for one in interpretations:
        gate_only = one.criterion == GATE_ONLY
        result = apply_criteria(
            geometry.points,
            geometry.viewpoint,
            geometry.mesh.edges,
            geometry.length,
            geometry.surface.flow_distance,
            geometry.to_centroid,
            Settings(
                gate=one.gate,
                concave_boundary=one.concave_boundary,
                criterion="elevation" if gate_only else one.criterion,
            ),
            returns=geometry.returns,
        )
        yield one, _gate_only(result, geometry.mesh.edges) if gate_only else result


def _gate_only(result: CriterionResult, edges: IntArray) -> CriterionResult:
    """The result of line 1 alone: edges that pass the gate from both ends, and their nodes."""
    edge: BoolArray = result.gate[: len(edges)] & result.gate[len(edges) :]
    node = np.zeros(len(result.node), bool)
    node[edges[edge].ravel()] = True
    return CriterionResult(result.gate, result.handed_over, result.gate, node, edge)


def _tpi(geometry: _Geometry, edge: BoolArray) -> float:
    return two_point_intervisibility(int(edge.sum()), len(geometry.mesh.triangles))


def _mean_iou(regions: Sequence[GroundRegion]) -> float:
    return mean_known([overlap(first, second).iou for first, second in pairwise(regions)])
