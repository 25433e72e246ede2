"""One frame through the paper's experiments: granularity sweep, timed runs, three methods."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from intervis.arrays import Float64Array, finite_rows
from intervis.errors import IntervisError, PointsError
from intervis.lab.paper import printed_values
from intervis.method.analysis import Analysis, StageTimes, analyze
from intervis.method.comparison import SightLines, global_points, interpolation_points
from intervis.method.measures import Measures
from intervis.settings import Settings

if TYPE_CHECKING:
    from intervis.drives import Frame

FEW_RETURNS = 100
"""With fewer returns in view the greatest granularity of the tables leaves no node to judge."""

SWEEP = tuple(range(1, 101))
"""Granularities of Figures 9 and 10."""

SWEEP_RUNS = 5
"""Runs of each granularity of the sweep; the least time of each stage counts."""

PAPER_STAGES = ("S1", "S2", "S3")
"""The stages in the paper's TIME; field of view and sampling come before."""

Step = Callable[[str], None]
"""Told what was just done, once for each unit of work."""


@dataclass(frozen=True)
class Granularity:
    """One granularity of the sweep: what was measured, and the least time of each stage."""

    tau: int
    measures: Measures
    intervisible: int
    hull: int
    copies: int
    times: StageTimes


@dataclass(frozen=True, eq=False)
class TimedRuns:
    """Times of one granularity: (R, 6) seconds, columns as in `StageTimes`."""

    tau: int
    stages: tuple[str, ...]
    seconds: Float64Array

    def column(self, stage: str) -> Float64Array:
        """(R,) seconds of a stage; "TIME" is the paper's, S1 + S2 + S3."""
        if stage == "TIME":
            found: Float64Array = sum(
                (self.column(name) for name in PAPER_STAGES), np.zeros(len(self.seconds))
            )
            return found
        return self.seconds[:, self.stages.index(stage)]


@dataclass(frozen=True, eq=False)
class Agreement:
    """How far a method says the same of its nodes as another method of the same points.

    Attributes
    ----------
    nodes : int
        Nodes that both judge.
    share : float
        Per cent of them with the same verdict.
    correlation : float
        Matthews correlation of the two verdicts: 0 by chance, 1 where they are the same; NaN where
        one of them says the same of every node.
    """

    nodes: int
    share: float
    correlation: float


@dataclass(frozen=True, eq=False)
class FrameExperiment:
    """What the paper's tables and figures show of one frame.

    Attributes
    ----------
    frame : Frame
        As it was used: without its image where that does not fit the calibration.
    settings : Settings
        In force, tau of Table 4 included.
    sweep : mapping of int to Granularity
    timed : mapping of int to TimedRuns
    ours : Analysis
        The paper's method at the granularity of Table 4.
    fine : Analysis
        The paper's method at the finest granularity of Table 2, for Figures 4 to 8.
    interpolation : SightLines
    everything : SightLines or None
        Global points, where it was asked for.
    ours_s, interpolation_s, everything_s : float
        Seconds for Table 4: the paper's stages, the middle of the runs.
    notes : tuple of str
        What is missing or different, and why.
    """

    frame: "Frame"
    settings: Settings
    sweep: Mapping[int, Granularity]
    timed: Mapping[int, TimedRuns]
    ours: Analysis
    fine: Analysis
    interpolation: SightLines
    everything: SightLines | None
    ours_s: float
    interpolation_s: float
    everything_s: float | None
    notes: tuple[str, ...]


def steps_of_frame(*, with_global: bool) -> int:
    """How many units of work `run_frame` tells of."""
    return SWEEP_RUNS + len(printed_values.TAUS) + 2 + with_global


def run_frame(
    frame: "Frame",
    settings: Settings | None = None,
    *,
    with_global: bool = True,
    step: Step = lambda note: None,
) -> FrameExperiment:
    """Everything of Sec. 3 and 4 that one frame can show.

    Parameters
    ----------
    frame : Frame
    settings : Settings or None
        ``tau`` is the granularity of Table 4 where it is a number; 35 otherwise.
    with_global : bool
        Run global points as well.
    step : callable
        Told after each unit of work.

    Raises
    ------
    IntervisError
        The frame holds nothing that any of the methods can work on.
    """
    frame, settings, notes = usable(frame, Settings() if settings is None else settings)
    tau = printed_values.TAU_TABLE_4 if settings.tau == "auto" else settings.tau
    settings = settings.with_changes(tau=tau)
    where = mount(frame)

    def at(tau: int) -> Analysis:
        return analyze(frame.points, settings=settings.with_changes(tau=tau), **where)

    at(tau)  # compiles what is not compiled yet: no time below holds that
    step("kernels are ready")
    found: dict[int, list[Analysis]] = {granularity: [] for granularity in SWEEP}
    for turn in range(SWEEP_RUNS):  # in turns: a pause of the machine meets one run of each
        for granularity in SWEEP:
            found[granularity].append(at(granularity))
        step(f"granularities, turn {turn + 1} of {SWEEP_RUNS}")
    sweep = {granularity: _granularity(runs, granularity) for granularity, runs in found.items()}
    del found
    timed = {}
    for granularity in printed_values.TAUS:
        timed[granularity] = _timed(
            granularity, [at(granularity) for _ in range(printed_values.RUNS)]
        )
        step(f"ten runs at tau {granularity}")
    interpolated = [
        interpolation_points(frame.points, settings=settings, **where) for _ in range(3)
    ]
    everything = None
    if with_global:
        global_points(frame.points[:64], **where)
        everything = global_points(frame.points, **where)
        step("global points")
    step("interpolation points")
    runs = [at(tau) for _ in range(printed_values.RUNS)]
    return FrameExperiment(
        frame=frame,
        settings=settings,
        sweep=sweep,
        timed=timed,
        ours=runs[0],
        fine=at(printed_values.TAUS[0]),
        interpolation=interpolated[-1],
        everything=everything,
        ours_s=float(np.median([paper_time(run.times) for run in runs])),
        interpolation_s=float(np.median([paper_time(run.times) for run in interpolated])),
        everything_s=None if everything is None else paper_time(everything.times),
        notes=tuple(notes) + tuple(_thin_notes(runs[0])),
    )


