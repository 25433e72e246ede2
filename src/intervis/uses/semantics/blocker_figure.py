"""Picture of what blocks: returns from above by the class of their blocker, and the shares."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from intervis.arrays import Float64Array
from intervis.plots.style import FAINT, dots, legend_below, mark_viewpoint, page_figure
from intervis.result_table import percent
from intervis.sight import Sight
from intervis.uses.semantics.blockers import blocker_counts
from intervis.uses.semantics.classed_returns import UNLABELLED

if TYPE_CHECKING:
    from matplotlib.figure import Figure

VISIBLE_COLOUR = "#9cc9d8"
MOST_CLASSES = 6
CLASS_COLOURS = ("#c8385a", "#f2a33a", "#7b4bb5", "#1f4e9c", "#8a5a2b", "#d05ce0")
OWN_COLOURS = {"vegetation": "#2e7d32", UNLABELLED: "#6b7280"}
OTHER, OTHER_COLOUR = "other classes", "#22262b"
"""The classes that occlude most have a colour each; all others share one."""

SHOWN_M = 35.0
"""Returns within this of the viewpoint, along x and y, are drawn."""


class Panel(NamedTuple):
    """Answers for the same targets: of the scene as scanned, then without some classes.

    `classes` (M,) are those of the blockers, empty where a line is not occluded.
    """

    title: str
    sight: Sight
    classes: NDArray[np.str_]


def blocker_picture(
    targets: Float64Array, viewpoint: Float64Array, panels: Sequence[Panel]
) -> "Figure":
    """The targets from above, occluded ones by the class of what occludes them, one panel each.

    Parameters
    ----------
    targets : (M, 3) float64 array
        Sensor frame, metres.
    viewpoint : (3,) float64 array
    panels : sequence of Panel
        One or two.

    Raises
    ------
    MissingExtraError
        matplotlib (extra ``plots``) is not installed.
    """
    colours = _colours(panels)
    rows = [[f"above{n}" for n in range(len(panels))], ["bars"] * len(panels)]
    bars_in = 0.35 + 0.25 * len(panels)
    above_in = 6.2 / len(panels) + 0.4
    height_in = above_in + bars_in + 0.5
    ratios = [above_in, bars_in]
    with page_figure(height_in, mosaic=rows, height_ratios=ratios) as (figure, axes):
        for nth, panel in enumerate(panels):
            _draw_above(axes[f"above{nth}"], targets, viewpoint, panel, colours)
        _draw_bars(axes["bars"], panels, colours)
        _add_legend(figure, axes["above0"], viewpoint, colours)
        return figure


def _colours(panels: Sequence[Panel]) -> dict[str, str]:
    """Colours by class; those of the classes that occlude most, over all panels."""
    counts = blocker_counts(np.concatenate([panel.classes for panel in panels]))
    most = list(counts)[:MOST_CLASSES]
    others = iter(CLASS_COLOURS)
    chosen = {name: OWN_COLOURS.get(name) or next(others) for name in most}
    return chosen | ({OTHER: OTHER_COLOUR} if len(counts) > len(chosen) else {})


def _groups(panel: Panel, colours: dict[str, str]) -> list[tuple[str, NDArray[np.bool_]]]:
    """Masks of the targets by what is drawn of them, those that are drawn first come first."""
    named = np.where(np.isin(panel.classes, [*colours, ""]), panel.classes, OTHER)
    groups = [("unknown", panel.sight.unknown), ("visible", panel.sight.visible)]
    return groups + [(f"behind {name}", named == name) for name in colours]


def _palette(colours: dict[str, str]) -> dict[str, str]:
    of_classes = {f"behind {name}": colour for name, colour in colours.items()}
    return {"unknown": FAINT, "visible": VISIBLE_COLOUR, **of_classes}


def _draw_above(
    axes: Any,
    targets: Float64Array,
    viewpoint: Float64Array,
    panel: Panel,
    colours: dict[str, str],
) -> None:
    near = (np.abs(targets[:, :2] - viewpoint[:2]) < SHOWN_M).all(axis=1)
    for name, mask in _groups(panel, colours):
        dots(axes, targets[mask & near], s=0.7, color=_palette(colours)[name])
    mark_viewpoint(axes, viewpoint)
    x, y = viewpoint[:2]
    axes.set(
        xlim=(x - SHOWN_M, x + SHOWN_M),
        ylim=(y - SHOWN_M, y + SHOWN_M),
        aspect="equal",
        xlabel="x forward, m",
        ylabel="y left, m",
    )
    axes.set_title(panel.title[:1].upper() + panel.title[1:], pad=13)
    above = {"xycoords": "axes fraction", "textcoords": "offset points", "fontsize": 7.0}
    axes.annotate(_counts(panel.sight), (0.0, 1.0), (0.0, 4.0), **above)


def _counts(sight: Sight) -> str:
    masks = {"visible": sight.visible, "occluded": sight.occluded, "unknown": sight.unknown}
    return ", ".join(f"{percent(_share(mask))} {name}" for name, mask in masks.items())


def _share(mask: NDArray[np.bool_]) -> float:
    return float(mask.mean()) if len(mask) else 0.0


def _draw_bars(axes: Any, panels: Sequence[Panel], colours: dict[str, str]) -> None:
    """Of the lines that are occluded in the first panel: what each panel says of them."""
    asked = panels[0].sight.occluded
    for row, panel in enumerate(panels):
        unknown, visible, *behind = _groups(panel, colours)
        left = 0.0
        for name, mask in (*behind, unknown, visible):
            width = 100.0 * _share(mask[asked])
            axes.barh(-row, width, 0.7, left, color=_palette(colours)[name])
            if width >= 3.0:
                ink = "white" if name.startswith("behind") else "black"
                look: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": 6.5}
                axes.text(left + width / 2, -row, f"{width:.0f}", color=ink, **look)
            left += width
    count = int(asked.sum())
    axes.set(xlim=(0, 100), xlabel=f"per cent of the {count:,} lines that are occluded as scanned")
    names = ["as scanned", "without"][: len(panels)]
    axes.set_yticks([-row for row in range(len(panels))], names)
    for side in ("top", "right", "left"):
        axes.spines[side].set_visible(False)
    axes.tick_params(left=False)


def _add_legend(
    figure: "Figure", axes: Any, viewpoint: Float64Array, colours: dict[str, str]
) -> None:
    for name, colour in _palette(colours).items():
        dots(axes, np.full((1, 2), np.nan), s=14, color=colour, label=name)
    legend_below(figure, axes, columns=min(5, len(colours) + 3))
