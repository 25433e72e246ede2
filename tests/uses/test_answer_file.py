"""Files of answers: each format read back by a reader that is not ours, or by hand."""

import csv
import json
import struct
from pathlib import Path

import numpy as np
import pytest

from intervis.cli import exit_code
from intervis.drives.scan_file import read_scan
from intervis.errors import OutputError, PointsError
from intervis.sight import Sight
from intervis.uses.answer_file import save_answers

TARGETS = np.array([[1.0, 2, 3], [4, 5, 6], [7, 8, 9.5], [np.nan, 0, 0]])
SIGHT = Sight(
    np.array([1, 0, -1, -1], np.int8),
    np.array([0.9, 0.1, 0.5, np.nan]),
    np.array([[np.nan] * 3, [2.5, 3, 4], [np.nan] * 3, [np.nan] * 3]),
    np.array([0.7, -0.2, np.inf, np.nan]),
    np.array([1.0, 0.8, 0.25, np.nan]),
)
START = np.zeros(3)


def test_csv(tmp_path: Path) -> None:
    save_answers(tmp_path / "a.csv", START, TARGETS, SIGHT)
    rows = list(csv.DictReader((tmp_path / "a.csv").read_text().splitlines()))
    assert [row["state"] for row in rows] == ["visible", "occluded", "unknown", "unknown"]
    assert [float(rows[1][f"blocker_{axis}"]) for axis in "xyz"] == [2.5, 3, 4]
    assert rows[0]["blocker_x"] == rows[2]["clearance"] == rows[3]["probability"] == ""
    assert float(rows[2]["z"]) == 9.5


def test_json(tmp_path: Path) -> None:
    save_answers(tmp_path / "a.json", START, TARGETS, SIGHT)
    content = json.loads((tmp_path / "a.json").read_text())
    assert content["viewpoint"] == [0, 0, 0]
    first, second, third, fourth = content["lines"]
    assert (first["target"], first["state"], first["blocker"]) == ([1, 2, 3], "visible", None)
    assert (second["blocker"], second["clearance"]) == ([2.5, 3, 4], -0.2)
    assert (third["probability"], third["clearance"], third["observed"]) == (0.5, None, 0.25)
    assert fourth["target"] is None
    assert fourth["probability"] is None


def test_npz(tmp_path: Path) -> None:
    save_answers(tmp_path / "a.npz", START, TARGETS, SIGHT)
    with np.load(tmp_path / "a.npz") as arrays:
        for name in ("state", "probability", "blocker", "clearance", "observed"):
            np.testing.assert_array_equal(arrays[name], getattr(SIGHT, name))
        np.testing.assert_array_equal(arrays["targets"], TARGETS)


def test_classes_of_the_blockers(tmp_path: Path) -> None:
    names = ["", "car, parked", "", ""]
    for ending in ("csv", "json", "npz", "ply"):
        save_answers(tmp_path / f"a.{ending}", START, TARGETS, SIGHT, names)
    rows = list(csv.DictReader((tmp_path / "a.csv").read_text().splitlines()))
    assert [row["blocker_class"] for row in rows] == names
    lines = json.loads((tmp_path / "a.json").read_text())["lines"]
    assert [line["blocker_class"] for line in lines] == [None, "car, parked", None, None]
    with np.load(tmp_path / "a.npz") as arrays:
        assert arrays["blocker_class"].tolist() == names
    for wrong in (names[:3], [1, 2, 3, 4]):
        with pytest.raises(PointsError, match="4 answers need as many names of blocker_class"):
            save_answers(tmp_path / "b.csv", START, TARGETS, SIGHT, wrong)


def test_ply(tmp_path: Path) -> None:
    """By hand: 4 floats less one, a char, three bytes of colour, three floats."""
    path = tmp_path / "a.ply"
    save_answers(path, START, TARGETS, SIGHT)
    head, body = path.read_bytes().split(b"end_header\n")
    assert b"element vertex 4\nproperty float x\n" in head
    assert len(body) == 4 * struct.calcsize("<3fb3B3f")
    x, y, z, state, red, green, blue, p, *_ = struct.unpack_from("<3fb3B3f", body, 28)
    assert (x, y, z, state, (red, green, blue)) == (4, 5, 6, 0, (200, 56, 90))
    assert p == pytest.approx(0.1)
    scan = read_scan(path)
    assert scan.attributes["state"].tolist() == [1, 0, -1, -1]


def test_another_ending_is_told(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"written as .csv, .json, .npz, .ply"):
        save_answers(tmp_path / "a.xlsx", START, TARGETS, SIGHT)


@pytest.fixture
def wall(tmp_path: Path) -> Path:
    y, z = np.meshgrid(np.arange(-5, 5, 0.04), np.arange(-1.5, 1.5, 0.06))
    points = np.stack([np.full(y.size, 10.0), y.ravel(), z.ravel()], axis=1)
    np.save(tmp_path / "wall.npy", points.astype(np.float32))
    return tmp_path / "wall.npy"


def test_the_command_answers_many_ends(wall: Path, tmp_path: Path, capsys) -> None:
    np.save(tmp_path / "t.npy", np.array([[9.0, 0, 0], [30, 1, 0], [-9, 0, 0]], np.float32))
    command = ["sight", str(wall), "--from", "sensor", "--to", "9,1,0", "--to", "30,2,0"]
    out = tmp_path / "answers.csv"
    asked = [*command, "--targets", str(tmp_path / "t.npy"), "--out", str(out)]
    assert exit_code(asked) == 0
    said = capsys.readouterr().out
    assert said.index("Visible:") < said.index("Occluded:")
    assert "5 lines: 2 visible, 2 occluded, 1 unknown." in said
    rows = list(csv.DictReader(out.read_text().splitlines()))
    states = ["visible", "occluded", "visible", "occluded", "unknown"]
    assert [row["state"] for row in rows] == states


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "give the end of a sight line as --to X,Y,Z, or many with --targets"),
        (["--targets", "none.npy"], "none.npy"),
        (["--to", "1,2,3", "--out", "a.doc"], "written as .csv"),
    ],
)
def test_a_wrong_request_is_told(wall: Path, words: list[str], said: str, capsys) -> None:
    assert exit_code(["sight", str(wall), "--from", "sensor", *words]) == 2
    err = capsys.readouterr().err
    assert said in err
    assert len(err.splitlines()) == 1
