"""Carving: which voxels of a grid are free, occupied, occluded or unknown, from posed scans.

Each scan is drawn as a range image, as `intervis.Scene` draws it. The corners of all voxels are
projected into it once, and neighbouring voxels share them:

- **free**: all corners lie before the observed surface (a beam passed beside or beyond them);
- **occupied**: the voxel holds a return, or a surface passes between its corners
  (`intervis.sight.kernels.carving`);
- **occluded**: the corners lie behind the surface;
- **unknown**: fewer than four corners lie in an observed direction.

Where a silhouette passes between the corners, with other things far behind it, the centre decides.

Several scans add evidence (`intervis.sight.kernels.carved_sums`): occupied +0.85, free -0.4. So
what stood in a voxel during one scan and not during the others, a moving object, becomes free. What
the scan of the moment itself saw free or occupied is not outvoted.

The probability is that of the engine's occupancy model (`intervis.sight.occupancy_model`) for a
sample at the voxel's centre: height prior, and the inverse sensor model of each scan. The depth
counts as 0 in occupied voxels. The weights of several scans sum to those of the engine, but are
equal, because a grid has no near end.
"""

from __future__ import annotations  # help() shows the names of the array types

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from intervis.arguments import flag_of, object_of
from intervis.arrays import (
    LARGEST_M,
    BoolArray,
    Float32Array,
    Float64Array,
    FloatArray,
    IntArray,
    UInt8Array,
    checked_points,
    finite_rows,
    numbers_of,
)
from intervis.errors import PointsError, SceneError
from intervis.kernels import in_parts
from intervis.result_table import percent
from intervis.sight import Scene, Sensor
from intervis.sight.kernels.carved_sums import (
    FREE_SPACE,
    OCCLUDED,
    OCCUPIED,
    UNKNOWN,
    CarvedSums,
    accumulate_scan,
    finish_grid,
)
from intervis.sight.kernels.carving import carve_planes, mark_returns
from intervis.sight.kernels.packed_scans import PackedScans, descriptors_of
from intervis.sight.kernels.terrain import BORDER_M, CELL_M, CELLS
from intervis.sight.occupancy_model import CORRELATION, MODEL, SCANS, WEIGHT_DECAY
from intervis.sight.sensor import NO_RETURN_M
from intervis.transform import checked_pose
from intervis.uses.voxels.voxel_grid import VoxelGrid

STATES = {FREE_SPACE: "free", OCCUPIED: "occupied", OCCLUDED: "occluded", UNKNOWN: "unknown"}
"""The values of `CarvedGrid.state`."""
_LEAST_PLANES = 8


@dataclass(frozen=True, eq=False, repr=False)
class CarvedGrid:
    """The states of voxels.

    Attributes
    ----------
    grid : VoxelGrid
    state : (I, J, K) uint8 array
        0 free, 1 occupied, 2 occluded, 3 unknown.
    probability : (I, J, K) float32 array
        P(occupied).
    scans : int
        Number of scans.
    """

    grid: VoxelGrid
    state: UInt8Array
    probability: Float32Array
    scans: int

    @property
    def free(self) -> BoolArray:
        """Mask of the free voxels."""
        return np.asarray(self.state == FREE_SPACE)

    @property
    def occupied(self) -> BoolArray:
        """Mask of the occupied voxels."""
        return np.asarray(self.state == OCCUPIED)

    @property
    def occluded(self) -> BoolArray:
        """Mask of the occluded voxels."""
        return np.asarray(self.state == OCCLUDED)

    @property
    def unknown(self) -> BoolArray:
        """Mask of the unknown voxels."""
        return np.asarray(self.state == UNKNOWN)

    def __repr__(self) -> str:
        sides = " x ".join(map(str, self.grid.shape))
        counts = np.bincount(self.state.ravel(), minlength=len(STATES))
        parts = ", ".join(f"{percent(counts[s] / self.grid.size)} {STATES[s]}" for s in STATES)
        return f"<CarvedGrid: {sides} voxels of {self.grid.cell_m:g} m, {parts}>"


