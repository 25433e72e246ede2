"""Granularity chosen from the data: ``tau="auto"`` (the paper's future work).

Coarser kernels are faster and lose TPI. The loss was measured (`TPI_LOST`, measured again by
`intervis calibrate`): it depends on the number of nodes, and hardly on the criterion. So a
tolerance on TPI is a minimum number of nodes, the floor. tau is the coarsest granularity that keeps
the floor; with a time budget it is the finest within the budget, but never coarser than the floor
allows.
"""

import tomllib
from collections import deque
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from math import ceil
from statistics import median
from time import perf_counter
from typing import Any

import numpy as np
from scipy.spatial import Delaunay

from intervis.errors import SettingsError
from intervis.settings import Settings

TAU_CANDIDATES = (
    *(1, 2, 3, 4, 5, 6, 8, 10, 12, 14, 17, 20, 24, 29, 35, 42, 50, 60, 72, 86, 104, 125, 150),
    *(180, 215, 260, 310, 370, 450, 540, 650, 780, 930),
)
"""Granularities to choose from: steps of about 20 %, so that noise in n_fov rarely changes tau."""

FITTED: Mapping[str, Any] = tomllib.loads(
    files("intervis.method").joinpath("granularity.toml").read_text(encoding="utf-8")
)["numbers"]
"""The measured numbers by name; the file says where they come from."""

TPI_LOST: tuple[tuple[float, float], ...] = tuple(
    zip(FITTED["nodes"], FITTED["tpi_lost"], strict=True)
)
"""Nodes, and points of TPI lost against the best finer granularity."""

FRAME_MS: float = FITTED["frame_ms"]
RETURN_US: float = FITTED["return_us"]
NODE_US: float = FITTED["node_us"]
"""Time of a frame on the reference machine: constant part, per return in view, per node."""

REFERENCE_DELAUNAY_MS: float = FITTED["reference_delaunay_ms"]
"""Time of the Delaunay triangulation of 1,000 points on the reference machine."""

BUDGET_SHARE: float = FITTED["budget_share"]
"""Share of the budget that the predicted time may take: times of frames of one size vary."""

NODE_MARGIN = 1.15
"""`TauHysteresis` chooses tau for this many times the floor, since n_fov varies between frames."""

SWITCH_RATIO = 1.6
"""`TauHysteresis` keeps tau while it is within this factor of the best candidate."""

LEARNED_FRAMES = 8
"""Frames whose times `TauHysteresis` scales the predicted ones by."""


def floor_nodes(tpi_tolerance: float) -> int:
    """Fewest nodes that lose no more than a tolerance of TPI (points), by the measured curve.

    Examples
    --------
    >>> floor_nodes(2.8), floor_nodes(5.9)
    (1000, 572)
    """
    nodes, lost = np.array(TPI_LOST).T
    # Linear in the logarithm of the nodes. np.interp needs ascending abscissae: reversed.
    logarithm = np.interp(tpi_tolerance, lost[::-1], np.log(nodes)[::-1])
    return ceil(round(float(np.exp(logarithm)), 6))


def choose_tau(n_fov: int, settings: Settings, *, speed_factor: float | None = None) -> int:
    """The granularity for a frame with `n_fov` returns in view.

    Without ``settings.time_budget_ms`` it is the coarsest that keeps the floor of
    ``settings.tpi_tolerance``. With it, it is the finest whose predicted time is within the budget;
    where that breaks the floor, the floor has priority and the budget is exceeded.

    Parameters
    ----------
    n_fov : int
    settings : Settings
    speed_factor : float or None
        How many times slower this machine is than the reference machine; None measures it, once
        per process.

    Examples
    --------
    >>> choose_tau(20_008, Settings(tau="auto", tpi_tolerance=5.9))
    35
    >>> choose_tau(20_008, Settings(tau="auto", time_budget_ms=40.0), speed_factor=1.0)
    6
    """
    coarsest = _coarsest(n_fov, floor_nodes(settings.tpi_tolerance))
    if settings.time_budget_ms is None:
        return coarsest
    speed_factor = machine_speed_factor() if speed_factor is None else speed_factor
    for tau in TAU_CANDIDATES:
        predicted = predicted_ms(n_fov, tau, speed_factor)
        if tau >= coarsest or predicted <= BUDGET_SHARE * settings.time_budget_ms:
            return min(tau, coarsest)
    return coarsest


