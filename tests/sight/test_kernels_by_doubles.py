"""Range image, ground map and occluder kernels against slow doubles of their definitions."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_scans import GROUND_M, street_scan

from intervis.sight import HDL_64E, Scene
from intervis.sight.ground_map import ground_map_of
from intervis.sight.kernels import rasterize as kernels
from intervis.sight.kernels import terrain
from intervis.sight.kernels.batch import BRACKETED, BRACKETING, DIRECTION
from intervis.sight.kernels.dynamics import find_bracketing
from intervis.sight.range_image import range_image_of


def indices(count):
    return np.arange(count, dtype=np.uint32)


def columns_of(rng, columns, most):
    """Random returns by column, ascending in tan(elevation): t, rho, order and column starts."""
    counts = rng.integers(0, most + 1, columns)
    start = np.concatenate([[0], np.cumsum(counts)])
    t = np.concatenate([np.sort(rng.uniform(-0.5, 0.5, n)) for n in counts])
    rho = rng.choice([5.0, 5.4, 6.2, 12.0, 40.0], len(t)) * rng.uniform(0.98, 1.02, len(t))
    return t, rho, indices(len(t)), start.astype(np.uint32)


def pixel_by_definition(t_of, rho_of, spacing_of, t):
    """What the definition of the range image says of one direction of a column."""
    value = 0.0
    for m in range(len(t_of)):
        spacing = spacing_of(t_of[m])
        below, above = t_of[m] - 0.6 * spacing, t_of[m] + 0.6 * spacing
        if m > 0 and t_of[m] - t_of[m - 1] < 2.6 * spacing:
            below = 0.5 * (t_of[m] + t_of[m - 1])
            r, q = rho_of[m], rho_of[m - 1]
            small_jump = abs(r - q) < 0.2 * min(r, q)
            same_height = abs(t_of[m] * r - t_of[m - 1] * q) < 0.25
            if small_jump or same_height:
                below = t_of[m]
                if t_of[m - 1] <= t < t_of[m]:
                    f = (t - t_of[m - 1]) / (t_of[m] - t_of[m - 1])
                    value = 1.0 / ((1.0 - f) / q + f / r)
        if m + 1 < len(t_of) and t_of[m + 1] - t_of[m] < 2.6 * spacing:
            above = 0.5 * (t_of[m] + t_of[m + 1])
        if below <= t < above:
            value = rho_of[m]
    return value


@settings(max_examples=30)
@given(seed=st.integers(0, 2**32 - 1))
def test_a_range_image_is_drawn_as_it_is_defined(seed):
    rng = np.random.default_rng(seed)
    t, rho, order, start = columns_of(rng, columns=6, most=12)
    spacings = rng.uniform(0.01, 0.06, 8)
    lowest, step, rows = -0.6, 0.0103, 120
    # columns are cyclic: two of either side are drawn again beside the others
    image = np.zeros((10, rows), np.float32)
    kernels.rasterize(rho, t, t * rho, order, start, spacings, lowest, step, -2, image)
    assert np.array_equal(image[:2], image[6:8])
    assert np.array_equal(image[8:], image[2:4])

    def spacing_of(tan_elevation):
        return spacings[min(int((tan_elevation + 2.0) / 4.0 * 8), 7)]

    expected = np.array(
        [
            [
                pixel_by_definition(
                    t[start[c] : start[c + 1]],
                    rho[start[c] : start[c + 1]],
                    spacing_of,
                    lowest + k * step,
                )
                for k in range(rows)
            ]
            for c in range(6)
        ]
    )
    np.testing.assert_allclose(image[2:-2], expected, rtol=1e-5)


def test_surfaces_are_those_that_three_of_four_neighbours_agree_with(rng):
    """Against shifted copies of the whole image."""
    image = rng.choice([0.0, 10.0, 10.2, 10.5, 12.0], (40, 60)).astype(np.float32)
    far, units_per_m = 3, 100.0
    pixels = np.empty(image.shape, np.int16)
    bordered = np.pad(np.pad(image, ((2, 2), (0, 0)), mode="wrap"), ((0, 0), (far, far)))
    kernels.quantize(bordered, far, units_per_m, pixels)
    agree = np.zeros(image.shape, int)
    beside = np.stack([np.roll(image, 1, 0), np.roll(image, -1, 0)])
    # a column without a return between two with one takes the nearer range
    filled = np.where((image == 0) & (beside > 0).all(axis=0), beside.min(axis=0), image)
    observed = np.zeros(image.shape, int)
    for axis, shift, tolerance in ((0, 1, 0.04), (0, -1, 0.04), (1, far, 0.08), (1, -far, 0.08)):
        other = np.roll(image, shift, axis)
        if axis == 0:  # a column that was missed is looked through
            other = np.where(other > 0, other, np.roll(image, 2 * shift, axis))
        near = (other > 0) & (np.abs(filled - other) < np.float64(tolerance) * other)
        known = other > 0
        if axis == 1:  # azimuth is cyclic, elevation is not
            near[:, :far] &= shift < 0
            near[:, image.shape[1] - far :] &= shift > 0
            known[:, :far] &= shift < 0
            known[:, image.shape[1] - far :] &= shift > 0
            observed += known
        agree += near
    agree += observed == 0  # no beam above or below: a single ring
    units = (filled.astype(np.float64) * units_per_m).astype(int)
    expected = np.where(agree >= 3, units, -(units // 2 * 2))  # volumetric ones are even
    assert {-1, 0, 1} <= set(np.sign(pixels).ravel().tolist())
    assert np.array_equal(pixels, np.where(filled > 0, expected, 0))


def test_beam_spacings_are_medians_of_their_bands(rng):
    """Two groups of beams with different spacings; the bands between take the nearest value."""
    coarse, fine = np.arange(-1.0, -0.2, 0.02), np.arange(0.0, 0.4, 0.005)
    t = np.tile(np.concatenate([coarse, fine]), 50)
    beams = len(coarse) + len(fine)
    start = np.arange(0, len(t) + 1, beams, dtype=np.uint32)
    spacings = kernels.beam_spacings(t, indices(len(t)), start, 0.01, 40)
    band = [int((value + 2.0) / 4.0 * 40) for value in (-0.8, 0.2)]
    assert spacings[band[0]] == pytest.approx(0.02, rel=0.1)
    assert spacings[band[1]] == pytest.approx(0.005, abs=0.001)
    assert (spacings[: band[0]] == spacings[band[0]]).all(), "below the lowest beam"
    assert (spacings[band[1] + 3 :] == spacings[band[1] + 1]).all(), "above the highest beam"


def known_cells(rng, share):
    height = rng.normal(-1.7, 0.05, (terrain.CELLS, terrain.CELLS)).astype(np.float32)
    height[rng.random(height.shape) > share] = np.inf
    return height


def test_the_lowest_return_of_a_cell_is_its_third_lowest(rng):
    points = rng.uniform([-5, -5, -2], [5, 5, 1], (600, 3))
    lowest = np.empty((terrain.CELLS, terrain.CELLS), np.float32)
    terrain.lowest_returns(points.T.copy(), np.arange(len(points)), lowest)
    cells = np.floor(points[:, :2]).astype(int) + terrain.CELLS // 2
    for a in range(59, 69):
        for b in range(59, 69):
            z = np.sort(points[(cells == [a, b]).all(axis=1), 2])
            expected = z[2] if len(z) > 3 else np.inf
            assert lowest[a, b] == np.float32(expected)
    assert np.isinf(lowest[:50]).all()


def test_ground_outliers_are_cells_that_lie_below_most_neighbours(rng):
    lowest = known_cells(rng, 0.6)
    deep = rng.integers(2, terrain.CELLS - 2, (40, 2))
    lowest[deep[:, 0], deep[:, 1]] = -4.0
    kept = np.empty_like(lowest)
    terrain.remove_outliers(lowest, kept)
    for a, b in [*deep.tolist(), *rng.integers(0, terrain.CELLS, (300, 2)).tolist()]:
        around = lowest[max(a - 2, 0) : a + 3, max(b - 2, 0) : b + 3]
        around = around[np.isfinite(around)]
        below = np.count_nonzero(around < lowest[a, b] + np.float32(0.35))
        dropped = np.isfinite(lowest[a, b]) and (len(around) < 3 or 4 * below < len(around))
        assert kept[a, b] == (np.inf if dropped else lowest[a, b])


def test_ground_that_is_seen_through_nearer_ground_is_dropped():
    """A level road, multipath 3 m below it, and a pit behind whose edge the floor is in sight."""
    height = np.full((terrain.CELLS, terrain.CELLS), -1.7, np.float32)
    middle = terrain.CELLS // 2
    multipath = [(middle + 12, middle), (middle - 20, middle + 9), (middle, middle - 7)]
    for cell in multipath:
        height[cell] = -4.7
    # the line from the sensor to the floor passes the edge, 10 m away, at -1.7 * 30 / 30
    height[middle + 11 : middle + 30, middle - 2 : middle + 3] = np.inf
    height[middle + 30 : middle + 40, middle] = -5.2
    before = height.copy()
    terrain.remove_below_nearer(height)
    dropped = np.isinf(height) & np.isfinite(before)
    assert set(map(tuple, np.argwhere(dropped))) == {
        cell for cell in multipath if np.isfinite(before[cell])
    }


def test_the_slope_filter_is_the_lower_envelope_of_cones(rng):
    height = known_cells(rng, 0.3)
    height[rng.random(height.shape) < 0.05] += 3.0
    before = height.copy()
    terrain.slope_filter(height)
    at = np.argwhere(np.isfinite(before))
    for a, b in rng.integers(0, terrain.CELLS, (150, 2)):
        cones = before[at[:, 0], at[:, 1]] + 0.15 * np.abs(at - [a, b]).sum(axis=1)
        assert height[a, b] == pytest.approx(cones.min(), abs=1e-4)


def interpolated(height, known, cell):
    """Ground of one cell between the nearest known cells along x, or else along y."""
    if known[cell]:
        return height[cell]
    for axis in (0, 1):
        line = np.moveaxis(height, axis, 0)[:, cell[1 - axis]]
        of_line = np.flatnonzero(np.moveaxis(known, axis, 0)[1:-1, cell[1 - axis]]) + 1
        before, after = of_line[of_line < cell[axis]], of_line[of_line > cell[axis]]
        if len(before) and len(after) and after[0] - before[-1] <= 8:
            ends = [before[-1], after[0]]
            return np.interp(cell[axis], ends, line[ends])
    return np.nan


def test_ground_is_known_between_known_cells_alone(rng):
    height = known_cells(rng, 0.08)
    known = np.isfinite(height)
    before = height.copy()
    terrain.interpolate(height, known)
    inner = rng.integers(1, terrain.CELLS - 1, (600, 2))
    expected = [interpolated(before, known, tuple(cell)) for cell in inner]
    assert 100 < np.isnan(expected).sum() < 500
    np.testing.assert_allclose(height[tuple(inner.T)], expected, atol=1e-5)
    for border in (height[0], height[-1], height[:, 0], height[:, -1]):
        assert np.isnan(border).all()


def test_the_sensor_stands_as_high_as_its_ground_says(rng):
    """The stages together: a road, a kerb, cars and multipath below the road."""
    x, y = rng.uniform(-40, 40, (2, 150_000))
    z = np.where(y > 5.0, -1.55, -1.7) + rng.normal(0.0, 0.01, len(x))
    z[:40] = -6.0
    z[(np.abs(x - 8.0) < 2.0) & (np.abs(y) < 0.9)] += 1.4
    ground = ground_map_of(np.stack([x, y, z]), np.arange(len(x)))
    middle = terrain.CELLS // 2
    assert ground[middle + 8, middle] == pytest.approx(-1.7, abs=0.15 * 2)
    assert ground[middle, middle] == pytest.approx(-1.7, abs=0.05)
    assert ground[middle, middle + 12] == pytest.approx(-1.55, abs=0.05)


WALLS = {
    "up": ([10.0, -8.0, GROUND_M, 10.4, 8.0, -0.9], -1.3, 0.0, 0.4),
    "left": ([10.0, -6.0, GROUND_M, 10.4, 0.5, 3.0], -0.8, 0.0, 0.5),
    "right": ([10.0, -0.7, GROUND_M, 10.4, 6.0, 3.0], -0.8, 0.0, 0.7),
    "down": ([10.0, -8.0, -0.9, 10.4, 8.0, 3.0], -0.6, 0.0, 0.3),
}


@pytest.mark.parametrize("way", sorted(WALLS))
def test_an_occluded_line_is_shifted_past_the_nearest_edge(way):
    """A wall whose nearest edge lies above, below, left or right of the line."""
    box, z, y, shift_m = WALLS[way]
    scene = Scene.from_scan(street_scan(boxes=np.array([box])))
    sight = scene.sight([7.0, y, z], [[14.0, y, z]])
    assert sight.occluded[0]
    assert sight.blocker[0] == pytest.approx([10.0, y, z], abs=0.15)
    # The shift is found across the beam of the scanner, in pixels of up to 6 cm at 10 m.
    assert -sight.clearance[0] == pytest.approx(shift_m, abs=0.2)


@settings(max_examples=25, deadline=None)
@given(
    y=st.floats(-5.0, 5.0),
    z=st.floats(-1.2, 0.5),
    away=st.floats(11.0, 30.0),
    x_wall=st.floats(6.0, 12.0),
)
def test_a_blocker_is_where_the_line_meets_the_wall(y, z, away, x_wall):
    box = np.array([[x_wall, -20.0, GROUND_M, x_wall + 0.3, 20.0, 4.0]])
    scene = Scene.from_scan(street_scan(boxes=box, noise_m=0.0, step_deg=0.4, beams=32))
    start, end = np.array([2.0, 0.0, -0.4]), np.array([x_wall + away - 6.0, y, z])
    sight = scene.sight(start, end[None])
    assert sight.occluded[0]
    expected = start + (x_wall - start[0]) / (end[0] - start[0]) * (end - start)
    assert sight.blocker[0] == pytest.approx(expected, abs=0.12)


def test_near_and_far_limits_of_the_sensor_are_kept(rng):
    """Returns outside the range limits leave no trace in the range image."""
    scan = street_scan().astype(np.float64)
    near = 0.5 * rng.normal(size=(50, 3)) / 3.0
    far = 500.0 * np.column_stack([np.ones(50), rng.uniform(-1, 1, 50), np.zeros(50)])
    image = range_image_of(np.vstack([scan, near, far]), HDL_64E)
    assert image.returns == range_image_of(scan, HDL_64E).returns


def bracketing_by_definition(position, offset_s, a, b, chosen):
    """Rank, direction and fraction, one line at a time, from the text of `occupancy_model`."""
    near = position[chosen[0]]
    to_a, to_b = np.sum((a - near) ** 2), np.sum((b - near) ** 2)
    end = (a if to_a <= to_b else b)[:2]
    timed = not np.isnan(offset_s[chosen[0]])
    if timed:
        beyond = [n for n in range(1, len(chosen)) if offset_s[chosen[0]] * offset_s[chosen[n]] < 0]
    else:
        ahead = end - near[:2]
        beyond = [n for n in range(1, len(chosen)) if (position[chosen[n], :2] - end) @ ahead > 0]
    if not beyond:
        return (-1 if timed else 0), None, None
    way = position[chosen[beyond[0]], :2] - near[:2]
    length = np.linalg.norm(way)
    if length < 0.5:
        return 0, None, None
    if timed:
        first, second = offset_s[chosen[0]], offset_s[chosen[beyond[0]]]
        return beyond[0], way / length, first / (first - second)
    fraction = np.clip((end - near[:2]) @ (way / length) / length, 0.0, 1.0)
    return beyond[0], way / length, fraction


@pytest.mark.parametrize("timed", [False, True])
def test_the_bracketing_scan_is_the_nearest_on_the_other_side(rng, timed):
    scans, lines = 6, 4000
    position = rng.normal(0.0, 4.0, (scans, 3))
    offset_s = rng.normal(0.0, 1.0, scans) if timed else np.full(scans, np.nan)
    a, b = rng.normal(0.0, 6.0, (2, lines, 3))
    b[::4] = 2.0 * position[0] - a[::4]  # both ends equally far from the first scan
    chosen = np.array([rng.permutation(scans)[:4] for _ in range(lines)])
    chosen[::4, 0] = 0
    table = np.zeros((lines, BRACKETED + 1))
    find_bracketing(position, offset_s, a, b, chosen, table)
    ranks = set()
    for i in range(lines):
        if i % 4 == 0 and not timed:  # a tie up to rounding: either end, but one of them whole
            options = [
                bracketing_by_definition(position, offset_s, one, one, chosen[i])
                for one in (a[i], b[i])
            ]
        else:
            options = [bracketing_by_definition(position, offset_s, a[i], b[i], chosen[i])]
        assert any(
            table[i, BRACKETING] == rank
            and (
                direction is None
                or np.allclose(table[i, DIRECTION : DIRECTION + 3], [*direction, fraction])
            )
            for rank, direction, fraction in options
        ), i
        ranks.add(int(table[i, BRACKETING]))
    assert {1, 2, 3} <= ranks


def test_the_nearer_end_is_found_in_three_dimensions():
    """One end is nearer only because of the sensor's height."""
    position = np.array([[0.0, 0.0, 3.0], [10.0, 0.0, 3.0], [-10.0, 0.0, 3.0]])
    a, b = np.array([[4.0, 0.0, -3.0]]), np.array([[-5.0, 0.0, 4.0]])
    table = np.zeros((1, BRACKETED + 1))
    find_bracketing(position, np.full(3, np.nan), a, b, np.array([[0, 1, 2]]), table)
    assert table[0, BRACKETING] == 2, "b is nearer: 5.1 m against 7.2 m"
