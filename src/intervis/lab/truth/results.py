"""Results of an evaluation: the scores of every method at every setting."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from intervis.arrays import BoolArray
from intervis.lab.truth.methods import ENGINE, Method, Predictions
from intervis.lab.truth.query_set import QuerySet
from intervis.lab.truth.scores import Scores, average, number_or_none, score
from intervis.progress import Progress

SCHEMA = 3
"""Version of the JSON; raised when a key changes."""


@dataclass(eq=False)
class MethodResult:
    """The scores of one method at one setting.

    Attributes
    ----------
    method, setting : str
    labels : list of str
        Labels of the query sets, in order.
    scores : list of Scores
        Overall scores of each query set.
    subsets : dict of str to list of Scores
        Scores of each subset of the targets, for each query set.
    seconds : list of (float, float)
        Time to prepare and to answer, for each query set.
    """

    method: str
    setting: str
    labels: list[str] = field(default_factory=list)
    scores: list[Scores] = field(default_factory=list)
    subsets: dict[str, list[Scores]] = field(default_factory=dict)
    seconds: list[tuple[float, float]] = field(default_factory=list)

    @property
    def mean(self) -> Scores:
        """Mean over the query sets."""
        return average(self.scores)

    def mean_of(self, subset: str) -> Scores:
        """Mean over the query sets, for one subset of the targets."""
        return average(self.subsets[subset])

    @property
    def prepare_s(self) -> float:
        """Median of the seconds to prepare the scans."""
        return _median([prepare for prepare, _ in self.seconds])

    @property
    def answer_s(self) -> float:
        """Median of the seconds to answer one query set."""
        return _median([answer for _, answer in self.seconds])

    def add(self, query_set: QuerySet, predictions: Predictions) -> None:
        """Score the predictions for one more query set."""
        self.labels.append(query_set.label)
        self.seconds.append((predictions.prepare_s, predictions.answer_s))
        self.scores.append(_scored(query_set, predictions, query_set.overall))
        for subset, mask in query_set.subsets.items():
            self.subsets.setdefault(subset, []).append(_scored(query_set, predictions, mask))

    def to_json(self) -> dict[str, Any]:
        """Plain numbers, texts and lists; undefined numbers are None."""
        return {
            "method": self.method,
            "setting": self.setting,
            "mean": self.mean.to_json(),
            "subsets": {subset: self.mean_of(subset).to_json() for subset in self.subsets},
            "prepare_s": number_or_none(self.prepare_s),
            "answer_s": number_or_none(self.answer_s),
            "query_sets": {
                label: scores.to_json()
                for label, scores in zip(self.labels, self.scores, strict=True)
            },
        }


@dataclass(frozen=True, eq=False)
class EvaluationResult:
    """The results of all methods under one ground truth and one protocol.

    Attributes
    ----------
    source : str
        Name of the drive.
    ground_truth : str
        ``held-out returns``, or ``exact world`` and the ray caster.
    protocol : str
        Which scans the methods got.
    query_sets : tuple of str
        Labels of the query sets: ``i:j``, or ``frame from viewpoint``.
    target_count : int
        Labelled targets that the overall scores include, summed over the query sets.
    results : tuple of MethodResult
        The engine first.
    """

    source: str
    ground_truth: str
    protocol: str
    query_sets: tuple[str, ...]
    target_count: int
    results: tuple[MethodResult, ...]

    def best_settings(self, query_set: str | None = None) -> list[MethodResult]:
        """The result of each method with the highest MCC, in the methods' order.

        The MCC is the mean over the query sets, or that of one query set.
        """
        best: dict[str, MethodResult] = {}
        for result in self.results:
            known = best.get(result.method)
            if known is None or _sort_key(result, query_set) > _sort_key(known, query_set):
                best[result.method] = result
        return list(best.values())

    def result_of(self, method: str = ENGINE) -> MethodResult:
        """The result of one method at its best setting."""
        return next(result for result in self.best_settings() if result.method == method)

    def to_json(self) -> dict[str, Any]:
        """Plain numbers, texts and lists; undefined numbers are None."""
        best = self.best_settings()
        return {
            "schema": SCHEMA,
            "source": self.source,
            "ground_truth": self.ground_truth,
            "protocol": self.protocol,
            "query_sets": list(self.query_sets),
            "target_count": self.target_count,
            "results": [
                {**result.to_json(), "best_setting": result in best} for result in self.results
            ],
        }


def run_methods(
    query_sets: Iterable[QuerySet], methods: Sequence[Method], progress: Progress
) -> tuple[tuple[MethodResult, ...], tuple[str, ...], int]:
    """Run all methods on all query sets: results, labels of the query sets, number of targets."""
    results = tuple(MethodResult(method.name, method.setting) for method in methods)
    labels, target_count = [], 0
    for query_set in query_sets:
        labels.append(query_set.label)
        overall = query_set.overall
        target_count += len(query_set.targets) if overall is None else int(overall.sum())
        for method, result in zip(methods, results, strict=True):
            result.add(
                query_set,
                method.predict(query_set.inputs, query_set.viewpoint, query_set.targets),
            )
            progress(f"{query_set.label}, {method.name}, {method.setting}")
    return results, tuple(labels), target_count


def _scored(query_set: QuerySet, predictions: Predictions, mask: BoolArray | None) -> Scores:
    chosen = slice(None) if mask is None else mask
    return score(
        query_set.visible[chosen],
        predictions.probability[chosen],
        None if predictions.state is None else predictions.state[chosen],
    )


def _sort_key(result: MethodResult, query_set: str | None) -> float:
    """The MCC; -inf where it is undefined, so that such a result is never the best."""
    scores = result.mean if query_set is None else result.scores[result.labels.index(query_set)]
    return scores.mcc if math.isfinite(scores.mcc) else -math.inf


def _median(values: Sequence[float]) -> float:
    return float(np.median(values)) if values else math.nan
