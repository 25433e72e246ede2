"""The sensor of a scan, by numbers on paper: each rule of `intervis.sight.sensor` by itself."""

import numpy as np
import pytest
from test_projected_scan import neighbours_by_definition

from intervis.errors import SettingsError
from intervis.sight import GENERIC, SENSORS, Sensor, sensor_named, sensor_of_scan
from intervis.sight.projected_scan import project_scan
from intervis.sight.sensor import _beam_count, _spacings_deg

DATA_SHEETS = {  # beams, field of view, azimuth step at 10 Hz, range limits, beam divergence
    "HDL-64E": (64, -24.8, 2.0, 0.173, 0.9, 120.0, 0.11),
    "HDL-32E": (32, -30.67, 10.67, 0.166, 0.9, 100.0, 0.16),
    "VLP-16": (16, -15.0, 15.0, 0.2, 0.5, 100.0, 0.17),
    "OS1-128": (128, -22.5, 22.5, 0.352, 0.5, 120.0, 0.35),
    "generic": (64, -30.0, 30.0, 0.2, 0.5, 120.0, 0.2),
}


@pytest.mark.parametrize("name", DATA_SHEETS)
def test_presets_are_those_of_the_data_sheets(name):
    assert sensor_named(name.upper()) == SENSORS[name] == Sensor(name, *DATA_SHEETS[name])
    assert len(SENSORS) == len(DATA_SHEETS)


LIMITS = [
    ({"beams": 1}, True),
    ({"beams": np.int64(4)}, True),
    ({"lowest_deg": -90.0, "highest_deg": 90.0}, True),
    ({"lowest_deg": -90.1}, False),
    ({"highest_deg": 90.1}, False),
    ({"azimuth_step_deg": 10.0}, True),
    ({"azimuth_step_deg": 10.1}, False),
    ({"azimuth_step_deg": -0.1}, False),
    ({"min_range_m": 0.0}, True),
    ({"min_range_m": -0.1}, False),
    ({"min_range_m": 50.0}, False),
    ({"divergence_deg": 0.0}, True),
    ({"divergence_deg": 5.0}, True),
    ({"divergence_deg": 5.1}, False),
    ({"divergence_deg": -0.1}, False),
]


@pytest.mark.parametrize(("values", "valid"), LIMITS)
def test_a_sensor_is_checked_to_its_limits(values, valid):
    good = dict(zip(list(vars(GENERIC))[1:], (4, -9.0, 9.0, 0.2, 1.0, 50.0, 0.1), strict=True))
    if valid:
        assert vars(Sensor("x", **(good | values))).items() >= values.items()
    else:
        with pytest.raises(SettingsError):
            Sensor("x", **(good | values))


def test_beams_share_the_field_of_view():
    assert Sensor("x", 4, -9.0, 9.0, 0.2, 1.0, 50.0, 0.1).beam_spacing_deg == 6.0
    assert Sensor("x", 1, -9.0, 9.0, 0.2, 1.0, 50.0, 0.1).beam_spacing_deg == 18.0


def grid(azimuth_deg, elevation_deg, range_m=20.0):
    """Returns at all pairs of azimuth and elevation, row by row."""
    a, e = np.meshgrid(np.radians(azimuth_deg), np.radians(elevation_deg))
    rays = np.stack([np.cos(a) * np.cos(e), np.sin(a) * np.cos(e), np.sin(e)], axis=-1)
    return range_m * rays.reshape(-1, 3)


def test_a_hundred_returns_farther_than_a_decimetre_make_a_sensor():
    scan = grid(np.arange(11), np.arange(9))  # 99 returns
    for extra_m, derived in ((0.09, False), (0.1, False), (0.11, True)):
        sensor = sensor_of_scan(np.vstack([scan, [[extra_m, 0.0, 0.0]]]))
        assert (sensor != GENERIC) == derived, extra_m


def test_values_of_a_regular_scan():
    """Beams 2 degrees apart from -10 to 10, returns 1 degree apart, at 150 m, one at 0.3 m."""
    scan = grid(np.arange(0, 90, 1.0), np.arange(-10, 11, 2.0), 150.0)
    sensor = sensor_of_scan(scan)
    assert (sensor.name, sensor.beams) == ("derived", 11)
    assert sensor.lowest_deg == pytest.approx(-10.0)
    assert sensor.highest_deg == pytest.approx(10.0)
    # the cosine of the elevation narrows the step: the median is that of the beams at 4 degrees
    assert sensor.azimuth_step_deg == pytest.approx(np.cos(np.radians(6.0)), rel=2e-2)
    assert sensor.min_range_m == 0.5
    assert sensor.max_range_m == pytest.approx(150.0)
    assert sensor.divergence_deg == GENERIC.divergence_deg
    near = sensor_of_scan(np.vstack([0.1 * scan, [[0.3, 0, 0]]]))
    assert near.min_range_m == pytest.approx(0.3)
    assert near.max_range_m == GENERIC.max_range_m


