"""Fit of the line probability, and of the thresholds of the three answers."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from intervis.arrays import BoolArray, Float64Array
from intervis.sight import occupancy_model as model
from intervis.sight.kernels.line_sums import LineSums

PRECISION_VISIBLE, PRECISION_OCCLUDED = 0.99, 0.97
"""What the thresholds must reach in exact worlds."""
NAMES = (
    "sharpness",
    "change_time_s",
    "disappeared_unbracketed",
    "appeared_unbracketed",
    "disappeared",
    "appeared",
)
BOUNDS = ((0.5, 4.0), (0.5, 50.0), (0.0, 1.0), (0.0, 1.0), (0.0, 1.0), (0.0, 1.0))


@dataclass(frozen=True, eq=False)
class JudgedLines:
    """L lines with their sums and answers.

    Attributes
    ----------
    optical_depth, surface, unobserved, unobserved_m, occluded_space_m, length_m : (L,) arrays
        As in `intervis.sight.kernels.line_sums.LineSums`.
    time_gap_s : (L,) float64 array
    bracketed : (L,) bool array
        Whether one scan answered.
    visible : (L,) bool array
    weight : (L,) float64 array
    """

    optical_depth: Float64Array
    surface: Float64Array
    unobserved: Float64Array
    unobserved_m: Float64Array
    occluded_space_m: Float64Array
    length_m: Float64Array
    time_gap_s: Float64Array
    bracketed: BoolArray
    visible: BoolArray
    weight: Float64Array


def judged_lines(
    sums: LineSums, length_m: Float64Array, visible: BoolArray, *, base: float, bracketed: bool
) -> JudgedLines:
    """The lines of one query set; their weights sum to 1."""
    count = len(visible)
    return JudgedLines(
        optical_depth=base + sums.free + sums.surface + sums.unobserved,
        surface=sums.surface,
        unobserved=sums.unobserved,
        unobserved_m=sums.unobserved_m,
        occluded_space_m=sums.occluded_space_m,
        length_m=length_m,
        time_gap_s=sums.time_gap_s,
        bracketed=np.full(count, bracketed),
        visible=visible,
        weight=np.full(count, 1.0 / count),
    )


def joined(parts: list[JudgedLines]) -> JudgedLines:
    """The lines of several query sets."""
    names = JudgedLines.__dataclass_fields__
    return JudgedLines(
        **{name: np.concatenate([getattr(part, name) for part in parts]) for name in names}
    )


def line_probability(lines: JudgedLines, theta: Float64Array) -> Float64Array:
    """P(visible) of `occupancy_model` with the parameters `NAMES`."""
    parameters = model.MODEL.parameters._replace(**dict(zip(NAMES, theta, strict=True)))
    fractions = model.change_fractions(lines.time_gap_s, lines.bracketed, parameters)
    return model.probability(lines.optical_depth, *fractions, parameters.sharpness)


def probability_loss(lines: JudgedLines, theta: Float64Array) -> float:
    """Mean negative log-likelihood per line, each query set weighted alike."""
    p = np.clip(line_probability(lines, theta), 1e-6, 1.0 - 1e-6)
    losses = -np.where(lines.visible, np.log(p), np.log1p(-p))
    return float(lines.weight @ losses / lines.weight.sum())


def fit_probability(lines: JudgedLines) -> tuple[dict[str, float], float]:
    """Sharpness and change fractions of maximum likelihood, by name, and the loss.

    The change time and the fractions trade off against each other where all time gaps are short;
    the bounds keep them finite.
    """
    start = np.array([1.5, 5.0, 0.5, 0.3, 0.3, 0.2])
    found = minimize(
        lambda theta: probability_loss(lines, theta), start, method="L-BFGS-B", bounds=BOUNDS
    )
    return dict(zip(NAMES, map(float, found.x), strict=True)), float(found.fun)


def choose_thresholds(lines: JudgedLines, probability: Float64Array) -> dict[str, float]:
    """Smallest thresholds at which "visible" and "occluded" reach their precision.

    Parameters
    ----------
    lines : JudgedLines
        Of exact worlds.
    probability : (L,) float64 array
        P(visible).
    """
    observed = model.may_be_visible(
        lines.surface,
        lines.unobserved,
        lines.unobserved_m,
        lines.occluded_space_m,
        lines.length_m,
    )
    return {
        "visible_min_probability": _smallest(
            np.arange(0.5, 0.991, 0.01), probability, lines.visible, observed, PRECISION_VISIBLE
        ),
        "occluded_min_surface": _smallest(
            np.arange(0.3, 4.01, 0.05),
            lines.surface,
            ~lines.visible,
            np.ones(len(lines.surface), bool),
            PRECISION_OCCLUDED,
        ),
    }


def _smallest(
    candidates: Float64Array,
    value: Float64Array,
    right: BoolArray,
    eligible: BoolArray,
    precision: float,
) -> float:
    """The smallest candidate from which on the chosen lines are right often enough."""
    for candidate in candidates:
        chosen = eligible & (value >= candidate)
        if not chosen.any() or right[chosen].mean() >= precision:
            return round(float(candidate), 3)
    return round(float(candidates[-1]), 3)
