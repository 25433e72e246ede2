"""Siting on a walled square whose answers follow on paper; returns counted beam by beam; files."""

import csv
import io
import itertools
import json
from pathlib import Path

import numpy as np
import pytest
import walled_square
from hypothesis import given, settings
from hypothesis import strategies as st

from intervis import open_drive
from intervis.cli import exit_code
from intervis.errors import CalibrationError, DriveError, PointsError, SceneError, SettingsError
from intervis.sight import SENSORS, Scene
from intervis.uses.routes.route import Route
from intervis.uses.routes.zone import Zone, read_zones
from intervis.uses.sites import coverage as coverage_module
from intervis.uses.sites.candidate import (
    Candidate,
    candidates_along,
    candidates_within,
    check_candidates_in_scene,
)
from intervis.uses.sites.candidate_file import read_candidates, read_users
from intervis.uses.sites.coverage import OUT_OF_REACH, coverage
from intervis.uses.sites.demand import (
    demand_of_points,
    demand_of_zones,
    labelled_users,
    weighted_by_users,
)
from intervis.uses.sites.objective import Objective
from intervis.uses.sites.reach import OBJECTS, Reach, object_size, scanner_with
from intervis.uses.sites.site_figure import COLOURS, siting_picture
from intervis.uses.sites.siting import Siting, best_sites, choose_sites, set_state

EVERYWHERE = Reach(SENSORS["generic"], least_returns=0.0)
EAST = Zone("east", [[6, -8], [16, -8], [16, 8], [6, 8]], 0.4, 1.6)
WEST = Zone("west", [[-16, -8], [-6, -8], [-6, 8], [-16, 8]], 0.4, 1.6, weight=2.0)
CANDIDATES = (
    Candidate("E", [20, 0, 3]),
    Candidate("W", [-20, 0, 3]),
    Candidate("N", [1, 20, 3]),
    Candidate("NE", [6, 20, 3]),
)


@pytest.fixture(scope="module")
def scene() -> Scene:
    return walled_square.scene()


@pytest.fixture(scope="module")
def found(scene: Scene) -> Siting:
    demand = demand_of_zones(scene, [EAST, WEST], 1.0)
    return best_sites(scene, CANDIDATES, demand, 1, reach=EVERYWHERE)


# The square on paper


def test_the_best_place_is_that_of_paper(found: Siting) -> None:
    demand = found.coverage.demand
    paper = np.array([walled_square.sees(one.place, demand.points) for one in CANDIDATES])
    worths = paper @ demand.weight  # 1/3, 2/3, all, and most of it
    np.testing.assert_allclose(worths[:3], [1 / 3, 2 / 3, 1.0], atol=1e-9)
    assert 0.8 < worths[3] < 0.95
    assert [one.name for one in found.sites] == ["N"]
    np.testing.assert_allclose(found.coverage.probability @ demand.weight, worths, atol=0.05)
    told = found.coverage.state >= 0
    assert told.mean() > 0.98
    assert (found.coverage.state == paper)[told].mean() > 0.99
    shares = found.coverage.shares
    np.testing.assert_allclose(sum(shares.values()), 1.0)
    np.testing.assert_allclose(shares["visible"], worths, atol=0.03)
    assert found.attainable > 0.98


@pytest.mark.parametrize(
    ("names", "count", "views", "best"),
    [
        (("E", "W", "NE"), 1, 1, {"NE"}),
        (("E", "W"), 1, 1, {"W"}),
        (("E", "W"), 2, 1, {"E", "W"}),
        (("E", "W", "N", "NE"), 2, 2, {"N", "NE"}),  # (1 + 0.9) / 2 of the views
        (("E", "W", "NE"), 2, 2, {"W", "NE"}),
    ],
)
def test_other_choices_on_paper(
    scene: Scene, names: tuple[str, ...], count: int, views: int, best: set[str]
) -> None:
    taken = [one for one in CANDIDATES if one.name in names]
    demand = demand_of_zones(scene, [EAST, WEST], 2.0)
    paper = np.array([walled_square.sees(one.place, demand.points) for one in taken])
    worth = {
        chosen: float(np.minimum(paper[list(chosen)].sum(axis=0), views) @ demand.weight) / views
        for chosen in itertools.combinations(range(len(taken)), count)
    }
    assert {taken[nth].name for nth in max(worth, key=worth.__getitem__)} == best
    for method in ("greedy", "exact"):
        answer = best_sites(
            scene, taken, demand, count, reach=EVERYWHERE, views=views, method=method
        )
        assert {one.name for one in answer.sites} == best
        assert answer.choice.value == pytest.approx(max(worth.values()), abs=0.05)


