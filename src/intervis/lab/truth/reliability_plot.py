"""Reliability diagrams: fraction of visible points against predicted probability."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from intervis.lab.truth.scores import MIN_BIN_FRACTION
from intervis.plots.style import (
    FAINT,
    INK,
    INTERVISIBLE,
    NODE,
    legend_below,
    page_figure,
    save_figure,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from intervis.lab.truth.results import EvaluationResult
    from intervis.lab.truth.scores import Reliability


def reliability_figure(evaluations: "list[EvaluationResult]") -> "Figure":
    """One reliability diagram of the engine for each evaluation, side by side.

    Raises
    ------
    MissingExtraError
        matplotlib (extra ``plots``) is not installed.
    """
    with page_figure(3.9, ncols=len(evaluations), squeeze=False) as (figure, axes):
        for panel, evaluation in zip(axes[0], evaluations, strict=True):
            mean = evaluation.results[0].mean
            draw_reliability(panel, mean.reliability)
            panel.set_title(f"{evaluation.ground_truth.split(',')[0]}, {evaluation.protocol}")
            panel.annotate(
                f"Brier {mean.brier:.3f}\n"
                f"max calibration error {mean.reliability.max_calibration_error:.3f}",
                (0.03, 0.97),
                xycoords="axes fraction",
                va="top",
                fontsize=7.0,
            )
        legend_below(figure, axes[0, 0])
        return figure


def draw_reliability(axes: Any, bins: "Reliability") -> None:
    """Bars: fraction of points in each bin. Dots: visible fraction, against the diagonal."""
    edges = np.linspace(0, 1, len(bins.weight) + 1)
    axes.bar(
        (edges[1:] + edges[:-1]) / 2,
        bins.weight,
        width=0.09,
        color=FAINT,
        label="fraction of points",
    )
    axes.plot([0, 1], [0, 1], color=INK, linewidth=0.6, label="perfect calibration")
    large = bins.weight >= MIN_BIN_FRACTION
    for chosen, colour, label in (
        (large, INTERVISIBLE, "visible fraction"),
        ((bins.weight > 0) & ~large, NODE, f"the same, under {MIN_BIN_FRACTION:.0%} of points"),
    ):
        axes.plot(
            bins.mean_probability[chosen],
            bins.visible_fraction[chosen],
            "o",
            color=colour,
            markersize=4,
            label=label,
        )
    axes.set(xlim=(0, 1), ylim=(0, 1), aspect="equal")
    axes.set(xlabel="predicted probability", ylabel="fraction")


def save_reliability(evaluations: "list[EvaluationResult]", path: Path) -> None:
    """Draw the diagrams to a PNG file.

    Raises
    ------
    MissingExtraError
        matplotlib (extra ``plots``) is not installed.
    OutputError
        The file cannot be written.
    """
    save_figure(reliability_figure(evaluations), path)
