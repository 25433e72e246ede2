"""Figures 3 to 10 of the paper, from whatever frame: captions and files."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from intervis.lab.paper.curve import CurvePoint
from intervis.lab.paper.experiment import FrameExperiment
from intervis.lab.paper.plots import figure_4, figure_5, figure_9, figure_10, figure_curve
from intervis.lab.paper.scenes import figure_3, figure_6, figure_7, figure_8
from intervis.plots.style import save_figure
from intervis.settings import Settings

if TYPE_CHECKING:
    pass

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
        save_figure(figure, written[-1], "png")
        if name in PLOTS:
            save_figure(figure, folder / f"{name}.svg", "svg")
    return written


def save_curve(curve: Sequence[CurvePoint], folder: Path) -> Path:
    """Draw TPI lost against nodes, with the floor of the default tolerance, as SVG.

    Raises
    ------
    MissingExtraError
        matplotlib (extra ``plots``) is not installed.
    OutputError
        The file cannot be written.
    """
    path = folder / "granularity.svg"
    save_figure(figure_curve(curve, Settings().tpi_tolerance), path, "svg")
    return path
