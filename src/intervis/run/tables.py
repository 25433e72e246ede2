"""The tables of a run: measures of the frames, and times of the stages."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from intervis.plots.tables import Table
from intervis.run.frame_file import FrameRecord

FEW_FRAMES = 12
"""Most frames for which a printed table has one row per frame; beyond, it has statistics."""

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
"""Name, heading and format of each measure shown."""

STAGES: tuple[tuple[str, str], ...] = (
    ("fov", "field of view"),
    ("sampling", "sampling"),
    ("S1", "S1 surface"),
    ("S2", "S2 mesh and graph"),
    ("S3", "S3 intervisibility"),
    ("total", "total"),
)
"""Name and heading of each timed stage."""

NOTE_TAU = "tau: granularity, the number of returns per node."
NOTE_COUNTS = (
    "n_raw: returns of the scan; n_fov: returns in the field of view; n: nodes after sampling;"
    " N: finite elements (triangles); SP: unique edges, the pairs of nodes that are compared."
)
NOTE_SHARES = (
    "ARR: average redundancy removal (Eq. 15), the share of raw returns that are no nodes. TPI:"
    " two-point intervisibility (Eq. 16), intervisible edges over 3 N; it cannot exceed SP / (3 N),"
    " just over 50 %, because 3 N counts every inner edge twice. TPI_unique: intervisible edges"
    " over SP. DCP: decreasing calculation (Eq. 17), the share of sight lines saved compared with"
    " one per raw return."
)
NOTE_TIMES = (
    "p50: median; p99: 99th percentile; std: standard deviation. Times exclude compilation, and"
    " reading and writing files."
)

NOTE_RATE = (
    "Frames computed by this run, reading and writing included: while a frame is analysed, the next"
    " one is read and the last one written."
)


def measures_table(records: Sequence[FrameRecord], *, few: int | None = FEW_FRAMES) -> Table:
    """The paper's measures, one row per frame, or statistics over many frames.

    Parameters
    ----------
    records : sequence of FrameRecord
        Frames of a run, at least one.
    few : int or None
        Beyond this number of frames the rows are mean, sample standard deviation, minimum and
        maximum; None always gives one row per frame.
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
        names, rows = _statistics_rows(values)
        formats = [".1f" if form == ".0f" else form for form in formats]
        title = f"Measures of {len(records)} frames"
    cells = tuple(
        (name, *(format(value, form) for value, form in zip(row, formats, strict=True)))
        for name, row in zip(names, rows, strict=True)
    )
    notes = (NOTE_TAU, NOTE_COUNTS, NOTE_SHARES) if with_tau else (NOTE_COUNTS, NOTE_SHARES)
    return Table(title, headings, cells, notes)


def _row(record: FrameRecord, with_tau: bool) -> list[float]:
    tau = [float(record.tau)] if with_tau and record.tau is not None else []
    measures = (record.measures[name] for name, _, _ in MEASURES)
    return [*tau, *measures, 1e3 * record.times_s["total"]]


def _statistics_rows(values: Any) -> tuple[list[str], Any]:
    statistics: list[tuple[str, Callable[[Any], Any]]] = [
        ("mean", lambda column: np.mean(column, axis=0)),
        ("sample std", lambda column: np.std(column, axis=0, ddof=1)),
        ("minimum", lambda column: np.min(column, axis=0)),
        ("maximum", lambda column: np.max(column, axis=0)),
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


def pace_table(content: Mapping[str, Any]) -> Table | None:
    """How fast frames came, and whether they kept the budget, from the content of a summary.

    None where there is nothing to tell: few frames were computed, and no budget was given.
    """
    rate, budget = content.get("rate"), content.get("budget")
    rows = []
    if rate is not None:
        rows.append(("frames a second", f"{rate['frames_per_s']:.1f}"))
        interval_s = rate["interval_s"] or {}
        rows += [
            (f"ms from frame to frame, {key}", f"{1e3 * interval_s[key]:.1f}")
            for key in ("p50", "p99", "max")
            if key in interval_s
        ]
    if budget is not None:
        rows.append(("budget ms", f"{budget['budget_ms']:g}"))
        rows.append(("frames that took longer", f"{budget['missed']} of {budget['frames']}"))
    if not rows:
        return None
    notes = [NOTE_RATE] if rate is not None else []
    if budget is not None:
        notes.append(_missed_note(content, budget))
    return Table("Pace", ("quantity", "value"), tuple(rows), tuple(notes))


def _missed_note(content: Mapping[str, Any], budget: Mapping[str, Any]) -> str:
    """Which frames took longer than the budget."""
    if not budget["missed"]:
        return "Every frame kept the budget (total: raw scan to region)."
    frames = {frame["number"]: frame for frame in content["frames"]}
    shown = [
        f"{number} ({1e3 * frames[number]['times_s']['total']:.1f} ms, tau {frames[number]['tau']})"
        for number in budget["missed_frames"][:FEW_FRAMES]
    ]
    more = budget["missed"] - len(shown)
    rest = f", and {more} more, which summary.json lists" if more else ""
    return f"Longer than the budget (total: raw scan to region): {', '.join(shown)}{rest}."
