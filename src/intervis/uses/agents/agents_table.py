"""Who sees whom as rows: matrix, pairs, and every frame."""

import math
from dataclasses import dataclass

import numpy as np

from intervis.arrays import Float64Array
from intervis.plots.tables import Table
from intervis.result_table import percent
from intervis.uses.agents.mutual_sight import ABSENT, HIDDEN, REASONS, SEES, MutualSight


@dataclass(frozen=True, eq=False)
class PairSight:
    """How one agent sees another over all frames.

    Attributes
    ----------
    observer, target : str
    frames : int
        In which both are there.
    seen : int
        Of these, in which the observer sees the target.
    first, last : int or None
        First and last frame in which it does.
    first_s, last_s : float
        Their times; NaN where there is none.
    probability : float
        Mean P(visible) of the lines, also in frames in which the target is out of range or of the
        field of view.
    nearest_m : float
        Least distance.
    blind : str
        Most frequent reason of the other frames; empty where there is none.
    blocker : (3,) float64 array
        Of the first occluded frame; NaN where there is none.
    """

    observer: str
    target: str
    frames: int
    seen: int
    first: int | None
    last: int | None
    first_s: float
    last_s: float
    probability: float
    nearest_m: float
    blind: str
    blocker: Float64Array


def pairs_of(found: MutualSight) -> list[PairSight]:
    """All ordered pairs that share a frame, by observer and target."""
    rows = []
    for a, observer in enumerate(found.names):
        for b, target in enumerate(found.names):
            reason = found.reason[:, a, b]
            both = np.flatnonzero(reason != ABSENT)
            if a == b or not len(both):
                continue
            seen = np.flatnonzero(reason == SEES)
            hidden = np.flatnonzero(reason == HIDDEN)
            blind = reason[both][reason[both] != SEES]
            first, last = (int(found.frames[seen[k]]) if len(seen) else None for k in (0, -1))
            first_s, last_s = (
                float(found.time_s[seen[k]]) if len(seen) else math.nan for k in (0, -1)
            )
            rows.append(
                PairSight(
                    *(observer, target, len(both), len(seen), first, last, first_s, last_s),
                    _mean(found.probability[both, a, b]),
                    float(found.range_m[both, a, b].min()),
                    REASONS[int(np.bincount(blind).argmax())] if len(blind) else "",
                    found.blocker[hidden[0], a, b] if len(hidden) else np.full(3, np.nan),
                )
            )
    return rows


def _mean(values: Float64Array) -> float:
    """Mean of the values that are not NaN; NaN if there is none."""
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else math.nan


def pair_table(rows: list[PairSight]) -> Table:
    """One row for each ordered pair."""
    heads = (
        *("observer", "target", "frames", "sees in", "first", "last", "P of the line"),
        *("nearest, m", "blind because", "blocker"),
    )
    cells = tuple(
        (
            *(row.observer, row.target, str(row.frames), str(row.seen)),
            *("-" if frame is None else str(frame) for frame in (row.first, row.last)),
            percent(row.probability),
            f"{row.nearest_m:.1f}",
            row.blind or "-",
            "-" if math.isnan(row.blocker[0]) else ", ".join(f"{v:.1f}" for v in row.blocker),
        )
        for row in rows
    )
    return Table("Pairs", heads, cells)


def matrix_table(found: MutualSight) -> Table:
    """Share of the common frames in which the agent of a row sees that of a column."""
    share = found.seen_share
    rows = tuple((name, *map(percent, share[a])) for a, name in enumerate(found.names))
    return Table("Row sees column, share of frames", ("", *found.names), rows)


def pairs_as_csv(rows: list[PairSight]) -> str:
    """One row for each ordered pair, unrounded; what is not defined is empty."""
    heads = (
        *("observer", "target", "frames", "seen", "first", "last", "first_s", "last_s"),
        *("probability", "nearest_m", "blind", "blocker_x", "blocker_y", "blocker_z"),
    )
    cells = tuple(
        (
            *(row.observer, row.target, str(row.frames), str(row.seen)),
            *("" if frame is None else str(frame) for frame in (row.first, row.last)),
            *map(_cell, (row.first_s, row.last_s, row.probability, row.nearest_m)),
            row.blind,
            *map(_cell, row.blocker),
        )
        for row in rows
    )
    return Table("", heads, cells).as_csv()


def frames_as_csv(found: MutualSight) -> str:
    """One row for each frame and ordered pair."""
    heads = (
        *("frame", "time_s", "observer", "target", "state", "probability", "range_m"),
        *("blocker_x", "blocker_y", "blocker_z"),
    )
    cells = []
    for f, a, b in np.argwhere(found.reason != ABSENT).tolist():
        numbers = (found.probability[f, a, b], found.range_m[f, a, b], *found.blocker[f, a, b])
        cells.append(
            (
                *(str(found.frames[f]), _cell(found.time_s[f]), found.names[a], found.names[b]),
                REASONS[found.reason[f, a, b]],
                *map(_cell, numbers),
            )
        )
    return Table("", heads, tuple(cells)).as_csv()


def _cell(value: float) -> str:
    return f"{value:.9g}" if math.isfinite(value) else ""
