"""The occlusion walk of SemanticKITTI's voxelizer, voxel for voxel.

From the centre of each voxel a walk leads to a sensor. The first occupied voxel on it, the own one
included, blocks it; a walk in a negative direction ends on reaching index 0 without a look at that
voxel. All voxels on a walk get its result, and later walks overwrite it; voxels that have a result
start no walk. The result therefore depends on the order of visiting: shells from the largest x, the
smallest y and the largest y inwards. Numbers are float32, as the tool's are.
"""

import numpy as np

from intervis.arrays import Float32Array, Int32Array, UInt8Array
from intervis.kernels import kernel

UNSET, OPEN, BLOCKED = 0, 1, 2
"""Results of a walk."""


@kernel
def _start(corner: np.float32, cell_m: np.float32, index: int) -> np.float32:
    """Centre of a voxel along one axis."""
    return np.float32(np.float64(corner + np.float32(index) * cell_m) + 0.5 * np.float64(cell_m))


@kernel
def _first_crossing(along: np.float32, cell_m: np.float32) -> np.float32:
    half = 0.5 * np.float64(cell_m)
    return np.float32((-half if along < 0 else half) / np.float64(along))


@kernel
def _between_crossings(along: np.float32, cell_m: np.float32) -> np.float32:
    return np.float32((-cell_m if along < 0 else cell_m) / along)


@kernel
def _walk(
    filled: UInt8Array,
    columns: int,
    rows: int,
    levels: int,
    i: int,
    j: int,
    k: int,
    end: Float32Array,
    corner: Float32Array,
    cell_m: np.float32,
    fates: UInt8Array,
    path: Int32Array,
) -> None:
    """Walk from a voxel to an end point and write the result to all voxels on the way.

    `filled` and `fates` are flat grids.
    """
    x = np.float32(end[0] - _start(corner[0], cell_m, i))
    y = np.float32(end[1] - _start(corner[1], cell_m, j))
    z = np.float32(end[2] - _start(corner[2], cell_m, k))
    at_x, at_y, at_z = (
        _first_crossing(x, cell_m),
        _first_crossing(y, cell_m),
        _first_crossing(z, cell_m),
    )
    per_x, per_y, per_z = (
        _between_crossings(x, cell_m),
        _between_crossings(y, cell_m),
        _between_crossings(z, cell_m),
    )
    step_x, out_x = (-1, 0) if x < 0 else (1, columns)
    step_y, out_y = (-1, 0) if y < 0 else (1, rows)
    step_z, out_z = (-1, 0) if z < 0 else (1, levels)
    # Truncated towards zero, as a conversion to int does.
    end_i = int((end[0] - corner[0]) / cell_m)
    end_j = int((end[1] - corner[1]) / cell_m)
    end_k = int((end[2] - corner[2]) / cell_m)
    own = (i * rows + j) * levels + k
    count, result = 0, OPEN
    while 0 <= i < columns and 0 <= j < rows and 0 <= k < levels:
        here = (i * rows + j) * levels + k
        if filled[here] > 0:
            result = BLOCKED
            break
        path[count] = here
        count += 1
        with_x, with_y = (0 if at_x < at_z else 2), (1 if at_y < at_z else 2)
        axis = with_x if at_x < at_y else with_y
        if axis == 0:
            i += step_x
            at_x = np.float32(at_x + per_x)
            left = i == out_x
        elif axis == 1:
            j += step_y
            at_y = np.float32(at_y + per_y)
            left = j == out_y
        else:
            k += step_z
            at_z = np.float32(at_z + per_z)
            left = k == out_z
        if left or (i == end_i and j == end_j and k == end_k):
            break
    for n in range(count):
        fates[path[n]] = result
    fates[own] = result


@kernel
def update_blocked(
    occupied: UInt8Array,
    end: Float32Array,
    corner: Float32Array,
    cell_m: np.float32,
    is_first: bool,
    blocked: UInt8Array,
) -> None:
    """Which voxels (I, J, K) are blocked towards a sensor.

    Parameters
    ----------
    occupied : (I, J, K) uint8 array
    end : (3,) float32 array
        Place of the sensor, metres, in the frame of the grid.
    corner, cell_m
        Of the grid.
    is_first : bool
        True: `blocked` gets the results. False: voxels that are open towards this sensor become
        open, and voxels that are open already start no walk.
    blocked : (I, J, K) uint8 array
        1 blocked, 0 open.
    """
    columns, rows, levels = occupied.shape
    filled, fates = occupied.reshape(-1), np.zeros(occupied.size, np.uint8)
    results = blocked.reshape(-1)
    path = np.empty(columns + rows + levels + 3, np.int32)
    shells = min(columns, (rows + 1) // 2)
    for shell in range(shells):
        for side in range(3):
            far = columns - 1 - shell
            if side == 0:
                i_from, i_to, j_from, j_to = far, far + 1, 0, rows
            else:
                j_from = shell if side == 1 else rows - 1 - shell
                i_from, i_to, j_to = 0, far, j_from + 1
            for i in range(i_from, i_to):
                for j in range(j_from, j_to):
                    row = (i * rows + j) * levels
                    for k in range(levels):
                        at = row + k
                        if not is_first and results[at] == 0:
                            continue
                        if fates[at] == UNSET:
                            _walk(
                                *(filled, columns, rows, levels, i, j, k),
                                *(end, corner, cell_m, fates, path),
                            )
                        result = 1 if fates[at] == BLOCKED else 0
                        results[at] = result if is_first else results[at] & result
