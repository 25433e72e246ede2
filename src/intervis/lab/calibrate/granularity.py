"""Calibration of ``tau="auto"``: TPI lost against nodes, and the time of a frame."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import nnls

from intervis.arrays import Float64Array
from intervis.errors import SettingsError
from intervis.lab.calibrate.outcome import Outcome, versions
from intervis.lab.calibrate.plan import (
    GranularityInput,
    Plan,
    check_drive,
    fingerprints,
    opened,
)
from intervis.lab.paper.curve import COARSEST, tpi_curve
from intervis.lab.paper.experiment import camera_arguments, usable
from intervis.lab.paper.interpretations import spread_frames
from intervis.method.analysis import analyze
from intervis.method.granularity import (
    REFERENCE_DELAUNAY_MS,
    TAU_CANDIDATES,
    machine_speed_factor,
)
from intervis.progress import Progress, reporter
from intervis.settings import Settings

if TYPE_CHECKING:
    from intervis.drives import Frame

REPEATS = 5
"""Runs of a frame at one granularity; their median counts."""
WITHIN_BUDGET = 0.9
"""Share of the frames whose time must stay within the budget."""


@dataclass(frozen=True, eq=False)
class TimeModel:
    """Time of a frame: ``frame_ms + 1e-3 (return_us n_fov + node_us n)``.

    `budget_share` is the share of a budget that the predicted time may take so that
    `WITHIN_BUDGET` of the measured times stay within the budget.
    """

    frame_ms: float
    return_us: float
    node_us: float
    budget_share: float


def fit_times(n_fov: Float64Array, nodes: Float64Array, time_ms: Float64Array) -> TimeModel:
    """Non-negative least squares of the relative errors.

    Examples
    --------
    >>> n_fov, nodes = np.array([1e4, 2e4, 2e4, 1e4]), np.array([300.0, 600.0, 5000.0, 9000.0])
    >>> times = fit_times(n_fov, nodes, 0.5 + 1e-3 * (0.2 * n_fov + 8.0 * nodes))
    >>> round(times.frame_ms, 3), round(times.return_us, 3), round(times.node_us, 3)
    (0.5, 0.2, 8.0)
    """
    columns = np.stack([np.ones(len(nodes)), 1e-3 * n_fov, 1e-3 * nodes], axis=1)
    found, _ = nnls(columns / time_ms[:, None], np.ones(len(nodes)))
    excess = time_ms / (columns @ found)
    share = min(1.0, 1.0 / float(np.quantile(excess, WITHIN_BUDGET)))
    frame_ms, return_us, node_us = map(float, found)
    return TimeModel(frame_ms, return_us, node_us, share)


def calibrate_granularity(plan: Plan, data: Path, *, progress: Progress | None = None) -> Outcome:
    """Measure all numbers of `intervis/method/granularity.toml`.

    Raises
    ------
    SettingsError
        The plan names no drive for it.
    DriveError
        A drive cannot be opened.
    """
    section = check_granularity(plan, data)
    report = reporter(progress)
    frames: list[Frame] = []
    for name in section.drives:
        with opened(name, data) as drive:
            frames += spread_frames(drive, section.frames_per_drive)
    curve = tpi_curve(frames, progress=report)
    # From few nodes to many; more nodes never lose more.
    nodes = [round(point.nodes) for point in reversed(curve)]
    lost = np.minimum.accumulate([point.mean_lost for point in reversed(curve)])
    times = fit_times(*_measured_times(frames, report))
    outcome = Outcome()
    outcome.provenance.update(
        command="intervis calibrate",
        versions=versions(),
        tpi_lost=f"mean over {len(frames)} frames: {', '.join(section.drives)}",
        times="the same frames, camera view and 90 degrees ahead",
        drives=fingerprints(section.drives, data),
    )
    outcome.numbers.update(
        nodes=nodes,
        tpi_lost=np.round(lost, 2).tolist(),
        frame_ms=times.frame_ms,
        return_us=times.return_us,
        node_us=times.node_us,
        reference_delaunay_ms=machine_speed_factor() * REFERENCE_DELAUNAY_MS,
        budget_share=times.budget_share,
    )
    return outcome


def check_granularity(plan: Plan, data: Path) -> GranularityInput:
    """The plan's section, after a look at its drives; raises as `calibrate_granularity`."""
    if plan.granularity is None:
        raise SettingsError("the plan has no section [granularity]: name drives there.")
    for name in plan.granularity.drives:
        check_drive(name, data)
    return plan.granularity


def granularity_steps(plan: Plan) -> int:
    """How often `calibrate_granularity` reports progress at most."""
    if plan.granularity is None:
        return 0
    return 2 * len(plan.granularity.drives) * plan.granularity.frames_per_drive


def _measured_times(
    frames: "Sequence[Frame]", report: Progress
) -> tuple[Float64Array, Float64Array, Float64Array]:
    """Returns in view, nodes and median time of each frame, view and granularity."""
    rows = []
    for given in frames:
        for view in ("camera", "front"):
            frame, settings, _ = usable(given, Settings(view=view))
            for tau in (tau for tau in TAU_CANDIDATES if tau <= COARSEST):
                chosen = settings.with_changes(tau=tau)
                results = [
                    analyze(frame.points, settings=chosen, **camera_arguments(frame))
                    for _ in range(REPEATS)
                ]
                measures = results[0].measures
                time_ms = 1e3 * median(result.times.total for result in results)
                rows.append((measures.n_fov, measures.n, time_ms))
        report(f"times, frame {given.number}")
    n_fov, nodes, time_ms = np.array(rows, dtype=np.float64).T
    return n_fov, nodes, time_ms
