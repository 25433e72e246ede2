"""Picture of who sees whom: the lines of one frame from above, and the matrix of all frames."""

from collections.abc import Sequence
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
NAMED, NUMBERED = 12, 25
"""With more agents they have numbers for names, those of the matrix; with still more neither."""
LABEL_PT = 6.5
BESIDE = ((1, 1), (-1, 1), (1, -1), (-1, -1), (0, 1), (0, -1))
"""Sides of a dot on which its label may stand: right or left, above or below."""
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
        scale_pt = 72.0 * min(5.0 / wide, plan_in / tall)  # 5 of 7 inches, where names are long
        _draw_names(axes[0], found, nth, (low, high), scale_pt)
        axes[0].legend(
            loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, frameon=False, borderpad=0.0
        )
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


def _draw_names(
    axes: Any,
    found: MutualSight,
    nth: int,
    corners: tuple[Float64Array, Float64Array],
    scale_pt: float,
) -> None:
    """Names or numbers beside the agents of a frame; `scale_pt` points on paper are a metre."""
    from matplotlib.patheffects import withStroke

    eyes = found.eyes[nth]
    here = np.flatnonzero(np.isfinite(eyes[:, 0]))
    if len(here) > NUMBERED:
        return
    texts = [_label(found, a) for a in here.tolist()]
    places = scale_pt * (eyes[here, :2] - corners[0])
    sides = sides_of_labels(places, texts, scale_pt * (corners[1] - corners[0]))
    rim = [withStroke(linewidth=2.0, foreground="white")]
    for text, place, (right, up) in zip(texts, eyes[here], sides, strict=True):
        axes.annotate(
            *(text, place[:2]),
            xytext=(4 * right, 3 * up),
            textcoords="offset points",
            ha=("right", "center", "left")[right + 1],
            va="bottom" if up > 0 else "top",
            fontsize=LABEL_PT,
            path_effects=rim,
        )


def _label(found: MutualSight, a: int) -> str:
    return found.names[a] if len(found.names) <= NAMED else str(a)


def sides_of_labels(
    places: Float64Array, texts: Sequence[str], size: Float64Array
) -> list[tuple[int, int]]:
    """The side of each dot on which its label is freest of labels and dots, and inside.

    Parameters
    ----------
    places : (K, 2) float64 array
        Of the dots, points on paper from the lower left corner.
    texts : sequence of K str
    size : (2,) float64 array
        Of the axes, points.

    Examples
    --------
    The second label would be cut at the edge, the third one would lie over the first:

    >>> dots_pt = np.array([[10.0, 20.0], [195.0, 50.0], [2.0, 20.0]])
    >>> sides_of_labels(dots_pt, ["child", "driver", "cyclist"], np.array([200.0, 100.0]))
    [(1, 1), (-1, 1), (1, -1)]
    """
    chosen: list[tuple[int, int]] = []
    taken: list[Float64Array] = []
    for place, text in zip(places, texts, strict=True):
        wide, tall = 0.6 * LABEL_PT * len(text), 1.2 * LABEL_PT
        boxes = []
        for right, up in BESIDE:
            left = place[0] + 4 * right - (0.0, 0.5 * wide, wide)[(1, 0, -1).index(right)]
            low = place[1] + 3 * up - (0.0 if up > 0 else tall)
            boxes.append(np.array([left, low, left + wide, low + tall]))
        costs = [_cost(box, places, taken, size) for box in boxes]
        best = int(np.argmin(costs))
        chosen.append(BESIDE[best])
        taken.append(boxes[best])
    return chosen


def _cost(
    box: Float64Array, places: Float64Array, taken: Sequence[Float64Array], size: Float64Array
) -> float:
    """How much a box (left, low, right, high) covers, in labels; leaving the axes counts most."""
    inside = bool((box[:2] >= 0.0).all() and (box[2:] <= size).all())
    over = sum(bool((box[:2] < one[2:]).all() and (one[:2] < box[2:]).all()) for one in taken)
    dots_under = ((places > box[:2]) & (places < box[2:])).all(axis=1).sum()
    return (0.0 if inside else 100.0) + over + 0.5 * float(dots_under)


def _draw_matrix(axes: Any, found: MutualSight) -> None:
    share = 100.0 * found.seen_share
    shown = axes.imshow(share, vmin=0, vmax=100, cmap="Blues", aspect="auto")
    axes.set_facecolor("#eceef1")
    names, count = list(found.names), len(found.names)
    if count <= NUMBERED:
        if count > NAMED:
            axes.set_yticks(range(count), [f"{name}  {nth}" for nth, name in enumerate(names)])
            axes.set_xticks(range(count))
        else:
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
