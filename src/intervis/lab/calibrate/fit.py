"""The calibration of the occupancy model, stage by stage."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from intervis.errors import SettingsError
from intervis.lab.calibrate import curves, probability, risk
from intervis.lab.calibrate.line_set import QueryLines, SampleTable, query_lines, sample_table
from intervis.lab.calibrate.outcome import Outcome, versions
from intervis.lab.calibrate.plan import (
    STAGES,
    STREET_FRAMES,
    Input,
    Plan,
    Stage,
    check_drive,
    fingerprints,
    opened,
)
from intervis.lab.truth.cells import (
    KINDS,
    NO_ECHO,
    cells,
    exact_lines,
    lines_without_echo,
    random_of,
    scan_of,
)
from intervis.lab.truth.evaluation import chosen_pairs, held_out_query_sets
from intervis.lab.truth.labelled_targets import HeldOutSettings
from intervis.lab.worlds.places import PLACES, Place
from intervis.lab.worlds.ray_casting import require_embreex
from intervis.progress import Progress, reporter
from intervis.sight import Scene
from intervis.sight import occupancy_model as model
from intervis.sight.answers import answer_lines, sum_lines
from intervis.sight.kernels.parameters import OccupancyModel

ROUNDS = 3
"""Curves and probability are fitted in turns, so many times."""


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
        The plan names no lines for one of the stages.
    MissingExtraError
        The plan names a generated world and embreex is not installed.
    DriveError
        A drive cannot be opened, or lacks frames, poses or a reference for a pair.
    """
    report = reporter(progress)
    check_inputs(plan, data)
    knots = {name: model.FITTED[name] for name in curves.KNOTS}
    table = sample_table(
        curve_lines(plan, data, report),
        *(np.array(values, dtype=np.float64) for values in knots.values()),
    )
    numbers, losses = fit_numbers(table)
    report("curves")
    engine = model.model_of({**model.FITTED, **numbers})
    numbers |= fit_thresholds(_queries(plan, data, "thresholds", report), engine)
    report("thresholds")
    provenance: dict[str, Any] = {
        "command": "intervis calibrate",
        "versions": versions(),
        **{stage: _used(plan, stage) for stage in STAGES},
        "drives": fingerprints((given.drive for given in plan.inputs), data),
        "lines_per_pair": plan.lines_per_pair,
        "seed": plan.seed,
        **losses,
        "loss_shipped": curves.loss_of(table, model.FITTED),
    }
    return Outcome(numbers, provenance)


def fit_numbers(table: SampleTable) -> tuple[dict[str, Any], dict[str, float]]:
    """All numbers but the thresholds, and the losses by name.

    Curves and probability are fitted in turns, each with the numbers of the other one fixed; the
    weights of the scans are chosen after the first turn.
    """
    # Chosen by hand: near the mean of the height curve over the heights of traffic.
    names = (*curves.KNOTS, "unknown_height_log_odds", "weight_decay", "correlation")
    numbers: dict[str, Any] = {name: model.FITTED[name] for name in names}
    numbers.update(zip(probability.NAMES, probability.START, strict=True))
    for turn in range(ROUNDS):
        parameters = model.model_of({**model.FITTED, **numbers}).parameters
        fitted = curves.fit_curves(
            table, numbers, parameters, numbers["weight_decay"], numbers["correlation"]
        )
        numbers |= fitted.numbers()
        of_lines, loss = probability.fit_probability(curves.line_depths(table, numbers))
        numbers |= of_lines
        if turn == 0:
            decay, correlation, _ = curves.choose_weights(table, fitted, numbers)
            numbers |= {"weight_decay": decay, "correlation": correlation}
    return numbers, {"loss_curves": fitted.loss, "loss_probability": loss}


def fit_thresholds(queries: Iterator[QueryLines], engine: OccupancyModel) -> dict[str, list[float]]:
    """The thresholds of the words for each risk; see `intervis.lab.calibrate.risk`."""
    observed, unobserved, occluded = [], [], []
    for _, group in groupby(queries, key=lambda lines: lines.unit):
        parts = [_answered(lines, engine) for lines in group]
        p, mostly, meets, visible = (np.concatenate(part) for part in zip(*parts, strict=True))
        leans = p >= 0.5
        observed.append(risk.Unit(p[leans & mostly], visible[leans & mostly]))
        unobserved.append(risk.Unit(p[leans & ~mostly], visible[leans & ~mostly]))
        rows = ~leans & meets
        occluded.append(risk.Unit(1.0 - p[rows], ~visible[rows]))
    return {
        "risks": list(risk.RISKS),
        "visible_from": risk.thresholds(observed),
        "visible_unobserved_from": risk.thresholds(unobserved),
        "occluded_to": [1.0 - limit for limit in risk.thresholds(occluded)],
    }