def _coarsest(n_fov: int, floor: int) -> int:
    """The coarsest candidate that gives at least `floor` nodes; 1 where none does."""
    return max((tau for tau in TAU_CANDIDATES if ceil(n_fov / tau) >= floor), default=1)


def predicted_ms(n_fov: int, tau: int, speed_factor: float) -> float:
    """Predicted time of a frame, raw scan to region, on this machine."""
    return speed_factor * (FRAME_MS + 1e-3 * (RETURN_US * n_fov + NODE_US * ceil(n_fov / tau)))


@cache
def machine_speed_factor() -> float:
    """How many times slower this machine is than the reference machine."""
    points = np.random.default_rng(0).random((1000, 2))
    taken_ms = []
    for _ in range(7):
        start = perf_counter()
        Delaunay(points)
        taken_ms.append(1e3 * (perf_counter() - start))
    return median(taken_ms) / REFERENCE_DELAUNAY_MS


class TauHysteresis:
    """Granularity for consecutive frames, with hysteresis: tau changes only when it has to.

    A change of tau changes every node. It is made only when the floor or the budget would be
    broken, or when tau is far from the best candidate (`SWITCH_RATIO`).

    With a budget, the predicted times are scaled by those of the last frames (`learn`): they follow
    the machine, and what else runs on it.

    Parameters
    ----------
    settings : Settings
        With ``tau="auto"``.

    Raises
    ------
    SettingsError
        ``settings.tau`` is a number.

    Examples
    --------
    >>> hysteresis = TauHysteresis(Settings(tau="auto", tpi_tolerance=5.9))
    >>> [hysteresis.choose(n_fov) for n_fov in (20_000, 20_400, 19_300, 18_000, 40_000)]
    [29, 29, 29, 29, 60]
    """

    def __init__(self, settings: Settings) -> None:
        if settings.tau != "auto":
            raise SettingsError(f"tau is {settings.tau}: TauHysteresis needs tau='auto'.")
        self.settings = settings
        self.tau: int | None = None
        self._excess: deque[float] = deque(maxlen=LEARNED_FRAMES)

    def choose(self, n_fov: int, *, speed_factor: float | None = None) -> int:
        """The granularity for the next frame."""
        with_margin = max(1, int(n_fov / NODE_MARGIN))
        best = _coarsest(with_margin, floor_nodes(self.settings.tpi_tolerance))
        if self.settings.time_budget_ms is not None:
            factor = machine_speed_factor() if speed_factor is None else speed_factor
            within = choose_tau(n_fov, self.settings, speed_factor=factor * self._usual_excess())
            best = min(best, within)
        if self.tau is None or not self._keeps(self.tau, n_fov, best):
            self.tau = best
        return self.tau

    def learn(
        self, n_fov: int, tau: int, taken_ms: float, *, speed_factor: float | None = None
    ) -> None:
        """Note the granularity of a frame, and the time that it took with that."""
        self.tau = tau
        if self.settings.time_budget_ms is not None:
            factor = machine_speed_factor() if speed_factor is None else speed_factor
            self._excess.append(taken_ms / predicted_ms(n_fov, tau, factor))

    def _usual_excess(self) -> float:
        """How many times longer than predicted the next frame is expected to take.

        The second-longest of the last frames: one that was held up by chance does not count.
        """
        longest = sorted(self._excess, reverse=True)
        return longest[min(1, len(longest) - 1)] if longest else 1.0

    def _keeps(self, tau: int, n_fov: int, best: int) -> bool:
        coarsest = _coarsest(n_fov, floor_nodes(self.settings.tpi_tolerance))
        # With a budget, a granularity finer than the best one takes too long.
        finest = best / SWITCH_RATIO if self.settings.time_budget_ms is None else best
        return tau <= coarsest and finest <= tau <= best * SWITCH_RATIO
