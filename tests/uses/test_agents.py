"""Who sees whom: fields of view and bodies on paper, lines against single ones, files."""

import csv
from pathlib import Path

import numpy as np
import posed_street
import pytest
from hypothesis import given
from hypothesis import strategies as st

from intervis import open_drive
from intervis.cli import exit_code
from intervis.errors import CalibrationError, DriveError, PointsError, PoseError, SettingsError
from intervis.sight import Scene
from intervis.transform import rigid
from intervis.uses.agents.agent_file import labelled_agents, read_agents, scanner_agent
from intervis.uses.agents.agents_figure import agents_picture
from intervis.uses.agents.agents_table import frames_as_csv, matrix_table, pairs_of
from intervis.uses.agents.mutual_sight import ABSENT, REASONS, Agent, MutualSight, mutual_sight
from intervis.uses.routes.survey import has_times, scene_of_drive


@pytest.fixture(scope="module")
def street(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return posed_street.write(tmp_path_factory.mktemp("drives") / "street")


@pytest.fixture(scope="module")
def scene(street: Path) -> Scene:
    drive = open_drive(street)
    return scene_of_drive(drive, drive.frame_numbers, scans_per_s=10.0)


def at(x: float, y: float, z: float = 1.2, yaw_deg: float = 0.0) -> np.ndarray:
    yaw = np.radians(yaw_deg)
    turn = [[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]]
    return rigid(turn, [x, y, z])


def word(found, observer: str, target: str, frame: int = 0) -> str:
    a, b = found.names.index(observer), found.names.index(target)
    return REASONS[found.reason[frame, a, b]]


def test_reasons(scene: Scene) -> None:
    agents = [
        Agent("looks along x", at(10, -3), fov_deg=90.0),
        Agent("looks back", at(18, -3, yaw_deg=180.0), fov_deg=90.0, range_m=7.0),
        Agent("behind the van", at(26.8, 2.0, 0.8)),
        Agent("beside", at(10, 3), fov_deg=90.0),
    ]
    found = mutual_sight(scene, agents, [0, 3], np.array([0.0, 0.3]))
    assert word(found, "looks along x", "looks back") == "visible"
    assert word(found, "looks back", "looks along x") == "out of range"  # 8 m
    # (26.8, 2) lies at 16.6 degrees to the left of x from (10, -3); "beside" at 90 degrees.
    assert word(found, "looks along x", "behind the van") in ("occluded", "unknown")
    assert word(found, "looks along x", "beside") == "outside field of view"
    assert word(found, "beside", "looks along x") == "outside field of view"
    assert (found.reason[:, range(4), range(4)] == ABSENT).all()
    np.testing.assert_array_equal(found.probability, found.probability.transpose(0, 2, 1))


def test_lines_are_those_of_the_scene(scene: Scene) -> None:
    rng = np.random.default_rng(4)
    places = rng.uniform([0, -6, 0.4], [30, 6, 2.2], (7, 3))
    agents = [Agent(f"a{nth}", at(*place)) for nth, place in enumerate(places)]
    found = mutual_sight(scene, agents, [2], np.array([0.2]), risk=0.02)
    states = {"visible": 1, "occluded": 0, "unknown": -1}
    for a, start in enumerate(places):
        for b, end in enumerate(places):
            if a != b:
                one = scene.sight(start, end[None], moment_s=0.2, risk=0.02)
                assert states[word(found, f"a{a}", f"a{b}")] == one.state[0]
                assert found.range_m[0, a, b] == pytest.approx(np.linalg.norm(start - end))


def test_a_body_does_not_hide_its_own_eye(scene: Scene) -> None:
    # The driver of the van, with and without the van as a body.
    middle = posed_street.VAN.mean(axis=0)
    eye = np.array([*middle[:2], 1.6])
    body = posed_street.VAN - eye
    ahead = Agent("ahead", at(14, 0, 1.4))
    inside = mutual_sight(scene, [ahead, Agent("driver", at(*eye))], [0])
    outside = mutual_sight(scene, [ahead, Agent("driver", at(*eye), body=body)], [0])
    assert word(inside, "ahead", "driver") != "visible"
    assert word(outside, "ahead", "driver") == "visible"
    assert word(outside, "driver", "ahead") == "visible"


@given(
    st.tuples(*[st.floats(-1, 1)] * 3),
    st.tuples(*[st.floats(-30, 30)] * 3),
    st.floats(0, 360),
)
def test_lines_start_where_they_leave_the_body(share, towards, yaw_deg: float) -> None:
    from intervis.uses.agents.mutual_sight import BODY_MARGIN_M, _way_out

    half = np.array([2.0, 1.0, 0.7])
    eye_in_box = np.array(share) * half
    body = np.array([-half - eye_in_box, half - eye_in_box])
    pose = at(3.0, -2.0, 1.0, yaw_deg)
    target = np.array(towards)
    out = _way_out(Agent("car", pose, body=body), pose, target)
    steps = np.linspace(0.0, 1.0, 4001)
    places = pose[:3, 3] + steps[:, None] * (target - pose[:3, 3])
    local = (places - pose[:3, 3]) @ pose[:3, :3]
    inside = ((local >= body[0] - BODY_MARGIN_M) & (local <= body[1] + BODY_MARGIN_M)).all(axis=1)
    assert out == pytest.approx(steps[inside].max(), abs=1e-3)


def test_pairs_and_tables(scene: Scene) -> None:
    walker = Agent("walker", {1: at(14, -3), 3: at(26.8, 2.0, 0.8), 2: at(14, -2)})
    pole = Agent("pole", at(8, -4, 2.0))
    found = mutual_sight(scene, [pole, walker], [0, 1, 2, 3], np.array([0.0, 0.1, 0.2, 0.3]))
    first, second = pairs_of(found)
    assert (first.observer, first.target, first.frames, first.seen) == ("pole", "walker", 3, 2)
    assert (first.first, first.last) == (1, 2)
    assert (first.first_s, first.last_s) == pytest.approx((0.1, 0.2))
    assert first.blind in ("occluded", "unknown")
    assert second.nearest_m == pytest.approx(np.sqrt(36 + 1 + 0.64))
    assert matrix_table(found).rows == (("pole", "-", "67 %"), ("walker", "67 %", "-"))
    rows = list(csv.DictReader(frames_as_csv(found).splitlines()))
    assert [row["frame"] for row in rows] == ["1", "1", "2", "2", "3", "3"]
    assert rows[0]["state"] == "visible"


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"places": {}}, "agent 'a' has no place: give x and y"),
        ({"fov_deg": 0.0}, "field of view of agent 'a' must be above 0 and up to 360"),
        ({"range_m": -1.0}, "the range of agent 'a' must be positive"),
        ({"body": np.zeros((2, 3))}, "the body of agent 'a' has no volume"),
    ],
)
def test_agents_that_make_no_sense_are_told(values: dict, message: str) -> None:
    with pytest.raises(PointsError, match=message):
        Agent("a", **({"places": np.eye(4)} | values))


