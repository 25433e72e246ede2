"""Tables as text, Markdown, CSV and HTML."""

import csv
import html
import io
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Table:
    """Cells of text under headings; the first column is left-aligned, the others right-aligned."""

    title: str
    headings: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...] = ()

    def as_text(self) -> str:
        """Aligned columns for a terminal; notes are wrapped below the table."""
        widths = [max(map(len, column)) for column in zip(self.headings, *self.rows, strict=True)]

        def line(cells: Sequence[str]) -> str:
            first, *others = zip(cells, widths, strict=True)
            parts = [first[0].ljust(first[1]), *(cell.rjust(width) for cell, width in others)]
            return "  ".join(parts).rstrip()

        rule = "  ".join("-" * width for width in widths)
        notes = [textwrap.fill(note, 96, break_on_hyphens=False) for note in self.notes]
        return "\n".join([self.title, line(self.headings), rule, *map(line, self.rows), *notes])

    def as_markdown(self) -> str:
        """A table in GitHub's Markdown."""
        lines = [
            f"**{self.title}**",
            "",
            "| " + " | ".join(self.headings) + " |",
            "|" + "|".join(["---", *["--:"] * (len(self.headings) - 1)]) + "|",
            *("| " + " | ".join(_escaped_bars(row)) + " |" for row in self.rows),
        ]
        return "\n".join(lines) + "\n\n" + "".join(f"{note}\n\n" for note in self.notes)

    def as_csv(self) -> str:
        """Comma-separated values, headings first, without the notes."""
        text = io.StringIO()
        csv.writer(text, lineterminator="\n").writerows([self.headings, *self.rows])
        return text.getvalue()

    def as_html(self) -> str:
        """A table element with escaped cells."""
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


def _escaped_bars(row: Sequence[str]) -> list[str]:
    return [cell.replace("|", "\\|") for cell in row]
