"""Up: the direction against gravity, in the frame of a scan that comes without a pose.

Heights above the ground need to know where up is. A pose says so: the scene's z axis. Without one
the scanner is taken to stand upright, unless the scan shows otherwise: then the ground is the
largest plane that the scanner stands above with next to nothing behind it, and up is its normal. A
wall is such a plane too, so that a tilt of 70 to 140 degrees is not looked for; nor is one of less
than 10 degrees, which may be a road that rises.

The numbers were chosen on generated worlds of the seeds 2 and 3 (`intervis.lab.truth.cells`);
`tests/sight/test_gravity.py` judges them on other seeds and on real tilted scanners.
"""

import numpy as np
from scipy.spatial import cKDTree

from intervis.arrays import BoolArray, Float64Array, IntArray
from intervis.sight.ground_map import LEAST_BELOW_M
from intervis.sight.kernels.terrain import CELL_M, CELLS, MAX_RISE, lowest_returns
from intervis.sight.projected_scan import ProjectedScan

REACH_M = 30.0
"""Returns farther away are left out: the ground bends."""
LEVEL_SHARE, LEAST_PAIRS = 0.45, 20
"""An upright scanner sees neighbouring cells of about one height below itself: so large a share of
the pairs of cells, of so many at least."""
LEAST_TILT_DEG, WALLS_DEG = 10.0, (70.0, 140.0)
"""Tilts that are not told from a rising road, and from walls and ceilings."""
FINE_M, VOXEL_M = 0.05, 0.5
"""Returns are thinned to the mean of each voxel, over its fine cells, so that neither copies nor
the order of the returns matter."""
NEIGHBOURS, NEIGHBOURS_WITHIN_M = 10, 2.5
FLATNESS, LEAST_SPREAD_M2 = 0.01, 0.05
"""Neighbours lie on a plane if their variance along its normal is so small a fraction of the next
larger one, and this is not smaller than that."""
CANDIDATES = 150
ON_PLANE_M, BEHIND_M = 0.2, 0.5
BEHIND_COST, LEAST_SUPPORT, NEARLY_BEST = 2.0, 60, 0.6
"""A plane is supported by the voxels on it, less so many for each one behind it. Of the planes that
are supported nearly as well as the best one, the one nearest to upright is the ground."""
REFINEMENTS = 5


def up_of_scan(scan: ProjectedScan) -> Float64Array | None:
    """The direction of up in the frame of a scan whose scanner is tilted.

    Parameters
    ----------
    scan : ProjectedScan
        Its level coordinates are not read.

    Returns
    -------
    (3,) float64 array or None
        Unit vector. None: the scanner stands upright, or nothing says otherwise.

    Examples
    --------
    A scanner 2 m above level ground, upright and turned by 45 degrees about its x axis:

    >>> x, y = np.meshgrid(np.arange(-9, 9, 0.2), np.arange(-9, 9, 0.2))
    >>> ground = np.stack([x.ravel(), y.ravel(), np.full(x.size, -2.0)], axis=1)
    >>> from intervis.sight.projected_scan import project_scan
    >>> up_of_scan(project_scan(ground)) is None
    True
    >>> s = np.sqrt(0.5)
    >>> turned = ground @ np.array([[1, 0, 0], [0, s, s], [0, -s, s]])
    >>> up_of_scan(project_scan(turned)).round(3)
    array([-0.   , -0.707,  0.707])
    """
    if _shows_level_ground(scan.xyz):
        return None
    voxels = _thinned(scan)
    if len(voxels) < LEAST_SUPPORT:
        return None
    ground = _ground_plane(voxels)
    if ground is None:
        return None
    up = _refined(voxels, *ground)
    return up if up[2] < np.cos(np.radians(LEAST_TILT_DEG)) else None


def tilt_of(up: Float64Array) -> float:
    """Angle between a unit vector and the z axis, degrees; 0 for z itself.

    Examples
    --------
    >>> tilt_of(np.array([0.0, 0.0, 1.0])), tilt_of(np.array([0.0, -1.0, 0.0]))
    (0.0, 90.0)
    """
    return float(np.degrees(np.arctan2(np.hypot(up[0], up[1]), up[2])))


def level_rotation(up: Float64Array | None) -> Float64Array:
    """Rotation (3, 3) that takes the unit vector `up` to z, and x to the x-z plane.

    None stands for z itself.

    Examples
    --------
    >>> np.allclose(level_rotation(np.array([0.6, 0.0, 0.8])) @ [0.6, 0.0, 0.8], [0, 0, 1])
    True
    """
    if up is None:
        return np.eye(3)
    axis = np.eye(3)[0 if abs(up[0]) < 0.9 else 2]
    x = axis - (axis @ up) * up
    x /= np.linalg.norm(x)
    return np.array([x, np.cross(up, x), up])


