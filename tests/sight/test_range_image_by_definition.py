"""The range image of a scan, pixel by pixel, from the text of `intervis.sight.range_image`."""

import math
from itertools import pairwise

import numpy as np
import pytest

from intervis.sight import Sensor
from intervis.sight.range_image import range_image_of

COLUMNS, SPACING, UNIT_M = 72, 0.03, 60.0 / 32767
SENSOR = Sensor("made", 16, -24.0, 6.0, 5.0, 1.0, 60.0, 0.1)
"""Beams 2 degrees apart: 0.0349 in pseudo-elevation, near the 0.03 of the scans below."""


def azimuth_of(column, within=0.5):
    """An azimuth within a column, radians: octants are divided evenly but for 0.1 degrees."""
    return (column + within) * 2.0 * math.pi / COLUMNS


def point_at(column, e, planar_m, within=0.5):
    """A return in a column at a pseudo-elevation: z / rho, or beyond 45 degrees 2 - rho / |z|."""
    azimuth = azimuth_of(column, within)
    if abs(e) <= 1.0:
        rho, z = planar_m, e * planar_m
    else:
        rho, z = (2.0 - abs(e)) * planar_m, math.copysign(planar_m, e)
    return [rho * math.cos(azimuth), rho * math.sin(azimuth), z]


def scan_of(columns):
    """A scan from the returns of its columns, {column: [(pseudo-elevation, planar range), ...]}."""
    points = [point_at(c, e, r) for c, returns in columns.items() for e, r in returns]
    return np.array(points)


def drawn(returns, spacing, e):
    """Planar range of one direction of a column, ascending returns (e, r); 0: unobserved."""
    value = 0.0
    for m, (t, r) in enumerate(returns):
        begin, end = t - 0.6 * spacing, t + 0.6 * spacing
        if m > 0 and t - returns[m - 1][0] < 2.6 * spacing:
            u, q = returns[m - 1]
            begin = 0.5 * (t + u)
            if abs(r - q) < 0.2 * min(r, q) or abs(t * r - u * q) < 0.25:  # heights on the sides
                begin = t
                if u <= e < t:
                    f = (e - u) / (t - u)
                    value = 1.0 / ((1.0 - f) / q + f / r)
        if m + 1 < len(returns) and returns[m + 1][0] - t < 2.6 * spacing:
            end = 0.5 * (t + returns[m + 1][0])
        if begin <= e < end:
            value = r
    return value


def signed(image, far):
    """Planar ranges with the sign of the pixels: negative where three of four do not agree."""
    columns, rows = image.shape
    result = np.zeros(image.shape)
    for c in range(columns):
        beside = [image[(c + step) % columns] for step in (-1, 1)]
        next_but_one = [image[(c + step) % columns] for step in (-2, 2)]
        for k in range(rows):
            r = image[c, k]
            if r == 0.0:
                if beside[0][k] == 0.0 or beside[1][k] == 0.0:
                    continue
                r = min(beside[0][k], beside[1][k])
            agree = 0
            for near, after in zip(beside, next_but_one, strict=True):
                other = near[k] or after[k]
                agree += other > 0.0 and abs(r - other) < 0.04 * other
            vertical = [image[c, k + step] for step in (-far, far) if 0 <= k + step < rows]
            vertical = [other for other in vertical if other > 0.0]
            agree += sum(abs(r - other) < 0.08 * other for other in vertical)
            agree += not vertical
            result[c, k] = r if agree >= 3 else -r
    return result


def bridged(image, step):
    """Planar ranges of the surfaces that dropouts interrupt; 0: no dropout."""
    observed = image != 0.0
    per_row = observed.sum(axis=0)
    scanned = per_row >= max(0.05 * per_row.max(), 1)
    result = np.zeros(image.shape)
    for c, column in enumerate(np.abs(image)):
        rows = np.flatnonzero(observed[c])
        for p, q in pairwise(rows):
            a, b = column[p], column[q]
            if 1 < q - p <= int(0.2 / step) and abs(a - b) < 0.2 * min(a, b):
                between = np.arange(p + 1, q)
                inverse = np.interp(between, [p, q], [1.0 / a, 1.0 / b])
                result[c, between] = np.where(scanned[between], 1.0 / inverse, 0.0)
    return result


