"""Sight distance on roads with a formula: by the engine on simulated scans, and by exact rays.

Exact rays must agree with the paper to a step of the objects. The engine is held to what was
measured with these scans, engine minus paper in metres (objects 0.5 m apart; -0.5 to 0 is exact):

- crest, R = 600 m: AASHTO -4.3 to -1.3, Austroads -6.8 to -0.8. Near the limit the line clears the
  crest by (S^2 - s^2) / (8 R): 4.3 m are 11 cm, 6.8 m are 14 cm of height. Never too far.
- curve with a hedge, R = 80 m: -0.9 to 0.1. Parked cars at a junction: -0.5 to 0.1.
"""

import csv
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import posed_street
import pytest
from numpy.typing import NDArray

from intervis import open_drive
from intervis.cli import exit_code
from intervis.errors import PointsError, SceneError, SettingsError
from intervis.lab.worlds.roads import (
    ParkedRow,
    RoadWorld,
    crest_road,
    crest_sight_m,
    curve_road,
    curve_sight_m,
    junction_road,
)
from intervis.sight import OCCLUDED, UNKNOWN, VISIBLE, Scene
from intervis.transform import rigid, transform
from intervis.uses.routes.route import Route
from intervis.uses.routes.sight_distance import (
    NO_TARGET,
    SightDistances,
    mean_grade,
    sight_distances,
)
from intervis.uses.routes.sight_distance_table import (
    as_csv,
    geojson_of,
    hidden_stretches,
    stations_of,
    summary,
    worst_stations,
)
from intervis.uses.routes.sight_standard import (
    AASHTO,
    AUSTROADS,
    DMRB,
    SightStandard,
    standard_named,
)
from intervis.uses.routes.survey import classes_of, hidden_eyes, route_on_road, survey_of

Array = NDArray[np.float64]
STEP_M = 0.5
SPEED_MPS = 50 / 3.6


def judged(
    world: RoadWorld, scene: Scene, standard: SightStandard, step_m: float, reach_m: float
) -> SightDistances:
    lengths = {"step_m": step_m, "target_step_m": STEP_M, "reach_m": reach_m}
    return sight_distances(scene, world.road, standard, speed_mps=SPEED_MPS, **lengths)


def scanned(world: RoadWorld) -> Scene:
    pytest.importorskip("embreex", reason="embreex, which scans the worlds, is not installed")
    return world.scene(5.0, np.random.default_rng(7), columns=600)


def exact(world: RoadWorld, found: SightDistances) -> SightDistances:
    """The same lines, answered by rays at the triangles of the world."""
    state = np.full(found.state.shape, NO_TARGET, np.int8)
    eye_m, object_m = found.standard.eye_m[0], found.standard.object_m[0]
    for nth, at_m in enumerate(found.chainage_m):
        ahead = at_m + found.distance_m <= world.road.length_m
        ends = world.road.above(at_m + found.distance_m[ahead], object_m)
        hit = world.snapshot.caster.blocked(world.road.above(at_m, eye_m), ends)
        state[nth, ahead] = np.where(hit, OCCLUDED, VISIBLE)
    return replace(found, state=state)


def check(
    found: SightDistances, world: RoadWorld, paper_m: Array, measured: tuple[float, float]
) -> None:
    """Exact rays within a step of the paper, the engine within what was measured."""
    truth = exact(world, found)
    bounded = truth.is_bounded
    assert bounded.sum() >= 10
    error_m = truth.possible_m[bounded] - paper_m[bounded]
    assert error_m.min() > -STEP_M - 0.05  # the crest is 0.5 m long chords, the hedge 0.3 m long
    assert error_m.max() < 0.05
    assert (truth.seen_m == truth.possible_m).all()
    assert found.is_bounded[bounded].all()
    engine_m = found.possible_m[bounded] - paper_m[bounded]
    assert measured[0] <= engine_m.min()
    assert engine_m.max() <= measured[1]
    assert (found.seen_m <= found.possible_m).all()


