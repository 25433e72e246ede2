"""Kernels that draw a range image: sorting returns, beam spacing, rasterizing, quantizing."""

import numpy as np

from intervis.arrays import (
    BoolArray,
    Float32Array,
    Float64Array,
    Int16Array,
    Int32Array,
    IntArray,
    UInt32Array,
)
from intervis.kernels import kernel
from intervis.sight.kernels.projection import FULL_CIRCLE, ZENITH

MAX_JUMP, FLAT_M = 0.2, 0.25
"""Two returns lie on one surface if their planar ranges differ by less than this fraction, or their
heights by so little."""
MAX_GAP_SPACINGS = 2.6
"""A gap of more beam spacings than this holds no surface."""
MAX_DROPOUT = 0.2
"""A gap of more pseudo-elevation than this, 11 degrees at the horizon, is not bridged."""
AGREEMENT = 0.04
"""Neighbours agree if 1 / planar range differs by less than this fraction."""


@kernel
def sort_by_key(
    key: UInt32Array, order: IntArray | UInt32Array, count: int
) -> tuple[UInt32Array, UInt32Array]:
    """Stable counting sort: the order by ascending key, and the first position of each key."""
    start = np.zeros(count + 1, np.uint32)
    for i in order:
        start[key[i] + 1] += 1
    for k in range(count):
        start[k + 1] += start[k]
    place = start[:-1].copy()
    result = np.empty(len(order), np.uint32)
    for i in order:
        result[place[key[i]]] = i
        place[key[i]] += 1
    return result, start


@kernel
def sort_into_columns(
    azimuth: Float64Array, elevation: Float64Array, kept: IntArray, columns: int, bins: int
) -> tuple[UInt32Array, UInt32Array]:
    """Order of the returns `kept` by column and pseudo-elevation, and where each column begins.

    The pseudo-elevation counts in `bins` steps; equal returns stay in their order.
    """
    column, fine = np.empty(len(azimuth), np.uint32), np.empty(len(azimuth), np.uint32)
    columns_per_unit, bins_per_unit = columns / FULL_CIRCLE, bins / (2.0 * ZENITH)
    for i in range(len(azimuth)):
        column[i] = min(azimuth[i] * columns_per_unit, columns - 1.0)
        fine[i] = min((elevation[i] + ZENITH) * bins_per_unit, bins - 1.0)
    order, _ = sort_by_key(fine, kept, bins)
    return sort_by_key(column, order, columns)


@kernel
def beam_spacings(
    elevation: Float64Array, order: UInt32Array, start: UInt32Array, usual: float, bands: int
) -> Float64Array:
    """Median step in pseudo-elevation between neighbouring beams, by band from the lowest up.

    Two returns of one beam lie in a column a fraction of a beam apart: steps under a quarter of
    the usual one are ignored. A band with few returns takes the value of the nearest other band.
    """
    bins = 64
    least = 0.25 * usual
    count = np.zeros((bands, bins), np.int64)
    for c in range(len(start) - 1):
        low = np.inf
        for m in range(start[c], start[c + 1]):
            high = elevation[order[m]]
            step = high - low
            if least < step < 8.0 * usual:
                band = band_of(0.5 * (low + high), bands)
                count[band, int((step - least) / (7.75 * usual) * bins)] += 1
            low = high
    spacings = np.full(bands, -1.0)
    for band in range(bands):
        total = count[band].sum()
        if total < 100:
            continue
        below = 0
        for k in range(bins):
            below += count[band, k]
            if 2 * below >= total:
                spacings[band] = least + (k + 0.5) / bins * 7.75 * usual
                break
    filled = np.full(bands, usual)
    for band in range(bands):
        nearest = bands
        for other in range(bands):
            if spacings[other] > 0.0 and abs(other - band) < nearest:
                nearest = abs(other - band)
                filled[band] = spacings[other]
    return filled


@kernel
def band_of(elevation: float, bands: int) -> int:
    """The band of a pseudo-elevation, of `bands` equal ones from straight down to straight up."""
    return min(int((elevation + ZENITH) / (2.0 * ZENITH) * bands), bands - 1)


