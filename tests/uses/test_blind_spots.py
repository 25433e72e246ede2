"""Blind spots behind a wall, with areas worked out on paper; outlines against their cells."""

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from matplotlib.path import Path as Polygon
from PIL import Image
from scipy import ndimage

from intervis.cli import exit_code
from intervis.errors import OutputError, PointsError, SettingsError
from intervis.sight import Scene
from intervis.uses.blind_spots import blind_spots, geojson_of, rings
from intervis.uses.grid_file import save_grid
from intervis.uses.visibility_grid import VisibilityGrid, blind_cells, visibility_grid

SENSOR_M = 1.8


def signed_area(ring: np.ndarray) -> float:
    x, y = ring.T
    return 0.5 * float((x[:-1] * y[1:] - x[1:] * y[:-1]).sum())


@given(arrays(np.bool_, st.tuples(st.integers(1, 7), st.integers(1, 7))))
@settings(max_examples=200, deadline=None)
def test_outlines_hold_their_cells_and_no_others(cells: np.ndarray) -> None:
    label, count = ndimage.label(cells)
    for nth in range(1, count + 1):
        part = label == nth
        outline = rings(part)
        areas = [signed_area(ring) for ring in outline]
        assert sum(areas) == part.sum()
        assert areas[0] > 0
        assert all(area < 0 for area in areas[1:])
        middles = np.argwhere(np.ones_like(part)) + 0.5
        crossings = sum(Polygon(ring).contains_points(middles).astype(int) for ring in outline)
        assert np.array_equal(crossings.reshape(part.shape) % 2 == 1, part)
        for ring in outline:
            assert np.array_equal(ring[0], ring[-1])
            step = np.diff(ring, axis=0)
            assert (np.count_nonzero(step, axis=1) == 1).all()  # along the axes
            assert not (np.sign(step[1:]) == np.sign(step[:-1])).all(axis=1).any()  # no idle corner


def street() -> np.ndarray:
    """Flat ground, a wall of 4 x 2.3 m at x = 8, and a house row at x = 30."""
    azimuth = np.radians(np.arange(-60, 60, 0.25))
    elevation = np.radians(np.arange(-25, 3, 0.3))
    azimuth, elevation = (grid.ravel() for grid in np.meshgrid(azimuth, elevation))
    rays = np.stack(
        [np.cos(azimuth), np.sin(azimuth), np.tan(elevation)], axis=1
    )  # per metre of horizontal range
    ground_m = np.where(rays[:, 2] < 0, -SENSOR_M / np.minimum(rays[:, 2], -1e-9), np.inf)
    wall_m = 8.0 / rays[:, 0]
    hits = (np.abs(wall_m * rays[:, 1]) < 2.0) & (np.abs(wall_m * rays[:, 2] + 0.65) < 1.15)
    row_m = 30.0 / rays[:, 0]
    range_m = np.minimum(np.where(hits, wall_m, np.inf), np.minimum(ground_m, row_m))
    return (rays * range_m[:, None]).astype(np.float32)


def test_spots_without_outlines_are_the_same_otherwise() -> None:
    points = street()
    grid = visibility_grid(Scene.from_scan(points), [0, 0, 0], points, reach_m=24.0, cell_m=0.3)
    spots, plain = blind_spots(grid), blind_spots(grid, has_outlines=False)
    assert len(spots) == len(plain) > 1
    for spot, one in zip(spots, plain, strict=True):
        assert len(spot.outline) >= 1
        assert one.outline == ()
        for name in set(vars(spot)) - {"outline"}:
            assert np.array_equal(
                getattr(spot, name), getattr(one, name), equal_nan=name == "blocker"
            )


