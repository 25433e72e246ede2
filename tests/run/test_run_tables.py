"""The tables of a run, with cells calculated by hand."""

import re

from intervis.run.frame_file import FrameRecord
from intervis.run.tables import measures_table, times_table

MEASURES = {
    "n_raw": 125_148.0, "n_dropped": 0.0, "n_fov": 20_008.0, "n": 572.0, "N": 1121.0,
    "SP": 1692.0, "ARR": 99.543, "TPI": 50.25, "TPI_unique": 99.9, "DCP": 98.65,
}  # fmt: skip


def record(number: int, **changes: float) -> FrameRecord:
    return FrameRecord(number, MEASURES | changes, {"total": 0.0104})


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
        "minimum": "1.00",
        "maximum": "10.00",
    }
    assert len(measures_table([record(n) for n in range(50)], few=None).rows) == 50


def test_the_limit_of_rows_is_inclusive():
    frames = [record(n) for n in range(4)]
    assert [row[0] for row in measures_table(frames, few=4).rows] == ["0", "1", "2", "3"]
    assert measures_table(frames, few=3).rows[0][0] == "mean"


def test_a_table_explains_its_headings():
    with_tau = measures_table([FrameRecord(3, MEASURES, {"total": 0.0104}, tau=35)])
    notes = " ".join(with_tau.notes)
    for name in ("tau", "n_raw", "n_fov", "n", "N", "SP", "ARR", "TPI", "TPI_unique", "DCP"):
        assert re.search(rf"(?<!\w){name}:", notes), name
    assert "just over 50 %" in notes
    assert not any("tau" in note for note in measures_table([record(0)]).notes)


def test_a_table_of_times_explains_its_headings():
    notes = " ".join(times_table({}, 1).notes)
    assert all(f"{name}:" in notes for name in ("p50", "p99"))


def test_times_are_milliseconds_in_the_order_of_the_stages():
    spread = {"p50": 0.001, "p99": 0.0025, "mean": 0.0015, "sample_std": None}
    table = times_table({"total": spread, "fov": spread}, 1)
    assert table.rows == (
        ("field of view", "1.00", "2.50", "1.50", ""),
        ("total", "1.00", "2.50", "1.50", ""),
    )
    assert table.title == "Time of each stage, 1 frame"
