"""Terrain height around a sensor.

Traffic, people and parked cars occupy the lowest two metres. The prior that unobserved space is
occupied therefore depends on the height above ground. The ground is known only in cells with
returns and between such cells: a slope that nobody saw is no ground. Elsewhere the map holds an
assumption for the prior alone: the height of the nearest known cell, marked by an offset.
"""

import numpy as np

from intervis.arrays import LARGEST_M, BoolArray, Float32Array, Float64Array, IntArray
from intervis.errors import SceneError
from intervis.sight.kernels.packed_scans import PackedScans
from intervis.sight.kernels.terrain import (
    ASSUMED_OFFSET_M,
    BORDER_M,
    CELL_M,
    CELLS,
    assume_ground,
    interpolate,
    lowest_returns,
    remove_below_nearer,
    remove_outliers,
    slope_filter,
)

LEAST_BELOW_M = 0.2
"""A scan shows ground only if some of it lies so far below the scanner."""


def ground_map_of(level: Float64Array, kept: IntArray) -> Float32Array:
    """Height of the ground around the sensor.

    Parameters
    ----------
    level : (3, N) float64 array
        Coordinates x, y, z of a scan, metres, the sensor at the origin, z up along gravity.
    kept : (M,) int64 array
        Indices of the returns to use, in any order.

    Returns
    -------
    (CELLS, CELLS) float32 array
        Metres in the same frame, on cells of `kernels.terrain.CELL_M`. Row a covers x from
        (a - CELLS / 2) CELL_M on, column b the same in y. Where the scan does not show the ground:
        that of the nearest cell where it does, minus `kernels.terrain.ASSUMED_OFFSET_M`; NaN if
        there is none.

    Examples
    --------
    >>> x, y = np.meshgrid(np.arange(-9, 9, 0.2), np.arange(-9, 9, 0.2))
    >>> flat = np.stack([x.ravel(), y.ravel(), np.full(x.size, -2.0)])
    >>> float(ground_map_of(flat, np.arange(x.size))[64, 64])
    -2.0
    """
    lowest = np.empty((CELLS, CELLS), np.float32)
    height = np.empty((CELLS, CELLS), np.float32)
    lowest_returns(level, kept, lowest)
    remove_outliers(lowest, height)
    remove_below_nearer(height)
    known = np.isfinite(height)
    slope_filter(height)
    interpolate(height, known)
    assume_ground(height)
    return height


def shown_ground(scans: PackedScans, nth: int) -> Float64Array:
    """Middles (K, 2) of the cells where the n-th scan shows the ground; scene frame, metres.

    None where all of it lies less than `LEAST_BELOW_M` below the scanner: the hits of level beams
    on walls are no ground.

    Raises
    ------
    SceneError
        The scene's z axis is not up.
    """
    _check_level(scans)
    ground_m = scans.ground[nth]
    shown = ground_m > -0.5 * ASSUMED_OFFSET_M
    if not (ground_m[shown] < -LEAST_BELOW_M).any():
        return np.empty((0, 2))
    middles = (np.argwhere(shown) + 0.5 - CELLS // 2) * CELL_M
    return np.asarray(scans.position[nth, :2] + middles)


def nearest_scans(scans: PackedScans, xy: Float64Array) -> IntArray:
    """Index (N,) of the scan whose scanner is nearest to points (N, 2) of the scene."""
    to_scans = np.linalg.norm(xy[:, None] - scans.position[None, :, :2], axis=2)
    return np.asarray(to_scans.argmin(axis=1))


def ground_height(scans: PackedScans, xy: Float64Array, count: int = 1) -> Float64Array:
    """Height (N,) of the ground below points (N, 2) of the scene, metres.

    With a count of 1 that of the nearest scan. Where this scan does not show the ground, that of
    the nearest cell where it does; NaN if it shows none, or the point is not finite or farther
    than 1e9 m. With a larger count the median of so many nearest scans that show the ground there,
    so that ghosts below the ground in one scan do not matter; as with 1 where none shows it.

    Raises
    ------
    SceneError
        The scene's z axis is not up.
    """
    _check_level(scans)
    finite = np.asarray((np.abs(xy) <= LARGEST_M).all(axis=1))
    xy = np.where(finite[:, None], xy, 0.0)
    height_m, _ = _height_by(scans, xy, nearest_scans(scans, xy))
    if count > 1:
        shown_m = _shown_heights(scans, xy, count)
        several = np.isfinite(shown_m).any(axis=1)
        height_m[several] = np.nanmedian(shown_m[several], axis=1)
    return np.where(finite, height_m, np.nan)


def _check_level(scans: PackedScans) -> None:
    """Check that z is up: the ground of a tilted frame has no height over its x and y."""
    if not np.array_equal(scans.level_from_scene, np.eye(3)):
        raise SceneError(
            "the scanner is tilted and its scan has no pose, so that the ground has no height over"
            " x and y: add the scan with its pose, in a frame whose z axis points up."
        )


def _height_by(
    scans: PackedScans, xy: Float64Array, nth: IntArray
) -> tuple[Float64Array, BoolArray]:
    """Height (N,) of the ground by one scan for each point, and whether it is assumed there."""
    cell = np.floor((xy - scans.position[nth, :2] + BORDER_M) / CELL_M) + CELLS // 2
    inside = ((cell >= 0) & (cell < CELLS)).all(axis=1)
    a, b = np.clip(cell, 0, CELLS - 1).astype(np.int64).T
    ground_m = scans.ground[nth, a, b].astype(np.float64)
    assumed = ground_m < -0.5 * ASSUMED_OFFSET_M
    ground_m += np.where(assumed, ASSUMED_OFFSET_M, 0.0)
    return scans.position[nth, 2] + ground_m, assumed | ~inside


def _shown_heights(scans: PackedScans, xy: Float64Array, count: int) -> Float64Array:
    """(N, count) heights by the nearest scans that show the ground; NaN where fewer do."""
    to_scans = np.linalg.norm(xy[:, None] - scans.position[None, :, :2], axis=2)
    order = np.argsort(to_scans, axis=1, kind="stable")
    found, known = np.full((len(xy), count), np.nan), np.zeros(len(xy), np.int64)
    for rank in range(order.shape[1]):
        open_rows = np.flatnonzero(known < count)
        height_m, assumed = _height_by(scans, xy[open_rows], order[open_rows, rank])
        shown = open_rows[~assumed & np.isfinite(height_m)]
        found[shown, known[shown]] = height_m[~assumed & np.isfinite(height_m)]
        known[shown] += 1
    return found
