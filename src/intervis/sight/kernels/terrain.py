"""Kernels of the ground map: lowest returns per cell, outliers, slope filter, interpolation."""

import numpy as np

from intervis.arrays import BoolArray, Float32Array, Float64Array, IntArray
from intervis.kernels import kernel

CELL_M = 1.0
CELLS = 128
"""The map has CELLS x CELLS square cells around the sensor."""
BORDER_M = 1e-7
"""A point on the border of two cells, give or take rounding, belongs to the upper one."""
MAX_RISE = 0.15
"""Slope above which a rise is an object on the ground, not ground."""
MAX_GAP_CELLS = 8
"""The ground is interpolated between cells with returns that are at most so many cells apart."""
CELLS_IN_FRONT = 6
"""A cell is compared with so many cells between it and the sensor."""
OUTLIER_M = 0.35
ASSUMED_OFFSET_M = 1000.0
"""Where the ground was not observed, a map holds the height of the nearest cell that has some,
minus this. Heights above such ground come out greater by it, so that no rule on heights applies to
them; only the prior reads them (`occupancy_model`)."""


@kernel
def lowest_returns(level: Float64Array, kept: IntArray, least: Float32Array) -> None:
    """Third lowest height of each cell's returns `kept`; infinite with fewer than four.

    `level` (3, N) holds x, y and z of all returns.
    """
    x, y, z = level[0], level[1], level[2]
    half = 0.5 * CELLS * CELL_M
    lows = np.full((CELLS * CELLS, 4), np.inf, np.float32)
    for i in kept:
        a = int((x[i] + half) / CELL_M)
        b = int((y[i] + half) / CELL_M)
        if not (0 <= a < CELLS and 0 <= b < CELLS):
            continue
        low, height = lows[a * CELLS + b], np.float32(z[i])
        # Without a branch: whether a height is among the lowest cannot be predicted.
        low[3] = min(low[3], max(low[2], height))
        low[2] = min(low[2], max(low[1], height))
        low[1] = min(low[1], max(low[0], height))
        low[0] = min(low[0], height)
    for a in range(CELLS):
        for b in range(CELLS):
            cell = a * CELLS + b
            least[a, b] = lows[cell, 2] if np.isfinite(lows[cell, 3]) else np.inf


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
def remove_below_nearer(height: Float32Array) -> None:
    """Drop cells that the sensor sees through the ground: multipath returns below the road.

    The line from the sensor to such a cell passes below most of the known cells just in front of
    it. The line to a falling road or to the foot of a wall passes above them.
    """
    middle = CELLS // 2
    seen = height.copy()
    for a in range(CELLS):
        for b in range(CELLS):
            z = seen[a, b]
            away = np.sqrt(float((a - middle) ** 2 + (b - middle) ** 2))
            if not np.isfinite(z) or away < 2.0:
                continue
            above, known = 0, 0
            for n in range(1, min(CELLS_IN_FRONT, int(away)) + 1):
                f = 1.0 - n / away
                p = middle + int(np.floor((a - middle) * f + 0.5))
                q = middle + int(np.floor((b - middle) * f + 0.5))
                if np.isfinite(seen[p, q]):
                    known += 1
                    above += 1 if seen[p, q] > f * z + OUTLIER_M else 0
            if known > 0 and 2 * above >= known:
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
def interpolate(height: Float32Array, known: BoolArray) -> None:
    """Fill cells without returns between two cells that have some, along x or else along y.

    The two are at most `MAX_GAP_CELLS` apart. All other cells become NaN: the ground there was not
    observed. So do the cells of the border, whose values apply beyond the map.
    """
    filled = np.full((CELLS, CELLS), np.nan, np.float32)
    for axis in range(2):
        for row in range(1, CELLS - 1):
            last = -1
            for at in range(1, CELLS - 1):
                a, b = (at, row) if axis == 0 else (row, at)
                if not known[a, b]:
                    continue
                filled[a, b] = height[a, b]
                if last >= 0 and 1 < at - last <= MAX_GAP_CELLS:
                    before = height[last, row] if axis == 0 else height[row, last]
                    for k in range(last + 1, at):
                        f = np.float32((k - last) / (at - last))
                        p, q = (k, row) if axis == 0 else (row, k)
                        if np.isnan(filled[p, q]):
                            filled[p, q] = before + f * (height[a, b] - before)
                last = at
    height[:] = filled


@kernel
def assume_ground(height: Float32Array) -> None:
    """Fill the NaN cells with the value of the nearest known cell, minus `ASSUMED_OFFSET_M`.

    The nearest by steps to one of eight neighbours, two passes over the map; if several are equally
    near, the first one found.
    """
    steps = np.where(np.isnan(height), 4 * CELLS, 0)
    for way in range(2):
        turn = 1 if way == 0 else -1
        for m in range(CELLS):
            a = m if way == 0 else CELLS - 1 - m
            for n in range(CELLS):
                b = n if way == 0 else CELLS - 1 - n
                for da, db in ((-turn, -turn), (-turn, 0), (-turn, turn), (0, -turn)):
                    p, q = a + da, b + db
                    inside = 0 <= p < CELLS and 0 <= q < CELLS
                    if inside and steps[p, q] + 1 < steps[a, b]:
                        steps[a, b] = steps[p, q] + 1
                        height[a, b] = height[p, q]
    for a in range(CELLS):
        for b in range(CELLS):
            if steps[a, b] > 0:
                height[a, b] -= ASSUMED_OFFSET_M
