"""Dynamic objects: where they stood at the query time, from two scans that bracket it.

The rule is defined in `intervis.sight.occupancy_model`.
"""

import numpy as np

from intervis.arrays import Float64Array, Int16Array, IntArray
from intervis.kernels import kernel
from intervis.sight.kernels.batch import (
    BRACKETED,
    BRACKETING,
    BY_BRACKETING,
    BY_NEAREST,
    DEPTH,
    DIRECTION,
    DYNAMIC,
    FIRST,
    HEIGHT,
    INCREMENT,
    LOG_ODDS,
    NEAR,
    RANK,
    Batch,
    padded_count,
)
from intervis.sight.kernels.packed_scans import FROM_SCENE, depth_at
from intervis.sight.kernels.parameters import Parameters

NO_BRACKETING, NEAREST_DECIDES = 0, -1
"""Values of a line's `BRACKETING` that are no rank."""
DISAGREE, OCCUPIED, LEFT = 2.0, 1.0, -1.0
"""Values of a sample's `DYNAMIC`: two scans disagree (to be resolved); an object stood there; it
had left or had not arrived."""
MIN_BASELINE_M = 0.5
"""Two scans closer than this define no direction."""


@kernel
def find_bracketing(
    position: Float64Array,
    time_offset_s: Float64Array,
    first: Float64Array,
    second: Float64Array,
    chosen: IntArray,
    lines: Float64Array,
) -> None:
    """Rank of the bracketing scan of each line: the nearest one on the other side of the query.

    `NO_BRACKETING` where there is none; `NEAREST_DECIDES` where a query time is given and lies
    outside the time span of the scans.

    Without a query time, the query is the passage of the sensor by the line's end that is closer to
    the nearest scan. `DIRECTION` becomes the unit vector (x, y) from the nearest to the bracketing
    scan, and the fraction of the way, or of the time, that had passed at the query. `BRACKETED`
    becomes 1 where scans before and after the query time contribute.
    """
    for i in range(len(first)):
        k = chosen[i, 0]
        x, y, z, offset_s = position[k, 0], position[k, 1], position[k, 2], time_offset_s[k]
        a0, a1, a2 = first[i, 0], first[i, 1], first[i, 2]
        b0, b1, b2 = second[i, 0], second[i, 1], second[i, 2]
        to_a = (a0 - x) ** 2 + (a1 - y) ** 2 + (a2 - z) ** 2
        to_b = (b0 - x) ** 2 + (b1 - y) ** 2 + (b2 - z) ** 2
        end_x, end_y = a0 if to_a <= to_b else b0, a1 if to_a <= to_b else b1
        u, v = end_x - x, end_y - y
        timed = not np.isnan(offset_s)
        rank = 0
        for n in range(chosen.shape[1] - 1, 0, -1):
            k = chosen[i, n]
            ahead = (position[k, 0] - end_x) * u + (position[k, 1] - end_y) * v
            rank = n if (-offset_s * time_offset_s[k] if timed else ahead) > 0.0 else rank
        k = chosen[i, rank]
        p, q = position[k, 0] - x, position[k, 1] - y
        length = np.sqrt(p * p + q * q)
        to_x, to_y = p / length, q / length
        passed = min(max((u * to_x + v * to_y) / length, 0.0), 1.0)
        lines[i, DIRECTION], lines[i, DIRECTION + 1] = to_x, to_y
        lines[i, DIRECTION + 2] = offset_s / (offset_s - time_offset_s[k]) if timed else passed
        lines[i, BRACKETED] = 1.0 if timed and rank > 0 else 0.0
        alone = NEAREST_DECIDES if timed else NO_BRACKETING
        known = NO_BRACKETING if length < MIN_BASELINE_M else rank
        lines[i, BRACKETING] = alone if rank == 0 else known


@kernel
def keep_depths(
    samples: Float64Array, lines: Float64Array, offsets: IntArray, count: int, n: int
) -> None:
    """Copy the n-th scan's depths for the lines whose bracketing scan it is."""
    for i in range(count):
        if int(lines[i, BRACKETING]) == n:
            for m in range(offsets[i, 0], offsets[i, 2]):
                samples[BY_BRACKETING, m] = samples[DEPTH, m]


@kernel
def find_dynamic(
    samples: Float64Array,
    lines: Float64Array,
    offsets: IntArray,
    count: int,
    parameters: Parameters,
) -> None:
    """Mark samples, at heights of traffic, that one scan saw occupied and the other saw free.

    Where the nearest scan alone decides, samples that it saw free are `LEFT`.
    """
    surface_from_m, free_m = parameters.surface_from_m, parameters.free_depth_m
    max_depth_m = parameters.dynamic_max_depth_m
    low_m, high_m = parameters.dynamic_min_height_m, parameters.dynamic_max_height_m
    for i in range(count):
        begin, end = offsets[i, 0], offsets[i, 2]
        by_nearest, by_bracketing = (
            samples[BY_NEAREST, begin:end],
            samples[BY_BRACKETING, begin:end],
        )
        height, dynamic = samples[HEIGHT, begin:end], samples[DYNAMIC, begin:end]
        two_see = DISAGREE if lines[i, BRACKETING] > 0.0 else 0.0
        one_sees = LEFT if lines[i, BRACKETING] == NEAREST_DECIDES else 0.0
        for m in range(padded_count(begin, end)):
            one, other, above_m = by_nearest[m], by_bracketing[m], height[m]
            at_height = (above_m >= low_m) & (above_m <= high_m)
            # NaN where either scan observed nothing: the comparisons are then false.
            occupied = (max(one, other) >= surface_from_m) & (max(one, other) <= max_depth_m)
            free = (one < free_m) | (other < free_m)
            disagree = two_see if at_height & occupied & free else 0.0
            dynamic[m] = one_sees if at_height & (one < free_m) & (two_see == 0.0) else disagree


