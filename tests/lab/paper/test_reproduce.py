"""The experiments on small drives: files written, and notes on what is left out."""

import csv
import io
import re
from functools import partial

import numpy as np
import pytest
from rough_ground import rough_ground

from intervis import Settings, open_drive
from intervis.camera import Camera
from intervis.cli import exit_code
from intervis.drives import Frame
from intervis.errors import IntervisError
from intervis.lab.paper import experiment as module
from intervis.lab.paper import interpretations
from intervis.lab.paper.experiment import run_frame, usable
from intervis.lab.paper.report import check_folder
from intervis.plots import style

PNG = ("03", "04", "05", "06", "07", "08", "09", "10")


@pytest.fixture(autouse=True)
def short(monkeypatch):
    """Few runs and coarse pictures: neither times nor pictures are tested here."""
    monkeypatch.setattr(style, "DPI", 40)
    monkeypatch.setattr(module, "SWEEP", (1, 5, 35, *module.printed_values.TAUS))
    monkeypatch.setattr(module, "SWEEP_RUNS", 1)
    monkeypatch.setattr(module.printed_values, "RUNS", 2)


def write_drive(folder, scans, poses=True):
    folder.mkdir()
    for number, points in enumerate(scans):
        points.tofile(folder / f"{number:06d}.bin")
    if poses:
        rows = [f"1 0 0 {0.3 * k} 0 1 0 0 0 0 1 0" for k in range(len(scans))]
        (folder / "poses.txt").write_text("\n".join(rows) + "\n")
    return folder


def cells(path):
    return list(csv.DictReader(io.StringIO(path.read_text())))


def reproduce(source, out, *more):
    return exit_code(["reproduce", str(source), "--out", str(out), *more])


def test_one_command_writes_everything_and_says_what_is_missing(tmp_path, capsys):
    drive = write_drive(tmp_path / "drive", [rough_ground(1, 1500), rough_ground(1, 1500)])
    out = tmp_path / "out"
    assert reproduce(drive, out, "--consecutive-frames", "2") == 0
    for number in PNG:
        assert (out / "figures" / f"figure-{number}.png").read_bytes()[:4] == b"\x89PNG"
    for number in ("04", "05", "09", "10"):
        assert (out / "figures" / f"figure-{number}.svg").read_text().startswith("<?xml")
    page = (out / "report.html").read_text()
    assert page.count("data:image/png;base64,") == len(PNG)
    assert not re.search(r"(src|href)=['\"](?!data:)", page)
    text = (out / "report.md").read_text()
    assert "no camera" in text
    for picture in re.findall(r"\]\((figures/[^)]+)\)", text):
        assert (out / picture).is_file()
    rows = cells(out / "tables" / "table-2.csv")
    assert [row["tau"] for row in rows] == [str(tau) for tau in range(10, 101, 10)]
    assert rows[0]["N paper"] == "3982"
    assert len(set(rows[0])) == 12
    methods = cells(out / "tables" / "table-4.csv")
    assert methods[0]["nodes"] == "1500"
    assert "settings" in text.lower()
    captured = capsys.readouterr()
    assert "report.html" in captured.out
    assert "criterion: ARR at least 99 %" in captured.out
    assert "no camera" in captured.err
    check_folder(out)  # its own report may be replaced


def test_without_poses_or_with_a_single_scan_temporal_consistency_is_left_out(tmp_path):
    several = write_drive(
        tmp_path / "several", [rough_ground(1, 900), rough_ground(2, 900)], poses=False
    )
    single = several / "000000.bin"
    for source, reason in ((several, "no poses"), (single, "a single frame")):
        out = tmp_path / reason.replace(" ", "-")
        assert reproduce(source, out, "--no-global-points") == 0
        text = (out / "report.md").read_text()
        assert f"Temporal consistency is left out: the frames have {reason}" in text or (
            f"left out: there is {reason}" in text
        )
        assert "Global points was not requested" in text
        assert not (out / "tables" / "temporal-consistency.csv").exists()


def test_a_few_returns_give_what_they_can(tmp_path):
    drive = write_drive(tmp_path / "few", [rough_ground(3, 40)])
    assert reproduce(drive, tmp_path / "out") == 0
    text = (tmp_path / "out" / "report.md").read_text()
    assert re.search(r"Returns in view: \d+ only", text)
    rows = cells(tmp_path / "out" / "tables" / "table-2.csv")
    assert rows[-1]["TPI %"] == "–"
    assert "not checked" in text
    assert "nan" not in re.sub(r"\S+\.\S+", "", text)


