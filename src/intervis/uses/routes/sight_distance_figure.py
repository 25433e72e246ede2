"""Pictures of sight distances: chart over chainage, states of all objects, and plan."""

from typing import TYPE_CHECKING, Any

import numpy as np

from intervis.arrays import BoolArray, Float64Array
from intervis.plots.style import (
    FAINT,
    INK,
    INTERVISIBLE,
    NODE,
    REGION,
    dots,
    page_figure,
)
from intervis.sight import OCCLUDED, UNKNOWN, VISIBLE
from intervis.uses.routes.plan_frame import PlanFrame
from intervis.uses.routes.sight_distance import (
    DEFICIENT,
    NO_TARGET,
    SUFFICIENT,
    UNDECIDED,
    SightDistances,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLOURS = {SUFFICIENT: INTERVISIBLE, DEFICIENT: NODE, UNDECIDED: REGION}
STATES = (
    (NO_TARGET, "beyond the path", "white"),
    (UNKNOWN, "unknown", FAINT),
    (OCCLUDED, "hidden", NODE),
    (VISIBLE, "visible", INTERVISIBLE),
)


def sight_distance_picture(found: SightDistances, returns: Float64Array) -> "Figure":
    """Plan with verdicts and blockers; available and required distance; state of every object.

    Parameters
    ----------
    found : SightDistances
    returns : (N, 3) float64 array
        Returns to draw in the plan, scene frame.

    Raises
    ------
    MissingExtraError
        matplotlib (extra ``plots``) is not installed.
    """
    plan = PlanFrame.around(found.road, found.road.points)
    ratios = [6.4 * plan.aspect, 2.1, 2.1]
    with page_figure(sum(ratios) + 1.2, nrows=3, height_ratios=ratios) as (figure, axes):
        _draw_plan(axes[0], found, returns, plan)
        _draw_chart(axes[1], found)
        _draw_states(axes[2], found)
        axes[2].sharex(axes[1])
        return figure


def _draw_plan(axes: Any, found: SightDistances, returns: Float64Array, plan: PlanFrame) -> None:
    plan.draw(axes, returns)
    places = plan.turned(found.road.at(found.chainage_m))
    verdict = found.verdict
    for word, colour in COLOURS.items():
        chosen = verdict == word
        label = f"{word}, {int(chosen.sum())}"
        dots(axes, places[chosen], s=16, color=colour, label=label, zorder=4)
    blocker = found.ending_blocker
    held = np.isfinite(blocker[:, 0])
    look = {"marker": "X", "s": 26, "color": INK, "edgecolor": "white", "linewidths": 0.5}
    dots(axes, plan.turned(blocker[held]), label="hides the road", zorder=5, **look)
    axes.set(
        ylabel="left of the line, m",
        title=f"Plan, {found.standard.name}: along the line from start to end of the path, m",
    )
    axes.legend(loc="upper right", framealpha=0.9, edgecolor="white", ncols=4, fontsize=6.5)


def _draw_chart(axes: Any, found: SightDistances) -> None:
    where, seen_m, possible_m = found.chainage_m, found.seen_m, found.possible_m
    axes.fill_between(
        where, seen_m, possible_m, color=FAINT, linewidth=0, label="unknown: may be visible"
    )
    axes.fill_between(where, 0, seen_m, color=INTERVISIBLE, alpha=0.25, linewidth=0)
    axes.plot(where, seen_m, color=INTERVISIBLE, marker=".", markersize=3, label="seen")
    axes.plot(where, found.required_m, color=INK, linewidth=1.2, linestyle="--", label="required")
    bounded = found.is_bounded
    dots(
        axes,
        np.column_stack([where, possible_m])[bounded],
        s=14,
        color=NODE,
        marker="v",
        label="ends at something that hides",
        zorder=4,
    )
    axes.set(
        ylabel="along the path, m",
        ylim=(0, _top_m(found)),
        title="Available and required sight distance",
    )
    axes.legend(loc="upper right", frameon=False, ncols=4, fontsize=6.5)


def _top_m(found: SightDistances) -> float:
    """Upper end of the axes, with room for the legend."""
    required_m = np.where(np.isfinite(found.required_m), found.required_m, 0.0)
    return 1.25 * float(max(found.distance_m[-1], required_m.max()))


def _draw_states(axes: Any, found: SightDistances) -> None:
    """Every object as a cell: chainage of the station, distance ahead."""
    from matplotlib.colors import ListedColormap

    half_s, half_d = _half_step(found.chainage_m), 0.5 * found.step_m
    axes.imshow(
        (found.state.T - NO_TARGET).astype(np.float64),
        origin="lower",
        aspect="auto",
        extent=(
            *(found.chainage_m[0] - half_s, found.chainage_m[-1] + half_s),
            *(found.distance_m[0] - half_d, found.distance_m[-1] + half_d),
        ),
        cmap=ListedColormap([colour for _, _, colour in STATES]),
        vmin=-0.5,
        vmax=3.5,
        interpolation="nearest",
    )
    steps = np.append(found.chainage_m - half_s, found.chainage_m[-1] + half_s)
    axes.stairs(found.required_m, steps, color=INK, linestyle="--", linewidth=1.2, baseline=None)
    for state, name, colour in STATES[1:]:
        label = f"{name}, {100 * _share(found, found.state == state):.0f} %"
        dots(axes, np.full((1, 2), np.nan), s=30, color=colour, marker="s", label=label)
    axes.set(
        xlabel="chainage of the driver, m",
        ylabel="object ahead, m",
        ylim=(0, _top_m(found)),
        title="State of every object",
    )
    axes.legend(loc="upper right", frameon=True, framealpha=0.85, ncols=3, fontsize=6.5)


def _share(found: SightDistances, chosen: BoolArray) -> float:
    return float(chosen.sum() / max((found.state != NO_TARGET).sum(), 1))


def _half_step(chainage_m: Float64Array) -> float:
    return 0.5 * float(chainage_m[1] - chainage_m[0]) if len(chainage_m) > 1 else 2.5