@kernel
def resolve_dynamic(
    pixels: Int16Array,
    first: Float64Array,
    second: Float64Array,
    parameters: Parameters,
    batch: Batch,
) -> None:
    """Decide for samples on which two scans disagree whether an object stood there."""
    samples = batch.samples
    for i in range(len(first)):
        line, a, b = batch.lines[i], first[i], second[i]
        if line[BRACKETING] <= 0.0:
            continue
        rank, begin = int(line[BRACKETING]), batch.offsets[i, 0]
        nearest = batch.descriptors[batch.chosen[i, 0]]
        bracketing = batch.descriptors[batch.chosen[i, rank]]
        direction = line[DIRECTION : DIRECTION + 3]
        for m in range(begin, batch.offsets[i, 1]):
            if samples[DYNAMIC, m] != DISAGREE:
                continue
            s = (m - begin + line[FIRST]) * line[INCREMENT]
            x, y, z = a[0] + s * (b[0] - a[0]), a[1] + s * (b[1] - a[1]), a[2] + s * (b[2] - a[2])
            if not was_occupied(pixels, nearest, bracketing, x, y, z, direction, parameters):
                samples[DYNAMIC, m] = LEFT
                continue
            samples[DYNAMIC, m] = OCCUPIED
            if samples[NEAR, m] > parameters.surface_to_m:
                one, other = samples[BY_NEAREST, m], samples[BY_BRACKETING, m]
                samples[NEAR, m] = parameters.surface_to_m
                samples[RANK, m] = 0 if one > other else rank


@kernel
def was_occupied(
    pixels: Int16Array,
    nearest: Float64Array,
    bracketing: Float64Array,
    x: float,
    y: float,
    z: float,
    direction: Float64Array,
    parameters: Parameters,
) -> bool:
    """Whether an object on its way from one scan's surface to the other's stood at a point.

    `nearest` and `bracketing` are the descriptors of the two scans.
    """
    surface_from_m, surface_to_m = parameters.surface_from_m, parameters.surface_to_m
    free_m, step_m = parameters.free_depth_m, parameters.motion_step_m
    to_x, to_y, before, after = direction[0], direction[1], direction[2], 1.0 - direction[2]
    occupied, step = False, 0.5 * step_m
    a, b, c = _in_sensor_frame(nearest, x, y, z, 1.0)
    da, db, dc = _in_sensor_frame(nearest, to_x, to_y, 0.0, 0.0)
    u, v, w = _in_sensor_frame(bracketing, x, y, z, 1.0)
    du, dv, dw = _in_sensor_frame(bracketing, to_x, to_y, 0.0, 0.0)
    while step < parameters.motion_reach_m and not occupied:
        for moved in (-step, step):
            p, q = -moved * before, moved * after
            depth = depth_at(pixels, nearest, a + p * da, b + p * db, c + p * dc)
            if occupied or not surface_from_m <= depth <= surface_to_m:
                continue
            depth = depth_at(pixels, bracketing, u + q * du, v + q * dv, w + q * dw)
            if not surface_from_m <= depth <= surface_to_m:
                continue
            occupied = depth_at(pixels, bracketing, u + p * du, v + p * dv, w + p * dw) < free_m
            if not occupied:
                occupied = depth_at(pixels, nearest, a + q * da, b + q * db, c + q * dc) < free_m
        step += step_m
    return occupied


@kernel
def _in_sensor_frame(
    descriptor: Float64Array, x: float, y: float, z: float, w: float
) -> tuple[float, float, float]:
    """A point (w = 1) or a direction (w = 0) of the scene in a scan's sensor frame."""
    g = descriptor[FROM_SCENE:]
    u = g[0] * x + g[1] * y + g[2] * z + g[3] * w
    v = g[4] * x + g[5] * y + g[6] * z + g[7] * w
    return u, v, g[8] * x + g[9] * y + g[10] * z + g[11] * w


@kernel
def apply_dynamic(samples: Float64Array, count: int, occupied: float, free: float) -> None:
    """Bound the log-odds of dynamic samples: at least `occupied`, or at most `free`."""
    log_odds, dynamic = samples[LOG_ODDS], samples[DYNAMIC]
    for m in range(count):
        summed = log_odds[m]
        at_least = max(summed, occupied) if dynamic[m] > 0.0 else summed
        log_odds[m] = min(at_least, free) if dynamic[m] < 0.0 else at_least