def check(columns, sensor=SENSOR):
    """Compare the image of a scan with its definition; return the image."""
    image = range_image_of(scan_of(columns), sensor)
    spacing = 3.0 * image.elevation_step  # three rows a beam
    assert spacing == pytest.approx(SPACING, abs=0.07 * math.radians(2.0)), "the median step"
    every = [one for returns in columns.values() for one in returns]
    low, high = min(e for e, _ in every), max(e for e, _ in every)
    # two spacings beyond the lowest and the highest beam
    assert image.elevation_from == pytest.approx(low - 2.0 * spacing)
    rows = int((high - low + 4.0 * spacing) / image.elevation_step) + 2
    assert image.pixels.shape[0] == COLUMNS
    assert abs(image.pixels.shape[1] - rows) <= 1  # rounding of a whole number
    assert image.unit_m == pytest.approx(max(r for _, r in every) / 32767)
    assert image.returns == len(every)
    expected = np.zeros(image.pixels.shape)
    for c, returns in columns.items():
        for k in range(expected.shape[1]):
            # a row at the very end of a piece belongs to it or not, by rounding: look beside it
            e = image.elevation_from + k * image.elevation_step
            expected[c, k] = drawn(sorted(returns), spacing, e + 1e-9)
    expected = signed(expected, 3)
    dropouts = bridged(expected, image.elevation_step)
    expected = (expected - dropouts) / image.unit_m
    off = np.abs(image.pixels - expected)
    assert (off <= 2.01).mean() > 0.999  # the last bit of a negative pixel is a flag
    assert (np.sign(image.pixels) == np.sign(expected)).mean() > 0.999
    odd = (image.pixels < 0) & (image.pixels % 2 == 1)
    assert (odd == (dropouts > 0.0)).mean() > 0.999
    return image


