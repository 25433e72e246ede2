"""The paper's experiments on one frame: granularity sweep, timed runs, three methods."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from intervis.arrays import Float64Array, IntArray, finite_rows
from intervis.errors import IntervisError, PointsError
from intervis.lab.paper import printed_values
from intervis.lab.truth.scores import matthews
from intervis.method.analysis import Analysis, StageTimes, analyze
from intervis.method.comparison import SightLines, global_points, interpolation_points
from intervis.method.measures import Measures
from intervis.progress import Progress, reporter
from intervis.settings import Settings

if TYPE_CHECKING:
    from intervis.drives import Frame

FEW_RETURNS = 100
"""Below this number of returns in view the claims are not checked: one kernel of the coarsest
granularity would take in all of them."""

SWEEP = tuple(range(1, 101))
"""Granularities of Figures 9 and 10."""

SWEEP_RUNS = 5
"""Runs per granularity of the sweep; the least time of each stage is reported."""

INTERPOLATION_RUNS = 3
"""Runs of interpolation points; the median time is reported."""

PAPER_STAGES = ("S1", "S2", "S3")
"""The stages in the paper's TIME; field of view and sampling precede them."""


@dataclass(frozen=True)
class SweepPoint:
    """One granularity of the sweep.

    Attributes
    ----------
    tau : int
    measures : Measures
    intervisible : int
        Number of intervisible edges.
    hull : int
        h, number of edges on the border of the mesh.
    copies : int
        Nodes in no triangle, since another node has the same position on the surface.
    times : StageTimes
        The least time of each stage over the runs.
    """

    tau: int
    measures: Measures
    intervisible: int
    hull: int
    copies: int
    times: StageTimes


@dataclass(frozen=True, eq=False)
class TimedRuns:
    """Times of R runs at one granularity: (R, 6) seconds, columns as in `StageTimes`."""

    tau: int
    stages: tuple[str, ...]
    seconds: Float64Array

    def column(self, stage: str) -> Float64Array:
        """(R,) seconds of a stage; "TIME" is the paper's S1 + S2 + S3."""
        if stage == "TIME":
            found: Float64Array = sum(
                (self.column(name) for name in PAPER_STAGES), np.zeros(len(self.seconds))
            )
            return found
        return self.seconds[:, self.stages.index(stage)]

    @property
    def std_s(self) -> float:
        """Sample standard deviation of TIME, seconds."""
        return float(self.column("TIME").std(ddof=1))

    @property
    def relative_std(self) -> float:
        """Sample standard deviation of TIME over its mean, per cent."""
        return 100.0 * self.std_s / float(self.column("TIME").mean())


@dataclass(frozen=True, eq=False)
class Agreement:
    """How far two methods give the same result for the same returns.

    Attributes
    ----------
    nodes : int
        Nodes that both methods have.
    share : float
        Share of them with the same result, per cent.
    correlation : float
        Matthews correlation of the two results: 0 as by chance, 1 where they are equal; NaN where
        the reference gives the same result for every node.
    """

    nodes: int
    share: float
    correlation: float


@dataclass(frozen=True, eq=False)
class FrameExperiment:
    """The data behind the paper's tables and figures, from one frame.

    Attributes
    ----------
    frame : Frame
        As used: without its image where that does not fit the calibration.
    settings : Settings
        As used, with tau of Table 4.
    sweep : mapping of int to SweepPoint
        By tau.
    timed : mapping of int to TimedRuns
        By tau.
    proposed : Analysis
        The paper's method at the granularity of Table 4.
    finest : Analysis
        The paper's method at the finest granularity of Table 2, for Figures 4 to 8.
    interpolation : SightLines
    global_lines : SightLines or None
        Global points; None where it was not requested.
    proposed_s, interpolation_s, global_s : float
        TIME of Table 4, seconds: the median of the runs.
    notes : tuple of str
        What is missing or different, and why.
    """

    frame: "Frame"
    settings: Settings
    sweep: Mapping[int, SweepPoint]
    timed: Mapping[int, TimedRuns]
    proposed: Analysis
    finest: Analysis
    interpolation: SightLines
    global_lines: SightLines | None
    proposed_s: float
    interpolation_s: float
    global_s: float | None
    notes: tuple[str, ...]


