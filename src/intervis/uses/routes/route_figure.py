"""Picture of sightings along a route: plan, and a bar of states for each target or zone."""

from typing import TYPE_CHECKING, Any

import numpy as np

from intervis.arrays import Float64Array
from intervis.plots.style import FAINT, INTERVISIBLE, NODE, dots, legend_below, page_figure
from intervis.sight import OCCLUDED, UNKNOWN, VISIBLE
from intervis.uses.routes.plan_frame import PlanFrame
from intervis.uses.routes.route_answer import RouteAnswer
from intervis.uses.routes.route_sight import OUT_OF_RANGE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STATES = (
    (OUT_OF_RANGE, "out of range", "white"),
    (UNKNOWN, "unknown", FAINT),
    (OCCLUDED, "occluded", NODE),
    (VISIBLE, "visible", INTERVISIBLE),
)
MOST_BARS = 40
"""With more targets the bars are those of the longest sightings."""


def route_picture(answer: RouteAnswer, returns: Float64Array, eye_m: float = 1.5) -> "Figure":
    """Plan with the targets or zones, and states over chainage.

    Parameters
    ----------
    answer : RouteAnswer
    returns : (N, 3) float64 array
        Returns to draw in the plan, scene frame.
    eye_m : float
        Height of the route above the road, whose returns are left out.

    Raises
    ------
    MissingExtraError
        matplotlib (extra ``plots``) is not installed.
    """
    corners = [zone.corners for zone in answer.zones] or [answer.middles[:, :2]]
    plan = PlanFrame.around(answer.route, np.vstack(corners))
    shown = np.argsort(-answer.seen_share, kind="stable")[:MOST_BARS]
    shown = np.sort(shown)
    ratios = [6.4 * plan.aspect, 0.6 + 0.2 * len(shown)]
    with page_figure(sum(ratios) + 1.2, nrows=2, height_ratios=ratios) as (figure, axes):
        plan.draw(axes[0], returns, eye_m)
        _draw_targets(axes[0], answer, plan)
        _draw_bars(axes[1], answer, shown)
        legend_below(figure, axes[1])
        return figure


def _draw_targets(axes: Any, answer: RouteAnswer, plan: PlanFrame) -> None:
    from matplotlib.patheffects import withStroke

    ever = answer.seen_share > 0
    rim = [withStroke(linewidth=2.0, foreground="white")]
    colours = np.where(ever, INTERVISIBLE, NODE)
    for zone, colour in zip(answer.zones, colours, strict=False):
        ring = plan.turned(np.vstack([zone.corners, zone.corners[:1]]))
        axes.fill(ring[:, 0], ring[:, 1], facecolor=colour, alpha=0.35, edgecolor=colour)
    middles = plan.turned(answer.middles)
    if not answer.zones:
        for chosen, colour, word in (
            (ever, INTERVISIBLE, "seen from somewhere"),
            (~ever, NODE, "never seen"),
        ):
            label = f"{word}, {int(chosen.sum()):,}"
            dots(axes, middles[chosen], s=10, color=colour, label=label, zorder=4)
        axes.legend(loc="upper right", framealpha=0.9, edgecolor="white", ncols=2, fontsize=6.5)
    if len(answer.names) <= MOST_BARS:
        for name, place in zip(answer.names, middles, strict=True):
            axes.annotate(
                *(name, place),
                xytext=(0, 4),
                textcoords="offset points",
                ha="center",
                fontsize=6.5,
                path_effects=rim,
            )
    axes.set(
        ylabel="left of the line, m",
        title="Plan: along the line from start to end of the route, m",
    )


def _draw_bars(axes: Any, answer: RouteAnswer, shown: Any) -> None:
    from matplotlib.colors import ListedColormap

    where = answer.chainage_m
    half = 0.5 * float(where[1] - where[0]) if len(where) > 1 else 0.5
    axes.imshow(
        (answer.state[:, shown].T - OUT_OF_RANGE).astype(np.float64),
        aspect="auto",
        extent=(where[0] - half, where[-1] + half, len(shown) - 0.5, -0.5),
        cmap=ListedColormap([colour for _, _, colour in STATES]),
        vmin=-0.5,
        vmax=3.5,
        interpolation="nearest",
    )
    for row in np.arange(len(shown) - 1) + 0.5:
        axes.axhline(row, color="white", linewidth=1.5)
    for nth, target in enumerate(shown if answer.zones else ()):
        share = answer.shares["visible"][:, target]
        axes.plot(where, nth + 0.45 - 0.9 * share, color="white", linewidth=1.1)
    for state, name, colour in STATES[1:]:
        label = f"{name}, {100 * float((answer.state == state).mean()):.0f} %"
        dots(axes, np.full((1, 2), np.nan), s=30, color=colour, marker="s", label=label)
    names = [answer.names[target] for target in shown]
    axes.set(
        xlabel="chainage, m",
        yticks=range(len(shown)),
        title="In sight along the route" + ("; white line: visible share" if answer.zones else ""),
    )
    axes.set_yticklabels(names)
