"""`intervis view`: the page as a file, and one sentence for each mistake."""

import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys

import numpy as np
import pytest

from intervis.cli import exit_code
from small_drive import scan_folder


@pytest.fixture
def drive(tmp_path):
    return scan_folder(tmp_path / "drive", (0, 1, 2))


def test_a_page_is_written_and_written_again(drive, tmp_path, capsys):
    page = tmp_path / "page.html"
    asked = ["view", str(drive), "--html", str(page), "--to", "10,1,0"]
    assert exit_code(asked) == 0
    out, err = capsys.readouterr()
    assert out == f"Page: {page} ({page.stat().st_size / 1e6:.1f} MB)\n"
    assert not err
    first = page.read_bytes()
    assert exit_code(asked) == 0
    assert page.read_bytes() == first  # the same input gives the same page


def test_another_file_is_not_replaced(drive, tmp_path, capsys):
    notes = tmp_path / "notes.html"
    notes.write_text("<p>mine</p>")
    assert exit_code(["view", str(drive), "--html", str(notes)]) == 2
    assert "was not written by 'intervis view' and was not changed" in capsys.readouterr().err
    assert notes.read_text() == "<p>mine</p>"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "give --html FILE to write a page, --serve to look at once, or --rerun"),
        (["--html", "PAGE", "--from", "camera"], "no camera: give --from as X,Y,Z, or sensor"),
        (["--html", "PAGE", "--from", "driver"], "--from must be X,Y,Z in metres"),
        (["--html", "PAGE", "--to", "1,2"], "--to must be X,Y,Z in metres"),
        (
            ["--html", "PAGE", "--fixed"],
            "--fixed keeps the viewpoint by the poses, and frame 0 has",
        ),
        (["--html", "PAGE", "--frames", "9:"], "no frame lies in the range"),
        (["--html", "PAGE", "--memory", "-1"], "--memory must be 0 or more, got -1"),
        (["--html", "PAGE", "--most", "0"], "--most must be 1 or more, got 0"),
        (["--html", "PAGE", "--returns", "0"], "--returns must be 1 or more, got 0"),
        (["--html", "PAGE", "--risk", "2"], "--risk must be from 0.001 to 0.2"),
        (["--html", "no/such/page.html"], "there is no folder"),
        (["--html", "."], "is a folder: give the path of a file"),
    ],
)
def test_mistakes_get_one_sentence(drive, tmp_path, capsys, monkeypatch, words, said):
    monkeypatch.chdir(tmp_path)
    page = tmp_path / "page.html"
    assert exit_code(["view", str(drive), *(str(page) if w == "PAGE" else w for w in words)]) == 2
    out, err = capsys.readouterr()
    assert said in err
    assert err.count("\n") == 1
    assert not out
    assert not page.exists()


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """The folder of a run with sight lines; its drive stands beside it."""
    folder = tmp_path_factory.mktemp("run")
    scan_folder(folder / "drive", (0, 1, 2))
    asked = ["run", str(folder / "drive"), "--out", str(folder / "run"), "--sight"]
    assert exit_code([*asked, "--viewpoint", "6,1,0.5", "--tau", "5"]) == 0
    return folder / "run"


def run_shown(page):
    """What the page of a run says of it."""
    return json.loads(re.search(r'id="page">(.*?)</script>', page.read_text())[1])["run"]


def test_the_page_of_a_run_shows_it_with_its_drive(run, tmp_path, capsys):
    page = tmp_path / "page.html"
    assert exit_code(["view", str(run), "--html", str(page), "--to", "10,1,0"]) == 0
    out, err = capsys.readouterr()
    assert (out.count("\n"), err) == (1, "")
    assert run_shown(page) == {"has_states": True, "has_drive": True}
    assert exit_code(["view", str(run), "--html", str(page), "--most", "1"]) == 0
    assert "1 of 3 frames are shown, evenly chosen" in capsys.readouterr().err


def test_a_run_whose_drive_is_gone_is_shown_with_one_sentence(run, tmp_path, capsys):
    moved, page = tmp_path / "moved", tmp_path / "page.html"
    drive = run.with_name("drive")
    drive.rename(moved)
    try:
        asked = ["view", str(run), "--html", str(page)]
        assert exit_code(asked) == 0
        assert capsys.readouterr().err.count("\n") == 1
        assert run_shown(page) == {"has_states": True, "has_drive": False}
        assert exit_code([*asked, "--drive", str(moved)]) == 0
        assert capsys.readouterr().err == ""
        assert run_shown(page)["has_drive"]
        page.unlink()
        for words, said in (
            (["--to", "10,1,0"], "--to needs the drive of the run, which is missing: there is"),
            (["--drive", str(tmp_path / "no")], "there is nothing at"),
        ):
            assert exit_code([*asked, *words]) == 2
            err = capsys.readouterr().err
            assert said in err
            assert err.count("\n") == 1
        assert [path.name for path in tmp_path.iterdir()] == ["moved"]
    finally:
        moved.rename(drive)


