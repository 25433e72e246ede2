"""Methods under evaluation: the sight-line engine, and the baselines at each of their settings."""

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter

import numpy as np

from intervis.arrays import Float64Array, IntArray
from intervis.lab.truth.baselines import Predict, all_baselines
from intervis.lab.truth.baselines.input_scans import InputScans, scene_of
from intervis.lab.truth.baselines.triangulated import SURFACES

ENGINE = "intervis"
"""Name of the sight-line engine among the methods."""


@dataclass(frozen=True, eq=False)
class Predictions:
    """What a method predicts for K targets, and how long it took.

    Attributes
    ----------
    probability : (K,) float64 array
        Of being visible.
    state : (K,) int array or None
        1 visible, 0 occluded, -1 unknown; None where a method has no "unknown".
    prepare_s, answer_s : float
        Seconds to prepare the scans, and to answer the queries. A method that does not separate
        the two reports both in ``answer_s``.
    """

    probability: Float64Array
    state: IntArray | None
    prepare_s: float
    answer_s: float


@dataclass(frozen=True)
class Method:
    """A method at one setting; ``predict(inputs, viewpoint, targets)`` returns `Predictions`."""

    name: str
    setting: str
    predict: Callable[[InputScans, Float64Array, Float64Array], Predictions]


def engine() -> Method:
    """The engine of `intervis.Scene` with its default settings."""
    return Method(ENGINE, "default", _predict_with_scene)


def baseline_methods(*, several_scans: bool) -> list[Method]:
    """All baselines, each at all its settings."""
    return [
        Method(baseline.name, setting, _timed(predict))
        for baseline in all_baselines(several_scans=several_scans)
        for setting, predict in baseline.settings.items()
    ]


def _predict_with_scene(
    inputs: InputScans, viewpoint: Float64Array, targets: Float64Array
) -> Predictions:
    start = perf_counter()
    scene = scene_of(inputs)
    ready = perf_counter()
    sight = scene.sight(viewpoint, targets, moment_s=inputs.moment_s)
    done = perf_counter()
    probability = np.asarray(sight.probability, dtype=np.float64)
    return Predictions(probability, np.asarray(sight.state), ready - start, done - ready)


def _timed(predict: Predict) -> Callable[[InputScans, Float64Array, Float64Array], Predictions]:
    def timed(inputs: InputScans, viewpoint: Float64Array, targets: Float64Array) -> Predictions:
        _ = inputs.points_world  # cached: the transform is not part of a baseline's time
        cost, spent, start = SURFACES.cost_s, SURFACES.spent_s, perf_counter()
        probability = predict(inputs, viewpoint, targets)
        took = perf_counter() - start - (SURFACES.spent_s - spent)
        return Predictions(probability, None, SURFACES.cost_s - cost, took)

    return timed
