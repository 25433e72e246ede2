"""One sight line explained: state, probability, blocker, clearance."""

from __future__ import annotations  # help() then shows ArrayLike by its name

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from intervis.arguments import object_of
from intervis.arrays import Float64Array, checked_point
from intervis.result_table import metres, result_table
from intervis.sight.answers import OCCLUDED, VISIBLE
from intervis.sight.occupancy_model import DEFAULT_RISK
from intervis.sight.scene import Scene
from intervis.sight.sight import Sight


@dataclass(frozen=True, eq=False)
class Explanation:
    """The answer for one line, as text and as numbers.

    Attributes
    ----------
    text : str
        Two or three sentences.
    state : int
        1 visible, 0 occluded, -1 unknown.
    probability : float
        P(visible).
    length_m : float
    blocker : (3,) float64 array
        Where the line is occluded, scene frame, metres; NaN unless occluded.
    blocker_m : float
        Distance from viewpoint to blocker; NaN unless occluded.
    clearance_m : float
        As in `intervis.sight.Sight`.
    unobserved_m : float
        Length of the line that no scan observed.
    """

    text: str
    state: int
    probability: float
    length_m: float
    blocker: Float64Array
    blocker_m: float
    clearance_m: float
    unobserved_m: float

    def __str__(self) -> str:
        return self.text

    def _repr_html_(self) -> str:
        """The sentences and the numbers, as a notebook shows them."""
        occluded = self.state == OCCLUDED
        known = not math.isnan(self.probability)
        rows = {
            "P(visible)": _percent(self.probability) if known else "-",
            "length": metres(self.length_m),
            "blocker": _place(self.blocker) if np.isfinite(self.blocker).all() else "-",
            "blocker from the viewpoint": metres(self.blocker_m),
            "shift that clears it" if occluded else "clearance": metres(abs(self.clearance_m)),
            "unobserved": metres(self.unobserved_m),
        }
        return result_table(self.text, rows)


def explain(
    scene: Scene,
    viewpoint: ArrayLike,
    target: ArrayLike,
    *,
    risk: float = DEFAULT_RISK,
    moment_s: float | None = None,
) -> Explanation:
    """Explain one sight line through a scene; arguments as in `Scene.sight`.

    Raises
    ------
    PointsError
        An end is not three finite numbers.
    SceneError
        The scene holds no scan; or a query time is given and a scan has no timestamp.

    Examples
    --------
    >>> y, z = np.meshgrid(np.arange(-5, 5, 0.04), np.arange(-1.5, 1.5, 0.06))
    >>> wall = np.stack([np.full(y.size, 10.0), y.ravel(), z.ravel()], axis=1)
    >>> print(explain(Scene.from_scan(wall), [0, 0, 0], [30, 1, 0]))
    Occluded: visible with a probability of ... %. An observed surface occludes the line 10.0 m...
    """
    object_of(scene, Scene, "scene")
    start = checked_point(viewpoint, "viewpoint")
    end = checked_point(target, "target")
    sight = scene.sight(start, end[None], risk=risk, moment_s=moment_s)
    unobserved_m = scene.unobserved_length(start, end, moment_s=moment_s)
    return explanation_of(start, end, sight, unobserved_m)


def explanation_of(
    start: Float64Array, end: Float64Array, sight: Sight, unobserved_m: float
) -> Explanation:
    """The explanation of one line's answer.

    Parameters
    ----------
    start, end : (3,) float64 arrays
        Scene frame, metres.
    sight : Sight
        Of one line: shape (1,).
    unobserved_m : float
        Length of the line that no scan observed, metres.
    """
    state, probability = int(sight.state[0]), float(sight.probability[0])
    length_m = math.dist(start, end)
    blocker, clearance_m = sight.blocker[0], float(sight.clearance[0])
    blocker_m = math.dist(start, blocker)
    if math.isnan(probability):
        text = "Unknown: the ends are too far apart for an answer."
    elif state == OCCLUDED:
        text = _occluded(probability, blocker, blocker_m, length_m, clearance_m)
    elif state == VISIBLE:
        text = _visible(probability, length_m, clearance_m, unobserved_m)
    else:
        text = _unknown(probability, length_m, unobserved_m)
    return Explanation(
        text,
        state,
        probability,
        length_m,
        blocker,
        blocker_m,
        clearance_m,
        unobserved_m,
    )


def _percent(probability: float) -> str:
    """Rounded percentage, never 0 or 100 %."""
    if probability < 0.01:
        return "less than 1 %"
    if probability > 0.99:
        return "more than 99 %"
    return f"{100 * probability:.0f} %"


def _metres(length_m: float) -> str:
    """Rounded length without its unit, never 0.0."""
    return "less than 0.1" if length_m < 0.05 else f"{length_m:.1f}"


def _place(point: Float64Array) -> str:
    return "(" + ", ".join(f"{round(float(value), 1) + 0.0:.1f}" for value in point) + ")"


def _occluded(
    probability: float, blocker: Float64Array, at_m: float, length_m: float, clearance_m: float
) -> str:
    answer = f"Occluded: visible with a probability of {_percent(probability)}."
    if not np.isfinite(blocker).all():
        return f"{answer} No single surface that a scan observed decides this."
    return (
        f"{answer} An observed surface occludes the line {_metres(at_m)} m from the viewpoint (of"
        f" {_metres(length_m)} m), at {_place(blocker)}; the line would have to pass"
        f" {_metres(abs(clearance_m))} m higher, lower or beside to clear it."
    )


def _visible(probability: float, length_m: float, clearance_m: float, unobserved_m: float) -> str:
    if length_m < 0.05:
        crossed = "Its ends are less than 0.1 m apart"
    else:
        crossed = f"Beams crossed {_metres(length_m - unobserved_m)} of its {_metres(length_m)} m"
    if np.isfinite(clearance_m):
        beside = f"it clears the nearest surface by {_metres(clearance_m)} m"
    else:
        beside = "no surface was observed beside it"
    answer = f"Visible: with a probability of {_percent(probability)}. {crossed}; {beside}."
    if 2.0 * round(length_m - unobserved_m, 1) < round(length_m, 1):  # as printed
        return f"{answer} No scan observed most of it: prior knowledge of such space decides."
    return answer


def _unknown(probability: float, length_m: float, unobserved_m: float) -> str:
    if unobserved_m > 0.5:
        return (
            "Unknown: not observed throughout; prior knowledge included, visible with a"
            f" probability of {_percent(probability)}. No scan observed {_metres(unobserved_m)} of"
            f" its {_metres(length_m)} m, and no observed surface clearly occludes the rest."
        )
    return (
        f"Unknown: not decided; the best estimate of the probability of being visible is"
        f" {_percent(probability)}. The line of {_metres(length_m)} m passes close to observed"
        " surfaces, or through space on which scans disagree."
    )
