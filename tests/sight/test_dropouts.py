"""Beams without a return between two returns of one surface."""

from pathlib import Path

import numpy as np
import pytest

from intervis.drives import open_drive
from intervis.errors import ArgumentError
from intervis.sight import Scene
from intervis.sight import occupancy_model as model
from intervis.sight.answers import sum_lines
from intervis.sight.kernels.pixel import is_dropout, is_observed
from intervis.sight.range_image import range_image_of
from intervis.sight.reference import reference_result
from intervis.sight.sensor import Sensor

KITTI_RAW = Path(__file__).parents[3] / "shared/data/kitti_raw/2011_09_26"
SENSOR = Sensor("made", 32, -24.0, 7.0, 0.5, 1.0, 100.0, 0.02)
"""Beams one degree apart."""
AZIMUTH, ELEVATION = np.meshgrid(np.arange(-30, 30, 0.5), np.arange(-24.0, 8.0), indexing="ij")


def wall(range_m=10.0, silent=None, far_m=None):
    """A wall across x, seen in a window of azimuth and elevation, degrees.

    `silent` (from, to, from, to) is a window without returns; above it the wall is `far_m` away.
    """
    azimuth, elevation = AZIMUTH.ravel(), ELEVATION.ravel()
    kept = np.ones(len(azimuth), bool)
    x = np.full(len(azimuth), range_m)
    if silent is not None:
        left, right, low, high = silent
        columns = (azimuth >= left) & (azimuth <= right)
        kept = ~(columns & (elevation >= low) & (elevation <= high))
        if far_m is not None:
            x[columns & (elevation > high)] = far_m
    rho = x / np.cos(np.radians(azimuth))
    y, z = x * np.tan(np.radians(azimuth)), rho * np.tan(np.radians(elevation))
    return np.column_stack([x, y, z])[kept]


def pixel_ahead(points, elevation_deg, azimuth_deg=0.25):
    """The pixel of a direction, and the metres of its unit."""
    image = range_image_of(points, SENSOR)
    column = int((azimuth_deg % 360.0) / 360.0 * len(image.pixels))
    row = (np.tan(np.radians(elevation_deg)) - image.elevation_from) / image.elevation_step
    return int(image.pixels[column, round(row)]), image.unit_m


@pytest.mark.parametrize(
    ("value", "dropout", "observed"),
    [(0, 0, 0), (1, 0, 1), (2, 0, 1), (32767, 0, 1), (-1, 1, 0), (-2, 0, 1), (-32767, 1, 0)],
)
def test_value_of_a_pixel(value, dropout, observed):
    for kind in (int, np.int16, np.int32):
        assert is_dropout(kind(value)) == dropout
        assert is_observed(kind(value)) == observed


def test_a_hole_in_a_wall_is_a_dropout_where_the_wall_would_be():
    points = wall(silent=(-5, 5, -8, -3))
    value, unit_m = pixel_ahead(points, -5.5)
    assert is_dropout(value)
    assert -value * unit_m == pytest.approx(10.0, abs=3 * unit_m + 0.01)
    assert pixel_ahead(points, -9.5)[0] > 0
    assert pixel_ahead(points, -5.5, azimuth_deg=10.25)[0] > 0


@pytest.mark.parametrize(
    ("silent", "far_m", "bridged"),
    [
        ((-5, 5, -11, -3), None, True),  # ten degrees from return to return
        ((-5, 5, -15, -3), None, False),  # fourteen: more than 0.2 of pseudo-elevation
        ((-5, 5, -8, -3), 11.5, True),  # ranges that differ by 15 %
        ((-5, 5, -8, -3), 12.5, False),  # by 25 %: two surfaces
        ((-5, 5, -8, 8), None, False),  # nothing above
        ((-5, 5, -25, -3), None, False),  # nothing below
    ],
)
def test_what_is_bridged(silent, far_m, bridged):
    value, _ = pixel_ahead(wall(silent=silent, far_m=far_m), -5.5)
    assert is_dropout(value) == bridged
    assert bridged or value == 0


