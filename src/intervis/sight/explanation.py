"""One sight line in words: visible or not, how sure, what blocks it where, by how much."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from intervis.arrays import Float64Array, checked_point
from intervis.sight.scene import OCCLUDED, VISIBLE, Scene, Sight


@dataclass(frozen=True, eq=False)
class Explanation:
    """One line's answer, and the numbers behind it.

    Attributes
    ----------
    text : str
        Two or three plain sentences.
    state : int
        1 visible, 0 occluded, -1 unknown.
    probability : float
        Of being visible.
    length_m : float
    blocker : (3,) float64 array
        Where the line is blocked, scene frame; NaN unless occluded.
    blocker_m : float
        How far that is from the viewpoint; NaN unless occluded.
    clearance_m : float
        As in `intervis.sight.Sight`.
    unknown_m : float
        Length of the line that no scan saw.
    """

    text: str
    state: int
    probability: float
    length_m: float
    blocker: Float64Array
    blocker_m: float
    clearance_m: float
    unknown_m: float

    def __str__(self) -> str:
        return self.text


def explain(
    scene: Scene, viewpoint: ArrayLike, target: ArrayLike, *, moment_s: float | None = None
) -> Explanation:
    """Explain one sight line through a scene, at a moment or at none; see `Scene.sight`.

    Raises
    ------
    PointsError
        An end is not three finite numbers.
    SceneError
        The scene holds no scan; a moment is asked about and a scan has no stamp.

    Examples
    --------
    >>> y, z = np.meshgrid(np.arange(-5, 5, 0.04), np.arange(-1.5, 1.5, 0.06))
    >>> wall = np.stack([np.full(y.size, 10.0), y.ravel(), z.ravel()], axis=1)
    >>> print(explain(Scene.from_scan(wall), [0, 0, 0], [30, 1, 0]))
    Occluded: visible with a probability of 15 %. A surface that was seen blocks the line...
    """
    start = checked_point(viewpoint, "viewpoint")
    end = checked_point(target, "target")
    sight = scene.sight(start, end[None], moment_s=moment_s)
    return in_words(start, end, sight, scene.unknown_length(start, end, moment_s=moment_s))


def in_words(start: Float64Array, end: Float64Array, sight: Sight, unknown_m: float) -> Explanation:
    """The explanation of one line's answer.

    Parameters
    ----------
    start, end : (3,) float64 arrays
        Scene frame, metres.
    sight : Sight
        Of one line: shape (1,).
    unknown_m : float
        How much of the line no scan saw, metres.
    """
    state, probability = int(sight.state[0]), float(sight.probability[0])
    length_m = float(np.linalg.norm(end - start))
    blocker, clearance_m = sight.blocker[0], float(sight.clearance[0])
    blocker_m = float(np.linalg.norm(blocker - start))
    if state == OCCLUDED:
        words = _occluded(blocker, blocker_m, length_m, clearance_m)
    elif state == VISIBLE:
        words = _visible(length_m, clearance_m, unknown_m)
    else:
        words = _unknown(length_m, unknown_m)
    name = {OCCLUDED: "Occluded", VISIBLE: "Visible"}.get(state, "Unknown")
    return Explanation(
        f"{name}: visible with a probability of {_percent(probability)}. {words}",
        state,
        probability,
        length_m,
        blocker,
        blocker_m,
        clearance_m,
        unknown_m,
    )


def _percent(probability: float) -> str:
    """Rounded, but never as certain as 0 or 100 %."""
    if probability < 0.01:
        return "less than 1 %"
    if probability > 0.99:
        return "more than 99 %"
    return f"{100 * probability:.0f} %"


def _place(point: Float64Array) -> str:
    return "(" + ", ".join(f"{value:.1f}" for value in point) + ")"


def _occluded(blocker: Float64Array, at_m: float, length_m: float, clearance_m: float) -> str:
    if not np.isfinite(blocker).all():
        return "What blocks it was not seen at one place."
    return (
        f"A surface that was seen blocks the line {at_m:.1f} m from the viewpoint (of"
        f" {length_m:.1f} m), at {_place(blocker)}; the line would have to pass"
        f" {abs(clearance_m):.1f} m higher, lower or beside to clear it."
    )


def _visible(length_m: float, clearance_m: float, unknown_m: float) -> str:
    seen = f"Beams crossed {length_m - unknown_m:.1f} of its {length_m:.1f} m"
    if not np.isfinite(clearance_m):
        return f"{seen}, and no surface is known beside it."
    return f"{seen}; it clears the nearest surface on its way by {clearance_m:.1f} m."


def _unknown(length_m: float, unknown_m: float) -> str:
    if unknown_m > 0.5:
        return (
            f"No scan saw {unknown_m:.1f} of its {length_m:.1f} m, and nothing that was seen"
            " clearly blocks the rest."
        )
    return (
        f"Its {length_m:.1f} m pass so close to surfaces that were seen, or through space that"
        " scans disagree about, that neither answer is safe."
    )