def test_a_place_that_is_no_rigid_motion_is_told() -> None:
    with pytest.raises(PoseError, match="the pose of agent 'a' holds NaN"):
        Agent("a", np.full((4, 4), np.nan))


def test_too_few_or_too_many_agents(scene: Scene) -> None:
    one = Agent("a", np.eye(4))
    for agents in ([one], [one, Agent("a", at(3, 0))]):
        with pytest.raises(PointsError, match="two agents or more are needed, with different"):
            mutual_sight(scene, agents, [0])
    with pytest.raises(SettingsError, match="too many: take fewer frames"):
        mutual_sight(scene, [one, Agent("b", at(3, 0))], range(6_000_000))


def read(text: str, tmp_path: Path, scene: Scene) -> list[Agent]:
    file = tmp_path / "agents.csv"
    file.write_text(text)
    return read_agents(file, scene)


def test_agents_of_a_file(tmp_path: Path, scene: Scene) -> None:
    pole, car, default = read(
        "name, x, y, z, height, yaw_deg, fov_deg, range_m, frame, length, width, tall\n"
        "pole, 5, -3, 4.2, , 90, 120, 60, , , ,\n"
        "car, 6, 0, , 1.2, 0, , , 1, 4, 1.8, 1.5\n"
        "car, 8, 0, , 1.2, 0, , , 2, , ,\n"
        "child, 9, -2, , , , , , , , ,\n",
        *(tmp_path, scene),
    )
    assert pole.pose_at(7)[:3, 3].tolist() == [5, -3, 4.2]
    np.testing.assert_allclose(pole.pose_at(7)[:3, 0], [0, 1, 0], atol=1e-12)
    assert (pole.fov_deg, pole.range_m, pole.body) == (120.0, 60.0, None)
    assert car.pose_at(0) is None
    np.testing.assert_allclose(car.pose_at(2)[:3, 3], [8, 0, 1.2], atol=0.05)
    np.testing.assert_allclose(car.body, [[-2, -0.9, -1.2], [2, 0.9, 0.3]], atol=0.05)
    assert default.pose_at(0)[2, 3] == pytest.approx(1.5, abs=0.05)


