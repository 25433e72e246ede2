"""`intervis sight`: a wall with known answers, and scans registered by their poses."""

import os
from pathlib import Path

import numpy as np
import pytest

from intervis.cli import exit_code
from intervis.drives import open_drive
from intervis.uses.registration import registered_scene
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
