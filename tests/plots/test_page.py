"""The page: self-contained, escaped texts, embedded pictures."""

import base64
import re

import pytest

from intervis.plots.page import Page, Picture
from intervis.plots.tables import Table
from parsed_page import Parsed

EVIL = "<script>alert('x')</script> & \"more\""
PNG = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg=="
)


@pytest.fixture
def picture(tmp_path) -> Picture:
    path = tmp_path / "a.png"
    path.write_bytes(PNG)
    return Picture(path, EVIL, EVIL)


def test_every_text_is_escaped(picture):
    page = Page(EVIL, EVIL, [picture, EVIL, Table(EVIL, (EVIL,), ((EVIL,),), (EVIL,))], [EVIL])
    parsed = Parsed(page.as_html())
    assert "script" not in parsed.tags
    # title, heading, lead, strong and caption of the picture, section, table's caption, head,
    # cell and note, small print
    assert parsed.text.count(EVIL) == 11
    assert ("alt", EVIL) in parsed.attributes


def test_pictures_are_embedded_byte_for_byte(picture):
    (data,) = re.findall(r"data:image/png;base64,([^']+)'", Page("t", "", [picture]).as_html())
    assert base64.b64decode(data) == PNG


def test_nothing_is_loaded_from_elsewhere(picture):
    parsed = Parsed(Page("t", "l", [picture]).as_html())
    assert not {"script", "link", "iframe"} & set(parsed.tags)
    sources = [value for name, value in parsed.attributes if name in ("src", "href")]
    assert all(value.startswith("data:") for value in sources)
