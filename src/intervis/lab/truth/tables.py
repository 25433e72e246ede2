"""Tables of an evaluation: every method's best setting, and all settings."""

import math
from typing import TYPE_CHECKING

from intervis.plots.tables import Table

if TYPE_CHECKING:
    from collections.abc import Sequence

    from intervis.lab.truth.paper_graph import GraphScore
    from intervis.lab.truth.scores import Scores
    from intervis.lab.truth.scoring import Evaluation, Row

HEADINGS = (
    "method",
    "MCC",
    "AUC",
    "Brier",
    "gap",
    "answered",
    "MCC of these",
    "visible ok",
    "occluded ok",
    "prepare",
    "answer",
)
NOTE = (
    "MCC: every point answered, visible from a probability of 0.5 on. Gap: largest gap of the"
    " reliability plot, in bins with 1 % of the points or more. Answered: share that is not"
    ' "unknown"; the next three columns are about these points: their MCC, and how often'
    ' "visible" and "occluded" were right. Averages over the viewpoints; times are medians'
    " for one viewpoint, ms (blank: part of the answer)."
)


GRAPH_HEADINGS = (
    "viewpoint",
    "tau",
    "criterion",
    "nodes",
    "visible",
    "called",
    "right",
    "MCC",
    "edges",
    "free",
    "called",
    "right",
)
GRAPH_NOTE = (
    "Visible (free): share of the judged nodes (edges) that really are, which is what calling"
    " all of them intervisible would get right. Called: share that the graph calls intervisible;"
    " right: how many of these really are. From the sensor every return is visible. Nodes are"
    " judged from the viewpoint, edges by whether their two ends see each other."
)


def graph_table(truth: str, scores: "Sequence[GraphScore]") -> Table:
    """The paper's graph under one truth: a row for each viewpoint, tau and criterion."""
    cells = tuple(
        (
            score.viewpoint,
            str(score.tau),
            score.criterion,
            f"{score.nodes:.0f}",
            *(_text(x, ".1%") for x in (score.nodes_visible, score.nodes_said, score.nodes_right)),
            _text(score.nodes_mcc, ".3f"),
            _text(score.edges, ".0f"),
            *(_text(x, ".1%") for x in (score.edges_visible, score.edges_said, score.edges_right)),
        )
        for score in scores
    )
    return Table(f"The paper's graph judged by {truth}", GRAPH_HEADINGS, cells, (GRAPH_NOTE,))


def accuracy_table(evaluation: "Evaluation", *, every_setting: bool = False) -> Table:
    """One row for each method at its best setting, or for every setting.

    Where targets are of several kinds, the rows of each kind follow.
    """
    rows = evaluation.rows if every_setting else evaluation.best_rows()
    cells = [_cells(_name(row), row.mean, row) for row in rows]
    for part in rows[0].parts if rows else ():
        cells += [_cells(f"{_name(row)}, {part}", row.mean_of(part), None) for row in rows]
    title = (
        f"{evaluation.source}: {evaluation.truth}, protocol {evaluation.protocol},"
        f" {len(evaluation.questions)} viewpoints, {evaluation.points:,} points"
    )
    return Table(title, HEADINGS, tuple(cells), (NOTE,))


def questions_table(evaluation: "Evaluation") -> Table:
    """Ours for each question: nothing hides behind an average."""
    row = evaluation.rows[0]
    cells = [
        _cells(label, scores, None)[:-2]
        for label, scores in zip(row.labels, row.scores, strict=True)
    ]
    return Table(f"{row.method}, each viewpoint", ("viewpoint", *HEADINGS[1:-2]), tuple(cells))


def _name(row: "Row") -> str:
    return row.method if row.setting == "default" else f"{row.method} ({row.setting})"


def _cells(name: str, scores: "Scores", row: "Row | None") -> tuple[str, ...]:
    return (
        name,
        _text(scores.mcc, ".3f"),
        _text(scores.auc, ".3f"),
        _text(scores.brier, ".3f"),
        _text(scores.reliability.largest_gap, ".3f"),
        _text(scores.coverage, ".1%"),
        _text(scores.mcc_answered, ".3f"),
        _text(scores.precision_visible, ".1%"),
        _text(scores.precision_occluded, ".1%"),
        "" if row is None or row.prepare_s == 0 else _text(1e3 * row.prepare_s, ".0f"),
        "" if row is None else _text(1e3 * row.answer_s, ".0f"),
    )


def _text(value: float, form: str) -> str:
    return format(value, form) if math.isfinite(value) else "-"
