"""`intervis simulate` and `intervis demo`; errors in the files of a drive with a camera."""

import contextlib
import csv
import io
import json
import shutil
import sys
from pathlib import Path

import pytest

from intervis.cli import exit_code
from intervis.drives import open_drive
from small_drive import files_below, scan_folder


@pytest.fixture(scope="module")
def simulated(tmp_path_factory) -> Path:
    """The folder of a simulated drive of two frames."""
    out = tmp_path_factory.mktemp("world")
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        assert exit_code(["simulate", "--out", str(out), "--frames", "2"]) == 0
    drive = Path(said.getvalue().strip().removeprefix("Drive: "))
    assert drive.is_relative_to(out)
    return drive.parent


@pytest.fixture(scope="module")
def demo(tmp_path_factory) -> Path:
    """The output folder of a demo of one frame."""
    out = tmp_path_factory.mktemp("demo") / "demo"
    assert exit_code(["demo", "--out", str(out), "--frames", "1", "--seed", "1"]) == 0
    return out


@pytest.fixture
def copied(simulated, tmp_path) -> Path:
    return Path(shutil.copytree(simulated, tmp_path / "copy"))


def test_simulate_writes_a_drive_that_opens(simulated):
    drive = open_drive(simulated)
    assert drive.frame_numbers == (0, 1)
    assert drive.camera is not None
    assert drive.poses is not None


def test_a_simulated_drive_runs_from_every_named_viewpoint(simulated, tmp_path):
    for viewpoint in ("camera", "sensor", "start"):
        out = tmp_path / viewpoint
        assert exit_code(["run", str(simulated), "--out", str(out), "--viewpoint", viewpoint]) == 0


def test_a_run_can_be_shown_as_a_demo_is(simulated, tmp_path, capsys):
    out = tmp_path / "out"
    assert exit_code(["run", str(simulated), "--out", str(out), "--report"]) == 0
    assert f"Page: {out / 'index.html'}" in capsys.readouterr().out
    assert (out / "pictures" / "overview.png").exists()
    before = files_below(out / "frames")
    assert exit_code(["run", str(simulated), "--out", str(out)]) == 0
    assert files_below(out / "frames") == before


def test_missing_calibration_is_named(copied, tmp_path, capsys):
    path = next(copied.rglob("calib_velo_to_cam.txt"))
    path.unlink()
    assert exit_code(["run", str(copied), "--out", str(tmp_path / "out")]) == 2
    assert "calib_velo_to_cam.txt" in capsys.readouterr().err


def test_a_calibration_line_that_does_not_parse_is_named(copied, tmp_path, capsys):
    path = next(copied.rglob("calib_velo_to_cam.txt"))
    lines = path.read_text().splitlines()
    (place,) = (nth for nth, line in enumerate(lines) if line.startswith("T:"))
    lines[place] = "T: 0.1 zero 0.2"
    path.write_text("\n".join(lines))
    assert exit_code(["run", str(copied), "--out", str(tmp_path / "out")]) == 2
    err = capsys.readouterr().err
    assert "calib_velo_to_cam.txt" in err
    assert str(place + 1) in err
    assert len(err.splitlines()) == 1


def test_a_demo_leaves_drive_run_tables_pictures_and_page(demo):
    there = {path.relative_to(demo).as_posix() for path in demo.rglob("*") if path.is_file()}
    assert {
        "index.html",
        "measures.md",
        "measures.csv",
        "run/summary.json",
        "run/settings.toml",
        "run/frames/0000000000.npz",
        *(
            f"pictures/{n}.png"
            for n in ("overview", "camera", "scan", "surface", "intervisibility", "sight")
        ),
    } <= there
    summary = json.loads((demo / "run" / "summary.json").read_text())
    measures = summary["frames"][0]["measures"]
    (row,) = csv.DictReader(io.StringIO((demo / "measures.csv").read_text()))
    assert row["frame"] == "0"
    for heading, name in (("n_raw", "n_raw"), ("n_fov", "n_fov"), ("nodes n", "n"), ("SP", "SP")):
        assert row[heading] == str(measures[name])
    page = (demo / "index.html").read_text()
    assert page.count("data:image/png;base64,") == 6
    assert "seed 1" in page
    assert "://" not in page


def test_a_demo_without_matplotlib_says_so_and_does_the_rest(
    simulated, tmp_path, capsys, monkeypatch
):
    monkeypatch.setattr("intervis.lab.worlds.simulate", lambda *_, **__: simulated, raising=False)
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    out = tmp_path / "demo"
    assert exit_code(["demo", "--out", str(out), "--frames", "2"]) == 0
    said, told = capsys.readouterr()
    assert "pip install 'intervis[plots]'" in told
    assert "measures.csv" in said
    page = (out / "index.html").read_text()
    assert "intervis[plots]" in page
    assert "<img" not in page
    assert not (out / "pictures").exists()


