"""A bird's-eye view: square cells of ground, by what the space above them holds."""

from __future__ import annotations  # help() shows the names of the array types

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from intervis.arguments import objects_of, shown
from intervis.arrays import Float32Array, Float64Array, UInt8Array, checked_points
from intervis.errors import PointsError, SceneError, SettingsError
from intervis.result_table import percent
from intervis.sight import Scene, Sensor
from intervis.sight.kernels.carved_sums import FREE_SPACE, OCCLUDED, OCCUPIED, UNKNOWN
from intervis.sight.query_checks import finite_number, positive_length
from intervis.uses.voxels.carving import STATES, CarvedGrid, Carver, is_return
from intervis.uses.voxels.voxel_grid import VoxelGrid


@dataclass(frozen=True, eq=False, repr=False)
class BevGrid:
    """Cells around a place; cell [i, j] reaches from corner + cell_m (i, j) upwards.

    Attributes
    ----------
    corner : (2,) float64 array
        Smallest x and y, metres.
    cell_m : float
    heights_m : two floats
        Heights above ground between which the space is judged.
    state : (I, J) uint8 array
        0 free, 1 occupied, 2 occluded, 3 unknown.
    probability : (I, J) float32 array
        P(occupied) of the voxel above the cell for which it is largest.
    ground_m : (I, J) float64 array
        Height of the ground at the cells' corners of smallest x and y, scene frame; NaN where none
        is known.
    """

    corner: Float64Array
    cell_m: float
    heights_m: tuple[float, float]
    state: UInt8Array
    probability: Float32Array
    ground_m: Float64Array

    def __repr__(self) -> str:
        counts = np.bincount(self.state.ravel(), minlength=len(STATES))
        parts = ", ".join(f"{percent(counts[s] / counts.sum())} {STATES[s]}" for s in STATES)
        columns, rows = self.state.shape
        return f"<BevGrid: {columns} x {rows} cells of {self.cell_m:g} m, {parts}>"


def bev_grid(
    scans: Sequence[tuple[ArrayLike, ArrayLike | None]],
    *,
    reach_m: float = 40.0,
    cell_m: float = 0.2,
    heights_m: tuple[float, float] = (0.3, 1.7),
    sensor: Sensor | str | None = None,
) -> BevGrid:
    """The cells around the scanner of the first scan.

    The space above each cell is carved (`Carver`) in voxels that follow the ground of the first
    scan. A cell is *occupied* if one of its voxels is; *free* if none is and at least half of them
    are free; otherwise *occluded* if more voxels are occluded than unknown, else *unknown*.

    Parameters
    ----------
    scans : sequence of (points, pose)
        Points (N, 3) in the sensor's frame, metres; scene from sensor, None for the identity. The
        first is the scan of the moment: what moved since or before does not fill a cell that it saw
        free.
    reach_m, cell_m : float
        Half of the edge of the grid, and edge of a cell, metres.
    heights_m : two floats
        Heights above ground between which the space is judged.
    sensor : Sensor, str or None
        As `intervis.Scene`.

    Raises
    ------
    SceneError
        There is no scan, or the first one shows no ground.
    SettingsError
        A length makes no sense, or the grid would have too many voxels.
    PointsError, PoseError
        As `intervis.Scene.add`.

    Examples
    --------
    >>> x, y = np.meshgrid(np.arange(-9, 9, 0.1), np.arange(-9, 9, 0.1))
    >>> ground = np.stack([x.ravel(), y.ravel(), np.full(x.size, -2.0)], axis=1)
    >>> post = np.stack([np.full(90, 4.1), np.full(90, 0.1), np.linspace(-2, 0, 90)], axis=1)
    >>> grid = bev_grid([(np.vstack([ground, post]), None)], reach_m=8.0, cell_m=0.2)
    >>> grid.state[60, 40], grid.state[60, 50]
    (np.uint8(1), np.uint8(0))
    """
    pairs = [_pair(scan) for scan in objects_of(scans, object, "scans")]
    if not pairs:
        raise SceneError("a grid needs one scan at least.")
    heights = [
        finite_number("heights_m", height, "metres")
        for height in objects_of(heights_m, object, "heights_m")
    ]
    if len(heights) != 2:
        raise SettingsError(f"heights_m must be two heights, got {shown(heights_m)}.")
    lowest, highest = heights
    reach_m, cell_m = positive_length("reach_m", reach_m), positive_length("cell_m", cell_m)
    if not highest - lowest >= 0.5 * cell_m:
        raise SettingsError(f"heights_m must rise by half a cell at least, got {shown(heights_m)}.")
    count = max(1, round(min(2.0 * reach_m / cell_m, 1e7)))
    levels = max(1, round(min((highest - lowest) / cell_m, 1e7)))
    points, pose = checked_points(pairs[0][0]), pairs[0][1]
    points = np.asarray(points[is_return(points)])
    scene = Scene.from_scan(points, pose, sensor)
    corner = scene.poses[0, :2, 3] - 0.5 * count * cell_m
    grid = VoxelGrid([*corner, lowest], cell_m, (count, count, levels))
    ground_m = _ground_at_corners(scene, grid)
    carver = Carver(grid, sensor=sensor, lift_m=ground_m)
    carver.add_packed(scene.packed_scans(), points, scene.poses[0], now=True)
    for other, other_pose in pairs[1:]:
        carver.add(other, other_pose)
    state, probability = _from_above(carver.result())
    return BevGrid(
        corner, cell_m, (lowest, lowest + levels * cell_m), state, probability, ground_m[:-1, :-1]
    )


def _pair(scan: object) -> tuple[ArrayLike, ArrayLike | None]:
    if not isinstance(scan, tuple | list) or len(scan) != 2:
        raise PointsError("each scan must be a pair of points and pose, or of points and None.")
    return scan[0], scan[1]


def _ground_at_corners(scene: Scene, grid: VoxelGrid) -> Float64Array:
    """Height (I + 1, J + 1) of the ground at the corners of the columns of voxels."""
    columns, rows = (np.arange(count + 1) * grid.cell_m for count in grid.shape[:2])
    xy = np.stack(np.meshgrid(columns, rows, indexing="ij"), axis=-1) + grid.corner[:2]
    ground_m = scene.ground_height(xy.reshape(-1, 2)).reshape(xy.shape[:2])
    if np.isnan(ground_m).any():
        raise SceneError("the first scan shows no ground, so no height above it is known.")
    return ground_m


def _from_above(carved: CarvedGrid) -> tuple[UInt8Array, Float32Array]:
    """State and probability (I, J) of columns of voxels."""
    levels = carved.grid.shape[2]
    counts = np.zeros((len(STATES), *carved.grid.shape[:2]), np.int16)
    probability = np.zeros(carved.grid.shape[:2], np.float32)
    for level in range(levels):  # a sum along a short last axis takes ten times as long
        for state in STATES:
            counts[state] += carved.state[:, :, level] == state
        np.maximum(probability, carved.probability[:, :, level], out=probability)
    found = np.where(counts[OCCLUDED] > counts[UNKNOWN], OCCLUDED, UNKNOWN)
    found[2 * counts[FREE_SPACE] >= levels] = FREE_SPACE
    found[counts[OCCUPIED] > 0] = OCCUPIED
    return found.astype(np.uint8), probability
