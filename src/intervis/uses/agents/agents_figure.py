"""Picture of who sees whom: the lines of one frame from above, and the matrix of all frames."""

from typing import TYPE_CHECKING, Any

import numpy as np

from intervis.arrays import Float64Array
from intervis.plots.style import FAINT, INK, INTERVISIBLE, NODE, REGION, dots, page_figure
from intervis.uses.agents.mutual_sight import ABSENT, HIDDEN, NOT_KNOWN, SEES, MutualSight

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LINES = (
    (HIDDEN, "occluded", NODE),
    (NOT_KNOWN, "unknown", REGION),
    (SEES, "visible", INTERVISIBLE),
)
MARGIN_M = 10.0
NAMED = 25
"""With more agents their names are left out."""
ABOVE_M, BELOW_M = 1.0, 2.5
"""Returns in this layer around the height of the eyes are drawn."""


def agents_picture(found: MutualSight, returns: Float64Array, nth: int = 0) -> "Figure":
    """The agents and lines of a frame from above; the share of frames in which each sees each.

    Parameters
    ----------
    found : MutualSight
    returns : (N, 3) float64 array
        Returns to draw, scene frame.
    nth : int
        Which of the frames is drawn.

    Raises
    ------
    MissingExtraError
        matplotlib (extra ``plots``) is not installed.
    """
    eyes = found.eyes[nth]
    here = np.isfinite(eyes[:, 0])
    low = eyes[here, :2].min(axis=0) - MARGIN_M
    high = eyes[here, :2].max(axis=0) + MARGIN_M
    tall, wide = high[1] - low[1], high[0] - low[0]
    plan_in = float(np.clip(6.2 * tall / wide, 1.8, 6.5))
    matrix_in = float(np.clip(0.9 + 0.2 * len(found.names), 1.8, 6.0))
    ratios = [plan_in, matrix_in]
    with page_figure(sum(ratios) + 0.8, nrows=2, height_ratios=ratios) as (figure, axes):
        _draw_returns(axes[0], returns, eyes[here], low, high)
        _draw_lines(axes[0], found, nth)
        axes[0].set(
            xlim=(low[0], high[0]),
            ylim=(low[1], high[1]),
            aspect="equal",
            xlabel="x, m",
            ylabel="y, m",
            title=f"Frame {found.frames[nth]}: {int(here.sum())} agents",
        )
        axes[0].legend(loc="upper right", framealpha=0.9, edgecolor="white", ncols=3)
        _draw_matrix(axes[1], found)
        return figure


def _draw_returns(
    axes: Any, returns: Float64Array, eyes: Float64Array, low: Float64Array, high: Float64Array
) -> None:
    level_m = float(np.median(eyes[:, 2]))
    shown = ((returns[:, :2] > low) & (returns[:, :2] < high)).all(axis=1)
    shown &= (returns[:, 2] > level_m - ABOVE_M) & (returns[:, 2] < level_m + BELOW_M)
    dots(axes, returns[shown], s=0.3, color=FAINT, rasterized=True)


def _draw_lines(axes: Any, found: MutualSight, nth: int) -> None:
    from matplotlib.collections import LineCollection
    from matplotlib.patheffects import withStroke

    eyes, reason = found.eyes[nth], found.reason[nth]
    for code, name, colour in LINES:
        pairs = np.argwhere((reason == code) | (reason.T == code))
        pairs = pairs[pairs[:, 0] < pairs[:, 1]]
        lines = LineCollection(
            [eyes[pair, :2] for pair in pairs],
            linewidths=0.7,
            colors=colour,
            label=f"{name}, {len(pairs)} pairs",
            alpha=0.85,
        )
        axes.add_collection(lines)
    here = np.isfinite(eyes[:, 0])
    dots(axes, eyes[here], s=14, color=INK, zorder=4)
    if here.sum() <= NAMED:
        rim = [withStroke(linewidth=2.0, foreground="white")]
        for name, place in zip(np.array(found.names)[here], eyes[here], strict=True):
            axes.annotate(
                *(name, place[:2]),
                xytext=(4, 3),
                textcoords="offset points",
                fontsize=6.5,
                path_effects=rim,
            )


def _draw_matrix(axes: Any, found: MutualSight) -> None:
    share = 100.0 * found.seen_share
    shown = axes.imshow(share, vmin=0, vmax=100, cmap="Blues", aspect="auto")
    axes.set_facecolor("#eceef1")
    names, count = list(found.names), len(found.names)
    if count <= NAMED:
        axes.set_yticks(range(count), names)
        axes.set_xticks(range(count), names, rotation=30 if count > 5 else 0, ha="right")
        if count <= 5:
            axes.set_xticks(range(count), names, ha="center")
        for a, b in np.argwhere(np.isfinite(share)):
            colour = "white" if share[a, b] > 60 else INK
            look = {"ha": "center", "va": "center", "fontsize": 6.5, "color": colour}
            axes.text(b, a, f"{share[a, b]:.0f}", **look)
    frames = int((found.reason != ABSENT).any(axis=(1, 2)).sum())
    axes.set_title(f"Row sees column, per cent of the common frames ({frames} frames)")
    shown.axes.tick_params(length=0)
