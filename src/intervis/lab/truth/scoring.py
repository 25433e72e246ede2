"""An evaluation: one row for each method and setting, and every question behind it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from intervis.arrays import BoolArray
from intervis.lab.truth.methods import OURS, Answers, Method
from intervis.lab.truth.query_set import Question
from intervis.lab.truth.scores import Scores, average, score

SCHEMA = 1
"""Version of the JSON; it changes when a name does."""


@dataclass(eq=False)
class Row:
    """The scores of one method at one setting.

    Attributes
    ----------
    method, setting : str
    labels : list of str
        The questions, in order.
    scores : list of Scores
        Over all targets of each question that count.
    parts : dict of str to list of Scores
        Over each kind of target, where questions tell kinds apart.
    seconds : list of (float, float)
        To prepare and to answer, for each question.
    """

    method: str
    setting: str
    labels: list[str] = field(default_factory=list)
    scores: list[Scores] = field(default_factory=list)
    parts: dict[str, list[Scores]] = field(default_factory=dict)
    seconds: list[tuple[float, float]] = field(default_factory=list)

    @property
    def mean(self) -> Scores:
        """Averaged over the questions."""
        return average(self.scores)

    def mean_of(self, part: str) -> Scores:
        """Averaged over the questions, for one kind of target."""
        return average(self.parts[part])

    @property
    def prepare_s(self) -> float:
        """Median seconds before the first answer."""
        return _median([prepare for prepare, _ in self.seconds])

    @property
    def answer_s(self) -> float:
        """Median seconds for the answers to one question."""
        return _median([answer for _, answer in self.seconds])

    def take(self, question: Question, answers: Answers) -> None:
        """Score the answers to one more question."""
        self.labels.append(question.label)
        self.seconds.append((answers.prepare_s, answers.answer_s))
        self.scores.append(_scored(question, answers, question.counted))
        for part, rows in question.parts.items():
            self.parts.setdefault(part, []).append(_scored(question, answers, rows))


@dataclass(frozen=True, eq=False)
class Evaluation:
    """What was asked of which methods, and how good the answers were.

    Attributes
    ----------
    source : str
        Name of the drive.
    truth : str
        ``held-out returns``, or ``exact world`` and who cast its rays.
    protocol : str
        What the methods could see.
    questions : tuple of str
        Labels: ``i:j``, or ``frame from viewpoint``.
    points : int
        Targets with a known answer that count, all questions together.
    rows : tuple of Row
        Ours first.
    """

    source: str
    truth: str
    protocol: str
    questions: tuple[str, ...]
    points: int
    rows: tuple[Row, ...]

    def best_rows(self) -> list[Row]:
        """Of each method the row with the highest mean MCC, in the methods' order."""
        best: dict[str, Row] = {}
        for row in self.rows:
            known = best.get(row.method)
            if known is None or _comparable(row) > _comparable(known):
                best[row.method] = row
        return list(best.values())

    def row_of(self, method: str = OURS) -> Row:
        """The best row of one method."""
        return next(row for row in self.best_rows() if row.method == method)

    def to_json(self) -> dict[str, Any]:
        """Plain numbers, texts and lists; what cannot be known is None."""
        best = self.best_rows()
        return {
            "schema": SCHEMA,
            "source": self.source,
            "truth": self.truth,
            "protocol": self.protocol,
            "questions": list(self.questions),
            "points": self.points,
            "rows": [{**_row_json(row), "best_setting": row in best} for row in self.rows],
        }


def _scored(question: Question, answers: Answers, rows: BoolArray | None) -> Scores:
    chosen = slice(None) if rows is None else rows
    return score(
        question.visible[chosen],
        answers.probability[chosen],
        None if answers.state is None else answers.state[chosen],
    )


def run_questions(
    questions: Sequence[Question] | Any, methods: Sequence[Method], advance: Any
) -> tuple[list[Row], tuple[str, ...], int]:
    """Ask every method every question; rows, labels and the number of targets in all."""
    rows = [Row(method.name, method.setting) for method in methods]
    labels, points = [], 0
    for question in questions:
        labels.append(question.label)
        points += len(question.targets) if question.counted is None else question.counted.sum()
        for method, row in zip(methods, rows, strict=True):
            row.take(question, method.ask(question.seen, question.viewpoint, question.targets))
            advance(f"{question.label}, {method.name}, {method.setting}")
    return rows, tuple(labels), int(points)


def _row_json(row: Row) -> dict[str, Any]:
    return {
        "method": row.method,
        "setting": row.setting,
        "mean": scores_json(row.mean),
        "parts": {part: scores_json(row.mean_of(part)) for part in row.parts},
        "prepare_s": number(row.prepare_s),
        "answer_s": number(row.answer_s),
        "questions": {
            label: scores_json(scores) for label, scores in zip(row.labels, row.scores, strict=True)
        },
    }


def scores_json(scores: Scores) -> dict[str, Any]:
    """The scores by name, with the bins of the reliability plot."""
    bins = scores.reliability
    return {
        **{
            name: number(getattr(scores, name))
            for name in (
                "mcc",
                "auc",
                "brier",
                "coverage",
                "precision_visible",
                "precision_occluded",
                "mcc_answered",
                "visible_share",
            )
        },
        "count": scores.count,
        "reliability": {
            "weight": [number(value) for value in bins.weight],
            "said": [number(value) for value in bins.said],
            "true": [number(value) for value in bins.true],
            "largest_gap": number(bins.largest_gap),
            "largest_gap_of_all": number(bins.largest_gap_of_all),
            "mean_gap": number(bins.mean_gap),
        },
    }


def number(value: float) -> float | None:
    """A finite number, or None: JSON knows no NaN."""
    return float(value) if math.isfinite(value) else None


def _comparable(row: Row) -> float:
    mcc = row.mean.mcc
    return mcc if math.isfinite(mcc) else -math.inf


def _median(values: Sequence[float]) -> float:
    ordered = sorted(values)
    count = len(ordered)
    if count == 0:
        return math.nan
    return (ordered[(count - 1) // 2] + ordered[count // 2]) / 2
