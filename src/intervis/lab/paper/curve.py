"""TPI lost by coarser sampling against the number of nodes, over many frames.

The smallest number of nodes that ``tau="auto"`` accepts follows from this curve
(`intervis.method.granularity.TPI_LOST`).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from intervis.lab.paper.experiment import camera_arguments, usable
from intervis.method.analysis import analyze
from intervis.method.granularity import TAU_CANDIDATES
from intervis.progress import Progress, reporter
from intervis.settings import Settings

if TYPE_CHECKING:
    from intervis.drives import Frame

COARSEST = 150
"""Coarsest granularity of the curve: it leaves about 100 nodes of a camera's view."""


@dataclass(frozen=True)
class CurvePoint:
    """One granularity over all frames.

    Attributes
    ----------
    tau : int
    nodes : float
        Mean number of nodes.
    TPI, mean_lost, most_lost : float
        Mean TPI, per cent; mean and greatest loss of TPI against the best finer granularity of
        the same frame, percentage points.
    total_ms : float
        Median time of a frame, raw scan to region.
    """

    tau: int
    nodes: float
    TPI: float
    mean_lost: float
    most_lost: float
    total_ms: float


def tpi_curve(
    frames: Sequence["Frame"],
    settings: Settings | None = None,
    *,
    progress: Progress | None = None,
) -> list[CurvePoint]:
    """Measure the granularity curve over frames, finest granularity first."""
    progress = reporter(progress)
    settings = Settings() if settings is None else settings
    taus = [tau for tau in TAU_CANDIDATES if tau <= COARSEST]
    shape = (len(frames), len(taus))
    tpi, nodes, total_s = np.empty(shape), np.empty(shape), np.empty(shape)
    for row, given in enumerate(frames):
        frame, used, _ = usable(given, settings)
        for column, tau in enumerate(taus):
            result = analyze(
                frame.points, settings=used.with_changes(tau=tau), **camera_arguments(frame)
            )
            tpi[row, column] = result.measures.TPI
            nodes[row, column] = result.measures.n
            total_s[row, column] = result.times.total
        progress(f"granularity curve, frame {given.number}")
    lost = np.maximum.accumulate(tpi, axis=1) - tpi
    return [
        CurvePoint(
            tau=tau,
            nodes=float(nodes[:, k].mean()),
            TPI=float(tpi[:, k].mean()),
            mean_lost=float(lost[:, k].mean()),
            most_lost=float(lost[:, k].max()),
            total_ms=1e3 * float(np.median(total_s[:, k])),
        )
        for k, tau in enumerate(taus)
    ]
