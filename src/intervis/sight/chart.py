"""The chart of a scan: one surface range for each direction around the sensor.

A LiDAR scan is a height field over the sphere. Its chart is an image: columns are azimuth, rows
are the slope t = z / rho (rho the horizontal range, so that a plane's 1/rho is linear in t within
a column: interpolating 1/rho between two beams is exact on walls and on the ground). A cell holds

    > 0    the surface's rho, and its neighbours agree with it: a solid surface,
    < 0    minus that rho where the neighbours disagree: leaves, wires, edges, lone returns, ground
           at a grazing angle, where one beam lies much farther than the next,
    0      nothing: no beam went there, or none came back. Never "free".

Between two beams of a column the surface is carried on where their ranges are those of one
surface; where they jump, each return keeps the half of the gap next to it. A return at the rim of
a gap keeps half a beam spacing around itself, no more.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from intervis.arrays import Float32Array, Float64Array, FloatArray, IntArray
from intervis.kernels import kernel
from intervis.sight.ground import ground_below
from intervis.sight.sensor import Sensor

COLUMN_SHARE = 2.0
"""Columns are this many azimuth steps wide, so that each beam has a return in each."""
ROWS_PER_BEAM = 3.0
"""Rows in one spacing of the densest beams."""
STEEPEST = 2.0
"""Slopes beyond +-2 (63 degrees) are off the chart."""
JUMP_SHARE, FLAT_M = 0.2, 0.25
"""Two returns lie on one surface when rho differs by less than this share, or z by so little."""
GAP_SHARE = 2.6
"""A gap wider than this many beam spacings holds no surface."""
AGREE_SHARE = 0.04
"""Neighbours agree when their 1/rho differs by less than this share."""
Int16Array = NDArray[np.int16]
_MOST_UNITS = 32767.0
_BANDS = 40
_FINE = 16384
_MOST_ROWS = 512
TURN = 8.0
"""`turn_of` a full circle."""


@dataclass(frozen=True, eq=False)
class Chart:
    """Surface range over azimuth and slope.

    Attributes
    ----------
    cells : (C, R) int16 array
        Signed horizontal range of the surface in units: see the module's text. Column after
        column, so that the rows that a sight line climbs lie side by side.
    unit_m : float
        Metres in a unit: the range divided by 32767, millimetres.
    slope_from, slope_step : float
        Row r lies at the slope z / rho = slope_from + r slope_step.
    ground_m : (G, G) float32 array
        Height of the ground below the sensor's surroundings, metres in the sensor's frame, on
        cells of `intervis.sight.ground.CELL_M`.
    returns : int
        How many returns it was made of.
    """

    cells: Int16Array
    unit_m: float
    slope_from: float
    slope_step: float
    ground_m: Float32Array
    returns: int


@kernel
def turn_of(x: float, y: float) -> float:
    """Azimuth as a number from 0 (x axis) to 8, by octants: monotone and cheap.

    Within an octant it follows the angle to 0.1 degrees. Charts are built and read with the same
    function, so its unevenness only makes some columns a few percent wider than others.
    """
    ax = abs(x)
    ay = abs(y)
    most = max(ax, ay)
    m = min(ax, ay) / (most if most > 0.0 else 1.0)
    u = m * (1.3147 - m * (0.2343 + 0.0804 * m))
    u = u if ay <= ax else 2.0 - u
    u = u if x >= 0.0 else 4.0 - u
    return u if y >= 0.0 else 8.0 - u


@kernel
def _polar(xyz: Float64Array, turn: Float64Array, rho: Float64Array, slope: Float64Array) -> None:
    for i in range(len(xyz)):
        x, y, z = xyz[i, 0], xyz[i, 1], xyz[i, 2]
        rho[i] = np.sqrt(x * x + y * y)
        slope[i] = z / rho[i]
        turn[i] = turn_of(x, y)


@kernel
def _sorted_by(key: IntArray, order: IntArray, count: int) -> tuple[IntArray, IntArray]:
    """Stable counting sort: the order by ascending key, and where each key starts."""
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
def _beam_gaps(
    slope: Float64Array, order: IntArray, start: IntArray, usual: float, bands: int
) -> Float64Array:
    """Median slope gap between neighbouring beams, by band of slope from -STEEPEST up.

    Two returns of one beam lie in a column a fraction of a beam apart: gaps under a quarter of
    the usual one are those. A band with few returns takes the value of the nearest other one.
    """
    bins = 64
    least = 0.25 * usual
    count = np.zeros((bands, bins), np.int64)
    for c in range(len(start) - 1):
        for m in range(start[c] + 1, start[c + 1]):
            low, high = slope[order[m - 1]], slope[order[m]]
            gap = high - low
            if least < gap < 8.0 * usual:
                band = int((0.5 * (low + high) + STEEPEST) / (2.0 * STEEPEST) * bands)
                count[band, int((gap - least) / (7.75 * usual) * bins)] += 1
    gaps = np.full(bands, -1.0)
    for band in range(bands):
        total = count[band].sum()
        if total < 100:
            continue
        seen = 0
        for k in range(bins):
            seen += count[band, k]
            if 2 * seen >= total:
                gaps[band] = least + (k + 0.5) / bins * 7.75 * usual
                break
    filled = np.full(bands, usual)
    for band in range(bands):
        best = bands
        for other in range(bands):
            if gaps[other] > 0.0 and abs(other - band) < best:
                best = abs(other - band)
                filled[band] = gaps[other]
    return filled


@kernel
def _draw(
    rho: Float64Array,
    slope: Float64Array,
    order: IntArray,
    start: IntArray,
    gaps: Float64Array,
    slope_from: float,
    slope_step: float,
    image: Float32Array,
) -> None:
    """Fill each column of the image with the polyline of its returns in (t, 1 / rho)."""
    columns, rows = image.shape
    bands = len(gaps)
    for c in range(columns):
        for m in range(start[c], start[c + 1]):
            i = order[m]
            t, r = slope[i], rho[i]
            gap = gaps[min(int((t + STEEPEST) / (2.0 * STEEPEST) * bands), bands - 1)]
            first = t - 0.6 * gap
            last = t + 0.6 * gap
            if m > start[c] and t - slope[order[m - 1]] < GAP_SHARE * gap:
                j = order[m - 1]
                u, q = slope[j], rho[j]
                first = 0.5 * (t + u)
                if abs(r - q) < JUMP_SHARE * min(r, q) or abs(t * r - u * q) < FLAT_M:
                    first = t
                    for k in range(
                        _row(u, slope_from, slope_step, rows), _row(t, slope_from, slope_step, rows)
                    ):
                        f = (slope_from + k * slope_step - u) / (t - u)
                        image[c, k] = 1.0 / ((1.0 - f) / q + f / r)
            if m + 1 < start[c + 1] and slope[order[m + 1]] - t < GAP_SHARE * gap:
                last = 0.5 * (t + slope[order[m + 1]])
            for k in range(
                _row(first, slope_from, slope_step, rows), _row(last, slope_from, slope_step, rows)
            ):
                image[c, k] = r


@kernel
def _row(slope: float, slope_from: float, slope_step: float, rows: int) -> int:
    """First row at or above a slope."""
    return int(min(max(np.ceil((slope - slope_from) / slope_step), 0.0), float(rows)))


@kernel
def _store(image: Float32Array, far: int, units_per_m: float, cells: Int16Array) -> None:
    """Store rho in units, negative where fewer than three of four neighbours agree in 1 / rho.

    The neighbours above and below are `far` rows away, one beam, and may differ twice as much.
    """
    columns, rows = image.shape
    for c in range(columns):
        left = image[c - 1]
        right = image[c + 1 if c + 1 < columns else 0]
        here = image[c]
        for k in range(rows):
            r = here[k]
            cells[c, k] = 0
            if r == 0.0:
                continue
            agree = 0
            if left[k] > 0.0 and abs(r - left[k]) < AGREE_SHARE * left[k]:
                agree += 1
            if right[k] > 0.0 and abs(r - right[k]) < AGREE_SHARE * right[k]:
                agree += 1
            if k >= far and abs(r - here[k - far]) < 2.0 * AGREE_SHARE * here[k - far]:
                agree += 1
            if k + far < rows and abs(r - here[k + far]) < 2.0 * AGREE_SHARE * here[k + far]:
                agree += 1
            units = max(r * units_per_m, 1.0)
            cells[c, k] = units if agree >= 3 else -units


def chart_of(points_velo: FloatArray, sensor: Sensor) -> Chart:
    """The chart of one scan.

    Parameters
    ----------
    points_velo : (N, 3) float array
        Finite points in the sensor's frame, metres. Returns nearer than the sensor's least range
        or farther than its range, and those steeper than 63 degrees, are left out.
    sensor : Sensor

    Returns
    -------
    Chart
        With `returns == 0` and an empty image where no point is left.

    Examples
    --------
    >>> from intervis.sight.sensor import GENERIC
    >>> azimuth = np.radians(np.arange(0, 360, 0.2))
    >>> ring = np.c_[10 * np.cos(azimuth), 10 * np.sin(azimuth), np.zeros(len(azimuth))]
    >>> chart = chart_of(ring, GENERIC)
    >>> round(float(chart.unit_m * np.abs(chart.cells).max()), 2)
    10.0
    """
    xyz = np.ascontiguousarray(points_velo[:, :3], dtype=np.float64)
    turn, rho, slope = np.empty(len(xyz)), np.empty(len(xyz)), np.empty(len(xyz))
    with np.errstate(divide="ignore", invalid="ignore"):
        _polar(xyz, turn, rho, slope)
    kept = np.flatnonzero(
        (rho >= max(sensor.least_range_m, 1e-3))
        & (rho <= sensor.range_m)
        & (np.abs(slope) < STEEPEST)
    )
    columns = max(8, round(360.0 / (COLUMN_SHARE * sensor.azimuth_step_deg)))
    usual = np.tan(np.radians(sensor.beam_spacing_deg))
    if len(kept) == 0:
        empty = np.zeros((columns, 2), np.int16)
        return Chart(empty, 1.0, 0.0, float(usual), ground_below(xyz[:0]), 0)

    column, fine = np.zeros(len(xyz), np.int64), np.zeros(len(xyz), np.int64)
    column[kept] = np.minimum(turn[kept] * (columns / TURN), columns - 1)
    fine[kept] = (slope[kept] + STEEPEST) * (_FINE / (2.0 * STEEPEST))
    order, _ = _sorted_by(fine, kept, _FINE)
    order, start = _sorted_by(column, order, columns)
    gaps = _beam_gaps(slope, order, start, usual, _BANDS)

    low, high = slope[order].min(), slope[order].max()
    step = max(gaps.min() / ROWS_PER_BEAM, (high - low) / _MOST_ROWS)
    slope_from = low - 2.0 * gaps.max()
    rows = int((high + 2.0 * gaps.max() - slope_from) / step) + 2
    image = np.zeros((columns, rows), np.float32)
    _draw(rho, slope, order, start, gaps, slope_from, step, image)
    unit_m = float(rho[order].max()) / _MOST_UNITS
    cells = np.empty((columns, rows), np.int16)
    _store(image, round(ROWS_PER_BEAM), 1.0 / unit_m, cells)
    ground_m = ground_below(xyz[kept])
    return Chart(cells, unit_m, float(slope_from), float(step), ground_m, len(kept))
