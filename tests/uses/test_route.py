"""Routes: chainage and offset against brute force, files, and the road surface below."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from intervis import open_drive
from intervis.errors import CalibrationError, DriveError, PointsError, SceneError, SettingsError
from intervis.transform import transform
from intervis.uses.routes.road_surface import RoadSurface
from intervis.uses.routes.route import Route
from intervis.uses.routes.route_file import read_route, route_of_drive
from intervis.uses.routes.target_file import read_targets

PLACES = st.lists(
    st.tuples(st.floats(-50, 50), st.floats(-50, 50)), min_size=2, max_size=12
).filter(lambda rows: sum(np.hypot(*np.subtract(a, b)) for a, b in pairwise(rows)) > 5)


@given(PLACES, st.floats(-60, 60), st.floats(-60, 60))
@example([(0.0, 1.0), (-24.0, 0.0625), (0.0, 1.0), (-25.0, 0.0)], -24.0, 0.0)
def test_a_point_is_located_at_the_nearest_place(places, x: float, y: float) -> None:
    try:
        route = Route.through([[*place, 0.0] for place in places])
    except PointsError:
        return  # all places are near each other
    fine_m = np.linspace(0.0, route.length_m, 20_000)
    distance_m = np.hypot(*(route.at(fine_m)[:, :2] - [x, y]).T)
    (at_m,), (offset_m,) = route.locate([[x, y]])
    assert abs(offset_m) == pytest.approx(distance_m.min(), abs=0.02)
    there = route.at(at_m)[:2]
    assert np.hypot(*(there - [x, y])) == pytest.approx(abs(offset_m), abs=1e-9)


def test_left_is_positive_and_distance_is_horizontal() -> None:
    route = Route.through([[0, 0, 0], [3, 4, 12], [3, 14, 12]])
    assert route.chainage_m.tolist() == [0, 5, 15]
    chainage_m, offset_m = route.locate([[1, 10], [5, 10], [np.nan, 0]])
    np.testing.assert_allclose(chainage_m, [11, 11, np.nan])
    np.testing.assert_allclose(offset_m, [2, -2, np.nan])
    np.testing.assert_allclose(route.shifted(2.0).at([15.0]), [[1, 14, 12]])
    back = route.reversed()
    np.testing.assert_allclose(back.at([0.0, 10.0]), [[3, 14, 12], [3, 4, 12]])
    np.testing.assert_allclose(back.locate([[1, 10]]), [[4], [-2]])


def test_a_standing_vehicle_and_speeds() -> None:
    # 10 m/s, then a stop of 1 s, then 5 m/s.
    x = [0, 1, 2, 2.05, 2.0, 2.1, 2.6, 3.1]
    times = [0, 0.1, 0.2, 0.5, 0.8, 1.2, 1.3, 1.4]
    route = Route.through([[value, 0, 0] for value in x], time_s=times)
    assert route.points[:, 0].tolist() == [0, 1, 2, 2.6, 3.1]
    assert route.speed_mps[0] == pytest.approx(10.0)
    assert route.speed_mps[-1] == pytest.approx(5.0)
    assert route.time_at(1.5) == pytest.approx(0.15)
    np.testing.assert_allclose(
        Route.through([[0, 0, 0], [6, 0, 0], [16, 0, 10]]).extended(5.0).points[-1], [21, 0, 15]
    )
    longer = route.extended(10.0)
    assert longer.length_m == pytest.approx(13.1)
    assert longer.speed_at(13.0) == pytest.approx(5.0)
    assert np.isnan(longer.time_at(13.0))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([[0, 0, 0]],), "needs two places"),
        (([[0, 0, 0], [0.1, 0, 0]],), "needs two places that are 0.2 m apart"),
        (([[0, 0], [5, 0]],), r"must have the shape \(N, 3\)"),
        (([[0, 0, 0], [np.nan, 0, 0]],), r"must have the shape \(N, 3\)"),
        (([[0, 0, 0], [1e300, 0, 0]],), "in metres up to 1e"),
    ],
)
def test_places_that_are_no_route_are_told(arguments, message: str) -> None:
    with pytest.raises(PointsError, match=message):
        Route.through(*arguments)


def test_tracks_out_of_order_are_told() -> None:
    places = [[0, 0, 0], [5, 0, 0], [9, 0, 0]]
    with pytest.raises(PointsError, match=r"must rise, and place 2 \(1.000 s\) is not later"):
        Route.through(places, time_s=[0.0, 2.0, 1.0])
    with pytest.raises(PointsError, match="as many finite times"):
        Route.through(places, time_s=[0.0, 2.0])
    with pytest.raises(PointsError, match="speeds of a route must be positive"):
        Route.through(places, speed_mps=[1.0, 0.0, 1.0])
    with pytest.raises(SettingsError, match="the offset must be a finite number"):
        Route.through(places).shifted(np.nan)
    with pytest.raises(SettingsError, match="too many"):
        Route.through(places).stations(1e-9)


def written(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


def test_files_of_three_formats_give_one_route(tmp_path: Path) -> None:
    kitti = written(
        tmp_path / "poses.txt", "1 0 0 0 0 1 0 0 0 0 1 1.7\n0 -1 0 6 1 0 0 8 0 0 1 1.7\n"
    )
    tum = written(
        tmp_path / "tum.txt", "# time x y z q\n100 0 0 1.7 0 0 0 1\n102 6 8 1.7 0 0 0 1\n"
    )
    points = written(
        tmp_path / "p.csv", "x, y, z, speed_kmh, time_s\n0, 0, 1.7, 18, 100\n6, 8, 1.7, 18, 102\n"
    )
    routes = [read_route(kitti), read_route(tum, 100.0), read_route(points, 100.0)]
    for route in routes:
        np.testing.assert_array_equal(route.points, [[0, 0, 1.7], [6, 8, 1.7]])
    for route in routes[1:]:
        np.testing.assert_allclose(route.speed_mps, 5.0)
        np.testing.assert_allclose(route.time_s, [0.0, 2.0])
    assert np.isnan(routes[0].speed_mps).all()


@pytest.mark.parametrize(
    ("text", "error", "message"),
    [
        ("x,z\n1,2\n", CalibrationError, "must have x and y"),
        ("x,y\n1,2\n3\n", CalibrationError, "way point 2: expected 2 values, got 1"),
        ("x,y\n1,two\n", CalibrationError, "a value of the way points is no number"),
        ("x,y\n1,2\n", PointsError, r"r.csv: a route needs two places"),
        ("1 0 0 0 0 0 0 1\n0 5 0 0 0 0 0 1\n", PointsError, "must rise"),
        ("1 0 0 0 0 0 0 1\n0 5 0\n", CalibrationError, "line 2: expected 8 numbers, got 3"),
        ("1 2 3\n", CalibrationError, "a pose needs 12 numbers"),
    ],
)
def test_files_that_are_no_route_are_told(
    tmp_path: Path, text: str, error: type, message: str
) -> None:
    with pytest.raises(error, match=message):
        read_route(written(tmp_path / "r.csv", text))
    with pytest.raises(DriveError, match="there is no route at"):
        read_route(tmp_path / "nothing.csv")


def ramp(x0: float, x1: float) -> np.ndarray:
    """Returns of a road that rises by 4 %: a hedge 2 m to its left, a ditch 2 m to its right."""
    x, y = np.meshgrid(np.arange(x0, x1, 0.2), np.arange(-3, 3, 0.2))
    z = 0.04 * x + np.select([y > 2, y < -2], [0.8, -0.6], 0.0)
    return np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1)


def test_the_road_below_a_route() -> None:
    route = Route.through([[x, 0, 0.04 * x + 1.7] for x in range(0, 41, 2)])
    road = RoadSurface(route)
    rng = np.random.default_rng(0)
    for x in (5.0, 15.0, 25.0):
        points = ramp(x - 20, x + 20)
        car = (np.abs(points[:, 0] - 30) < 2) & (np.abs(points[:, 1]) < 1)
        points[car, 2] += rng.uniform(0.4, 1.5, car.sum())  # hides the road, as a car ahead does
        points[:, 2] += rng.normal(0, 0.02, len(points))
        road.add(points, np.array([x, 0, 0.04 * x + 1.7]))
    where = np.arange(0.0, 40.0, 1.0)
    np.testing.assert_allclose(road.heights(where), 0.04 * where, atol=0.05)
    assert road.known_share > 0.8


def test_returns_on_the_own_vehicle_are_no_road() -> None:
    points = ramp(-10, 30)
    near = np.abs(points[:, 0] - 10) < 4  # below and around the vehicle no beam meets the road
    bonnet = points[np.abs(points[:, 0] - 10) < 2] + [0, 0, 0.8]
    road = RoadSurface(Route.through([[x, 0, 0.04 * x + 1.7] for x in range(0, 21, 2)]))
    road.add(np.vstack([points[~near], bonnet]), np.array([10.0, 0, 2.1]))
    where = np.arange(1.0, 20.0)
    np.testing.assert_allclose(road.heights(where), 0.04 * where, atol=0.05)


def test_a_route_that_no_scan_saw_has_no_road() -> None:
    road = RoadSurface(Route.through([[0, 0, 0], [10, 0, 0]]))
    assert np.isnan(road.heights(np.array([1.0]))).all()
    assert road.known_share == 0.0
    with pytest.raises(SceneError, match="cut it into parts"):
        RoadSurface(Route.through([[0, 0, 0], [9000, 9000, 0]]))


@pytest.mark.realdata
def test_the_scanner_of_a_real_drive_is_173_cm_above_the_road(shared_data: Path) -> None:
    # KITTI states that the scanner is mounted 1.73 m above the road.
    drive = open_drive(shared_data / "pcd_drive")
    route = route_of_drive(drive)
    road = RoadSurface(route)
    for number in drive.frame_numbers[::4]:
        frame = drive[number]
        road.add(transform(frame.pose, frame.points), frame.pose[:3, 3])
    where = route.stations(1.0)
    height_m = route.at(where)[:, 2] - road.heights(where)
    assert np.median(height_m) == pytest.approx(1.73, abs=0.03)
    assert np.ptp(height_m) < 0.06


# Ways back, cells that are too long


def test_a_route_that_turns_back_is_moved_and_extended():
    route = Route.through([[0, 0, 0], [5, 0, 0], [0, 0, 0]])
    assert route.shifted(1.0).points.tolist() == [[0, 1, 0], [5, 1, 0], [0, -1, 0]]
    assert route.extended(20.0).points[-1].tolist() == [-20, 0, 0]


def test_an_offset_that_overflows_is_refused():
    with pytest.raises(SettingsError, match="offset must be at most"):
        Route.through([[0, 0, 0], [5, 0, 0]]).shifted(1e300)


def test_a_cell_of_a_csv_that_is_too_long_is_one_sentence(tmp_path):
    path = tmp_path / "long.csv"
    path.write_text("x,y,z,name\n1,2,3," + "a" * 200_000 + "\n")
    for read in (read_targets, read_route):
        with pytest.raises(CalibrationError, match="does not parse as CSV"):
            read(path)


def test_the_last_station_is_never_beyond_the_end():
    """A length that rounding makes a little shorter than a whole number of steps."""
    route = Route.through([[0, 0, 0], [0, 5.999999999999993, 0]])
    assert np.isfinite(route.at(route.stations(0.5))).all()
    assert route.locate([[0, 7]])[0].tolist() == [route.length_m]