def test_a_wall_makes_a_blind_spot_of_the_area_on_paper() -> None:
    points = street()
    grid = visibility_grid(Scene.from_scan(points), [0, 0, 0], points, reach_m=24.0, cell_m=0.3)
    spots = blind_spots(grid)
    (spot,) = [one for one in spots if one.centre[0] > 10 and one.area_m2 > 60]
    assert abs(spot.centre[1]) < 1
    # At a height of 1 m the wall hides the ground behind it as far as its top allows: its top is
    # 0.5 m above the sensor, so to the end of the grid. Width 4 m at x = 8, 12 m at x = 24.
    on_paper_m2 = (24 - 8) * (4 + 12) / 2
    assert spot.area_m2 == pytest.approx(on_paper_m2, rel=0.1)
    assert 8.0 < spot.nearest_m < 9.0  # ends less than 0.4 m behind a surface are not judged
    assert spot.occluded > 0.9
    assert spot.hides == "car"
    assert spot.blocker[0] == pytest.approx(8.0, abs=0.3)
    assert signed_area(spot.outline[0]) == pytest.approx(spot.area_m2)
    assert grid.obstacle[tuple(np.floor((np.array([8.01, 0]) - grid.corner) / 0.3).astype(int))]


def test_what_is_seen_over_a_low_wall_is_no_blind_spot() -> None:
    """A child hides behind the wall, a mast does not."""
    points = street()
    scene = Scene.from_scan(points)
    low, high = (
        visibility_grid(scene, [0, 0, 2.0], points, reach_m=20, height_m=height_m)
        for height_m in (0.5, 3.5)
    )
    just_behind = tuple(np.floor((np.array([10.0, 0]) - low.corner) / low.cell_m).astype(int))
    assert low.state[just_behind] == 0
    assert high.state[just_behind] != 0


def test_ground_is_that_of_the_nearest_scan() -> None:
    x, y = np.meshgrid(np.arange(-9, 9, 0.2), np.arange(-9, 9, 0.2))
    flat = np.stack([x.ravel(), y.ravel(), np.full(x.size, -1.8)], axis=1)
    scene = Scene.from_scan(flat)
    higher = np.eye(4)
    higher[:3, 3] = [40, 0, 3]
    scene.add(flat, higher)
    found = scene.ground_height([[1, 1], [38, 2], [70, 0]])
    np.testing.assert_allclose(found, [-1.8, 1.2, 1.2], atol=1e-4)  # maps are float32
    with pytest.raises(PointsError, match=r"shape \(N, 2\)"):
        scene.ground_height([1.0, 2.0])


def test_hits_of_level_beams_are_no_ground(tmp_path: Path, capsys) -> None:
    azimuth = np.radians(np.arange(0, 360, 0.1))
    scale = 9.0 / np.maximum(np.abs(np.cos(azimuth)), np.abs(np.sin(azimuth)))  # a square room
    level = np.stack([scale * np.cos(azimuth), scale * np.sin(azimuth), 0 * azimuth], axis=1)
    scene = Scene.from_scan(level)
    assert np.isfinite(scene.ground_height([[8.0, 8.0]])).all()  # the map takes hits as ground
    grid = visibility_grid(scene, [0, 0, 0], level, reach_m=12.0)
    assert np.isnan(grid.ground_m).all()
    np.save(tmp_path / "ring.npy", level.astype(np.float32))
    assert exit_code(["blindspots", str(tmp_path / "ring.npy"), "--reach", "12"]) == 0
    out = capsys.readouterr().out
    assert "No cell has ground below the scanner within 20 m: nothing is judged." in out
    assert out.count("\n") == 1


def test_cells_far_from_ground_are_left_out() -> None:
    x, y = np.meshgrid(np.arange(-9, 9, 0.2), np.arange(-9, 9, 0.2))
    flat = np.stack([x.ravel(), y.ravel(), np.full(x.size, -1.8)], axis=1)
    grid = visibility_grid(Scene.from_scan(flat), [20, 0, 0], flat, reach_m=20.0, cell_m=1.0)
    known = np.isfinite(grid.ground_m)
    beside = np.abs(grid.middles[..., 1]) < 8
    ahead_m = grid.middles[..., 0]
    assert known[beside & (ahead_m < 27)].all()
    assert not known[ahead_m > 30].any()
    far = visibility_grid(Scene.from_scan(flat), [100, 100, 0], flat, reach_m=20.0)
    assert blind_spots(far) == []


def test_ground_that_rises_above_the_scanner_is_ground() -> None:
    x, y = np.meshgrid(np.arange(-20, 40, 0.2), np.arange(-9, 9, 0.2))
    hill = np.stack([x.ravel(), y.ravel(), 0.1 * x.ravel() - 1.8], axis=1)
    grid = visibility_grid(Scene.from_scan(hill), [0, 0, 0], hill, reach_m=8.0)
    higher = visibility_grid(Scene.from_scan(hill), [30, 0, 3], hill, reach_m=8.0)
    assert np.isfinite(grid.ground_m).all()
    assert (higher.ground_m > 0.2).all()


