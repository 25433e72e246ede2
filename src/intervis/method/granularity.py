"""Granularity chosen by itself: ``tau="auto"`` (the paper's future work).

Coarser kernels are quicker and lose TPI. How much they lose was measured (`TPI_LOST`, regenerated
by `intervis.lab.paper.curve`): it depends on the number of nodes that are left, and hardly on
the criterion. A tolerance on TPI thus is a floor of nodes, and tau is the coarsest granularity that
keeps it; a time budget makes tau as fine as the budget allows, but never coarser than the floor.
"""

from functools import cache
from math import ceil
from statistics import median
from time import perf_counter

import numpy as np
from scipy.spatial import Delaunay

from intervis.errors import SettingsError
from intervis.settings import Settings

LADDER = (
    *(1, 2, 3, 4, 5, 6, 8, 10, 12, 14, 17, 20, 24, 29, 35, 42, 50, 60, 72, 86, 104, 125, 150),
    *(180, 215, 260, 310, 370, 450, 540, 650, 780, 930),
)
"""Granularities that are chosen among: steps of a fifth, too coarse to follow noise."""

TPI_LOST = (
    (134, 26.9),
    (160, 23.2),
    (193, 19.9),
    (233, 15.8),
    (278, 12.9),
    (334, 10.5),
    (400, 8.9),
    (477, 7.2),
    (572, 5.9),
    (690, 4.4),
    (834, 3.6),
    (1000, 2.8),
    (1177, 2.1),
    (1429, 1.6),
    (1667, 1.2),
    (2000, 0.9),
    (2500, 0.6),
    (3333, 0.4),
    (5000, 0.0),
)
"""Nodes, and points of TPI lost against the best finer granularity: mean over eleven frames."""

FRAME_MS, RETURN_US, NODE_US = 0.6, 0.16, 8.5
"""Time of a frame where `machine_pace` is 1: fixed, for a return in view, for a node."""

PACE_MS = 2.0
"""Delaunay triangulation of a thousand points where the three times above were measured."""

BUDGET_SHARE = 0.85
"""Frames of one size differ by some 12 % in time: the prediction stays so far under a budget."""

HEADROOM = 1.15
"""`SteadyTau` aims so far above the floor: returns in view come and go."""

SLACK = 1.6
"""`SteadyTau` keeps a granularity until it has so many times more nodes than asked for."""


def floor_nodes(tpi_tolerance: float) -> int:
    """Fewest nodes that lose no more than a tolerance of TPI, points, by the measured curve.

    Examples
    --------
    >>> floor_nodes(2.8), floor_nodes(5.9)
    (1000, 572)
    """
    nodes, lost = np.array(TPI_LOST).T
    # np.interp wants rising abscissae; the loss falls with the logarithm of the nodes.
    return ceil(round(float(np.exp(np.interp(tpi_tolerance, lost[::-1], np.log(nodes)[::-1]))), 6))


def choose_tau(n_fov: int, settings: Settings, *, pace: float | None = None) -> int:
    """The granularity for a frame with `n_fov` returns in view.

    Without ``settings.time_budget_ms`` it is the coarsest that keeps the floor of
    ``settings.tpi_tolerance``; with it the finest whose predicted time is within the budget, or, if
    that would be under the floor, the floor: accuracy goes first, and the budget is then missed.

    Parameters
    ----------
    n_fov : int
    settings : Settings
    pace : float or None
        How many times slower this machine is than the one that the prediction was made on; None
        measures it, once in a process.

    Examples
    --------
    >>> choose_tau(20_008, Settings(tau="auto", tpi_tolerance=5.9))
    35
    >>> choose_tau(20_008, Settings(tau="auto", time_budget_ms=40.0), pace=1.0)
    6
    """
    coarsest = _coarsest(n_fov, floor_nodes(settings.tpi_tolerance))
    if settings.time_budget_ms is None:
        return coarsest
    pace = machine_pace() if pace is None else pace
    for tau in LADDER:
        predicted = predicted_ms(n_fov, tau, pace)
        if tau >= coarsest or predicted <= BUDGET_SHARE * settings.time_budget_ms:
            return min(tau, coarsest)
    return coarsest


def _coarsest(n_fov: int, floor: int) -> int:
    """The coarsest granularity of the ladder that leaves `floor` nodes; 1 where none does."""
    return max((tau for tau in LADDER if ceil(n_fov / tau) >= floor), default=1)


def predicted_ms(n_fov: int, tau: int, pace: float) -> float:
    """Time of a frame, raw scan to region, as measured and scaled to this machine."""
    return pace * (FRAME_MS + 1e-3 * (RETURN_US * n_fov + NODE_US * ceil(n_fov / tau)))


@cache
def machine_pace() -> float:
    """How many times slower this machine is than the one the times were measured on."""
    points = np.random.default_rng(0).random((1000, 2))
    taken_ms = []
    for _ in range(7):
        start = perf_counter()
        Delaunay(points)
        taken_ms.append(1e3 * (perf_counter() - start))
    return median(taken_ms) / PACE_MS


class SteadyTau:
    """Granularity for frames that follow one another: it holds still while it can.

    A change of granularity changes every node, so it is made only when the floor is reached or
    when the frame holds far more nodes than are asked for.

    Parameters
    ----------
    settings : Settings
        With ``tau="auto"``.

    Raises
    ------
    SettingsError
        ``settings.tau`` is a number: there is nothing to choose.

    Examples
    --------
    >>> steady = SteadyTau(Settings(tau="auto", tpi_tolerance=5.9))
    >>> [steady.choose(n_fov) for n_fov in (20_000, 20_400, 19_300, 18_000, 40_000)]
    [29, 29, 29, 29, 60]
    """

    def __init__(self, settings: Settings) -> None:
        if settings.tau != "auto":
            raise SettingsError(f"tau is {settings.tau}: only tau='auto' leaves a choice.")
        self.settings = settings
        self.tau: int | None = None

    def choose(self, n_fov: int, *, pace: float | None = None) -> int:
        """The granularity for the next frame."""
        aim = choose_tau(max(1, int(n_fov / HEADROOM)), self.settings, pace=pace)
        if self.tau is None or not self._still_good(n_fov, aim):
            self.tau = aim
        return self.tau

    def _still_good(self, n_fov: int, aim: int) -> bool:
        assert self.tau is not None
        coarsest = _coarsest(n_fov, floor_nodes(self.settings.tpi_tolerance))
        return self.tau <= coarsest and aim / SLACK <= self.tau <= aim * SLACK
