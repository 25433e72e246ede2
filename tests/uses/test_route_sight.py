"""Targets and zones along a route, against single sight lines and a loop in plain Python."""

import csv
import json
from pathlib import Path

import numpy as np
import posed_street
import pytest
from hypothesis import given
from hypothesis import strategies as st

from intervis import open_drive
from intervis.cli import exit_code
from intervis.errors import DriveError, PointsError, SceneError, SettingsError
from intervis.plots.style import INK
from intervis.sight import VISIBLE, Scene
from intervis.uses.routes.route import Route
from intervis.uses.routes.route_answer import targets_along, zones_along
from intervis.uses.routes.route_figure import route_picture
from intervis.uses.routes.route_file import route_of_drive
from intervis.uses.routes.route_sight import OUT_OF_RANGE, route_sight, sightings, zone_sight
from intervis.uses.routes.survey import (
    check_route_in_survey,
    moments_near,
    moments_of_poses,
    route_on_road,
    scene_of_drive,
    survey_of,
)
from intervis.uses.routes.target_file import check_targets_in_scene, read_targets
from intervis.uses.routes.zone import Zone

NAN = float("nan")


@pytest.fixture(scope="module")
def street(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return posed_street.write(tmp_path_factory.mktemp("drives") / "street")


@pytest.fixture(scope="module")
def scene(street: Path) -> Scene:
    drive = open_drive(street)
    return scene_of_drive(drive, drive.frame_numbers, scans_per_s=10.0)


ROUTE = Route.through([[x, 0, 1.7] for x in range(0, 13, 4)], time_s=[0.0, 0.1, 0.2, 0.3])


@pytest.mark.parametrize("with_times", [False, True])
def test_states_are_those_of_single_lines(scene: Scene, with_times: bool) -> None:
    rng = np.random.default_rng(1)
    targets = rng.uniform([5, -8, 0.3], [40, 8, 2.0], (60, 3))
    targets[7] = NAN
    eyes = ROUTE.at(ROUTE.stations(3.0))
    moments_s = ROUTE.time_at(ROUTE.stations(3.0)) if with_times else None
    found = route_sight(scene, eyes, targets, max_range_m=25.0, moments_s=moments_s, risk=0.02)
    for p, eye in enumerate(eyes):
        moment_s = None if moments_s is None else float(moments_s[p])
        for m, target in enumerate(targets):
            one = scene.sight(eye, target[None], moment_s=moment_s, risk=0.02)
            far = np.linalg.norm(target - eye) > 25.0
            assert found.state[p, m] == (OUT_OF_RANGE if far else one.state[0])
            if not far:
                np.testing.assert_allclose(found.probability[p, m], one.probability[0], atol=1e-7)
    assert {-2, -1, 0, 1} == set(found.state.ravel().tolist())


def test_the_van_hides_what_is_behind_it_until_the_eye_has_passed(tmp_path: Path) -> None:
    # The van reaches from (22, 1) to (26, 3); a target at (27, 3.2) is seen past its near side when
    # the line from (x, 0) clears its corner (26, 1): 1 / (26 - x) > 3.2 / (27 - x), x > 25.5.
    drive = open_drive(posed_street.write(tmp_path / "long", count=9))
    scene = scene_of_drive(drive, drive.frame_numbers)
    long = Route.through([[0, 0, 1.7], [30, 0, 1.7]])
    behind = np.array([[27.0, 3.2, 1.2], [15.0, -4.0, 0.8]])
    answer = targets_along(scene, long, ["behind", "free"], behind, step_m=0.5)
    rows = {row.name: row for row in answer.rows if row.nth == 1}
    assert rows["behind"].from_m == pytest.approx(25.5, abs=1.0)
    assert rows["behind"].first_range_m == pytest.approx(np.hypot(1.5, 3.2), abs=0.8)
    assert rows["behind"].before in ("occluded", "unknown")
    assert (rows["free"].from_m, rows["free"].before) == (0.0, "start")
    assert rows["free"].nearest_m == pytest.approx(np.hypot(4.0, 0.9), abs=0.05)
    assert np.isnan(rows["free"].from_s)


STATES = st.lists(
    st.lists(st.sampled_from([1, 0, -1, -2]), min_size=3, max_size=3), min_size=1, max_size=12
)


@given(STATES, st.integers(0, 3))
def test_sightings_are_runs(rows: list[list[int]], gap: int) -> None:
    state = np.array(rows, np.int8)
    expected = []
    words = {0: "occluded", -1: "unknown", -2: "out of range", 1: "visible"}
    for target in range(3):
        column = [row[target] for row in rows]
        seen = [nth for nth, value in enumerate(column) if value == VISIBLE]
        groups: list[list[int]] = []
        for nth in seen:
            if groups and nth - groups[-1][-1] - 1 <= gap:
                groups[-1].append(nth)
            else:
                groups.append([nth])
        for group in groups:
            before = words[column[group[0] - 1]] if group[0] else "start"
            after = words[column[group[-1] + 1]] if group[-1] + 1 < len(column) else "end"
            expected.append((target, group[0], group[-1], before, after))
    found = sightings(state, gap)
    assert [(s.target, s.first, s.last, s.before, s.after) for s in found] == expected


def test_shares_of_zones(scene: Scene) -> None:
    eyes = ROUTE.at(ROUTE.stations(4.0))
    behind = Zone("behind the van", [[26.6, 1.2], [29, 1.2], [29, 2.8], [26.6, 2.8]], 0.2, 1.0)
    ahead = Zone("ahead", [[14, -2], [18, -2], [18, 0], [14, 0]], 0.3, 1.5)
    found = zone_sight(scene, eyes, [behind, ahead])
    whole = found.visible + found.occluded + found.unknown
    np.testing.assert_allclose(whole, 1.0)
    assert (found.visible[:, 0] < 0.1).all()
    assert (found.visible[:, 1] > 0.95).all()
    samples = behind.samples(scene)
    for p, eye in enumerate(eyes):
        sight = scene.sight(eye, samples)
        assert found.occluded[p, 0] == pytest.approx(sight.occluded.mean())
        assert found.probability[p, 0] == pytest.approx(sight.probability.mean(), abs=1e-6)
    assert set(found.states(0.5)[:, 1].tolist()) == {1}
    assert 1 not in found.states(0.5)[:, 0]


def test_what_makes_no_sense_is_told(scene: Scene, street: Path, tmp_path: Path) -> None:
    eyes = ROUTE.at(ROUTE.stations(4.0))
    with pytest.raises(SettingsError, match="max_range_m must be a positive length"):
        route_sight(scene, eyes, eyes, max_range_m=0.0)
    with pytest.raises(SettingsError, match="places x 100,000 targets are"):
        route_sight(scene, np.zeros((9999, 3)), np.zeros((100_000, 3)))
    with pytest.raises(PointsError, match="2 targets need as many names, got 1"):
        targets_along(scene, ROUTE, ["one"], np.zeros((2, 3)))
    with pytest.raises(PointsError, match="no zone is given"):
        zones_along(scene, ROUTE, [])
    bare = Route.through([[0, 0, 1.7], [9, 0, 1.7]])
    with pytest.raises(SettingsError, match="the route has no times"):
        targets_along(scene, bare, ["one"], np.zeros((1, 3)), at_pose_times=True)
    with pytest.raises(SceneError, match=r"1 of 2 targets lie more than 150 m .* \(900.0, 0.0"):
        check_targets_in_scene(scene, np.array([[0, 0, 0], [900.0, 0, 0]]))
    drive = open_drive(street)
    with pytest.raises(SceneError, match=r"4 scans need some .* GB are allowed"):
        survey_of(drive, ROUTE, max_bytes=1_000_000)
    with pytest.raises(SettingsError, match="spacing of scans must be 0 or more"):
        survey_of(drive, ROUTE, spacing_m=-1.0)
    with pytest.raises(DriveError, match="there are no targets at"):
        read_targets(tmp_path / "nothing.csv")


def test_a_survey(street: Path) -> None:
    drive = open_drive(street)
    route = route_of_drive(drive, 10.0)
    survey = survey_of(drive, route, spacing_m=5.0, scans_per_s=10.0)
    assert survey.frames == (0, 2)
    np.testing.assert_allclose(survey.scene.timestamps_s, [0.0, 0.2])
    road = route_on_road(survey, route)
    np.testing.assert_allclose(road.points[:, 2], 0.0, atol=0.03)
    assert route_on_road(survey, route, 1.5).points[0, 2] == pytest.approx(0.2)
    where = np.array([0.0, 6.0])
    np.testing.assert_allclose(moments_of_poses(survey, route, where), [[0.0], [0.15]])
    moments_s = moments_near(survey, route, where)
    assert set(moments_s.ravel().tolist()) == {0.0, 0.2}
    check_route_in_survey(survey, route)
    away = Route.through([[0, 0, 0], [0, 200, 0]])
    with pytest.raises(SceneError, match=r"at chainage 61 m, .* 61.0 m away, and 60 m are"):
        check_route_in_survey(survey, away)
    check_route_in_survey(survey, Route.through([[0, 0, 0], [0, 60.0 + 1e-9, 0]]))
    with pytest.raises(SceneError, match=r"along 0 % of the route only, and 30 % .*--mount"):
        route_on_road(survey_of(drive, Route.through([[0, 80, 0], [9, 80, 0]])), away)


def test_the_command(street: Path, tmp_path: Path, capsys) -> None:
    targets = tmp_path / "t.csv"
    targets.write_text("name,x,y,z\npost,15,-4,0.8\nchild,27,2,1.0\n")
    outputs = {
        "--csv": tmp_path / "s.csv",
        "--geojson": tmp_path / "s.geojson",
        "--picture": tmp_path / "s.png",
    }
    files = [str(part) for pair in outputs.items() for part in pair]
    assert exit_code(["route", str(street), "--targets", str(targets), *files]) == 0
    assert "1 of 2 targets come into sight" in capsys.readouterr().out
    rows = list(csv.DictReader(outputs["--csv"].read_text().splitlines()))
    assert [(row["target"], row["before"], row["after"]) for row in rows] == [
        ("post", "start", "end")
    ]
    content = json.loads(outputs["--geojson"].read_text())
    seen = {
        one["properties"]["name"]: one["properties"]["VISIBLE"]
        for one in content["features"]
        if one["properties"]["kind"] == "target"
    }
    assert seen == {"post": 1, "child": 0}
    assert outputs["--picture"].stat().st_size > 10_000


def test_the_command_takes_the_ways_of_sight_distance(street: Path, tmp_path: Path) -> None:
    targets = tmp_path / "t.csv"
    targets.write_text("name,x,y,z\nkerb,-30,3,-0.5\nahead,20,-3,1.2\n")
    sightings, picture = tmp_path / "s.csv", tmp_path / "s.png"
    command = ["route", str(street), "--targets", str(targets), "--csv", str(sightings)]
    ways = ["--back", "--extend", "8", "--offset", "-2", "--eye", "1.2", "--mount", "1.7"]
    assert exit_code([*command, *ways, "--picture", str(picture)]) == 0
    rows = {row["target"]: row for row in csv.DictReader(sightings.read_text().splitlines())}
    # The eye starts at (20, -2, 1.2), 8 m beyond the last scan, and travels to (0, -2, 1.2).
    assert float(rows["ahead"]["first_range_m"]) == pytest.approx(1.0, abs=0.01)
    assert float(rows["ahead"]["last_range_m"]) == pytest.approx(np.hypot(20, 1), abs=0.01)


@pytest.mark.parametrize("count", [40, 41])
def test_many_targets_are_drawn_as_shares(scene: Scene, count: int) -> None:
    pytest.importorskip("matplotlib")
    targets = np.column_stack([np.linspace(2, 40, count), np.full(count, -3.0), np.full(count, 1)])
    answer = targets_along(scene, ROUTE, [f"t{n}" for n in range(count)], targets, max_range_m=30.0)
    plan, chart = route_picture(answer, np.zeros((0, 3))).axes
    figure = plan.figure
    figure.canvas.draw()
    legend, title = plan.get_legend().get_window_extent(), plan._left_title.get_window_extent()
    assert not legend.overlaps(title)
    assert len(plan.texts) == (count if count == 40 else 0)
    if count == 40:
        assert [tick.get_text() for tick in chart.get_yticklabels()] == list(answer.names)
        return
    assert chart.get_title(loc="left").endswith("share of 41 targets")
    visible = chart.collections[3].get_paths()[0].vertices  # after three marks of the legend
    top = {x: visible[visible[:, 0] == x, 1].max() for x in answer.chainage_m}
    share = 100.0 * (answer.state == VISIBLE).mean(axis=1)
    np.testing.assert_allclose([top[x] for x in answer.chainage_m], share)
    assert 0 < share.min() < 100


def test_the_visible_share_of_zones_is_a_dark_line(scene: Scene) -> None:
    pytest.importorskip("matplotlib")
    zone = Zone("kerb", [[14, -2], [18, -2], [18, 0], [14, 0]])
    answer = zones_along(scene, ROUTE, [zone])
    _, chart = route_picture(answer, np.zeros((0, 3))).axes
    line = chart.lines[-1]
    np.testing.assert_allclose(line.get_ydata(), 0.42 - 0.84 * answer.shares["visible"][:, 0])
    assert line.get_color() == INK


def test_the_command_with_zones(street: Path, tmp_path: Path, capsys) -> None:
    square = [[14, -2], [18, -2], [18, 0], [14, 0], [14, -2]]
    zones = tmp_path / "z.geojson"
    geometry = {"type": "Polygon", "coordinates": [square]}
    zones.write_text(
        json.dumps({"features": [{"geometry": geometry, "properties": {"name": "kerb"}}]})
    )
    shares = tmp_path / "shares.csv"
    command = ["route", str(street), "--zones", str(zones), "--hz", "10", "--moments", "pose"]
    assert exit_code([*command, "--eye", "1.2", "--shares", str(shares)]) == 0
    assert "1 of 1 zones come into sight, 1 are in sight all the way" in capsys.readouterr().out
    rows = list(csv.DictReader(shares.read_text().splitlines()))
    assert len(rows) == 13
    assert all(float(row["kerb visible"]) > 0.5 for row in rows)
    bow = {"type": "Polygon", "coordinates": [[[0, 0], [4, 4], [4, 0], [0, 4]]]}
    zones.write_text(json.dumps({"features": [{"geometry": bow}]}))
    assert exit_code(["route", str(street), "--zones", str(zones)]) == 2
    assert "zone 'zone 1' crosses itself" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ([], "give either --targets FILE or --zones"),
        (["--targets", "t.csv", "--shares", "s.csv"], "--shares writes the shares of zones"),
        (["--targets", "t.csv", "--moments", "any"], "--moments must be one of map, pose"),
        (["--targets", "t.csv", "--least", "2"], "--least must be a share"),
        (["--targets", "t.csv", "--mount", "1.7"], "--mount tells where the road below --eye is"),
        (["--targets", "t.csv", "--eye", "nan"], "--eye must be from 0 to 100 m, got nan"),
        (["--targets", "nothing.csv"], "there are no targets at nothing.csv"),
        (["--targets", "nothing.csv", "--route", "no.txt"], "there is no route at no.txt"),
    ],
)
def test_requests_that_make_no_sense(street: Path, options: list, message: str, capsys) -> None:
    assert exit_code(["route", str(street), *options]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
