"""Tables as text, Markdown, CSV and HTML, and the two that a run ends with."""

import csv
import html
import io
import textwrap
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from intervis.run.frame_file import FrameRecord

FEW_FRAMES = 12
"""Up to so many frames a printed table has a row for each; beyond, it says how they spread."""

MEASURES: tuple[tuple[str, str, str], ...] = (
    ("n_raw", "n_raw", ".0f"),
    ("n_fov", "n_fov", ".0f"),
    ("n", "nodes n", ".0f"),
    ("N", "N", ".0f"),
    ("SP", "SP", ".0f"),
    ("ARR", "ARR %", ".2f"),
    ("TPI", "TPI %", ".2f"),
    ("TPI_unique", "TPI_unique %", ".2f"),
    ("DCP", "DCP %", ".2f"),
)
"""Name, heading and format of each measure that is shown."""

STAGES: tuple[tuple[str, str], ...] = (
    ("fov", "field of view"),
    ("sampling", "sampling"),
    ("S1", "S1 surface"),
    ("S2", "S2 mesh and graph"),
    ("S3", "S3 intervisibility"),
    ("total", "total"),
)
"""Name and heading of each stage that is timed."""

NOTE_TPI = (
    "TPI is the paper's: intervisible edges over 3 N. It cannot exceed SP / (3 N), just over 50 %,"
    " because 3 N counts every inner edge twice; TPI_unique is the share of the edges themselves."
)
NOTE_TIMES = "Times are those of compiled kernels, without reading or writing files."


@dataclass(frozen=True)
class Table:
    """Cells of text under headings; the first column is to the left, the others to the right."""

    title: str
    headings: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...] = ()

    def as_text(self) -> str:
        """Aligned columns for a terminal."""
        widths = [max(map(len, column)) for column in zip(self.headings, *self.rows, strict=True)]

        def line(cells: Sequence[str]) -> str:
            first, *others = zip(cells, widths, strict=True)
            parts = [first[0].ljust(first[1]), *(cell.rjust(width) for cell, width in others)]
            return "  ".join(parts).rstrip()

        rule = "  ".join("-" * width for width in widths)
        notes = [textwrap.fill(note, 96) for note in self.notes]
        return "\n".join([self.title, line(self.headings), rule, *map(line, self.rows), *notes])

    def as_markdown(self) -> str:
        """A table of GitHub's Markdown."""
        lines = [
            f"**{self.title}**",
            "",
            "| " + " | ".join(self.headings) + " |",
            "|" + "|".join(["---", *["--:"] * (len(self.headings) - 1)]) + "|",
            *("| " + " | ".join(_no_bars(row)) + " |" for row in self.rows),
        ]
        return "\n".join(lines) + "\n\n" + "".join(f"{note}\n\n" for note in self.notes)

    def as_csv(self) -> str:
        """Comma-separated values, headings first."""
        text = io.StringIO()
        csv.writer(text, lineterminator="\n").writerows([self.headings, *self.rows])
        return text.getvalue()

    def as_html(self) -> str:
        """A table element, every cell escaped."""
        head = "".join(f"<th>{html.escape(cell)}</th>" for cell in self.headings)
        body = "\n".join(
            "<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>"
            for row in self.rows
        )
        notes = "".join(f"<p class='note'>{html.escape(note)}</p>" for note in self.notes)
        return (
            f"<div class='wide'><table><caption>{html.escape(self.title)}</caption>"
            f"<thead><tr>{head}</tr></thead>\n<tbody>\n{body}\n</tbody></table></div>{notes}"
        )


def _no_bars(row: Sequence[str]) -> list[str]:
    return [cell.replace("|", "\\|") for cell in row]


def measures_table(records: Sequence[FrameRecord], *, few: int | None = FEW_FRAMES) -> Table:
    """The paper's measures, a row for each frame, or how they spread where frames are many.

    Parameters
    ----------
    records : sequence of FrameRecord
        Frames of a run, at least one.
    few : int or None
        Beyond this number of frames the rows are mean, sample standard deviation, least and
        greatest value; None always gives a row for each frame.
    """
    with_tau = all(record.tau is not None for record in records)
    headings = ("frame", *(heading for _, heading, _ in MEASURES), "total ms")
    formats = [*(form for _, _, form in MEASURES), ".2f"]
    if with_tau:
        headings, formats = ("frame", "tau", *headings[1:]), [".0f", *formats]
    values = np.array([_row(record, with_tau) for record in records])
    if few is None or len(records) <= few:
        names = [str(record.number) for record in records]
        rows, title = values, "Measures of each frame"
    else:
        names, rows = _spread_rows(values)
        formats = [".1f" if form == ".0f" else form for form in formats]
        title = f"Measures of {len(records)} frames"
    cells = tuple(
        (name, *(format(value, form) for value, form in zip(row, formats, strict=True)))
        for name, row in zip(names, rows, strict=True)
    )
    return Table(title, headings, cells, (NOTE_TPI,))


def _row(record: FrameRecord, with_tau: bool) -> list[float]:
    tau = [float(record.tau)] if with_tau and record.tau is not None else []
    measures = (record.measures[name] for name, _, _ in MEASURES)
    return [*tau, *measures, 1e3 * record.times_s["total"]]


def _spread_rows(values: Any) -> tuple[list[str], Any]:
    statistics: list[tuple[str, Callable[[Any], Any]]] = [
        ("mean", lambda column: np.mean(column, axis=0)),
        ("sample std", lambda column: np.std(column, axis=0, ddof=1)),
        ("least", lambda column: np.min(column, axis=0)),
        ("greatest", lambda column: np.max(column, axis=0)),
    ]
    return [name for name, _ in statistics], np.array([f(values) for _, f in statistics])


def times_table(times_s: Mapping[str, Mapping[str, float | None]], frames: int) -> Table:
    """Milliseconds of each stage: median, 99th percentile, mean and sample standard deviation."""
    rows = []
    for name, heading in STAGES:
        if name in times_s:
            spread = [times_s[name].get(key) for key in ("p50", "p99", "mean", "sample_std")]
            rows.append((heading, *("" if s is None else f"{1e3 * s:.2f}" for s in spread)))
    headings = ("stage", "p50 ms", "p99 ms", "mean ms", "sample std ms")
    title = f"Time of each stage, {frames} frame{'s' if frames != 1 else ''}"
    return Table(title, headings, tuple(rows), (NOTE_TIMES,))
