"""The report of a run: files, pictures and texts of the page."""

import dataclasses
from pathlib import Path

import pytest

from intervis.errors import OutputError, ScanError
from intervis.run import run_drive
from intervis.run.report import report_run, report_steps
from intervis.settings import Settings
from parsed_page import Parsed
from small_drive import MemoryDrive

EVIL = "<script>alert('x')</script> & \"more\""


def report_of(tmp_path: Path, **options):
    drive = MemoryDrive(**options)
    summary = run_drive(drive, tmp_path / "run", settings=Settings(tau=5))
    return drive, summary, report_run(drive, summary, tmp_path, source_note="Made for a test.")


def test_a_report_of_a_run(tmp_path):
    _, summary, report = report_of(tmp_path, name=EVIL, failing={1: ScanError("frame 1 is bad.")})
    assert report.missing is None
    assert [path.relative_to(tmp_path).as_posix() for path in report.paths] == [
        "index.html",
        "measures.md",
        "measures.csv",
        *(
            f"pictures/{n}.png"
            for n in ("sight", "overview", "camera", "scan", "surface", "intervisibility")
        ),
    ]
    parsed = Parsed(report.paths[0].read_text())
    assert "script" not in parsed.tags
    assert f"Intervisibility of {EVIL}" in parsed.text
    # Frames 0, 2 and 5 went well: the middle one is 2.
    assert "Made for a test. 3 frames, tau = 5, viewpoint: camera. The pictures show frame 2." in (
        parsed.text
    )
    assert "Frame 1 failed: frame 1 is bad." in parsed.text
    assert len(report.paths[2].read_text().splitlines()) == 1 + len(summary.frames)


def test_without_a_camera_there_is_no_camera_picture(tmp_path):
    *_, report = report_of(tmp_path, with_camera=False)
    assert [path.stem for path in report.paths[3:]] == [
        "sight",
        "overview",
        "scan",
        "surface",
        "intervisibility",
    ]


def test_sight_lines_come_first_and_the_region_has_its_caveat(tmp_path):
    *_, report = report_of(tmp_path)
    assert report.paths[3] == tmp_path / "pictures" / "sight.png"
    assert report.paths[3].read_bytes().startswith(b"\x89PNG")
    text = Parsed(report.paths[0].read_text()).text
    order = ["What a place ahead sees", "Sight lines from a viewpoint ahead", "The paper's method"]
    order += ["It is not what the viewpoint sees", "Measures", "Steps of the method"]
    places = [text.index(words) for words in order]
    assert places == sorted(places)


@pytest.mark.parametrize("with_camera", [True, False])
def test_progress_is_reported_after_each_picture_and_the_page(tmp_path, with_camera):
    drive, summary, _ = report_of(tmp_path, with_camera=with_camera)
    notes = []
    report_run(drive, summary, tmp_path, progress=notes.append)
    pictures = [
        "sight",
        "overview",
        *["camera"] * with_camera,
        "scan",
        "surface",
        "intervisibility",
    ]
    assert notes == [*pictures, "page"]
    assert len(notes) == report_steps(drive)


def test_a_run_without_frames_has_nothing_to_show(tmp_path):
    drive, summary, _ = report_of(tmp_path)
    with pytest.raises(OutputError, match="no frame with a result"):
        report_run(drive, dataclasses.replace(summary, frames=()), tmp_path)
