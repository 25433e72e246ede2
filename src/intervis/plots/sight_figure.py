"""Picture of sight lines: the visible returns of a scan, and one sight line."""

from typing import TYPE_CHECKING, Any

import numpy as np

from intervis.arrays import Float64Array, FloatArray
from intervis.plots.style import (
    FAINT,
    INK,
    INTERVISIBLE,
    NODE,
    dots,
    legend_below,
    mark_viewpoint,
    page_figure,
)
from intervis.sight import OCCLUDED, UNKNOWN, VISIBLE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from intervis.sight import Explanation, Sight

STATES = {
    UNKNOWN: ("unknown", FAINT),
    OCCLUDED: ("occluded", NODE),
    VISIBLE: ("visible", INTERVISIBLE),
}
"""Label and colour of each state, in drawing order: visible returns are drawn last."""

SHOWN_M = 40.0
"""Least distance from the middle of the line to the border of the view, along x and y."""

EDGE_M = 2.0
"""Margin of the view."""

LEAST_ASPECT = 0.5
"""Smallest ratio of the sides of the view; the legend needs the width."""


def sight_from_above(
    points: FloatArray,
    sight: "Sight",
    viewpoint: Float64Array,
    line: "Explanation | None" = None,
    end: Float64Array | None = None,
) -> "Figure":
    """The returns of a scan from above, coloured by state, and optionally one sight line.

    Parameters
    ----------
    points : (K, 3) float array
        Returns, scene frame, metres.
    sight : Sight
        Of the K sight lines from the viewpoint to these returns.
    viewpoint : (3,) float64 array
        Scene frame, metres.
    line, end : Explanation and (3,) float64 array, or None
        A sight line from the viewpoint to `end`, and its explanation.

    Raises
    ------
    MissingExtraError
        matplotlib (extra ``plots``) is not installed.
    """
    window = _window(points, viewpoint, viewpoint if end is None else end)
    wide_m, high_m = window[1] - window[0]
    with page_figure(1.0 + 5.6 * high_m / wide_m) as (figure, axes):
        for state, (name, colour) in STATES.items():
            chosen = sight.state == state
            label = f"{name}, {100 * chosen.mean():.0f} %" if len(chosen) else name
            dots(axes, points[chosen], s=1.2, color=colour, label=label)
        if line is not None and end is not None:
            _draw_line(axes, viewpoint, end, line)
        mark_viewpoint(axes, viewpoint)
        axes.set(
            xlim=window[:, 0],
            ylim=window[:, 1],
            aspect="equal",
            xlabel="x forward, m",
            ylabel="y left, m",
            title=f"{len(points):,} returns as seen from ({_numbers(viewpoint)})",
        )
        legend_below(figure, axes)
        return figure


def _window(points: FloatArray, viewpoint: Float64Array, end: Float64Array) -> Float64Array:
    """(2, 2) lower and upper corner of the view: the line and the returns around it."""
    ends = np.stack([viewpoint, end])[:, :2].astype(np.float64)
    middle = ends.mean(axis=0)
    reach = max(SHOWN_M, 0.6 * float(np.abs(ends[1] - ends[0]).max()))
    near = points[(np.abs(points[:, :2] - middle) < reach).all(axis=1), :2]
    corners = np.vstack([ends, np.quantile(near, [0.002, 0.998], axis=0) if len(near) else ends])
    low, high = corners.min(axis=0) - EDGE_M, corners.max(axis=0) + EDGE_M
    missing = np.maximum(LEAST_ASPECT * (high - low)[::-1] - (high - low), 0.0) / 2
    return np.stack([low - missing, high + missing])


def _draw_line(axes: Any, start: Float64Array, end: Float64Array, line: "Explanation") -> None:
    ends = np.stack([start, end])
    axes.plot(ends[:, 0], ends[:, 1], color=INK, linewidth=0.9, zorder=5, label="sight line")
    dots(axes, end[None], s=16, color=INK, zorder=6)
    if np.isfinite(line.blocker).all():
        look = {"s": 34, "marker": "X", "color": NODE, "edgecolor": "white", "linewidths": 0.5}
        dots(axes, line.blocker[None], label="blocked here", zorder=7, **look)


def _numbers(point: Float64Array) -> str:
    return ", ".join(f"{value:.1f}" for value in point)
