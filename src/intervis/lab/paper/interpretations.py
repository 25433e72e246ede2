"""The readings that the paper's text leaves open, settled by measurement.

Every combination of metric, chart, sampling, gate, concave boundary and criterion is run over real
frames at the ten granularities of Table 2. What counts is how far TPI stays from the table (another
frame than the paper's, so a few points are no fault), and how steady TPI and region are along a
drive.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise, product
from math import ceil
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from intervis.arrays import BoolArray, Float64Array, IntArray
from intervis.lab.paper import printed_values
from intervis.lab.paper.experiment import Step
from intervis.lab.paper.temporal_consistency import GroundRegion, draw_region, overlap
from intervis.method.analysis import checked_extrinsics, field_of_view, meta_viewpoint
from intervis.method.criteria import CriterionResult, apply_criteria, intervisible_region
from intervis.method.measures import two_point_intervisibility
from intervis.method.mesh import Mesh, build_mesh, star_centroids
from intervis.method.sampling import sample_kernels, sample_radius, sample_stride
from intervis.method.surface import Surface, build_surface
from intervis.settings import Settings

if TYPE_CHECKING:
    from intervis.drives import Drive, Frame

METRICS = ("mahalanobis", "normalized", "euclidean", "ground")
CHARTS = ("ground", "angles", "polar")
SAMPLINGS = ("kernel", "stride", "radius")
GATES = ("degree", "mean", "shortest", "star_minimum", "none")
CONCAVE_BOUNDARIES = ("every", "any")
CRITERIA = ("elevation", "sight_angle", "sight_line", "not judged")
"""What lines 6 and 8 compare; "not judged" leaves lines 2 to 9 out: the gate of line 1 alone."""

ALONG = 6
"""Consecutive frames that tell how steady a reading is."""

BISECTIONS = 12
"""Steps to find the radius that gives as many nodes as a granularity."""


class Reading(NamedTuple):
    """One way to read the paper."""

    metric: str
    chart: str
    sampling: str
    gate: str
    concave_boundary: str
    criterion: str


@dataclass(frozen=True, eq=False)
class ReadingScore:
    """How one reading fares.

    Attributes
    ----------
    reading : Reading
    TPI : (frames, 10) float64 array
        At the granularities of Table 2, for each frame.
    TPI_std : float
        Sample standard deviation of TPI at tau = 35 along the drive, points; NaN without one.
    iou : float
        Mean overlap of the region of consecutive frames at tau = 35; NaN without a drive.
    """

    reading: Reading
    TPI: Float64Array
    TPI_std: float
    iou: float

    @property
    def away(self) -> float:
        """Mean absolute difference to Table 2 over all frames and granularities, points."""
        return float(np.abs(self.TPI - _printed()).mean())

    @property
    def mean_away(self) -> float:
        """Mean absolute difference of the mean over the frames, points."""
        return float(np.abs(self.TPI.mean(axis=0) - _printed()).mean())

    @property
    def worst(self) -> float:
        """Greatest absolute difference of the mean over the frames, points."""
        return float(np.abs(self.TPI.mean(axis=0) - _printed()).max())


def _printed() -> Float64Array:
    return np.array([row.TPI for row in printed_values.TABLE_2.values()])


@dataclass(frozen=True, eq=False)
class _Geometry:
    """One frame, sampled, charted and meshed: what the readings of Algorithm 1 work on."""

    points: Float64Array
    viewpoint: Float64Array
    returns: Float64Array
    mesh: Mesh
    surface: Surface
    length: Float64Array
    to_centroid: Float64Array


def compare_readings(
    frames: Sequence["Frame"],
    drive: Sequence["Frame"] = (),
    *,
    metrics: Sequence[str] = METRICS,
    charts: Sequence[str] = CHARTS,
    samplings: Sequence[str] = SAMPLINGS,
    step: Step = lambda note: None,
) -> list[ReadingScore]:
    """Every reading over every frame, nearest to Table 2 first.

    Parameters
    ----------
    frames : sequence of Frame
        Held against Table 2.
    drive : sequence of Frame
        Consecutive frames with poses, for steadiness; may be empty.
    metrics, charts, samplings : sequences of str
        Which of the geometries to run; every reading of Algorithm 1 is run on each.
    step : callable
        Told after each geometry; there are as many as metrics times charts times samplings.
    """
    views = [_View(frame) for frame in frames]
    along = [_View(frame) for frame in drive]
    scores = []
    for sampling in samplings:
        for metric, chart in product(metrics, charts):
            scores += _scores(views, along, metric, chart, sampling)
            step(f"{sampling}, {metric}, {chart}")
    return sorted(scores, key=lambda score: score.away)


def count_geometries() -> int:
    """How many steps `compare_readings` tells of."""
    return len(METRICS) * len(CHARTS) * len(SAMPLINGS)


def chosen_reading(settings: Settings) -> Reading:
    """The reading that settings stand for."""
    return Reading(*(getattr(settings, name) for name in Reading._fields))


def spread_frames(drive: "Drive", count: int) -> "list[Frame]":
    """At most `count` frames of a drive, spread evenly from its first to its last."""
    numbers = drive.frame_numbers
    places = np.linspace(0, len(numbers) - 1, min(count, len(numbers))).round().astype(int)
    return [drive[numbers[place]] for place in places]


def consecutive_frames(drives: "Sequence[Drive]", count: int = ALONG) -> "list[Frame]":
    """The first frames of the first drive with poses; none where there is no such drive."""
    for drive in drives:
        if drive.poses and len(drive) > 1:
            posed = [number for number in drive.frame_numbers if number in drive.poses]
            return [drive[number] for number in posed[:count]]
    return []


class _View:
    """A frame's returns in view, and the nodes of each sampling, found once."""

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
    """Nodes of balls of the radius that gives about ceil(n / tau) of them."""
    wanted = ceil(len(points) / tau)
    low_m, high_m = 1e-3, float(np.ptp(points, axis=0).max())
    best = sample_radius(points, high_m, viewpoint)
    # More nodes for a smaller radius, nearly always: halve the way on a logarithmic scale.
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
    views: Sequence[_View], along: Sequence[_View], metric: str, chart: str, sampling: str
) -> list[ReadingScore]:
    """All readings of Algorithm 1 on one geometry."""
    readings = [
        Reading(metric, chart, sampling, *rest)
        for rest in product(GATES, CONCAVE_BOUNDARIES, CRITERIA)
        if rest[1] == "every" or rest[2] != "not judged"
    ]
    tpi = {reading: np.empty((len(views), len(printed_values.TAUS))) for reading in readings}
    for row, view in enumerate(views):
        for column, tau in enumerate(printed_values.TAUS):
            geometry = _geometry(view, metric, chart, sampling, tau)
            for reading, verdict in _verdicts(geometry, readings):
                tpi[reading][row, column] = _tpi(geometry, verdict.edge)
    steady: dict[Reading, list[float]] = {reading: [] for reading in readings}
    regions: dict[Reading, list[GroundRegion]] = {reading: [] for reading in readings}
    for view in along:
        assert view.pose is not None
        geometry = _geometry(view, metric, chart, sampling, printed_values.TAU_TABLE_4)
        mesh = geometry.mesh
        for reading, verdict in _verdicts(geometry, readings):
            steady[reading].append(_tpi(geometry, verdict.edge))
            region = intervisible_region(mesh.triangles, mesh.edges, verdict.node, verdict.edge)
            regions[reading].append(draw_region(geometry.points, mesh.triangles, region, view.pose))
    return [
        ReadingScore(reading, tpi[reading], _std(steady[reading]), _mean_iou(regions[reading]))
        for reading in readings
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


def _verdicts(
    geometry: _Geometry, readings: Sequence[Reading]
) -> Iterator[tuple[Reading, CriterionResult]]:
    for reading in readings:
        judged = reading.criterion != "not judged"
        verdict = apply_criteria(
            geometry.points,
            geometry.viewpoint,
            geometry.mesh.edges,
            geometry.length,
            geometry.surface.flow_distance,
            geometry.to_centroid,
            Settings(
                gate=reading.gate,
                concave_boundary=reading.concave_boundary,
                criterion=reading.criterion if judged else "elevation",
            ),
            returns=geometry.returns,
        )
        yield reading, verdict if judged else _gate_alone(verdict, geometry.mesh.edges)


def _gate_alone(verdict: CriterionResult, edges: IntArray) -> CriterionResult:
    """What line 1 alone would call intervisible: edges that pass it from both ends."""
    edge: BoolArray = verdict.gate[: len(edges)] & verdict.gate[len(edges) :]
    node = np.zeros(len(verdict.node), bool)
    node[edges[edge].ravel()] = True
    return CriterionResult(verdict.gate, verdict.handed_over, verdict.gate, node, edge)


def _tpi(geometry: _Geometry, edge: BoolArray) -> float:
    return two_point_intervisibility(int(edge.sum()), len(geometry.mesh.triangles))


def _std(values: Sequence[float]) -> float:
    return float(np.std(values, ddof=1)) if len(values) > 1 else float("nan")


def _mean_iou(regions: Sequence[GroundRegion]) -> float:
    found = [overlap(a, b).iou for a, b in pairwise(regions)]
    known = [iou for iou in found if np.isfinite(iou)]
    return float(np.mean(known)) if known else float("nan")