def test_two_sides_make_the_whole(scene: Scene) -> None:
    demand = demand_of_zones(scene, [EAST, WEST], 1.0)
    covered = coverage(scene, CANDIDATES[:2], demand, EVERYWHERE)
    both = choose_sites(covered, 2)
    assert both.shares["visible"] == pytest.approx(1.0, abs=0.01)
    assert both.zone_shares(0)["visible"] == pytest.approx(1.0, abs=0.01)
    twice = choose_sites(covered, 2, views=2)  # no target is seen from both sides
    assert twice.shares["visible"] < 0.01
    assert twice.choice.value == pytest.approx(0.5, abs=0.02)
    assert twice.enough < 0.05
    assert both.returns == pytest.approx(covered.returns.sum())


def test_lines_are_those_of_the_scene_in_any_batch(
    scene: Scene, found: Siting, monkeypatch: pytest.MonkeyPatch
) -> None:
    demand, covered = found.coverage.demand, found.coverage
    for nth, one in enumerate(CANDIDATES):
        sight = scene.sight(one.place, demand.points)
        np.testing.assert_array_equal(covered.state[nth], sight.state)
        np.testing.assert_allclose(covered.probability[nth], sight.probability, atol=1e-7)
        free = EVERYWHERE.returns(one.place, demand.points)
        expected = float(demand.weight @ (free * sight.probability))
        assert covered.returns[nth] == pytest.approx(expected)
    notes: list[str] = []
    monkeypatch.setattr(coverage_module, "LINES_AT_ONCE", 700)
    again = coverage(scene, CANDIDATES, demand, EVERYWHERE, progress=notes.append)
    np.testing.assert_array_equal(again.state, covered.state)
    np.testing.assert_allclose(again.returns, covered.returns)
    assert len(notes) == len(coverage_module.batches(4, len(demand.points))) == 4


def test_certain_counts_visible_lines_only(scene: Scene) -> None:
    # Far beyond the outer wall nothing was observed: unknown, and more probable than nothing.
    demand = demand_of_points(np.array([[50.0, 0, 1], [12, 0, 1]]))
    covered = coverage(scene, CANDIDATES[:1], demand, EVERYWHERE)
    assert covered.state[0].tolist()[1] == 1
    assert covered.state[0].tolist()[0] != 1
    plain, certain = choose_sites(covered, 1), choose_sites(covered, 1, certain=True)
    seen = float(covered.probability[0, 1])
    assert certain.choice.value == pytest.approx(0.5 * seen)
    assert plain.choice.value == pytest.approx(0.5 * (seen + float(covered.probability[0, 0])))


@given(st.data())
def test_states_of_sets_by_counting(data) -> None:
    row = st.lists(st.sampled_from([1, 0, -1, -2]), min_size=3, max_size=3)
    state = np.array(data.draw(st.lists(row, min_size=1, max_size=4)), np.int8)
    views = data.draw(st.integers(1, len(state)))
    for target, got in enumerate(set_state(state, views)):
        column = sorted(state[:, target].tolist(), key=[1, -1, 0, -2].index)
        assert got == column[views - 1]  # the views-th best of the states


# Reach


