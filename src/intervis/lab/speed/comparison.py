"""Timings as a table, ratios first, and beside those of an earlier run."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from intervis.drives.regular_file import open_regular
from intervis.errors import DriveError, OutputError
from intervis.lab.speed.timing import Timing
from intervis.plots.tables import Table

OWN = "intervis"
MOST_BYTES = 10_000_000
"""Of an earlier run that is read."""


def ratios(timings: Sequence[Timing]) -> dict[tuple[str, str], float]:
    """Median time of each other tool divided by ours of the same group.

    Examples
    --------
    >>> ours, other = Timing("a", "intervis", 1, [1.0] * 3), Timing("a", "scipy", 1, [8.0] * 3)
    >>> ratios([ours, other])
    {('a', 'scipy'): 8.0}
    """
    own = {timing.group: timing.median_s for timing in timings if timing.by == OWN}
    return {
        (timing.group, timing.by): timing.median_s / own[timing.group]
        for timing in timings
        if timing.by != OWN and timing.group in own
    }


def timings_table(timings: Sequence[Timing], notes: Sequence[str] = ()) -> Table:
    """Work, tool, ratio to ours, median, spread, size."""
    to_ours = ratios(timings)
    rows, group = [], ""
    for timing in timings:
        ratio = to_ours.get((timing.group, timing.by))
        rows.append(
            (
                timing.group if timing.group != group else "",
                timing.by,
                "1" if timing.by == OWN else f"{ratio:.2g}" if ratio else "",
                f"{1e3 * timing.median_s:.1f}",
                f"{timing.spread:.0%}",
                f"{timing.size:,}",
            )
        )
        group = timing.group
    headings = ("work", "by", "times ours", "ms", "spread", "size")
    spread = "ms: median; spread: half the distance of the quartiles, share of the median."
    return Table("Speed", headings, tuple(rows), (spread, *notes))


def changes_table(timings: Sequence[Timing], earlier: Mapping[str, Any]) -> Table:
    """Our times beside those of an earlier run.

    A group with another tool is compared by the ratio to that tool, which a busy or another
    machine changes less than the times.
    """
    before = {(one["group"], one["by"]): one["median_s"] for one in earlier["timings"]}
    rows = []
    for timing in timings:
        key = (timing.group, OWN)
        if timing.by != OWN or key not in before:
            continue
        others = [
            other
            for other in timings
            if other.group == timing.group and other.by != OWN and (other.group, other.by) in before
        ]
        slower = timing.median_s / before[key]
        for other in others[:1]:
            slower /= other.median_s / before[other.group, other.by]
        rows.append(
            (
                timing.group,
                f"{1e3 * before[key]:.1f}",
                f"{1e3 * timing.median_s:.1f}",
                f"{slower:.2f}",
                others[0].by if others else "time",
            )
        )
    headings = ("work", "ms before", "ms now", "times as long", "measured by")
    return Table("Since the earlier run", headings, tuple(rows))


def as_json(timings: Sequence[Timing], head: Mapping[str, Any]) -> str:
    """Timings with what they were measured on."""
    body = [
        {
            "group": timing.group,
            "by": timing.by,
            "size": timing.size,
            "median_s": timing.median_s,
            "times_s": timing.times_s,
        }
        for timing in timings
    ]
    return json.dumps({**head, "timings": body}, indent=1) + "\n"


def read_earlier(path: Path) -> dict[str, Any]:
    """An earlier run, from its JSON file.

    Raises
    ------
    OutputError
        The file cannot be read, or holds no timings.
    """
    try:
        with open_regular(path) as file:
            content = json.loads(file.read(MOST_BYTES))
        for one in content["timings"]:
            if not (isinstance(one["group"], str) and isinstance(one["by"], str)):
                raise TypeError
            if not float(one["median_s"]) > 0:
                raise ValueError
    except OSError as error:
        raise OutputError(f"cannot read {path}: {error.strerror}.") from None
    except (DriveError, ValueError, TypeError, KeyError, RecursionError):
        raise OutputError(
            f"{path} holds no timings: give a file that `intervis bench --json` wrote."
        ) from None
    return dict(content)
