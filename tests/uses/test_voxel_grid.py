"""Grids of voxels: indices, centres, and sizes that are refused before memory is taken."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from intervis.errors import PointsError, SettingsError
from intervis.uses.voxels.voxel_grid import MOST_VOXELS, VoxelGrid

SIDES = st.tuples(*[st.integers(1, 40)] * 3)


@given(SIDES, st.floats(0.05, 3.0), st.integers(0, 2**32 - 1))
def test_the_centre_of_a_voxel_lies_in_it(shape, cell_m, seed) -> None:
    rng = np.random.default_rng(seed)
    grid = VoxelGrid(rng.uniform(-50, 50, 3), cell_m, shape)
    index = rng.integers(0, shape, (20, 3))
    found, inside = grid.index_of(grid.centre_of(index))
    assert inside.all()
    assert np.array_equal(found, index)


def test_points_on_the_border_and_outside() -> None:
    grid = VoxelGrid([0.0, -1.0, 0.0], 0.5, (2, 4, 1))
    points = np.array([[0, -1, 0], [0.5, -1, 0], [1.0, 0, 0], [0.2, 0.99, 0.49], [0.2, 0, -0.01]])
    index, inside = grid.index_of(points)
    assert inside.tolist() == [True, True, False, True, False]
    assert index[inside].tolist() == [[0, 0, 0], [1, 0, 0], [0, 3, 0]]
    assert grid.upper.tolist() == [1.0, 1.0, 0.5]
    occupied = grid.occupied_by(points)
    assert np.argwhere(occupied).tolist() == [[0, 0, 0], [0, 3, 0], [1, 0, 0]]


def test_far_points_do_not_overflow() -> None:
    index, inside = VoxelGrid([0, 0, 0], 0.1, (5, 5, 5)).index_of(np.array([[1e30, -1e30, 0.0]]))
    assert not inside.any()
    assert index.tolist() == [[5, -1, 0]]


@pytest.mark.parametrize(
    ("corner", "cell_m", "shape", "message"),
    [
        ([0, 0, 0], 0.0, (4, 4, 4), "cell_m must be a positive length"),
        ([0, 0, 0], np.nan, (4, 4, 4), "cell_m must be a finite number"),
        ([0, 0, 0], 0.2, (4, 0, 4), "three whole numbers"),
        ([0, 0, 0], 0.2, (4, 4), "three whole numbers"),
        ([0, 0, 0], 0.2, (4.5, 4, 4), "three whole numbers"),
        ([0, 0, 0], 0.2, (True, 4, 4), "three whole numbers"),
        ([0, 0, 0], 0.2, (4096, 4096, 100), r"1,677,721,600, which would take 40.3 GB"),
    ],
)
def test_a_grid_that_makes_no_sense_is_told(corner, cell_m, shape, message) -> None:
    with pytest.raises(SettingsError, match=message):
        VoxelGrid(corner, cell_m, shape)


def test_a_corner_is_three_numbers_and_the_largest_grid_is_allowed() -> None:
    with pytest.raises(PointsError, match="corner must be three"):
        VoxelGrid([0, 0], 0.2, (4, 4, 4))
    assert VoxelGrid([0, 0, 0], 0.1, (MOST_VOXELS, 1, 1)).size == MOST_VOXELS
