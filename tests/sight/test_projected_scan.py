"""Projected scans and what is read from them fast, against slow doubles of the definitions."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_scans import street_scan, turned

from intervis.sight import HDL_64E, sensor_of_scan
from intervis.sight.kernels.beam_pattern import direction_scale, list_by_cell, neighbour_angles
from intervis.sight.kernels.rasterize import sort_into_columns
from intervis.sight.projected_scan import project_scan
from intervis.sight.range_image import _kept, range_image_of
from intervis.sight.sensor import _quantile

COLUMNS, ROWS = 36, 23
SEEDS = st.integers(0, 2**32 - 1)


def scattered(rng, count):
    """Returns in all directions, some of them twice."""
    points = rng.normal(size=(count, 3)) * rng.uniform(1.0, 50.0, (count, 1))
    return np.concatenate([points, points[: count // 10]])


def test_a_projected_scan_holds_ranges_and_level_coordinates(rng):
    points, pose = scattered(rng, 300), turned(0.7, 2.0, 1.0)
    pose[:3, :3] = pose[:3, :3] @ np.array([[1, 0, 0], [0, 0.8, -0.6], [0, 0.6, 0.8]])
    scan = project_scan(points.astype(np.float32), pose[:3, :3])
    points = points.astype(np.float32).astype(np.float64)
    rho, z = np.hypot(points[:, 0], points[:, 1]), points[:, 2]
    assert np.array_equal(scan.xyz.T, points)
    assert scan.range_m == pytest.approx(np.linalg.norm(points, axis=1), rel=1e-12)
    assert scan.planar_m == pytest.approx(np.maximum(rho, np.abs(z)), rel=1e-12)
    steep = np.sign(z) * (2.0 - rho / np.abs(z))
    assert scan.elevation == pytest.approx(np.where(np.abs(z) <= rho, z / rho, steep), abs=1e-12)
    azimuth_deg = np.degrees(np.arctan2(points[:, 1], points[:, 0])) % 360.0
    assert np.abs(scan.azimuth * 45.0 - azimuth_deg).max() < 0.11
    level = np.array([pose[:3, :3] @ point for point in points])
    assert scan.level.T == pytest.approx(level, abs=1e-12)
    assert np.array_equal(project_scan(points).level, project_scan(points).xyz)


def neighbours_by_definition(azimuth, elevation, hits, i, columns=COLUMNS, rows=ROWS):
    """Angle beside, angle above and mean solid angle of return i, over all returns."""
    column = np.minimum((azimuth / 8.0 * columns).astype(int), columns - 1)
    row = np.minimum(((elevation + 2.0) / 4.0 * rows).astype(int), rows - 1)
    apart = np.abs(column - column[i])
    around = (np.minimum(apart, columns - apart) <= 1) & (np.abs(row - row[i]) <= 1)
    around[np.setdiff1d(np.arange(len(azimuth)), hits)] = False
    per_azimuth, per_elevation = direction_scale(elevation[i])
    turn = np.abs(azimuth - azimuth[i])
    across = np.minimum(turn, 8.0 - turn) * per_azimuth
    up = np.abs(elevation - elevation[i]) * per_elevation
    angle = np.hypot(across, up)
    other = around & (angle >= 1e-6)
    beside, above = angle[other & (up <= 0.5 * across)], angle[other & (across <= 0.5 * up)]
    cell = per_azimuth * 8.0 / columns * per_elevation * 4.0 / rows
    return min(beside, default=np.inf), min(above, default=np.inf), 9 * cell / around.sum()


@pytest.mark.parametrize("elevation_deg", [-89.0, -60.0, -45.0, -20.0, 0.0, 10.0, 44.9, 45.1, 80.0])
def test_angles_of_one_unit_of_the_projection(elevation_deg):
    """In azimuth an eighth of a turn of a circle of radius cos(elevation). In elevation, from
    e = tan(elevation) the square of its cosine, from e = 2 - cot(elevation) that of its sine."""
    sine, cosine = np.sin(np.radians(elevation_deg)), np.cos(np.radians(elevation_deg))
    steep = abs(sine) > cosine
    e = np.sign(sine) * (2.0 - cosine / abs(sine)) if steep else sine / cosine
    across, up = direction_scale(e)
    assert across == pytest.approx(cosine * np.pi / 4.0, rel=1e-12)
    assert up == pytest.approx((sine if steep else cosine) ** 2, rel=1e-12)


@settings(max_examples=20, deadline=None)
@given(seed=SEEDS, count=st.integers(5, 600))
def test_neighbours_are_found_among_the_cells_around_a_return(seed, count):
    rng = np.random.default_rng(seed)
    scan = project_scan(scattered(rng, count))
    hits = np.flatnonzero(rng.random(len(scan)) < 0.9)
    if len(hits) == 0:
        return
    picked = rng.choice(hits, 12)
    lists = list_by_cell(scan.azimuth, scan.elevation, hits, picked, COLUMNS, ROWS)
    found = np.empty((3, len(picked)))
    neighbour_angles(scan.azimuth, scan.elevation, *lists, COLUMNS, ROWS, picked, *found)
    expected = [neighbours_by_definition(scan.azimuth, scan.elevation, hits, i) for i in picked]
    np.testing.assert_allclose(found.T, expected, rtol=1e-12)


@settings(max_examples=20, deadline=None)
@given(seed=SEEDS, columns=st.integers(8, 50))
def test_returns_are_sorted_by_column_and_elevation_and_else_keep_their_order(seed, columns):
    rng = np.random.default_rng(seed)
    scan = project_scan(scattered(rng, 400))
    kept = np.flatnonzero(rng.random(len(scan)) < 0.8)
    order, start = sort_into_columns(scan.azimuth, scan.elevation, kept, columns, 64)
    column = np.minimum((scan.azimuth / 8.0 * columns).astype(int), columns - 1)
    fine = np.minimum(((scan.elevation + 2.0) * 16.0).astype(int), 63)
    expected = kept[np.lexsort((kept, fine[kept], column[kept]))]
    assert np.array_equal(order, expected)
    for c in range(columns):
        assert np.array_equal(order[start[c] : start[c + 1]], expected[column[expected] == c])


@given(seed=SEEDS, count=st.integers(1, 300), fraction=st.floats(0.0, 1.0))
def test_a_quantile_is_that_of_numpy(seed, count, fraction):
    values = np.random.default_rng(seed).lognormal(1.0, 2.0, count)
    assert _quantile(values, fraction) == np.quantile(values, fraction)


def test_the_median_of_two_values_is_rounded_as_by_numpy(rng):
    for values in rng.lognormal(1.0, 2.0, (500, 2)):
        assert _quantile(values, 0.5) == np.quantile(values, 0.5)


@settings(deadline=None)
@given(seed=SEEDS, count=st.integers(0, 4000), strays=st.integers(0, 8))
def test_strays_are_far_beyond_nearly_all_returns(seed, count, strays):
    rng = np.random.default_rng(seed)
    planar_m = rng.permutation(
        np.concatenate([rng.uniform(0.0, 20.0, count), rng.uniform(60.0, 119.0, strays)])
    )
    kept = np.flatnonzero((planar_m >= 0.9) & (planar_m <= 120.0))
    if len(kept):
        kept = kept[planar_m[kept] <= 4.0 * np.quantile(planar_m[kept], 0.999)]
    found, farthest_m = _kept(planar_m, HDL_64E)
    assert np.array_equal(found, kept)
    assert farthest_m == planar_m[kept].max(initial=0.0)


def test_a_range_image_does_not_depend_on_the_number_of_threads(monkeypatch):
    scan = street_scan()
    drawn = []
    for threads in ("1", "2", "5"):
        monkeypatch.setenv("INTERVIS_THREADS", threads)
        drawn.append(range_image_of(scan, sensor_of_scan(scan)).pixels)
    assert len(drawn[0]) > 1000, "enough columns for several parts"
    assert np.array_equal(drawn[0], drawn[1])
    assert np.array_equal(drawn[0], drawn[2])


@pytest.mark.parametrize(("times", "beside", "above"), [(0.5, True, False), (2.0, False, True)])
def test_a_neighbour_on_the_border_of_a_cone_lies_in_it(times, beside, above):
    """Two returns a 32nd of a unit apart at the horizon, and exactly half or twice as far up."""
    per_azimuth, per_elevation = direction_scale(0.0)
    assert per_elevation == 1.0
    across = 2.0**-5 * per_azimuth
    azimuth, elevation = np.array([1.0, 1.0 + 2.0**-5]), np.array([0.0, times * across])
    hits = np.array([0, 1])
    lists = list_by_cell(azimuth, elevation, hits, hits[:1], COLUMNS, ROWS)
    found = np.empty((3, 1))
    neighbour_angles(azimuth, elevation, *lists, COLUMNS, ROWS, hits[:1], *found)
    assert np.isfinite(found[:2, 0]).tolist() == [beside, above]
