"""Rays through a grid of voxels (Amanatides and Woo 1987), in units of voxels."""

import numpy as np

from intervis.arrays import Float64Array, Int32Array, UInt8Array
from intervis.kernels import kernel

CROSSED, ENDED = 1, 2
"""Marks of a voxel: some ray crossed it, some ray ended in it."""
FREE_SPACE, OCCUPIED = 0, 1
"""The states of `intervis.uses.voxels.carving` that a ray tells from all others."""


@kernel
def clip_to_grid(
    origin: Float64Array, along: Float64Array, columns: int, rows: int, levels: int
) -> tuple[float, float]:
    """Where the ray origin + t along, 0 <= t <= 1, enters and leaves the grid; t0 > t1: nowhere."""
    t0, t1 = 0.0, 1.0
    for axis in range(3):
        size = columns if axis == 0 else rows if axis == 1 else levels
        if along[axis] == 0.0:
            if not 0.0 <= origin[axis] < size:
                return 1.0, 0.0
            continue
        a = -origin[axis] / along[axis]
        b = (size - origin[axis]) / along[axis]
        t0, t1 = max(t0, min(a, b)), min(t1, max(a, b))
    return t0, t1


@kernel
def walk(
    origin: Float64Array,
    end: Float64Array,
    columns: int,
    rows: int,
    levels: int,
    path: Int32Array,
) -> int:
    """Write the voxels that a segment crosses, in order, as indices into the flat grid.

    Parameters
    ----------
    origin, end : (3,) float64 arrays
        In voxels from the grid's corner; both may lie outside.
    columns, rows, levels : int
        Shape of the grid.
    path : (columns + rows + levels,) int32 array

    Returns
    -------
    int
        How many voxels were written.
    """
    along = end - origin
    t0, t1 = clip_to_grid(origin, along, columns, rows, levels)
    if not t0 <= t1:
        return 0
    i = int(min(max(origin[0] + t0 * along[0], 0.0), columns - 1.0))
    j = int(min(max(origin[1] + t0 * along[1], 0.0), rows - 1.0))
    k = int(min(max(origin[2] + t0 * along[2], 0.0), levels - 1.0))
    di, dj, dk = np.sign(along[0]), np.sign(along[1]), np.sign(along[2])
    step_i, step_j, step_k = int(di), int(dj), int(dk)
    with_i = (i + (di > 0.0) - origin[0]) / along[0] if di != 0.0 else np.inf
    with_j = (j + (dj > 0.0) - origin[1]) / along[1] if dj != 0.0 else np.inf
    with_k = (k + (dk > 0.0) - origin[2]) / along[2] if dk != 0.0 else np.inf
    per_i = abs(1.0 / along[0]) if di != 0.0 else np.inf
    per_j = abs(1.0 / along[1]) if dj != 0.0 else np.inf
    per_k = abs(1.0 / along[2]) if dk != 0.0 else np.inf
    count = 0
    while count < len(path):
        path[count] = (i * rows + j) * levels + k
        count += 1
        if min(with_i, with_j, with_k) > t1:
            break
        if with_i <= with_j and with_i <= with_k:
            i, with_i = i + step_i, with_i + per_i
        elif with_j <= with_k:
            j, with_j = j + step_j, with_j + per_j
        else:
            k, with_k = k + step_k, with_k + per_k
        if not (0 <= i < columns and 0 <= j < rows and 0 <= k < levels):
            break
    return count


@kernel
def mark_beams(origin: Float64Array, ends: Float64Array, marks: UInt8Array) -> None:
    """Mark the voxels that the beams from an origin (3,) to their ends (N, 3) cross and end in.

    All in voxels from the grid's corner; `marks` (I, J, K).
    """
    columns, rows, levels = marks.shape
    flat = marks.reshape(-1)
    path = np.empty(columns + rows + levels, np.int32)
    for n in range(len(ends)):
        end = ends[n]
        count = walk(origin, end, columns, rows, levels, path)
        i, j, k = np.floor(end[0]), np.floor(end[1]), np.floor(end[2])
        inside = (0.0 <= i < columns) & (0.0 <= j < rows) & (0.0 <= k < levels)
        last = int((i * rows + j) * levels + k) if inside else -1
        for m in range(count):
            if path[m] != last:
                flat[path[m]] |= CROSSED
        if inside:
            flat[last] |= ENDED


@kernel
def mark_pixels(
    origin: Float64Array,
    ends: Float64Array,
    state: UInt8Array,
    seen: UInt8Array,
    begin: int,
    stop: int,
) -> None:
    """Mark what the rays of pixels see: observed voxels, up to the first one that is occupied.

    `state` (I, J, K) uint8: `FREE_SPACE`, `OCCUPIED`, others are not observed.
    """
    columns, rows, levels = state.shape
    states, flags = state.reshape(-1), seen.reshape(-1)
    path = np.empty(columns + rows + levels, np.int32)
    for n in range(begin, stop):
        count = walk(origin, ends[n], columns, rows, levels, path)
        for m in range(count):
            at = path[m]
            if states[at] == FREE_SPACE or states[at] == OCCUPIED:
                flags[at] = 1
            if states[at] == OCCUPIED:
                break
