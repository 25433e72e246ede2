"""A grid of what a viewpoint sees at one height above the ground."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from intervis.arguments import object_of
from intervis.arrays import (
    BoolArray,
    Float64Array,
    FloatArray,
    checked_place,
    checked_points,
    finite_rows,
)
from intervis.errors import SettingsError
from intervis.sight import UNKNOWN, Scene
from intervis.sight.ground_map import nearest_scans, shown_ground
from intervis.sight.occupancy_model import DEFAULT_RISK
from intervis.sight.query_checks import positive_length

MOST_CELLS = 4_000_000
"""Cells of a grid at most: some 300 MB while it is answered."""

MOST_HEIGHT_M = 1000.0
"""Height above ground at most: lines to higher cells take long and leave the scans."""

GROUND_WITHIN_M = 20.0
"""Cells are judged where a scan shows the ground within this distance."""

OBSTACLE_M = (0.3, 2.5)
"""Heights above ground of returns that fill a cell."""


@dataclass(frozen=True, eq=False, repr=False)
class VisibilityGrid:
    """Square cells around a viewpoint; cell [i, j] reaches from corner + cell_m (i, j) upwards.

    Attributes
    ----------
    viewpoint : (3,) float64 array
        Scene frame, metres.
    corner : (2,) float64 array
        Smallest x and y of the grid, metres.
    cell_m, height_m : float
        Edge of a cell, and the height above ground at which cells are judged.
    state : (I, J) int8 array
        1 visible, 0 occluded, -1 unknown: of the line to the middle of the cell.
    probability : (I, J) float64 array
        NaN where no ground is known.
    blocker : (I, J, 3) float64 array
        As in `intervis.Sight`.
    ground_m : (I, J) float64 array
        Height of the ground in the scene's frame; NaN where the nearest scan shows none within
        `GROUND_WITHIN_M`.
    obstacle : (I, J) bool array
        Cells with returns at heights of obstacles.
    """

    viewpoint: Float64Array
    corner: Float64Array
    cell_m: float
    height_m: float
    state: NDArray[np.int8]
    probability: Float64Array
    blocker: Float64Array
    ground_m: Float64Array
    obstacle: BoolArray

    @property
    def range_m(self) -> Float64Array:
        """(I, J) horizontal distance of the middles from the viewpoint, metres."""
        return np.asarray(np.linalg.norm(self.middles - self.viewpoint[:2], axis=2))

    @property
    def middles(self) -> Float64Array:
        """(I, J, 2) x and y of the middles of the cells, metres."""
        i, j = np.indices(self.state.shape)
        return np.asarray(self.corner + (np.stack([i, j], axis=2) + 0.5) * self.cell_m)

    def __repr__(self) -> str:
        rows, columns = self.state.shape
        return f"<VisibilityGrid: {rows} x {columns} cells of {self.cell_m:g} m>"


def visibility_grid(
    scene: Scene,
    viewpoint: ArrayLike,
    returns: FloatArray,
    *,
    reach_m: float = 40.0,
    cell_m: float = 0.4,
    height_m: float = 1.0,
    risk: float = DEFAULT_RISK,
    moment_s: float | None = None,
) -> VisibilityGrid:
    """What a viewpoint sees of the space at one height above the ground around it.

    Parameters
    ----------
    scene : Scene
    viewpoint : (3,) array
        Scene frame, metres.
    returns : (N, 3) float array
        Scene frame, metres: what fills cells.
    reach_m, cell_m, height_m : float
        Half of the edge of the grid, edge of a cell, height above ground.
    risk, moment_s
        See `intervis.Scene.sight`.

    Raises
    ------
    SettingsError
        A length is not positive and finite, the height is above 1,000 m, or the grid would have
        too many cells.
    PointsError, SceneError
        As `intervis.Scene.sight`.
    """
    object_of(scene, Scene, "scene")
    start, returns = checked_place(viewpoint), checked_points(returns, "returns")
    reach_m = positive_length("reach_m", reach_m)
    cell_m = positive_length("cell_m", cell_m)
    height_m = positive_length("height_m", height_m)
    if height_m > MOST_HEIGHT_M:
        raise SettingsError(f"height_m must be at most {MOST_HEIGHT_M:g} m, got {height_m:g}.")
    count = int(np.ceil(min(2.0 * reach_m / cell_m, 1e6)))
    if count * count > MOST_CELLS:
        raise SettingsError(
            f"{2 * reach_m:g} m in cells of {cell_m:g} m make {count:,} x {count:,} cells, and at"
            f" most {MOST_CELLS:,} are judged: choose larger cells or a shorter reach."
        )
    corner = start[:2] - 0.5 * count * cell_m
    i, j = np.indices((count, count)).reshape(2, -1)
    xy = corner + (np.column_stack([i, j]) + 0.5) * cell_m
    ground_m = np.where(_near_ground(scene, xy), scene.ground_height(xy), np.nan)
    targets = np.column_stack([xy, ground_m + height_m])  # NaN without ground: unknown
    sight = scene.sight(start, targets, risk=risk, moment_s=moment_s)
    shape = (count, count)
    return VisibilityGrid(
        start,
        corner,
        cell_m,
        height_m,
        sight.state.reshape(shape),
        sight.probability.reshape(shape),
        sight.blocker.reshape((*shape, 3)),
        ground_m.reshape(shape),
        obstacle_cells(returns, scene, corner, cell_m, count),
    )


def _near_ground(scene: Scene, xy: Float64Array) -> BoolArray:
    """Points (N, 2) that have ground, shown by the nearest scan, within `GROUND_WITHIN_M`."""
    scans = scene.packed_scans()
    nearest, near = nearest_scans(scans, xy), np.zeros(len(xy), np.bool_)
    for nth in np.unique(nearest).tolist():
        shown = shown_ground(scans, nth)
        if len(shown):
            mine = np.flatnonzero(nearest == nth)
            distance_m, _ = cKDTree(shown).query(xy[mine], distance_upper_bound=GROUND_WITHIN_M)
            near[mine] = np.isfinite(distance_m)
    return near


def obstacle_cells(
    returns: FloatArray, scene: Scene, corner: Float64Array, cell_m: float, count: int
) -> BoolArray:
    """Cells (I, J) that hold returns at heights of obstacles."""
    points = np.asarray(returns[finite_rows(returns), :3], np.float64)
    with np.errstate(over="ignore"):
        cell = np.floor((points[:, :2] - corner) / cell_m)
    inside = ((cell >= 0) & (cell < count)).all(axis=1)
    points, cell = points[inside], cell[inside].astype(np.int64)
    above_m = points[:, 2] - scene.ground_height(points[:, :2])
    fills = (above_m >= OBSTACLE_M[0]) & (above_m <= OBSTACLE_M[1])
    found = np.zeros((count, count), np.bool_)
    found[cell[fills, 0], cell[fills, 1]] = True
    return found


def blind_cells(grid: VisibilityGrid) -> BoolArray:
    """Cells (I, J) over known ground that are not visible and hold no obstacle."""
    known = np.isfinite(grid.ground_m)
    return np.asarray((grid.state != 1) & known & ~grid.obstacle)


def occluded_share(grid: VisibilityGrid, cells: BoolArray) -> float:
    """Of some cells, the share that is occluded; the others are unknown."""
    return float(np.mean(grid.state[cells] != UNKNOWN)) if cells.any() else float("nan")
