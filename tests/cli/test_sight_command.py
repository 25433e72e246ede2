"""`intervis sight`: a wall with known answers, and scans registered by their poses."""

import csv
import json
import os
import re
from pathlib import Path

import numpy as np
import pytest

from intervis.cli import exit_code
from intervis.drives import open_drive
from intervis.uses import labelled_scene
from intervis.uses.registration import registered_scene
from labelled_walls import write_walls
from small_drive import scan_folder


@pytest.fixture(scope="module")
def wall(tmp_path_factory) -> Path:
    """A scan of a wall 10 m ahead, 10 m wide."""
    y, z = np.meshgrid(np.arange(-5, 5, 0.04), np.arange(-1.5, 1.5, 0.06))
    points = np.stack([np.full(y.size, 10.0), y.ravel(), z.ravel()], axis=1)
    path = tmp_path_factory.mktemp("wall") / "wall.npy"
    np.save(path, points.astype(np.float32))
    return path


@pytest.mark.parametrize(
    ("target", "state"), [("9,1,0", "Visible:"), ("30,1,0", "Occluded:"), ("-9,0,0", "Unknown:")]
)
def test_a_wall(wall, target, state, capsys):
    assert exit_code(["sight", str(wall), "--from", "sensor", "--to", target]) == 0
    out, err = capsys.readouterr()
    assert state in out
    assert not err


def test_a_tilted_scanner_is_named(tmp_path, capsys):
    x, y = np.meshgrid(np.arange(-9, 9, 0.2), np.arange(-9, 9, 0.2))
    ground = np.stack([x.ravel(), y.ravel(), np.full(x.size, -2.0)], axis=1)
    s = np.sqrt(0.5)
    for turn, said in ((np.eye(3), False), (np.array([[s, 0, s], [0, 1, 0], [-s, 0, s]]), True)):
        np.save(tmp_path / "scan.npy", (ground @ turn).astype(np.float32))
        scan = str(tmp_path / "scan.npy")
        assert exit_code(["sight", scan, "--from", "sensor", "--to", "4,1,0"]) == 0
        assert ("tilted by 45 degrees" in capsys.readouterr().out) is said


def test_a_lower_risk_leaves_a_line_unknown(wall, capsys):
    asked = ["sight", str(wall), "--from", "sensor", "--to", "30,1,0"]
    for risk, state in (("0.2", "Occluded:"), ("0.001", "Unknown:")):
        assert exit_code([*asked, "--risk", risk]) == 0
        assert state in capsys.readouterr().out


def test_the_blocker_is_on_the_wall(wall, capsys):
    assert exit_code(["sight", str(wall), "--from", "0,0,0", "--to", "20,2,0"]) == 0
    out = capsys.readouterr().out
    x, y, z = map(float, out.split(", at (")[1].split(")")[0].split(","))
    # The line y = x / 10 meets the wall x = 10 at y = 1.
    assert (x, y, z) == pytest.approx((10, 1, 0), abs=0.25)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--from", "camera", "--to", "1,2,3"], "no camera: give --from as X,Y,Z"),
        (["--from", "0,0,0", "--to", "camera"], "no camera: give --to as X,Y,Z"),
        (["--from", "0,0,0", "--to", "1,2,3", "--picture", "x.notaformat"], ".png or .svg"),
        (["--from", "driver", "--to", "1,2,3"], "--from must be X,Y,Z in metres"),
        (["--from", "0,0,0", "--to", "1,2"], "--to must be X,Y,Z in metres"),
        (["--from", "0,0,0", "--to", "1,2,inf"], "--to must be three finite numbers"),
        (["--from", "0,0,0", "--to", "1,2,3", "--frame", "7"], "no frame 7"),
        (["--from", "0,0,0", "--to", "1,2,3", "--frames", "0:2"], "by their poses"),
        (["--from", "0,0,0", "--to", "1,2,3", "--frames", "x"], "--frames must be A:B"),
        (["--from", "0,0,0"], "--to X,Y,Z, or many with --targets"),
        (["--from", "0,0,0", "--to", "1,2,3", "--risk", "0.5"], "--risk must be from 0.001 to 0.2"),
    ],
)
def test_a_wrong_request_is_a_one_line_message(words, said, tmp_path, capsys):
    drive = scan_folder(tmp_path / "drive")
    assert exit_code(["sight", str(drive), *words]) == 2
    err = capsys.readouterr().err
    assert said in err
    assert len(err.splitlines()) == 1