def test_a_crest() -> None:
    # S = sqrt(2 R) (sqrt(h1) + sqrt(h2)): 34.64 (1.0392 + 0.7746) = 62.8 m for 1.08 and 0.60 m,
    # 34.64 (1.0488 + 0.4472) = 51.8 m for 1.10 and 0.20 m.
    world = crest_road(600.0, 60.0)
    scene = scanned(world)
    for standard, by_hand_m, measured in (
        (AASHTO, 62.8, (-5.0, 0.0)),
        (AUSTROADS, 51.8, (-7.5, 0.0)),
    ):
        paper_m = crest_sight_m(600.0, standard.eye_m[0], standard.object_m[0])
        assert paper_m == pytest.approx(by_hand_m, abs=0.05)
        found = judged(world, scene, standard, 6.0, 80.0)
        check(found, world, np.full(len(found.chainage_m), paper_m), measured)
    at_crest = stations_of(found)[8]  # chainage 48, 12 m before the top
    assert abs(at_crest.blocker_offset_m) < 1.0
    assert at_crest.blocker_height_m == pytest.approx(0.0, abs=0.3)
    assert 50.0 < at_crest.blocker_chainage_m < 110.0


def test_a_curve_is_measured_along_the_path() -> None:
    # Sagitta 5 m of a circle of 80 m: cos(S / 160) = 75 / 80, S = 160 x 0.3554 = 56.9 m along the
    # path. The chord is 2 sqrt(80^2 - 75^2) = 55.7 m.
    world = curve_road(80.0, 5.0, 120.0)
    found = judged(world, scanned(world), AASHTO, 8.0, 80.0)
    assert curve_sight_m(80.0, 5.0) == pytest.approx(56.9, abs=0.05)
    check(found, world, np.full(len(found.chainage_m), 56.86), (-1.5, 0.6))
    middle = stations_of(found)[5]
    # The hedge lies 5 m to the left of the path (its back 6 m), half way to the hidden object.
    assert 4.7 < middle.blocker_offset_m < 6.3
    assert middle.blocker_chainage_m == pytest.approx(middle.chainage_m + 28.4, abs=6.0)


def test_parked_cars_hide_a_stretch_that_reappears() -> None:
    world, row = junction_road(length_m=60.0), ParkedRow()
    found = judged(world, scanned(world), AASHTO, 2.5, 85.0)
    before_m = 30.0 - found.chainage_m
    assert row.first_hidden_m(10.0) == pytest.approx(10 + 80 / 8.5)
    assert row.last_hidden_m(10.0) == pytest.approx(10 + 130 / 6.7)
    nan = float("nan")
    paper_m = np.array([row.first_hidden_m(d) if d > 2 else nan for d in before_m])
    check(found, world, paper_m, (-1.0, 0.6))
    stretches = hidden_stretches(found)
    assert len(stretches) == 11  # from 30 to 5 m before the corner; nearer, the end is not seen
    for one in stretches:
        last_m = row.last_hidden_m(30.0 - one.chainage_m)
        assert one.to_m == pytest.approx(last_m, abs=1.0)
        assert row.near_m - 0.5 < one.blocker[0] < row.far_m
        assert -3.4 < one.blocker[1] < -1.3
    ignoring = replace(found, ignore_m=40.0)
    assert (ignoring.seen_m[:8] > found.seen_m[:8] + 5.0).all()


def straight(state: list[list[int]], required_m: float, ignore_m: float = 0.0) -> SightDistances:
    """Made answers for objects 5, 10, 15 ... m ahead on a straight road."""
    rows = np.array(state, np.int8)
    stations, objects = rows.shape
    ones = np.ones(stations)
    return SightDistances(
        AASHTO,
        Route.through([[0, 0, 0], [100, 0, 0]]),
        10.0 * np.arange(stations),
        5.0 + 5.0 * np.arange(objects),
        *(10.0 * ones, 0.0 * ones, required_m * ones),
        rows,
        np.where(rows == NO_TARGET, np.nan, np.where(rows == 1, 0.9, 0.3)),
        np.where((rows == OCCLUDED)[..., None], [7.0, 2.0, 1.0], np.nan),
        ignore_m,
    )