def test_rows_that_no_beam_scans_hold_no_dropouts():
    # No beam from -8 to -3 degrees, at any azimuth: an unequal spacing of rows.
    points = wall()
    elevation_deg = np.degrees(np.arctan2(points[:, 2], np.hypot(points[:, 0], points[:, 1])))
    gap = (elevation_deg > -8.5) & (elevation_deg < -2.5)
    assert gap.sum() > 500
    assert pixel_ahead(points[~gap], -5.5)[0] == 0
    # One column of returns is less than 5 % of the others; a sixth of them is more.
    azimuth_deg = np.degrees(np.arctan2(points[:, 1], points[:, 0]))
    assert pixel_ahead(points[~gap | (azimuth_deg > 29.2)], -5.5)[0] == 0
    assert is_dropout(pixel_ahead(points[~gap | (azimuth_deg > 20)], -5.5)[0])


def test_a_line_through_a_hole_in_a_surface_is_unknown_and_improbable():
    eye, inside = np.zeros(3), np.array([[14.0, 0.1, -14.0 * np.tan(np.radians(5.5))]])
    holed, lower = (
        Scene.from_scan(wall(silent=(-5, 5, low, -3)), sensor=SENSOR) for low in (-8, -25)
    )
    through = holed.sight(eye, inside)
    assert through.unknown[0], "no return says that a surface occludes it"
    assert through.observed[0] < 0.1
    # Without returns below the hole nothing says that the wall goes on.
    assert through.probability[0] < 0.5 < lower.sight(eye, inside).probability[0]
    before = holed.sight(eye, 0.6 * inside)
    assert before.probability[0] > through.probability[0] + 0.2


def test_engine_and_reference_agree_on_dropouts(rng):
    points = wall(silent=(-12, 9, -8, -3))
    points = points[rng.random(len(points)) > 0.1]
    scans = Scene.from_scan(points, sensor=SENSOR).packed_scans()
    a = rng.uniform([-2, -4, -2], [6, 4, 1], (400, 3))
    b = rng.uniform([8, -6, -4], [16, 6, 1], (400, 3))
    sums = sum_lines(scans, a, b)
    results = [reference_result(scans, p, q) for p, q in zip(a, b, strict=True)]
    for name in ("free", "surface", "unobserved", "unobserved_m", "end_occluded_m"):
        expected = [getattr(result, name) for result in results]
        np.testing.assert_allclose(getattr(sums, name), expected, rtol=1e-9, atol=1e-9)
    # The lines meet dropouts: without their curve the sums differ.
    tables = model.MODEL.tables
    curve = tables.depth_log_odds.copy()
    curve[2 * (len(curve) // 3) : -1] = 0.0
    without = model.MODEL._replace(tables=tables._replace(depth_log_odds=curve))
    plain = sum_lines(scans, a, b, without)
    assert (np.abs(plain.unobserved - sums.unobserved) > 0.1).mean() > 0.05
    assert np.array_equal(plain.surface, sums.surface)


@pytest.mark.skipif(not KITTI_RAW.is_dir(), reason="shared/data/kitti_raw is absent")
def test_a_black_car_of_few_returns_is_not_called_visible():
    scan = open_drive(KITTI_RAW / "2011_09_26_drive_9001_sync")[0].points
    behind = Scene.from_scan(scan).sight([0, 0, 0], [[8.1, 3.15, -0.9]])
    assert behind.unknown[0]
    assert behind.probability[0] < 0.8


def test_a_scan_of_which_returns_were_left_out_has_no_dropouts():
    """Without the returns of the window, as if they had been of a class that is not wanted."""
    eye, inside = np.zeros(3), np.array([[14.0, 0.1, -14.0 * np.tan(np.radians(5.5))]])
    scene = Scene(sensor=SENSOR)
    scene.add(wall(silent=(-5, 5, -8, -3)), complete=False)
    assert scene.sight(eye, inside).probability[0] > 0.5
    values = scene.packed_scans().pixels
    assert not ((values < 0) & (values % 2 == 1)).any()
    with pytest.raises(ArgumentError, match="complete"):
        scene.add(wall(), complete="yes")
