"""Kernels of the ground map: lowest returns per cell, outliers, slope filter, extrapolation."""

import numpy as np

from intervis.arrays import BoolArray, Float32Array, Float64Array
from intervis.kernels import kernel

CELL_M = 1.0
CELLS = 128
"""The map has CELLS x CELLS square cells around the sensor. Beyond, its border value applies."""
MAX_RISE = 0.15
"""Slope above which a rise is an object on the ground, not ground."""
MAX_DESCENT = 0.08
"""Slope below which the ground does not fall away from the sensor: deeper returns are multipath."""
OUTLIER_M = 0.35
NEAR_SENSOR_M = 12.0
"""The ground height at the sensor is the median over cells closer than this."""


@kernel
def lowest_returns(xyz: Float64Array, least: Float32Array) -> None:
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
def remove_outliers(least: Float32Array, kept: Float32Array) -> None:
    """Drop cells well below most of their neighbours: multipath returns below the road."""
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
                if around[k] < z + OUTLIER_M:
                    below += 1
            if n < 3 or below * 4 < n:
                kept[a, b] = np.inf


@kernel
def remove_too_low(height: Float32Array) -> None:
    """Drop cells below the steepest descent from the ground around the sensor."""
    around = np.empty(CELLS * CELLS, np.float32)
    n = 0
    middle = CELLS // 2
    reach = int(NEAR_SENSOR_M / CELL_M)
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
            if height[a, b] < base - OUTLIER_M - MAX_DESCENT * away:
                height[a, b] = np.inf


@kernel
def slope_filter(height: Float32Array) -> None:
    """Lower each known cell to the cone of slope `MAX_RISE` above every other known cell."""
    rise = np.float32(MAX_RISE * CELL_M)
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
def extrapolate(height: Float32Array, known: BoolArray) -> None:
    """Give each cell without returns the height of the nearest cell that has some."""
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