def steps_of_frame(*, with_global: bool) -> int:
    """How often `run_frame` calls its progress callback."""
    return SWEEP_RUNS + len(printed_values.TAUS) + 2 + with_global


def run_frame(
    frame: "Frame",
    settings: Settings | None = None,
    *,
    with_global: bool = True,
    progress: Progress | None = None,
) -> FrameExperiment:
    """Run the experiments of Sec. 3 and 4 that need one frame.

    Parameters
    ----------
    frame : Frame
    settings : Settings or None
        ``tau``, if it is a number, is the granularity of Table 4; otherwise that is 35.
    with_global : bool
        Run global points as well.
    progress : callable, optional

    Raises
    ------
    IntervisError
        The frame has no return that a method can use.
    """
    progress = reporter(progress)
    frame, settings, notes = usable(frame, Settings() if settings is None else settings)
    tau = printed_values.TAU_TABLE_4 if settings.tau == "auto" else settings.tau
    settings = settings.with_changes(tau=tau)
    where = camera_arguments(frame)

    def at(tau: int) -> Analysis:
        return analyze(frame.points, settings=settings.with_changes(tau=tau), **where)

    at(tau)  # compile the kernels first, so that no time below contains compilation
    progress("kernels are compiled")
    found: dict[int, list[Analysis]] = {granularity: [] for granularity in SWEEP}
    # Every granularity once, then again: a busy machine then slows one run of each, not all of one.
    for repeat in range(SWEEP_RUNS):
        for granularity in SWEEP:
            found[granularity].append(at(granularity))
        progress(f"granularities, run {repeat + 1} of {SWEEP_RUNS}")
    sweep = {granularity: _sweep_point(runs, granularity) for granularity, runs in found.items()}
    del found
    timed = {}
    for granularity in printed_values.TAUS:
        timed[granularity] = _timed(
            granularity, [at(granularity) for _ in range(printed_values.RUNS)]
        )
        progress(f"timed runs at tau {granularity}")
    interpolated = [
        interpolation_points(frame.points, settings=settings, **where)
        for _ in range(INTERPOLATION_RUNS)
    ]
    progress("interpolation points")
    global_lines = None
    if with_global:
        global_points(frame.points[:64], **where)  # compile first
        global_lines = global_points(frame.points, **where)
        progress("global points")
    runs = [at(tau) for _ in range(printed_values.RUNS)]
    return FrameExperiment(
        frame=frame,
        settings=settings,
        sweep=sweep,
        timed=timed,
        proposed=runs[0],
        finest=at(printed_values.TAUS[0]),
        interpolation=interpolated[-1],
        global_lines=global_lines,
        proposed_s=float(np.median([paper_time(run.times) for run in runs])),
        interpolation_s=float(np.median([paper_time(run.times) for run in interpolated])),
        global_s=None if global_lines is None else paper_time(global_lines.times),
        notes=tuple(notes) + tuple(_few_returns_notes(runs[0])),
    )


def camera_arguments(frame: "Frame") -> dict[str, Any]:
    """The camera and the extrinsics of a frame as keyword arguments of the methods."""
    return {"camera": frame.camera, "cam_from_velo": frame.cam_from_velo}


def paper_time(times: StageTimes) -> float:
    """The paper's TIME: S1 + S2 + S3, seconds."""
    return times.S1 + times.S2 + times.S3