def test_unknown_is_never_visible() -> None:
    found = straight(
        [
            [1, 1, 1, 1],  # all visible
            [1, 1, -1, 1],  # unknown before the required distance
            [1, 1, 0, 1],  # hidden before it
            [1, 1, -1, 0],  # unknown, then hidden beyond it
            [1, 1, 1, -1],  # unknown beyond it
            [1, 1, -2, -2],  # the path ends before it
            [0, 1, 1, 1],
        ],
        required_m=15.0,
    )
    assert found.seen_m.tolist() == [20, 10, 10, 10, 15, 10, 0]
    assert found.possible_m.tolist() == [20, 20, 10, 15, 20, 10, 0]
    assert found.is_bounded.tolist() == [False, False, True, True, False, False, True]
    words = ["sufficient", "undecided", "deficient", "undecided", "sufficient", "undecided"]
    assert found.verdict.tolist() == [*words, "deficient"]
    np.testing.assert_array_equal(found.deficit_m, [0, np.nan, 5, np.nan, 0, np.nan, 15])
    np.testing.assert_allclose(found.unknown_share, [0, 1 / 3, 0, 1 / 3, 0, 0, 0])
    np.testing.assert_allclose(found.least_probability, [0.9, 0.3, 0.3, 0.3, 0.9, 0.9, 0.3])
    assert worst_stations(found, 5) == [6, 2]


def test_the_end_of_the_path_is_told_where_it_alone_leaves_it_open() -> None:
    rows = [[1, 1, -2, -2], [1, -1, -2, -2], [1, 1, -2, -2], [1, 1, -1, 1]]
    found = straight(rows, required_m=15.0)
    ends_m = found.road.length_m - np.array([12.0, 12.0, 15.0, 12.0])
    found = replace(found, chainage_m=ends_m)
    assert found.verdict.tolist() == ["undecided"] * 4
    assert found.ends_early.tolist() == [True, False, False, False]
    assert summary(found).endswith(
        "4 undecided. 1 of the undecided see all of the path, which ends before the required"
        " distance: --extend M continues it."
    )


def test_short_stretches_can_be_ignored() -> None:
    rows = [[1, 0, 1, 1], [1, 0, 0, 1], [1, 1, 1, 0]]
    assert straight(rows, 15.0, ignore_m=6.0).seen_m.tolist() == [20, 5, 15]  # the last has no end
    assert straight(rows, 15.0, ignore_m=11.0).seen_m.tolist() == [20, 20, 15]
    assert [(one.from_m, one.to_m) for one in hidden_stretches(straight(rows, 15.0))] == [
        (10.0, 10.0),
        (10.0, 15.0),
    ]


def test_rows_and_files() -> None:
    found = straight([[1, 0, 0, 1], [1, 1, 1, 1]], 15.0)
    first, second = stations_of(found)
    place = (first.blocker_chainage_m, first.blocker_offset_m, first.blocker_height_m)
    assert place == pytest.approx((7, 2, 1))
    assert np.isnan(second.blocker_chainage_m)
    heading, one, two = as_csv(found).splitlines()
    cells = dict(zip(heading.split(","), one.split(","), strict=True))
    assert (cells["verdict"], cells["deficit_m"], cells["blocker_offset_m"]) == (
        *("deficient", "10"),
        "2",
    )
    assert dict(zip(heading.split(","), two.split(","), strict=True))["blocker_x"] == ""
    content = geojson_of(found)
    kinds = [one["properties"]["kind"] for one in content["features"]]
    assert kinds == ["station", "blocker", "station", "hidden stretch"]
    assert content["features"][3]["geometry"]["coordinates"] == [[10.0, 0, 0], [15.0, 0, 0]]


