"""Where scans show the ground, and how high it is: maps of a few cells, by numbers on paper."""

import numpy as np
import pytest
from made_scans import street_scan

from intervis.sight import Scene
from intervis.sight.ground_map import ground_height, nearest_scans, shown_ground
from intervis.sight.kernels.terrain import CELLS

ASSUMED_M = -1000.0
"""Is added where a scan does not show the ground."""
POSITION = np.array([[10.5, -3.25, 2.0], [90.0, 7.0, 1.0], [-500.0, 0.0, 0.0]])
SHOWN = {(64, 64): -1.75, (70, 50): -1.25, (3, 120): -2.5}


@pytest.fixture(scope="module")
def scans():
    """Three scans: of three cells of ground, of level hits on walls, and of nothing."""
    ground = np.full((3, CELLS, CELLS), -1.5 + ASSUMED_M, np.float32)
    for cell, height_m in SHOWN.items():
        ground[0][cell] = height_m
    ground[1] = -0.125
    ground[2] = np.nan
    packed = Scene.from_scan(street_scan(beams=8, step_deg=4.0)).packed_scans()
    return packed._replace(ground=ground, position=POSITION)


def test_ground_is_shown_in_the_cells_with_returns_alone(scans):
    """Cell 64 begins at the scanner; cells are 1 m wide."""
    expected = {(10.5 + a - 63.5, -3.25 + b - 63.5) for a, b in SHOWN}
    assert set(map(tuple, shown_ground(scans, 0).tolist())) == expected
    for nth in (1, 2):
        assert shown_ground(scans, nth).shape == (0, 2)


def test_the_height_is_that_of_the_nearest_scan(scans):
    xy = np.array(
        [
            [11.0, -3.0],  # cell (64, 64)
            [17.49, -17.1],  # cell (70, 50)
            [-50.0, 53.0],  # cell (3, 120)
            [12.0, -3.0],  # not shown: that of the nearest cell where it is
            [90.0, 500.0],  # beyond the map: its last cell
            [-500.0, 0.0],
            [np.nan, 0.0],
            [np.inf, 0.0],
        ]
    )
    assert nearest_scans(scans, xy[:6]).tolist() == [0, 0, 0, 0, 1, 2]
    expected = [0.25, 0.75, -0.5, 0.5, 0.875, np.nan, np.nan, np.nan]
    np.testing.assert_allclose(ground_height(scans, xy), expected, atol=1e-4)
