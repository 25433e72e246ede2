"""Figures 3, 6, 7 and 8 of the paper: scan, mesh, intervisible edges and terrain map."""

from typing import TYPE_CHECKING, Any

import numpy as np

from intervis.arrays import Float64Array, finite_rows
from intervis.lab.paper.experiment import FrameExperiment, border_edges
from intervis.lab.paper.views import (
    ground_range_m,
    reach_m,
    scatter_3d,
    set_limits,
    solid_axes,
    without_outliers,
)
from intervis.method.analysis import Analysis
from intervis.plots.figures import SHOWN_PERCENT, draw_camera_view
from intervis.plots.style import (
    FAINT,
    INTERVISIBLE,
    NODE,
    REGION,
    SEQUENTIAL,
    colour_bar,
    dots,
    legend_below,
    mark_viewpoint,
    page_figure,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def figure_3(result: FrameExperiment) -> "Figure":
    """Camera view, and the scan from above coloured by intensity."""
    frame = result.frame
    if frame.camera is None:
        with page_figure(5.6) as (figure, axes):
            _draw_scan(axes, result)
            return figure
    with page_figure(8.0, nrows=2, height_ratios=[1.0, 2.5]) as (figure, axes):
        draw_camera_view(axes[0], frame, result.finest)
        axes[0].set_title(f"(a) Camera: {axes[0].get_title(loc='left')}")
        _draw_scan(axes[1], result, "(b) ")
        return figure


def _draw_scan(axes: Any, result: FrameExperiment, letter: str = "") -> None:
    frame = result.frame
    rows = finite_rows(frame.points)
    points, intensity = frame.points[rows], frame.attributes.get("intensity")
    value = points[:, 2] if intensity is None else np.asarray(intensity)[rows]
    low, high = np.percentile(value, [1, 99])
    shown_m = float(np.percentile(np.abs(points[:, :2]).max(axis=1), SHOWN_PERCENT))
    shown = dots(
        axes, points, c=value, s=0.4, cmap=SEQUENTIAL, vmin=low, vmax=max(high, low + 1e-6)
    )
    mark_viewpoint(axes, result.finest.viewpoint)
    axes.set(
        xlim=(-shown_m, shown_m),
        ylim=(-shown_m, shown_m),
        aspect="equal",
        xlabel="x forward, m",
        ylabel="y left, m",
        title=f"{letter}Scan from above: {len(points):,} returns",
    )
    colour_bar(axes, shown, "elevation z, m" if intensity is None else "intensity")


def figure_6(result: FrameExperiment) -> "Figure":
    """The mesh, its intervisible edges and the reachable tree, whole and near part."""
    with page_figure(4.1, ncols=2) as (figure, axes):
        for place, percent, scale, title in (
            (axes[0], SHOWN_PERCENT, 1.0, "Whole"),
            (axes[1], 60.0, 1.8, "Near part"),
        ):
            _draw_topology(place, result.finest, scale)
            set_limits(place, result.finest, percent, square=True)
            place.set_title(title)
        legend_below(figure, axes[0], 3)
        return figure


def _draw_topology(axes: Any, analysis: Analysis, scale: float) -> None:
    from matplotlib.collections import LineCollection

    ground, good = analysis.node_points[:, :2], analysis.edge_intervisible
    tree = np.flatnonzero(analysis.tree_parent >= 0)
    branches = np.stack([ground[analysis.tree_parent[tree]], ground[tree]], axis=1)
    roots = ground[analysis.tree_parent == -1]
    for lines, colour, width, label in (
        (ground[analysis.edges[~good]], FAINT, 0.25, "other edge"),
        (ground[analysis.edges[good]], REGION, 0.5, "intervisible edge"),
        (branches, INTERVISIBLE, 0.7, "edge of the reachable tree"),
    ):
        axes.add_collection(
            LineCollection(list(lines), colors=colour, linewidths=width * scale, label=label)
        )
    point = analysis.node_intervisible
    dots(axes, ground[point], s=1.2 * scale, color=NODE, zorder=3, label="intervisibility point")
    dots(axes, roots, s=6 * scale, color=INTERVISIBLE, zorder=4, label="reached directly")
    mark_viewpoint(axes, analysis.viewpoint)


def figure_7(result: FrameExperiment) -> "Figure":
    """Intervisible edges by difference in elevation, in 3-D and from above."""
    from matplotlib.collections import LineCollection
    from mpl_toolkits.mplot3d.art3d import Line3DCollection

    finest = result.finest
    nodes, kept = finest.node_points, without_outliers(finest.node_points)
    pairs = finest.edges[finest.edge_intervisible]
    rise_m = np.abs(nodes[pairs[:, 0], 2] - nodes[pairs[:, 1], 2])
    high = float(np.percentile(rise_m, 98)) if len(rise_m) else 1.0
    point = finest.node_intervisible
    scan = result.frame.points[finest.in_view]
    with page_figure(
        7.2,
        mosaic=[["solid"], ["above"]],
        height_ratios=[1.0, 1.1],
        per_subplot_kw={"solid": {"projection": "3d"}},
    ) as (figure, axes):
        solid, above = axes["solid"], axes["above"]
        limits: Any = {"cmap": SEQUENTIAL, "linewidths": 0.8}
        both = kept[pairs].all(axis=1)
        if both.any():
            lines_3d = Line3DCollection(list(nodes[pairs[both]]), **limits)
            lines_3d.set_array(rise_m[both])
            lines_3d.set_clim(0, high)
            solid.add_collection3d(lines_3d)
        scatter_3d(solid, nodes[point & kept], color=NODE, s=2.0)
        solid_axes(solid, nodes[kept], "(a) In 3-D")
        dots(above, scan, s=0.4, color="#9aa1ab", label="return in view")
        lines = LineCollection(list(nodes[pairs][:, :, :2]), **limits)
        lines.set_array(rise_m)
        lines.set_clim(0, high)
        above.add_collection(lines)
        dots(above, nodes[point], s=1.5, color=NODE, zorder=3, label="intervisibility point")
        mark_viewpoint(above, finest.viewpoint)
        set_limits(above, finest, 95.0)
        above.set_title("(b) From above")
        colour_bar(above, lines, "elevation difference |Δz| of an edge, m")
        legend_below(figure, above, 3)
        return figure


def figure_8(result: FrameExperiment) -> "Figure":
    """Terrain map: finite elements shaded by elevation, in 3-D and from above."""
    from matplotlib.collections import LineCollection

    finest = result.finest
    nodes, point = finest.node_points, finest.node_intervisible
    low, high = np.percentile(nodes[:, 2], [1, 99])
    reach = reach_m(finest, 95.0)
    kept = (ground_range_m(finest) <= reach) & without_outliers(nodes)
    shown = finest.triangles[kept[finest.triangles].all(axis=1)]
    shade: Any = {"cmap": SEQUENTIAL, "vmin": low, "vmax": high}
    with page_figure(
        7.2,
        mosaic=[["solid"], ["above"]],
        height_ratios=[1.0, 1.1],
        per_subplot_kw={"solid": {"projection": "3d"}},
    ) as (figure, axes):
        solid, above = axes["solid"], axes["above"]
        if len(shown):
            solid.plot_trisurf(
                nodes[:, 0], nodes[:, 1], nodes[:, 2], triangles=shown, linewidth=0.05, **shade
            )
            map_ = above.tripcolor(
                nodes[:, 0],
                nodes[:, 1],
                nodes[:, 2],
                triangles=finest.triangles,
                shading="gouraud",
                **shade,
            )
            colour_bar(above, map_, "elevation z, m")
            above.add_collection(
                LineCollection(
                    list(_region_border(finest)),
                    colors="white",
                    linewidths=0.9,
                    label="border of the region",
                )
            )
        scatter_3d(solid, nodes[kept & point] + [0, 0, 0.05], color=NODE, s=2.0)
        solid_axes(solid, nodes[kept], "(a) In 3-D, in the colours of (b)")
        dots(above, nodes[point], s=1.5, color=NODE, zorder=3, label="intervisibility point")
        mark_viewpoint(above, finest.viewpoint)
        set_limits(above, finest, 95.0)
        above.set_facecolor("#eceef1")
        above.set_title("(b) From above")
        legend = above.legend(loc="upper left", facecolor="#8a9099", labelcolor="white")
        legend.get_frame().set_linewidth(0.0)
        return figure


def _region_border(analysis: Analysis) -> Float64Array:
    """(K, 2, 2) ends over the ground of the edges on the border of the region."""
    edges = border_edges(analysis.triangles[analysis.region])
    border: Float64Array = analysis.node_points[edges, :2]
    return border
