"""Picture of sightings along a route: plan, and a bar of states for each target or zone.

With many targets the bars give way to the share of the targets in each state.
"""

from typing import TYPE_CHECKING, Any

import numpy as np

from intervis.arrays import Float64Array
from intervis.plots.style import FAINT, INK, INTERVISIBLE, NODE, dots, legend_below, page_figure
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
"""With more targets the share of them in each state is drawn instead."""
SHARES_IN, DOT_PT2 = 2.2, 10.0


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
    count = len(answer.names)
    ratios = [6.4 * plan.aspect, SHARES_IN if count > MOST_BARS else 0.6 + 0.2 * count]
    with page_figure(sum(ratios) + 1.2, nrows=2, height_ratios=ratios) as (figure, axes):
        plan.draw(axes[0], returns, eye_m)
        _draw_targets(axes[0], answer, plan)
        if count > MOST_BARS:
            _draw_shares(axes[1], answer)
        else:
            _draw_bars(axes[1], answer)
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
        size = DOT_PT2 * min(1.0, max((MOST_BARS / len(middles)) ** 0.5, 0.1))
        for chosen, colour, word in (
            (ever, INTERVISIBLE, "seen from somewhere"),
            (~ever, NODE, "never seen"),
        ):
            label = f"{word}, {int(chosen.sum()):,}"
            dots(axes, middles[chosen], s=size, color=colour, label=label, zorder=4)
        axes.legend(
            loc="lower right",
            bbox_to_anchor=(1.0, 1.0),
            ncols=2,
            frameon=False,
            markerscale=(DOT_PT2 / size) ** 0.5,
        )
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
        xlabel="along the line from start to end of the route, m",
        title="Plan",
    )


def _draw_shares(axes: Any, answer: RouteAnswer) -> None:
    """Share of the targets in each state over chainage, visible ones at the bottom."""
    for state, name, colour in STATES[1:]:
        label = f"{name}, {100 * float((answer.state == state).mean()):.0f} %"
        dots(axes, np.full((1, 2), np.nan), s=30, color=colour, marker="s", label=label)
    shares = [100.0 * (answer.state == state).mean(axis=1) for state, _, _ in STATES[::-1]]
    colours = [colour for _, _, colour in STATES[::-1]]
    kind = "zones" if answer.zones else "targets"
    axes.stackplot(answer.chainage_m, shares, colors=colours)
    axes.set(
        xlabel="chainage, m",
        ylabel=f"{kind}, %",
        xlim=(answer.chainage_m[0], max(answer.chainage_m[-1], answer.chainage_m[0] + 1e-9)),
        ylim=(0, 100),
        title=f"In sight along the route: share of {len(answer.names):,} {kind}",
    )


def _draw_bars(axes: Any, answer: RouteAnswer) -> None:
    from matplotlib.colors import ListedColormap
    from matplotlib.patheffects import withStroke

    shown = len(answer.names)
    where = answer.chainage_m
    half = 0.5 * float(where[1] - where[0]) if len(where) > 1 else 0.5
    axes.imshow(
        (answer.state.T - OUT_OF_RANGE).astype(np.float64),
        aspect="auto",
        extent=(where[0] - half, where[-1] + half, shown - 0.5, -0.5),
        cmap=ListedColormap([colour for _, _, colour in STATES]),
        vmin=-0.5,
        vmax=3.5,
        interpolation="nearest",
    )
    for row in np.arange(shown - 1) + 0.5:
        axes.axhline(row, color="white", linewidth=1.5)
    rim = [withStroke(linewidth=2.4, foreground="white")]
    for nth in range(shown if answer.zones else 0):
        share = answer.shares["visible"][:, nth]
        axes.plot(where, nth + 0.42 - 0.84 * share, color=INK, linewidth=1.1, path_effects=rim)
    for state, name, colour in STATES[1:]:
        label = f"{name}, {100 * float((answer.state == state).mean()):.0f} %"
        dots(axes, np.full((1, 2), np.nan), s=30, color=colour, marker="s", label=label)
    axes.set(
        xlabel="chainage, m",
        yticks=range(shown),
        title="In sight along the route" + ("; dark line: visible share" if answer.zones else ""),
    )
    axes.set_yticklabels(answer.names)
