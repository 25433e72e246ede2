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


def test_the_folder_of_a_run_is_refused(drive, tmp_path, capsys):
    run = tmp_path / "run"
    assert exit_code(["run", str(drive), "--out", str(run)]) == 0
    capsys.readouterr()
    assert exit_code(["view", str(run), "--html", str(tmp_path / "page.html")]) == 2
    assert "holds the results of a run, without its scans" in capsys.readouterr().err


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
