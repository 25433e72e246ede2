"""`intervis sight`: the words for each answer, and a wall whose answers are plain."""

from pathlib import Path

import numpy as np
import pytest

from intervis.cli import exit_code
from intervis.cli.sight import in_words, remembered_scene
from intervis.drives import open_drive
from intervis.sight import OCCLUDED, UNKNOWN, VISIBLE, Sight
from small_drive import scan_folder


def answer(state: int, probability: float, clearance_m: float, blocker=(np.nan,) * 3) -> Sight:
    return Sight(
        np.array([state], np.int8),
        np.array([probability]),
        np.array([blocker], float),
        np.array([clearance_m]),
    )


FROM, TO = (0.0, 0.0, 0.0), (3.0, 4.0, 0.0)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (
            answer(VISIBLE, 0.934, 0.456),
            ["VISIBLE", "93 %", "clears the nearest surface by 0.46 m"],
        ),
        (answer(VISIBLE, 0.9999, np.inf), ["VISIBLE", "more than 99 %"]),
        (
            answer(OCCLUDED, 0.02, -0.3, (1.5, 2.0, 0.0)),
            [
                "OCCLUDED",
                "2 % only",
                "at (1.50, 2.00, 0.00), 2.5 m from the start",
                "0.30 m higher",
            ],
        ),
        (answer(OCCLUDED, 0.001, -0.3), ["less than 1 %", "not seen at one place"]),
        (answer(UNKNOWN, 0.6, 0.2), ["UNKNOWN", "does not decide; it is open with 60 %"]),
        (answer(UNKNOWN, 0.95, np.inf), ["UNKNOWN", "seen by no scan"]),
        (answer(UNKNOWN, np.nan, np.nan), ["UNKNOWN: it cannot be judged."]),
    ],
)
def test_each_answer_has_its_words(given, words):
    said = in_words(FROM, TO, given)
    assert said.startswith("The line from (0.00, 0.00, 0.00) to (3.00, 4.00, 0.00) is 5.0 m long.")
    for word in words:
        assert word in said
    assert "nan" not in said
    assert "inf" not in said


@pytest.fixture(scope="module")
def wall(tmp_path_factory) -> Path:
    """A scan of a wall 10 m ahead, 10 m wide."""
    y, z = np.meshgrid(np.arange(-5, 5, 0.04), np.arange(-1.5, 1.5, 0.06))
    points = np.stack([np.full(y.size, 10.0), y.ravel(), z.ravel()], axis=1)
    path = tmp_path_factory.mktemp("wall") / "wall.npy"
    np.save(path, points.astype(np.float32))
    return path


@pytest.mark.parametrize(
    ("target", "verdict"), [("9,1,0", "VISIBLE"), ("30,1,0", "OCCLUDED"), ("-9,0,0", "UNKNOWN")]
)
def test_a_wall(wall, target, verdict, capsys):
    assert exit_code(["sight", str(wall), "--from", "sensor", "--to", target]) == 0
    out, err = capsys.readouterr()
    assert verdict in out
    assert not err


def test_the_blocker_is_on_the_wall(wall, capsys):
    assert exit_code(["sight", str(wall), "--from", "0,0,0", "--to", "20,2,0"]) == 0
    out = capsys.readouterr().out
    x, y, z = map(float, out.split("in the way at (")[1].split(")")[0].split(","))
    # The line y = x / 10 meets the wall x = 10 at y = 1.
    assert (x, y, z) == pytest.approx((10, 1, 0), abs=0.25)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--from", "camera", "--to", "1,2,3"], "no camera: give --from as X,Y,Z"),
        (["--from", "driver", "--to", "1,2,3"], "--from must be X,Y,Z in metres"),
        (["--from", "0,0,0", "--to", "1,2"], "--to must be X,Y,Z in metres"),
        (["--from", "0,0,0", "--to", "1,2,inf"], "--to must be three finite numbers"),
        (["--from", "0,0,0", "--to", "1,2,3", "--frame", "7"], "no frame 7"),
        (["--from", "0,0,0", "--to", "1,2,3", "--frames", "0:2"], "by their poses"),
        (["--from", "0,0,0", "--to", "1,2,3", "--frames", "x"], "--frames must be A:B"),
        (["--from", "0,0,0"], "--to"),
    ],
)
def test_a_wrong_request_gets_one_sentence(words, said, tmp_path, capsys):
    drive = scan_folder(tmp_path / "drive")
    assert exit_code(["sight", str(drive), *words]) == 2
    err = capsys.readouterr().err
    assert said in err
    assert len(err.splitlines()) == 1


def test_other_frames_are_laid_over_by_their_poses(tmp_path, capsys):
    folder = scan_folder(tmp_path / "drive", (0, 1, 2))
    # Frame 0 at the origin; frame 1 at x = 4; frame 2 at (4, 3), turned left by a quarter.
    (folder / "poses.txt").write_text(
        "1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 4 0 1 0 0 0 0 1 0\n0 -1 0 4 1 0 0 3 0 0 1 0\n"
    )
    drive = open_drive(folder)
    # As seen from frame 2: its x is the world's y, its y the world's -x.
    poses = remembered_scene(drive, drive[2], (0, 3)).poses
    np.testing.assert_allclose(poses[:, :3, 3], [[-3, 4, 0], [-3, 0, 0], [0, 0, 0]], atol=1e-12)
    np.testing.assert_allclose(poses[0, :3, :3], [[0, 1, 0], [-1, 0, 0], [0, 0, 1]], atol=1e-12)
    np.testing.assert_allclose(poses[2], np.eye(4), atol=1e-12)
    command = ["sight", str(folder), "--frame", "2", "--from", "sensor", "--to", "9,1,0"]
    assert exit_code([*command, "--frames", ":"]) == 0
    assert "frame 2, 3 scans;" in capsys.readouterr().out
