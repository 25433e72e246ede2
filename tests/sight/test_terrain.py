"""Stages of the ground map on small maps, by numbers on paper."""

import numpy as np
import pytest

from intervis.sight.kernels import terrain

CELLS = terrain.CELLS
MIDDLE = 64
"""Cell of the sensor: the map reaches from -64 m to 64 m."""


def in_python(kernel):
    """A kernel as it is written, not compiled: an index too far is an error."""
    return getattr(kernel, "py_func", kernel)


def empty_map():
    return np.full((CELLS, CELLS), np.inf, np.float32)


def lowest_of(*points):
    """Lowest returns of each cell."""
    least = np.empty((CELLS, CELLS), np.float32)
    level = np.array(points, float).T.copy()
    in_python(terrain.lowest_returns)(level, np.arange(len(points)), least)
    return least


@pytest.mark.parametrize(
    ("x", "y", "cell"),
    [
        (-64.0, 0.0, (0, 64)),
        (63.99, -64.0, (127, 0)),
        (-0.01, 63.99, (63, 127)),
        (0.0, -0.01, (64, 63)),
        (64.0, 0.0, None),
        (0.0, 64.0, None),
        (-65.0, 0.0, None),
        (0.0, -65.0, None),
        (500.0, 0.0, None),
        (0.0, -500.0, None),
    ],
)
def test_a_return_counts_in_its_cell_and_beyond_the_map_in_none(x, y, cell):
    least = lowest_of(*[[x, y, z] for z in (-1.0, -2.0, -4.0, -3.0)])
    expected = empty_map()
    if cell:
        expected[cell] = -2.0  # the third lowest of four
    assert np.array_equal(least, expected)


@pytest.mark.parametrize("order", [[1, 2, 3, 4], [4, 3, 2, 1], [2, 1, 4, 3], [3, 4, 1, 2]])
def test_the_third_lowest_of_four_returns_in_any_order(order):
    assert lowest_of(*[[0.5, 0.5, z] for z in order])[MIDDLE, MIDDLE] == 3.0
    assert np.isinf(lowest_of(*[[0.5, 0.5, z] for z in order[:3]])).all(), "three are too few"


def kept_cells(cells):
    """Which of some cells, {(row, column): height}, are no outliers."""
    least, kept = empty_map(), np.empty((CELLS, CELLS), np.float32)
    for cell, height in cells.items():
        least[cell] = height
    in_python(terrain.remove_outliers)(least, kept)
    assert (np.isinf(kept) | (kept == least)).all()
    return {cell for cell in cells if np.isfinite(kept[cell])}


def test_a_cell_needs_two_known_neighbours():
    pair = {(40, 40): -1.0, (41, 40): -1.0}
    assert kept_cells(pair) == set()
    assert kept_cells(pair | {(40, 42): -1.0}) == set(pair) | {(40, 42)}


