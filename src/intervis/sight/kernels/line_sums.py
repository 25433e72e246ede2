"""Sums over the samples of each sight line."""

from typing import NamedTuple

import numpy as np

from intervis.arrays import Float64Array, IntArray
from intervis.kernels import kernel
from intervis.sight.kernels.batch import (
    BRACKETED,
    CLEARANCE,
    DYNAMIC,
    FIRST,
    FREE,
    GAP,
    HEIGHT,
    IN_OCCLUDED_SPACE,
    IS_UNOBSERVED,
    LOG_ODDS,
    NEAR,
    RANK,
    STEP_M,
    SURFACE,
    UNOBSERVED,
    Batch,
)
from intervis.sight.kernels.parameters import Parameters


class LineSums(NamedTuple):
    """What the samples of L lines add up to; see `intervis.sight.occupancy_model`.

    Optical depth in three parts: `surface`, `free`, `unobserved`; `movable` is the part of
    `surface` at heights of traffic and people. `unobserved_m` is the length that no scan observed,
    `occluded_space_m` the part of it behind observed surfaces, and `end_occluded_m` the part of
    that which reaches an end of the line. `time_gap_s` is the time between the query and the
    nearest scan, 0 without a query time; `bracketed` is 1 where scans before and after it
    contribute, else 0. `clearance_m` is the smallest gap to a surface or the ground (inf: none).
    `occluder_m` is the distance from the line's first end to the sample at a surface with the
    highest occupancy, `occluder_scan` the scan that observed it (-1: none).
    """

    free: Float64Array
    surface: Float64Array
    movable: Float64Array
    unobserved: Float64Array
    unobserved_m: Float64Array
    occluded_space_m: Float64Array
    end_occluded_m: Float64Array
    time_gap_s: Float64Array
    clearance_m: Float64Array
    occluder_m: Float64Array
    bracketed: Float64Array
    occluder_scan: IntArray


@kernel
def new_line_sums(count: int) -> LineSums:
    """Uninitialised sums for so many lines."""
    v = np.empty((11, count))
    scan = np.empty(count, np.int64)
    return LineSums(v[0], v[1], v[2], v[3], v[4], v[5], v[6], v[7], v[8], v[9], v[10], scan)


@kernel
def length_at_ends(flags: Float64Array, begin: int, end: int) -> int:
    """Samples from either end of a line inwards, up to the first one without the flag."""
    first = begin
    while first < end and flags[first] > 0.0:
        first += 1
    last = end
    while last > first and flags[last - 1] > 0.0:
        last -= 1
    return first - begin + end - last


@kernel
def clear_ends(
    samples: Float64Array,
    offsets: IntArray,
    count: int,
    parameters: Parameters,
    lowest_log_odds: float,
) -> None:
    """Make the samples along the surface that an end of their line lies on free.

    From each end inwards: all samples up to the first one that is farther than `end_surface_m` from
    every surface, below ground, or occupied by a dynamic object. If that one is not free, the line
    enters the surface: fewer than `grazing_samples` then stay as they are.
    """
    log_odds, gap, near = samples[LOG_ODDS], samples[GAP], samples[NEAR]
    height, dynamic = samples[HEIGHT], samples[DYNAMIC]
    for i in range(count):
        begin, end = offsets[i, 0], offsets[i, 1]
        for way in range(2):
            first, step = (begin, 1) if way == 0 else (end - 1, -1)
            m = first
            while (
                begin <= m < end
                and near[m] <= parameters.end_surface_m
                and not height[m] < -parameters.below_ground_m
                and not dynamic[m] > 0.0
            ):
                m += step
            if begin <= m < end and abs(m - first) < parameters.grazing_samples:
                leaves = near[m] == np.inf and gap[m] < np.inf
                if not leaves or height[m] < -parameters.below_ground_m:
                    continue
            for k in range(first, m, step):
                log_odds[k] = lowest_log_odds
                gap[k] = min(gap[k], 0.0)
                near[k] = np.inf


