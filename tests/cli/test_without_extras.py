"""Without the optional dependencies the library works, and the laboratory names its extra."""

import subprocess
import sys
from pathlib import Path

import pytest

from small_drive import scan_folder

EXTRAS = (
    *("embreex", "matplotlib", "PIL", "pypcd4", "lzf", "pyarrow", "pye57"),
    *("laspy", "lazrs", "lz4", "backports", "rosbags", "rerun", "foxglove", "fsspec"),
)
PROGRAM = (
    f"import sys; sys.modules.update(dict.fromkeys({EXTRAS!r}))\n"
    "from intervis.cli import exit_code; sys.exit(exit_code(sys.argv[1:]))"
)


def without_extras(*words: str | Path) -> subprocess.CompletedProcess[str]:
    """The program in a process where importing an optional dependency raises ImportError."""
    command = [sys.executable, "-c", PROGRAM, *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True)


@pytest.fixture
def drive(tmp_path) -> Path:
    return scan_folder(tmp_path / "drive")


def test_a_drive_is_analysed(drive, tmp_path):
    done = without_extras("run", drive, "--out", tmp_path / "out", "--tau", "10")
    assert done.returncode == 0, done.stderr
    assert "Measures of each frame" in done.stdout
    assert len(list((tmp_path / "out" / "frames").iterdir())) == 3


def test_a_report_has_tables_and_names_the_extra_for_pictures(drive, tmp_path):
    done = without_extras("run", drive, "--out", tmp_path / "out", "--report")
    assert done.returncode == 0, done.stderr
    assert "pip install 'intervis[plots]'" in done.stderr
    assert "<table>" in (tmp_path / "out" / "index.html").read_text()


def test_a_sight_line_is_answered(drive):
    done = without_extras("sight", drive, "--from", "sensor", "--to", "5,0,0")
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[1].split(":")[0] in ("Visible", "Occluded", "Unknown")


@pytest.mark.parametrize(
    ("words", "extra"),
    [
        (
            ["sight", "{drive}", "--from", "sensor", "--to", "5,0,0", "--picture", "{out}.png"],
            "plots",
        ),
        (["view", "{drive}", "--rerun", "{out}.rrd"], "viewer"),
        (["view", "{drive}", "--foxglove", "{out}.mcap"], "viewer"),
        (["demo", "--out", "{out}"], "lab"),
        (["simulate", "--out", "{out}"], "lab"),
        (["evaluate", "street"], "lab"),
        (["sight", "s3://bucket/drive", "--from", "sensor", "--to", "5,0,0"], "s3"),
    ],
)
def test_what_needs_an_extra_names_it_in_one_line(words, extra, drive, tmp_path):
    places = {"drive": drive, "out": tmp_path / "out"}
    done = without_extras(*(word.format(**places) for word in words))
    assert done.returncode == 2, done.stderr
    lines = [line for line in done.stderr.splitlines() if not line.startswith("note: ")]
    assert len(lines) == 1, done.stderr
    assert f"pip install 'intervis[{extra}]'" in lines[0]
    assert not done.stdout, "the work has been done before the extra was looked for"