def _shows_level_ground(xyz: Float64Array) -> bool:
    """Whether cells of the lowest of returns (3, N) lie level with others, below the scanner."""
    lowest = np.empty((CELLS, CELLS), np.float32)
    lowest_returns(xyz, np.arange(xyz.shape[1]), lowest)
    half, reach = CELLS // 2, int(REACH_M / CELL_M)
    near = lowest[half - reach : half + reach, half - reach : half + reach]
    pairs, level = 0, 0
    for one, other in ((near[1:], near[:-1]), (near[:, 1:], near[:, :-1])):
        known = np.isfinite(one) & np.isfinite(other)
        a, b = one[known], other[known]
        pairs += len(a)
        below = np.maximum(a, b) < -LEAST_BELOW_M
        level += int(np.count_nonzero(below & (np.abs(a - b) < MAX_RISE * CELL_M)))
    return pairs >= LEAST_PAIRS and level >= LEVEL_SHARE * pairs


def _thinned(scan: ProjectedScan) -> Float64Array:
    """(M, 3) mean of each voxel over its fine cells, of the points within `REACH_M`."""
    near = scan.xyz[:, (scan.range_m > VOXEL_M) & (scan.range_m < REACH_M)].T
    fine = FINE_M * (_distinct(np.floor(near / FINE_M).astype(np.int64)) + 0.5)
    key, index = np.unique(_keys(np.floor(fine / VOXEL_M).astype(np.int64)), return_inverse=True)
    count = np.bincount(index, minlength=len(key))
    sums = [np.bincount(index, fine[:, axis], len(key)) for axis in range(3)]
    return np.stack(sums, axis=1) / np.maximum(count, 1)[:, None]


_KEY_HALF = 1 << 12


def _keys(cells: IntArray) -> IntArray:
    """One number for each cell (M, 3) of whole numbers."""
    a, b, c = (cells + _KEY_HALF).T
    return np.asarray((a * 2 * _KEY_HALF + b) * 2 * _KEY_HALF + c)


def _distinct(cells: IntArray) -> IntArray:
    """The distinct cells (K, 3), in ascending order of their keys."""
    key = np.unique(_keys(cells))
    rest, c = np.divmod(key, 2 * _KEY_HALF)
    return np.stack([*np.divmod(rest, 2 * _KEY_HALF), c], axis=1) - _KEY_HALF


def _ground_plane(voxels: Float64Array) -> tuple[Float64Array, Float64Array] | None:
    """A point and the normal, towards the scanner, of the plane that is the ground."""
    centre, normal = _local_planes(voxels)
    behind, wall = np.cos(np.radians(WALLS_DEG[1])), np.cos(np.radians(WALLS_DEG[0]))
    possible = np.flatnonzero((normal[:, 2] > wall) | (normal[:, 2] < behind))
    chosen = possible[:: max(1, len(possible) // CANDIDATES)]
    if len(chosen) == 0:
        return None
    centre, normal = centre[chosen], normal[chosen]
    ahead_m = voxels @ normal.T - np.einsum("ki,ki->k", centre, normal)
    on = np.count_nonzero(np.abs(ahead_m) < ON_PLANE_M, axis=0)
    support = on - BEHIND_COST * np.count_nonzero(ahead_m < -BEHIND_M, axis=0)
    if support.max() < LEAST_SUPPORT:
        return None
    best = np.flatnonzero(support >= NEARLY_BEST * support.max())
    ground = best[np.argmax(normal[best, 2])]
    return centre[ground], normal[ground]


def _local_planes(voxels: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Centres and normals (P, 3), towards the scanner, of neighbours on a plane below it."""
    distance, neighbour = cKDTree(voxels).query(
        voxels, NEIGHBOURS, distance_upper_bound=NEIGHBOURS_WITHIN_M
    )
    around = voxels[neighbour[np.isfinite(distance[:, -1])]]
    centre = around.mean(axis=1)
    offset = around - centre[:, None]
    variance, axes = np.linalg.eigh(np.einsum("nki,nkj->nij", offset, offset) / NEIGHBOURS)
    flat: BoolArray = variance[:, 0] < FLATNESS * variance[:, 1]
    flat &= variance[:, 1] > LEAST_SPREAD_M2
    centre, normal = centre[flat], axes[flat, :, 0]
    to_scanner_m = -np.einsum("pi,pi->p", normal, centre)
    below = np.abs(to_scanner_m) > LEAST_BELOW_M
    return centre[below], (normal * np.sign(to_scanner_m)[:, None])[below]


def _refined(voxels: Float64Array, centre: Float64Array, normal: Float64Array) -> Float64Array:
    """The normal of the plane through all voxels near a plane."""
    for _ in range(REFINEMENTS):
        on = voxels[np.abs((voxels - centre) @ normal) < ON_PLANE_M]
        centre = on.mean(axis=0)
        fitted = np.linalg.eigh(np.cov((on - centre).T))[1][:, 0]
        normal = fitted if fitted @ centre < 0.0 else -fitted
    return normal
