"""Passes over the samples of a batch: what one scan says about them, and their heights.

Why the passes are cut as they are: see `intervis.sight.kernels`.
"""

import numpy as np

from intervis.arrays import Float32Array, Float64Array, Int16Array, Int32Array
from intervis.kernels import kernel
from intervis.sight.kernels.batch import (
    ALONG,
    ENTRY,
    FIRST,
    FRACTION,
    GAP,
    HEIGHT,
    HIGH,
    INCREMENT,
    LOG_ODDS,
    LOW,
    NEAR,
    PIXEL,
    PLACE,
    POSITION,
    RANGE,
    RANK,
    START,
    Batch,
    padded_count,
)
from intervis.sight.kernels.packed_scans import (
    COLUMNS,
    ELEVATION_FROM,
    LEVEL,
    MAX_INTERPOLATED_JUMP,
    OFFSET,
    ROWS,
    ROWS_PER_UNIT,
    UNIT_M,
)
from intervis.sight.kernels.parameters import Parameters
from intervis.sight.kernels.pixel import is_dropout, is_observed
from intervis.sight.kernels.projection import FULL_CIRCLE, pseudo_azimuth, pseudo_elevation
from intervis.sight.kernels.terrain import BORDER_M, CELL_M, CELLS


@kernel
def clamped(value: float, most: float) -> float:
    """A value limited to 0 ... `most`; 0 for NaN."""
    value = value if value > 0.0 else 0.0
    return value if value < most else most


@kernel
def place_samples(count: int, batch: Batch) -> None:
    """Positions of the samples along their lines, from 0 to 1; every scan reuses them."""
    lines, offsets = batch.lines, batch.offsets
    for i in range(count):
        begin, end = offsets[i, 0], offsets[i, 2]
        position, first, increment = (
            batch.samples[POSITION, begin:end],
            lines[i, FIRST],
            lines[i, INCREMENT],
        )
        for m in range(padded_count(begin, end)):
            position[m] = (m + first) * increment


@kernel
def project(n: int, count: int, batch: Batch) -> None:
    """Project the samples into the range images of their lines' n-th scans.

    Writes planar range, the lower of the two nearest pixels in the column, and fractional row.
    """
    samples, places, lines, offsets = batch.samples, batch.places, batch.lines, batch.offsets
    for i in range(count):
        begin, end = offsets[i, 0], offsets[i, 2]
        range_of, fraction_of = samples[RANGE, begin:end], samples[FRACTION, begin:end]
        pixel_of = places[PIXEL, begin:end]
        u0, v0, w0 = lines[i, START], lines[i, START + 1], lines[i, START + 2]
        du, dv, dw = lines[i, ALONG], lines[i, ALONG + 1], lines[i, ALONG + 2]
        position, k = samples[POSITION, begin:end], batch.chosen[i, n]
        elevation_from = batch.descriptors[k, ELEVATION_FROM]
        rows_per_unit = batch.descriptors[k, ROWS_PER_UNIT]
        columns, rows = batch.descriptors[k, COLUMNS], batch.descriptors[k, ROWS]
        columns_per_unit = columns / FULL_CIRCLE
        for m in range(padded_count(begin, end)):
            s = position[m]
            u, v, w = u0 + s * du, v0 + s * dv, w0 + s * dw
            rho = np.sqrt(u * u + v * v)
            f = (pseudo_elevation(rho, w) - elevation_from) * rows_per_unit
            inside = (f >= 0.0) & (f < rows - 1.0)
            f = f if inside else 0.0
            row = np.floor(f)
            column = np.floor(clamped(pseudo_azimuth(u, v) * columns_per_unit, columns - 1.0))
            range_of[m] = max(rho, abs(w))
            fraction_of[m] = f - row if inside else -1.0
            pixel_of[m] = column * rows + row


@kernel
def gather(pixels: Int16Array, runs: int, batch: Batch) -> None:
    """Read the two pixels of each sample."""
    for i in range(runs):
        begin, end = batch.runs[i, 0], batch.runs[i, 1]
        pixel = batch.places[PIXEL, begin:end]
        low, high = batch.values[LOW, begin:end], batch.values[HIGH, begin:end]
        image = pixels[int(batch.descriptors[batch.runs[i, 2], OFFSET]) :]
        for m in range(padded_count(begin, end)):
            at = np.uint32(pixel[m])
            low[m] = image[at]
            high[m] = image[at + 1]


