"""Lines along the surface that they end on: a round wall of 10 m, by numbers on paper."""

import numpy as np
import pytest

from intervis.sight.answers import sum_lines
from intervis.sight.kernels.packed_scans import PackedScans
from intervis.sight.kernels.terrain import CELLS
from intervis.sight.reference import reference_result

UNITS_PER_M = 500


def round_wall(ground_m):
    """A scan of a wall 10 m around the scanner, in all its directions, over level ground."""
    columns, rows = 64, 32
    return PackedScans(
        pixels=np.full(columns * rows, 10 * UNITS_PER_M, np.int16),
        unit_m=np.array([1.0 / UNITS_PER_M]),
        offset=np.array([0]),
        columns=np.array([columns]),
        rows=np.array([rows]),
        elevation_from=np.array([-0.5]),
        rows_per_unit=np.array([rows - 1.0]),
        sensor_from_scene=np.eye(4)[None, :3].copy(),
        position=np.zeros((1, 3)),
        ground=np.full((1, CELLS, CELLS), ground_m, np.float32),
        level_from_scene=np.eye(3),
        age_cost_m=np.zeros(1),
        time_offset_s=np.full(1, np.nan),
    )


@pytest.mark.parametrize(("below_m", "leaves"), [(-1.0, True), (0.4, True), (0.6, False)])
def test_a_line_leaves_a_surface_unless_it_runs_below_ground(below_m, leaves):
    """The map of the ground may be wrong by half a metre.

    The line touches the wall in its middle, and lies 0.1 m behind it at its ends.
    """
    scans = round_wall(-1.0 + below_m)
    a, b = np.array([10.0, -1.5, -1.0]), np.array([10.0, 1.5, -1.0])
    sums, expected = sum_lines(scans, a[None], b[None]), reference_result(scans, a, b)
    for surface, free in ((sums.surface[0], sums.free[0]), (expected.surface, expected.free)):
        assert (surface == 0.0) == leaves
        assert (free > 0.0) == leaves


def test_a_line_that_runs_behind_the_surface_does_not_leave_it():
    """0.3 m behind it at its ends: farther than the surface itself."""
    scans = round_wall(-1.7)
    a, b = np.array([10.3, -1.5, -1.0]), np.array([10.3, 1.5, -1.0])
    assert sum_lines(scans, a[None], b[None]).surface[0] > 0.0
    assert reference_result(scans, a, b).surface > 0.0
