"""The page: self-contained, every text escaped, pictures inside."""

import base64
import dataclasses
import re
from html.parser import HTMLParser
from pathlib import Path

import pytest

from intervis.errors import OutputError, ScanError
from intervis.plots.page import Page, Picture
from intervis.plots.tables import Table
from intervis.run.report import report_run
from intervis.run.stream import run
from intervis.settings import Settings
from small_drive import MemoryDrive

EVIL = "<script>alert('x')</script> & \"more\""
PNG = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg=="
)


class Seen(HTMLParser):
    """Tags, their attributes, and all text."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.attributes: list[tuple[str, str | None]] = []
        self.text = ""
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes += attrs

    def handle_data(self, data):
        self.text += data


@pytest.fixture
def picture(tmp_path) -> Picture:
    path = tmp_path / "a.png"
    path.write_bytes(PNG)
    return Picture(path, EVIL, EVIL)


def test_every_text_is_escaped(picture):
    page = Page(EVIL, EVIL, [picture, EVIL, Table(EVIL, (EVIL,), ((EVIL,),), (EVIL,))], [EVIL])
    seen = Seen(page.as_html())
    assert "script" not in seen.tags
    # title, heading, lead, strong and caption of the picture, section, table's caption, head,
    # cell and note, small print
    assert seen.text.count(EVIL) == 11
    assert ("alt", EVIL) in seen.attributes


def test_pictures_are_inside_byte_for_byte(picture):
    (data,) = re.findall(r"data:image/png;base64,([^']+)'", Page("t", "", [picture]).as_html())
    assert base64.b64decode(data) == PNG


def test_nothing_is_fetched(picture):
    seen = Seen(Page("t", "l", [picture]).as_html())
    assert not {"script", "link", "iframe"} & set(seen.tags)
    sources = [value for name, value in seen.attributes if name in ("src", "href")]
    assert all(value.startswith("data:") for value in sources)


def report_of(tmp_path: Path, **options):
    drive = MemoryDrive(**options)
    summary = run(drive, tmp_path / "run", settings=Settings(tau=5))
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
            for n in ("overview", "camera", "scan", "surface", "intervisibility")
        ),
    ]
    seen = Seen(report.paths[0].read_text())
    assert "script" not in seen.tags
    assert f"Intervisibility of {EVIL}" in seen.text
    # Frames 0, 2 and 5 went well: the middle one is 2.
    assert "Made for a test. 3 frames, tau = 5, viewpoint: camera. The pictures show frame 2." in (
        seen.text
    )
    assert "Frame 1 failed: frame 1 is bad." in seen.text
    assert len(report.paths[2].read_text().splitlines()) == 1 + len(summary.frames)


def test_without_a_camera_there_is_no_camera_picture(tmp_path):
    *_, report = report_of(tmp_path, with_camera=False)
    assert [path.stem for path in report.paths[3:]] == [
        "overview",
        "scan",
        "surface",
        "intervisibility",
    ]


def test_sight_lines_are_shown_where_asked_for(tmp_path):
    drive, summary, _ = report_of(tmp_path)
    report = report_run(drive, summary, tmp_path, with_sight=True)
    assert report.paths[-1] == tmp_path / "pictures" / "sight.png"
    assert report.paths[-1].read_bytes().startswith(b"\x89PNG")
    seen = Seen(report.paths[0].read_text())
    assert "Sight lines" in seen.text
    assert "What is seen from ahead" in seen.text


def test_a_run_without_frames_has_nothing_to_show(tmp_path):
    drive, summary, _ = report_of(tmp_path)
    with pytest.raises(OutputError, match="no frame to show"):
        report_run(drive, dataclasses.replace(summary, frames=()), tmp_path)
