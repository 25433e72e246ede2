"""The calibration of the occupancy model, stage by stage."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from intervis.drives import Drive
from intervis.errors import SettingsError
from intervis.lab.calibrate import curves, probability
from intervis.lab.calibrate.line_set import QueryLines, SampleTable, query_lines, sample_table
from intervis.lab.calibrate.outcome import Outcome, versions
from intervis.lab.calibrate.plan import (
    STREET,
    STREET_FRAMES,
    Input,
    Plan,
    Stage,
    check_drive,
    fingerprints,
    opened,
)
from intervis.lab.truth.evaluation import chosen_pairs, held_out_query_sets, world_query_sets
from intervis.lab.truth.held_out import SILHOUETTES_VISIBLE
from intervis.lab.truth.labelled_targets import HeldOutSettings
from intervis.lab.truth.query_set import QuerySet
from intervis.lab.worlds import load_world
from intervis.progress import Progress, silent
from intervis.sight import occupancy_model as model
from intervis.sight.answers import sum_lines
from intervis.sight.kernels.parameters import OccupancyModel

LABELS = HeldOutSettings(rule=SILHOUETTES_VISIBLE)
"""The shipped numbers were fitted with silhouettes labelled visible."""
PROBABILITY_LINES = 20
"""So many times more lines are drawn for `probability` and `thresholds`: the engine sums them."""


def calibrate_model(plan: Plan, data: Path, *, progress: Progress | None = None) -> Outcome:
    """Fit all numbers of `intervis/sight/occupancy_model.toml`.

    Parameters
    ----------
    plan : Plan
    data : Path
        Folder of the drives that the plan names.
    progress : callable, optional
        See `intervis.progress`.

    Returns
    -------
    Outcome

    Raises
    ------
    SettingsError
        No input of the plan is used for one of the stages.
    MissingExtraError
        The plan names a built-in street and embreex is not installed.
    DriveError
        A drive cannot be opened, or lacks frames, poses or a reference for a pair.
    """
    report = progress or silent
    check_inputs(plan, data)
    result = Outcome()
    result.provenance.update(command="intervis calibrate", versions=versions())
    table = _table(plan, data, "curves", report)
    knots = {"depth_m": model.FITTED["depth_m"], "height_m": model.FITTED["height_m"]}
    depth_m, height_m = (np.array(values, dtype=np.float64) for values in knots.values())

    fitted = curves.fit_curves(table, depth_m, height_m)
    report("curves")
    weights_table = _table(plan, data, "weights", report)
    decay, correlation, _ = curves.choose_weights(weights_table, fitted, depth_m, height_m)
    fitted = curves.fit_curves(table, depth_m, height_m, decay, correlation)
    report("weights")
    result.numbers.update(
        weight_decay=decay,
        correlation=correlation,
        attenuation_per_m=fitted.attenuation_per_m,
        base_optical_depth=fitted.base_optical_depth,
        **knots,
        surface_log_odds=fitted.surface_log_odds.tolist(),
        volumetric_log_odds=fitted.volumetric_log_odds.tolist(),
        height_log_odds=fitted.height_log_odds.tolist(),
        # Chosen by hand: near the mean of the height curve over the heights of traffic.
        unknown_height_log_odds=model.FITTED["unknown_height_log_odds"],
    )
    engine = model.model_of({**model.FITTED, **result.numbers})

    lines = _judged(plan, data, "probability", engine, report)
    numbers, loss = probability.fit_probability(lines)
    result.numbers.update(numbers)
    report("probability")
    # A query without a time has the default time gap; the thresholds must be reachable then.
    worlds = _judged(plan, data, "thresholds", engine, report)
    worlds = replace(worlds, time_gap_s=np.full(len(worlds.visible), model.DEFAULT_TIME_GAP_S))
    theta = np.array([numbers[name] for name in probability.NAMES])
    p = probability.line_probability(worlds, theta)
    result.numbers.update(probability.choose_thresholds(worlds, p))
    report("thresholds")
    result.provenance.update(
        curves=_used(plan, "curves"),
        weights=_used(plan, "weights"),
        probability=_used(plan, "probability"),
        thresholds=_used(plan, "thresholds"),
        drives=fingerprints((given.drive for given in plan.inputs), data),
        lines_per_pair=plan.lines_per_pair,
        seed=plan.seed,
        loss_curves=fitted.loss,
        loss_curves_shipped=curves.loss_of(table, model.FITTED),
        loss_probability=loss,
    )
    return result


def model_steps(plan: Plan) -> int:
    """How often `calibrate_model` reports progress."""
    used = [given for given in plan.inputs for _ in given.stages]
    return 4 + sum(len(given.protocols) for given in used)


def check_inputs(plan: Plan, data: Path) -> None:
    """Raise before the work where `calibrate_model` would raise: stages, drives, frame numbers."""
    for stage in ("curves", "weights", "probability", "thresholds"):
        if not any(stage in given.stages for given in plan.inputs):
            raise SettingsError(f"no input of the plan is used for the stage {stage!r}: name one.")
    for given in plan.inputs:
        if "thresholds" in given.stages and not given.drive.startswith(STREET):
            raise SettingsError(
                f"the stage 'thresholds' needs an exact world (street:SEED), got {given.drive!r}."
            )
    for given in plan.inputs:
        drive = check_drive(given.drive, data)
        if drive is not None:
            chosen_pairs(drive, given.frame_pairs)  # raises where a frame or a pose is missing
            continue
        for i, j in given.frame_pairs:
            if i == j or max(i, j) >= STREET_FRAMES:
                raise SettingsError(
                    f"{given.drive} has the frames 0 to {STREET_FRAMES - 1}: pairs must be two of"
                    f" them, got {i}:{j}."
                )


def _used(plan: Plan, stage: Stage) -> str:
    return "; ".join(
        f"{given.drive} {given.pairs} {' '.join(given.protocols)}"
        for given in plan.inputs
        if stage in given.stages
    )


def _table(plan: Plan, data: Path, stage: Stage, report: Progress) -> SampleTable:
    depth_m, height_m = (
        np.array(model.FITTED[name], dtype=np.float64) for name in ("depth_m", "height_m")
    )
    return sample_table(_queries(plan, data, stage, plan.lines_per_pair, report), depth_m, height_m)


def _judged(
    plan: Plan, data: Path, stage: Stage, engine: OccupancyModel, report: Progress
) -> probability.JudgedLines:
    count = PROBABILITY_LINES * plan.lines_per_pair
    return probability.joined(
        [
            probability.judged_lines(
                sum_lines(queries.scans, queries.starts, queries.ends, engine),
                np.linalg.norm(queries.ends - queries.starts, axis=1),
                queries.visible,
                base=engine.parameters.base_optical_depth,
                single_scan=len(queries.scans.position) == 1,
            )
            for queries in _queries(plan, data, stage, count, report)
        ]
    )


def _queries(
    plan: Plan, data: Path, stage: Stage, count: int, report: Progress
) -> Iterator[QueryLines]:
    rng = np.random.default_rng(plan.seed)
    for given in plan.inputs:
        if stage not in given.stages:
            continue
        with opened(given.drive, data) as drive:
            for protocol in given.protocols:
                for query_set in _query_sets(drive, given, stage, protocol):
                    yield query_lines(query_set, count, rng)
                report(f"{stage}: {given.drive}, {protocol}")


def _query_sets(drive: Drive, given: Input, stage: Stage, protocol: Any) -> Iterator[QuerySet]:
    if stage != "thresholds":
        yield from held_out_query_sets(drive, given.frame_pairs, protocol, LABELS)
        return
    world = load_world(drive.root)
    frames = sorted({i for i, _ in given.frame_pairs})
    yield from world_query_sets(
        drive, lambda number: world.triangles_at_frame(number)[0], frames, protocol
    )
