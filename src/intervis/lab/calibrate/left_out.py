"""How well fitted numbers hold on what they were not fitted to.

One scanner, mount, world or drive at a time is left out of the lines of the stage `curves`; all
numbers but the thresholds are fitted without it, and judged on it.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from intervis.arrays import BoolArray
from intervis.errors import SettingsError
from intervis.lab.calibrate import curves
from intervis.lab.calibrate.fit import check_inputs, curve_lines, fit_numbers
from intervis.lab.calibrate.line_set import QueryLines, SampleTable, lines_of, sample_table
from intervis.lab.calibrate.plan import Plan
from intervis.lab.worlds.beam_pattern import PATTERNS
from intervis.lab.worlds.mounts import MOUNTS
from intervis.lab.worlds.places import PLACES
from intervis.plots.tables import Table
from intervis.progress import Progress, reporter
from intervis.sight import occupancy_model as model


@dataclass(frozen=True)
class LeftOut:
    """Mean negative log-likelihood per line of what was left out.

    Attributes
    ----------
    name : str
        A scanner, mount, world or drive.
    lines : int
    fitted_without, fitted_with : float
        Under the numbers that were fitted without and with these lines.
    """

    name: str
    lines: int
    fitted_without: float
    fitted_with: float


def sources(plan: Plan) -> tuple[str, ...]:
    """Names of the scanners, mounts, worlds and drives of the stage `curves`.

    Examples
    --------
    >>> sources(Plan(matrix={"curves": [1], "leave_out": ["tilted"]}))[-9:-1]
    ('tripod', 'street', 'crossing', 'crest', 'hall', 'forest', 'roadside', 'car-park')
    """
    of_matrix = (*PATTERNS, *MOUNTS, *PLACES) if plan.matrix.curves else ()
    drives = dict.fromkeys(given.drive for given in plan.inputs if "curves" in given.stages)
    return (*(name for name in of_matrix if name not in plan.matrix.leave_out), *drives)


def checked_sources(plan: Plan, names: Sequence[str]) -> tuple[str, ...]:
    """The names; all that the plan has, where none is given.

    Raises
    ------
    SettingsError
        The plan has no lines of a name, or no others.
    """
    known = sources(plan)
    for name in names:
        if name not in known:
            raise SettingsError(
                f"the plan has no {name!r} to leave out: it has {', '.join(known)}."
            )
    if len(known) < 2:
        raise SettingsError("the plan has one drive and no matrix: nothing is left to fit.")
    return tuple(names) or known


def left_out_steps(plan: Plan, names: Sequence[str]) -> int:
    """How often `leave_each_out` reports progress."""
    inputs = [given for given in plan.inputs if "curves" in given.stages]
    sampled = len(plan.matrix.curves) + sum(len(given.protocols) for given in inputs)
    return sampled + 1 + len(names)


def leave_each_out(
    plan: Plan, data: Path, names: Sequence[str], *, progress: Progress | None = None
) -> Iterator[LeftOut]:
    """Leave out one of `names` (`checked_sources`) at a time."""
    report = reporter(progress)
    check_inputs(plan, data)
    queries = list(curve_lines(plan, data, report))
    knots = (np.array(model.FITTED[name], dtype=np.float64) for name in curves.KNOTS)
    table = sample_table(queries, *knots)
    fitted, _ = fit_numbers(table)
    report("all lines")
    for name in names:
        yield _judged(name, table, _rows(queries, name), fitted)
        report(name)


def _rows(queries: Sequence[QueryLines], name: str) -> BoolArray:
    """Which lines are from a source."""
    return np.concatenate([np.full(len(q.starts), name in q.sources) for q in queries])


def _judged(name: str, table: SampleTable, rows: BoolArray, fitted: dict[str, object]) -> LeftOut:
    without, _ = fit_numbers(lines_of(table, ~rows))
    judge = lines_of(table, rows)
    return LeftOut(
        name, int(rows.sum()), curves.loss_of(judge, without), curves.loss_of(judge, fitted)
    )


def left_out_table(results: Sequence[LeftOut]) -> Table:
    """One row for each source."""
    rows = tuple(
        (one.name, f"{one.lines:,}", f"{one.fitted_without:.3f}", f"{one.fitted_with:.3f}")
        for one in results
    )
    heads = ("left out", "lines", "loss, fitted without it", "loss, fitted with it")
    return Table("Numbers judged on what was left out", heads, rows)
