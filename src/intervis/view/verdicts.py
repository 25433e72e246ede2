"""What a page stores of judged returns: the numbers that an explanation prints, as it prints them.

`intervis.sight.explain` prints metres with one decimal and whole percent. The page stores these
rounded numbers, so that the browser forms the same sentences. Coordinates are rounded to one
centimetre BEFORE they are judged: an answer belongs to the coordinates that the page shows.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from intervis.arrays import Float64Array, FloatArray, IntArray
from intervis.sight import OCCLUDED, VISIBLE, Sight
from intervis.sight.observed_profile import unobserved_parts
from intervis.view.columns import Columns
from intervis.view.judged_frame import JudgedFrame

PARTS = 16
"""A line is drawn in so many parts, each observed or unobserved."""

BLOCKED, OPEN, NOT_OBSERVED, NOT_DECIDED, BLOCKED_SOMEWHERE, NO_ANSWER = range(6)
"""Kinds of sentences: occluded by one surface, visible, unknown and not observed, unknown and not
decided, occluded by no single surface, too far apart."""

PARTLY_OBSERVED = 8
"""Added to the kind of lines with unobserved metres, for which `profile` has an entry."""

UNDECIDED_M = 0.5
"""`intervis.sight.explanation` calls an unknown line not observed from so many metres on."""

FARTHEST_M = 1e7
"""Coordinates of returns that are shown: those beyond are errors of a file."""

NOTHING_BESIDE = 65535
"""Stored as the clearance of lines beside which nothing was observed."""


@dataclass(frozen=True, eq=False)
class ReturnsWithParts:
    """The judged returns of one frame, and which parts of the lines to them are unobserved.

    Attributes
    ----------
    judged : JudgedFrame
        With N returns.
    unobserved_m : (N,) float64 array
    parts_m : (N, PARTS) float64 array
        Unobserved metres of each part of a line.
    """

    judged: JudgedFrame
    unobserved_m: Float64Array
    parts_m: Float64Array


def thinned_rows(points: FloatArray, most: int) -> IntArray:
    """Rows of at most so many returns, evenly chosen; rows that are no return are left out.

    So are those with a coordinate beyond `FARTHEST_M`.

    Examples
    --------
    >>> thinned_rows(np.array([[np.nan] * 3, [1.0, 0, 0], [2, 0, 0], [3, 0, 0]]), 2)
    array([1, 2])
    """
    near = (np.abs(points[:, :3]) <= FARTHEST_M).all(axis=1)  # not for NaN
    rows = np.flatnonzero(near & points[:, :3].any(axis=1))
    if len(rows) <= most:
        return rows
    return np.asarray(rows[np.arange(most) * len(rows) // most])


def returns_with_parts(judged: JudgedFrame) -> ReturnsWithParts:
    """The unobserved parts of the lines to the returns of a frame."""
    ends = judged.points
    parts_m = np.zeros((len(ends), PARTS))
    # `observed` is exactly 1 where no sample is unobserved: those lines need no second march.
    partly = np.flatnonzero(judged.sight.observed < 1.0)
    if len(partly):
        starts = np.broadcast_to(judged.viewpoint, (len(partly), 3))
        scans = judged.scene.packed_scans(judged.moment_s)
        parts_m[partly] = unobserved_parts(scans, starts, ends[partly], PARTS)
    return ReturnsWithParts(judged, parts_m.sum(axis=1), parts_m)


def verdict_columns(returns: ReturnsWithParts) -> Columns:
    """The columns of judged returns, as the page's ``verdicts.js`` reads them.

    ``row``, ``x``, ``y``, ``z`` (cm), ``kind``, ``percent``, ``clearance`` (dm), ``metres`` (dm:
    of visible lines the length less the observed metres, of others the unobserved metres);
    ``profile`` of the lines that are not wholly observed (bit k: part k is mostly unobserved);
    ``blocker_x`` ... (dm) and ``blocker_at`` (dm from the viewpoint) of the occluded lines.
    """
    judged, sight = returns.judged, returns.judged.sight
    kind = _kinds(sight, returns.unobserved_m)
    length_m = np.linalg.norm(judged.points - judged.viewpoint, axis=1)
    partly = returns.parts_m.any(axis=1)
    clearance = np.where(np.isfinite(sight.clearance), np.abs(sight.clearance), 0.0)
    beside_nothing = ~np.isfinite(sight.clearance)
    unobserved = decimetres(returns.unobserved_m)
    crossed = decimetres(np.maximum(length_m - returns.unobserved_m, 0.0))
    blocked = kind == BLOCKED
    blocker = sight.blocker[blocked]
    at_m = np.linalg.norm(blocker - judged.viewpoint, axis=1)
    columns: Columns = {
        "row": judged.rows,
        "x": judged.centimetres[:, 0],
        "y": judged.centimetres[:, 1],
        "z": judged.centimetres[:, 2],
        "kind": kind + PARTLY_OBSERVED * partly,
        "percent": percent_codes(sight.probability),
        "clearance": np.where(beside_nothing, NOTHING_BESIDE, decimetres(clearance)),
        "metres": np.where(kind == OPEN, decimetres(length_m) - crossed, unobserved),
        "profile": _profiles(returns.parts_m[partly], length_m[partly]),
        "blocker_at": decimetres(at_m),
    }
    for axis, name in enumerate("xyz"):
        columns[f"blocker_{name}"] = decimetres(blocker[:, axis])
    return columns


BY_DIFFERENCE = frozenset(
    [
        *("row", "metres", "blocker_at", "edge_a"),
        *(f"{prefix}{axis}" for prefix in ("", "blocker_", "cell_") for axis in "xyz"),
    ]
)
"""Columns whose successive values are alike."""


def _kinds(sight: Sight, unobserved_m: Float64Array) -> IntArray:
    """(N,) kind of the sentence that explains each line."""
    blocked = np.isfinite(sight.blocker).all(axis=1)
    unknown = np.where(unobserved_m > UNDECIDED_M, NOT_OBSERVED, NOT_DECIDED)
    kind = np.where(sight.state == VISIBLE, OPEN, unknown)
    kind = np.where(sight.state == OCCLUDED, np.where(blocked, BLOCKED, BLOCKED_SOMEWHERE), kind)
    return np.asarray(np.where(np.isnan(sight.probability), NO_ANSWER, kind), np.int64)


def _profiles(parts_m: Float64Array, length_m: Float64Array) -> IntArray:
    """(L,) bits of the parts of which more than half is unobserved."""
    dark = parts_m > 0.5 * length_m[:, None] / PARTS
    return np.asarray(dark @ (1 << np.arange(PARTS)), np.int64)


def decimetres(metres: Float64Array) -> IntArray:
    """Whole decimetres, rounded as ``f"{value:.1f}"`` rounds metres.

    Examples
    --------
    >>> decimetres(np.array([0.04, 0.05, 0.15, 0.25, -1.26])).tolist()
    [0, 1, 1, 2, -13]
    """
    metres = np.clip(metres, -FARTHEST_M, FARTHEST_M)  # those of damaged returns fit no integer
    tenths = 10.0 * np.asarray(metres, np.float64)
    whole = np.rint(tenths)
    # The product may be rounded across a tie: those few are left to Python's exact rounding.
    near_tie = np.flatnonzero(np.abs(np.abs(tenths - whole) - 0.5) < 1e-6)
    for at in near_tie:
        whole[at] = round(10.0 * float(f"{metres[at]:.1f}"))
    return np.asarray(whole, np.int64)


def percent_codes(probability: Float64Array) -> NDArray[np.int64]:
    """Whole percent; 0 stands for less than 1 %, 101 for more than 99 %, 255 for none.

    Examples
    --------
    >>> percent_codes(np.array([0.004, 0.01, 0.5, 0.99, 0.991, np.nan])).tolist()
    [0, 1, 50, 99, 101, 255]
    """
    known = np.nan_to_num(probability)
    percent = np.rint(100.0 * known)
    percent = np.where(known < 0.01, 0, np.where(known > 0.99, 101, percent))
    return np.where(np.isnan(probability), 255, percent).astype(np.int64)