@pytest.mark.parametrize(
    ("text", "error", "message"),
    [
        ("name,x\na,1\n", CalibrationError, "agents need a heading with name, x, y"),
        ("name,x,y,colour\na,1,2,red\n", CalibrationError, "agents need a heading"),
        ("name,x,y\n", CalibrationError, "and rows below it"),
        ("name,x,y,z\na,1,two,3\n", CalibrationError, "agent 1: y must be a number"),
        ("name,x,y,z\npole,1,,3\n", PointsError, "agent 'pole' has no place: give x and y"),
        ("name,x,y,z\na,1,2,3\na,1,3,3\n", PointsError, "each needs a frame number of its own"),
        ("name,x,y,frame\na,1,2,1.5\n", PointsError, "each needs a frame number of its own"),
        ("name,x,y\na,1,2,3\n", CalibrationError, "a row has more values than the heading"),
        ("name,x,y,z\na,900,0,3\n", PointsError, "stands 888 m from every scan"),
        ("name,x,y,z,fov_deg\na,1,2,3,400\n", PointsError, "up to 360 degrees, got 400"),
    ],
)
def test_files_that_hold_no_agents_are_told(
    text: str, error: type, message: str, tmp_path: Path, scene: Scene
) -> None:
    with pytest.raises(error, match=message):
        read(text, tmp_path, scene)
    with pytest.raises(DriveError, match="there are no agents at"):
        read_agents(tmp_path / "nothing.csv", scene)


def test_the_command(street: Path, tmp_path: Path, capsys) -> None:
    agents = tmp_path / "a.csv"
    agents.write_text("name,x,y,height\npole,14,-4,2\nchild,26.8,2,0.8\n")
    pairs, every, picture = (tmp_path / name for name in ("p.csv", "e.csv", "p.png"))
    command = ["agents", str(street), "--agents", str(agents), "--hz", "10"]
    written = ["--csv", str(pairs), "--every", str(every), "--picture", str(picture)]
    assert exit_code([*command, *written]) == 0
    out = capsys.readouterr().out
    assert "Row sees column, share of frames" in out
    rows = {(r["observer"], r["target"]): r for r in csv.DictReader(pairs.read_text().splitlines())}
    assert rows["scanner", "pole"]["seen"] == "4"
    assert rows["scanner", "child"]["seen"] == "0"
    assert len(rows) == 6
    assert every.read_text().count("\n") == 1 + 4 * 6
    assert picture.stat().st_size > 10_000
    assert exit_code(["agents", str(street)]) == 2
    assert "give agents as --agents FILE.csv" in capsys.readouterr().err
    assert exit_code(["agents", str(street), "--labelled"]) == 2
    assert "street has no labelled objects in these frames" in capsys.readouterr().err
    assert "P of the line" in out


