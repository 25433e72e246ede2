"""Methods under judgement: the line-of-sight engine, and the rivals at each of their settings."""

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter

import numpy as np

from intervis.arrays import Float64Array, IntArray
from intervis.lab.truth.baselines import Answer, Seen, rivals
from intervis.lab.truth.baselines.triangulated import SURFACES

OURS = "intervis"


@dataclass(frozen=True, eq=False)
class Answers:
    """What a method says about (K,) targets.

    Attributes
    ----------
    probability : (K,) float64 array
        Of being visible.
    state : (K,) int array or None
        1 visible, 0 occluded, -1 unknown; None where a method never says "unknown".
    prepare_s, answer_s : float
        Seconds from scans to something that can answer, and for the answers; both in ``answer_s``
        where a method does not part them.
    """

    probability: Float64Array
    state: IntArray | None
    prepare_s: float
    answer_s: float


@dataclass(frozen=True)
class Method:
    """A method with one setting."""

    name: str
    setting: str
    ask: Callable[[Seen, Float64Array, Float64Array], Answers]


def ours() -> Method:
    """The engine of `intervis.Scene`, as it comes."""
    return Method(OURS, "default", _ask_scene)


def theirs(*, several_scans: bool) -> list[Method]:
    """Every rival at every setting."""
    return [
        Method(rival.name, setting, _timed(answer))
        for rival in rivals(several_scans=several_scans)
        for setting, answer in rival.settings.items()
    ]


def _ask_scene(seen: Seen, viewpoint: Float64Array, targets: Float64Array) -> Answers:
    from intervis.sight import Scene

    start = perf_counter()
    scene = Scene()
    timestamps_s = seen.timestamps_s or (None,) * len(seen.scans)
    for scan, pose, timestamp_s in zip(seen.scans, seen.poses, timestamps_s, strict=True):
        scene.add(scan, pose, timestamp_s)
    ready = perf_counter()
    sight = scene.sight(viewpoint, targets, moment_s=None if seen.timestamps_s is None else 0.0)
    done = perf_counter()
    probability = np.asarray(sight.probability, dtype=np.float64)
    return Answers(probability, np.asarray(sight.state), ready - start, done - ready)


def _timed(answer: Answer) -> Callable[[Seen, Float64Array, Float64Array], Answers]:
    def ask(seen: Seen, viewpoint: Float64Array, targets: Float64Array) -> Answers:
        _ = seen.points_world  # scans in one frame: no rival has to pay for that
        cost, spent, start = SURFACES.cost_s, SURFACES.spent_s, perf_counter()
        probability = answer(seen, viewpoint, targets)
        took = perf_counter() - start - (SURFACES.spent_s - spent)
        return Answers(probability, None, SURFACES.cost_s - cost, took)

    return ask
