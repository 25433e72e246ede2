"""SemanticKITTI's masks as its own tool makes them (jbehley/voxelizer, read November 2026).

- Returns nearer than 2.5 m or farther than 70 m are left out, and so are those on the own car
  (-2 < x < 3, abs(y) < 2 in the frame of each scan).
- A voxel has the label of most of its returns, the smaller one if two are equal. The *input* is the
  anchor scan alone, the *target* the anchor and the next 70 scans.
- *Occluded* is a voxel whose walk to the sensor of the anchor is blocked in the target, *invalid*
  one whose walks to the sensors of all these scans are, without being occupied itself
  (`intervis.uses.voxels.kernels.voxelizer_walk`).

Moving objects stay in the target, as tubes, unless the caller leaves their returns out.
"""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from intervis.arrays import BoolArray, Float64Array, FloatArray, IntArray, finite_rows
from intervis.uses.voxels.kernels.voxelizer_walk import update_blocked
from intervis.uses.voxels.voxel_grid import VoxelGrid

NEAREST_M, FARTHEST_M = 2.5, 70.0
CAR_X_M, CAR_Y_M = (-2.0, 3.0), 2.0
LATER_SCANS = 70
MOVING_CLASSES = frozenset(range(252, 260))
"""SemanticKITTI's classes of things that move: car, bicyclist, person ... truck, other vehicle."""


def tool_keeps(points: FloatArray) -> BoolArray:
    """Which points (N, 3), sensor frame, the tool enters into its grids."""
    x, y = points[:, 0], points[:, 1]
    with np.errstate(invalid="ignore", over="ignore"):
        range_m = np.sqrt((points.astype(np.float32) ** 2).sum(axis=1))
        on_car = (x > CAR_X_M[0]) & (x < CAR_X_M[1]) & (np.abs(y) < CAR_Y_M)
        near = (range_m >= NEAREST_M) & (range_m <= FARTHEST_M)
    return np.asarray(near & ~on_car & finite_rows(points))


def voted_labels(
    grid: VoxelGrid, scans: Iterable[tuple[FloatArray, NDArray[np.uint16]]]
) -> tuple[BoolArray, NDArray[np.uint16]]:
    """Which voxels (I, J, K) hold points, and the label of most of them (0: none or unlabelled).

    Parameters
    ----------
    grid : VoxelGrid
    scans : iterable of (points, labels)
        Points (N, 3), finite, in the frame of the grid, metres; labels (N,) uint16. One scan is
        held at a time.

    Examples
    --------
    >>> points = np.array([[9.1, 0, 0], [9.1, 0.1, 0], [9.1, 0.1, 0.1]])
    >>> labels = np.array([40, 10, 10], np.uint16)
    >>> occupied, label = voted_labels(VoxelGrid([9, 0, 0], 0.2, (1, 1, 2)), [(points, labels)])
    >>> occupied[0, 0], label[0, 0]
    (array([ True, False]), array([10,  0], dtype=uint16))
    """
    keys: list[IntArray] = [np.empty(0, np.int64)]
    for points, labels in scans:
        index, inside = grid.index_of(points)
        flat = np.ravel_multi_index(tuple(index[inside].T), grid.shape).astype(np.int64)
        keys.append((flat << 16) | labels[inside])
    each, counts = np.unique(np.concatenate(keys), return_counts=True)
    # Ascending by voxel and label; of each voxel the first of the labels with the largest count.
    order = np.lexsort((each, -counts, each >> 16))
    voxel, first = np.unique(each[order] >> 16, return_index=True)
    occupied, label = np.zeros(grid.size, np.bool_), np.zeros(grid.size, np.uint16)
    occupied[voxel] = True
    label[voxel] = (each[order][first] & 0xFFFF).astype(np.uint16)
    return occupied.reshape(grid.shape), label.reshape(grid.shape)


def blocked_masks(
    grid: VoxelGrid, occupied: BoolArray, sensors: Float64Array
) -> tuple[BoolArray, BoolArray]:
    """The tool's masks *occluded* and *invalid* (I, J, K) of a target.

    Parameters
    ----------
    grid : VoxelGrid
        In the frame of the anchor, whose sensor is at the origin.
    occupied : (I, J, K) bool array
    sensors : (S, 3) float64 array
        Places of the sensor in the later scans, metres.
    """
    filled = occupied.astype(np.uint8)
    corner, cell_m = grid.corner.astype(np.float32), np.float32(grid.cell_m)
    blocked = np.zeros(grid.shape, np.uint8)
    update_blocked(filled, np.zeros(3, np.float32), corner, cell_m, True, blocked)
    occluded = blocked > 0
    for place in sensors.reshape(-1, 3).astype(np.float32):
        update_blocked(filled, place, corner, cell_m, False, blocked)
    return occluded, np.asarray((blocked > 0) & ~occupied)
