"""Tables in four notations: text, HTML, CSV and Markdown."""

import csv
import io
from html.parser import HTMLParser

import pytest

from intervis.plots.tables import Table


class Cells(HTMLParser):
    """Texts of the cells of an HTML table, row by row."""

    def __init__(self) -> None:
        super().__init__()
        self.rows: list[list[str]] = []
        self.tags: list[str] = []
        self._inside = False

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        if tag == "tr":
            self.rows.append([])
        self._inside = tag in ("td", "th")
        if self._inside:
            self.rows[-1].append("")

    def handle_endtag(self, tag):
        if tag in ("td", "th"):
            self._inside = False

    def handle_data(self, data):
        if self._inside:
            self.rows[-1][-1] += data


TRICKY = Table(
    "A <b>title</b>", ("name", "value, %"), (("<script>|x", "1,5"), ("b", "22")), ("Note & more.",)
)


def test_text_is_aligned_left_first_then_right():
    assert TRICKY.as_text().splitlines() == [
        "A <b>title</b>",
        "name        value, %",
        "----------  --------",
        "<script>|x       1,5",
        "b                 22",
        "Note & more.",
    ]


def test_notes_are_wrapped_below_the_table():
    note = "two-point intervisibility of " * 8
    lines = Table("t", ("a",), (("1",),), (note,)).as_text().splitlines()[4:]
    assert len(lines) > 1
    assert all(len(line) <= 96 for line in lines)
    assert " ".join(lines) == note.strip()


def test_html_shows_every_cell_as_it_is_and_runs_none():
    parser = Cells()
    parser.feed(TRICKY.as_html())
    assert parser.rows == [list(TRICKY.headings), *map(list, TRICKY.rows)]
    assert "script" not in parser.tags
    assert "b" not in parser.tags


def test_csv_reads_back():
    assert list(csv.reader(io.StringIO(TRICKY.as_csv()))) == [
        ["name", "value, %"],
        ["<script>|x", "1,5"],
        ["b", "22"],
    ]


def test_markdown_bars_do_not_split_cells():
    lines = TRICKY.as_markdown().splitlines()
    assert lines[2:6] == [
        "| name | value, % |",
        "|---|--:|",
        "| <script>\\|x | 1,5 |",
        "| b | 22 |",
    ]


def test_rows_of_another_width_are_an_error_not_a_crooked_table():
    with pytest.raises(ValueError):
        Table("t", ("a", "b"), (("1",),)).as_text()