@pytest.mark.parametrize(
    ("standard", "speed_kmh", "grade", "printed_m"),
    [
        # AASHTO Green Book, Table 3-1 (calculated) and 3-2; its constants are rounded to 0.278 and
        # 0.039, which is up to 1 % more.
        *((AASHTO, 50, 0.0, 63.5), (AASHTO, 100, 0.0, 184.2), (AASHTO, 120, 0.0, 248.6)),
        *((AASHTO, 100, -0.03, 194), (AASHTO, 100, -0.06, 207), (AASHTO, 100, -0.09, 223)),
        *((AASHTO, 100, 0.03, 174), (AASHTO, 100, 0.06, 167), (AASHTO, 100, 0.09, 160)),
        # DMRB CD 109, Table 2.10, desirable minimum, rounded to 5 m.
        *((DMRB, 50, 0.0, 70), (DMRB, 85, 0.0, 160), (DMRB, 120, 0.0, 295)),
        # Austroads: 2.5 V / 3.6 + V^2 / (254 (0.36 + 0.01 a)).
        (AUSTROADS, 100, 0.0, 2.5 * 100 / 3.6 + 10_000 / (254 * 0.36)),
        (AUSTROADS, 80, -0.05, 2.5 * 80 / 3.6 + 6_400 / (254 * 0.31)),
    ],
)
def test_required_distances(
    standard: SightStandard, speed_kmh: float, grade: float, printed_m: float
) -> None:
    required_m = float(standard.stopping_m(speed_kmh / 3.6, grade))
    assert required_m == pytest.approx(printed_m, rel=0.0105 if standard is AASHTO else 0.045)
    assert abs(required_m - printed_m) < 3.0


def test_grade_and_braking() -> None:
    assert float(DMRB.stopping_m(20.0, -0.1)) == float(DMRB.stopping_m(20.0))
    assert np.isinf(AASHTO.stopping_m(20.0, -0.34))
    road = Route.through([[0, 0, 0], [50, 0, 0], [100, 0, 5]])
    grade = mean_grade(road, np.array([0.0, 40.0, 95.0]), np.array([50.0, 20.0, 50.0]))
    np.testing.assert_allclose(grade, [0.0, 0.05, 0.1])
    road = Route.through([[0, 0, 0], [92, 0, 4.2], [100, 0, 4.2]])
    # The last 10 m of the path rise by 2 m x 4.2 / 92.
    np.testing.assert_allclose(mean_grade(road, np.array([95.0]), np.array([50.0])), 4.2 / 460)


def test_objects_reach_beyond_the_required_distance() -> None:
    road = Route.through([[0, 0, -1.7], [200, 0, -1.7]])
    found = sight_distances(wall_scene(), road, AASHTO, speed_mps=10.0, step_m=100.0)
    assert found.distance_m[0] == 5.0
    assert found.distance_m[-1] == pytest.approx(1.5 * found.required_m.max(), abs=1.0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"eye_m": (11.0,)}, "eye heights must be from 0 to 10 m, got 11"),
        ({"object_m": ()}, "object heights must be from 0 to 10 m, got none"),
        ({"reaction_s": -1.0}, "the reaction time must be from 0 to 10 s"),
        ({"braking": 0.0}, "braking must be from 0.02 to 1"),
    ],
)
def test_numbers_of_a_standard_have_a_range(change: dict, message: str) -> None:
    with pytest.raises(SettingsError, match=message):
        AASHTO.changed(**change)
    with pytest.raises(SettingsError, match="there is no standard 'din'"):
        standard_named("din")


def wall_scene() -> Scene:
    y, z = np.meshgrid(np.arange(-9, 9, 0.1), np.arange(-1.7, 2, 0.1))
    return Scene.from_scan(np.stack([np.full(y.size, 12.0), y.ravel(), z.ravel()], axis=1))


def test_an_eye_that_no_scan_sees_is_found() -> None:
    """Behind the wall at x = 12, 0.9 m above its foot; before it all is free."""
    eyes = np.array([[5.0, 0, -0.8], [11.0, 0, -0.8], [14.0, 0, -0.8], [np.nan, 0, 0], [500, 0, 0]])
    assert hidden_eyes(wall_scene(), eyes).tolist() == [False, False, True, False, False]


