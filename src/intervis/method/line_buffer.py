"""Line buffers: each sight line compared with all points, for the method "global points"."""

import numpy as np

from intervis.arrays import Float32Array, Float64Array, IntArray
from intervis.kernels import in_parts, kernel

TILE = 4096
"""Points in one tile: 48 KiB of float32 x, y, z, about the size of an L1 data cache."""

LINES_PER_PART = 256
"""Fewest sight lines for which a thread is worth starting."""


def obstacles_in_buffer(offset: Float64Array, buffer_m: float, target_margin_m: float) -> IntArray:
    """(V,) how many of the V points stand above the sight line from P0 to each of them.

    Parameters
    ----------
    offset : (V, 3) float64 array
        Points relative to P0, z up, metres.
    buffer_m : float
        Half width of the line buffer over the ground plane, metres.
    target_margin_m : float
        Points nearer to the target than this, along the line over the ground, are not compared.
    """
    x, y, z = (np.ascontiguousarray(column, dtype=np.float32) for column in offset.T)
    reach = np.hypot(offset[:, 0], offset[:, 1])
    over_0 = np.divide(1.0, reach, out=np.zeros_like(reach), where=reach > 0)
    ux, uy, slope = ((offset[:, k] * over_0).astype(np.float32) for k in range(3))
    # Shorter by 1e-6 of its length: in single precision no target may stand above its own line.
    compared_m = (reach * (1.0 - 1e-6) - target_margin_m).astype(np.float32)
    obstacles = np.zeros(len(offset), np.int64)
    half_width = np.float32(buffer_m)

    def work(start: int, stop: int) -> None:
        _count_above(x, y, z, ux, uy, slope, compared_m, half_width, start, stop, obstacles)

    in_parts(work, len(offset), least=LINES_PER_PART)
    return obstacles


@kernel
def _count_above(
    x: Float32Array,
    y: Float32Array,
    z: Float32Array,
    ux: Float32Array,
    uy: Float32Array,
    slope: Float32Array,
    compared_m: Float32Array,
    half_width: np.float32,
    start: int,
    stop: int,
    obstacles: IntArray,
) -> None:
    """Compare every point with the lines [start, stop).

    A point stands above a line when the least of four margins is positive: inside the buffer, on
    the target's side of P0, outside the target margin, above the line. The inner loop has no
    branch and only 32-bit numbers, so that LLVM vectorises it.
    """
    for tile in range(0, x.shape[0], TILE):
        tile_x = x[tile : tile + TILE]
        tile_y = y[tile : tile + TILE]
        tile_z = z[tile : tile + TILE]
        for i in range(start, stop):
            line_x, line_y, line_slope, line_compared = ux[i], uy[i], slope[i], compared_m[i]
            count = np.int32(0)
            for k in range(tile_x.shape[0]):
                along = line_x * tile_x[k] + line_y * tile_y[k]
                beside = half_width - abs(line_x * tile_y[k] - line_y * tile_x[k])
                between = min(along, line_compared - along)
                above = tile_z[k] - line_slope * along
                margin = min(min(beside, between), above)
                count += np.int32(1) if margin > np.float32(0) else np.int32(0)
            obstacles[i] += count
