"""Figures 4, 5, 9 and 10 of the paper: spectra, and values and times against granularity."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from intervis.arrays import Float64Array
from intervis.lab.paper import printed_values
from intervis.lab.paper.curve import CurvePoint
from intervis.lab.paper.experiment import FrameExperiment
from intervis.lab.paper.spectra import Spectrum, power_spectra
from intervis.lab.paper.views import (
    scatter_3d,
    solid_axes,
    solid_bar,
    without_outliers,
)
from intervis.method.granularity import TPI_LOST, floor_nodes
from intervis.plots.style import (
    FAINT,
    INK,
    INTERVISIBLE,
    NODE,
    SEQUENTIAL,
    legend_below,
    page_figure,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PRINTED = "#b5591c"
"""Colour of the values that the paper prints."""


def figure_4(result: FrameExperiment) -> "Figure":
    """Nodes in the field of view, and their spectra."""
    nodes = result.finest.node_points
    return _points_and_spectra(
        nodes,
        nodes[:, 2],
        "elevation z, m",
        f"(a) {len(nodes):,} nodes of {result.finest.measures.n_fov:,} returns in view"
        f" (tau = {result.finest.settings.tau})",
        power_spectra(nodes),
        None,
    )


def figure_5(result: FrameExperiment) -> "Figure":
    """The manifold auxiliary surface, and its spectra with those of the nodes."""
    finest = result.finest
    surface = np.column_stack([finest.chart, finest.node_points[:, 2] - finest.viewpoint[2]])
    return _points_and_spectra(
        surface,
        finest.flow_distance,
        "flow distance D′" + (", m" if finest.metric in ("ground", "euclidean") else ""),
        f"(a) Manifold auxiliary surface: {len(surface):,} nodes",
        power_spectra(surface),
        power_spectra(finest.node_points),
        finest.settings.chart,
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
        kept = without_outliers(points)
        shown = scatter_3d(solid, points[kept], c=colour[kept], cmap=SEQUENTIAL, s=2.0)
        solid_axes(solid, points[kept], title)
        if chart != "ground":
            solid.set(xlabel="first chart axis", ylabel="second chart axis")
        solid_bar(solid, shown, colour_label)
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
    axes.set(xlabel="frequency, cycles per node", title=f"{letter}{name}", xlim=(0, 0.5))
    if first:
        axes.set_ylabel("power, dB re m² per cycle")
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


def _draw_grid(axes: Any) -> None:
    axes.grid(visible=True, which="major", color="#eceef1", linewidth=0.6)


def figure_9(result: FrameExperiment) -> "Figure":
    """Counts and rates against granularity."""
    points = [result.sweep[tau] for tau in sorted(result.sweep)]
    taus = [point.tau for point in points]
    with page_figure(3.4, ncols=2) as (figure, axes):
        counts, rates = axes
        for label, colour, values in (
            ("SNP", INTERVISIBLE, [point.measures.SP for point in points]),
            ("MESH", "#4f9d69", [point.measures.N for point in points]),
            ("NODE", PRINTED, [point.measures.n for point in points]),
            ("TPI", NODE, [point.intervisible for point in points]),
        ):
            counts.plot(taus, values, color=colour, linewidth=1.3, label=label)
        counts.set(
            yscale="log",
            xlim=(0, 100),
            xlabel="granularity tau, returns per kernel",
            ylabel="number",
            title="Counts",
        )
        _draw_grid(counts)
        counts.legend(frameon=False, ncols=2)
        rates.plot(
            taus,
            [
                printed_values.ceiling_of_tpi(point.measures.n - point.copies, point.measures.N)
                for point in points
            ],
            color=INK,
            linewidth=0.9,
            linestyle="--",
            label="ceiling SP / (3 N)",
        )
        rates.plot(
            taus,
            [point.measures.TPI for point in points],
            color=NODE,
            linewidth=1.3,
            label="TPI, this frame",
        )
        rates.plot(
            printed_values.TAUS,
            [row.TPI for row in printed_values.TABLE_2.values()],
            "o",
            color=PRINTED,
            markersize=4,
            label="TPI, paper's Table 2",
        )
        rates.set(
            xlim=(0, 102),
            ylim=(0, 56),
            xlabel="granularity tau, returns per kernel",
            ylabel="TPI, %",
            title="Rate",
        )
        _draw_grid(rates)
        rates.legend(frameon=False, loc="lower left")
        return figure


def figure_10(result: FrameExperiment) -> "Figure":
    """Time of the stages against granularity."""
    points = [result.sweep[tau] for tau in sorted(result.sweep)]
    taus = [point.tau for point in points]
    with page_figure(3.8) as (figure, axes):
        for stage, label, colour, style in (
            ("total", "all stages", INK, "-"),
            ("S1", "S1 auxiliary surface", INTERVISIBLE, "-"),
            ("S2", "S2 finite elements", "#4f9d69", "-"),
            ("S3", "S3 intervisibility", NODE, "-"),
            ("sampling", "sampling", "#7a6fb0", "--"),
            ("fov", "field of view", "#8a9099", "--"),
        ):
            values = [1e3 * max(point.times[stage], 1e-7) for point in points]
            axes.plot(taus, values, color=colour, linestyle=style, linewidth=1.2, label=label)
        axes.plot(
            printed_values.TAUS,
            [1e3 * row.ATIME for row in printed_values.TABLE_3.values()],
            "o",
            color=PRINTED,
            markersize=4,
            label="paper, S1 + S2 + S3",
        )
        axes.axhline(1e3 / printed_values.CAMERA_HZ, color="#8a9099", linewidth=0.7, linestyle=":")
        axes.text(
            101,
            0.94e3 / printed_values.CAMERA_HZ,
            "one period at 25 fps",
            ha="right",
            va="top",
            fontsize=7,
        )
        axes.set(
            yscale="log",
            xlim=(0, 102),
            xlabel="granularity tau, returns per kernel",
            ylabel="time, ms",
            title="Time by stage",
        )
        _draw_grid(axes)
        legend_below(figure, axes, 4)
        return figure


def figure_curve(points: Sequence[CurvePoint], tolerance: float) -> "Figure":
    """TPI lost against nodes, and the least number of nodes for a tolerance of TPI."""
    nodes = [point.nodes for point in points]
    floor = floor_nodes(tolerance)
    with page_figure(3.2) as (figure, axes):
        axes.plot(
            nodes,
            [point.most_lost for point in points],
            color=FAINT,
            linewidth=1.2,
            label="greatest of the frames",
        )
        axes.plot(
            nodes,
            [point.mean_lost for point in points],
            "o-",
            color=NODE,
            linewidth=1.3,
            markersize=3,
            label="mean of the frames",
        )
        axes.plot(
            *zip(*TPI_LOST, strict=True),
            color=INTERVISIBLE,
            linewidth=1.0,
            linestyle="--",
            label="curve used by tau = auto",
        )
        axes.axvline(floor, color=INK, linewidth=0.7, linestyle=":")
        axes.text(
            1.04 * floor,
            0.75 * max(point.most_lost for point in points),
            f"at least {floor} nodes for\na tolerance of {tolerance:g} points",
            fontsize=7,
        )
        axes.set(
            xscale="log",
            xlabel="nodes",
            ylabel="TPI lost, points",
            title="TPI lost by coarser sampling",
        )
        _draw_grid(axes)
        axes.legend(frameon=False, loc="upper right")
        return figure
