"""March along many sight lines: from range images to sums over the samples of each line.

The definition is in `intervis.sight.occupancy_model`; `intervis.sight.reference` implements it
plainly, and tests hold this code to it. Why the passes are cut as they are: see
`intervis.sight.kernels`.
"""

import numpy as np

from intervis.arrays import Float64Array, Int32Array
from intervis.kernels import kernel
from intervis.sight.kernels.batch import (
    BY_NEAREST,
    DEPTH,
    DYNAMIC,
    HEIGHT,
    LOG_ODDS,
    PLACE,
    Batch,
    lay_out,
    select_scan,
)
from intervis.sight.kernels.dynamics import (
    apply_dynamic,
    find_bracketing,
    find_dynamic,
    keep_depths,
    resolve_dynamic,
)
from intervis.sight.kernels.line_sums import (
    LineSums,
    add_up,
    classify_samples,
    clear_ends,
)
from intervis.sight.kernels.packed_scans import PackedScans, choose_scans
from intervis.sight.kernels.parameters import OccupancyModel, Parameters
from intervis.sight.kernels.samples import (
    accumulate,
    clamped,
    compute_depths,
    compute_heights,
    gather,
    place_samples,
    project,
    reduce_depths,
)
from intervis.sight.kernels.terrain import ASSUMED_OFFSET_M


@kernel
def _find_places(
    samples: Float64Array,
    row: int,
    places: Int32Array,
    count: int,
    start: float,
    entries_per_unit: float,
    entries: int,
) -> None:
    """Entries of a row's values in a table that begins at `start`."""
    value, place, last = samples[row], places[PLACE], entries - 1.0
    for m in range(count):
        place[m] = clamped((value[m] - start) * entries_per_unit, last)


@kernel
def _find_heights(
    samples: Float64Array, places: Int32Array, count: int, parameters: Parameters, entries: int
) -> None:
    """Entries of the samples' heights in the table over known and, after it, assumed ground."""
    height_of, place = samples[HEIGHT], places[PLACE]
    per_m, offset_m = parameters.entries_per_m, ASSUMED_OFFSET_M
    known_from_m, assumed_from_m = parameters.height_from_m, parameters.assumed_from_m
    known, last = parameters.known_height_entries, entries - 1.0
    for m in range(count):
        height = height_of[m]
        assumed = height > 0.5 * offset_m
        start = offset_m + assumed_from_m if assumed else known_from_m
        entry = clamped((height - start) * per_m, last)
        entry = min(entry + known, last) if assumed else min(entry, known - 1.0)
        place[m] = entry


@kernel
def _add_height_prior(
    samples: Float64Array, places: Int32Array, count: int, table: Float64Array
) -> None:
    """Add the prior log-odds of the samples' heights above ground."""
    log_odds, place = samples[LOG_ODDS], places[PLACE]
    for m in range(count):
        log_odds[m] += table[np.uint32(place[m])]


@kernel
def _to_occupancy(
    samples: Float64Array, places: Int32Array, count: int, table: Float64Array
) -> None:
    """Replace the log-odds of the samples by probabilities."""
    log_odds, place = samples[LOG_ODDS], places[PLACE]
    for m in range(count):
        log_odds[m] = table[np.uint32(place[m])]


@kernel
def march(
    scans: PackedScans,
    first: Float64Array,
    second: Float64Array,
    model: OccupancyModel,
    batch: Batch,
    sums: LineSums,
) -> None:
    """Write the sums of the lines from `first` to `second`, (L, 3) each, scene frame."""
    pixels, ground, position = scans.pixels, scans.ground.reshape(-1), scans.position
    age_cost_m, time_offset_s = scans.age_cost_m, scans.time_offset_s
    samples, places, lines = batch.samples, batch.places, batch.lines
    offsets, chosen = batch.offsets, batch.chosen
    distance, chosen_distance = batch.distance, batch.chosen_distance
    parameters, tables = model.parameters, model.tables
    depth_log_odds, height_log_odds = tables.depth_log_odds, tables.height_log_odds
    occupancies, used = tables.occupancies, chosen.shape[1]
    weights, entries = tables.scan_weights[used - 1], float(len(depth_log_odds) // 3)
    per_log_odds = parameters.entries_per_log_odds
    at = 0
    while at < len(first):
        count = lay_out(
            first, second, at, parameters.step_m, parameters.end_margin_m, lines, offsets
        )
        total, a, b = offsets[count - 1, 2], first[at : at + count], second[at : at + count]
        if len(position) > 1:
            choose_scans(position, age_cost_m, a, b, chosen, distance, chosen_distance)
            find_bracketing(position, time_offset_s, a, b, chosen, lines)
        place_samples(count, batch)
        for n in range(used):
            depths = BY_NEAREST if n == 0 else DEPTH
            runs = select_scan(n, a, b, batch)
            project(n, count, batch)
            gather(pixels, runs, batch)
            compute_depths(depths, runs, batch, parameters, entries)
            reduce_depths(samples, depths, n, total, parameters.surface_from_m)
            accumulate(samples, places, n, total, depth_log_odds, weights[n])
            if n == 0:
                compute_heights(ground, position, a, b, batch)
            else:
                keep_depths(samples, lines, offsets, count, n)
        _find_heights(samples, places, total, parameters, len(height_log_odds))
        _add_height_prior(samples, places, total, height_log_odds)
        if used > 1:
            find_dynamic(samples, lines, offsets, count, parameters)
            resolve_dynamic(pixels, a, b, parameters, batch)
            occupied, free = parameters.dynamic_occupied_log_odds, parameters.dynamic_free_log_odds
            apply_dynamic(samples, total, occupied, free)
        else:
            samples[DYNAMIC, :total] = 0.0
        clear_ends(samples, offsets, count, parameters, parameters.log_odds_from)
        start, steps = parameters.log_odds_from, len(occupancies)
        _find_places(samples, LOG_ODDS, places, total, start, per_log_odds, steps)
        _to_occupancy(samples, places, total, occupancies)
        classify_samples(samples, total, parameters)
        add_up(time_offset_s, count, batch, parameters, at, sums)
        at += count


@kernel
def order_ends(first: Float64Array, second: Float64Array) -> None:
    """Swap the ends of lines, (L, 3) each, so that the lexicographically smaller one is first.

    The engine never knows which end is the viewpoint. Answers are therefore reciprocal to the bit.
    """
    for i in range(len(first)):
        swap = False
        for axis in range(3):
            if first[i, axis] != second[i, axis]:
                swap = first[i, axis] > second[i, axis]
                break
        if swap:
            for axis in range(3):
                first[i, axis], second[i, axis] = second[i, axis], first[i, axis]