@pytest.mark.parametrize(("near_share", "highest_deg"), [(0.18, 10.0), (0.24, 40.0)])
def test_the_nearest_fifth_of_the_returns_does_not_count_for_the_field_of_view(
    near_share, highest_deg
):
    scan = grid(np.arange(0, 360, 2.0), np.linspace(-10, 10, 11))
    count = round(len(scan) * near_share / (1 - near_share))
    near = grid(np.linspace(0, 359, count), [40.0], 5.0)
    sensor = sensor_of_scan(np.vstack([scan, near]))
    assert sensor.highest_deg == pytest.approx(highest_deg, abs=0.1)


@pytest.mark.parametrize(("strays", "counted"), [(6, False), (10, True)])
def test_a_thousandth_of_the_returns_does_not_count_for_the_field_of_view(strays, counted):
    """Of 8000 returns: the eighth lowest and the eighth highest are the limits."""
    plain = grid(np.linspace(0, 358, 400), np.linspace(-5, 5, 20))
    for sign in (-1.0, 1.0):
        scan = plain.copy()
        scan[:strays] = grid(np.arange(strays) * 9.0, [sign * 50.0])
        sensor = sensor_of_scan(scan)
        limit = sensor.lowest_deg if sign < 0 else sensor.highest_deg
        assert limit == pytest.approx(sign * (50.0 if counted else 5.0), abs=0.6)


@pytest.mark.parametrize("elevation_deg", [10.0, -35.0])
def test_a_ring_reaches_half_a_step_above_and_below(elevation_deg):
    step_deg = 0.5 * np.cos(np.radians(elevation_deg))
    sensor = sensor_of_scan(grid(np.arange(0, 360, 0.5), [elevation_deg]))
    assert sensor.beams == 1
    assert sensor.azimuth_step_deg == pytest.approx(step_deg, rel=0.01)
    assert sensor.lowest_deg == pytest.approx(elevation_deg - 0.5 * step_deg, abs=0.01)
    assert sensor.highest_deg == pytest.approx(elevation_deg + 0.5 * step_deg, abs=0.01)


@pytest.mark.parametrize("sign", [-1, 1])
def test_a_ring_around_the_pole_stays_below_it(sign):
    sensor = sensor_of_scan(grid(np.arange(0, 360, 1.0), [sign * 89.9]))
    assert 0.5 * (sensor.lowest_deg + sensor.highest_deg) == pytest.approx(sign * 89.0)


def test_a_column_of_beams_takes_their_spacing_for_its_step():
    sensor = sensor_of_scan(grid([30.0], np.arange(-30, 30, 0.5)))
    assert sensor.azimuth_step_deg == pytest.approx(0.5, rel=0.01)
    assert sensor.beam_spacing_deg == pytest.approx(0.5, rel=0.05)


def test_the_step_is_between_a_fiftieth_of_a_degree_and_five_degrees():
    dense = sensor_of_scan(grid(np.arange(0, 1, 0.01), [0.0, 1.0, 2.0]))
    assert dense.azimuth_step_deg == 0.02
    wide = sensor_of_scan(grid(np.arange(0, 360, 6.0), np.arange(-10, 11, 2.0)))
    assert wide.azimuth_step_deg == 5.0
    fair = sensor_of_scan(grid(np.arange(0, 360, 4.5), np.arange(-10, 11, 2.0)))
    assert fair.azimuth_step_deg == pytest.approx(4.5, rel=0.03)


def test_scattered_points_without_neighbours_are_of_a_generic_sensor():
    assert sensor_of_scan(grid(np.arange(0, 360, 30.0), np.arange(-80, 81, 16.0))) == GENERIC


# --- the number of beams ---


def beams_of(counts, spacing):
    """Beams of elevations from 0 to 1 degree, so many in each of the 20 bins."""
    middles = -0.025 + (np.arange(20) + 0.5) * 1.05 / 20
    return _beam_count(np.repeat(middles, counts), 0.0, 1.0, spacing)


def bins(**counts):
    """Counts of 20 bins: b3=7 puts 7 elevations into bin 3."""
    return [counts.get(f"b{nth}", 0) for nth in range(20)]


@pytest.mark.parametrize(
    ("counts", "beams"),
    [
        (bins(b0=9, b4=9, b9=9, b15=9), 4),
        (bins(b0=9, b1=9, b4=9, b9=9, b15=9), 4),  # one beam in two bins
        (bins(b3=9, b4=9, b9=9, b15=9, b19=9), 4),
        (bins(b0=9, b4=9, b19=9), None),  # three peaks are too few
        (bins(b0=13, b4=13, b9=13, b15=1), None),  # 1 is half of the mean of 40 / 20
        (bins(b0=13, b4=13, b9=13, b15=2), 4),
        (bins(b0=27, b4=27, b9=27, b15=3), 4),  # more than half of 84 / 20
        (bins(**{f"b{nth}": 9 for nth in range(0, 18, 2)}), 9),
        (bins(**{f"b{nth}": 9 for nth in range(0, 20, 2)}), None),  # half of the bins are full
        ([9] * 20, None),
    ],
)
def test_beams_are_peaks_in_the_histogram_of_elevations(counts, beams):
    """Without four clear peaks the spacing says how many fit: round(1 / spacing) + 1, or 2."""
    assert beams_of(counts, 0.3) == (beams or 4)
    assert beams_of(counts, 0.15) == (beams or 8)
    assert beams_of(counts, 5.0) == (beams or 2)


