"""The paper's graph judged by the truth: are its intervisibility points and edges really so?

MPCS (Algorithm 1) calls nodes and edges intervisible from the geometry of a mesh; the paper
compares it with two methods of the same kind, not with what can be seen. Here its answers meet
both truths of `intervis.lab.truth`: a node counts as visible when it is visible from the
viewpoint P0, an edge when its two ends see each other.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from intervis.arrays import BoolArray, Float64Array
from intervis.drives import Drive, Frame
from intervis.errors import DriveError
from intervis.lab.truth.exact import truth as exact_truth
from intervis.lab.truth.held_out import judge
from intervis.lab.truth.scores import matthews
from intervis.lab.worlds.ray_casting import RayCaster
from intervis.method.analysis import Analysis, analyze
from intervis.settings import Criterion, Settings
from intervis.transform import inverse, transform

CRITERIA: tuple[Criterion, ...] = ("elevation", "sight_angle", "sight_line")


@dataclass(frozen=True)
class GraphScore:
    """How often one graph, or the mean over several, was right.

    Attributes
    ----------
    viewpoint : str
        Where it was looked from: ``sensor``, ``camera``, or another pose.
    criterion : str
    tau : int
    nodes : float
        Nodes that the truth judges.
    nodes_visible : float
        Share of them that are visible: what calling every node intervisible would get right.
    nodes_said : float
        Share that is called intervisible.
    nodes_right : float
        Share of those called intervisible that are visible.
    nodes_mcc : float
        Matthews correlation of said and visible; NaN where all nodes are visible.
    edges, edges_visible, edges_said, edges_right : float
        The same for edges, whose ends must see each other; NaN where the truth cannot tell.
    """

    viewpoint: str
    criterion: str
    tau: int
    nodes: float
    nodes_visible: float
    nodes_said: float
    nodes_right: float
    nodes_mcc: float
    edges: float = np.nan
    edges_visible: float = np.nan
    edges_said: float = np.nan
    edges_right: float = np.nan

    def to_json(self) -> dict[str, Any]:
        """The fields, None for what is not known."""
        return {
            name: None if isinstance(value, float) and np.isnan(value) else value
            for name, value in asdict(self).items()
        }


def graphs_by_held_out_returns(
    drive: Drive,
    pairs: Sequence[tuple[int, int]],
    *,
    taus: Sequence[int] = (35, 10, 1),
    criteria: Sequence[Criterion] = CRITERIA,
) -> list[GraphScore]:
    """Judge the graph of scan i, seen from pose j, by the returns of scan j.

    Parameters
    ----------
    drive : Drive
        With poses.
    pairs : sequence of (i, j)
        Frame numbers.
    taus, criteria : sequences
        Every combination is judged, each as the mean over the pairs.

    Raises
    ------
    DriveError
        A frame has no pose, or there is no such frame.
    """
    scores = []
    for i, j in pairs:
        seen, judging = drive[i], drive[j]
        if seen.pose is None or judging.pose is None:
            raise DriveError(f"frames {i} and {j} of {drive.name} need poses.")
        judgement = judge(seen.points, seen.pose, judging.points, judging.pose)
        visible = np.zeros(len(seen.points), bool)
        visible[judgement.index[judgement.visible]] = True
        judged = np.zeros(len(seen.points), bool)
        judged[judgement.index] = True
        for settings in _choices(taus, criteria):
            result = analyze(seen.points, viewpoint=judgement.viewpoint_i, settings=settings)
            scores.append(_score("pose j", result, judged[result.nodes], visible[result.nodes]))
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
    """Judge the graphs of a simulated drive by rays cast at its triangles.

    Parameters
    ----------
    drive : Drive
        With poses.
    triangles_at : callable
        Triangles (T, 3, 3) at a frame's moment, in the frame of the poses.
    frames : sequence of int
        Whose scans are looked at.
    later : sequence of int
        Viewpoints beside sensor and camera: the poses so many frames later, where there are any.
    taus, criteria : sequences
        Every combination is judged, each as the mean over the frames.
    """
    scores = []
    for number in frames:
        frame = drive[number]
        if frame.pose is None:
            raise DriveError(f"frame {number} of {drive.name} needs a pose.")
        caster = RayCaster(transform(inverse(frame.pose), triangles_at(number)))
        for settings in _choices(taus, criteria):
            for name, result in _graphs(drive, frame, settings, later):
                scores.append(_score_in_world(name, result, caster))
    return _averaged(scores)


def _choices(taus: Iterable[int], criteria: Iterable[Criterion]) -> list[Settings]:
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
            place = transform(inverse(frame.pose), pose[:3, 3])
            yield f"{step} frames later", analyze(frame.points, viewpoint=place, settings=around)


def _score_in_world(viewpoint: str, result: Analysis, caster: RayCaster) -> GraphScore:
    points = result.node_points
    visible, hidden = exact_truth(caster, result.viewpoint, points, np.ones(len(points), bool))
    start, stop = points[result.edges[:, 0]], points[result.edges[:, 1]]
    length = np.linalg.norm(stop - start, axis=1)
    # Both ends lie on surfaces, give or take the noise of their range: neither may block.
    slack = np.minimum(0.15 + 0.01 * np.linalg.norm(start - result.viewpoint, axis=1), length / 3)
    inward = start + (stop - start) * (slack / np.where(length > 0, length, 1.0))[:, None]
    free = ~caster.blocked(inward, stop, slack_m=slack)
    return _score(viewpoint, result, visible | hidden, visible, free)


def _score(
    viewpoint: str,
    result: Analysis,
    judged: BoolArray,
    visible: BoolArray,
    edge_free: BoolArray | None = None,
) -> GraphScore:
    said, true = result.node_intervisible[judged], visible[judged]
    settings = result.settings
    edges = {}
    if edge_free is not None and len(edge_free):
        edges = {
            "edges": float(len(edge_free)),
            "edges_visible": _share(edge_free),
            "edges_said": _share(result.edge_intervisible),
            "edges_right": _share(edge_free[result.edge_intervisible]),
        }
    return GraphScore(
        viewpoint=viewpoint,
        criterion=settings.criterion,
        tau=int(settings.tau),
        nodes=float(judged.sum()),
        nodes_visible=_share(true),
        nodes_said=_share(said),
        nodes_right=_share(true[said]),
        nodes_mcc=np.nan if true.all() else matthews(true, said),
        **edges,
    )


def _share(mask: BoolArray) -> float:
    return float(mask.mean()) if len(mask) else float("nan")


def _averaged(scores: Sequence[GraphScore]) -> list[GraphScore]:
    """The mean of the scores that share viewpoint, criterion and tau, in order of appearance."""
    groups: dict[tuple[str, str, int], list[GraphScore]] = {}
    for score in scores:
        groups.setdefault((score.viewpoint, score.criterion, score.tau), []).append(score)
    numbers = [name for name in GraphScore.__dataclass_fields__ if name[:4] in ("node", "edge")]
    averaged = []
    for (viewpoint, criterion, tau), members in groups.items():
        means = {}
        for name in numbers:
            known = [value for m in members if not np.isnan(value := getattr(m, name))]
            means[name] = float(np.mean(known)) if known else float("nan")
        averaged.append(GraphScore(viewpoint, criterion, tau, **means))
    return averaged
