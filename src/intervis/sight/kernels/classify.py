"""States, probabilities, blockers, clearances and observed shares of many sight lines."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from intervis.arrays import Float64Array
from intervis.kernels import kernel
from intervis.sight.kernels.batch import new_batch
from intervis.sight.kernels.line_sums import new_line_sums
from intervis.sight.kernels.march import march, order_ends
from intervis.sight.kernels.occluder import locate_occluder
from intervis.sight.kernels.packed_scans import PackedScans
from intervis.sight.kernels.parameters import OccupancyModel, Parameters, Thresholds

_LINES_AT_ONCE = 256


class Answers(NamedTuple):
    """The fields of `intervis.sight.Sight`, of L lines."""

    state: NDArray[np.int8]
    probability: Float64Array
    blocker: Float64Array
    clearance: Float64Array
    observed: Float64Array


@kernel
def _can_be_judged(a: Float64Array, b: Float64Array, max_range_m: float) -> bool:
    """Whether a line's length is finite and at most `max_range_m`."""
    length = np.sqrt((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2 + (b[2] - a[2]) ** 2)
    return bool(np.isfinite(length) and length <= max_range_m)


@kernel
def _probability(
    optical_depth: float,
    movable: float,
    time_gap_s: float,
    bracketed: bool,
    parameters: Parameters,
) -> float:
    """P(visible): `occupancy_model.change_fractions` and `occupancy_model.probability` in one."""
    changed = 1.0 - np.exp(-time_gap_s / parameters.change_time_s)
    most = parameters.max_changed
    disappeared = parameters.disappeared if bracketed else parameters.disappeared_unbracketed
    appeared = parameters.appeared if bracketed else parameters.appeared_unbracketed
    disappeared = min(disappeared * changed, most)
    appeared = min(appeared * changed, most)
    unchanged = 1.0 / (1.0 + np.expm1(optical_depth) ** parameters.sharpness)
    static = 1.0 / (1.0 + np.expm1(max(optical_depth - movable, 0.0)) ** parameters.sharpness)
    return float(unchanged + disappeared * (static - unchanged) - appeared * unchanged)


@kernel
def _mostly_observed(
    unobserved_m: float, occluded_space_m: float, length_m: float, parameters: Parameters
) -> bool:
    """`occupancy_model.mostly_observed`."""
    sampled_m = max(length_m - 2.0 * parameters.end_margin_m, 0.0)
    allowed_m = min(
        parameters.observed_max_unobserved_m,
        parameters.observed_max_unobserved_fraction * sampled_m,
    )
    return bool(
        unobserved_m <= allowed_m and occluded_space_m <= parameters.observed_max_occluded_space_m
    )


@kernel
def _state(
    probability: float, mostly_observed: bool, meets_surface: bool, thresholds: Thresholds
) -> int:
    """1 visible, 0 occluded, -1 unknown."""
    if meets_surface and probability <= thresholds.occluded_to:
        return 0
    least = thresholds.visible_from if mostly_observed else thresholds.visible_unobserved_from
    return 1 if probability >= least else -1


@kernel
def answer_range(
    scans: PackedScans,
    starts: Float64Array,
    ends: Float64Array,
    paired: bool,
    model: OccupancyModel,
    thresholds: Thresholds,
    max_range_m: float,
    begin: int,
    stop: int,
    answers: Answers,
) -> None:
    """Write the answers of lines `begin` to `stop`; see `intervis.sight.answers.answer_lines`."""
    parameters = model.parameters
    batch, in_sensor_frame = new_batch(scans, model), np.empty((2, 3))
    first, second = np.empty((_LINES_AT_ONCE, 3)), np.empty((_LINES_AT_ONCE, 3))
    which = np.empty(_LINES_AT_ONCE, np.int64)
    sums = new_line_sums(_LINES_AT_ONCE)
    at = begin
    while at < stop:
        count = 0
        while at < stop and count < _LINES_AT_ONCE:
            a = starts[at if paired else at // len(ends)]
            b = ends[at if paired else at % len(ends)]
            answers.state[at] = -1
            answers.probability[at] = np.nan
            answers.clearance[at] = np.nan
            answers.blocker[at] = np.nan
            answers.observed[at] = np.nan
            if _can_be_judged(a, b, max_range_m):
                first[count], second[count] = a, b
                which[count] = at
                count += 1
            at += 1
        order_ends(first[:count], second[:count])
        march(scans, first[:count], second[:count], model, batch, sums)
        for i in range(count):
            line, a, b = which[i], first[i], second[i]
            length = np.sqrt((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2 + (b[2] - a[2]) ** 2)
            end_m = sums.end_occluded_m[i]
            optical_depth = parameters.base_optical_depth + sums.free[i] + sums.surface[i]
            optical_depth += sums.unobserved[i]
            optical_depth += parameters.end_occluded_depth * end_m**parameters.end_occluded_power
            probability = _probability(
                optical_depth,
                sums.movable[i],
                sums.time_gap_s[i],
                sums.bracketed[i] > 0,
                parameters,
            )
            observed = _mostly_observed(
                sums.unobserved_m[i], sums.occluded_space_m[i], length, parameters
            )
            meets_surface = sums.surface[i] >= parameters.occluded_min_surface
            state = _state(probability, observed, meets_surface, thresholds)
            answers.state[line] = state
            answers.probability[line] = probability
            answers.clearance[line] = sums.clearance_m[i]
            sampled_m = length - 2.0 * parameters.end_margin_m
            share = sums.unobserved_m[i] / sampled_m if sampled_m > 0.0 else 0.0
            answers.observed[line] = 1.0 - min(share, 1.0)
            if state == 0:
                answers.clearance[line] = -locate_occluder(
                    scans.pixels,
                    batch.descriptors[sums.occluder_scan[i]],
                    a,
                    b,
                    length,
                    sums.occluder_m[i],
                    in_sensor_frame,
                    answers.blocker[line],
                )
