"""Sums over scans for each voxel of a grid, and the states and probabilities that follow."""

from typing import NamedTuple

import numpy as np

from intervis.arrays import Float32Array, Float64Array, Int16Array, UInt8Array
from intervis.kernels import kernel
from intervis.sight.kernels.carving import ACROSS, BEFORE, BEHIND, UNSEEN, VOLUMETRIC
from intervis.sight.kernels.parameters import OccupancyModel, Parameters
from intervis.sight.kernels.samples import clamped
from intervis.sight.kernels.terrain import ASSUMED_OFFSET_M

HIT, FREE = 0.85, -0.4
"""Evidence of one scan for an occupied and for a free voxel, in log-odds: the values of OctoMap
(Hornung et al. 2013, doi:10.1007/s10514-012-9321-0)."""
FREE_SPACE, OCCUPIED, OCCLUDED, UNKNOWN = range(4)
"""The states of a voxel."""


class CarvedSums(NamedTuple):
    """What the scans so far say about each voxel, (I, J, K) each.

    `log_odds` is the sum of the depth's log-odds over the `scans` that observed the voxel,
    `evidence` the sum of `HIT` and `FREE`. `behind` is 1 where some scan saw a surface before the
    voxel. `now` is what the scan of the moment says, `UNSEEN` to `BEHIND`.
    """

    log_odds: Float32Array
    evidence: Float32Array
    scans: Int16Array
    behind: UInt8Array
    now: UInt8Array


@kernel
def accumulate_scan(
    place: UInt8Array,
    centre_depth: Float32Array,
    returns: UInt8Array,
    is_now: bool,
    depth_log_odds: Float64Array,
    parameters: Parameters,
    sums: CarvedSums,
) -> None:
    """Add what one scan says about the planes of voxels at hand.

    A voxel that holds a return, or that the surface passes, is occupied; its depth counts as 0.
    """
    entries = len(depth_log_odds) // 3
    columns, rows, levels = place.shape
    for i in range(columns):
        for j in range(rows):
            for k in range(levels):
                found, depth = place[i, j, k], centre_depth[i, j, k]
                volumetric, found = found >= VOLUMETRIC, found & 3
                if returns[i, j, k] > 0:
                    found = ACROSS
                if found == ACROSS:
                    depth = np.float32(0.0)
                if found == UNSEEN:
                    continue
                if depth == depth:
                    at = (depth - parameters.depth_from_m) * parameters.entries_per_m
                    entry = int(clamped(at, entries - 1.0))
                    entry += 0 if volumetric else entries
                    sums.log_odds[i, j, k] += depth_log_odds[entry]
                    sums.scans[i, j, k] += 1
                if found == BEHIND:
                    sums.behind[i, j, k] = 1
                else:
                    sums.evidence[i, j, k] += HIT if found == ACROSS else FREE
                if is_now:
                    sums.now[i, j, k] = found


@kernel
def finish_grid(
    sums: CarvedSums,
    height: Float64Array,
    cell_m: float,
    model: OccupancyModel,
    total_weight: Float64Array,
    state: UInt8Array,
    probability: Float32Array,
) -> None:
    """States and probabilities of the planes of voxels at hand from their sums.

    `height` (n, J) is the height of the lowest centres above the ground, as `compute_heights`
    gives it: greater by `ASSUMED_OFFSET_M` over assumed ground, NaN without any.
    `total_weight` (W,): the sum of the weights of so many scans.
    """
    columns, rows, levels = state.shape
    parameters, occupancies = model.parameters, model.tables.occupancies
    heights, most = model.tables.height_log_odds, len(total_weight) - 1
    for i in range(columns):
        for j in range(rows):
            for k in range(levels):
                above = height[i, j] + k * cell_m
                assumed = above > 0.5 * ASSUMED_OFFSET_M
                start = parameters.height_from_m
                start = ASSUMED_OFFSET_M + parameters.assumed_from_m if assumed else start
                last, known = len(heights) - 1.0, parameters.known_height_entries
                entry = clamped((above - start) * parameters.entries_per_m, last)
                entry = min(entry + known, last) if assumed else min(entry, known - 1.0)
                log_odds = heights[int(entry)]
                n = sums.scans[i, j, k]
                if n > 0:
                    log_odds += total_weight[min(n, most)] * sums.log_odds[i, j, k] / n
                at = (log_odds - parameters.log_odds_from) * parameters.entries_per_log_odds
                probability[i, j, k] = occupancies[int(clamped(at, len(occupancies) - 1.0))]
                now, evidence = sums.now[i, j, k], sums.evidence[i, j, k]
                if now == ACROSS or (now != BEFORE and evidence > 0.0):
                    state[i, j, k] = OCCUPIED
                elif now == BEFORE or evidence < 0.0:
                    state[i, j, k] = FREE_SPACE
                else:
                    state[i, j, k] = OCCLUDED if sums.behind[i, j, k] else UNKNOWN
