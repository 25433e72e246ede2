"""Zones: what lies inside, what crosses itself, and files."""

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from intervis.errors import DriveError, PointsError
from intervis.sight import Scene
from intervis.uses.routes.zone import Zone, read_zones

L_SHAPE = [[0, 0], [6, 0], [6, 2], [2, 2], [2, 5], [0, 5]]


@given(st.floats(0, 2 * np.pi), st.floats(0.2, 5.0))
def test_inside_and_area_hold_in_any_direction(angle: float, scale: float) -> None:
    turn = scale * np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    zone = Zone("L", np.array(L_SHAPE) @ turn.T)
    assert zone.area_m2 == pytest.approx(18.0 * scale**2)
    x, y = np.meshgrid(np.arange(-1.25, 7, 0.5), np.arange(-1.25, 7, 0.5))
    points = np.column_stack([x.ravel(), y.ravel()])
    in_foot = (points > 0).all(axis=1) & (points < [6, 2]).all(axis=1)
    in_leg = (points > 0).all(axis=1) & (points < [2, 5]).all(axis=1)
    np.testing.assert_array_equal(zone.contains(points @ turn.T), in_foot | in_leg)


def test_samples_fill_the_zone_at_three_heights() -> None:
    x, y = np.meshgrid(np.arange(-15, 15, 0.2), np.arange(-15, 15, 0.2))
    flat = np.stack([x.ravel(), y.ravel(), np.full(x.size, -2.0)], axis=1)
    zone = Zone("L", L_SHAPE, 0.2, 1.8)
    samples = zone.samples(Scene.from_scan(flat))
    assert sorted(set(samples[:, 2].round(6))) == [-1.8, -1.0, -0.2]
    assert zone.contains(samples[:, :2]).all()
    # The share of samples in a part of the zone is that of its area: 8 of 18 m2 lie at x > 2.
    assert np.mean(samples[:, 0] > 2) == pytest.approx(8 / 18, abs=0.03)
    thin = Zone("thin", [[0, 0], [40, 0.01], [40, 0.03], [0, 0.02]], 1.0, 1.0)
    assert len(thin.samples(Scene.from_scan(flat))) >= 1


@pytest.mark.parametrize(
    ("corners", "message"),
    [
        ([[0, 0], [4, 4], [4, 0], [0, 4]], "'z' crosses itself: its edges 1 and 3 meet"),
        ([[0, 0], [4, 0], [4, 4], [2, 0], [0, 4]], "crosses itself"),  # a corner on an edge
        ([[0, 0], [4, 0], [2, 0]], "crosses itself"),  # folds back
        ([[0, 0], [4, 0], [4, 0], [4, 4]], "crosses itself"),  # a corner twice
        ([[0, 0], [1e-3, 0], [0, 1e-3]], "has no area"),
        ([[0, 0], [4, 0]], "three corners or more"),
        ([[0, 0], [4, 0], [np.inf, 1]], "three corners or more"),
        ([[0, 0, 1], [4, 0, 1], [4, 4, 1]], "three corners or more"),
    ],
)
def test_polygons_that_make_no_sense_are_told(corners, message: str) -> None:
    with pytest.raises(PointsError, match=message):
        Zone("z", corners)


def test_heights_must_be_in_order() -> None:
    with pytest.raises(PointsError, match=r"a lower and an upper height, got 2.0 and 1.0"):
        Zone("z", L_SHAPE, 2.0, 1.0)


def feature(coordinates, **properties) -> dict:
    geometry = {"type": "Polygon", "coordinates": coordinates}
    return {"type": "Feature", "geometry": geometry, "properties": properties}


def test_zones_of_a_file(tmp_path: Path) -> None:
    square = [[0, 0], [2, 0], [2, 2], [0, 2], [0, 0]]
    file = tmp_path / "z.geojson"
    features = [feature([square], name="kerb", low_m=0, high_m=1.2), feature([square])]
    file.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    kerb, other = read_zones(file)
    assert (kerb.name, kerb.low_m, kerb.high_m, kerb.area_m2) == ("kerb", 0.0, 1.2, 4.0)
    assert (other.name, other.low_m, other.high_m) == ("zone 2", 0.2, 2.0)


@pytest.mark.parametrize(
    ("content", "error", "message"),
    [
        ("{", DriveError, "no JSON"),
        ("[" * 100_000, DriveError, "no JSON"),
        ("[]", DriveError, "has no features"),
        ('{"features": [3]}', DriveError, "feature 1 is no polygon"),
        ('{"features": [{"geometry": {"type": "Point"}}]}', DriveError, "feature 1 is no polygon"),
        (json.dumps({"features": [feature([["a"]])]}), DriveError, "feature 1 is no polygon"),
        (json.dumps({"features": [feature([L_SHAPE, L_SHAPE])]}), PointsError, "has holes"),
        (json.dumps({"features": [feature([L_SHAPE], low_m="x")]}), DriveError, "no polygon"),
    ],
)
def test_files_that_hold_no_zones_are_told(
    tmp_path: Path, content: str, error: type, message: str
) -> None:
    file = tmp_path / "z.geojson"
    file.write_text(content)
    with pytest.raises(error, match=message):
        read_zones(file)
    with pytest.raises(DriveError, match="there are no zones at"):
        read_zones(tmp_path / "nothing")


# Shapes and numbers that would take all memory, or overflow


@pytest.mark.parametrize("width_m", [1e-3, 2e-6])
def test_a_thin_zone_is_sampled_inside_without_much_work(width_m):
    zone = Zone("thin", [[0, 0], [140, 1], [140, 1 + width_m]])
    cells = zone._cells()
    assert 1 <= len(cells) < 10_000
    assert zone.contains(cells).all()


def test_a_thin_zone_of_two_arms_is_sampled_inside():
    arms = [[0, 0], [500, 400], [0, 1e-3], [-1, 5e-4]]
    zone = Zone("arms", arms)
    assert zone.contains(zone._cells()).all()


def test_a_zone_has_a_bounded_number_of_corners():
    angle = np.linspace(0, 2 * np.pi, 501, endpoint=False)
    circle = np.column_stack([np.cos(angle), np.sin(angle)]) * 9
    with pytest.raises(PointsError, match="may have 500 corners"):
        Zone("round", circle)
    assert Zone("round", circle[::2]).area_m2 > 200


@pytest.mark.parametrize(
    "zone",
    [
        ([[0, 0], [1e308, 0], [0, 1e308]], 0.0, 2.0),
        ([[0, 0], [1, 0], [0, 1]], -1e300, 2.0),
        ([[0, 0], [1, 0], [0, 1]], 0.0, float("inf")),
    ],
)
def test_numbers_that_overflow_are_one_sentence(zone):
    with pytest.raises(PointsError, match=r"^zone 'a' .*\.$"):
        Zone("a", *zone)


def test_a_number_that_no_float_holds_is_one_sentence(tmp_path):
    path = tmp_path / "zones.geojson"
    feature = {"type": "Polygon", "coordinates": [[[0, 0], [10**400, 0], [0, 1]]]}
    path.write_text(json.dumps({"features": [{"geometry": feature, "properties": {}}]}))
    with pytest.raises(DriveError, match="feature 1 is no polygon of numbers"):
        read_zones(path)
