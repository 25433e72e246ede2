"""The reliability plot: how often points were visible that were said to be so."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

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

    from intervis.lab.truth.scores import Reliability
    from intervis.lab.truth.scoring import Evaluation


def reliability_figure(evaluations: "list[Evaluation]") -> "Figure":
    """Ours, one panel for each evaluation: said against true, and how many points said so.

    Raises
    ------
    MissingExtraError
        matplotlib (extra ``plots``) is not installed.
    """
    with page_figure(3.9, ncols=len(evaluations), squeeze=False) as (figure, axes):
        for panel, evaluation in zip(axes[0], evaluations, strict=True):
            mean = evaluation.rows[0].mean
            draw_reliability(panel, mean.reliability)
            panel.set_title(f"{evaluation.truth.split(',')[0]}, {evaluation.protocol}")
            panel.annotate(
                f"Brier {mean.brier:.3f}\nlargest gap {mean.reliability.largest_gap:.3f}",
                (0.03, 0.97),
                xycoords="axes fraction",
                va="top",
                fontsize=7.0,
            )
        legend_below(figure, axes[0, 0])
        return figure


def draw_reliability(axes: Any, bins: "Reliability") -> None:
    """Bins as bars (share of points) and dots (share that was visible) over the diagonal."""
    edges = np.linspace(0, 1, len(bins.weight) + 1)
    axes.bar(
        (edges[1:] + edges[:-1]) / 2,
        bins.weight,
        width=0.09,
        color=FAINT,
        label="share of points",
    )
    axes.plot([0, 1], [0, 1], color=INK, linewidth=0.6, label="as often as said")
    filled = bins.weight > 0
    for rows, colour, label in (
        (bins.weight >= 0.01, INTERVISIBLE, "share visible"),
        (filled & (bins.weight < 0.01), NODE, "the same, under 1 % of points"),
    ):
        axes.plot(bins.said[rows], bins.true[rows], "o", color=colour, markersize=4, label=label)
    axes.set(xlim=(0, 1), ylim=(0, 1), aspect="equal")
    axes.set(xlabel="probability said", ylabel="share")


def save_reliability(evaluations: "list[Evaluation]", path: Path) -> None:
    """Draw the plot as a PNG file.

    Raises
    ------
    MissingExtraError
        matplotlib (extra ``plots``) is not installed.
    OutputError
        The file cannot be written.
    """
    save_figure(reliability_figure(evaluations), path)