@kernel
def classify_samples(samples: Float64Array, count: int, parameters: Parameters) -> None:
    """Split the occupancies of the samples into surface, free and unobserved."""
    surface_to_m = parameters.surface_to_m
    gap, near, height = samples[GAP], samples[NEAR], samples[HEIGHT]
    surface, free, unobserved = samples[SURFACE], samples[FREE], samples[UNOBSERVED]
    is_unobserved, occluded_space = samples[IS_UNOBSERVED], samples[IN_OCCLUDED_SPACE]
    clearance = samples[CLEARANCE]
    for m in range(count):
        # One select at a time on values that are loaded unconditionally: joined conditions and
        # conditional loads are not vectorised.
        ahead, depth, above, occupancy = gap[m], near[m], height[m], surface[m]
        met = depth if depth <= surface_to_m else np.inf
        at_surface = occupancy if met < np.inf else 0.0
        in_free = occupancy - at_surface if ahead < np.inf else 0.0
        surface[m] = at_surface
        free[m] = in_free
        unobserved[m] = occupancy - at_surface - in_free
        not_met = 1.0 if met == np.inf else 0.0
        dark = not_met if ahead == np.inf else 0.0
        is_unobserved[m] = dark
        occluded_space[m] = dark if depth < np.inf else 0.0
        least = min(ahead, above) if met == np.inf else np.inf
        clearance[m] = least if ahead < np.inf else np.inf


@kernel
def add_up(
    time_offset_s: Float64Array,
    count: int,
    batch: Batch,
    parameters: Parameters,
    at: int,
    sums: LineSums,
) -> None:
    """Write the sums of a batch's lines, whose samples are classified, from line `at` on.

    `time_offset_s` (S,): scan time minus query time, NaN without a query time.
    """
    samples, attenuation_per_m = batch.samples, parameters.attenuation_per_m
    surface, free, unobserved = samples[SURFACE], samples[FREE], samples[UNOBSERVED]
    is_unobserved, occluded_space = samples[IS_UNOBSERVED], samples[IN_OCCLUDED_SPACE]
    clearance, rank, height = samples[CLEARANCE], samples[RANK], samples[HEIGHT]
    low_m, high_m = parameters.dynamic_min_height_m, parameters.dynamic_max_height_m
    for i in range(count):
        begin, end, step = batch.offsets[i, 0], batch.offsets[i, 1], batch.lines[i, STEP_M]
        at_surface, in_free, in_unobserved, least = 0.0, 0.0, 0.0, np.inf
        samples_unobserved, samples_occluded, movable = 0.0, 0.0, 0.0
        for m in range(begin, end):
            at_surface += surface[m]
            in_traffic = (height[m] >= low_m) & (height[m] <= high_m)
            movable += surface[m] if in_traffic else 0.0
            in_free += free[m]
            in_unobserved += unobserved[m]
            samples_unobserved += is_unobserved[m]
            samples_occluded += occluded_space[m]
            least = min(least, clearance[m])
        most, most_at, most_scan = 0.0, 0.0, -1
        if at_surface > 0.0:
            for m in range(begin, end):
                if surface[m] > most:
                    most = surface[m]
                    most_scan = batch.chosen[i, int(rank[m])]
                    most_at = m - begin + batch.lines[i, FIRST]
        sums.surface[at + i] = at_surface * attenuation_per_m * step
        sums.movable[at + i] = movable * attenuation_per_m * step
        sums.free[at + i] = in_free * attenuation_per_m * step
        sums.unobserved[at + i] = in_unobserved * attenuation_per_m * step
        sums.unobserved_m[at + i] = samples_unobserved * step
        sums.occluded_space_m[at + i] = samples_occluded * step
        sums.end_occluded_m[at + i] = length_at_ends(occluded_space, begin, end) * step
        offset_s = time_offset_s[batch.chosen[i, 0]]
        sums.time_gap_s[at + i] = 0.0 if np.isnan(offset_s) else abs(offset_s)
        sums.bracketed[at + i] = batch.lines[i, BRACKETED]
        sums.clearance_m[at + i] = max(least, 0.0)
        sums.occluder_m[at + i] = most_at * step
        sums.occluder_scan[at + i] = most_scan
