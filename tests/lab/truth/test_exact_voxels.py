"""Exact voxels: triangles against cubes by dense samples, and carved grids in a known world."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

pytest.importorskip("embreex", reason="embreex, which casts the rays, is not installed")

from intervis.lab.truth.exact_voxels import (
    MARGIN_M,
    observable,
    score_voxels,
    surface_distance,
)
from intervis.lab.worlds import RayCaster, Scanner, build_street
from intervis.transform import inverse, transform
from intervis.uses.voxels.carving import Carver
from intervis.uses.voxels.voxel_grid import VoxelGrid


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=12)
def test_the_smallest_cube_that_meets_a_triangle(seed) -> None:
    rng = np.random.default_rng(seed)
    grid = VoxelGrid([-1.0, -1.0, -1.0], 0.5, (4, 4, 3))
    triangle = rng.uniform(-1.6, 1.6, (3, 3))
    found = surface_distance(grid, triangle[None])
    samples = np.vstack([rng.dirichlet(np.ones(3), 20_000) @ triangle, triangle])
    for voxel in np.ndindex(grid.shape):
        sampled = np.abs(samples - grid.centre_of(voxel)).max(axis=1).min()
        if np.isfinite(found[voxel]):
            assert found[voxel] - 1e-9 <= sampled <= found[voxel] + 0.08  # samples lie apart
        else:
            assert sampled > 0.25 + MARGIN_M


def test_what_a_scanner_can_see_on_paper() -> None:
    """A wall of one metre at x = 4, and a backdrop at x = 9."""
    wall = [[4.1, -0.5, -2], [4.1, 0.5, -2], [4.1, 0.5, 2], [4.1, -0.5, 2]]
    back = [[9.1, -9, -9], [9.1, 9, -9], [9.1, 9, 9], [9.1, -9, 9]]
    corners = np.array([[quad[0], quad[n], quad[n + 1]] for quad in (wall, back) for n in (1, 2)])
    grid = VoxelGrid([2.0, -0.1, -0.1], 0.2, (50, 1, 1))
    scanner = Scanner(elevations_deg=(10.0, -10.0), roof=None, nearest_m=1.0)
    seen = observable(grid, RayCaster(corners), scanner)[:, 0, 0]
    assert seen.tolist() == [True] * 11 + [False] * 39  # up to the voxel of the wall
    beside = VoxelGrid([2.0, 1.9, -0.1], 0.2, (50, 1, 1))
    assert observable(beside, RayCaster(corners), scanner)[:, 0, 0].sum() == 36  # to the backdrop
    above = VoxelGrid([2.0, -0.1, 3.0], 0.2, (5, 1, 1))
    assert not observable(above, RayCaster(corners), scanner).any()


def test_a_carved_street_is_right_where_it_claims_something() -> None:
    """On a street that none of the rules was chosen on."""
    world, scanner = build_street(7), Scanner()
    snapshot, pose = world.at(3.0), world.vehicle_pose_at(3.0)
    points, _ = scanner.scan(snapshot, pose, np.random.default_rng(0))
    grid = VoxelGrid([4.0, -6.0, -2.0], 0.2, (50, 60, 20))
    carver = Carver(grid)
    carver.add(points, now=True)
    carved = carver.result()
    score = score_voxels(carved, snapshot.triangles, scanner, pose)
    assert score.observable > 10_000
    assert score.free_within > 0.98
    assert score.occupied_within > 0.98
    assert score.claimed > 0.95
    exact = surface_distance(grid, transform(inverse(pose), snapshot.triangles)) <= 0.1
    assert score.occupied == pytest.approx(np.mean(exact[carved.state == 1]))
