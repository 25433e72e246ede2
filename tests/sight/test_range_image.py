"""Charts, ground and sensors against scans whose every range is known by formula."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_scans import GROUND_M, directions, ranges, street_scan

from intervis.errors import SettingsError
from intervis.sight import GENERIC, HDL_64E, SENSORS, Sensor, sensor_named, sensor_of_scan
from intervis.sight.ground_map import ground_map_of
from intervis.sight.kernels.projection import (
    FULL_CIRCLE,
    pseudo_azimuth,
    pseudo_elevation,
)
from intervis.sight.kernels.terrain import CELL_M, CELLS
from intervis.sight.range_image import range_image_of

NOTHING = np.empty((0, 6))


def at_pixels(image):
    """Azimuth (radians) and slope of the middles of a image's cells."""
    columns, rows = image.pixels.shape
    slope = image.elevation_from + np.arange(rows) * image.elevation_step
    return (np.arange(columns) + 0.5) * (2 * np.pi / columns), slope


@given(st.floats(-np.pi, np.pi), st.floats(0.01, 100.0))
def test_pseudo_azimuth_follows_the_azimuth_to_a_tenth_of_a_degree(azimuth, range_m):
    units = pseudo_azimuth(range_m * np.cos(azimuth), range_m * np.sin(azimuth))
    assert 0.0 <= units <= FULL_CIRCLE
    off_deg = (units * 45.0 - np.degrees(azimuth) + 180.0) % 360.0 - 180.0
    assert abs(off_deg) < 0.11


def test_pseudo_azimuth_of_the_sensor_itself_is_a_number():
    assert pseudo_azimuth(0.0, 0.0) == 0.0


def test_pseudo_azimuth_never_falls():
    azimuth = np.linspace(0.0, 2 * np.pi, 20_001)[:-1]
    units = np.array(
        [pseudo_azimuth(x, y) for x, y in zip(np.cos(azimuth), np.sin(azimuth), strict=True)]
    )
    assert (np.diff(units) > 0).all()


def test_a_plane_is_carried_on_exactly_between_the_beams():
    rays = directions(beams=32)
    range_m = ranges(np.zeros(3), rays, NOTHING)
    hit = range_m < 40.0
    image = range_image_of(rays[hit] * range_m[hit, None], HDL_64E)
    _, slope = at_pixels(image)
    rows = (slope < np.tan(np.radians(-12.0))) & (slope > np.tan(np.radians(-24.0)))
    rho = image.unit_m * image.pixels[:, rows].astype(float)
    assert (rho > 0).all(), "a plane is one solid surface"
    assert rho == pytest.approx(np.broadcast_to((GROUND_M / slope[rows]), rho.shape), 1e-3)


def test_a_range_image_reaches_two_of_its_widest_spacings_beyond_its_beams():
    """Beams 2 degrees apart below, 0.3 degrees apart above."""
    elevation_deg = np.concatenate([np.arange(-20.0, -4.0, 2.0), np.arange(-4.0, 4.0, 0.3)])
    e, a = np.meshgrid(np.radians(elevation_deg), np.radians(np.arange(0, 360, 0.2)))
    rays = np.stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)], -1).reshape(-1, 3)
    image = range_image_of(15.0 * rays, HDL_64E)
    tangent = np.tan(np.radians(elevation_deg))
    widest = np.diff(tangent).max()
    _, rows = at_pixels(image)
    assert rows[0] < tangent[0] - 1.5 * widest
    assert rows[-1] > tangent[-1] + 1.5 * widest


def test_directions_without_a_return_hold_nothing():
    image = range_image_of(street_scan(boxes=NOTHING), HDL_64E)
    _, slope = at_pixels(image)
    assert (image.pixels[:, slope > np.tan(np.radians(0.5))] == 0).all()
    assert (image.pixels[:, slope < np.tan(np.radians(-26.5))] == 0).all()


def test_a_lone_return_is_scattered_and_small():
    image = range_image_of(np.array([[10.0, 3.0, 0.5]]), HDL_64E)
    filled = image.pixels != 0
    assert 1 <= filled.sum() <= 6
    assert (image.pixels[filled] < 0).all()


def test_the_order_of_the_returns_does_not_matter(rng):
    scan = street_scan()
    one, other = (
        range_image_of(scan, HDL_64E),
        range_image_of(scan[rng.permutation(len(scan))], HDL_64E),
    )
    assert one.pixels.shape == other.pixels.shape
    # two returns of one beam in one column may swap: the noise of a range, no more
    apart_m = one.unit_m * np.abs(np.abs(one.pixels.astype(float)) - np.abs(other.pixels))
    assert (apart_m < 0.15).mean() > 0.995


