"""Picture of a siting: plan with targets by state of the chosen set, candidates, chosen places."""

from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial import cKDTree

from intervis.arrays import Float64Array
from intervis.plots.style import (
    INK,
    INTERVISIBLE,
    NODE,
    REGION,
    dots,
    legend_below,
    page_figure,
)
from intervis.result_table import percent
from intervis.sight import OCCLUDED, UNKNOWN, VISIBLE
from intervis.uses.sites.coverage import OUT_OF_REACH, STATES
from intervis.uses.sites.siting import Siting

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLOURS = {
    OUT_OF_REACH: "#e9d8b4",
    UNKNOWN: "#aeb4be",
    OCCLUDED: NODE,
    VISIBLE: INTERVISIBLE,
}
"""In drawing order: states of the targets."""
AROUND_M = 8.0
ASPECTS = (0.3, 1.1)
"""Least and largest ratio of height and width."""
FILL_PT2 = 2.2
OVERLAP = 1.12
"""Edge of a square by the distance of targets: without overlap gaps show between fine cells."""
FRAME_IN = 1.4
"""Title, axis and legend: with less the layout does not settle, and the title is cut."""
LEGEND_COLUMNS = 3
"""Two rows: six entries with weights are wider than the page."""


def siting_picture(found: Siting, returns: Float64Array) -> "Figure":
    """The plan: returns above the ground, targets by state, candidates, and the chosen places.

    Where targets stand above each other, the worst state of them is drawn.

    Parameters
    ----------
    found : Siting
    returns : (N, 3) float64 array
        To draw in grey, scene frame, metres.

    Raises
    ------
    MissingExtraError
        matplotlib (extra ``plots``) is not installed.
    """
    places = np.array([one.place for one in found.coverage.candidates])
    window = _window(found.coverage.demand.points, places)
    wide, tall = window[1] - window[0]
    with page_figure(FRAME_IN + 6.2 * tall / wide) as (figure, axes):
        _draw_targets(axes, found, 6.2 / wide)
        inside = ((returns[:, :2] > window[0]) & (returns[:, :2] < window[1])).all(axis=1)
        dots(axes, returns[inside], s=0.2, color=INK, alpha=0.45, rasterized=True)
        chosen = list(found.choice.sites)
        others = np.setdiff1d(np.arange(len(places)), chosen)
        look: dict[str, Any] = {"edgecolor": INK, "linewidths": 0.5, "zorder": 5}
        dots(axes, places[others], s=9, color="white", label="candidate", **look)
        look |= {"s": 120, "marker": "*", "zorder": 6}
        dots(axes, places[chosen], color=REGION, label="chosen", **look)
        _number(axes, places[chosen])
        axes.set(
            xlim=window[:, 0],
            ylim=window[:, 1],
            aspect="equal",
            xlabel="x, m",
            ylabel="y, m",
            title=_title(found),
        )
        legend_below(figure, axes, LEGEND_COLUMNS)
        return figure


def _title(found: Siting) -> str:
    count, of = len(found.choice.sites), len(found.coverage.candidates)
    by = "" if found.views == 1 else f", by {found.views} places or more"
    return f"{count} of {of} candidates; worst state of the targets above each other{by}"


def _window(*shown: Float64Array) -> Float64Array:
    """(2, 2) lower left and upper right corner around all places."""
    xy = np.concatenate([one[:, :2] for one in shown])
    low, high = xy.min(axis=0) - AROUND_M, xy.max(axis=0) + AROUND_M
    wide, tall = high - low
    missing = np.array([max(tall / ASPECTS[1] - wide, 0.0), max(ASPECTS[0] * wide - tall, 0.0)])
    return np.stack([low - missing / 2, high + missing / 2])


def _draw_targets(axes: Any, found: Siting, inches_per_m: float) -> None:
    """The targets of each column of points as one square, in the colour of the worst state."""
    points, weight = found.coverage.demand.points, found.coverage.demand.weight
    order = [OCCLUDED, OUT_OF_REACH, UNKNOWN, VISIBLE]
    badness = np.select([found.state == state for state in order], range(len(order)))
    columns, member = np.unique(points[:, :2].round(3), axis=0, return_inverse=True)
    worst = np.full(len(columns), len(order) - 1)
    np.minimum.at(worst, member.reshape(-1), badness)
    spacing_m = _spacing(columns)
    size = max((72.0 * inches_per_m * OVERLAP * spacing_m) ** 2, FILL_PT2)
    unit = "" if np.ptp(weight) < 0.1 * weight.max() else " of the weight"
    for state, colour in COLOURS.items():
        share = float(weight[found.state == state].sum())
        label = f"{STATES[state]}, {percent(share)}{unit}"
        here = columns[worst == order.index(state)]
        if share > 0.0 or len(here):
            look = {"s": size, "marker": "s", "zorder": 1}
            dots(axes, here, color=_light(colour), label=label, **look)


def _light(colour: str) -> Any:
    """The colour on white paper, so that returns stand out; not transparent, as squares overlap."""
    from matplotlib.colors import to_rgb

    return tuple(1.0 - 0.8 * (1.0 - np.array(to_rgb(colour))))


def _spacing(columns: Float64Array) -> float:
    """Distance of neighbouring columns, metres; 0 for one."""
    if len(columns) < 2:
        return 0.0
    distance_m, _ = cKDTree(columns).query(columns, k=2)
    return float(np.median(distance_m[:, 1]))


def _number(axes: Any, places: Float64Array) -> None:
    from matplotlib.patheffects import withStroke

    rim = [withStroke(linewidth=2.4, foreground="white")]
    for rank, place in enumerate(places, start=1):
        axes.annotate(
            *(str(rank), place[:2]),
            xytext=(0, 6),
            textcoords="offset points",
            ha="center",
            fontsize=8,
            weight="bold",
            zorder=7,
            path_effects=rim,
        )