def test_wrong_requests_get_one_sentence(tmp_path, capsys):
    drive = write_drive(tmp_path / "drive", [rough_ground(4, 300)])
    (tmp_path / "file").write_text("x")
    for arguments in (
        [drive, tmp_path / "a", "--frame", "7"],
        [tmp_path / "nothing", tmp_path / "b"],
        [drive, tmp_path / "file"],
        [drive, tmp_path / "c", "--set", "taw=3"],
    ):
        assert reproduce(*arguments) == 2
        said = capsys.readouterr().err
        assert said.startswith("intervis: ")
        assert "Traceback" not in said


def camera(width=300, height=200):
    return Camera(np.array([[200.0, 0, 150, 0], [0, 200, 100, 0], [0, 0, 1, 0]]), width, height)


CAM_FROM_VELO = np.array([[0.0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]])


def with_image(folder, size):
    image = pytest.importorskip("PIL.Image")
    path = folder / "image.png"
    image.new("RGB", size).save(path)
    return Frame(
        0, rough_ground(5)[:, :3], camera=camera(), cam_from_velo=CAM_FROM_VELO, image_path=path
    )


def test_an_image_of_another_size_is_left_out_and_said(tmp_path):
    good, _, notes = usable(with_image(tmp_path, (300, 200)), Settings())
    assert good.image_path is not None
    assert notes == []
    odd, _, notes = usable(with_image(tmp_path, (310, 200)), Settings())
    assert odd.image_path is None
    assert "310 x 200" in notes[0]
    assert "300 x 200" in notes[0]
    (tmp_path / "image.png").write_bytes(b"no picture")
    broken = Frame(
        0,
        rough_ground(5)[:, :3],
        camera=camera(),
        cam_from_velo=CAM_FROM_VELO,
        image_path=tmp_path / "image.png",
    )
    _, _, notes = usable(broken, Settings())
    assert "no image" in notes[0]


def test_nothing_in_view_turns_to_the_full_circle_and_says_so():
    behind = rough_ground(6)[:, :3] * np.array([-1, 1, 1], np.float32)
    frame = Frame(0, behind, camera=camera(), cam_from_velo=CAM_FROM_VELO)
    _, settings, notes = usable(frame, Settings())
    assert settings.view == "circle"
    assert any("full circle" in note for note in notes)
    with pytest.raises(IntervisError):
        usable(Frame(0, np.full((5, 3), np.nan, np.float32)), Settings())


def test_the_interpretations_command_writes_its_tables(tmp_path, capsys, monkeypatch):
    one = {"metrics": ["ground"], "charts": ["ground"], "samplings": ["kernel"]}
    monkeypatch.setattr(
        interpretations,
        "compare_interpretations",
        partial(interpretations.compare_interpretations, **one),
    )
    drive = write_drive(tmp_path / "drive", [rough_ground(1, 400), rough_ground(2, 400)])
    out = tmp_path / "out"
    assert exit_code(["interpretations", str(drive), "--out", str(out), "--frames", "1"]) == 0
    captured = capsys.readouterr()
    assert "One choice changed at a time" in captured.out
    assert "interpretations.csv" in captured.err
    rows = cells(out / "interpretations.csv")
    assert len(rows) == 35
    assert {row["metric"] for row in rows} == {"ground"}
    assert "Frames: drive 0." in (out / "interpretations.md").read_text()
    assert cells(out / "granularity.csv")[0]["tau"] == "1"
    assert (out / "granularity.svg").is_file()


@pytest.mark.realdata
@pytest.mark.slow
def test_a_real_frame_stays_within_three_points_of_the_paper_in_the_mean(shared_data):
    drive = open_drive(shared_data / "kitti_object")
    away = []
    for number in drive.frame_numbers:
        sweep = run_frame(drive[number], with_global=False).sweep
        away += [
            abs(sweep[tau].measures.TPI - row.TPI)
            for tau, row in module.printed_values.TABLE_2.items()
        ]
    assert np.mean(away) < 3.0


def test_a_frame_that_does_not_exist_leaves_no_folder(tmp_path, capsys):
    drive = write_drive(tmp_path / "drive", [rough_ground(1, 900)])
    assert reproduce(drive, tmp_path / "out", "--frame", "999") == 2
    assert "no frame 999" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("name", ["report.html", "report.md", "settings.toml"])
def test_files_of_other_origin_are_not_replaced(name, tmp_path, capsys):
    drive = write_drive(tmp_path / "drive", [rough_ground(1, 900)])
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / name).write_text("mine")
    assert reproduce(drive, tmp_path / "out") == 2
    assert f"{name} was not written by an earlier" in capsys.readouterr().err
    assert [path.name for path in (tmp_path / "out").iterdir()] == [name]