def test_a_drive_without_poses_is_told(tmp_path: Path, capsys) -> None:
    drive = posed_street.write(tmp_path / "street", count=2)
    (drive / "poses.txt").unlink()
    assert exit_code(["agents", str(drive), "--labelled"]) == 2
    assert "street has no poses, which put its scans" in capsys.readouterr().err


def test_one_scan_without_a_pose_has_agents_in_its_own_frame(tmp_path: Path, capsys) -> None:
    drive = posed_street.write(tmp_path / "street", count=1)
    (drive / "poses.txt").unlink()
    (tmp_path / "agents.csv").write_text("name,x,y,z\nnear,4,0,0\n")
    assert exit_code(["agents", str(drive), "--agents", str(tmp_path / "agents.csv")]) == 0
    said = capsys.readouterr().out
    assert said.startswith("street, 1 frame; coordinates in the frame of its scan.")
    assert "scanner" in said


@pytest.mark.realdata
def test_categories_that_are_not_there_are_told(shared_data: Path, capsys) -> None:
    (log,) = (shared_data / "av2" / "val").iterdir()
    command = ["agents", str(log), "--labelled", "--category", "CAR", "--frames", "0:1"]
    assert exit_code(command) == 2
    error = capsys.readouterr().err
    assert "has no labelled CAR: choose from BICYCLE, BOLLARD" in error
    assert "VEHICULAR_TRAILER." in error


def many(count: int) -> MutualSight:
    """Agents in a row that see each other."""
    shape = (1, count, count)
    eyes = np.column_stack([4.0 * np.arange(count), np.zeros(count), np.ones(count)])
    return MutualSight(
        *(tuple(f"walker {nth}" for nth in range(count)), np.array([0]), np.array([0.0])),
        *(eyes[None], np.zeros(shape, np.int8), np.ones(shape), np.ones(shape)),
        np.full((*shape, 3), np.nan),
    )


@pytest.mark.parametrize(("count", "named"), [(12, "walker 3"), (13, "3"), (25, "3")])
def test_many_agents_have_numbers_in_the_picture(count: int, named: str) -> None:
    pytest.importorskip("matplotlib")
    figure = agents_picture(many(count), np.zeros((0, 3)))
    plan, matrix = figure.axes
    assert named in {text.get_text() for text in plan.texts}
    rows = [tick.get_text() for tick in matrix.get_yticklabels()]
    assert rows[3] == ("walker 3" if count == 12 else "walker 3  3")
    figure.canvas.draw()
    box = plan.get_window_extent()
    for text in plan.texts:
        extent = text.get_window_extent()
        assert box.x0 <= extent.x0
        assert extent.x1 <= box.x1
    assert not plan.get_legend().get_window_extent().overlaps(box.padded(-1.0))


@pytest.mark.realdata
def test_labelled_pedestrians_of_a_real_drive(shared_data: Path) -> None:
    (log,) = (shared_data / "av2" / "val").iterdir()
    drive = open_drive(log)
    numbers = list(drive.frame_numbers)
    people = labelled_agents(drive, numbers, range_m=50.0, categories=["pedestrian"])
    assert 10 < len(people) < 40
    scene = scene_of_drive(drive, numbers)
    assert has_times(scene)
    found = mutual_sight(
        scene, [scanner_agent(drive, numbers), *people], numbers, scene.timestamps_s
    )
    # Of those with ten returns or more the scanner sees nearly all: labels count the returns.
    returns = {
        f"{box.category} {box.track[:8]}": box.returns
        for box in drive[numbers[0]].boxes
        if box.category == "PEDESTRIAN"
    }
    seen = {one.target: one.seen for one in pairs_of(found) if one.observer == "scanner"}
    many = [name for name, count in returns.items() if count >= 10]
    assert sum(seen[name] > 0 for name in many) >= 0.8 * len(many)
    for one in pairs_of(found):  # nobody sees farther than asked
        if one.observer != "scanner" and one.seen:
            assert one.nearest_m <= 50.0