def test_ground_rises_with_a_hill_and_not_with_what_stands_on_it(rng):
    x, y = rng.uniform(-50, 50, (2, 200_000))
    z = -1.7 + 0.05 * x
    z[(abs(x - 10) < 2) & (abs(y) < 1)] += 1.5  # a car
    z[:50] = -9.0  # reflections from under the road
    ground_m = ground_map_of(np.stack([x, y, z]), np.arange(len(x)))
    middle = (np.arange(CELLS) + 0.5 - CELLS // 2) * CELL_M
    inside = abs(middle) < 48
    off = ground_m - (-1.7 + 0.05 * middle)[:, None]
    assert abs(off[np.ix_(inside, inside)]).max() < 0.45
    assert np.median(abs(off[np.ix_(inside, inside)])) < 0.05


def test_ground_without_returns_is_unknown():
    assert np.isnan(ground_map_of(np.empty((3, 0)), np.arange(0))).all()


@pytest.mark.parametrize("name", sorted(SENSORS))
def test_a_sensor_is_derived_from_its_scan(name):
    sensor = SENSORS[name]
    rays = directions(sensor.lowest_deg, sensor.highest_deg, sensor.beams, sensor.azimuth_step_deg)
    derived = sensor_of_scan(12.0 * rays)
    assert derived.lowest_deg == pytest.approx(sensor.lowest_deg, abs=0.3)
    assert derived.highest_deg == pytest.approx(sensor.highest_deg, abs=0.3)
    assert derived.beam_spacing_deg == pytest.approx(sensor.beam_spacing_deg, rel=0.6)
    assert derived.azimuth_step_deg == pytest.approx(sensor.azimuth_step_deg, rel=0.6)


def test_a_single_ring_is_one_beam_wide():
    azimuth = np.radians(np.arange(0.0, 360.0, 0.5))
    ring = np.stack([7.0 * np.cos(azimuth), 7.0 * np.sin(azimuth), np.zeros(len(azimuth))], 1)
    sensor = sensor_of_scan(ring)
    assert sensor.beams == 1
    assert sensor.azimuth_step_deg == pytest.approx(0.5, rel=0.01)
    assert sensor.beam_spacing_deg == pytest.approx(0.5, rel=0.01)


@given(
    step_deg=st.sampled_from([0.1, 0.2, 0.35]),
    beams=st.sampled_from([16, 32, 64]),
    half_turn_deg=st.sampled_from([20.0, 60.0, 180.0]),
    kept=st.floats(0.8, 1.0),
    seed=st.integers(0, 1000),
)
@settings(max_examples=25, deadline=None)
def test_the_spacing_does_not_hang_on_counts(step_deg, beams, half_turn_deg, kept, seed):
    """Copies, rows without a return, a cut of azimuth, lost returns, strays and order."""
    rng = np.random.default_rng(seed)
    rays = directions(-15.0, 15.0, beams, step_deg)
    plain = 12.0 * rays
    azimuth_deg = np.degrees(np.arctan2(rays[:, 1], rays[:, 0]))
    scan = plain[(np.abs(azimuth_deg) <= half_turn_deg)]
    scan = scan[rng.random(len(scan)) < kept]
    odd = [scan, scan[::3], np.zeros((len(scan), 3)), rng.normal(0.0, 1e4, (2, 3))]
    found = sensor_of_scan(rng.permutation(np.concatenate(odd)))
    expected = sensor_of_scan(plain)
    assert found.azimuth_step_deg == pytest.approx(expected.azimuth_step_deg, rel=0.05)
    assert found.azimuth_step_deg == pytest.approx(step_deg, rel=0.08)
    assert found.beam_spacing_deg == pytest.approx(expected.beam_spacing_deg, rel=0.15)


@given(st.floats(-np.pi / 2, np.pi / 2), st.floats(0.01, 100.0))
def test_pseudo_elevation_is_monotone_and_odd(elevation, range_m):
    rho, z = range_m * np.cos(elevation), range_m * np.sin(elevation)
    here = pseudo_elevation(rho, z)
    tangent = np.tan(elevation)
    expected = tangent if abs(tangent) <= 1 else np.sign(tangent) * (2 - 1 / abs(tangent))
    assert here == pytest.approx(expected, abs=1e-9)
    assert pseudo_elevation(rho, -z) == pytest.approx(-here, abs=1e-12)
    assert -2.0 <= here <= 2.0


def test_the_poles_are_observed():
    """A sphere of returns is seen in every direction, straight up and down included."""
    rays = directions(-90.0, 90.0, 181, 1.0)
    image = range_image_of(10.0 * rays, sensor_of_scan(10.0 * rays))
    rows = image.elevation_from + np.arange(image.pixels.shape[1]) * image.elevation_step
    inside = np.abs(rows) < 1.99
    planar_m = image.unit_m * np.abs(image.pixels[:, inside].astype(float))
    tangent = np.where(np.abs(rows) <= 1, rows, 2 - np.abs(rows))[inside]
    assert planar_m == pytest.approx(
        np.broadcast_to(10.0 / np.sqrt(1 + tangent**2), planar_m.shape), rel=2e-3
    )


def test_one_stray_does_not_coarsen_the_ranges(rng):
    scan = street_scan()
    stray = np.array([[1e5, 3e4, 10.0]], np.float32)
    sensor = sensor_of_scan(scan)
    one, other = range_image_of(scan, sensor), range_image_of(np.vstack([stray, scan]), sensor)
    assert np.array_equal(one.pixels, other.pixels)
    assert one.unit_m == other.unit_m


def test_a_scan_of_few_returns_is_of_a_generic_sensor():
    assert sensor_of_scan(np.ones((3, 3))) == GENERIC


def test_sensors_that_make_no_sense_are_refused():
    assert sensor_named("vlp-16").name == "VLP-16"
    good = {
        "name": "x",
        "beams": 4,
        "lowest_deg": -9.0,
        "highest_deg": 9.0,
        "azimuth_step_deg": 0.2,
        "min_range_m": 1.0,
        "max_range_m": 50.0,
        "divergence_deg": 0.1,
    }
    assert Sensor(**good).beam_spacing_deg == 6.0
    values = (np.nan, np.inf, "64", None, True)
    odd = [{name: value} for name in good if name != "name" for value in values]
    for bad in (
        {"beams": 0},
        {"beams": 1.5},
        {"lowest_deg": 9.0},
        {"max_range_m": 0.5},
        {"azimuth_step_deg": 0.0},
        *odd,
    ):
        with pytest.raises(SettingsError):
            Sensor(**(good | bad))
