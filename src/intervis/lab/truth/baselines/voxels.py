"""Occupancy voxels: a target is occluded where its sight line crosses a voxel that holds a return.

The traversal is that of Amanatides and Woo, A fast voxel traversal algorithm for ray tracing,
Eurographics 1987.
"""

import numpy as np

from intervis.arrays import BoolArray, Float64Array
from intervis.kernels import in_parts, kernel
from intervis.lab.truth.baselines.input_scans import InputScans


def predict(
    inputs: InputScans,
    viewpoint: Float64Array,
    targets: Float64Array,
    *,
    voxel_m: float,
    tolerance_voxels: float,
) -> Float64Array:
    """1 where the sight line crosses no occupied voxel, 0 elsewhere; see `baselines`.

    Parameters
    ----------
    voxel_m : float
        Edge length of a voxel.
    tolerance_voxels : float
        Occupied voxels this near to the viewpoint or the target, in edge lengths, are ignored.
    """
    if len(targets) == 0:
        return np.empty(0)
    # All segments lie in the bounding box of their ends: other voxels are not needed.
    low = np.minimum(targets.min(axis=0), viewpoint) - voxel_m
    high = np.maximum(targets.max(axis=0), viewpoint) + voxel_m
    occupied = _occupied(inputs.points_world, low, high, voxel_m)
    clear = np.empty(len(targets), dtype=np.bool_)
    origin, ends = (viewpoint - low) / voxel_m, (targets - low) / voxel_m

    def work(start: int, stop: int) -> None:
        march(occupied, origin, ends[start:stop], tolerance_voxels, clear[start:stop])

    in_parts(work, len(targets))
    return clear.astype(np.float64)


def _occupied(
    points: Float64Array, low: Float64Array, high: Float64Array, voxel_m: float
) -> BoolArray:
    """(X, Y, Z) which voxels of the box from `low` to `high` hold a point."""
    shape = tuple(int(n) for n in np.ceil((high - low) / voxel_m))
    inside = ((points >= low) & (points < high)).all(axis=1)
    cell = ((points[inside] - low) / voxel_m).astype(np.int64)
    cell = np.minimum(cell, np.array(shape) - 1)  # rounding can give an index equal to the size
    occupied = np.zeros(shape, dtype=np.bool_)
    occupied[tuple(cell.T)] = True
    return occupied


@kernel
def march(
    occupied: BoolArray,
    origin: Float64Array,
    ends: Float64Array,
    tolerance: float,
    clear: BoolArray,
) -> None:
    """Write to ``clear`` (M,) whether each segment crosses no occupied voxel.

    Unit: the edge length of a voxel. Voxels left within `tolerance` of the origin, or closer than
    `tolerance` to the end, are ignored.
    """
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
            delta = ends[m, axis] - origin[axis]
            cell[axis] = int(np.floor(origin[axis]))
            step[axis] = 1 if delta > 0 else -1
            border = cell[axis] + (1 if delta > 0 else 0)
            # Distance along the segment to the next border, and between two borders.
            each_t[axis] = length / abs(delta) if delta != 0 else np.inf
            next_t[axis] = (border - origin[axis]) / delta * length if delta != 0 else np.inf
        clear[m] = True
        entry = 0.0
        while entry < length - tolerance:
            axis = 0
            if next_t[1] < next_t[axis]:
                axis = 1
            if next_t[2] < next_t[axis]:
                axis = 2
            exit_t = min(next_t[axis], length)
            if (
                exit_t > tolerance
                and exit_t <= length - tolerance
                and occupied[cell[0], cell[1], cell[2]]
            ):
                clear[m] = False
                break
            entry = next_t[axis]
            cell[axis] += step[axis]
            next_t[axis] += each_t[axis]
