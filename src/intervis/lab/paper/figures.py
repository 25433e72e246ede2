"""Figures 3 to 10 of the paper from one frame: captions and files."""

from collections.abc import Sequence
from pathlib import Path

from intervis.lab.paper.curve import CurvePoint
from intervis.lab.paper.experiment import FrameExperiment
from intervis.lab.paper.plots import figure_4, figure_5, figure_9, figure_10, figure_curve
from intervis.lab.paper.scenes import figure_3, figure_6, figure_7, figure_8
from intervis.plots.style import save_figure
from intervis.settings import Settings

PLOTS = ("figure-04", "figure-05", "figure-09", "figure-10")
"""Figures that are also written as SVG."""

CAPTIONS = {
    "figure-03": (
        "Figure 3. Acquired data",
        "The camera's image with the returns in view, and the whole scan from above.",
    ),
    "figure-04": (
        "Figure 4. Sampling of the field of view, and its spectra",
        "(a) One node per spherical kernel of tau returns. (b) Power spectra of the nodes'"
        " coordinates in the order of the scan: periodogram (faint) and Welch's average over"
        " segments.",
    ),
    "figure-05": (
        "Figure 5. Manifold auxiliary surface, and its spectra",
        "(a) The nodes as displaced by cohesion and repulsion, coloured by flow distance from the"
        " viewpoint. (b) Their spectra; the dashed line is that of Figure 4.",
    ),
    "figure-06": (
        "Figure 6. Finite elements with intervisibility",
        "All edges of the mesh, the intervisible edges, and the tree of nodes that the viewpoint"
        " reaches along them; the near part is enlarged on the right.",
    ),
    "figure-07": (
        "Figure 7. Intervisibility over the field of view",
        "Intervisible edges coloured by the elevation difference of their ends, over the returns in"
        " view; the red dots are the intervisibility points.",
    ),
    "figure-08": (
        "Figure 8. Intervisibility terrain map",
        "Finite elements shaded by elevation, with the intervisibility points, in 3-D and from"
        " above; the white line is the border of the intervisible region.",
    ),
    "figure-09": (
        "Figure 9. Values against granularity",
        "Left: numbers of finite elements (MESH), nodes (NODE), intervisible edges (TPI) and tested"
        " pairs (SNP). Right: the rate TPI of Table 2, its ceiling, and the paper's values.",
    ),
    "figure-10": (
        "Figure 10. Time against granularity",
        "The least time of five runs for each stage, and the paper's mean TIME of ten runs (in"
        " MATLAB, on another machine).",
    ),
}
"""Heading and caption by file name."""


def save_paper_figures(result: FrameExperiment, folder: Path) -> list[Path]:
    """Draw Figures 3 to 10 as PNG, and the plots among them as SVG as well.

    Returns
    -------
    list of Path
        The PNG files, in order.

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
    """Draw TPI lost against nodes, and the nodes for the default tolerance, as SVG.

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