class Carver:
    """Carves a grid scan by scan; the memory does not grow with their number.

    Parameters
    ----------
    grid : VoxelGrid
        In the scene's frame, z up.
    sensor : Sensor, str or None
        As `intervis.Scene`.
    lift_m : (I + 1, J + 1) float64 array or None
        Raises the corners of each column of voxels by so much, metres: a grid that follows the
        ground. None: a grid of cubes.

    Raises
    ------
    ArgumentError, PointsError, SettingsError
        The grid is none, the heights do not fit it, or there is no such sensor.

    Examples
    --------
    A wall 10 m ahead:

    >>> y, z = np.meshgrid(np.arange(-5, 5, 0.04), np.arange(-1.5, 1.5, 0.06))
    >>> wall = np.stack([np.full(y.size, 10.1), y.ravel(), z.ravel()], axis=1)
    >>> carver = Carver(VoxelGrid([0.0, -1.0, -0.5], 0.5, (40, 4, 2)))
    >>> carver.add(wall)
    >>> carver.result().state[[10, 20, 30], 1, 1]
    array([0, 1, 2], dtype=uint8)
    """

    def __init__(
        self,
        grid: VoxelGrid,
        *,
        sensor: Sensor | str | None = None,
        lift_m: Float64Array | None = None,
    ) -> None:
        columns, rows, _ = object_of(grid, VoxelGrid, "grid").shape
        self.grid = grid
        self._sensor = Scene(sensor=sensor).sensor
        self._lift = np.zeros((columns + 1, rows + 1))
        if lift_m is not None:
            given = numbers_of(lift_m, "lift_m")
            if given.shape != self._lift.shape or not (np.abs(given) <= LARGEST_M).all():
                raise PointsError(
                    f"lift_m must have the shape {self._lift.shape} and be up to {LARGEST_M:g} m."
                )
            self._lift += given / grid.cell_m
        self._sums = CarvedSums(
            np.zeros(grid.shape, np.float32),
            np.zeros(grid.shape, np.float32),
            np.zeros(grid.shape, np.int16),
            np.zeros(grid.shape, np.uint8),
            np.zeros(grid.shape, np.uint8),
        )
        self._place = np.empty(grid.shape, np.uint8)
        self._depth = np.empty(grid.shape, np.float32)
        self._ground: PackedScans | None = None
        self.scans = 0

    def add(self, points: ArrayLike, pose: ArrayLike | None = None, *, now: bool = False) -> None:
        """Add a scan.

        Parameters
        ----------
        points : (N, 3) or (N, 4) float array
            In the sensor's frame, metres; rows that are no returns are left out (`is_return`).
        pose : (4, 4) array or None
            Scene from sensor. None: the scene's frame is the sensor's, which stands upright.
        now : bool
            Whether this is a scan of the moment that the grid is for. Its ground serves the height
            prior, too; without such a scan, that of the first one does.

        Raises
        ------
        PointsError, PoseError
            As `intervis.Scene.add`.
        """
        xyz, now = checked_points(points), flag_of(now, "now")
        scene_from_sensor = np.eye(4) if pose is None else checked_pose(pose)
        kept = np.asarray(xyz[is_return(xyz)])
        packed = Scene.from_scan(kept, scene_from_sensor, self._sensor).packed_scans()
        self.add_packed(packed, kept, scene_from_sensor, now=now)

    def add_packed(
        self,
        packed: PackedScans,
        points: FloatArray,
        scene_from_sensor: Float64Array,
        *,
        now: bool = False,
    ) -> None:
        """Add a scan as a scene of this scan alone packs it; its points (N, 3) are finite."""
        returns = np.zeros(self.grid.shape, np.uint8)
        grid = self.grid
        # Not by a product of matrices: BLAS spreads such small ones over threads, which costs more.
        rows = np.ascontiguousarray(points)
        mark_returns(rows, scene_from_sensor, grid.corner, grid.cell_m, self._lift, returns)
        self._carve(packed, returns, now)
        if self._ground is None or now:
            self._ground = packed
        self.scans += 1

    def _carve(self, packed: PackedScans, returns: UInt8Array, now: bool) -> None:
        descriptor = descriptors_of(packed)[0]
        sensor_from_scene = packed.sensor_from_scene[0]
        steps = self.grid.cell_m * sensor_from_scene[:, :3].T
        start = sensor_from_scene[:, :3] @ self.grid.corner + sensor_from_scene[:, 3]
        frame = np.vstack([start, steps])
        table, parameters = MODEL.tables.depth_log_odds, MODEL.parameters

        def work(begin: int, stop: int) -> None:
            place, depth = self._place[begin:stop], self._depth[begin:stop]
            carve_planes(
                packed.pixels, descriptor, frame, self._lift, self.grid.cell_m, begin, place, depth
            )
            sums = CarvedSums._make([values[begin:stop] for values in self._sums])
            accumulate_scan(place, depth, returns[begin:stop], now, table, parameters, sums)

        in_parts(work, self.grid.shape[0], least=_LEAST_PLANES)

    def result(self) -> CarvedGrid:
        """The grid from the scans added so far; more may be added later.

        Raises
        ------
        SceneError
            No scan was added.
        """
        if self._ground is None:
            raise SceneError("the grid has no scan: call carver.add(points, pose) first.")
        height = _lowest_heights(self.grid, self._lift, self._ground)
        state = np.empty(self.grid.shape, np.uint8)
        probability = np.empty(self.grid.shape, np.float32)
        weights = np.cumsum(WEIGHT_DECAY ** np.arange(SCANS)) ** (1.0 - CORRELATION)
        total_weight = np.append(0.0, weights)

        def work(begin: int, stop: int) -> None:
            finish_grid(
                CarvedSums._make([values[begin:stop] for values in self._sums]),
                height[begin:stop],
                self.grid.cell_m,
                MODEL,
                total_weight,
                state[begin:stop],
                probability[begin:stop],
            )

        in_parts(work, self.grid.shape[0], least=_LEAST_PLANES)
        return CarvedGrid(self.grid, state, probability, self.scans)


def is_return(points: FloatArray) -> BoolArray:
    """Which rows (N, 3), sensor frame, are returns: finite, and not at the scanner itself.

    Examples
    --------
    >>> is_return(np.array([[4.0, 0, 0], [0, 0, 0], [np.nan, 0, 0]]))
    array([ True, False, False])
    """
    with np.errstate(invalid="ignore", over="ignore"):
        away = np.abs(points).max(axis=1, initial=0.0) >= NO_RETURN_M
    return np.asarray(away & finite_rows(points))


def _lowest_heights(grid: VoxelGrid, lift: Float64Array, ground: PackedScans) -> Float64Array:
    """Heights (I, J) of the lowest centres above the ground map of a scan."""
    mean = 0.25 * (lift[:-1, :-1] + lift[1:, :-1] + lift[:-1, 1:] + lift[1:, 1:])
    i, j = np.indices(grid.shape[:2])
    centre = grid.centre_of(np.stack([i, j, mean], axis=-1)) - ground.position[0]
    cell: IntArray = np.floor((centre[..., :2] + BORDER_M) / CELL_M).astype(np.int64) + CELLS // 2
    a, b = np.moveaxis(np.clip(cell, 0, CELLS - 1), -1, 0)
    height: NDArray[np.float64] = centre[..., 2] - ground.ground[0][a, b]
    return height
