"""The graph of the paper's method compared with ground truth.

MPCS (Algorithm 1) classifies nodes and edges as intervisible from the geometry of a mesh. The
paper compares it with two methods of the same kind, not with measured visibility. Here a node is
labelled visible when it is visible from the viewpoint P0, an edge when its two ends see each other.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np

from intervis.arrays import BoolArray, Float64Array
from intervis.drives import Drive, Frame
from intervis.errors import DriveError
from intervis.lab.truth.exact_world import TOLERANCE_FRACTION, TOLERANCE_M, exact_labels
from intervis.lab.truth.held_out import held_out_labels
from intervis.lab.truth.scores import (
    matthews,
    mean_of_known,
    mean_or_nan,
    number_or_none,
)
from intervis.lab.worlds.ray_casting import RayCaster
from intervis.method.analysis import Analysis, analyze
from intervis.settings import Criterion, Settings
from intervis.transform import inverse, transform

CRITERIA: tuple[Criterion, ...] = ("elevation", "sight_angle", "sight_line")


@dataclass(frozen=True)
class GraphScore:
    """Scores of one graph, or the mean over several.

    Attributes
    ----------
    viewpoint : str
        ``sensor``, ``camera``, or another pose.
    criterion : str
    tau : int
    nodes : float
        Number of labelled nodes.
    nodes_visible : float
        Fraction of them that are visible: the precision of calling every node intervisible.
    nodes_predicted : float
        Fraction of them that the graph calls intervisible.
    nodes_precision : float
        Fraction of the nodes called intervisible that are visible.
    nodes_mcc : float
        Matthews correlation coefficient of the two; NaN where all nodes are visible.
    edges, edges_visible, edges_predicted, edges_precision : float
        The same for edges, whose ends must see each other; NaN where edges have no labels.
    """

    viewpoint: str
    criterion: str
    tau: int
    nodes: float
    nodes_visible: float
    nodes_predicted: float
    nodes_precision: float
    nodes_mcc: float
    edges: float = np.nan
    edges_visible: float = np.nan
    edges_predicted: float = np.nan
    edges_precision: float = np.nan

    def to_json(self) -> dict[str, Any]:
        """The fields by name; NaN becomes None."""
        return {
            name: number_or_none(value) if isinstance(value, float) else value
            for name, value in asdict(self).items()
        }


def graphs_by_held_out_returns(
    drive: Drive,
    pairs: Sequence[tuple[int, int]],
    *,
    taus: Sequence[int] = (35, 10, 1),
    criteria: Sequence[Criterion] = CRITERIA,
) -> list[GraphScore]:
    """Score the graph of scan i, seen from pose j, against the returns of scan j.

    Parameters
    ----------
    drive : Drive
        With poses.
    pairs : sequence of (i, j)
        Frame numbers.
    taus, criteria : sequences
        Every combination is scored, each as the mean over the pairs.

    Raises
    ------
    DriveError
        A frame has no pose, or there is no such frame.
    """
    scores = []
    for i, j in pairs:
        frame, reference = drive[i], drive[j]
        if frame.pose is None or reference.pose is None:
            raise DriveError(f"frames {i} and {j} of {drive.name} need poses.")
        labels = held_out_labels(frame.points, frame.pose, reference.points, reference.pose)
        visible = np.zeros(len(frame.points), bool)
        visible[labels.index[labels.visible]] = True
        labelled = np.zeros(len(frame.points), bool)
        labelled[labels.index] = True
        for settings in _combinations(taus, criteria):
            result = analyze(frame.points, viewpoint=labels.viewpoint_i, settings=settings)
            nodes = result.nodes
            scores.append(_score("pose j", result, labelled[nodes], visible[nodes]))
    return _averaged(scores)


def graphs_by_exact_world(
    drive: Drive,
    triangles_at: Callable[[int], Float64Array],
    frames: Sequence[int],
    *,
    later: Sequence[int] = (5, 10),
    taus: Sequence[int] = (35, 10, 1),
    criteria: Sequence[Criterion] = CRITERIA,
) -> list[GraphScore]:
    """Score the graphs of a simulated drive against rays cast at its triangles.

    Parameters
    ----------
    drive : Drive
        With poses.
    triangles_at : callable
        Triangles (T, 3, 3) at the time of a frame, in the frame of the poses.
    frames : sequence of int
        Frames whose scans are analysed.
    later : sequence of int
        Further viewpoints beside sensor and camera: the poses so many frames later, where the
        drive has them.
    taus, criteria : sequences
        Every combination is scored, each as the mean over the frames.

    Raises
    ------
    DriveError
        A frame has no pose, or there is no such frame.
    """
    scores = []
    for number in frames:
        frame = drive[number]
        if frame.pose is None:
            raise DriveError(f"frame {number} of {drive.name} needs a pose.")
        caster = RayCaster(transform(inverse(frame.pose), triangles_at(number)))
        for settings in _combinations(taus, criteria):
            for name, result in _graphs(drive, frame, settings, later):
                scores.append(_score_in_world(name, result, caster))
    return _averaged(scores)


def _combinations(taus: Iterable[int], criteria: Iterable[Criterion]) -> list[Settings]:
    criteria = tuple(criteria)
    return [Settings(tau=tau, criterion=name) for tau in taus for name in criteria]


def _graphs(
    drive: Drive, frame: Frame, settings: Settings, later: Sequence[int]
) -> Iterator[tuple[str, Analysis]]:
    """The frame's graph from the camera, the sensor and later poses."""
    around = settings.with_changes(view="circle")
    if frame.camera is not None:
        yield (
            "camera",
            analyze(
                frame.points,
                camera=frame.camera,
                cam_from_velo=frame.cam_from_velo,
                settings=settings,
            ),
        )
    yield "sensor", analyze(frame.points, settings=around)
    for step in later:
        pose = drive.poses.get(frame.number + step) if drive.poses else None
        if pose is not None and frame.pose is not None:
            viewpoint = transform(inverse(frame.pose), pose[:3, 3])
            yield (
                f"{step} frames later",
                analyze(frame.points, viewpoint=viewpoint, settings=around),
            )