def test_the_histogram_has_eight_bins_at_least():
    """Elevations 0 to 0.2 degrees: bins of 0.25 / 8 degrees, in which four peaks fit."""
    middles = -0.025 + (np.array([0, 2, 5]) + 0.5) * 0.25 / 8
    assert _beam_count(np.repeat(middles, 9), 0.0, 0.2, 0.1) == 3
    assert _beam_count(np.repeat([0.0, 0.1, 0.2], 9), 0.0, 0.2, 0.04) == 6


# --- spacings ---


def spacings_by_definition(scan, hits):
    """The spacings as the text of `sensor` has them, over all returns."""
    picked = hits[np.linspace(0, len(hits) - 1, min(len(hits), 600)).astype(int)]
    found = [np.nan, np.nan]
    for columns, rows in ((360, 229), (90, 57)):
        angles = np.array(
            [
                neighbours_by_definition(scan.azimuth, scan.elevation, hits, i, columns, rows)
                for i in picked
            ]
        ).T
        for n in (0, 1):
            known_deg = np.degrees(angles[n][np.isfinite(angles[n])])
            if np.isnan(found[n]) and 2 * len(known_deg) >= len(picked):
                found[n] = float(np.median(known_deg))
        if not np.isnan(found).any():
            break
    both = np.isfinite(angles[0]) & np.isfinite(angles[1])
    if both.any():
        scatter = angles[2][both] / (angles[0][both] * angles[1][both])
        low, high = np.quantile(scatter, [0.25, 0.75])
        if high / low > 2.6:
            return found[0] * max(high, 1.0), found[1] * max(high, 1.0)
    return found[0], found[1]


def scan_at(azimuth_deg, elevation_deg):
    """A projected scan of returns at some azimuths and elevations."""
    a, e = np.radians(np.ravel(azimuth_deg)), np.radians(np.ravel(elevation_deg))
    rays = np.stack([np.cos(a) * np.cos(e), np.sin(a) * np.cos(e), np.sin(e)], axis=1)
    return project_scan(9.0 * rays)


def test_irregular_spacings_never_shrink():
    """Half of the returns lie in a grid, where the solid angle of a return is the product of its
    spacings. The others lie in rows 0.06 degrees apart, each a third of a step farther: a return
    has its neighbour above three rows up, and a third of that solid angle."""
    step_deg = 0.2
    rows, columns = np.meshgrid(np.arange(-30, 30), np.arange(100), indexing="ij")
    sheared = step_deg * (columns + rows / 3.0), 0.3 * step_deg * rows
    rows, columns = np.meshgrid(np.arange(-12, 12), np.arange(250), indexing="ij")
    even = 90.0 + step_deg * columns, step_deg * rows
    scan = scan_at(
        *(np.concatenate([np.ravel(x), np.ravel(y)]) for x, y in zip(sheared, even, strict=True))
    )
    hits = np.arange(len(scan))
    found = _spacings_deg(scan, hits)
    np.testing.assert_allclose(found, spacings_by_definition(scan, hits), rtol=1e-9)
    assert found[0] == pytest.approx(step_deg, rel=0.15), "times the upper quartile, near one"


@pytest.mark.parametrize("spread", [0.0, 0.3, 0.4, 3.0])
@pytest.mark.parametrize("step_deg", [0.6, 1.7, 4.5])
def test_spacings_are_medians_between_neighbours_and_grow_where_the_returns_are_irregular(
    step_deg, spread
):
    """Beams in a grid, displaced at random by a part of their spacing."""
    rng = np.random.default_rng(int(10 * step_deg + 100 * spread))
    half = 15.0 * step_deg
    azimuth, elevation = np.meshgrid(
        np.arange(-half, half, step_deg), np.arange(-half, half, 1.3 * step_deg)
    )
    azimuth = azimuth + spread * step_deg * rng.normal(size=azimuth.shape)
    elevation = np.clip(elevation + spread * step_deg * rng.normal(size=azimuth.shape), -80, 80)
    scan = scan_at(azimuth, elevation)
    hits = np.flatnonzero(rng.random(len(scan)) < 0.95)
    expected = spacings_by_definition(scan, hits)
    np.testing.assert_allclose(_spacings_deg(scan, hits), expected, rtol=1e-9)