def test_other_frames_are_registered_by_their_poses(tmp_path, capsys):
    folder = scan_folder(tmp_path / "drive", (0, 1, 2))
    # Frame 0 at the origin; frame 1 at x = 4; frame 2 at (4, 3), turned left by a quarter.
    (folder / "poses.txt").write_text(
        "1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 4 0 1 0 0 0 0 1 0\n0 -1 0 4 1 0 0 3 0 0 1 0\n"
    )
    drive = open_drive(folder)
    # As seen from frame 2: its x is the world's y, its y the world's -x.
    poses = registered_scene(drive, drive[2], [0, 1]).poses
    np.testing.assert_allclose(poses[:, :3, 3], [[-3, 4, 0], [-3, 0, 0], [0, 0, 0]], atol=1e-12)
    np.testing.assert_allclose(poses[0, :3, :3], [[0, 1, 0], [-1, 0, 0], [0, 0, 1]], atol=1e-12)
    np.testing.assert_allclose(poses[2], np.eye(4), atol=1e-12)
    command = ["sight", str(folder), "--frame", "2", "--from", "sensor", "--to", "9,1,0"]
    assert exit_code([*command, "--frames", ":"]) == 0
    assert "frame 2, 3 scans;" in capsys.readouterr().out


def test_the_picture_is_written(wall, tmp_path, capsys):
    path = tmp_path / "seen.png"
    command = ["sight", str(wall), "--from", "sensor", "--to", "30,1,0", "--picture", str(path)]
    assert exit_code(command) == 0
    assert path.read_bytes().startswith(b"\x89PNG")
    assert f"Picture: {path}" in capsys.readouterr().out
    assert exit_code([*command[:-1], str(tmp_path / "nowhere" / "seen.png")]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


def test_a_picture_has_the_format_of_its_name(wall, tmp_path):
    path = tmp_path / "seen.svg"
    command = ["sight", str(wall), "--from", "30,1,0", "--to", "sensor", "--picture", str(path)]
    assert exit_code(command) == 0
    assert path.read_text().startswith("<?xml")


def test_a_picture_is_never_put_in_place_of_a_pipe(wall, tmp_path, capsys, monkeypatch):
    pipe = tmp_path / "seen.png"
    os.mkfifo(pipe)
    monkeypatch.setattr("intervis.drives.open_drive", None)  # refused before the work
    command = ["sight", str(wall), "--from", "sensor", "--to", "30,1,0", "--picture", str(pipe)]
    assert exit_code(command) == 2
    assert "give the path of a file" in capsys.readouterr().err
    assert pipe.is_fifo()


@pytest.fixture
def walls(tmp_path) -> Path:
    """A drive of two labelled scans: a hedge before a wall."""
    return write_walls(tmp_path / "walls")


ASKED = ["--from", "sensor", "--to", "20,0,0", "--to", "20,9,0", "--to", "5,0,0"]


def test_the_class_of_each_blocker_is_said(walls, capsys):
    assert exit_code(["sight", str(walls), *ASKED]) == 0
    _, hedge, wall, free = capsys.readouterr().out.splitlines()
    assert hedge.startswith("Occluded:")
    assert hedge.endswith("Class of the blocker: vegetation.")
    assert wall.endswith("Class of the blocker: building.")
    assert "Class" not in free


def test_command_and_python_have_the_same_numbers(walls, tmp_path, capsys):
    out = tmp_path / "answers.json"
    words = ["--from", "1,0,0", "--targets", "returns", "--frames", ":", "--without", "vegetation"]
    assert exit_code(["sight", str(walls), *words, "--out", str(out)]) == 0
    said = capsys.readouterr().out
    labelled = labelled_scene(open_drive(walls), 0, frames=[1], without=["vegetation"])
    sight = labelled.sight([1, 0, 0], labelled.targets)
    classes = labelled.blocker_classes(sight)
    assert f"2 scans without vegetation ({labelled.left_out:,} returns left out)" in said
    assert f"{len(sight):,} lines: {sight.visible.sum():,} visible" in said
    lines = json.loads(out.read_text())["lines"]
    assert [line["blocker_class"] or "" for line in lines] == classes.tolist()
    assert [line["probability"] for line in lines] == sight.probability.tolist()
    assert all("vegetation" not in line for line in said.splitlines()[1:])


def test_files_hold_the_class_of_the_blocker(walls, tmp_path):
    for ending in ("csv", "json", "npz", "ply"):
        out = tmp_path / f"answers.{ending}"
        assert exit_code(["sight", str(walls), *ASKED, "--out", str(out)]) == 0
    expected = ["vegetation", "building", ""]
    rows = csv.DictReader((tmp_path / "answers.csv").read_text().splitlines())
    assert [row["blocker_class"] for row in rows] == expected
    content = json.loads((tmp_path / "answers.json").read_text())
    assert [line["blocker_class"] for line in content["lines"]] == ["vegetation", "building", None]
    with np.load(tmp_path / "answers.npz") as arrays:
        assert arrays["blocker_class"].tolist() == expected


def test_files_of_a_drive_without_labels_have_no_class(wall, tmp_path):
    out = tmp_path / "answers.csv"
    assert exit_code(["sight", str(wall), *ASKED, "--out", str(out)]) == 0
    assert "blocker_class" not in out.read_text()


def test_shares_of_the_classes_are_shown(walls, capsys):
    words = ["sight", str(walls), "--from", "sensor", "--to", "20,0,0", "--to", "20,1,0"]
    assert exit_code([*words, "--targets", "returns"]) == 0
    assert re.search(r"^vegetation +2 +100\.0 %$", capsys.readouterr().out, re.MULTILINE)


def test_blockers_are_drawn_before_and_after(walls, tmp_path, capsys):
    picture = tmp_path / "blockers.svg"
    words = ["sight", str(walls), "--from", "1,0,0", "--to", "20,0,0", "--blockers", str(picture)]
    assert exit_code([*words, "--frames", ":", "--without", "vegetation"]) == 0
    assert f"Picture of the blockers: {picture}" in capsys.readouterr().out
    assert picture.read_text().startswith("<?xml")


@pytest.mark.parametrize(
    ("classes", "said"),
    [
        (["car"], "there is no class 'car': choose from building, unlabelled, vegetation."),
        (["parked building"], "nothing says which 'building' is parked"),
        (["vegetation", "building"], "no return is left without vegetation, building"),
    ],
)
def test_a_class_that_cannot_be_left_out_is_a_one_line_message(walls, classes, said, capsys):
    words = [word for name in classes for word in ("--without", name)]
    assert exit_code(["sight", str(walls), *ASKED, *words]) == 2
    err = capsys.readouterr().err
    assert said in err
    assert len(err.splitlines()) == 1


def test_a_drive_without_classes_leaves_none_out(wall, tmp_path, capsys):
    for option in (["--without", "car"], ["--blockers", str(tmp_path / "b.png")]):
        out = ["--out", str(tmp_path / "answers.csv")]
        assert exit_code(["sight", str(wall), *ASKED, *option, *out]) == 2
        assert not list(tmp_path.iterdir())
        err = capsys.readouterr().err
        assert "frame 0 has neither labels of its points nor boxes" in err
        assert len(err.splitlines()) == 1