def test_an_envelope_takes_the_worst_line() -> None:
    road = Route.through([[0, 0, -1.7], [30, 0, -1.7]])
    lines = {"speed_mps": 5.0, "reach_m": 25.0, "target_step_m": 5.0, "step_m": 10.0}
    over = AASHTO.changed(eye_m=(1.08, 3.0), object_m=(0.6, 4.0))
    scene = wall_scene()
    found = sight_distances(scene, road, over, **lines, risk=0.1)
    for nth, at_m in enumerate(found.chainage_m):
        for k, ahead_m in enumerate(found.distance_m):
            if at_m + ahead_m > 30.0:
                assert found.state[nth, k] == NO_TARGET
                continue
            pairs = [
                scene.sight([at_m, 0, eye_m - 1.7], [[at_m + ahead_m, 0, object_m - 1.7]], risk=0.1)
                for eye_m in (1.08, 3.0)
                for object_m in (0.6, 4.0)
            ]
            states = {int(one.state[0]) for one in pairs}
            worst = OCCLUDED if OCCLUDED in states else UNKNOWN if UNKNOWN in states else VISIBLE
            assert found.state[nth, k] == worst
            assert found.probability[nth, k] == min(float(one.probability[0]) for one in pairs)
    assert {OCCLUDED, UNKNOWN, NO_TARGET} <= set(found.state.ravel().tolist())


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({}, SettingsError, "the route has no speeds: give one"),
        ({"speed_mps": -5.0}, SettingsError, r"up to 360 km/h, got -18 km/h"),
        ({"speed_mps": float("nan")}, SettingsError, "the speed must be a finite"),
        ({"speed_mps": 5.0, "ignore_m": -1.0}, SettingsError, "ignore_m must be 0 or more"),
        ({"speed_mps": 5.0, "step_m": 0.0}, SettingsError, "the step must be a positive"),
        ({"speed_mps": 5.0, "reach_m": 2.0}, SettingsError, "reach_m must be 5 m or more"),
        ({"speed_mps": 5.0, "target_step_m": 1e-7}, SettingsError, "lines are asked, and at most"),
        ({"speed_mps": 5.0, "moments_s": np.zeros((6, 1))}, SceneError, "time of every scan"),
        ({"speed_mps": 5.0, "moments_s": [[0.0]]}, SettingsError, "a row for each of 6 stations"),
        ({"speed_mps": 5.0, "risk": 0.5}, SettingsError, "risk"),
    ],
)
def test_what_makes_no_sense_is_told(arguments: dict, error: type, message: str) -> None:
    road = Route.through([[0, 0, -1.7], [30, 0, -1.7]])
    with pytest.raises(error, match=message):
        sight_distances(wall_scene(), road, AASHTO, **arguments)


def test_a_path_without_heights_or_too_short_is_told() -> None:
    with pytest.raises(PointsError, match="without a height"):
        sight_distances(
            wall_scene(),
            Route.through([[0, 0, 0], [30, 0, 0]]).with_heights(np.array([0, np.nan])),
            AASHTO,
        )
    with pytest.raises(PointsError, match=r"4.0 m long, and objects start 5 m ahead"):
        sight_distances(wall_scene(), Route.through([[0, 0, 0], [4, 0, 0]]), AASHTO)