def mount(frame: "Frame") -> dict[str, Any]:
    """A frame's camera as keyword arguments of the methods."""
    return {"camera": frame.camera, "cam_from_velo": frame.cam_from_velo}


def paper_time(times: StageTimes) -> float:
    """The paper's TIME: S1 + S2 + S3, seconds."""
    return times.S1 + times.S2 + times.S3


def usable(frame: "Frame", settings: Settings) -> tuple["Frame", Settings, list[str]]:
    """The frame and settings to work with, and what had to be changed, in words."""
    notes: list[str] = []
    if frame.camera is None:
        notes.append(
            "This source has no camera: Figure 3 (a) is left out"
            + (
                ", and the field of view is the 90 degrees ahead in place of the camera's."
                if settings.view == "camera"
                else "."
            )
        )
        if settings.view == "camera":
            settings = settings.with_changes(view="front")
    else:
        frame, said = _checked_image(frame)
        notes += said
    try:
        analyze(frame.points, settings=settings.with_changes(tau=100), **mount(frame))
    except PointsError as error:
        if not finite_rows(frame.points).any() or settings.view == "circle":
            raise
        notes.append(f"The full circle is taken for the field of view: {error}")
        settings = settings.with_changes(view="circle")
    return frame, settings, notes


def _checked_image(frame: "Frame") -> tuple["Frame", list[str]]:
    """The frame without its image where that is missing, unreadable or of another size."""
    assert frame.camera is not None
    if frame.image_path is None:
        return frame, ["This frame has no image: Figure 3 (a) shows the returns alone."]
    try:
        image = frame.image
    except IntervisError as error:
        return replace(frame, image_path=None), [f"Figure 3 (a) shows no image: {error}"]
    assert image is not None
    height, width = image.shape[:2]
    if (width, height) == (frame.camera.width_px, frame.camera.height_px):
        return frame, []
    return replace(frame, image_path=None), [
        f"The image has {width} x {height} pixels and the calibration speaks of"
        f" {frame.camera.width_px} x {frame.camera.height_px}: it is left out of Figure 3 (a),"
        " and the field of view is the calibration's."
    ]


def _thin_notes(ours: Analysis) -> list[str]:
    n_fov = ours.measures.n_fov
    if n_fov >= FEW_RETURNS:
        return []
    return [
        f"Returns in view: {n_fov} only. From granularity {(n_fov + 1) // 2} on there are fewer"
        " than three nodes, no finite element, and no TPI. The claims are not judged on that."
    ]


def _granularity(runs: Sequence[Analysis], tau: int) -> Granularity:
    last = runs[-1]
    triangles = last.triangles
    sides = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=-1).reshape(-1, 2)
    shared = np.unique(np.sort(sides, axis=1), axis=0, return_counts=True)[1]
    stages = last.times.keys()
    least = [min(run.times[stage] for run in runs) for stage in stages]
    return Granularity(
        tau=tau,
        measures=last.measures,
        intervisible=int(last.edge_intervisible.sum()),
        hull=int((shared == 1).sum()),
        copies=len(last.nodes) - len(np.unique(triangles)),
        times=StageTimes(*least),
    )


def _timed(tau: int, runs: Sequence[Analysis]) -> TimedRuns:
    stages = tuple(runs[0].times.keys())
    return TimedRuns(tau, stages, np.array([[run.times[name] for name in stages] for run in runs]))


def agreement(method: Analysis, reference: Analysis) -> Agreement:
    """How far `method` says of its nodes what `reference` says of the same returns."""
    common, here, there = np.intersect1d(
        method.nodes, reference.nodes, assume_unique=True, return_indices=True
    )
    if len(common) == 0:
        return Agreement(0, float("nan"), float("nan"))
    ours, theirs = method.node_intervisible[here], reference.node_intervisible[there]
    both, neither = np.sum(ours & theirs), np.sum(~ours & ~theirs)
    only_ours, only_theirs = np.sum(ours & ~theirs), np.sum(~ours & theirs)
    spread = np.sqrt(
        float(ours.sum()) * float((~ours).sum()) * float(theirs.sum()) * float((~theirs).sum())
    )
    product = float(both) * float(neither) - float(only_ours) * float(only_theirs)
    return Agreement(
        nodes=len(common),
        share=100.0 * float(both + neither) / len(common),
        correlation=product / spread if spread else float("nan"),
    )
