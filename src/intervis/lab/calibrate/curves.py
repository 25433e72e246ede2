"""Maximum-likelihood fit of the occupancy curves, the attenuation and the scan weights."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from scipy import sparse
from scipy.optimize import minimize

from intervis.arrays import BoolArray, Float64Array
from intervis.lab.calibrate.line_set import SampleTable
from intervis.sight import occupancy_model as model

SMOOTHNESS = 2e-4
"""Penalty on squared second differences of a curve, in units of the mean likelihood."""
BASE_OPTICAL_DEPTH_BOUNDS = (1e-4, 5e-2)
DECAYS = (0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
CORRELATIONS = (0.0, 0.15, 0.3, 0.45, 0.6)
_MIN_OPTICAL_DEPTH = 1e-9


@dataclass(frozen=True, eq=False)
class Curves:
    """Fitted curves, attenuation and base optical depth.

    `loss` is the mean negative log-likelihood per line, each query set weighted alike.
    """

    surface_log_odds: Float64Array
    volumetric_log_odds: Float64Array
    height_log_odds: Float64Array
    attenuation_per_m: float
    base_optical_depth: float
    loss: float


def design_matrix(table: SampleTable, decay: float, correlation: float) -> sparse.csr_array:
    """Matrix (K, 2 D + H): times the knots of all curves it gives the log-odds of the samples."""
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


def line_losses(optical_depth: Float64Array, visible: BoolArray) -> Float64Array:
    """Negative log-likelihood of each line under P(visible) = exp(-x)."""
    x = np.maximum(optical_depth, _MIN_OPTICAL_DEPTH)
    return np.asarray(np.where(visible, x, -np.log(-np.expm1(-x))))


class _Likelihood:
    """Penalised loss and its gradient over (knots, log attenuation, log base optical depth)."""

    def __init__(self, table: SampleTable, matrix: sparse.csr_array, depth_knots: int) -> None:
        self.table, self.matrix = table, matrix
        self.transposed = sparse.csr_array(matrix.T)
        self.weight = table.weight / table.weight.sum()
        fixed = np.where(table.below_ground, model.BELOW_GROUND_ATTENUATION_PER_M, 0.0)
        self.fixed = np.bincount(table.line, fixed * table.step_m, len(table.visible))
        self.step_m = np.where(table.below_ground, 0.0, table.step_m)
        sizes = (depth_knots, depth_knots, matrix.shape[1] - 2 * depth_knots)
        differences = [_second_differences(size) for size in sizes]
        self.difference = sparse.csr_array(sparse.block_diag(differences))

    def optical_depth(self, theta: Float64Array) -> tuple[Float64Array, Float64Array, Float64Array]:
        """Optical depths of the lines, occupancy of the samples, and where log-odds are free."""
        raw = self.matrix @ theta[:-2] + self.table.height_log_odds
        bounded = np.where(
            self.table.occupied, np.maximum(raw, model.DYNAMIC_OCCUPIED_LOG_ODDS), raw
        )
        bounded = np.where(
            self.table.left, np.minimum(bounded, model.DYNAMIC_FREE_LOG_ODDS), bounded
        )
        occupancy = 1.0 / (1.0 + np.exp(-bounded))
        part = np.exp(theta[-2]) * occupancy * self.step_m
        x = np.exp(theta[-1]) + self.fixed + np.bincount(self.table.line, part, len(self.fixed))
        return x, occupancy, np.asarray(bounded == raw, dtype=np.float64)

    def __call__(self, theta: Float64Array) -> tuple[float, Float64Array]:
        x, occupancy, free = self.optical_depth(theta)
        loss = float(self.weight @ line_losses(x, self.table.visible))
        x = np.maximum(x, _MIN_OPTICAL_DEPTH)
        by_x = self.weight * np.where(self.table.visible, 1.0, -1.0 / np.expm1(x))
        attenuation = np.exp(theta[-2])
        by_sample = by_x[self.table.line] * attenuation * self.step_m * occupancy
        bend = self.difference @ theta[:-2]
        gradient = np.empty(len(theta))
        gradient[:-2] = self.transposed @ (by_sample * (1.0 - occupancy) * free)
        gradient[:-2] += 2.0 * SMOOTHNESS * (self.difference.T @ bend)
        gradient[-2] = by_sample.sum()
        gradient[-1] = by_x.sum() * np.exp(theta[-1])
        return loss + SMOOTHNESS * float(bend @ bend), gradient


def _second_differences(size: int) -> sparse.csr_array:
    return sparse.csr_array(
        sparse.diags_array([1.0, -2.0, 1.0], offsets=[0, 1, 2], shape=(size - 2, size))
    )


def fit_curves(
    table: SampleTable,
    depth_m: Float64Array,
    height_m: Float64Array,
    decay: float = model.WEIGHT_DECAY,
    correlation: float = model.CORRELATION,
) -> Curves:
    """Fit all curves to the lines of a table, from a start that knows none of them.

    Parameters
    ----------
    table : SampleTable
    depth_m, height_m : (D,) and (H,) float64 arrays
        The knots that the table was made with.
    decay, correlation : float
        Of the scan weights.

    Returns
    -------
    Curves
    """
    likelihood = _Likelihood(table, design_matrix(table, decay, correlation), len(depth_m))
    near_surface = np.where((depth_m > -0.2) & (depth_m < 1.5), 3.0, -1.0)
    start = np.concatenate([near_surface, near_surface, np.full(len(height_m), -4.0), [0.0, -6.0]])
    bounds = [(-8.0, 8.0)] * (len(start) - 2)
    bounds += [(np.log(0.2), np.log(5.0)), tuple(np.log(BASE_OPTICAL_DEPTH_BOUNDS))]
    found = minimize(likelihood, start, jac=True, method="L-BFGS-B", bounds=bounds)
    theta, count = found.x, len(depth_m)
    x, _, _ = likelihood.optical_depth(theta)
    return Curves(
        surface_log_odds=theta[count : 2 * count],
        volumetric_log_odds=theta[:count],
        height_log_odds=theta[2 * count : -2],
        attenuation_per_m=float(np.exp(theta[-2])),
        base_optical_depth=float(np.exp(theta[-1])),
        loss=float(likelihood.weight @ line_losses(x, table.visible)),
    )


def loss_of(table: SampleTable, fitted: Mapping[str, Any]) -> float:
    """Mean negative log-likelihood per line under the numbers of a fitted file."""
    matrix = design_matrix(table, fitted["weight_decay"], fitted["correlation"])
    likelihood = _Likelihood(table, matrix, len(fitted["depth_m"]))
    theta = np.concatenate(
        [
            fitted["volumetric_log_odds"],
            fitted["surface_log_odds"],
            fitted["height_log_odds"],
            np.log([fitted["attenuation_per_m"], fitted["base_optical_depth"]]),
        ]
    )
    x, _, _ = likelihood.optical_depth(theta)
    return float(likelihood.weight @ line_losses(x, table.visible))


def choose_weights(
    table: SampleTable, curves: Curves, depth_m: Float64Array, height_m: Float64Array
) -> tuple[float, float, dict[tuple[float, float], float]]:
    """The decay and correlation of the scan weights with the smallest loss, and all losses."""
    losses = {}
    for decay, correlation in product(DECAYS, CORRELATIONS):
        numbers = {
            "weight_decay": decay,
            "correlation": correlation,
            "depth_m": depth_m,
            "height_m": height_m,
            "surface_log_odds": curves.surface_log_odds,
            "volumetric_log_odds": curves.volumetric_log_odds,
            "height_log_odds": curves.height_log_odds,
            "attenuation_per_m": curves.attenuation_per_m,
            "base_optical_depth": curves.base_optical_depth,
        }
        losses[decay, correlation] = loss_of(table, numbers)
    best = min(losses, key=lambda key: losses[key])
    return *best, losses
