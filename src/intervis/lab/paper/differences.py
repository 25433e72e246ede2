"""Differences of a granularity sweep to Table 2, and of its counts to their formulas."""

from math import ceil

import numpy as np

from intervis.lab.paper import printed_values
from intervis.lab.paper.experiment import FrameExperiment, SweepPoint


def tpi_distance(result: FrameExperiment) -> tuple[float, float]:
    """Mean and greatest absolute difference of TPI to Table 2, points."""
    difference = [
        abs(result.sweep[tau].measures.TPI - row.TPI)
        for tau, row in printed_values.TABLE_2.items()
        if tau in result.sweep
    ]
    return float(np.mean(difference)), float(np.max(difference))


def identity_residuals(point: SweepPoint) -> tuple[int, int, int] | None:
    """Differences of n, N and SP to their formulas; None where there is no finite element.

    n = ceil(n_fov / tau), N = 2 n - 2 - h and SP = N + n - 1. In the last two, n does not count
    nodes that have the same position as another node, since a mesh holds each position once.
    """
    m = point.measures
    if m.N == 0:
        return None
    meshed = m.n - point.copies
    return (
        m.n - ceil(m.n_fov / point.tau),
        m.N - (2 * meshed - 2 - point.hull),
        m.SP - (m.N + meshed - 1),
    )
