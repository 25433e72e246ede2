"""Kernels that draw a range image: sorting returns, beam spacing, rasterizing, quantizing."""

import numpy as np

from intervis.arrays import Float32Array, Float64Array, Int16Array, IntArray
from intervis.kernels import kernel
from intervis.sight.kernels.projection import ZENITH

MAX_JUMP, FLAT_M = 0.2, 0.25
"""Two returns lie on one surface if their planar ranges differ by less than this fraction, or their
heights by so little."""
MAX_GAP_SPACINGS = 2.6
"""A gap of more beam spacings than this holds no surface."""
AGREEMENT = 0.04
"""Neighbours agree if 1 / planar range differs by less than this fraction."""


@kernel
def sort_by_key(key: IntArray, order: IntArray, count: int) -> tuple[IntArray, IntArray]:
    """Stable counting sort: the order by ascending key, and the first position of each key."""
    start = np.zeros(count + 1, np.int64)
    for i in order:
        start[key[i] + 1] += 1
    for k in range(count):
        start[k + 1] += start[k]
    place = start[:-1].copy()
    result = np.empty(len(order), np.int64)
    for i in order:
        result[place[key[i]]] = i
        place[key[i]] += 1
    return result, start


@kernel
def beam_spacings(
    elevation: Float64Array, order: IntArray, start: IntArray, usual: float, bands: int
) -> Float64Array:
    """Median step in pseudo-elevation between neighbouring beams, by band from the lowest up.

    Two returns of one beam lie in a column a fraction of a beam apart: steps under a quarter of
    the usual one are ignored. A band with few returns takes the value of the nearest other band.
    """
    bins = 64
    least = 0.25 * usual
    count = np.zeros((bands, bins), np.int64)
    for c in range(len(start) - 1):
        for m in range(start[c] + 1, start[c + 1]):
            low, high = elevation[order[m - 1]], elevation[order[m]]
            step = high - low
            if least < step < 8.0 * usual:
                band = band_of(0.5 * (low + high), bands)
                count[band, int((step - least) / (7.75 * usual) * bins)] += 1
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
    order: IntArray,
    start: IntArray,
    spacings: Float64Array,
    lowest: float,
    step: float,
    image: Float32Array,
) -> None:
    """Fill each column of the image with the polyline of its returns in (e, 1 / planar range).

    `order` lists the returns by column and pseudo-elevation e, those of column c from `start[c]`
    on. `height` is measured along gravity. Row k of the image lies at e = lowest + k step.
    """
    columns, rows = image.shape
    bands = len(spacings)
    for c in range(columns):
        for m in range(start[c], start[c + 1]):
            i = order[m]
            t, r = elevation[i], planar_range[i]
            spacing = spacings[band_of(t, bands)]
            first = t - 0.6 * spacing
            last = t + 0.6 * spacing
            if m > start[c] and t - elevation[order[m - 1]] < MAX_GAP_SPACINGS * spacing:
                j = order[m - 1]
                u, q = elevation[j], planar_range[j]
                first = 0.5 * (t + u)
                if abs(r - q) < MAX_JUMP * min(r, q) or abs(height[i] - height[j]) < FLAT_M:
                    first = t
                    for k in range(_row(u, lowest, step, rows), _row(t, lowest, step, rows)):
                        f = (lowest + k * step - u) / (t - u)
                        image[c, k] = 1.0 / ((1.0 - f) / q + f / r)
            if m + 1 < start[c + 1]:
                u = elevation[order[m + 1]]
                last = 0.5 * (t + u) if u - t < MAX_GAP_SPACINGS * spacing else last
            for k in range(_row(first, lowest, step, rows), _row(last, lowest, step, rows)):
                image[c, k] = r


@kernel
def _row(elevation: float, lowest: float, step: float, rows: int) -> int:
    """First row at or above a pseudo-elevation."""
    return int(min(max(np.ceil((elevation - lowest) / step), 0.0), float(rows)))


@kernel
def quantize(image: Float32Array, far: int, units_per_m: float, pixels: Int16Array) -> None:
    """Store planar ranges in units, negative where fewer than three of four neighbours agree.

    The neighbours above and below are `far` rows away, one beam, and may differ twice as much. If
    both were not observed (a single ring), they count as one that agrees. A column that its beam
    missed takes the nearer range of its neighbours, and the next column is its neighbour's.
    """
    columns, rows = image.shape
    for c in range(columns):
        left, left_but_one = image[c - 1], image[c - 2]
        right, right_but_one = image[(c + 1) % columns], image[(c + 2) % columns]
        here = image[c]
        for k in range(rows):
            r = here[k]
            pixels[c, k] = 0
            if r == 0.0:  # azimuths jitter: a beam may miss a column between two that it hits
                if left[k] == 0.0 or right[k] == 0.0:
                    continue
                r = min(left[k], right[k])
            at_left = left[k] if left[k] > 0.0 else left_but_one[k]
            at_right = right[k] if right[k] > 0.0 else right_but_one[k]
            agree = 0
            if at_left > 0.0 and abs(r - at_left) < AGREEMENT * at_left:
                agree += 1
            if at_right > 0.0 and abs(r - at_right) < AGREEMENT * at_right:
                agree += 1
            below = here[k - far] if k >= far else np.float32(0.0)
            above = here[k + far] if k + far < rows else np.float32(0.0)
            if below == 0.0 and above == 0.0:
                agree += 1
            if below > 0.0 and abs(r - below) < 2.0 * AGREEMENT * below:
                agree += 1
            if above > 0.0 and abs(r - above) < 2.0 * AGREEMENT * above:
                agree += 1
            units = max(r * units_per_m, 1.0)
            pixels[c, k] = units if agree >= 3 else -units
