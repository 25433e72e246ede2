"""The chart of `intervis bench --growth`: time and memory against the number of points."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from intervis.plots.style import FAINT, INK, INTERVISIBLE, NODE, REGION, legend_below, page_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from intervis.lab.speed.growth import Growth

LOOKS = ((INTERVISIBLE, "o"), (NODE, "s"), (REGION, "^"))
GOAL_EXPONENT, GOAL_BYTES = 1.1, 600.0
"""What is aimed for: drawn for comparison."""


def growth_figure(found: "Sequence[Growth]") -> "Figure":
    """Left: median times with their fits, and the slope of the goal. Right: bytes a point.

    Raises
    ------
    MissingExtraError
        matplotlib (extra ``plots``) is not installed.
    """
    with page_figure(3.3, ncols=2) as (figure, (time, memory)):
        for one, (colour, marker) in zip(found, LOOKS, strict=False):
            sizes, times_ms = np.array(one.sizes), 1e3 * np.array(one.median_s)
            look = {"color": colour, "marker": marker, "markersize": 4.0, "linewidth": 1.2}
            time.loglog(sizes, times_ms, label=f"{one.work}: n^{one.exponent:.2f}", **look)
            if one.bytes_per_point is not None:
                memory.semilogx(sizes, one.bytes_per_point, **look)
        sizes = np.array([min(one.sizes[0] for one in found), max(one.sizes[-1] for one in found)])
        middle = np.exp(np.mean([np.log(1e3 * np.array(one.median_s)).mean() for one in found]))
        goal = middle * (sizes / np.sqrt(sizes[0] * sizes[1])) ** GOAL_EXPONENT
        goal_look = {"color": INK, "linewidth": 0.8, "linestyle": (0, (4, 3)), "zorder": 1}
        time.loglog(
            sizes,
            goal,
            label=f"goal: slope n^{GOAL_EXPONENT}, {GOAL_BYTES:g} bytes a point",
            **goal_look,
        )
        memory.semilogx(sizes, [GOAL_BYTES, GOAL_BYTES], **goal_look)
        time.set(title="Time", xlabel="points", ylabel="ms, median")
        memory.set(title="Memory at the peak", xlabel="points", ylabel="bytes a point")
        memory.set_ylim(bottom=0)
        for axes in (time, memory):
            axes.grid(True, color=FAINT, linewidth=0.4)
            axes.set_axisbelow(True)
        legend_below(figure, time, columns=2)
        return figure