def test_a_scan_with_walls_gaps_and_lone_returns(rng):
    """Beams 0.03 apart, not on the rows of the image; a fifth of the returns is missing."""
    walls = rng.choice([5.0, 5.3, 6.5, 12.0, 30.0], (COLUMNS // 6, 4)).repeat(6, 0).repeat(4, 1)
    columns = {}
    for c in range(COLUMNS):
        jitter = rng.normal(0.0, 0.001, 16)
        returns = [
            (-0.35 + SPACING * k + jitter[k], walls[c, k] * rng.uniform(0.985, 1.015))
            for k in range(16)
            if rng.random() > 0.2
        ]
        columns[c] = returns if rng.random() > 0.1 else []
    columns[7].append((0.1, 60.0))
    image = check(columns)
    assert (image.pixels > 0).sum() > 500
    assert (image.pixels < 0).sum() > 500
    assert (image.pixels == 0).sum() > 500


def test_a_closed_wall_is_one_surface():
    columns = {c: [(-0.3 + SPACING * k, 10.0) for k in range(16)] for c in range(COLUMNS)}
    image = check(columns)
    e = image.elevation_from + np.arange(image.pixels.shape[1]) * image.elevation_step
    inside = (e > -0.3) & (e < -0.3 + 15 * SPACING - 0.001)
    assert (image.pixels[:, inside] == 32767).all()
    # returns at the border extend over 0.6 spacings
    below = (e > -0.3 - 0.55 * 3 * image.elevation_step) & (e < -0.3 - 1e-6)
    assert (image.pixels[:, below] != 0).all()
    assert below.sum() == 1
    beyond = e < -0.3 - 0.65 * 3 * image.elevation_step
    assert (image.pixels[:, beyond] == 0).all()


def test_a_wall_at_half_a_metre_is_drawn_as_one_at_ten():
    near = Sensor("near", 16, -24.0, 6.0, 5.0, 0.1, 60.0, 0.1)
    columns = {c: [(-0.3 + SPACING * k, 0.5) for k in range(16)] for c in range(COLUMNS)}
    image = check(columns, near)
    e = image.elevation_from + np.arange(image.pixels.shape[1]) * image.elevation_step
    inside = (e > -0.3) & (e < -0.3 + 15 * SPACING - 0.001)
    assert inside.sum() > 30
    assert (image.pixels[:, inside] > 0).all()


@pytest.mark.parametrize(("missing", "filled"), [([20], True), ([20, 21], False), ([71], True)])
def test_one_missed_column_is_filled_and_two_are_not(missing, filled):
    columns = {
        c: [(-0.3 + SPACING * k, 10.0 if c < 21 else 10.2) for k in range(16)]
        for c in range(COLUMNS)
        if c not in missing
    }
    image = check(columns)
    row = image.pixels.shape[1] // 2
    found = image.pixels[missing, row] * image.unit_m
    assert found == pytest.approx([10.0 if filled else 0.0] * len(missing), abs=1e-3)


@pytest.mark.parametrize(
    ("gap_spacings", "observed"), [(1, True), (2, True), (2.4, True), (2.8, False), (4, False)]
)
def test_gaps_of_more_than_two_and_a_half_spacings_hold_no_surface(gap_spacings, observed):
    """Eight beams, a gap, eight beams, all on a wall 10 m away."""
    e = np.concatenate([np.arange(8), 7 + gap_spacings + np.arange(8)]) * SPACING - 0.4
    image = check({c: [(one, 10.0) for one in e] for c in range(COLUMNS)})
    middle = e[7] + 0.5 * gap_spacings * SPACING
    row = round((middle - image.elevation_from) / image.elevation_step)
    assert (image.pixels[:, row] != 0).all() == observed


@pytest.mark.parametrize(
    ("far_m", "one_surface"), [(10.0, True), (11.9, True), (12.1, False), (30.0, False)]
)
def test_ranges_that_jump_by_a_fifth_are_two_surfaces(far_m, one_surface):
    """A wall above the horizon, its upper half farther away: interpolated, or a step half way."""
    e = 0.05 + SPACING * np.arange(16)
    columns = {
        c: [(one, 10.0 if k < 8 else far_m) for k, one in enumerate(e)] for c in range(COLUMNS)
    }
    image = check(columns)
    at = image.elevation_from + np.arange(image.pixels.shape[1]) * image.elevation_step
    between = (at > e[7] + 1e-6) & (at < e[8] - 1e-6)
    fraction = (at[between] - e[7]) / (e[8] - e[7])
    expected = 1.0 / ((1.0 - fraction) / 10.0 + fraction / far_m)
    if not one_surface:
        expected = np.where(fraction < 0.5, 10.0, far_m)
    found = np.abs(image.pixels[:, between]) * image.unit_m
    assert found == pytest.approx(np.broadcast_to(expected, found.shape), abs=2e-3)


@pytest.mark.parametrize(("apart_m", "one_surface"), [(0.24, True), (0.26, False)])
def test_returns_at_one_height_are_one_surface_however_far_apart(apart_m, one_surface):
    """Ground seen at a grazing angle: beams at -0.06 and -0.03 reach 25 and 50 m at -1.5 m."""
    ground = [(-0.03 * k, 1.5 / (0.03 * k)) for k in (16, 14, 12, 11, 10, 9, 8, 7, 6, 5, 4, 3, 2)]
    height = -1.5 + apart_m
    columns = {c: [*ground, (-0.03, -height / 0.03)] for c in range(COLUMNS)}
    image = range_image_of(scan_of(columns), SENSOR)
    e = image.elevation_from + np.arange(image.pixels.shape[1]) * image.elevation_step
    between = (e > -0.06 + 1e-6) & (e < -0.03 - 1e-6)
    fraction = (e[between] + 0.06) / 0.03
    expected = 1.0 / ((1.0 - fraction) / 25.0 + fraction * 0.03 / -height)
    if not one_surface:
        expected = np.where(fraction < 0.5, 25.0, -height / 0.03)
    found = np.abs(image.pixels[:, between]) * image.unit_m
    assert found == pytest.approx(np.broadcast_to(expected, found.shape), abs=5e-3)


@pytest.mark.parametrize(
    ("beside_m", "surface"),
    [(10.39, True), (10.43, False), (9.63, True), (9.61, False)],  # less than 4 % of the neighbour
)
@pytest.mark.parametrize("side", [-1, 1])
def test_a_surface_needs_three_neighbours_that_agree(beside_m, surface, side):
    """A wall 10 m away, at one column farther away above the beam 8; its neighbour differs."""
    e = 0.05 + SPACING * np.arange(16)
    columns = {c: [(one, 10.0) for one in e] for c in range(COLUMNS)}
    for c in (30 + side, 30 + 2 * side):
        columns[c] = [(one, beside_m) for one in e]
    columns[30] = [(one, 10.0 if k <= 8 else 13.0) for k, one in enumerate(e)]
    image = check(columns)
    row = math.floor((e[8] - image.elevation_from) / image.elevation_step)
    beams = np.abs(image.pixels[30, [row - 3, row, row + 3]]) * image.unit_m
    assert beams == pytest.approx([10.0, 10.0, 13.0], abs=2e-3)
    assert (image.pixels[30, row] > 0) == surface, "the other side and the beam below agree"


def test_blocks_that_differ_by_a_few_percent(rng):
    """Neighbours agree within 4 % beside and within 8 % above and below."""
    ranges = 10.0 * np.array([1.0, 1.02, 1.03, 1.05, 1.07, 1.09, 1.11])
    for size in (1, 2, 3):
        walls = rng.choice(ranges, (COLUMNS // size, 16)).repeat(size, 0)
        walls[:, 8:] = walls[:, 7:8] * rng.choice([1.0, 1.07, 1.09], (COLUMNS, 1))
        columns = {
            c: [(0.05 + SPACING * k, walls[c, k]) for k in range(16) if rng.random() > 0.1]
            for c in range(COLUMNS)
        }
        image = check(columns)
        assert 0.2 < (image.pixels > 0).sum() / (image.pixels != 0).sum() < 0.9


def test_returns_beyond_the_range_limits_and_strays_are_left_out():
    wall = {c: [(-0.3 + SPACING * k, 10.0) for k in range(16)] for c in range(COLUMNS)}
    plain = range_image_of(scan_of(wall), SENSOR)
    for planar_m, kept in ((0.99, False), (1.01, True), (60.5, False), (41.0, False), (39.0, True)):
        odd = scan_of({5: [(-0.2, planar_m)]})
        image = range_image_of(np.vstack([scan_of(wall), odd]), SENSOR)
        assert image.returns == plain.returns + kept, planar_m  # strays: more than 4 * 10 m
        assert image.unit_m == pytest.approx(max(10.0, planar_m if kept else 0.0) / 32767)


def test_a_scan_without_returns_has_an_empty_image():
    image = range_image_of(np.empty((0, 3)), SENSOR)
    assert image.returns == 0
    assert image.pixels.shape == (COLUMNS, 2)
    assert not image.pixels.any()
    assert (image.unit_m, image.elevation_from) == (1.0, 0.0)
    assert image.elevation_step == pytest.approx(math.radians(2.0))
    assert np.isnan(image.ground_m).all()


@pytest.mark.parametrize(
    ("step_deg", "columns"), [(5.0, 72), (0.2, 1800), (0.05, 4096), (10.0, 36), (7.0, 51)]
)
def test_a_column_is_one_azimuth_step_wide(step_deg, columns):
    sensor = Sensor("made", 16, -24.0, 6.0, step_deg, 1.0, 60.0, 0.1)
    assert range_image_of(np.array([[5.0, 0, 0]]), sensor).pixels.shape[0] == columns


def test_heights_are_measured_along_gravity():
    """A sensor on its side: what differs in its own z is at one height of the scene, or not."""
    level = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])  # z' = y
    e = 0.4 + SPACING * np.arange(16)  # far from the horizon: heights differ beam by beam
    columns = {c: [(one, 10.0 if k % 2 else 25.0) for k, one in enumerate(e)] for c in range(72)}
    scan = scan_of(columns)
    scan[:16, 1] = 1e-3  # those of column 0 on the x axis: y is the same at all ranges

    def interpolated(pose):
        image = range_image_of(scan, SENSOR, pose)
        range_m = np.abs(image.pixels[0].astype(int)) * image.unit_m
        return ((range_m > 11.0) & (range_m < 24.0)).sum()

    assert interpolated(None) == 0, "15 m apart, and 6 m or more in height"
    assert interpolated(np.eye(4)) == 0
    assert interpolated(level) > 10, "one height: one surface"


@pytest.mark.parametrize("times", [0.4, 0.75, 0.8, 0.88, 0.9, 1.0, 1.15, 1.75, 3.0, 7.0])
def test_the_beam_spacing_is_the_median_step_of_a_column(times):
    """In bins of 7.75 / 64 of the sensor's spacing, whose middle counts."""
    usual, sensor = math.radians(2.0), Sensor("made", 16, -24.0, 6.0, 2.5, 1.0, 60.0, 0.1)
    azimuth = np.radians(np.arange(1.25, 360.0, 2.5))
    levels = times * usual * np.arange(4) - 0.3
    rays = [np.stack([np.cos(azimuth), np.sin(azimuth), 0 * azimuth + e], 1) for e in levels]
    image = range_image_of(10.0 * np.vstack(rays), sensor)
    spacing = 3.0 * image.elevation_step
    assert spacing == pytest.approx(times * usual, abs=0.0606 * usual)
    # steps of 0.25 to 8 times the usual one, in 64 bins
    bin_of = (times - 0.25) / 7.75 * 64
    assert 0.05 < bin_of % 1.0 < 0.95, "not on the border of two bins"
    assert spacing == pytest.approx((0.25 + (int(bin_of) + 0.5) / 64 * 7.75) * usual)


def test_two_beams_have_one_step():
    sensor = Sensor("made", 2, -2.0, 2.0, 2.0, 1.0, 60.0, 0.1)
    azimuth = np.radians(np.arange(1.0, 360.0, 2.0))
    rays = [np.stack([np.cos(azimuth), np.sin(azimuth), 0 * azimuth + e], 1) for e in (-0.05, 0.05)]
    image = range_image_of(10.0 * np.vstack(rays), sensor)
    assert 3.0 * image.elevation_step == pytest.approx(0.1, abs=0.0606 * math.radians(4.0))


def test_an_image_has_about_a_thousand_rows_at_most():
    """600 beams over 0.8 of pseudo-elevation: a third of their spacing would be 1800 rows."""
    sensor = Sensor("made", 600, -5.0, 42.0, 10.0, 1.0, 60.0, 0.1)
    azimuth = np.radians(np.arange(5.0, 360.0, 10.0))
    e = np.linspace(-0.1, 0.7, 600)
    points = [[10 * np.cos(a), 10 * np.sin(a), 10 * one] for a in azimuth for one in e]
    image = range_image_of(np.array(points), sensor)
    assert image.elevation_step == pytest.approx(0.8 / 1024)


def test_returns_on_the_range_limits_are_kept():
    wall = scan_of({c: [(-0.3 + SPACING * k, 20.0) for k in range(16)] for c in range(COLUMNS)})
    for range_m, kept in ((1.0, 1), (60.0, 1), (0.9999, 0), (60.001, 0)):
        image = range_image_of(np.vstack([wall, [[range_m, 0.0, 0.0]]]), SENSOR)
        assert image.returns == len(wall) + kept