def test_a_demo_can_be_given_again(demo, capsys):
    assert exit_code(["demo", "--out", str(demo), "--frames", "1", "--seed", "1"]) == 0
    assert f"Page: {demo / 'index.html'}" in capsys.readouterr().out


@pytest.mark.parametrize(
    "mine", ["index.html", "measures.csv", "pictures/sight.png", "run/settings.toml"]
)
def test_a_demo_replaces_no_file_of_other_origin(mine, tmp_path, capsys):
    (tmp_path / mine).parent.mkdir(exist_ok=True)
    (tmp_path / mine).write_text("mine")
    assert exit_code(["demo", "--out", str(tmp_path), "--frames", "1"]) == 2
    err = capsys.readouterr().err
    assert f"{tmp_path / mine} was not written by an earlier" in err
    assert len(err.splitlines()) == 1
    assert list(files_below(tmp_path)) == [mine]


def test_a_demo_replaces_no_run_of_another_drive(simulated, tmp_path, capsys):
    run = ["run", str(scan_folder(tmp_path / "other")), "--out", str(tmp_path / "out" / "run")]
    assert exit_code(run) == 0
    before = files_below(tmp_path / "out")
    assert exit_code(["demo", "--out", str(tmp_path / "out"), "--frames", "1"]) == 2
    assert "choose another output folder" in capsys.readouterr().err
    assert files_below(tmp_path / "out") == before


def test_another_drive_leaves_files_that_are_no_frames(simulated, tmp_path):
    date = Path(shutil.copytree(simulated, tmp_path / simulated.name))
    scans = next(date.rglob("velodyne_points")) / "data"
    (scans / "notes.txt").write_text("mine")
    assert exit_code(["simulate", "--out", str(tmp_path), "--frames", "1", "--seed", "5"]) == 0
    assert sorted(path.name for path in scans.iterdir()) == ["0000000000.bin", "notes.txt"]


def test_a_demo_where_a_file_stands_is_refused(tmp_path, capsys):
    (tmp_path / "taken").write_text("mine")
    assert exit_code(["demo", "--out", str(tmp_path / "taken"), "--frames", "1"]) == 2
    err = capsys.readouterr().err
    assert len(err.splitlines()) == 1
    assert (tmp_path / "taken").read_text() == "mine"


@pytest.mark.parametrize(
    "command",
    [["simulate", "--out"], ["demo", "--out"], ["evaluate", "street", "--json"]],
    ids=["simulate", "demo", "evaluate"],
)
def test_commands_without_embreex_name_the_extra(command, tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "embreex", None)
    assert exit_code([*command, str(tmp_path / "new")]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err == (
        "intervis: ray casting needs the package 'embreex':"
        " install it with pip install 'intervis[lab]'.\n"
    )
    assert not list(tmp_path.iterdir())


def test_simulate_writes_other_layouts_and_scanners(tmp_path, capsys):
    out = tmp_path / "drive"
    options = ["--layout", "mcap", "--scanner", "vlp-16", "--scanner", "ring@front"]
    command = ["simulate", "--out", str(out), "--frames", "2", "--motion-distortion", *options]
    assert exit_code(command) == 0
    path = Path(capsys.readouterr().out.strip().removeprefix("Drive: "))
    assert path == out / "drive.mcap" / "lidar" / "roof"
    frame = open_drive(path)[1]
    assert [len(scan.points) > 500 for scan in frame.scans] == [True, True]
    assert frame.deskewed().shape == frame.points.shape
    assert exit_code(command) == 2
    assert "holds files already and was not changed" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "names"),
    [
        (["--layout", "bag"], "kitti, nuscenes, argoverse2, pcd, mcap"),
        (["--layout", "pcd", "--scanner", "vlp16"], "hdl-32e, hdl-64e, livox"),
        (["--scanner", "vlp-16@hood"], "roof, under, left, right, front, rear, mast, tripod"),
        (["--layout", "pcd", "--frames", "0"], "frames must be a whole number of 1 or more"),
        (["--layout", "pcd", "--seed", "-1"], "seed must be a whole number of 0 or more"),
    ],
)
def test_wrong_names_and_numbers_are_told_in_one_line(options, names, tmp_path, capsys):
    assert exit_code(["simulate", "--out", str(tmp_path / "new"), *options]) == 2
    said = capsys.readouterr()
    assert names in said.err
    assert len(said.err.splitlines()) == 1
    assert not list(tmp_path.iterdir())


def test_a_drive_is_not_simulated_through_a_link(tmp_path, capsys):
    (tmp_path / "theirs").mkdir()
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "2011_09_26").symlink_to(tmp_path / "theirs")
    asked = ["simulate", "--frames", "1", "--no-images", "--scanner", "vlp-16"]
    assert exit_code([*asked, "--out", str(tmp_path / "out")]) == 2
    assert "2011_09_26 is a link" in capsys.readouterr().err
    assert list((tmp_path / "theirs").iterdir()) == []