@kernel
def rasterize(
    planar_range: Float64Array,
    elevation: Float64Array,
    height: Float64Array,
    order: UInt32Array,
    start: UInt32Array,
    spacings: Float64Array,
    lowest: float,
    step: float,
    first_column: int,
    image: Float32Array,
) -> None:
    """Fill columns of an empty image with the polylines of their returns in (e, 1 / planar range).

    `order` lists the returns by column and pseudo-elevation e, those of column c from `start[c]`
    on. `height` is measured along gravity. Row k of the image lies at e = lowest + k step, its
    first column is `first_column`, which may be negative: columns are cyclic.
    """
    rows, bands, columns = image.shape[1], len(spacings), len(start) - 1
    for n in range(len(image)):
        c = (first_column + n) % columns
        # Of the return below: e, planar range, height, spacing, row, first row of its own range.
        u, q, height_u, spacing_u, row_u, first = -np.inf, 1.0, 0.0, 0.0, 0, 0
        for m in range(int(start[c]), int(start[c + 1])):
            i = order[m]
            t, r, height_t = elevation[i], planar_range[i], height[i]
            spacing = spacings[band_of(t, bands)]
            row = _row(t, lowest, step, rows)
            near = t - u < MAX_GAP_SPACINGS * spacing
            surface = near and (
                abs(r - q) < MAX_JUMP * min(r, q) or abs(height_t - height_u) < FLAT_M
            )
            last = 0.5 * (t + u) if t - u < MAX_GAP_SPACINGS * spacing_u else u + 0.6 * spacing_u
            stop = _row(last, lowest, step, rows)
            # A surface covers all rows from the return below on.
            for k in range(first, min(stop, row_u) if surface else stop):
                image[n, k] = q
            if surface:
                first = row
                for k in range(row_u, row):
                    f = (lowest + k * step - u) / (t - u)
                    image[n, k] = 1.0 / ((1.0 - f) / q + f / r)
            else:
                first = _row(0.5 * (t + u) if near else t - 0.6 * spacing, lowest, step, rows)
            u, q, height_u, spacing_u, row_u = t, r, height_t, spacing, row
        for k in range(first, _row(u + 0.6 * spacing_u, lowest, step, rows)):
            image[n, k] = q


@kernel
def _row(elevation: float, lowest: float, step: float, rows: int) -> int:
    """First row at or above a pseudo-elevation."""
    return int(min(max(np.ceil((elevation - lowest) / step), 0.0), float(rows)))


@kernel
def quantize(image: Float32Array, far: int, units_per_m: float, pixels: Int16Array) -> None:
    """Store planar ranges in units; even, negative where fewer than three of four neighbours agree.

    The neighbours above and below are `far` rows away, one beam, and may differ twice as much. If
    both were not observed (a single ring), they count as one that agrees. A column that its beam
    missed takes the nearer range of its neighbours, and the next column is its neighbour's.

    The image has a border of two columns and of `far` rows around the pixels.
    """
    columns, rows = pixels.shape
    for c in range(columns):
        below, here, above = image[c + 2], image[c + 2, far:], image[c + 2, 2 * far :]
        left_but_one, left = image[c, far:], image[c + 1, far:]
        right, right_but_one = image[c + 3, far:], image[c + 4, far:]
        units = pixels[c]
        for k in range(rows):
            units[k] = np.int32(
                _signed_units(
                    here[k],
                    left[k],
                    left_but_one[k],
                    right[k],
                    right_but_one[k],
                    below[k],
                    above[k],
                    units_per_m,
                )
            )


@kernel
def _signed_units(
    range_m: float,
    left: float,
    left_but_one: float,
    right: float,
    right_but_one: float,
    below: float,
    above: float,
    units_per_m: float,
) -> float:
    """One pixel of `quantize`, without a branch. An unobserved neighbour, 0, agrees with none."""
    # azimuths jitter: a beam may miss a column between two that it hits
    nearer = min(left, right)
    r = nearer if range_m == 0.0 else range_m
    at_left = left if left > 0.0 else left_but_one
    at_right = right if right > 0.0 else right_but_one
    agree = 1.0 if (below == 0.0) & (above == 0.0) else 0.0
    agree += 1.0 if abs(r - at_left) < AGREEMENT * at_left else 0.0
    agree += 1.0 if abs(r - at_right) < AGREEMENT * at_right else 0.0
    agree += 1.0 if abs(r - below) < 2.0 * AGREEMENT * below else 0.0
    agree += 1.0 if abs(r - above) < 2.0 * AGREEMENT * above else 0.0
    units = r * units_per_m
    even = 2.0 * max(np.floor(0.5 * units), 1.0)
    units = max(units, 1.0) if agree >= 3.0 else -even
    return units if r > 0.0 else 0.0


@kernel
def count_observed(pixels: Int16Array, observed: Int32Array) -> None:
    """Add to `observed` (R,) the number of pixels (C, R) of each row that hold a range."""
    for c in range(len(pixels)):
        units = pixels[c]
        for k in range(len(observed)):
            observed[k] += units[k] != 0


@kernel
def bridge_dropouts(pixels: Int16Array, is_scanned: BoolArray, most_rows: int) -> None:
    """Mark beams without a return between two returns of one surface; see `pixel`.

    A gap in a column is bridged if it has at most `most_rows` rows and if the ranges below and
    above it lie on one surface (`MAX_JUMP`). Only rows (R,) that beams scan take part.
    """
    rows = pixels.shape[1]
    for c in range(len(pixels)):
        units, below = pixels[c], -1
        for k in range(rows):
            if units[k] == 0:
                continue
            if below >= 0 and 1 < k - below <= most_rows:
                low, high = abs(float(units[below])), abs(float(units[k]))
                if abs(low - high) < MAX_JUMP * min(low, high):
                    for m in range(below + 1, k):
                        f = (m - below) / (k - below)
                        if is_scanned[m]:
                            units[m] = -(int(1.0 / ((1.0 - f) / low + f / high)) | 1)
            below = k
