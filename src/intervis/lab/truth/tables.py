"""Tables of an evaluation: all methods at their best or at every setting, and the paper's graph."""

import math
from operator import attrgetter
from typing import TYPE_CHECKING

from intervis.lab.truth.scores import COVERAGES
from intervis.plots.tables import Table

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from intervis.lab.truth.paper_graph import GraphScore
    from intervis.lab.truth.results import EvaluationResult, MethodResult
    from intervis.lab.truth.scores import Scores

SCORE_HEADINGS = (
    "MCC",
    "AURC",
    "AUC",
    "Brier",
    "max cal. error",
    "coverage",
    "MCC answered",
    "precision visible",
    "precision occluded",
)
SCORE_FIELDS = (
    ("mcc", ".3f"),
    ("aurc", ".3f"),
    ("auc", ".3f"),
    ("brier", ".3f"),
    ("reliability.max_calibration_error", ".3f"),
    ("coverage", ".1%"),
    ("mcc_answered", ".3f"),
    ("precision_visible", ".1%"),
    ("precision_occluded", ".1%"),
)
"""Attribute of the scores and format, below each heading."""

NOTE = (
    "MCC: Matthews correlation over all targets, visible from a probability of 0.5 on. Max cal."
    " error: largest calibration error of the reliability diagram, over bins with at least 1 % of"
    ' the targets. Coverage: fraction of targets whose state is not "unknown"; the next three'
    " columns are over these targets. Scores are means over the viewpoints, the calibration error"
    " is that of their pooled bins. Prepare and answer: median times for one viewpoint, ms (blank:"
    " included in answer)."
)
RISK_HEADINGS = (
    "MCC",
    "AURC",
    *(
        f"false {state} at {coverage:.0%}"
        for coverage in COVERAGES
        for state in ("visible", "occluded")
    ),
    "unknown said",
    "unknown visible",
)
RISK_FIELDS = (
    ("mcc", ".3f"),
    ("aurc", ".4f"),
    ("false_visible_60", ".1%"),
    ("false_occluded_60", ".1%"),
    ("false_visible_80", ".1%"),
    ("false_occluded_80", ".1%"),
    ("false_visible_95", ".1%"),
    ("false_occluded_95", ".1%"),
    ("unknown_probability", ".3f"),
    ("unknown_visible_fraction", ".3f"),
)
RISK_NOTE = (
    "AURC: mean risk over all coverages; the risk at a coverage is the fraction of wrong answers"
    " among the targets with the probability farthest from 0.5. False visible (occluded): fraction"
    " of these targets that are called visible (occluded), and are not; the sum of the two is the"
    " risk. Unknown said, unknown visible: mean probability of the targets whose state is"
    ' "unknown", and the fraction of them that are visible.'
)

GRAPH_HEADINGS = (
    "viewpoint",
    "tau",
    "criterion",
    "nodes",
    "visible",
    "predicted",
    "precision",
    "MCC",
    "edges",
    "free",
    "predicted",
    "precision",
)
GRAPH_FIELDS = (
    ("nodes", ".0f"),
    ("nodes_visible", ".1%"),
    ("nodes_predicted", ".1%"),
    ("nodes_precision", ".1%"),
    ("nodes_mcc", ".3f"),
    ("edges", ".0f"),
    ("edges_visible", ".1%"),
    ("edges_predicted", ".1%"),
    ("edges_precision", ".1%"),
)
GRAPH_NOTE = (
    "Visible (free): fraction of the labelled nodes (edges) that are visible (free), which is the"
    " precision of calling all of them intervisible. Predicted: fraction that the graph calls"
    " intervisible; precision: fraction of these that are visible (free). From the sensor all"
    " returns are visible. Nodes are labelled from the viewpoint, edges by whether their two ends"
    " see each other."
)


def accuracy_table(evaluation: "EvaluationResult", *, every_setting: bool = False) -> Table:
    """One row for each method at its best setting, or at every setting.

    The rows of each subset of the targets follow.
    """
    results = evaluation.results if every_setting else evaluation.best_settings()
    cells = [
        (name, *_texts(scores, SCORE_FIELDS), *times) for name, scores, times in _rows(results)
    ]
    title = (
        f"{evaluation.source}: {evaluation.ground_truth}, protocol {evaluation.protocol},"
        f" {_counted(len(evaluation.query_sets), 'viewpoint')},"
        f" {_counted(evaluation.target_count, 'point')}"
    )
    return Table(title, ("method", *SCORE_HEADINGS, "prepare", "answer"), tuple(cells), (NOTE,))


def risk_table(evaluation: "EvaluationResult", *, every_setting: bool = False) -> Table:
    """Risk and coverage: one row for each method, and for each subset of the targets."""
    results = evaluation.results if every_setting else evaluation.best_settings()
    cells = [(name, *_texts(scores, RISK_FIELDS)) for name, scores, _ in _rows(results)]
    title = (
        f"{evaluation.source}: risk and coverage, {evaluation.ground_truth}, protocol"
        f" {evaluation.protocol}"
    )
    return Table(title, ("method", *RISK_HEADINGS), tuple(cells), (RISK_NOTE,))


def viewpoint_table(evaluation: "EvaluationResult", *, every_method: bool = False) -> Table:
    """The scores of the engine for each viewpoint, or those of all methods.

    Each other method is shown at the setting with its highest MCC for that viewpoint.
    """
    engine, *_ = evaluation.results
    cells: list[tuple[str, ...]] = []
    for place, label in enumerate(evaluation.query_sets):
        cells.append((label, *_texts(engine.scores[place], SCORE_FIELDS)))
        if every_method:
            cells += [
                (f"{label}, {_name(result)}", *_texts(result.scores[place], SCORE_FIELDS))
                for result in evaluation.best_settings(label)[1:]
            ]
    methods = "all methods" if every_method else engine.method
    return Table(f"{methods}, each viewpoint", ("viewpoint", *SCORE_HEADINGS), tuple(cells))


def graph_table(ground_truth: str, scores: "Sequence[GraphScore]") -> Table:
    """The paper's graph: one row for each viewpoint, tau and criterion."""
    cells = tuple(
        (score.viewpoint, str(score.tau), score.criterion, *_texts(score, GRAPH_FIELDS))
        for score in scores
    )
    title = f"The paper's graph compared with {ground_truth}"
    return Table(title, GRAPH_HEADINGS, cells, (GRAPH_NOTE,))


def _name(result: "MethodResult") -> str:
    setting = result.setting
    return result.method if setting == "default" else f"{result.method} ({setting})"


def _rows(
    results: "Sequence[MethodResult]",
) -> "Iterator[tuple[str, Scores, tuple[str, str]]]":
    """Name, scores and times of each method, then of each subset of its targets."""
    for result in results:
        yield _name(result), result.mean, _times(result)
    for subset in results[0].subsets if results else ():
        for result in results:
            yield f"{_name(result)}, {subset}", result.mean_of(subset), ("", "")


def _times(result: "MethodResult") -> tuple[str, str]:
    prepare = "" if result.prepare_s == 0 else _text(1e3 * result.prepare_s, ".0f")
    return prepare, _text(1e3 * result.answer_s, ".0f")


def _counted(count: int, noun: str) -> str:
    return f"{count:,} {noun}{'' if count == 1 else 's'}"


def _texts(record: object, fields: "Sequence[tuple[str, str]]") -> tuple[str, ...]:
    """The named attributes of a record, each in its format."""
    return tuple(_text(attrgetter(name)(record), form) for name, form in fields)


def _text(value: float, form: str) -> str:
    return format(value, form) if math.isfinite(value) else "-"
