"""Tables of an evaluation: all methods at their best or at every setting, and the paper's graph."""

import math
from typing import TYPE_CHECKING

from intervis.lab.truth.scores import COVERAGES
from intervis.plots.tables import Table

if TYPE_CHECKING:
    from collections.abc import Sequence

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
    cells = [(_name(result), *_scores(result.mean), *_times(result)) for result in results]
    for subset in results[0].subsets if results else ():
        cells += [
            (f"{_name(result)}, {subset}", *_scores(result.mean_of(subset)), "", "")
            for result in results
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
    cells = [(_name(result), *_risks(result.mean)) for result in results]
    for subset in results[0].subsets if results else ():
        cells += [
            (f"{_name(result)}, {subset}", *_risks(result.mean_of(subset))) for result in results
        ]
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
        cells.append((label, *_scores(engine.scores[place])))
        if every_method:
            cells += [
                (f"{label}, {_name(result)}", *_scores(result.scores[place]))
                for result in evaluation.best_settings(label)[1:]
            ]
    methods = "all methods" if every_method else engine.method
    return Table(f"{methods}, each viewpoint", ("viewpoint", *SCORE_HEADINGS), tuple(cells))


def graph_table(ground_truth: str, scores: "Sequence[GraphScore]") -> Table:
    """The paper's graph: one row for each viewpoint, tau and criterion."""
    cells = tuple(
        (
            score.viewpoint,
            str(score.tau),
            score.criterion,
            f"{score.nodes:.0f}",
            _text(score.nodes_visible, ".1%"),
            _text(score.nodes_predicted, ".1%"),
            _text(score.nodes_precision, ".1%"),
            _text(score.nodes_mcc, ".3f"),
            _text(score.edges, ".0f"),
            _text(score.edges_visible, ".1%"),
            _text(score.edges_predicted, ".1%"),
            _text(score.edges_precision, ".1%"),
        )
        for score in scores
    )
    title = f"The paper's graph compared with {ground_truth}"
    return Table(title, GRAPH_HEADINGS, cells, (GRAPH_NOTE,))


def _name(result: "MethodResult") -> str:
    setting = result.setting
    return result.method if setting == "default" else f"{result.method} ({setting})"


def _scores(scores: "Scores") -> tuple[str, ...]:
    return (
        _text(scores.mcc, ".3f"),
        _text(scores.aurc, ".3f"),
        _text(scores.auc, ".3f"),
        _text(scores.brier, ".3f"),
        _text(scores.reliability.max_calibration_error, ".3f"),
        _text(scores.coverage, ".1%"),
        _text(scores.mcc_answered, ".3f"),
        _text(scores.precision_visible, ".1%"),
        _text(scores.precision_occluded, ".1%"),
    )


def _risks(scores: "Scores") -> tuple[str, ...]:
    return (
        _text(scores.mcc, ".3f"),
        _text(scores.aurc, ".4f"),
        _text(scores.false_visible_60, ".1%"),
        _text(scores.false_occluded_60, ".1%"),
        _text(scores.false_visible_80, ".1%"),
        _text(scores.false_occluded_80, ".1%"),
        _text(scores.false_visible_95, ".1%"),
        _text(scores.false_occluded_95, ".1%"),
        _text(scores.unknown_probability, ".3f"),
        _text(scores.unknown_visible_fraction, ".3f"),
    )


def _times(result: "MethodResult") -> tuple[str, str]:
    prepare = "" if result.prepare_s == 0 else _text(1e3 * result.prepare_s, ".0f")
    return prepare, _text(1e3 * result.answer_s, ".0f")


def _counted(count: int, noun: str) -> str:
    return f"{count:,} {noun}{'' if count == 1 else 's'}"


def _text(value: float, form: str) -> str:
    return format(value, form) if math.isfinite(value) else "-"
