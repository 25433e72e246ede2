"""Picture of a grid of voxels: a level slice and an upright one, in the colours of the states."""

from typing import TYPE_CHECKING, Any

import numpy as np

from intervis.arrays import UInt8Array
from intervis.plots.style import FAINT, INK, INTERVISIBLE, NODE, dots, legend_below, page_figure
from intervis.uses.voxels.carving import STATES
from intervis.uses.voxels.masks import Masks

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLOURS = (INTERVISIBLE, INK, NODE, FAINT)
"""Of the states free, occupied, occluded and unknown."""
LEVEL_M = -0.9
"""Height of the level slice above the scanner: some 0.8 m above the road for one on a roof, unless
the grid does not reach there."""


def mask_picture(masks: Masks, *, scanner_m: float) -> "Figure":
    """The states of the voxels at one height, and on the upright plane through y = 0.

    Parameters
    ----------
    masks : Masks
    scanner_m : float
        Height of the scanner in the frame of the grid; the level slice lies 0.9 m below it.

    Raises
    ------
    MissingExtraError
        matplotlib (extra ``plots``) is not installed.
    """
    grid = masks.grid
    index, _ = grid.index_of(np.array([[0.0, 0.0, scanner_m + LEVEL_M]]))
    _, j, k = np.clip(index[0], 0, np.array(grid.shape) - 1)
    low, high = grid.corner, grid.upper
    centre = grid.centre_of([0, j, k])
    ratio = (high[1] - low[1]) / max(high[2] - low[2], 1e-9)
    width_in, size = 6.4, high - low
    height_in = width_in * (size[1] + size[2]) / size[0] + 1.3
    heights = {"height_ratios": [ratio, 1.0]}
    with page_figure(min(height_in, 9.0), nrows=2, gridspec_kw=heights) as (figure, axes):
        _slice(axes[0], masks.state[:, :, k], (low[0], high[0], low[1], high[1]))
        axes[0].set(ylabel="y left, m", title=f"level slice at z = {centre[2]:.1f} m")
        _slice(axes[1], masks.state[:, j, :], (low[0], high[0], low[2], high[2]))
        axes[1].set(xlabel="x ahead, m", ylabel="z, m")
        axes[1].set_title(f"upright slice at y = {centre[1]:.1f} m")
        for state, name in STATES.items():
            look = {"s": 30, "color": COLOURS[state], "marker": "s", "label": name}
            dots(axes[0], np.full((1, 2), np.nan), **look)
        legend_below(figure, axes[0])
        return figure


def _slice(axes: Any, state: UInt8Array, extent: tuple[float, float, float, float]) -> None:
    from matplotlib.colors import ListedColormap

    axes.imshow(
        state.T,
        origin="lower",
        extent=extent,
        cmap=ListedColormap(list(COLOURS)),
        vmin=-0.5,
        vmax=3.5,
        interpolation="nearest",
    )