@pytest.fixture(scope="module")
def street(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return posed_street.write(tmp_path_factory.mktemp("drives") / "street")


def test_the_command(street: Path, tmp_path: Path, capsys) -> None:
    # The van reaches from (22, 1) to (26, 3); the path turns left behind it.
    route = tmp_path / "r.csv"
    route.write_text("x,y,speed_kmh\n0,0,40\n27,0,40\n31,3,20\n38,6,20\n")
    outputs = {
        "--csv": tmp_path / "s.csv",
        "--geojson": tmp_path / "s.geojson",
        "--picture": tmp_path / "s.png",
        "--worst": tmp_path / "worst",
    }
    files = [str(part) for pair in outputs.items() for part in pair]
    command = ["sightdistance", str(street), "--route", str(route), "--spacing", "0"]
    assert exit_code([*command, "--offset", "0.5", *files]) == 0
    out = capsys.readouterr().out
    assert "AASHTO Green Book" in out
    rows = list(csv.DictReader(outputs["--csv"].read_text().splitlines()))
    assert [float(row["speed_kmh"]) for row in rows[:2]] == pytest.approx([40, 40])
    short = [row for row in rows if row["verdict"] == "deficient"]
    assert short
    assert all(21.5 < float(row["blocker_x"]) < 26.5 for row in short)
    assert all(0.5 < float(row["blocker_y"]) < 3.5 for row in short)
    assert json.loads(outputs["--geojson"].read_text())["standard"] == "AASHTO"
    assert outputs["--picture"].stat().st_size > 10_000
    pictures = list(outputs["--worst"].iterdir())
    assert pictures
    assert all(path.stat().st_size > 10_000 for path in pictures)
    reverse = [*command, "--back", "--hz", "10", "--moments", "any", "--eye", "1.05,2"]
    assert exit_code([*reverse, "--standard", "dmrb", "--step", "10"]) == 0
    assert "textbook extract" in capsys.readouterr().out


def test_an_eye_in_the_van_is_told(street: Path, tmp_path: Path, capsys) -> None:
    """The van reaches from (22, 1) to (26, 3): the stations at 23 and 24.5 m stand in it."""
    route = tmp_path / "r.csv"
    route.write_text("x,y,speed_kmh\n0,0,30\n38,0,30\n")
    command = ["sightdistance", str(street), "--route", str(route), "--spacing", "0"]
    assert exit_code([*command, "--step", "1.5"]) == 0
    assert "no scan sees the eye" not in capsys.readouterr().err
    assert exit_code([*command, "--step", "1.5", "--offset", "2"]) == 0
    told = capsys.readouterr().err
    assert "the first at chainage 2" in told
    assert "no scan sees the eye: it stands in an obstacle or behind one" in told
    assert told.count("\n") == 1


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--standard", "din"], "there is no standard 'din': choose one of aashto, dmrb"),
        (["--eye", "high"], "--eye must be heights in metres, as 1.08 or 1.05,2, got 'high'"),
        (["--object", "20"], "object heights must be from 0 to 10 m, got 20"),
        (["--braking", "3"], "braking must be from 0.02 to 1, as a share of gravity, got 3"),
        (["--reaction", "-1"], "the reaction time must be from 0 to 10 s"),
        ([], "the route has no speeds: give one for the whole of it (--speed KM/H)"),
        (["--speed", "-3"], "the speed must be above 0 and up to 360 km/h, got -3 km/h"),
        (["--hz", "0"], "the scans a second must be from 1e-06 to 1e+06, got 0"),
        (["--hz", "1e308"], "the scans a second must be at most 1e+15"),
        (["--mount", "nan"], "the height of the route must be a finite number"),
        (["--mount", "1e308"], "the height of the route must be at most 1e+15"),
        (["--mount", "1e12"], "the height of the route must be at most 1e+09 m"),
        (["--moments", "now"], "--moments must be one of map, pose, any"),
        (["--moments", "pose"], "--moments pose needs times of the scans: give them with --hz"),
        (["--speed", "30", "--step", "-1"], "the step must be a positive length"),
        (["--extend", "500"], "the route leaves the scans at chainage"),
        (["--speed", "30", "--extend", "20", "--hz", "5", "--moments", "pose"], "has no time at"),
    ],
)
def test_requests_that_make_no_sense(street: Path, options: list, message: str, capsys) -> None:
    assert exit_code(["sightdistance", str(street), *options]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1


@pytest.mark.realdata
def test_a_car_hides_the_road_from_a_driveway(shared_data: Path, tmp_path: Path) -> None:
    # A driver leaves a driveway at x = 11.5 and turns right; a car is parked from x = 20.5 to 24.5
    # at y = -1.8 to -3.3 (seen in the scans). From (11.5, -5) the line that touches its corner
    # (20.6, -1.8) meets the path y = -1 at x = 11.5 + 9.1 / 3.2 x 4 = 22.9.
    drive = open_drive(shared_data / "pcd_drive")
    route = Route.through([[11.5, -7, 0], [11.5, -3, 0], [13.5, -1, 0], [60, -1, 0]])
    survey = survey_of(drive, route, spacing_m=1.5)
    road = route_on_road(survey, route)
    found = sight_distances(survey.scene, road, AASHTO, speed_mps=6.0, step_m=1.0)
    one = stations_of(found)[2]
    assert one.place[:2] == pytest.approx([11.5, -5.0])
    assert one.verdict == "deficient"
    assert one.possible_m == pytest.approx(2.0 + np.hypot(2, 2) + 9.4, abs=1.6)
    assert 20.3 < one.blocker[0] < 22.5  # the near end of the car
    assert -2.4 < one.blocker[1] < -1.5
    assert classes_of(drive, survey, found.ending_blocker) == ("",) * len(found.chainage_m)


@pytest.mark.realdata
def test_labels_name_what_hides(shared_data: Path) -> None:
    (log,) = (shared_data / "av2" / "val").iterdir()
    drive = open_drive(log)
    frame = drive[drive.frame_numbers[0]]
    route = Route.through([frame.pose[:3, 3], frame.pose[:3, 3] + [10, 0, 0]])
    survey = survey_of(drive, route)
    boxes = [box for box in frame.boxes if box.category == "REGULAR_VEHICLE"][:5]
    middles = np.array([transform(frame.pose, box.velo_from_box[:3, 3]) for box in boxes])
    places = np.vstack([middles, np.full((1, 3), np.nan), np.add(middles[:1], [0, 0, 500])])
    assert classes_of(drive, survey, places) == ("REGULAR_VEHICLE",) * len(boxes) + ("", "")


def scans_of_a_van(there: Callable[[int], bool]) -> Scene:
    """Twelve scans in 5.5 s, the van is there in some of them."""
    scene = Scene()
    for nth in range(12):
        van = posed_street.VAN if there(nth) else None
        pose = rigid(np.eye(3), [4.0 + 0.5 * nth, 0.0, posed_street.HEIGHT_M])
        scene.add(posed_street.returns(pose[0, 3], van), pose, 0.5 * nth)
    return scene


@pytest.mark.parametrize(
    ("there", "hides_at"),
    [
        (lambda nth: True, {"first", "last", "any"}),
        (lambda nth: nth < 6, {"first"}),  # it leaves
        (lambda nth: nth >= 6, {"last"}),  # it comes
        (lambda nth: False, set()),
    ],
)
def test_what_was_seen_through_at_some_moment_does_not_hide(
    there: Callable[[int], bool], hides_at: set[str]
) -> None:
    # The path runs along y = 2 through the van, whose back is at x = 22.
    scene = scans_of_a_van(there)
    road = Route.through([[0, 2, 0], [50, 2, 0]])
    moments_s = {"first": [0.0], "last": [5.5], "any": np.linspace(0.0, 5.5, 8)}
    for name, times in moments_s.items():
        found = sight_distances(
            scene,
            road,
            AASHTO,
            speed_mps=5.0,
            reach_m=40.0,
            moments_s=np.tile(times, (10, 1)),
        )
        if name in hides_at:
            np.testing.assert_allclose(found.possible_m[:4], [22, 17, 12, 7], atol=1.01)
            np.testing.assert_allclose(found.ending_blocker[:4, 0], 22.0, atol=0.5)
        else:
            assert not found.is_bounded.any()
            np.testing.assert_allclose(found.seen_m[:4], [40, 40, 40, 35], atol=1.01)
