"""One sight line explained: state, probability, blocker, clearance."""

from __future__ import annotations  # help() then shows ArrayLike by its name

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from intervis.arrays import Float64Array, checked_point
from intervis.sight.scene import OCCLUDED, VISIBLE, Scene, Sight


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


def explain(
    scene: Scene, viewpoint: ArrayLike, target: ArrayLike, *, moment_s: float | None = None
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
    Occluded: visible with a probability of 16 %. An observed surface occludes the line 10.0 m...
    """
    start = checked_point(viewpoint, "viewpoint")
    end = checked_point(target, "target")
    sight = scene.sight(start, end[None], moment_s=moment_s)
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
    length_m = float(np.linalg.norm(end - start))
    blocker, clearance_m = sight.blocker[0], float(sight.clearance[0])
    blocker_m = float(np.linalg.norm(blocker - start))
    if state == OCCLUDED:
        words = _occluded(blocker, blocker_m, length_m, clearance_m)
    elif state == VISIBLE:
        words = _visible(length_m, clearance_m, unobserved_m)
    else:
        words = _unknown(length_m, unobserved_m)
    name = {OCCLUDED: "Occluded", VISIBLE: "Visible"}.get(state, "Unknown")
    return Explanation(
        f"{name}: visible with a probability of {_percent(probability)}. {words}",
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


def _place(point: Float64Array) -> str:
    return "(" + ", ".join(f"{value:.1f}" for value in point) + ")"


def _occluded(blocker: Float64Array, at_m: float, length_m: float, clearance_m: float) -> str:
    if not np.isfinite(blocker).all():
        return "Its blocker has no single position."
    return (
        f"An observed surface occludes the line {at_m:.1f} m from the viewpoint (of"
        f" {length_m:.1f} m), at {_place(blocker)}; the line would have to pass"
        f" {abs(clearance_m):.1f} m higher, lower or beside to clear it."
    )


def _visible(length_m: float, clearance_m: float, unobserved_m: float) -> str:
    crossed = f"Beams crossed {length_m - unobserved_m:.1f} of its {length_m:.1f} m"
    if not np.isfinite(clearance_m):
        return f"{crossed}; no surface was observed beside it."
    return f"{crossed}; it clears the nearest surface by {clearance_m:.1f} m."


def _unknown(length_m: float, unobserved_m: float) -> str:
    if unobserved_m > 0.5:
        return (
            f"No scan observed {unobserved_m:.1f} of its {length_m:.1f} m, and no observed surface"
            " clearly occludes the rest."
        )
    return (
        f"Its {length_m:.1f} m pass close to observed surfaces, or through space on which scans"
        " disagree: neither answer is certain enough."
    )
