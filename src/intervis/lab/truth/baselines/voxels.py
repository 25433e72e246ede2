"""Occupancy voxels: a segment is blocked when it marches through a voxel that holds a return.

The march is that of Amanatides and Woo, A fast voxel traversal algorithm, Eurographics 1987.
"""

import numpy as np

from intervis.arrays import BoolArray, Float64Array
from intervis.kernels import in_parts, kernel
from intervis.lab.truth.baselines.input_scans import Seen


def answer(
    seen: Seen,
    viewpoint: Float64Array,
    targets: Float64Array,
    *,
    voxel_m: float,
    slack_voxels: float,
) -> Float64Array:
    """Probability (1 or 0) that targets (M, 3) are visible past the occupied voxels.

    Parameters
    ----------
    seen : Seen
    viewpoint : (3,) float64 array
        World frame.
    targets : (M, 3) float64 array
        World frame.
    voxel_m : float
        Edge of a voxel.
    slack_voxels : float
        Occupied voxels do not count this near the viewpoint or the target, in edges.
    """
    if len(targets) == 0:
        return np.empty(0)
    # every segment lies in the box of its ends, so nothing outside that box matters
    low = np.minimum(targets.min(axis=0), viewpoint) - voxel_m
    high = np.maximum(targets.max(axis=0), viewpoint) + voxel_m
    occupied = _occupied(seen.points_world, low, high, voxel_m)
    clear = np.empty(len(targets), dtype=np.bool_)
    origin, ends = (viewpoint - low) / voxel_m, (targets - low) / voxel_m

    def work(start: int, stop: int) -> None:
        march(occupied, origin, ends[start:stop], slack_voxels, clear[start:stop])

    in_parts(work, len(targets))
    return clear.astype(np.float64)


def _occupied(
    points: Float64Array, low: Float64Array, high: Float64Array, voxel_m: float
) -> BoolArray:
    shape = tuple(int(n) for n in np.ceil((high - low) / voxel_m))
    inside = ((points >= low) & (points < high)).all(axis=1)
    cell = ((points[inside] - low) / voxel_m).astype(np.int64)
    cell = np.minimum(cell, np.array(shape) - 1)  # rounding may reach the upper border
    flat = np.ravel_multi_index((cell[:, 0], cell[:, 1], cell[:, 2]), shape)
    occupied = np.zeros(shape, dtype=np.bool_)
    occupied.ravel()[flat] = True
    return occupied


@kernel
def march(
    occupied: BoolArray, origin: Float64Array, ends: Float64Array, slack: float, clear: BoolArray
) -> None:
    """Write to ``clear`` (M,) whether each segment meets no occupied voxel; edges of 1."""
    cell = np.empty(3, np.int64)
    step = np.empty(3, np.int64)
    next_t = np.empty(3)
    each_t = np.empty(3)
    for m in range(len(ends)):
        length = 0.0
        for axis in range(3):
            length += (ends[m, axis] - origin[axis]) ** 2
        length = np.sqrt(length)
        for axis in range(3):
            way = ends[m, axis] - origin[axis]
            cell[axis] = int(np.floor(origin[axis]))
            step[axis] = 1 if way > 0 else -1
            border = cell[axis] + (1 if way > 0 else 0)
            # distances along the segment, in edges, to the next border and between borders
            each_t[axis] = length / abs(way) if way != 0 else np.inf
            next_t[axis] = (border - origin[axis]) / way * length if way != 0 else np.inf
        clear[m] = True
        entered = 0.0
        while entered < length - slack:
            axis = 0
            if next_t[1] < next_t[axis]:
                axis = 1
            if next_t[2] < next_t[axis]:
                axis = 2
            left = min(next_t[axis], length)
            if left > slack and left <= length - slack and occupied[cell[0], cell[1], cell[2]]:
                clear[m] = False
                break
            entered = next_t[axis]
            cell[axis] += step[axis]
            next_t[axis] += each_t[axis]