def _score_in_world(viewpoint: str, result: Analysis, caster: RayCaster) -> GraphScore:
    points = result.node_points
    visible, occluded = exact_labels(caster, result.viewpoint, points, np.ones(len(points), bool))
    free = _edges_free(points[result.edges], result.viewpoint, caster)
    return _score(viewpoint, result, visible | occluded, visible, free)


def _edges_free(ends: Float64Array, viewpoint: Float64Array, caster: RayCaster) -> BoolArray:
    """(E,) whether the two ends of each edge, (E, 2, 3), see each other.

    Both ends lie on surfaces, within range noise. Surfaces this near to an end are ignored, but
    at each end no more than a third of the edge.
    """
    start, stop = ends[:, 0], ends[:, 1]
    length = np.linalg.norm(stop - start, axis=1)
    range_m = np.linalg.norm(start - viewpoint, axis=1)
    tolerance = np.minimum(TOLERANCE_M + TOLERANCE_FRACTION * range_m, length / 3)
    fraction = tolerance / np.where(length > 0, length, 1.0)
    inner_start = start + (stop - start) * fraction[:, None]
    return ~caster.blocked(inner_start, stop, slack_m=tolerance)


def _score(
    viewpoint: str,
    result: Analysis,
    labelled: BoolArray,
    visible: BoolArray,
    edge_free: BoolArray | None = None,
) -> GraphScore:
    predictions, labels = result.node_intervisible[labelled], visible[labelled]
    settings = result.settings
    edges = {}
    if edge_free is not None and len(edge_free):
        edges = {
            "edges": float(len(edge_free)),
            "edges_visible": mean_or_nan(edge_free),
            "edges_predicted": mean_or_nan(result.edge_intervisible),
            "edges_precision": mean_or_nan(edge_free[result.edge_intervisible]),
        }
    return GraphScore(
        viewpoint=viewpoint,
        criterion=settings.criterion,
        tau=int(settings.tau),
        nodes=float(labelled.sum()),
        nodes_visible=mean_or_nan(labels),
        nodes_predicted=mean_or_nan(predictions),
        nodes_precision=mean_or_nan(labels[predictions]),
        nodes_mcc=matthews(labels, predictions),
        **edges,
    )


def _averaged(scores: Sequence[GraphScore]) -> list[GraphScore]:
    """The mean of the scores that share viewpoint, criterion and tau, in order of appearance."""
    groups: dict[tuple[str, str, int], list[GraphScore]] = {}
    for score in scores:
        groups.setdefault((score.viewpoint, score.criterion, score.tau), []).append(score)
    numbers = [f.name for f in fields(GraphScore) if f.name.startswith(("nodes", "edges"))]
    averaged = []
    for (viewpoint, criterion, tau), members in groups.items():
        means = {name: mean_of_known([getattr(m, name) for m in members]) for name in numbers}
        averaged.append(GraphScore(viewpoint, criterion, tau, **means))
    return averaged
