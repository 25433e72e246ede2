"""Parts that the paper's figures share: 3-D axes, and limits around the viewpoint."""

from typing import Any

import numpy as np

from intervis.arrays import BoolArray, Float64Array
from intervis.method.analysis import Analysis


def scatter_3d(axes: Any, points: Float64Array, **look: Any) -> Any:
    """Borderless dots at (K, 3) positions."""
    return axes.scatter(
        points[:, 0], points[:, 1], points[:, 2], depthshade=False, **({"linewidths": 0} | look)
    )


def without_outliers(points: Float64Array) -> BoolArray:
    """(K,) mask of the points that a 3-D view shows: all but a few outliers."""
    low, high = np.percentile(points, [0.5, 99.0], axis=0)
    inside: BoolArray = ((points >= low) & (points <= high)).all(axis=1)
    return inside if inside.sum() > 3 else np.ones(len(points), bool)


def solid_axes(axes: Any, points: Float64Array, title: str) -> None:
    """A view from behind and above, with exaggerated elevation."""
    low, high = points.min(axis=0), points.max(axis=0)
    span = np.maximum(high - low, 1e-3)
    axes.set(xlabel="x forward, m", ylabel="y left, m", zlabel="z, m")
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2] + 1e-3))
    wide = max(span[0], span[1])
    axes.set_box_aspect((max(span[0], 0.5 * wide), max(span[1], 0.5 * wide), 0.22 * wide), zoom=1.3)
    axes.view_init(elev=30, azim=-115)
    axes.set_title(title, y=1.0, pad=-6)
    axes.tick_params(labelsize=6, pad=-2)
    axes.locator_params(axis="z", nbins=4)
    axes.zaxis.labelpad = -6
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.set_pane_color((0.96, 0.96, 0.97, 1.0))


def solid_bar(axes: Any, shown: Any, label: str) -> None:
    """A colour bar beside a 3-D view."""
    bar = axes.figure.colorbar(shown, cax=axes.inset_axes((1.22, 0.15, 0.022, 0.65)))
    bar.set_label(label, fontsize=7.0)
    bar.ax.tick_params(labelsize=7.0)
    bar.outline.set_visible(False)


def ground_range_m(analysis: Analysis) -> Float64Array:
    """(V,) ground range of each node from the viewpoint."""
    offset = analysis.node_points[:, :2] - analysis.viewpoint[:2]
    return np.hypot(offset[:, 0], offset[:, 1])


def reach_m(analysis: Analysis, percent: float) -> float:
    """Ground range within which this percentage of the nodes lies."""
    return float(np.percentile(ground_range_m(analysis), percent))


def set_limits(axes: Any, analysis: Analysis, percent: float, *, square: bool = False) -> None:
    """Limits around the viewpoint and the nearest nodes, with equal scales."""
    near = ground_range_m(analysis) <= reach_m(analysis, percent)
    kept = np.vstack([analysis.node_points[near, :2], analysis.viewpoint[:2]])
    low, high = kept.min(axis=0), kept.max(axis=0)
    if square:
        middle, half = (low + high) / 2, (high - low).max() / 2
        low, high = middle - half, middle + half
    margin = 0.03 * float((high - low).max()) + 0.3
    axes.set(
        xlim=(low[0] - margin, high[0] + margin),
        ylim=(low[1] - margin, high[1] + margin),
        aspect="equal",
        xlabel="x forward, m",
        ylabel="y left, m",
    )