def test_neighbours_are_up_to_two_cells_away_on_all_sides():
    for corner in ((38, 38), (38, 42), (42, 38), (42, 42)):
        cells = {(40, 40): -1.0, corner: -1.0, (40, 41): -1.0}
        assert (40, 40) in kept_cells(cells)
        farther = tuple(2 * c - 40 - (c - 40) // 2 for c in corner)  # three cells away
        assert (40, 40) not in kept_cells({(40, 40): -1.0, farther: -1.0, (40, 41): -1.0})
    for away, near in ((2, True), (3, False), (20, False)):
        for other in ((40 - away, 40), (40 + away, 40), (40, 40 - away), (40, 40 + away)):
            cells = {(40, 40): -1.0, other: -1.0, (41, 41): -1.0}
            assert ((40, 40) in kept_cells(cells)) == near, other


def test_the_borders_of_the_map_are_no_neighbours_of_each_other():
    assert kept_cells({(0, 0): -1.0, (127, 0): -1.0, (0, 127): -1.0, (126, 127): -1.0}) == set()
    corner = {(0, 0): -1.0, (1, 1): -1.0, (2, 2): -1.0}
    assert kept_cells(corner) == set(corner)
    corner = {(127, 127): -1.0, (126, 126): -1.0, (125, 125): -1.0}
    assert kept_cells(corner) == set(corner)


def test_a_cell_stays_where_a_quarter_of_the_known_cells_is_as_low():
    around = [(39, 39), (39, 40), (39, 41), (40, 39), (40, 41), (41, 40)]
    for higher, stays in ((3, True), (4, False)):  # itself and three others: one of four
        cells = {(40, 40): -4.0} | dict.fromkeys(around[:higher], -1.0)
        assert ((40, 40) in kept_cells(cells)) == stays
    for rise_m, stays in ((0.34, True), (0.36, False)):
        cells = {(40, 40): -4.0} | dict.fromkeys(around, -4.0 + rise_m)
        assert ((40, 40) in kept_cells(cells)) == stays


def is_dropped(cell, height, in_front):
    """Whether a cell is dropped that lies behind other cells, {(row, column): height}."""
    seen = empty_map()
    seen[cell] = height
    for other, other_height in in_front.items():
        seen[other] = other_height
    in_python(terrain.remove_below_nearer)(seen)
    return bool(np.isinf(seen[cell]))


@pytest.mark.parametrize("toward", [(1, 0), (-1, 0), (0, 1), (0, -1)])
def test_ground_below_the_line_of_sight_over_the_cells_in_front_is_dropped(toward):
    """A cell 8 m away at -4 m: the line to it is at -0.5 m for each metre from the sensor."""

    def place(away):
        return MIDDLE + away * toward[0], MIDDLE + away * toward[1]

    cell, height = place(8), -4.0
    for away in range(2, 8):
        assert is_dropped(cell, height, {place(away): -0.5 * away + 0.36}), away
        assert not is_dropped(cell, height, {place(away): -0.5 * away + 0.34}), away
    assert not is_dropped(cell, height, {place(1): 9.0}), "six cells in front are compared"
    assert not is_dropped(cell, height, {}), "nothing is known in front of it"
    above, below = {place(7): 0.0, place(6): 0.0}, {place(5): -9.0, place(4): -9.0}
    assert is_dropped(cell, height, above | below), "half of them"
    assert not is_dropped(cell, height, {place(7): 0.0} | below)


def test_cells_beside_the_sensor_have_nothing_in_front():
    for cell in ((65, 64), (64, 63), (65, 65)):
        assert not is_dropped(cell, -4.0, {(64, 64): 9.0})
    assert is_dropped((66, 64), -4.0, {(64, 64): 9.0}), "two cells away"
    assert is_dropped((66, 64), -4.0, {(65, 64): 9.0})


def test_in_front_of_a_cell_means_on_the_way_to_the_sensor():
    """(3, 4) m away: 5 m. One metre nearer is (2.4, 3.2), then (1.8, 2.4), (1.2, 1.6) ..."""
    way = [(2, 3), (2, 2), (1, 2), (1, 1)]  # the cells nearest to those places
    for n, (a, b) in enumerate(way, start=1):
        line_m = -5.0 * (1.0 - n / 5.0)
        for signs in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
            cell = MIDDLE + 3 * signs[0], MIDDLE + 4 * signs[1]
            other = MIDDLE + a * signs[0], MIDDLE + b * signs[1]
            assert is_dropped(cell, -5.0, {other: line_m + 0.4})
            assert not is_dropped(cell, -5.0, {other: line_m + 0.3})
    assert not is_dropped((MIDDLE + 3, MIDDLE + 4), -5.0, {(MIDDLE + 3, MIDDLE + 3): 9.0})


@pytest.mark.parametrize("low", [(0, 0), (127, 127), (0, 127), (127, 0), (40, 90)])
def test_one_low_cell_lowers_all_others_by_its_cone(low):
    height = np.full((CELLS, CELLS), 30.0, np.float32)
    height[low] = 0.0
    terrain.slope_filter(height)
    rows, columns = np.indices((CELLS, CELLS))
    cone = 0.15 * (np.abs(rows - low[0]) + np.abs(columns - low[1]))
    np.testing.assert_allclose(height, np.minimum(cone, 30.0), atol=1e-3)


def filled_map(cells):
    """The map after interpolation between some known cells."""
    height = np.full((CELLS, CELLS), 99.0, np.float32)
    known = np.zeros((CELLS, CELLS), bool)
    for cell, value in cells.items():
        height[cell], known[cell] = value, True
    in_python(terrain.interpolate)(height, known)
    return {
        (int(a), int(b)): pytest.approx(float(height[a, b]))
        for a, b in np.argwhere(np.isfinite(height))
    }


def test_ground_is_interpolated_over_seven_unknown_cells():
    ends = {(20, 30): 1.0, (28, 30): 5.0}
    between = {(20 + k, 30): 1.0 + 0.5 * k for k in range(9)}
    assert filled_map(ends) == between
    assert filled_map({(b, a): z for (a, b), z in ends.items()}) == {
        (b, a): z for (a, b), z in between.items()
    }
    assert filled_map({(20, 30): 1.0, (29, 30): 5.0}) == {(20, 30): 1.0, (29, 30): 5.0}
    assert filled_map({(20, 30): 1.0, (21, 30): 5.0}) == {(20, 30): 1.0, (21, 30): 5.0}


@pytest.mark.parametrize("row", [1, 126])
def test_the_outermost_inner_rows_are_interpolated_along_themselves(row):
    ends, between = {(20, row): 1.0, (23, row): 4.0}, {(21, row): 2.0, (22, row): 3.0}
    assert filled_map(ends) == ends | between
    turned = {(b, a): z for (a, b), z in (ends | between).items()}
    assert filled_map({(b, a): z for (a, b), z in ends.items()}) == turned


def test_where_both_axes_could_fill_a_cell_the_x_axis_does():
    found = filled_map({(20, 30): 1.0, (22, 30): 3.0, (21, 29): 7.0, (21, 31): 9.0})
    assert found[21, 30] == 2.0


def test_known_cells_of_the_border_are_not_used():
    inner = {(1, 60): 1.0, (2, 60): 1.0, (126, 60): 4.0, (60, 1): 5.0, (60, 126): 6.0}
    border = {(0, 60): 3.0, (127, 60): 3.0, (60, 0): 3.0, (60, 127): 3.0, (0, 0): 3.0}
    assert filled_map(inner | border) == inner


def assumed(cells):
    """The whole map after assumptions around some known cells, {(row, column): height}."""
    height = np.full((CELLS, CELLS), np.nan, np.float32)
    for cell, value in cells.items():
        height[cell] = value
    in_python(terrain.assume_ground)(height)
    return height


@pytest.mark.parametrize("cell", [(0, 0), (127, 127), (0, 127), (127, 0), (40, 90)])
def test_one_known_cell_is_the_assumption_of_all_others(cell):
    height = assumed({cell: -2.0})
    assert height[cell] == -2.0
    height[cell] = -1002.0
    assert (height == -1002.0).all()


def test_without_a_known_cell_nothing_is_assumed():
    assert np.isnan(assumed({})).all()


def test_a_cell_takes_the_height_of_the_nearest_known_one():
    """By steps to one of eight neighbours: the larger of the distances in rows and columns."""
    known = {(10, 20): 1.0, (100, 90): 2.0, (30, 110): 3.0, (120, 5): 4.0}
    height = assumed(known)
    rows, columns = np.indices((CELLS, CELLS))
    steps = {value: np.maximum(abs(rows - a), abs(columns - b)) for (a, b), value in known.items()}
    nearest = np.sort(list(steps.values()), axis=0)
    for value, away in steps.items():
        alone = (away == nearest[0]) & (nearest[1] > nearest[0])  # no other is as near
        assert alone.sum() > 1000
        expected = np.where(away == 0, value, value - 1000.0)
        assert (height[alone] == expected[alone]).all()


def test_among_sixty_known_cells_the_nearest_counts(rng):
    known = {(int(a), int(b)): float(n) for n, (a, b) in enumerate(rng.integers(0, CELLS, (60, 2)))}
    height = assumed(known)
    rows, columns = np.indices((CELLS, CELLS))
    away = np.array([np.maximum(abs(rows - a), abs(columns - b)) for a, b in known])
    nearest, second = np.sort(away, axis=0)[:2]
    value = np.array(list(known.values()))[away.argmin(axis=0)]
    expected = np.where(nearest == 0, value, value - 1000.0)
    alone = second > nearest
    assert ((second == nearest + 1) & alone).sum() > 300
    assert (height[alone] == expected[alone]).all()


@pytest.mark.parametrize("other", [(10, 20), (20, 10), (20, 20)])
def test_of_two_cells_equally_near_the_first_one_counts(other):
    height = assumed({(10, 10): 1.0, other: 2.0})
    middle = tuple((a + 10) // 2 for a in other)
    assert height[middle] == -999.0


def test_known_cells_stay_as_they_are(rng):
    height = np.where(rng.random((CELLS, CELLS)) < 0.5, rng.normal(size=(CELLS, CELLS)), np.nan)
    filled = height.astype(np.float32)
    in_python(terrain.assume_ground)(filled)
    known = np.isfinite(height)
    assert (filled[known] == height[known].astype(np.float32)).all()
    assert (filled[~known] < -990.0).all()
