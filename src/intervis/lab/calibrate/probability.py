"""Maximum-likelihood fit of the line probability: sharpness, changes, and occluded ends."""

import numpy as np
from scipy.optimize import minimize

from intervis.arrays import Float64Array
from intervis.lab.calibrate.curves import line_losses
from intervis.lab.calibrate.line_set import LineDepths
from intervis.sight import occupancy_model as model
from intervis.sight.kernels.parameters import Parameters

NAMES = (
    "sharpness",
    "change_time_s",
    "disappeared_unbracketed",
    "appeared_unbracketed",
    "disappeared",
    "appeared",
    "end_occluded_depth",
    "end_occluded_power",
)
BOUNDS = (
    *((0.4, 4.0), (0.5, 50.0), (0.0, 1.0), (0.0, 1.0), (0.0, 1.0), (0.0, 1.0)),
    *((0.0, 3.0), (0.2, 1.5)),
)
START = (1.3, 5.0, 0.5, 0.4, 0.2, 0.2, 0.3, 0.4)
_MAX_OPTICAL_DEPTH = 50.0


def line_probability(lines: LineDepths, parameters: Parameters) -> Float64Array:
    """P(visible) of `occupancy_model` with these parameters."""
    x = np.minimum(lines.optical_depth, _MAX_OPTICAL_DEPTH)
    movable = np.minimum(lines.movable, x)
    x = x + model.end_optical_depth(lines.end_occluded_m, parameters)
    changed = model.change_fractions(lines.time_gap_s, lines.bracketed, parameters)
    return model.probability(x, movable, *changed, parameters.sharpness)


def probability_loss(lines: LineDepths, parameters: Parameters) -> float:
    """Mean negative log-likelihood per line."""
    losses = line_losses(line_probability(lines, parameters), lines.visible)
    return float(lines.weight @ losses / lines.weight.sum())


def fit_probability(lines: LineDepths) -> tuple[dict[str, float], float]:
    """The numbers `NAMES` of maximum likelihood, and the loss.

    The change time and the fractions trade off against each other where all time gaps are short;
    the bounds keep them finite.
    """

    def loss(theta: Float64Array) -> float:
        numbers = dict(zip(NAMES, map(float, theta), strict=True))
        return probability_loss(lines, model.MODEL.parameters._replace(**numbers))

    found = minimize(loss, np.array(START), method="L-BFGS-B", bounds=BOUNDS)
    return dict(zip(NAMES, map(float, found.x), strict=True)), float(found.fun)