def _answered(lines: QueryLines, engine: OccupancyModel) -> tuple[Any, Any, Any, Any]:
    """P(visible) of lines; masks: mostly observed, on a surface, visible."""
    answers = answer_lines(lines.scans, lines.starts, lines.ends, paired=True, model=engine)
    sums = sum_lines(lines.scans, lines.starts, lines.ends, engine)
    length_m = np.linalg.norm(lines.ends - lines.starts, axis=1)
    mostly = model.mostly_observed(sums.unobserved_m, sums.occluded_space_m, length_m)
    meets = sums.surface >= model.OCCLUDED_MIN_SURFACE
    return answers.probability, mostly, meets, lines.visible


def model_steps(plan: Plan) -> int:
    """How often `calibrate_model` reports progress."""
    of_drives = sum(len(given.protocols) * len(given.stages) for given in plan.inputs)
    return 2 + of_drives + len(plan.matrix.curves) + len(plan.matrix.thresholds)


def check_inputs(plan: Plan, data: Path) -> None:
    """Raise before the work where `calibrate_model` would raise: stages, drives, frame numbers."""
    seeds = {"curves": plan.matrix.curves, "thresholds": plan.matrix.thresholds}
    for stage in STAGES:
        if not seeds[stage] and not any(stage in given.stages for given in plan.inputs):
            raise SettingsError(f"no input of the plan is used for the stage {stage!r}: name one.")
    if any(seeds.values()):
        require_embreex()  # before minutes of work, not after them
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
    seeds = plan.matrix.curves if stage == "curves" else plan.matrix.thresholds
    drives = [
        f"{given.drive} {given.pairs} {' '.join(given.protocols)} {' '.join(given.targets)}"
        for given in plan.inputs
        if stage in given.stages
    ]
    left_out = f" without {' '.join(plan.matrix.leave_out)}" if plan.matrix.leave_out else ""
    matrix = [f"matrix seeds {' '.join(map(str, seeds))}{left_out}"] if seeds else []
    return "; ".join(matrix + drives)


def curve_lines(plan: Plan, data: Path, report: Progress) -> Iterator[QueryLines]:
    """The lines of the stage `curves`."""
    return _queries(plan, data, "curves", report)


def _queries(plan: Plan, data: Path, stage: Stage, report: Progress) -> Iterator[QueryLines]:
    seeds = plan.matrix.curves if stage == "curves" else plan.matrix.thresholds
    lines = plan.matrix.lines if stage == "curves" else plan.matrix.threshold_lines
    for seed in seeds:
        yield from matrix_lines(seed, lines, plan.matrix.leave_out, with_silent=stage == "curves")
        report(f"{stage}: matrix, seed {seed}")
    count = plan.lines_per_pair if stage == "curves" else plan.threshold_lines_per_pair
    rng = np.random.default_rng(plan.seed)
    for given in plan.inputs:
        if stage in given.stages:
            yield from _drive_lines(given, data, stage, count, rng, report)


def _drive_lines(
    given: Input, data: Path, stage: Stage, count: int, rng: np.random.Generator, report: Progress
) -> Iterator[QueryLines]:
    with opened(given.drive, data) as drive:
        for protocol in given.protocols:
            for targets in given.targets:
                settings = HeldOutSettings(targets=targets, rate_hz=given.rate)
                family = f"{given.drive} {protocol} {targets}"
                for query_set in held_out_query_sets(drive, given.frame_pairs, protocol, settings):
                    lines = query_lines(query_set, count, rng)
                    unit = f"{family} {lines.label}"
                    yield replace(lines, family=family, unit=unit, sources=(given.drive,))
            report(f"{stage}: {given.drive}, {protocol}")


def matrix_lines(
    seed: int, count: int, leave_out: tuple[str, ...] = (), *, with_silent: bool = True
) -> Iterator[QueryLines]:
    """The lines of all cells, one query set for each kind of lines.

    `with_silent`: also lines along beams without echo. Nearly all of them end in the sky; among the
    lines of the thresholds they would make up for wrong answers elsewhere.
    """
    places: dict[str, Place] = {}
    for cell in cells():
        if {cell.scanner, cell.mount, cell.world} & set(leave_out):
            continue
        place = places.setdefault(cell.world, PLACES[cell.world](seed))
        rng = random_of(cell, seed)
        scan = scan_of(cell, place, rng)
        lines = exact_lines(place, scan, count, rng)
        silent = lines_without_echo(place, scan, count // len(KINDS) * with_silent, rng)
        scans = Scene.from_scan(scan.points, scan.pose).packed_scans()
        label = f"{cell.scanner} {cell.mount} {cell.world} {seed}"
        for k, kind in enumerate((*KINDS, NO_ECHO)):
            drawn = silent if kind == NO_ECHO else lines
            rows = drawn.kind == k
            if rows.any():
                yield QueryLines(
                    label,
                    scans,
                    drawn.starts[rows],
                    drawn.ends[rows],
                    drawn.visible[rows],
                    family=f"matrix {kind}",
                    unit=label,
                    sources=(cell.scanner, cell.mount, cell.world),
                )
