"""Exact voxels: which voxels of a grid hold a surface of a known world, and which a scanner sees.

The world's triangles decide, voxel by voxel: a voxel *holds* a surface where one of the triangles
overlaps its cube (separating axes, Akenine-Moeller 2001). It is *observable* for a scanner where

- its centre lies between the lowest and the highest beam, in a direction in which a ray hits
  something within the scanner's range; and
- that ray reaches the centre, or ends inside the voxel.

A free voxel is right if it holds no surface, an occupied one if it does. Returns have noise: with a
margin, an occupied voxel is right if a surface passes within the margin of it, and a free one if
its cube without a rim of that width holds none.
"""

from dataclasses import dataclass

import numpy as np

from intervis.arrays import BoolArray, Float64Array
from intervis.lab.worlds.ray_casting import RayCaster
from intervis.lab.worlds.scanner import Scanner
from intervis.transform import inverse, transform
from intervis.uses.voxels.carving import CarvedGrid
from intervis.uses.voxels.voxel_grid import VoxelGrid

MARGIN_M = 0.05
"""Two and a half times the range noise of the simulated scanner."""


@dataclass(frozen=True)
class VoxelScore:
    """How often a carved grid is right; shares from 0 to 1.

    Attributes
    ----------
    free, occupied : float
        Of the voxels with this state, the share that is right to the voxel.
    free_within, occupied_within : float
        The same within `MARGIN_M`.
    claimed : float
        Of the observable voxels, the share that is free or occupied.
    observable : int
        Number of observable voxels.
    """

    free: float
    occupied: float
    free_within: float
    occupied_within: float
    claimed: float
    observable: int


def score_voxels(
    carved: CarvedGrid, triangles: Float64Array, scanner: Scanner, pose: Float64Array
) -> VoxelScore:
    """Score a grid in the scanner's frame against the world.

    Parameters
    ----------
    carved : CarvedGrid
        In the frame of the scanner.
    triangles : (T, 3, 3) float64 array
        World frame, metres, at the time of the scan.
    scanner : Scanner
    pose : (4, 4) float64 array
        World from scanner.
    """
    grid, local = carved.grid, transform(inverse(pose), triangles)
    distance, half = surface_distance(grid, local), 0.5 * grid.cell_m
    exact, grown, shrunk = (distance <= half + m for m in (0.0, MARGIN_M, -MARGIN_M))
    seen = observable(grid, RayCaster(local), scanner)
    return VoxelScore(
        float(np.mean(~exact[carved.free])),
        float(np.mean(exact[carved.occupied])),
        float(np.mean(~shrunk[carved.free])),
        float(np.mean(grown[carved.occupied])),
        float(np.mean((carved.free | carved.occupied)[seen])),
        int(seen.sum()),
    )


def observable(grid: VoxelGrid, caster: RayCaster, scanner: Scanner) -> BoolArray:
    """Which voxels (I, J, K) a scanner at the origin can see."""
    index = np.indices(grid.shape).reshape(3, -1).T
    centre = grid.centre_of(index)
    range_m = np.linalg.norm(centre, axis=1)
    direction = centre / np.maximum(range_m, 1e-9)[:, None]
    elevation_deg = np.degrees(np.arcsin(direction[:, 2]))
    lowest, highest = min(scanner.elevations_deg), max(scanner.elevations_deg)
    aimed = (elevation_deg >= lowest) & (elevation_deg <= highest) & (range_m > scanner.nearest_m)
    seen = np.zeros(len(index), np.bool_)
    aimed_at = np.flatnonzero(aimed)
    hit_m, _ = caster.closest(np.zeros(3), direction[aimed_at], scanner.farthest_m)
    returns = np.isfinite(hit_m)
    aimed_at, hit_m = aimed_at[returns], hit_m[returns]
    ends_in, _ = grid.index_of(direction[aimed_at] * hit_m[:, None])
    inside = (ends_in == index[aimed_at]).all(axis=1)
    seen[aimed_at] = inside | (hit_m >= range_m[aimed_at])
    return seen.reshape(grid.shape)


def surface_distance(grid: VoxelGrid, triangles: Float64Array) -> Float64Array:
    """Half the edge of the smallest cube around each centre (I, J, K) that meets a triangle.

    A voxel holds a surface where this is at most `grid.cell_m / 2`. Distances beyond `MARGIN_M`
    outside of the voxel are infinite.

    Examples
    --------
    >>> floor = np.array([[[-9.0, -9, 0.36], [9, -9, 0.36], [0, 9, 0.36]]])
    >>> surface_distance(VoxelGrid([0, 0, 0], 0.2, (1, 1, 3)), floor).round(2)
    array([[[ inf, 0.06, 0.14]]])
    """
    found = np.full(grid.shape, np.inf)
    reach = 0.5 * grid.cell_m + MARGIN_M
    low, high = triangles.min(axis=1) - MARGIN_M, triangles.max(axis=1) + MARGIN_M
    near = ((high >= grid.corner) & (low <= grid.upper)).all(axis=1)
    for corners, least, most in zip(triangles[near], low[near], high[near], strict=True):
        first = np.maximum(np.floor((least - grid.corner) / grid.cell_m).astype(int), 0)
        last = np.floor((most - grid.corner) / grid.cell_m).astype(int) + 1
        box = tuple(slice(a, min(b, n)) for a, b, n in zip(first, last, grid.shape, strict=True))
        counts = [part.stop - part.start for part in box]
        centre = grid.centre_of(np.moveaxis(np.indices(counts), 0, -1) + first)
        distance = _cube_distance(corners, centre)
        found[box] = np.minimum(found[box], np.where(distance <= reach, distance, np.inf))
    return found


def _cube_distance(corners: Float64Array, centre: Float64Array) -> Float64Array:
    """Half edges of the smallest cubes around centres (..., 3) that meet a triangle (3, 3).

    Two convex bodies are apart where some axis separates them: a normal of the cube or of the
    triangle, or a product of two edges.
    """
    edges = np.roll(corners, -1, axis=0) - corners
    axes = np.vstack([np.cross(edges[0], edges[1]), np.eye(3)])
    axes = np.vstack([axes, *(np.cross(np.eye(3), edge) for edge in edges)])
    lengths = np.abs(axes).sum(axis=1)
    axes = axes[lengths > 1e-12] / lengths[lengths > 1e-12, None]
    spread = corners @ axes.T
    middle = centre @ axes.T
    beyond = np.maximum(spread.min(axis=0) - middle, middle - spread.max(axis=0))
    return np.asarray(np.maximum(beyond.max(axis=-1), 0.0))
