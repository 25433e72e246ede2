"""The ground around a sensor: how high above it a point of space is.

Traffic, people and parked cars fill the lowest two metres; whether unseen space is likely to hold
something depends on the height above the ground first of all.
"""

import numpy as np

from intervis.arrays import BoolArray, Float32Array, Float64Array
from intervis.kernels import kernel

CELL_M = 1.0
CELLS = 128
"""The ground is known on CELLS x CELLS squares around the sensor; beyond, its rim carries on."""
STEEPEST_GROUND = 0.15
"""Ground rises by no more than this slope: what rises faster stands on the ground."""
DESCENT = 0.08
"""Ground falls away from the sensor by no more than this slope; deeper returns are reflections."""
_STRAY_M = 0.35
_USUAL_MOUNT_M = 1.7


@kernel
def _lowest(xyz: Float64Array, least: Float32Array) -> None:
    """Third lowest height of each cell's returns; infinite with fewer than four."""
    half = 0.5 * CELLS * CELL_M
    lows = np.full((CELLS, CELLS, 3), np.inf, np.float32)
    count = np.zeros((CELLS, CELLS), np.int64)
    for i in range(len(xyz)):
        a = int((xyz[i, 0] + half) / CELL_M)
        b = int((xyz[i, 1] + half) / CELL_M)
        if not (0 <= a < CELLS and 0 <= b < CELLS):
            continue
        count[a, b] += 1
        z = xyz[i, 2]
        low = lows[a, b]
        if z < low[0]:
            low[0], low[1], low[2] = z, low[0], low[1]
        elif z < low[1]:
            low[1], low[2] = z, low[1]
        elif z < low[2]:
            low[2] = z
    for a in range(CELLS):
        for b in range(CELLS):
            least[a, b] = lows[a, b, 2] if count[a, b] > 3 else np.inf


@kernel
def _without_strays(least: Float32Array, kept: Float32Array) -> None:
    """Drop cells well below most of their neighbours: reflections from under the road."""
    around = np.empty(25, np.float32)
    for a in range(CELLS):
        for b in range(CELLS):
            z = least[a, b]
            kept[a, b] = z
            if not np.isfinite(z):
                continue
            n = 0
            for p in range(max(a - 2, 0), min(a + 3, CELLS)):
                for q in range(max(b - 2, 0), min(b + 3, CELLS)):
                    if np.isfinite(least[p, q]):
                        around[n] = least[p, q]
                        n += 1
            below = 0
            for k in range(n):
                if around[k] < z + _STRAY_M:
                    below += 1
            if n < 3 or below * 4 < n:
                kept[a, b] = np.inf


@kernel
def _without_depths(height: Float32Array) -> None:
    """Drop cells that lie deeper than any road descends from the ground around the sensor."""
    around = np.empty(CELLS * CELLS, np.float32)
    n = 0
    middle = CELLS // 2
    reach = int(12.0 / CELL_M)
    for a in range(middle - reach, middle + reach):
        for b in range(middle - reach, middle + reach):
            if np.isfinite(height[a, b]):
                around[n] = height[a, b]
                n += 1
    if n == 0:
        return
    base = np.median(around[:n])
    for a in range(CELLS):
        for b in range(CELLS):
            away = CELL_M * np.sqrt(float((a - middle) ** 2 + (b - middle) ** 2))
            if height[a, b] < base - _STRAY_M - DESCENT * away:
                height[a, b] = np.inf


@kernel
def _under_cones(height: Float32Array) -> None:
    """Lower each known cell to what the others allow by the steepest slope."""
    rise = np.float32(STEEPEST_GROUND * CELL_M)
    for _ in range(2):
        for a in range(CELLS):
            for b in range(CELLS):
                if a > 0:
                    height[a, b] = min(height[a, b], height[a - 1, b] + rise)
                if b > 0:
                    height[a, b] = min(height[a, b], height[a, b - 1] + rise)
        for a in range(CELLS - 1, -1, -1):
            for b in range(CELLS - 1, -1, -1):
                if a < CELLS - 1:
                    height[a, b] = min(height[a, b], height[a + 1, b] + rise)
                if b < CELLS - 1:
                    height[a, b] = min(height[a, b], height[a, b + 1] + rise)


@kernel
def _carry_on(height: Float32Array, known: BoolArray) -> None:
    """Give each cell without returns the height of the nearest one that has some."""
    away = np.full((CELLS, CELLS), 4 * CELLS, np.int64)
    for a in range(CELLS):
        for b in range(CELLS):
            if known[a, b]:
                away[a, b] = 0
            if a > 0 and away[a - 1, b] + 1 < away[a, b]:
                away[a, b], height[a, b] = away[a - 1, b] + 1, height[a - 1, b]
            if b > 0 and away[a, b - 1] + 1 < away[a, b]:
                away[a, b], height[a, b] = away[a, b - 1] + 1, height[a, b - 1]
    for a in range(CELLS - 1, -1, -1):
        for b in range(CELLS - 1, -1, -1):
            if a < CELLS - 1 and away[a + 1, b] + 1 < away[a, b]:
                away[a, b], height[a, b] = away[a + 1, b] + 1, height[a + 1, b]
            if b < CELLS - 1 and away[a, b + 1] + 1 < away[a, b]:
                away[a, b], height[a, b] = away[a, b + 1] + 1, height[a, b + 1]


def ground_below(points_velo: Float64Array) -> Float32Array:
    """Height of the ground around the sensor.

    Parameters
    ----------
    points_velo : (N, 3) float64 array
        A scan in its sensor's frame, metres, z up.

    Returns
    -------
    (CELLS, CELLS) float32 array
        Metres in the sensor's frame; row a is x from (a - CELLS / 2) CELL_M, column b is y
        likewise. 1.7 m below the sensor everywhere where the scan shows no ground.

    Examples
    --------
    >>> x, y = np.meshgrid(np.arange(-9, 9, 0.2), np.arange(-9, 9, 0.2))
    >>> flat = np.stack([x.ravel(), y.ravel(), np.full(x.size, -2.0)], axis=1)
    >>> float(ground_below(flat)[64, 64])
    -2.0
    """
    least = np.empty((CELLS, CELLS), np.float32)
    kept = np.empty((CELLS, CELLS), np.float32)
    _lowest(points_velo, least)
    _without_strays(least, kept)
    _without_depths(kept)
    if not np.isfinite(kept).any():
        kept[:] = -_USUAL_MOUNT_M
        return kept
    known = np.isfinite(kept)
    _under_cones(kept)
    _carry_on(kept, known)
    return kept