def usable(frame: "Frame", settings: Settings) -> tuple["Frame", Settings, list[str]]:
    """The frame and settings that the experiments can use, and one note for each change.

    Without a camera the field of view is the 90 degrees ahead. An image that does not fit the
    calibration is dropped. Where no return is in view, the field of view is the full circle.

    Raises
    ------
    PointsError
        No return can be used.
    """
    notes: list[str] = []
    if frame.camera is None:
        notes.append(
            "This source has no camera: Figure 3 (a) is left out"
            + (
                ", and the field of view is the 90 degrees ahead instead of the camera's."
                if settings.view == "camera"
                else "."
            )
        )
        if settings.view == "camera":
            settings = settings.with_changes(view="front")
    else:
        frame, image_notes = _checked_image(frame)
        notes += image_notes
    try:
        analyze(frame.points, settings=settings.with_changes(tau=100), **camera_arguments(frame))
    except PointsError as error:
        if not finite_rows(frame.points).any() or settings.view == "circle":
            raise
        notes.append(f"The full circle is used as the field of view: {error}")
        settings = settings.with_changes(view="circle")
    return frame, settings, notes


def _checked_image(frame: "Frame") -> tuple["Frame", list[str]]:
    """The frame without its image where that is missing, unreadable or of another size."""
    assert frame.camera is not None
    if not frame.has_image:
        return frame, ["This frame has no image: Figure 3 (a) shows the returns alone."]
    try:
        image = frame.image
    except IntervisError as error:
        return replace(frame, image_path=None, read_image=None), [
            f"Figure 3 (a) shows no image: {error}"
        ]
    assert image is not None
    height, width = image.shape[:2]
    if (width, height) == (frame.camera.width_px, frame.camera.height_px):
        return frame, []
    return replace(frame, image_path=None, read_image=None), [
        f"The image has {width} x {height} pixels, the calibration"
        f" {frame.camera.width_px} x {frame.camera.height_px}. The image is left out of Figure 3"
        " (a); the field of view follows the calibration."
    ]


def _few_returns_notes(proposed: Analysis) -> list[str]:
    n_fov = proposed.measures.n_fov
    if n_fov >= FEW_RETURNS:
        return []
    return [
        f"Returns in view: {n_fov} only. From granularity {(n_fov + 1) // 2} on there are fewer"
        " than three nodes, so no finite element and no TPI. The claims are not checked on this"
        " frame."
    ]


def _sweep_point(runs: Sequence[Analysis], tau: int) -> SweepPoint:
    last = runs[-1]
    stages = tuple(last.times.keys())
    least = [min(run.times[stage] for run in runs) for stage in stages]
    return SweepPoint(
        tau=tau,
        measures=last.measures,
        intervisible=int(last.edge_intervisible.sum()),
        hull=len(border_edges(last.triangles)),
        copies=len(last.nodes) - len(np.unique(last.triangles)),
        times=StageTimes(*least),
    )


def border_edges(triangles: IntArray) -> IntArray:
    """(K, 2) edges that belong to exactly one of (F, 3) triangles, smaller node first.

    Examples
    --------
    >>> border_edges(np.array([[0, 1, 2], [2, 1, 3]])).tolist()
    [[0, 1], [0, 2], [1, 3], [2, 3]]
    """
    sides = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=-1).reshape(-1, 2)
    unique, count = np.unique(np.sort(sides, axis=1), axis=0, return_counts=True)
    border: IntArray = unique[count == 1]
    return border


def _timed(tau: int, runs: Sequence[Analysis]) -> TimedRuns:
    stages = tuple(runs[0].times.keys())
    return TimedRuns(tau, stages, np.array([[run.times[name] for name in stages] for run in runs]))


def agreement(method: Analysis, reference: Analysis) -> Agreement:
    """Compare a method with a reference on the nodes that both have."""
    common, here, there = np.intersect1d(
        method.nodes, reference.nodes, assume_unique=True, return_indices=True
    )
    if len(common) == 0:
        return Agreement(0, float("nan"), float("nan"))
    result, expected = method.node_intervisible[here], reference.node_intervisible[there]
    return Agreement(
        nodes=len(common),
        share=100.0 * float(np.mean(result == expected)),
        correlation=matthews(expected, result),
    )