def test_without_ground_nothing_is_judged() -> None:
    y, z = np.meshgrid(np.arange(-1, 1, 0.05), np.arange(0, 2, 0.05))
    wall = np.stack([np.full(y.size, 5.0), y.ravel(), z.ravel()], axis=1)[:20]
    scene = Scene.from_scan(wall)
    grid = visibility_grid(scene, [0, 0, 0], wall, reach_m=5)
    if np.isnan(grid.ground_m).all():
        assert not blind_cells(grid).any()
        assert blind_spots(grid) == []


@pytest.mark.parametrize(
    ("lengths", "message"),
    [
        ({"cell_m": 0.0}, "cell_m must be a positive length"),
        ({"reach_m": np.inf}, "reach_m must be a finite number"),
        ({"reach_m": 1000.0, "cell_m": 0.1}, "20,000 x 20,000 cells"),
    ],
)
def test_a_grid_that_makes_no_sense_is_told(lengths: dict[str, float], message: str) -> None:
    with pytest.raises(SettingsError, match=message):
        visibility_grid(Scene.from_scan(street()), [0, 0, 0], street(), **lengths)


def made_grid() -> VisibilityGrid:
    state = np.array([[1, 1, 0], [1, -1, 0]], np.int8)  # two cells along x, three along y
    return VisibilityGrid(
        np.zeros(3),
        np.array([-1.0, 2.0]),
        0.5,
        1.0,
        state,
        np.full((2, 3), 0.5),
        np.full((2, 3, 3), np.nan),
        np.zeros((2, 3)),
        np.array([[False, True, False], [False, False, False]]),
    )


def test_files_of_a_grid(tmp_path: Path) -> None:
    grid = made_grid()
    save_grid(tmp_path / "g.pgm", grid)
    with Image.open(tmp_path / "g.pgm") as image:
        # Rows from the largest y down, columns along x.
        assert np.asarray(image).tolist() == [[205, 205], [0, 205], [254, 254]]
    text = (tmp_path / "g.yaml").read_text()
    assert "image: g.pgm\nresolution: 0.5\norigin: [-1.000000, 2.000000, 0.0]\n" in text
    save_grid(tmp_path / "g.npz", grid)
    with np.load(tmp_path / "g.npz") as arrays:
        for name in arrays.files:
            np.testing.assert_array_equal(arrays[name], getattr(grid, name))
    with pytest.raises(OutputError, match=r".npz or .pgm"):
        save_grid(tmp_path / "g.tif", grid)


def test_geojson_of_the_spots() -> None:
    grid = made_grid()
    (spot,) = blind_spots(grid, least_area_m2=0.1)
    assert spot.area_m2 == 3 * 0.25
    (feature,) = geojson_of([spot], grid)["features"]
    ring = np.array(feature["geometry"]["coordinates"][0])
    assert signed_area(ring) == pytest.approx(0.75)
    assert ring.min(axis=0).tolist() == [-1.0, 2.5]
    assert ring.max(axis=0).tolist() == [0.0, 3.5]
    assert feature["properties"]["blocker"] is None


def test_the_command(tmp_path: Path, capsys) -> None:
    np.save(tmp_path / "street.npy", street())
    outlines, grid = tmp_path / "b.geojson", tmp_path / "b.pgm"
    picture = tmp_path / "b.png"
    command = ["blindspots", str(tmp_path / "street.npy"), "--reach", "15", "--cell", "0.5"]
    written = ["--geojson", str(outlines), "--grid", str(grid), "--picture", str(picture)]
    assert exit_code([*command, *written]) == 0
    out = capsys.readouterr().out
    assert "car" in out
    content = json.loads(outlines.read_text())
    assert content["type"] == "FeatureCollection"
    assert len(content["features"]) >= 1
    assert grid.read_bytes().startswith(b"P5\n60 60\n255\n")
    assert picture.stat().st_size > 10_000
    assert exit_code([*command, "--cell", "-1"]) == 2
    assert "cell_m must be a positive length" in capsys.readouterr().err
