"""Picture of a visibility grid from above, with its blind spots."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from intervis.plots.style import FAINT, INK, INTERVISIBLE, NODE, dots, legend_below, page_figure
from intervis.uses.blind_spots import BlindSpot
from intervis.uses.visibility_grid import VisibilityGrid

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STATES = (("unknown", FAINT), ("occluded", NODE), ("visible", INTERVISIBLE), ("obstacle", INK))
NUMBERED = 12
"""So many of the nearest spots are outlined and numbered."""


def grid_picture(grid: VisibilityGrid, spots: Sequence[BlindSpot]) -> "Figure":
    """The cells by state, obstacles, and the nearest blind spots with the rank of their distance.

    Raises
    ------
    MissingExtraError
        matplotlib (extra ``plots``) is not installed.
    """
    with page_figure(7.2) as (figure, axes):
        from matplotlib.colors import ListedColormap
        from matplotlib.patheffects import withStroke

        kind = np.where(grid.obstacle, 3, grid.state + 1).astype(np.float64)
        kind[np.isnan(grid.ground_m)] = np.nan
        low = grid.corner
        high = low + grid.cell_m * np.array(kind.shape)
        axes.imshow(
            kind.T,
            origin="lower",
            extent=(low[0], high[0], low[1], high[1]),
            cmap=ListedColormap([colour for _, colour in STATES]),
            vmin=-0.5,
            vmax=3.5,
            interpolation="nearest",
        )
        for name, colour in STATES:
            dots(axes, np.full((1, 2), np.nan), s=30, color=colour, marker="s", label=name)
        rim = [withStroke(linewidth=2.0, foreground="white")]
        for nth, spot in enumerate(spots[:NUMBERED], start=1):
            for ring in spot.outline:
                axes.plot(ring[:, 0], ring[:, 1], color=INK, linewidth=0.6)
            axes.text(*spot.centre, str(nth), fontsize=8, ha="center", path_effects=rim)
        look = {"marker": "*", "s": 70, "color": INK, "edgecolor": "white", "zorder": 6}
        dots(axes, grid.viewpoint[None, :2], label="viewpoint", **{**look, "linewidths": 0.6})
        axes.set(
            xlim=(low[0], high[0]),
            ylim=(low[1], high[1]),
            aspect="equal",
            xlabel="x forward, m",
            ylabel="y left, m",
            title=f"{grid.height_m:g} m above the ground, with the nearest blind spots",
        )
        legend_below(figure, axes)
        return figure
