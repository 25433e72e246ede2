"""Figures 3 to 10 of the paper, from whatever frame."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from intervis.arrays import BoolArray, Float64Array, finite_rows
from intervis.method.analysis import Analysis
from intervis.report.figures import SHOWN_PERCENT, draw_camera_view
from intervis.report.style import (
    DPI,
    FAINT,
    INK,
    INTERVISIBLE,
    NODE,
    REGION,
    SEQUENTIAL,
    colour_bar,
    dots,
    page_figure,
)
from intervis.reproduction import paper
from intervis.reproduction.experiment import FrameExperiment
from intervis.reproduction.spectra import Spectrum, power_spectra
from intervis.results import write_whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MARK = "#b5591c"
"""Colour of what the paper prints, beside what was measured."""

PLOTS = ("figure-04", "figure-05", "figure-09", "figure-10")
"""Figures that are plots: written as SVG as well."""

CAPTIONS = {
    "figure-03": (
        "Figure 3. Acquired data",
        "The camera's view with the returns that fall into it, and the whole scan from above.",
    ),
    "figure-04": (
        "Figure 4. Sampling of the field of view, and its spectra",
        "(a) One node for each spherical kernel. (b) Power spectra of the nodes' coordinates in the"
        " order of the scan: periodogram (faint) and Welch's average over segments.",
    ),
    "figure-05": (
        "Figure 5. Manifold auxiliary surface, and its spectra",
        "(a) The nodes where cohesion and repulsion put them, coloured by flow distance from the"
        " viewpoint. (b) The same spectra as in Figure 4; the line of Figure 4 is dashed.",
    ),
    "figure-06": (
        "Figure 6. Finite elements with intervisibility",
        "All edges of the mesh, the intervisible ones, and the tree that the viewpoint reaches"
        " along them; on the right the near part, enlarged.",
    ),
    "figure-07": (
        "Figure 7. Intervisibility over the field of view",
        "Intervisible edges coloured by the difference in elevation of their ends, over the returns"
        " in view; the red dots are the intervisibility points.",
    ),
    "figure-08": (
        "Figure 8. Intervisibility terrain map",
        "Finite elements shaded by elevation, with the intervisibility points, in 3-D and from"
        " above; the outlined area is the intervisible region.",
    ),
    "figure-09": (
        "Figure 9. Values against granularity",
        "Left: MESH finite elements, NODE nodes, TPI intervisible edges, SNP judged pairs. Right:"
        " the rate TPI of Table 2, its ceiling, and the paper's values.",
    ),
    "figure-10": (
        "Figure 10. Time against granularity",
        "The least of five runs for each stage, and the paper's mean TIME of ten runs (in MATLAB,"
        " on another machine).",
    ),
}
"""Heading and caption by the name of the file."""


def save_paper_figures(result: FrameExperiment, folder: Path) -> list[Path]:
    """Draw Figures 3 to 10.

    Returns
    -------
    list of Path
        The PNG files, in order; SVG files lie beside the plots.

    Raises
    ------
    MissingExtraError
        matplotlib or Pillow (extra ``plots``) is not installed.
    OutputError
        A file cannot be written.
    """
    draw = {
        "figure-03": figure_3,
        "figure-04": figure_4,
        "figure-05": figure_5,
        "figure-06": figure_6,
        "figure-07": figure_7,
        "figure-08": figure_8,
        "figure-09": figure_9,
        "figure-10": figure_10,
    }
    written = []
    for name, make in draw.items():
        figure = make(result)
        written.append(folder / f"{name}.png")
        _save(figure, written[-1], "png")
        if name in PLOTS:
            _save(figure, folder / f"{name}.svg", "svg")
    return written


def _save(figure: "Figure", path: Path, kind: str) -> None:
    write_whole(path, lambda file: figure.savefig(file, format=kind, dpi=DPI, facecolor="white"))


def figure_3(result: FrameExperiment) -> "Figure":
    """Camera view, and the scan from above coloured by echo intensity."""
    frame = result.frame
    if frame.camera is None:
        with page_figure(5.6) as (figure, axes):
            _draw_echoes(axes, result)
            return figure
    with page_figure(8.0, nrows=2, height_ratios=[1.0, 2.5]) as (figure, axes):
        draw_camera_view(axes[0], frame, result.fine)
        axes[0].set_title(f"(a) Camera: {axes[0].get_title(loc='left')}")
        _draw_echoes(axes[1], result, "(b) ")
        return figure


def _draw_echoes(axes: Any, result: FrameExperiment, letter: str = "") -> None:
    frame = result.frame
    rows = finite_rows(frame.points)
    points, echo = frame.points[rows], frame.attributes.get("intensity")
    value = points[:, 2] if echo is None else np.asarray(echo)[rows]
    low, high = np.percentile(value, [1, 99])
    reach_m = float(np.percentile(np.abs(points[:, :2]).max(axis=1), SHOWN_PERCENT))
    shown = dots(
        axes, points, c=value, s=0.4, cmap=SEQUENTIAL, vmin=low, vmax=max(high, low + 1e-6)
    )
    _mark(axes, result.fine.viewpoint)
    axes.set(
        xlim=(-reach_m, reach_m),
        ylim=(-reach_m, reach_m),
        aspect="equal",
        xlabel="x forward, m",
        ylabel="y left, m",
        title=f"{letter}Scan from above: {len(points):,} returns",
    )
    colour_bar(axes, shown, "elevation z, m" if echo is None else "echo intensity")


def figure_4(result: FrameExperiment) -> "Figure":
    """Nodes in the field of view, and their spectra."""
    nodes = result.fine.node_points
    return _points_and_spectra(
        nodes,
        nodes[:, 2],
        "elevation z, m",
        f"(a) {len(nodes):,} nodes of {result.fine.measures.n_fov:,} returns in view"
        f" (tau = {result.fine.settings.tau})",
        power_spectra(nodes),
        None,
    )


def figure_5(result: FrameExperiment) -> "Figure":
    """The manifold auxiliary surface, and its spectra beside those of the nodes."""
    fine = result.fine
    surface = np.column_stack([fine.chart, fine.node_points[:, 2] - fine.viewpoint[2]])
    return _points_and_spectra(
        surface,
        fine.flow_distance,
        "flow distance D′" + (", m" if fine.metric in ("ground", "euclidean") else ""),
        f"(a) Manifold auxiliary surface: {len(surface):,} nodes",
        power_spectra(surface),
        power_spectra(fine.node_points),
        fine.settings.chart,
    )


def _points_and_spectra(
    points: Float64Array,
    colour: Float64Array,
    colour_label: str,
    title: str,
    spectra: tuple[Spectrum, ...],
    earlier: tuple[Spectrum, ...] | None,
    chart: str = "ground",
) -> "Figure":
    mosaic = [["points"] * 3, ["x", "y", "z"]]
    with page_figure(
        6.2,
        mosaic=mosaic,
        height_ratios=[1.9, 1.0],
        per_subplot_kw={"points": {"projection": "3d"}},
    ) as (figure, axes):
        solid = axes["points"]
        kept = _inside(points)
        shown = _scatter_3d(solid, points[kept], c=colour[kept], cmap=SEQUENTIAL, s=2.0)
        _solid_axes(solid, points[kept], title)
        if chart != "ground":
            solid.set(xlabel="first chart axis", ylabel="second chart axis")
        _solid_bar(solid, shown, colour_label)
        names = "xyz" if chart == "ground" else ("1st axis", "2nd axis", "z")
        for k, name in enumerate("xyz"):
            _draw_spectrum(
                axes[name], spectra[k], None if earlier is None else earlier[k], names[k], k == 0
            )
        return figure


def _draw_spectrum(
    axes: Any, spectrum: Spectrum, earlier: Spectrum | None, name: str, first: bool
) -> None:
    letter = "(b) " if first else ""
    axes.set(xlabel="frequency, cycles a node", title=f"{letter}{name}", xlim=(0, 0.5))
    if first:
        axes.set_ylabel("power, dB of m² a cycle")
    if len(spectrum.power) == 0:
        axes.text(0.5, 0.5, "too few nodes", ha="center", transform=axes.transAxes)
        return
    axes.plot(spectrum.frequency[1:], _decibel(spectrum.power[1:]), color=FAINT, linewidth=0.4)
    axes.plot(
        spectrum.smooth_frequency[1:],
        _decibel(spectrum.smooth_power[1:]),
        color=INTERVISIBLE,
        linewidth=1.2,
    )
    if earlier is not None and len(earlier.power):
        axes.plot(
            earlier.smooth_frequency[1:],
            _decibel(earlier.smooth_power[1:]),
            color=INK,
            linewidth=0.7,
            linestyle=(0, (2, 4)),
        )
    smooth = _decibel(spectrum.smooth_power[1:])
    axes.set_ylim(smooth.min() - 25, smooth.max() + 12)
    axes.text(
        0.97,
        0.95,
        f"flatness {spectrum.flatness:.3f}",
        ha="right",
        va="top",
        fontsize=7,
        transform=axes.transAxes,
    )


def _decibel(power: Float64Array) -> Float64Array:
    decibel: Float64Array = 10 * np.log10(np.maximum(power, np.finfo(np.float64).tiny))
    return decibel


def figure_6(result: FrameExperiment) -> "Figure":
    """The mesh, its intervisible edges and the tree, whole and close up."""
    with page_figure(4.1, ncols=2) as (figure, axes):
        for place, percent, scale, title in (
            (axes[0], SHOWN_PERCENT, 1.0, "Whole"),
            (axes[1], 60.0, 1.8, "Near part"),
        ):
            _draw_topology(place, result.fine, scale)
            _limits(place, result.fine, percent, square=True)
            place.set_title(title)
        _legend(figure, axes[0], 3)
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
    _mark(axes, analysis.viewpoint)


def figure_7(result: FrameExperiment) -> "Figure":
    """Intervisible edges by difference in elevation, in 3-D and from above."""
    from matplotlib.collections import LineCollection
    from mpl_toolkits.mplot3d.art3d import Line3DCollection

    fine = result.fine
    nodes, kept = fine.node_points, _inside(fine.node_points)
    pairs = fine.edges[fine.edge_intervisible]
    step_m = np.abs(nodes[pairs[:, 0], 2] - nodes[pairs[:, 1], 2])
    high = float(np.percentile(step_m, 98)) if len(step_m) else 1.0
    point = fine.node_intervisible
    scan = result.frame.points[fine.in_view]
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
            lines_3d.set_array(step_m[both])
            lines_3d.set_clim(0, high)
            solid.add_collection3d(lines_3d)
        _scatter_3d(solid, nodes[point & kept], color=NODE, s=2.0)
        _solid_axes(solid, nodes[kept], "(a) In 3-D")
        dots(above, scan, s=0.4, color="#9aa1ab", label="return in view")
        lines = LineCollection(list(nodes[pairs][:, :, :2]), **limits)
        lines.set_array(step_m)
        lines.set_clim(0, high)
        above.add_collection(lines)
        dots(above, nodes[point], s=1.5, color=NODE, zorder=3, label="intervisibility point")
        _mark(above, fine.viewpoint)
        _limits(above, fine, 95.0)
        above.set_title("(b) From above")
        colour_bar(above, lines, "elevation distance |Δz| of an edge, m")
        _legend(figure, above, 3)
        return figure


def figure_8(result: FrameExperiment) -> "Figure":
    """Terrain map: elements shaded by elevation, in 3-D and from above."""
    from matplotlib.collections import LineCollection

    fine = result.fine
    nodes, point = fine.node_points, fine.node_intervisible
    low, high = np.percentile(nodes[:, 2], [1, 99])
    reach = _reach(fine, 95.0)
    kept = (_ground_range(fine) <= reach) & _inside(nodes)
    shown = fine.triangles[kept[fine.triangles].all(axis=1)]
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
                triangles=fine.triangles,
                shading="gouraud",
                **shade,
            )
            colour_bar(above, map_, "elevation z, m")
            above.add_collection(
                LineCollection(
                    list(_rim(fine)), colors="white", linewidths=0.9, label="rim of the region"
                )
            )
        _scatter_3d(solid, nodes[kept & point] + [0, 0, 0.05], color=NODE, s=2.0)
        _solid_axes(solid, nodes[kept], "(a) In 3-D, in the colours of (b)")
        dots(above, nodes[point], s=1.5, color=NODE, zorder=3, label="intervisibility point")
        _mark(above, fine.viewpoint)
        _limits(above, fine, 95.0)
        above.set_facecolor("#eceef1")
        above.set_title("(b) From above")
        legend = above.legend(loc="upper left", facecolor="#8a9099", labelcolor="white")
        legend.get_frame().set_linewidth(0.0)
        return figure


def _rim(analysis: Analysis) -> Float64Array:
    """(K, 2, 2) edges that belong to one triangle of the region only."""
    chosen = analysis.triangles[analysis.region]
    sides = np.stack([chosen, np.roll(chosen, -1, axis=1)], axis=-1).reshape(-1, 2)
    unique, count = np.unique(np.sort(sides, axis=1), axis=0, return_counts=True)
    rim: Float64Array = analysis.node_points[unique[count == 1], :2]
    return rim


def figure_9(result: FrameExperiment) -> "Figure":
    """Counts and rates against granularity."""
    steps = [result.sweep[tau] for tau in sorted(result.sweep)]
    taus = [step.tau for step in steps]
    with page_figure(3.4, ncols=2) as (figure, axes):
        counts, rates = axes
        for label, colour, values in (
            ("SNP", INTERVISIBLE, [step.measures.SP for step in steps]),
            ("MESH", "#4f9d69", [step.measures.N for step in steps]),
            ("NODE", MARK, [step.measures.n for step in steps]),
            ("TPI", NODE, [step.intervisible for step in steps]),
        ):
            counts.plot(taus, values, color=colour, linewidth=1.3, label=label)
        counts.set(
            yscale="log",
            xlim=(0, 100),
            xlabel="granularity tau, returns a kernel",
            ylabel="number",
            title="Counts",
        )
        counts.grid(visible=True, which="major", color="#eceef1", linewidth=0.6)
        counts.legend(frameon=False, ncols=2)
        rates.plot(
            taus,
            [
                paper.ceiling_of_tpi(step.measures.n - step.copies, step.measures.N)
                for step in steps
            ],
            color=INK,
            linewidth=0.9,
            linestyle="--",
            label="ceiling SP / (3 N)",
        )
        rates.plot(
            taus,
            [step.measures.TPI for step in steps],
            color=NODE,
            linewidth=1.3,
            label="TPI, this frame",
        )
        rates.plot(
            paper.TAUS,
            [row.TPI for row in paper.TABLE_2.values()],
            "o",
            color=MARK,
            markersize=4,
            label="TPI, paper's Table 2",
        )
        rates.set(
            xlim=(0, 102),
            ylim=(0, 56),
            xlabel="granularity tau, returns a kernel",
            ylabel="TPI, %",
            title="Rate",
        )
        rates.grid(visible=True, color="#eceef1", linewidth=0.6)
        rates.legend(frameon=False, loc="lower left")
        return figure


def figure_10(result: FrameExperiment) -> "Figure":
    """Time of the stages against granularity."""
    steps = [result.sweep[tau] for tau in sorted(result.sweep)]
    taus = [step.tau for step in steps]
    with page_figure(3.8) as (figure, axes):
        for stage, label, colour, style in (
            ("total", "all stages", INK, "-"),
            ("S1", "S1 auxiliary surface", INTERVISIBLE, "-"),
            ("S2", "S2 finite elements", "#4f9d69", "-"),
            ("S3", "S3 intervisibility", NODE, "-"),
            ("sampling", "sampling", "#7a6fb0", "--"),
            ("fov", "field of view", "#8a9099", "--"),
        ):
            values = [1e3 * max(step.times[stage], 1e-7) for step in steps]
            axes.plot(taus, values, color=colour, linestyle=style, linewidth=1.2, label=label)
        axes.plot(
            paper.TAUS,
            [1e3 * row.ATIME for row in paper.TABLE_3.values()],
            "o",
            color=MARK,
            markersize=4,
            label="paper, S1 + S2 + S3",
        )
        axes.axhline(1e3 / paper.CAMERA_HZ, color="#8a9099", linewidth=0.7, linestyle=":")
        axes.text(
            101, 0.94e3 / paper.CAMERA_HZ, "one period at 25 fps", ha="right", va="top", fontsize=7
        )
        axes.set(
            yscale="log",
            xlim=(0, 102),
            xlabel="granularity tau, returns a kernel",
            ylabel="time, ms",
            title="Time by stage",
        )
        axes.grid(visible=True, which="major", color="#eceef1", linewidth=0.6)
        _legend(figure, axes, 4)
        return figure


def _legend(figure: "Figure", axes: Any, columns: int) -> None:
    """A legend in rows below everything, its dots large enough to be seen."""
    handles, labels = axes.get_legend_handles_labels()
    legend = figure.legend(
        handles, labels, loc="outside lower center", ncols=columns, frameon=False
    )
    handle: Any
    for handle in legend.legend_handles:
        if hasattr(handle, "set_sizes"):
            handle.set_sizes([max(14.0, float(handle.get_sizes()[0]))])


def _scatter_3d(axes: Any, points: Float64Array, **look: Any) -> Any:
    return axes.scatter(
        points[:, 0], points[:, 1], points[:, 2], depthshade=False, **({"linewidths": 0} | look)
    )


def _inside(points: Float64Array) -> BoolArray:
    """Points that a 3-D view shows: it holds all but a few stray ones."""
    low, high = np.percentile(points, [0.5, 99.0], axis=0)
    inside: BoolArray = ((points >= low) & (points <= high)).all(axis=1)
    return inside if inside.sum() > 3 else np.ones(len(points), bool)


def _solid_axes(axes: Any, points: Float64Array, title: str) -> None:
    """A view from behind and above, elevation stretched so that steps can be seen."""
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


def _solid_bar(axes: Any, shown: Any, label: str) -> None:
    bar = axes.figure.colorbar(shown, cax=axes.inset_axes((1.22, 0.15, 0.022, 0.65)))
    bar.set_label(label, fontsize=7.0)
    bar.ax.tick_params(labelsize=7.0)
    bar.outline.set_visible(False)


def _ground_range(analysis: Analysis) -> Float64Array:
    offset = analysis.node_points[:, :2] - analysis.viewpoint[:2]
    return np.hypot(offset[:, 0], offset[:, 1])


def _reach(analysis: Analysis, percent: float) -> float:
    return float(np.percentile(_ground_range(analysis), percent))


def _limits(axes: Any, analysis: Analysis, percent: float, *, square: bool = False) -> None:
    """Limits that hold the viewpoint and the nearest nodes, with equal scales."""
    near = _ground_range(analysis) <= _reach(analysis, percent)
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


def _mark(axes: Any, viewpoint: Float64Array) -> None:
    dots(
        axes,
        viewpoint[None, :2],
        marker="*",
        s=45,
        color=INK,
        edgecolor="white",
        linewidths=0.4,
        zorder=6,
        label="viewpoint",
    )
