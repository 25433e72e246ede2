"""Answers for many sight lines at once."""

import numpy as np

from intervis.arrays import Float64Array
from intervis.kernels import in_parts
from intervis.sight.kernels.batch import new_batch
from intervis.sight.kernels.classify import Answers, answer_range
from intervis.sight.kernels.line_sums import LineSums, new_line_sums
from intervis.sight.kernels.march import march, order_ends
from intervis.sight.kernels.packed_scans import PackedScans
from intervis.sight.kernels.parameters import OccupancyModel, Thresholds
from intervis.sight.occupancy_model import DEFAULT_THRESHOLDS, MODEL

VISIBLE, OCCLUDED, UNKNOWN = 1, 0, -1
"""The states of a sight line."""

_MIN_LINES_PER_THREAD = 512


def answer_lines(
    scans: PackedScans,
    starts: Float64Array,
    ends: Float64Array,
    *,
    paired: bool,
    max_range_m: float | None = None,
    thresholds: Thresholds = DEFAULT_THRESHOLDS,
    model: OccupancyModel = MODEL,
) -> Answers:
    """The answers for lines between points of the scene, field by field.

    Parameters
    ----------
    scans : PackedScans
    starts, ends : (S, 3) and (E, 3) float64 arrays
        C-contiguous. A line with a non-finite end is unknown.
    paired : bool
        True: the i-th start with the i-th end, L = S = E lines. False: each start with each end,
        L = S E lines, in the order of the starts.
    max_range_m : float or None
        Longer lines are unknown.
    thresholds : Thresholds
        See `intervis.sight.occupancy_model.thresholds_for`.
    model : OccupancyModel

    Returns
    -------
    Answers
        Of L lines.
    """
    count = len(ends) if paired else len(starts) * len(ends)
    answers = Answers(
        np.empty(count, np.int8),
        np.empty(count),
        np.empty((count, 3)),
        np.empty(count),
        np.empty(count),
    )
    limit_m = np.inf if max_range_m is None else float(max_range_m)

    def work(begin: int, stop: int) -> None:
        answer_range(scans, starts, ends, paired, model, thresholds, limit_m, begin, stop, answers)

    in_parts(work, count, least=_MIN_LINES_PER_THREAD)
    return answers


def sum_lines(
    scans: PackedScans, starts: Float64Array, ends: Float64Array, model: OccupancyModel = MODEL
) -> LineSums:
    """Sums over the samples of L lines between finite points, (L, 3) each, scene frame.

    Positions along a line count from its lexicographically smaller end.
    """
    first, second = (np.array(points, np.float64, order="C") for points in (starts, ends))
    order_ends(first, second)
    sums = new_line_sums(len(first))

    def work(begin: int, stop: int) -> None:
        part = slice(begin, stop)
        of_part = LineSums._make([values[part] for values in sums])
        march(scans, first[part], second[part], model, new_batch(scans, model), of_part)

    in_parts(work, len(first), least=_MIN_LINES_PER_THREAD)
    return sums