def test_a_damaged_frame_of_a_run_is_told_and_ends_with_1(run, tmp_path, caplog, capsys):
    copy = shutil.copytree(run, tmp_path / "copy")
    frames, page = sorted((copy / "frames").iterdir()), tmp_path / "page.html"
    frames[1].write_bytes(b"broken")
    assert exit_code(["view", str(copy), "--html", str(page)]) == 1
    assert "frame 1 is left out: " in caplog.text
    assert page.read_text().count('id="block-') == 2
    page.unlink()
    for frame in frames:
        frame.write_bytes(b"")
    capsys.readouterr()
    assert exit_code(["view", str(copy), "--html", str(page)]) == 2
    assert capsys.readouterr().err.splitlines()[-1].endswith("is damaged: File is not a zip file.")
    assert not page.exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--serve"], "--serve is about a drive"),
        (["--from", "1,2,3"], "--from is about a drive"),
        (["--fixed"], "--fixed is about a drive"),
        (["--camera", "image_03"], "--camera is about a drive"),
        (["--risk", "0.02"], "--risk is about lines that are judged now"),
        (["--memory", "0"], "--memory is about lines that are judged now"),
        (["--frames", "9:"], "no frame lies in the range"),
        (["--returns", "0"], "--returns must be 1 or more"),
    ],
)
def test_mistakes_with_a_run_get_one_sentence(run, tmp_path, capsys, words, said):
    page = tmp_path / "page.html"
    assert exit_code(["view", str(run), "--html", str(page), *words]) == 2
    out, err = capsys.readouterr()
    assert said in err
    assert (err.count("\n"), out) == (1, "")
    assert not page.exists()


def test_pages_stand_neither_in_the_run_nor_in_its_drive(run, capsys):
    for folder in (run, run.with_name("drive")):
        assert exit_code(["view", str(run), "--html", str(folder / "page.html")]) == 2
        assert "which this command reads and never changes" in capsys.readouterr().err


def test_the_runs_of_several_drives_are_named(run, drive, tmp_path, capsys):
    for name in ("b", "a"):
        shutil.copytree(run, tmp_path / "runs" / name)
    page = str(tmp_path / "page.html")
    assert exit_code(["view", str(tmp_path / "runs"), "--html", page]) == 2
    assert "give the path of one of them: a, b." in capsys.readouterr().err
    assert exit_code(["view", str(drive), "--html", page, "--drive", str(drive)]) == 2
    assert "--drive says where the drive of a run is" in capsys.readouterr().err


def test_a_long_drive_is_thinned_after_its_size_is_said(tmp_path, capsys):
    drive = scan_folder(tmp_path / "long", (0,))
    for number in range(1, 5000):
        os.link(drive / "000000.bin", drive / f"{number:06d}.bin")
    page = tmp_path / "page.html"
    assert exit_code(["view", str(drive), "--html", str(page), "--most", "3"]) == 0
    out, err = capsys.readouterr()
    assert "a page of 5,000 frames would take up to" in err
    assert "3 of them are shown, evenly chosen" in err
    assert out.startswith("Page: ")
    shutil.rmtree(drive)


def test_names_with_control_characters_are_escaped_on_the_terminal(tmp_path, capsys):
    drive = scan_folder(tmp_path / "a\x1b[31m<b>", (0,))
    page = tmp_path / "p\x1b[31m.html"
    assert exit_code(["view", str(drive), "--html", str(page)]) == 0
    out, err = capsys.readouterr()
    assert "\x1b" not in out + err
    assert "\\x1b[31m" in out
    assert b"\x1b" not in page.read_bytes()


def test_a_frame_without_returns_is_shown_empty(tmp_path):
    folder = scan_folder(tmp_path / "drive", (0,))
    np.full((30, 4), np.nan, "<f4").tofile(folder / "000001.bin")
    page = tmp_path / "page.html"
    assert exit_code(["view", str(folder), "--html", str(page)]) == 0
    content = re.search(r'id="page">(.*?)</script>', page.read_text())[1]
    assert [frame["stored"] > 0 for frame in json.loads(content)["frames"]] == [True, False]


def test_a_broken_scan_is_left_out_and_told(tmp_path, caplog):
    folder = scan_folder(tmp_path / "drive", (0, 1))
    (folder / "000001.bin").write_bytes(b"123")
    page = tmp_path / "page.html"
    asked = ["view", str(folder), "--html", str(page)]
    assert exit_code(asked) == 0
    assert page.read_text().count('id="block-') == 1
    assert "frame 1 is left out: " in caplog.text
    (folder / "000000.bin").write_bytes(b"123")
    assert exit_code(asked) == 2


def test_a_taken_port_is_one_sentence(drive, capsys):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = str(taken.getsockname()[1])
        assert exit_code(["view", str(drive), "--serve", "--port", port]) == 2
    assert f"cannot listen on port {port} of 127.0.0.1" in capsys.readouterr().err


def test_ctrl_c_ends_serving_without_an_error(drive):
    # Whoever runs the tests in the background hands down an ignored SIGINT.
    program = (
        "import signal; signal.signal(signal.SIGINT, signal.default_int_handler);"
        " from intervis.cli import main; main()"
    )
    asked = [sys.executable, "-c", program, "view", str(drive), "--serve", "--port", "0"]
    with subprocess.Popen(asked, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as served:
        said = served.stdout.readline()
        served.send_signal(signal.SIGINT)
        try:
            _, err = served.communicate(timeout=60)
        finally:
            served.kill()
    assert said.startswith(b"Open http://127.0.0.1:")
    assert (served.returncode, err) == (0, b"")
