"""Style of the pictures: colours, text sizes, page figures, legends and colour bars."""

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from intervis.errors import MissingExtraError
from intervis.files import write_whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SEQUENTIAL = "viridis"
REGION = "#f2b134"
INTERVISIBLE = "#0b6e8f"
NODE = "#c8385a"
FAINT = "#c6cad1"
INK = "#22262b"
WIDTH_IN = 7.0
DPI = 200
"""Page width and resolution: 1400 pixels; text stays readable at half of that."""

_TEXT: Any = {
    "font.size": 8.0,
    "axes.titlesize": 9.0,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 8.0,
    "xtick.labelsize": 7.0,
    "ytick.labelsize": 7.0,
    "legend.fontsize": 7.0,
    "axes.edgecolor": "#8a9099",
    "axes.linewidth": 0.6,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "text.color": INK,
    "axes.labelcolor": INK,
    "xtick.color": INK,
    "ytick.color": INK,
}


def require_matplotlib() -> None:
    """Raise before the work where no picture can be drawn.

    Raises
    ------
    MissingExtraError
        matplotlib (extra ``plots``) is not installed.
    """
    try:
        import matplotlib.figure  # noqa: F401
    except ImportError:
        raise MissingExtraError("matplotlib", "plots", "Drawing pictures") from None


@contextlib.contextmanager
def page_figure(height_in: float, **subplots: Any) -> Iterator[tuple["Figure", Any]]:
    """A figure of page width and its axes, without a display; the style holds in the context.

    Parameters
    ----------
    height_in : float
        Inches.
    **subplots
        For ``Figure.subplots`` or, with ``mosaic=...``, for ``Figure.subplot_mosaic``.

    Raises
    ------
    MissingExtraError
        matplotlib (extra ``plots``) is not installed.
    """
    require_matplotlib()
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with matplotlib.rc_context(_TEXT):
        figure = Figure(figsize=(WIDTH_IN, height_in), dpi=DPI, layout="constrained")
        FigureCanvasAgg(figure)
        if "mosaic" in subplots:
            yield figure, figure.subplot_mosaic(**subplots)
        else:
            yield figure, figure.subplots(**subplots)


def colour_bar(axes: Any, mapped: Any, label: str) -> Any:
    """A thin colour bar to the right of the axes, of the same height."""
    bar = axes.figure.colorbar(mapped, cax=axes.inset_axes((1.015, 0.0, 0.018, 1.0)))
    bar.set_label(label, fontsize=7.0)
    bar.ax.tick_params(labelsize=7.0)
    bar.outline.set_visible(False)
    return bar


def legend_below(figure: "Figure", axes: Any, columns: int | None = None) -> None:
    """The legend of some axes below the figure, in one row or in a number of columns."""
    handles, labels = axes.get_legend_handles_labels()
    legend = figure.legend(
        handles, labels, loc="outside lower center", ncols=columns or len(labels), frameon=False
    )
    handle: Any
    for handle in legend.legend_handles:
        if hasattr(handle, "set_sizes"):  # single dots of a dense scan are too small to be seen
            handle.set_sizes([max(14.0, float(handle.get_sizes()[0]))])


def dots(axes: Any, positions: Any, **look: Any) -> Any:
    """Borderless dots at (K, 2) positions."""
    return axes.scatter(positions[:, 0], positions[:, 1], **({"linewidths": 0} | look))


def mark_viewpoint(axes: Any, viewpoint: Any) -> None:
    """A star at the viewpoint, on a view from above."""
    look = {"color": INK, "edgecolor": "white", "linewidths": 0.4, "zorder": 6}
    dots(axes, viewpoint[None, :2], marker="*", s=40, label="viewpoint", **look)


def save_figure(figure: "Figure", path: Path, kind: str = "png") -> None:
    """Write a figure whole or not at all, as ``png`` or ``svg``.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    write_whole(path, lambda file: figure.savefig(file, format=kind, dpi=DPI, facecolor="white"))
