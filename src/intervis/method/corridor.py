"""Corridors around sight lines: every point held against every line, for global points."""

import numpy as np

from intervis.arrays import Float32Array, Float64Array, IntArray
from intervis.kernels import in_parts, kernel

TILE = 4096
"""Raw points held against a part of the lines at once: 48 KiB, which stay in a near cache."""


def obstacles_among_all(offset: Float64Array, corridor_m: float, gap_m: float) -> IntArray:
    """(V,) how many of the V points stand over the sight line to each of them."""
    x, y, z = (np.ascontiguousarray(column, dtype=np.float32) for column in offset.T)
    reach = np.hypot(offset[:, 0], offset[:, 1])
    over_0 = np.divide(1.0, reach, out=np.zeros_like(reach), where=reach > 0)
    ux, uy, slope = ((offset[:, k] * over_0).astype(np.float32) for k in range(3))
    # A touch shorter than the line: in single precision no target stands over its own line.
    judged = (reach * (1.0 - 1e-6) - gap_m).astype(np.float32)
    obstacles = np.zeros(len(offset), np.int64)
    half_width = np.float32(corridor_m)

    def work(start: int, stop: int) -> None:
        _count_over(x, y, z, ux, uy, slope, judged, half_width, start, stop, obstacles)

    in_parts(work, len(offset), least=256)
    return obstacles


@kernel
def _count_over(
    x: Float32Array,
    y: Float32Array,
    z: Float32Array,
    ux: Float32Array,
    uy: Float32Array,
    slope: Float32Array,
    judged: Float32Array,
    half_width: np.float32,
    start: int,
    stop: int,
    obstacles: IntArray,
) -> None:
    """Hold every point against the lines [start, stop).

    A point stands over a line when its least margin is positive: inside the corridor, after P0,
    before the gap, above the line. One minimum and no branch keep the loop on vector units.
    """
    for tile in range(0, x.shape[0], TILE):
        tile_x = x[tile : tile + TILE]
        tile_y = y[tile : tile + TILE]
        tile_z = z[tile : tile + TILE]
        for i in range(start, stop):
            line_x, line_y, line_slope, line_judged = ux[i], uy[i], slope[i], judged[i]
            count = np.int32(0)
            for k in range(tile_x.shape[0]):
                along = line_x * tile_x[k] + line_y * tile_y[k]
                beside = half_width - abs(line_x * tile_y[k] - line_y * tile_x[k])
                between = min(along, line_judged - along)
                above = tile_z[k] - line_slope * along
                margin = min(min(beside, between), above)
                count += np.int32(1) if margin > np.float32(0) else np.int32(0)
            obstacles[i] += count