def beams_on_box(scanner, place, centre, size_m, rng: np.random.Generator) -> int:
    """Beams of one sweep ahead that meet a box of a random heading, one by one."""
    yaw = rng.uniform(0, 2 * np.pi)
    azimuth = np.radians(np.arange(-40, 40, scanner.azimuth_step_deg) + rng.uniform(0, 5))
    elevation = np.radians(
        np.linspace(scanner.lowest_deg, scanner.highest_deg, scanner.beams)
        + rng.uniform(-0.5, 0.5) * scanner.beam_spacing_deg
    )
    azimuth, elevation = (one.ravel() for one in np.meshgrid(azimuth, elevation))
    rays = np.column_stack(
        [
            np.cos(elevation) * np.cos(azimuth),
            np.cos(elevation) * np.sin(azimuth),
            np.sin(elevation),
        ]
    )
    turn = np.array([[np.cos(yaw), np.sin(yaw), 0], [-np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    rays, start = rays @ turn.T, turn @ (np.asarray(place) - centre)
    half = 0.5 * np.asarray(size_m)
    first, second = (-half - start) / rays, (half - start) / rays
    near, far = np.minimum(first, second).max(axis=1), np.maximum(first, second).min(axis=1)
    return int(((near < far) & (far > 0)).sum())


@pytest.mark.parametrize("away_m", [15.0, 30.0, 55.0])
@pytest.mark.parametrize("name", ["car", "pedestrian"])
def test_expected_returns_are_those_of_single_beams(away_m: float, name: str) -> None:
    scanner = scanner_with((0.23, 0.31), (-25.0, 15.0), 100.0)
    centre = np.array([away_m, 2.0, 0.8])
    rng = np.random.default_rng(7)
    counts = [beams_on_box(scanner, [0, 0, 5.0], centre, OBJECTS[name], rng) for _ in range(120)]
    expected = Reach(scanner, OBJECTS[name]).returns([0, 0, 5.0], centre[None])[0]
    assert expected == pytest.approx(np.mean(counts), rel=0.06)


def test_expected_returns_from_high_above() -> None:
    # 45 degrees down: there the beams stand closer beside each other, and see the top.
    scanner = scanner_with((0.23, 0.31), (-70.0, 15.0), 100.0)
    centre, eye, size_m = np.array([20.0, 0.0, 0.9]), [0.0, 0.0, 20.9], (1.8, 1.2, 0.7)
    rng = np.random.default_rng(8)
    counts = [beams_on_box(scanner, eye, centre, size_m, rng) for _ in range(80)]
    expected = Reach(scanner, size_m).returns(eye, centre[None])[0]
    assert expected == pytest.approx(np.mean(counts), rel=0.05)


def test_reach_on_paper() -> None:
    scanner = scanner_with((0.2, 0.2), (-30.0, 30.0), 50.0)
    reach = Reach(scanner, (2.0, 2.0, 2.0), least_returns=50.0)
    # From 10 m up, 30 degrees down meet the ground at 17.3 m; 50 m are met at 48.99 m.
    targets = np.array([[17.0, 0, 0], [17.6, 0, 0], [48.9, 0, 0], [49.1, 0, 0], [0.0, 0, 0]])
    returns = reach.returns([0, 0, 10.0], targets)
    assert (returns > 0).tolist() == [False, True, True, False, False]
    # A width of 8 / pi m in the mean over headings and 2 m of height, at 30 m on the level.
    level = reach.returns([0, 0, 0], np.array([[30.0, 0, 0]]))[0]
    assert level == pytest.approx(16 / np.pi / 900 / np.radians(0.2) ** 2)
    assert reach.within(np.array([49.9, 50.0, 0.0])).tolist() == [False, True, False]
    none = Reach(scanner, (2.0, 2.0, 2.0), least_returns=0.0)
    assert none.within(np.array([0.0, 0.1])).tolist() == [False, True]


def test_targets_out_of_reach_are_not_seen(scene: Scene) -> None:
    # From 12 m up, 30 degrees down meet a target at 1 m at 11 tan(60) = 19.05 m.
    targets = np.array([[18.8, 3.0, 1.0], [19.3, 3.0, 1.0]])
    up = Candidate("up", [0.0, 3.0, 12.0])
    west = Candidate("looks west", [10.0, 3.0, 3.0], yaw_deg=180.0, fov_deg=170.0)
    covered = coverage(scene, [up, west], demand_of_points(targets), EVERYWHERE)
    assert covered.state[0, 0] == OUT_OF_REACH
    assert covered.state[0, 1] != OUT_OF_REACH
    assert (covered.state[1] == OUT_OF_REACH).all()
    assert (covered.probability[covered.state == OUT_OF_REACH] == 0.0).all()
    assert covered.shares["out of reach"].tolist() == [0.5, 1.0]
    few = Reach(SENSORS["generic"], least_returns=1e5)
    none = best_sites(scene, [west, up], demand_of_points(targets), 1, reach=few)
    assert none.choice.value == 0.0
    assert none.shares["out of reach"] == 1.0


# Demand


def test_zones_weigh_by_area_and_weight(scene: Scene) -> None:
    demand = demand_of_zones(scene, [EAST, WEST], 0.7)
    assert demand.weight.sum() == pytest.approx(1.0)
    assert demand.weight[demand.zone == 1].sum() == pytest.approx(2 / 3)
    half = Zone("half", [[6, 10], [11, 10], [11, 26], [6, 26]], 0.4, 0.4)  # 80 m2 at one height
    other = demand_of_zones(scene, [EAST, half], 1.0)
    assert other.weight[other.zone == 1].sum() == pytest.approx(80 / (80 + 160))
    heights = demand.points[:, 2] - scene.ground_height(demand.points[:, :2])
    assert sorted(set(heights.round(6))) == [0.4, 1.0, 1.6]
    assert len(demand.points) == 3 * (15 * 23 + 15 * 23)  # 10 m and 16 m in cells of 0.7 m or less


@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1), st.floats(0.0, 1.0))
def test_road_users_by_a_plain_loop(seed: int, background: float) -> None:
    rng = np.random.default_rng(seed)
    points = np.column_stack([rng.uniform(0, 10, (12, 2)), np.ones(12)])
    base = demand_of_points(points, rng.uniform(0.1, 1.0, 12))
    users = np.vstack([rng.uniform(0, 10, (6, 2)), points[:1, :2], [[90.0, 90.0]]])
    amount = rng.uniform(0, 3, 8)
    expected, outside = np.zeros(12), 0
    for user, weight in zip(users, amount, strict=True):
        near = [n for n in range(12) if np.hypot(*(points[n, :2] - user)) <= 2.0]
        outside += not near
        for n in near:
            expected[n] += weight * base.weight[n] / base.weight[near].sum()
    expected = background * base.weight + (1 - background) * expected / expected.sum()
    got = weighted_by_users(base, users, amount, background)
    np.testing.assert_allclose(got.weight, expected)
    assert (got.users, got.users_outside) == (8, outside)


def test_demands_that_make_no_sense(scene: Scene) -> None:
    points = np.array([[0.0, 0, 1], [5, 0, 1]])
    with pytest.raises(PointsError, match="no zone is given"):
        demand_of_zones(scene, [])
    with pytest.raises(PointsError, match="all zones have the weight 0"):
        demand_of_zones(scene, [Zone("z", EAST.corners, weight=0.0)])
    with pytest.raises(PointsError, match="the weight of zone 'z' must be from 0"):
        Zone("z", EAST.corners, weight=-1.0)
    with pytest.raises(PointsError, match="the weight of zone 'z' must be from 0"):
        Zone("z", EAST.corners, weight=float("nan"))
    with pytest.raises(SettingsError, match=r"'east' has too many cells of 0\.001 m"):
        demand_of_zones(scene, [EAST], 0.001)
    with pytest.raises(SettingsError, match="the edge of cells must be a finite number"):
        demand_of_zones(scene, [EAST], float("nan"))
    with pytest.raises(SettingsError, match="too many cells of 1e-300 m"):
        demand_of_zones(scene, [EAST], 1e-300)
    tiny = Zone("tiny", EAST.corners, weight=5e-324)
    with pytest.raises(PointsError, match="all zones have the weight 0"):
        demand_of_zones(scene, [tiny], 1.0)
    with pytest.raises(PointsError, match="finite coordinates"):
        demand_of_points(np.array([[0.0, np.nan, 1]]))
    with pytest.raises(PointsError, match="not all 0"):
        demand_of_points(points, np.array([0.0, 0.0]))
    demand = demand_of_points(points)
    with pytest.raises(PointsError, match="none of 1 road users is within 2 m of a target"):
        weighted_by_users(demand, np.array([[50.0, 0]]))
    with pytest.raises(PointsError, match="places of road users must be finite"):
        weighted_by_users(demand, np.array([[np.nan, 0]]))
    with pytest.raises(PointsError, match="weights of road users must be 0 or more"):
        weighted_by_users(demand, points, np.array([1.0, -1.0]))
    with pytest.raises(PointsError, match="all road users have the weight 0"):
        weighted_by_users(demand, points, np.zeros(len(points)))
    with pytest.raises(SettingsError, match="background must be a share"):
        weighted_by_users(demand, points, background=1.5)


def test_objects_and_scanners_that_make_no_sense() -> None:
    for text in ("bus", "1,2", "1,2,nan", "0,1,1"):
        with pytest.raises(SettingsError, match="an object is car, bicycle, pedestrian, or L,W,H"):
            object_size(text)
    with pytest.raises(SettingsError, match="the spacing of beams must be above 0"):
        scanner_with((0.2, 0.0), (-10, 10), 50)
    for spacing_deg in ((1e-300, 1.0), (1.0, 1e-300), (-1.0, 1.0)):
        with pytest.raises(SettingsError, match="spacing of beams must be 1e-06 degrees or more"):
            scanner_with(spacing_deg, (-10, 10), 50)
    with pytest.raises(SettingsError, match="LOW less than HIGH"):
        scanner_with((0.2, 0.2), (10, -10), 50)
    with pytest.raises(SettingsError, match="the range must be a finite number"):
        scanner_with((0.2, 0.2), (-10, 10), float("inf"))
    with pytest.raises(SettingsError, match="least_returns must be 0 or more"):
        Reach(SENSORS["generic"], least_returns=-1.0)


# Candidates


def test_a_lattice_along_a_route_and_within_a_polygon(scene: Scene) -> None:
    route = Route.through([[-20, -15, 0], [20, -15, 0]])
    along = candidates_along(scene, route, 10.0, offsets_m=(-3.0, 3.0), mast_m=6.0)
    assert [one.name for one in along][:2] == ["-3 at 0", "-3 at 10"]
    places = np.array([one.place for one in along])
    np.testing.assert_allclose(places[:5, 0], [-20, -10, 0, 10, 20])
    np.testing.assert_allclose(places[:, 1], [-18] * 5 + [-12] * 5)
    np.testing.assert_allclose(places[:, 2], 6.0, atol=0.02)
    inside = candidates_within(scene, [EAST], 4.0)
    assert {one.name for one in inside} == {f"east {nth}" for nth in range(1, 13)}
    assert EAST.contains(np.array([one.place[:2] for one in inside])).all()
    far = Route.through([[900, 0, 0], [950, 0, 0]])
    with pytest.raises(SceneError, match="none of the candidates has ground that the scans show"):
        candidates_along(scene, far, 10.0)
    with pytest.raises(PointsError, match="more than 20,000: take them farther apart"):
        candidates_along(scene, route, 0.001)
    with pytest.raises(SettingsError, match="the height of the mast must be 0 m or more, got -1"):
        candidates_within(scene, [EAST], 4.0, mast_m=-1.0)


def test_candidates_of_files(scene: Scene, tmp_path: Path) -> None:
    table = tmp_path / "c.csv"
    table.write_text("name,x,y,z,height,yaw_deg,fov_deg\nA,1,2,7,,90,120\n,3,-12,,4,,\nC,5,6,,,,\n")
    rows = [{"name": "A", "x": 1, "y": 2, "z": 7, "yaw_deg": 90, "fov_deg": 120}]
    rows += [{"x": 3, "y": -12, "height": 4}, {"name": "C", "x": 5, "y": 6}]
    (tmp_path / "c.json").write_text(json.dumps(rows))
    features = [
        {
            "geometry": {
                "type": "Point",
                "coordinates": [row.pop(axis) for axis in "xyz" if axis in row],
            },
            "properties": row,
        }
        for row in rows
    ]
    (tmp_path / "c.geojson").write_text(json.dumps({"features": features}))
    for name in ("c.csv", "c.json", "c.geojson"):
        first, second, third = read_candidates(tmp_path / name, scene, mast_m=6.0)
        assert (first.name, second.name, third.name) == ("A", "2", "C")
        assert (first.yaw_deg, first.fov_deg, third.fov_deg) == (90.0, 120.0, 360.0)
        np.testing.assert_allclose(first.place, [1, 2, 7])
        np.testing.assert_allclose(second.place, [3, -12, 4], atol=0.02)
        np.testing.assert_allclose(third.place, [5, 6, 6], atol=0.02)


@pytest.mark.parametrize(
    ("name", "text", "error", "message"),
    [
        ("a.csv", "x,y\n1,nan\n", CalibrationError, "candidate 1: y must be a number, got 'nan'"),
        ("a.csv", "x,y\n1,\n", CalibrationError, "candidate 1: it needs x and y in metres"),
        ("a.csv", "x,y\n1,2,3\n", CalibrationError, "a row has more values than the heading"),
        ("a.csv", "x,y\n", CalibrationError, "holds no candidates"),
        ("a.csv", "x,y\n999,0\n", SceneError, "candidate '1' lies 981 m from every scan"),
        (
            "a.csv",
            "x,y,height\n1,9,-2\n",
            CalibrationError,
            "1: height is above the ground and must",
        ),
        (
            "a.csv",
            "x,y,z\n1,9,2\n1,9,-3\n",
            SceneError,
            "candidate '2' lies 3.0 m below the ground",
        ),
        ("a.csv", "x;y\n1;2\n", CalibrationError, "separate the columns by commas, got 'x;y'"),
        ("a.csv", "x\ty\n1\t2\n", CalibrationError, "separate the columns by commas"),
        ("a.csv", "x,y,x\n1,2,3\n", CalibrationError, "two columns are called 'x'"),
        ("a.csv", "name,x,y\nA,1,0\nA,2,0\n", PointsError, "two candidates are called 'A'"),
        ("a.csv", "x,y,fov_deg\n1,0,400\n", PointsError, "a field of view above 0 and up to 360"),
        ("a.json", "{", DriveError, "is no JSON: give candidates as CSV, JSON or GeoJSON"),
        ("a.json", "{}", DriveError, "a list of objects with x and y, or points"),
        ("a.json", "[[1, 2]]", DriveError, "a list of objects with x and y, or points"),
        ("a.json", '[{"x": true, "y": 1}]', CalibrationError, "x must be a number, got 'True'"),
        ("a.json", '[{"x": [1], "y": 1}]', CalibrationError, "x must be a number"),
        ("a.geojson", '{"features": [{"geometry": null}]}', DriveError, "feature 1 is no point"),
        ("a.geojson", '{"features": [3]}', DriveError, "feature 1 is no point"),
    ],
)
def test_candidate_files_that_make_no_sense(
    scene: Scene, tmp_path: Path, name: str, text: str, error: type, message: str
) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(error, match=message):
        read_candidates(tmp_path / name, scene)


def test_requests_that_make_no_sense(scene: Scene, found: Siting, tmp_path: Path) -> None:
    demand = found.coverage.demand
    with pytest.raises(SettingsError, match="9 places cannot be chosen from 4 candidates"):
        best_sites(scene, CANDIDATES, demand, 9, reach=EVERYWHERE)
    with pytest.raises(PointsError, match="candidates must be 1 to 20,000 in number, got 0"):
        check_candidates_in_scene(scene, [])
    with pytest.raises(SceneError, match=r"candidate .deep. lies 2\.0 m below the ground"):
        coverage(scene, [CANDIDATES[0], Candidate("deep", [20, 0, -2])], demand, EVERYWHERE)
    with pytest.raises(PointsError, match="the place of candidate 'A' must be three finite"):
        Candidate("A", [0, 0, float("nan")])
    with pytest.raises(SettingsError, match="lines, and at most 50,000,000 are answered"):
        coverage(scene, CANDIDATES * 20_000, demand, EVERYWHERE)
    with pytest.raises(DriveError, match="there are no candidates at"):
        read_candidates(tmp_path / "no.csv", scene)
    with pytest.raises(DriveError, match="there are no road users at"):
        read_users(tmp_path / "no.csv")
    file = tmp_path / "u.csv"
    for text, message in (
        ("a,b\n1,2\n", "road users need a heading with x, y"),
        ("x,y\n1,nan\n", "row 1: y must be a number"),
        ("x,y\n1,\n", "row 1: x, y must be numbers"),
        ("x,y,weight\n1,2,-3\n", "row 1: the weight is negative"),
        ("x,y,weight\n1,2,\n", "row 1: weight must be numbers"),
    ):
        file.write_text(text)
        with pytest.raises(CalibrationError, match=message):
            read_users(file)
    file.write_text("x,y,weight\n1,2,3\n4,5,0\n")
    places, weights = read_users(file)
    assert places.tolist() == [[1, 2], [4, 5]]
    assert weights.tolist() == [3, 0]


def test_a_drive_without_labels_has_no_road_users(tmp_path: Path) -> None:
    drive = open_drive(walled_square.write(tmp_path / "square"))
    with pytest.raises(DriveError, match="has no labelled objects in these frames"):
        labelled_users(drive, list(drive.frame_numbers)[:1])


# The command


@pytest.fixture(scope="module")
def square(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    walled_square.write(folder / "square")
    features = [
        {
            "type": "Feature",
            "properties": {"name": zone.name, "low_m": 0.4, "high_m": 1.6, "weight": zone.weight},
            "geometry": {"type": "Polygon", "coordinates": [zone.corners.tolist()]},
        }
        for zone in (EAST, WEST)
    ]
    content = {"type": "FeatureCollection", "features": features}
    (folder / "zones.geojson").write_text(json.dumps(content))
    rows = [",".join([one.name, *map(str, one.place)]) for one in CANDIDATES]
    (folder / "places.csv").write_text("name,x,y,z\n" + "\n".join(rows) + "\n")
    return folder


def test_the_command_writes_what_it_prints(square: Path, tmp_path: Path, capsys) -> None:
    command = ["site", str(square / "square"), "-k", "2", "--zones", str(square / "zones.geojson")]
    command += ["--candidates", str(square / "places.csv"), "--scanner", "generic"]
    files = {name: tmp_path / f"s.{name}" for name in ("csv", "json", "geojson", "png")}
    for option, path in zip(("csv", "json", "geojson", "picture"), files.values(), strict=True):
        command += [f"--{option}", str(path)]
    assert exit_code(command) == 0
    said = capsys.readouterr().out
    assert "4 candidates, 960 targets" in said
    assert "No other 2 candidates reach more. All 4 candidates together reach" in said
    columns = [line.split() for line in said.splitlines() if line[:2] in ("E ", "W ", "N ")]
    first, second = (float(line[-11]) for line in columns)  # covered, in per cent
    adds = [float(line[-13]) for line in columns]
    assert first == adds[0]
    assert second == pytest.approx(sum(adds), abs=0.11)
    with files["csv"].open() as file:
        rows = list(csv.DictReader(file))
    assert [row["name"] for row in rows] == ["E", "W", "N", "NE"]
    answer = json.loads(files["json"].read_text())
    assert answer["method"] == "exact"
    chosen = [row for row in rows if row["rank"]]
    assert {row["name"] for row in chosen} == set(answer["sites"])
    assert sum(float(row["gain"]) for row in chosen) == pytest.approx(answer["value"], abs=1e-5)
    for row in rows:
        states = ("visible", "occluded", "unknown", "out_of_reach")
        assert sum(float(row[word]) for word in states) == pytest.approx(1.0, abs=1e-5)
    assert float(rows[1]["visible"]) == pytest.approx(2 / 3, abs=0.02)
    assert answer["settings"]["scanner"]["name"] == "generic"
    features = json.loads(files["geojson"].read_text())["features"]
    assert [one["geometry"]["type"] for one in features] == ["Point"] * 4 + ["Polygon"] * 2
    assert sum(one["properties"].get("chosen", False) for one in features) == 2
    assert files["png"].read_bytes().startswith(b"\x89PNG")


def test_weights_and_lattices_of_the_command(square: Path, tmp_path: Path, capsys) -> None:
    (tmp_path / "users.csv").write_text("x,y,weight\n10,0,5\n10,1,5\n99,9,1\n")
    (tmp_path / "targets.csv").write_text("x,y,z,weight\n10,0,1,3\n-10,0,1,1\n")
    (tmp_path / "line.csv").write_text("x,y\n-20,0\n20,0\n")
    base = ["site", str(square / "square"), "--along", str(tmp_path / "line.csv"), "--every", "40"]
    base += ["--mast", "3", "--scanner", "generic", "--least-returns", "0"]
    users = ["--zones", str(square / "zones.geojson"), "--users", str(tmp_path / "users.csv")]
    assert exit_code([*base, *users]) == 0
    said = capsys.readouterr().out
    assert "+0 at 40 " in said  # the east, where the road users are, though the west weighs more
    assert "3 places of road users, 1 of them not at a target" in said
    assert exit_code([*base, "--targets", str(tmp_path / "targets.csv")]) == 0
    assert "+0 at 40 " in capsys.readouterr().out
    assert exit_code([*base, "--zones", str(square / "zones.geojson")]) == 0
    assert "+0 at 0 " in capsys.readouterr().out


def test_one_scan_without_a_pose_is_a_scene_in_its_own_frame(
    square: Path, tmp_path: Path, capsys
) -> None:
    """The scan at (6, 18), once with its pose, once without, everything else moved with it."""
    at = np.array([6.0, 18.0, walled_square.HEIGHT_M])
    scan = (square / "square" / "000004.bin").read_bytes()
    answers = []
    for name, moved in (("posed", 0.0), ("bare", 1.0)):
        folder = tmp_path / name
        folder.mkdir()
        (folder / "000000.bin").write_bytes(scan)
        if not moved:
            (folder / "poses.txt").write_text(f"1 0 0 {at[0]} 0 1 0 {at[1]} 0 0 1 {at[2]}\n")
        points = np.array([[x, y, 1.0] for x in range(-12, 13, 4) for y in range(4, 25, 4)]) + 0.3
        places = np.array([one.place for one in CANDIDATES])
        for file, rows in (("targets.csv", points), ("places.csv", places)):
            text = "".join(",".join(map(str, row)) + "\n" for row in rows - moved * at)
            (folder.parent / file).write_text(f"x,y,z\n{text}")
        command = ["site", str(folder), "--targets", str(tmp_path / "targets.csv"), "-k", "2"]
        command += ["--candidates", str(tmp_path / "places.csv"), "--scanner", "generic"]
        command += ["--json", str(tmp_path / f"{name}.json")]
        command += ["--picture", str(tmp_path / f"{name}.png")]
        assert exit_code(command) == 0
        frame = "its scan" if moved else "its poses"
        assert f"1 scan; 4 candidates, 42 targets; coordinates in the frame of {frame}." in (
            capsys.readouterr().out
        )
        answers.append(json.loads((tmp_path / f"{name}.json").read_text()))
    posed, bare = answers
    assert posed["sites"] == bare["sites"]
    assert posed["value"] == pytest.approx(bare["value"], abs=0.01)
    assert 0.2 < bare["value"] < 1.0


def test_several_scans_without_poses_are_one_sentence(square: Path, tmp_path: Path, capsys) -> None:
    for name in ("000000.bin", "000001.bin"):
        (tmp_path / name).write_bytes((square / "square" / name).read_bytes())
    command = ["site", str(tmp_path), "--zones", str(square / "zones.geojson"), "--along", "way"]
    assert exit_code(command) == 2
    assert "beside the scans, or choose one frame, which is then" in capsys.readouterr().err
    assert exit_code([*command, "--frames", "0"]) == 2
    assert "so it has no route of its own: give one as a file." in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ([], "give either --zones FILE.geojson or --targets FILE"),
        (["--zones", "z"], "give candidates by one of --candidates FILE, --along FILE|way"),
        (["--zones", "z", "--along", "way", "--within", "w"], "give candidates by one of"),
        (["--zones", "z", "--along", "way", "--mast", "nan"], "--mast must be from 0 to 1000 m"),
        (["--zones", "z", "--along", "way", "--object", "tree"], "an object is car, bicycle"),
        (
            ["--zones", "z", "--along", "way", "--offset", "left"],
            "--offset must be metres to the left",
        ),
        (["--zones", "z", "--along", "way", "--scanner", "X"], "there is no sensor 'X'"),
        (["--zones", "z", "--along", "way", "--range", "0"], "--range must be a positive length"),
        (["--zones", "z", "--along", "way", "--beam-spacing", "1"], "--beam-spacing is AZ,EL"),
        (["--zones", "z", "--along", "way", "--beam-spacing", "a,b"], "must be two angles"),
        (["--zones", "z", "--along", "way", "--beam-spacing", "1,1"], "give its --range"),
        (["--zones", "z", "--along", "way", "--field", "-9,9"], "give --beam-spacing, too"),
        (["--zones", "ZONES", "--along", "way", "--every", "5", "-k", "99"], "99 places cannot"),
        (["--zones", "ZONES", "--along", "way", "--combine", "sum"], "combine must be one of best"),
        (["--zones", "ZONES", "--along", "way", "--method", "fast"], "the method must be one of"),
        (["--zones", "ZONES", "--along", "way", "--users", "labels"], "has no labelled objects"),
        (["--zones", "z", "--along", "way", "--background", "0.2"], "--background is about the"),
        (["--zones", "none", "--along", "way"], "there are no zones at none"),
        (["--zones", "ZONES", "--along", "none"], "there is no route at none"),
        (["--zones", "CROSSING", "--along", "way"], "'z' crosses itself"),
        (["--zones", "FLAT", "--along", "way"], "zone 'z' has no area"),
        (["--zones", "DEGREES", "--along", "way"], "metres in the frame of the poses, not long"),
        (["--zones", "FAR", "--along", "way"], "lie more than 150 m from every scan"),
        (["--targets", "NAN", "--along", "way"], "target 1: x, y and z must be numbers"),
    ],
)
def test_commands_that_make_no_sense(
    square: Path, tmp_path: Path, options: list, message: str, capsys
) -> None:
    shapes = {
        "CROSSING": [[0, 0], [4, 4], [4, 0], [0, 4]],
        "FLAT": [[0, 0], [1e-3, 0], [0, 1e-3]],
        "DEGREES": [[8.4194, 49.0112], [8.4196, 49.0112], [8.4196, 49.0113], [8.4194, 49.0113]],
        "FAR": [[900, 0], [904, 0], [904, 4]],
    }
    names = {"ZONES": square / "zones.geojson", "NAN": tmp_path / "nan.csv"}
    (tmp_path / "nan.csv").write_text("x,y,z\n1,nan,1\n")
    for name, ring in shapes.items():
        geometry = {"type": "Polygon", "coordinates": [ring]}
        features = [{"type": "Feature", "properties": {"name": "z"}, "geometry": geometry}]
        names[name] = tmp_path / f"{name}.geojson"
        names[name].write_text(json.dumps({"features": features}))
    given_options = [str(names.get(one, one)) for one in options]
    assert exit_code(["site", str(square / "square"), "--frames", "0:3", *given_options]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert "Traceback" not in error


def test_no_output_over_an_input(square: Path, capsys) -> None:
    command = ["site", str(square / "square"), "--zones", str(square / "zones.geojson")]
    places = square / "places.csv"
    before = places.read_bytes()
    assert exit_code([*command, "--candidates", str(places), "--csv", str(places)]) == 2
    assert "which this command reads and never changes" in capsys.readouterr().err
    assert places.read_bytes() == before


def test_the_picture_shows_states_and_places(found: Siting) -> None:
    figure = siting_picture(found, np.zeros((0, 3)))
    (axes,) = figure.axes
    words = [text.get_text() for text in figure.legends[0].get_texts()]
    assert all(word.endswith(" % of the weight") for word in words[:-2])
    assert words[-2:] == ["candidate", "chosen"]
    assert any(word.startswith("visible, ") for word in words)
    stars = axes.collections[-1].get_offsets()
    np.testing.assert_allclose(stars, [[1.0, 20.0]])
    drawn = sum(len(one.get_offsets()) for one in axes.collections[: len(COLOURS)])
    assert drawn >= len(found.state) / 3  # three heights above each other are one square


@pytest.mark.parametrize(
    ("wide_m", "tall_m"), [(24.0, 2.0), (43.0, 11.5), (30.0, 30.0), (5.0, 60.0)]
)
def test_the_picture_cuts_neither_title_nor_legend(wide_m: float, tall_m: float) -> None:
    x, y = np.meshgrid(np.linspace(0, wide_m, 5), np.linspace(0, tall_m, 5))
    places = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, 2.0)])
    ground = np.column_stack([places[:, :2], np.zeros(x.size)])
    demand = demand_of_points(places, np.arange(1.0, x.size + 1))
    poles = [Candidate(str(rank), place) for rank, place in enumerate(places[:3])]
    scene = Scene.from_scan(ground - np.array([0.0, 0.0, 1.7]))
    figure = siting_picture(best_sites(scene, poles, demand, 1, reach=EVERYWHERE), ground)
    figure.savefig(io.BytesIO())
    width_px, height_px = figure.bbox.size
    (axes,), (legend,) = figure.axes, figure.legends
    assert axes.get_tightbbox().y1 <= height_px
    assert 0.0 <= legend.get_window_extent().x0
    assert legend.get_window_extent().x1 <= width_px


def test_zones_of_a_file_have_weights(square: Path) -> None:
    assert [zone.weight for zone in read_zones(square / "zones.geojson")] == [1.0, 2.0]


def test_best_is_the_least_of_all_dependences() -> None:
    seen = np.array([[0.6, 0.5], [0.6, 0.2]], np.float32)
    best, apart = (Objective(seen, np.ones(2), 1, how) for how in ("best", "independent"))
    assert best.value([0, 1]) == pytest.approx((0.6 + 0.5) / 2, abs=1e-6)
    assert apart.value([0, 1]) == pytest.approx((0.84 + 0.6) / 2, abs=1e-6)