@kernel
def compute_depths(
    to: int, runs: int, batch: Batch, parameters: Parameters, entries: float
) -> None:
    """Depth of the samples behind the observed surface (row `to`), and its entry in the table.

    A dropout has an entry, but no depth: no surface was observed there.
    """
    depth_from_m, entries_per_m = parameters.depth_from_m, parameters.entries_per_m
    for i in range(runs):
        begin, end = batch.runs[i, 0], batch.runs[i, 1]
        range_of, fraction = batch.samples[RANGE, begin:end], batch.samples[FRACTION, begin:end]
        lows, highs = batch.values[LOW, begin:end], batch.values[HIGH, begin:end]
        depth_of, entry_of = batch.samples[to, begin:end], batch.places[ENTRY, begin:end]
        unit_m = batch.descriptors[batch.runs[i, 2], UNIT_M]
        for m in range(padded_count(begin, end)):
            f, low, high = fraction[m], np.int32(lows[m]), np.int32(highs[m])
            value = high if f >= 0.5 else low
            dropout = is_dropout(value) & (f >= 0.0)
            known = is_observed(value) & (f >= 0.0)
            below, above = abs(float(low)), abs(float(high))
            mixed = below + (above - below) * f
            jump = abs(below - above)
            own = abs(float(value))
            surface = mixed if jump < MAX_INTERPOLATED_JUMP * min(below, above) else own
            depth = range_of[m] - surface * unit_m
            entry = np.floor(clamped((depth - depth_from_m) * entries_per_m, entries - 1.0))
            entry += entries if value > 0 else 0.0
            entry += 2.0 * entries if dropout else 0.0
            entry_of[m] = entry if known | dropout else 3.0 * entries
            depth_of[m] = depth if known else np.nan


@kernel
def reduce_depths(
    samples: Float64Array, by: int, n: int, count: int, surface_from_m: float
) -> None:
    """Fold the depths of the n-th scan into gap, nearest surface and its rank.

    Every value is read whether it is used or not: a conditional load prevents vectorisation.
    """
    depth_of, gap_of, near_of, rank_of = samples[by], samples[GAP], samples[NEAR], samples[RANK]
    later, rank = n > 0, float(n)
    for m in range(count):
        depth, gap_before, before, rank_before = depth_of[m], gap_of[m], near_of[m], rank_of[m]
        gap = -depth if depth < surface_from_m else np.inf
        near = abs(depth) if depth >= surface_from_m else np.inf
        gap_of[m] = min(gap_before, gap) if later else gap
        near_of[m] = min(before, near) if later else near
        rank_of[m] = rank_before if later & (near >= before) else rank


@kernel
def accumulate(
    samples: Float64Array,
    places: Int32Array,
    n: int,
    count: int,
    table: Float64Array,
    weight: float,
) -> None:
    """Add the weighted log-odds of the n-th scan."""
    log_odds, entry = samples[LOG_ODDS], places[ENTRY]
    if n == 0:
        for m in range(count):
            log_odds[m] = weight * table[np.uint32(entry[m])]
        return
    for m in range(count):
        log_odds[m] += weight * table[np.uint32(entry[m])]


@kernel
def compute_heights(
    ground: Float32Array,
    sensor_position: Float64Array,
    first: Float64Array,
    second: Float64Array,
    batch: Batch,
) -> None:
    """Heights of the samples above the nearest scan's ground; `ground` holds all ground maps."""
    samples, places = batch.samples, batch.places
    offsets, chosen, count = batch.offsets, batch.chosen, len(first)
    per_m, half = 1.0 / CELL_M, 0.5 * CELLS * CELL_M + BORDER_M
    for i in range(count):
        begin, end = offsets[i, 0], offsets[i, 2]
        place, height = places[PLACE, begin:end], samples[HEIGHT, begin:end]
        a, b, sensor = first[i], second[i], sensor_position[chosen[i, 0]]
        x, y, z = a[0] - sensor[0], a[1] - sensor[1], a[2] - sensor[2]
        dx, dy, dz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
        t = batch.descriptors[chosen[i, 0]]
        u0 = t[LEVEL] * x + t[LEVEL + 1] * y + t[LEVEL + 2] * z + half
        v0 = t[LEVEL + 3] * x + t[LEVEL + 4] * y + t[LEVEL + 5] * z + half
        w0 = t[LEVEL + 6] * x + t[LEVEL + 7] * y + t[LEVEL + 8] * z
        du = t[LEVEL] * dx + t[LEVEL + 1] * dy + t[LEVEL + 2] * dz
        dv = t[LEVEL + 3] * dx + t[LEVEL + 4] * dy + t[LEVEL + 5] * dz
        dw = t[LEVEL + 6] * dx + t[LEVEL + 7] * dy + t[LEVEL + 8] * dz
        position = samples[POSITION, begin:end]
        before = float(chosen[i, 0]) * CELLS
        for m in range(padded_count(begin, end)):
            s = position[m]
            p = np.floor(clamped((u0 + s * du) * per_m, CELLS - 1.0))
            q = np.floor(clamped((v0 + s * dv) * per_m, CELLS - 1.0))
            place[m] = (before + p) * CELLS + q
            height[m] = w0 + s * dw
    place, height = places[PLACE], samples[HEIGHT]
    for m in range(offsets[count - 1, 2]):
        height[m] -= ground[np.uint32(place[m])]
