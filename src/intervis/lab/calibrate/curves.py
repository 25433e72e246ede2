"""Maximum-likelihood fit of the occupancy curves, the attenuation and the scan weights."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from scipy import sparse
from scipy.optimize import minimize

from intervis.arrays import BoolArray, Float64Array
from intervis.lab.calibrate.line_set import LineDepths, SampleTable
from intervis.sight import occupancy_model as model
from intervis.sight.kernels.parameters import Parameters

SMOOTHNESS = 2e-4
"""Penalty on squared second differences of a curve, in units of the mean likelihood."""
BASE_OPTICAL_DEPTH_BOUNDS = (1e-4, 5e-2)
DECAYS = (0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
CORRELATIONS = (0.0, 0.15, 0.3, 0.45, 0.6)
DEPTH_CURVES = ("volumetric_log_odds", "surface_log_odds", "dropout_log_odds")
CURVES = (*DEPTH_CURVES, "height_log_odds", "assumed_height_log_odds")
KNOTS = ("depth_m", "height_m", "assumed_height_m")
"""Knots of the depth curves, which share theirs, and of the two height curves."""
ATTENUATION = ("attenuation_per_m", "base_optical_depth")
_LEAST_PROBABILITY, _MIN_OPTICAL_DEPTH, _MAX_OPTICAL_DEPTH = 1e-6, 1e-9, 50.0


@dataclass(frozen=True, eq=False)
class Curves:
    """Fitted curves, attenuation and base optical depth.

    `loss` is the mean negative log-likelihood per line, each family of lines weighted alike.
    """

    volumetric_log_odds: Float64Array
    surface_log_odds: Float64Array
    dropout_log_odds: Float64Array
    height_log_odds: Float64Array
    assumed_height_log_odds: Float64Array
    attenuation_per_m: float
    base_optical_depth: float
    loss: float

    def numbers(self) -> dict[str, Any]:
        """All but the loss by name, curves as lists."""
        values = {name: getattr(self, name).tolist() for name in CURVES}
        return values | {name: getattr(self, name) for name in ATTENUATION}


def design_matrix(table: SampleTable, decay: float, correlation: float) -> sparse.csr_array:
    """Matrix (K, 3 D + H + G): times the knots of all curves, the log-odds of the samples."""
    depth = sparse.csr_array(table.by_rank[0].shape)
    for rank, weights in enumerate(table.by_rank):
        by_count = np.array(
            [
                model.scan_weights(count, decay, correlation)[rank] if rank < count else 0.0
                for count in range(len(table.by_rank) + 1)
            ]
        )
        depth = depth + sparse.diags_array(by_count[table.scans]) @ weights
    return sparse.csr_array(sparse.hstack([depth, table.height]))


def line_losses(probability: Float64Array, visible: BoolArray) -> Float64Array:
    """Negative log-likelihood of each line."""
    p = np.clip(probability, _LEAST_PROBABILITY, 1.0 - _LEAST_PROBABILITY)
    return np.asarray(-np.where(visible, np.log(p), np.log1p(-p)))


class _Likelihood:
    """Penalised loss and its gradient over (knots, log attenuation, log base optical depth).

    The lines have the probability of `occupancy_model` with `parameters`: sharpness, changes and
    the term of their ends stay fixed.
    """

    def __init__(
        self,
        table: SampleTable,
        matrix: sparse.csr_array,
        sizes: Sequence[int],
        parameters: Parameters,
    ) -> None:
        self.table, self.matrix, self.parameters = table, matrix, parameters
        self.transposed = sparse.csr_array(matrix.T)
        self.weight = table.weight / table.weight.sum()
        self.fixed = model.end_optical_depth(table.end_occluded_m, parameters)
        self.step_m = table.step_m
        differences = [_second_differences(size) for size in sizes]
        self.difference = sparse.csr_array(sparse.block_diag(differences))
        self.movable_m = np.where(table.movable, self.step_m, 0.0)
        self.changed = model.change_fractions(table.time_gap_s, table.bracketed, parameters)

    def optical_depth(
        self, theta: Float64Array
    ) -> tuple[Float64Array, Float64Array, Float64Array, Float64Array]:
        """Optical depths of the lines, their movable parts, occupancy of the samples, and where
        log-odds are free.
        """
        raw = self.matrix @ theta[:-2] + self.table.height_log_odds
        bounded = np.where(
            self.table.occupied, np.maximum(raw, model.DYNAMIC_OCCUPIED_LOG_ODDS), raw
        )
        bounded = np.where(
            self.table.left, np.minimum(bounded, model.DYNAMIC_FREE_LOG_ODDS), bounded
        )
        occupancy = 1.0 / (1.0 + np.exp(-bounded))
        attenuation, count = np.exp(theta[-2]), len(self.fixed)
        x = np.bincount(self.table.line, occupancy * self.step_m, count)
        movable = np.bincount(self.table.line, occupancy * self.movable_m, count)
        x = np.exp(theta[-1]) + self.fixed + attenuation * x
        unbounded = np.asarray(bounded == raw, dtype=np.float64)
        return x, attenuation * movable, occupancy, unbounded

    def loss(self, theta: Float64Array) -> float:
        """Mean negative log-likelihood per line."""
        x, movable, _, _ = self.optical_depth(theta)
        p = model.probability(x, movable, *self.changed, self.parameters.sharpness)
        return float(self.weight @ line_losses(p, self.table.visible))

    def __call__(self, theta: Float64Array) -> tuple[float, Float64Array]:
        x, movable, occupancy, free = self.optical_depth(theta)
        disappeared, appeared = self.changed
        sharpness = self.parameters.sharpness
        p = model.probability(x, movable, disappeared, appeared, sharpness)
        loss = float(self.weight @ line_losses(p, self.table.visible))
        p = np.clip(p, _LEAST_PROBABILITY, 1.0 - _LEAST_PROBABILITY)
        by_p = self.weight * np.where(self.table.visible, -1.0 / p, 1.0 / (1.0 - p))
        by_x = by_p * (1.0 - disappeared - appeared) * _slope(x, sharpness)
        by_static = by_p * disappeared * _slope(x - movable, sharpness)
        line = self.table.line
        by_step = by_x[line] * self.step_m + by_static[line] * (self.step_m - self.movable_m)
        by_sample = np.exp(theta[-2]) * by_step * occupancy
        bend = self.difference @ theta[:-2]
        gradient = np.empty(len(theta))
        gradient[:-2] = self.transposed @ (by_sample * (1.0 - occupancy) * free)
        gradient[:-2] += 2.0 * SMOOTHNESS * (self.difference.T @ bend)
        gradient[-2] = by_sample.sum()
        gradient[-1] = (by_x + by_static).sum() * np.exp(theta[-1])
        return loss + SMOOTHNESS * float(bend @ bend), gradient


def _slope(x: Float64Array, sharpness: float) -> Float64Array:
    """Derivative of Q(x) of `occupancy_model`."""
    x = np.clip(x, _MIN_OPTICAL_DEPTH, _MAX_OPTICAL_DEPTH)
    q = model.unchanged_probability(x, sharpness)
    return np.asarray(-q * (1.0 - q) * sharpness / -np.expm1(-x))


def _second_differences(size: int) -> sparse.csr_array:
    return sparse.csr_array(
        sparse.diags_array([1.0, -2.0, 1.0], offsets=[0, 1, 2], shape=(size - 2, size))
    )


def line_depths(table: SampleTable, fitted: Mapping[str, Any]) -> LineDepths:
    """Optical depths of the lines under the curves of a fitted file, without occluded ends."""
    likelihood = _likelihood_of(table, {**fitted, "end_occluded_depth": 0.0})
    x, movable, _, _ = likelihood.optical_depth(_theta(fitted))
    return LineDepths(
        x,
        movable,
        table.end_occluded_m,
        table.time_gap_s,
        table.bracketed,
        table.visible,
        table.weight,
    )


def _theta(fitted: Mapping[str, Any]) -> Float64Array:
    """The numbers of a fitted file that `_Likelihood` varies."""
    curves = [np.asarray(fitted[name], dtype=np.float64) for name in CURVES]
    return np.concatenate([*curves, np.log([fitted[name] for name in ATTENUATION])])


def _likelihood_of(table: SampleTable, fitted: Mapping[str, Any]) -> _Likelihood:
    matrix = design_matrix(table, fitted["weight_decay"], fitted["correlation"])
    sizes = _sizes(fitted)
    return _Likelihood(table, matrix, sizes, model.model_of({**model.FITTED, **fitted}).parameters)


def _sizes(numbers: Mapping[str, Any]) -> list[int]:
    """Number of knots of each curve."""
    depth, *heights = (len(numbers[name]) for name in KNOTS)
    return [depth] * len(DEPTH_CURVES) + heights


def fit_curves(
    table: SampleTable,
    knots: Mapping[str, Sequence[float]],
    parameters: Parameters = model.MODEL.parameters,
    decay: float = model.WEIGHT_DECAY,
    correlation: float = model.CORRELATION,
) -> Curves:
    """Fit all curves to the lines of a table, from a start that knows none of them.

    Parameters
    ----------
    table : SampleTable
    knots : mapping
        `depth_m`, `height_m` and `assumed_height_m`, with which the table was made.
    parameters : Parameters
        Sharpness, change fractions and the term of the ends.
    decay, correlation : float
        Of the scan weights.
    """
    depth_m = np.array(knots["depth_m"], dtype=np.float64)
    sizes = _sizes(knots)
    likelihood = _Likelihood(table, design_matrix(table, decay, correlation), sizes, parameters)
    near_surface = np.where((depth_m > -0.2) & (depth_m < 1.5), 3.0, -1.0)
    heights = np.full(sizes[-2] + sizes[-1], -4.0)
    dropouts = np.zeros(len(depth_m))
    start = np.concatenate([near_surface, near_surface, dropouts, heights, [0.0, -6.0]])
    bounds = [(-8.0, 8.0)] * (len(start) - 2)
    bounds += [(np.log(0.2), np.log(5.0)), tuple(np.log(BASE_OPTICAL_DEPTH_BOUNDS))]
    found = minimize(likelihood, start, jac=True, method="L-BFGS-B", bounds=bounds)
    parts = np.split(found.x[:-2], np.cumsum(sizes)[:-1])
    return Curves(
        **dict(zip(CURVES, parts, strict=True)),
        attenuation_per_m=float(np.exp(found.x[-2])),
        base_optical_depth=float(np.exp(found.x[-1])),
        loss=likelihood.loss(found.x),
    )


def loss_of(table: SampleTable, fitted: Mapping[str, Any]) -> float:
    """Mean negative log-likelihood per line under the numbers of a fitted file."""
    return _likelihood_of(table, fitted).loss(_theta(fitted))


def choose_weights(
    table: SampleTable, curves: Curves, fitted: Mapping[str, Any]
) -> tuple[float, float, dict[tuple[float, float], float]]:
    """The decay and correlation of the scan weights with the smallest loss, and all losses.

    `fitted` holds the knots, and the numbers that the curves do not.
    """
    losses = {}
    for decay, correlation in product(DECAYS, CORRELATIONS):
        numbers = {**fitted, **curves.numbers()}
        numbers |= {"weight_decay": decay, "correlation": correlation}
        losses[decay, correlation] = loss_of(table, numbers)
    best = min(losses, key=lambda key: losses[key])
    return *best, losses
