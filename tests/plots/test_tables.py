"""Tables in four notations, with cells worked out by hand."""

import csv
import io
from html.parser import HTMLParser

import pytest

from intervis.plots.tables import Table, measures_table, times_table
from intervis.run.frame_file import FrameRecord

MEASURES = {
    "n_raw": 125_148.0, "n_dropped": 0.0, "n_fov": 20_008.0, "n": 572.0, "N": 1121.0,
    "SP": 1692.0, "ARR": 99.543, "TPI": 50.25, "TPI_unique": 99.9, "DCP": 98.65,
}  # fmt: skip


def record(number: int, **changes: float) -> FrameRecord:
    return FrameRecord(number, MEASURES | changes, {"total": 0.0104})


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


def test_a_row_for_each_frame_where_they_are_few():
    table = measures_table([record(3), record(7, TPI=10.0)])
    assert table.headings[:4] == ("frame", "n_raw", "n_fov", "nodes n")
    assert table.rows[0] == (
        "3", "125148", "20008", "572", "1121", "1692", "99.54", "50.25", "99.90", "98.65", "10.40",
    )  # fmt: skip
    assert table.rows[1][0] == "7"
    assert table.rows[1][7] == "10.00"


def test_granularity_has_a_column_where_there_is_one():
    table = measures_table([FrameRecord(3, MEASURES, {"total": 0.0104}, tau=35)])
    assert table.headings[:3] == ("frame", "tau", "n_raw")
    assert table.rows[0][:3] == ("3", "35", "125148")


def test_how_they_spread_where_frames_are_many():
    table = measures_table([record(n, TPI=float(t)) for n, t in enumerate((1, 2, 3, 4, 10))], few=4)
    tpi = table.headings.index("TPI %")
    assert {row[0]: row[tpi] for row in table.rows} == {
        "mean": "4.00",
        "sample std": "3.54",  # sqrt(50 / 4)
        "least": "1.00",
        "greatest": "10.00",
    }
    assert len(measures_table([record(n) for n in range(50)], few=None).rows) == 50


def test_a_table_says_that_tpi_has_a_ceiling():
    assert any("just over 50 %" in note for note in measures_table([record(0)]).notes)


def test_times_are_milliseconds_in_the_order_of_the_stages():
    spread = {"p50": 0.001, "p99": 0.0025, "mean": 0.0015, "sample_std": None}
    table = times_table({"total": spread, "fov": spread}, 1)
    assert table.rows == (
        ("field of view", "1.00", "2.50", "1.50", ""),
        ("total", "1.00", "2.50", "1.50", ""),
    )
    assert table.title == "Time of each stage, 1 frame"


def test_rows_of_another_width_are_an_error_not_a_crooked_table():
    with pytest.raises(ValueError):
        Table("t", ("a", "b"), (("1",),)).as_text()
