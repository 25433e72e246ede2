"""Picture of sight lines: the returns of a frame by state, and one sight line."""

from typing import TYPE_CHECKING, Any

import numpy as np

from intervis.arrays import Float64Array, FloatArray, finite_rows
from intervis.plots.figures import draw_image, pixels_of
from intervis.plots.style import (
    FAINT,
    INK,
    INTERVISIBLE,
    NODE,
    dots,
    legend_below,
    mark_viewpoint,
    page_figure,
)
from intervis.result_table import percent
from intervis.sight import OCCLUDED, UNKNOWN, VISIBLE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from intervis.drives import Frame
    from intervis.sight import Explanation, Sight

STATES = {
    UNKNOWN: ("unknown", FAINT),
    OCCLUDED: ("occluded", NODE),
    VISIBLE: ("visible", INTERVISIBLE),
}
"""Label and colour of each state, in drawing order: visible returns are drawn last."""

SHOWN_M = 25.0
"""Least distance from the middle of the line to the border of the view, along x and y."""

LINE_STEPS = 200
"""Positions along a sight line that is drawn over an image, which shows only what is ahead."""

EDGE_M = 2.0
"""Margin of the view."""

LEAST_ASPECT = 0.5
"""Smallest ratio of the sides of the view; the legend needs the width."""


def sight_picture(
    frame: "Frame",
    sight: "Sight",
    viewpoint: Float64Array,
    line: "Explanation | None" = None,
    end: Float64Array | None = None,
    tilt_deg: float = 0.0,
) -> "Figure":
    """The returns of a frame by state: over its image, if it has one, and from above.

    Parameters
    ----------
    frame : Frame
        With K finite returns.
    sight : Sight
        Of the K sight lines from the viewpoint to these returns.
    viewpoint : (3,) float64 array
        Sensor frame, metres.
    line, end : Explanation and (3,) float64 array, or None
        A sight line from the viewpoint to `end`, and its explanation; drawn as well.
    tilt_deg : float
        Angle between the sensor's z axis and up, degrees. The axes of the plan are x and y of the
        sensor: it is a view from above only where this is 0, and says so otherwise.

    Raises
    ------
    MissingExtraError
        matplotlib or Pillow (extra ``plots``) is not installed.
    """
    points = frame.points[finite_rows(frame.points)].astype(np.float64)
    window = _window(points, viewpoint, viewpoint if end is None else end)
    wide_m, high_m = window[1] - window[0]
    above_in = 1.0 + 5.6 * high_m / wide_m
    camera = frame.camera
    if camera is None or not frame.has_image:
        with page_figure(above_in) as (figure, axes):
            _draw_above(axes, points, sight, viewpoint, window, line, end)
            if tilt_deg:
                axes.set_title(f"{_title(points, viewpoint)}\n{_direction(tilt_deg)}")
            legend_below(figure, axes)
            return figure
    image_in = 0.4 + 6.2 * camera.height_px / camera.width_px
    ratios = [image_in, above_in]
    with page_figure(sum(ratios), nrows=2, height_ratios=ratios) as (figure, (over, above)):
        _draw_over_image(over, frame, points, sight, viewpoint, line, end)
        _draw_above(above, points, sight, viewpoint, window, line, end)
        above.set_title(_direction(tilt_deg))
        legend_below(figure, above)
        return figure


def _draw_above(
    axes: Any,
    points: Float64Array,
    sight: "Sight",
    viewpoint: Float64Array,
    window: Float64Array,
    line: "Explanation | None",
    end: Float64Array | None,
) -> None:
    """The returns from above, and the sight line."""
    for state, (name, colour) in STATES.items():
        chosen = sight.state == state
        label = f"{name}, {percent(float(chosen.mean()))}" if len(chosen) else name
        dots(axes, points[chosen], s=1.2, color=colour, label=label)
    if line is not None and end is not None:
        _draw_line(axes, np.stack([viewpoint, end]), line.blocker[None])
    mark_viewpoint(axes, viewpoint)
    axes.set(
        xlim=window[:, 0],
        ylim=window[:, 1],
        aspect="equal",
        xlabel="x forward, m",
        ylabel="y left, m",
        title=_title(points, viewpoint),
    )


def _draw_over_image(
    axes: Any,
    frame: "Frame",
    points: Float64Array,
    sight: "Sight",
    viewpoint: Float64Array,
    line: "Explanation | None",
    end: Float64Array | None,
) -> None:
    """The returns over the image, farthest first, and the part of the sight line ahead."""
    draw_image(axes, frame)
    pixels, ahead = pixels_of(frame, points)
    order = np.argsort(-np.linalg.norm(points[ahead], axis=1), kind="stable")
    palette = np.array([STATES[state][1] for state in (UNKNOWN, OCCLUDED, VISIBLE)])
    colours = palette[sight.state[ahead][order] - UNKNOWN]
    dots(axes, pixels[order], s=1.6, color=colours)
    if line is not None and end is not None:
        along = np.linspace(0.0, 1.0, LINE_STEPS)[:, None]
        path, _ = pixels_of(frame, viewpoint + along * (end - viewpoint))
        blocker, _ = pixels_of(frame, line.blocker[None])
        _draw_line(axes, path, blocker)
    axes.set_title(_title(points, viewpoint))


def _title(points: Float64Array, viewpoint: Float64Array) -> str:
    return f"{len(points):,} returns as seen from ({_numbers(viewpoint)})"


def _direction(tilt_deg: float) -> str:
    """Where the plan looks from."""
    if not tilt_deg:
        return "From above"
    return f"Along the sensor's z axis, {tilt_deg:.0f} degrees off upright"


def _window(points: FloatArray, viewpoint: Float64Array, end: Float64Array) -> Float64Array:
    """(2, 2) lower and upper corner of the view: the line and the returns around it."""
    ends = np.stack([viewpoint, end])[:, :2].astype(np.float64)
    middle = ends.mean(axis=0)
    reach = max(SHOWN_M, 0.6 * float(np.abs(ends[1] - ends[0]).max()))
    near = points[(np.abs(points[:, :2] - middle) < reach).all(axis=1), :2]
    corners = np.vstack([ends, np.quantile(near, [0.01, 0.99], axis=0) if len(near) else ends])
    low, high = corners.min(axis=0) - EDGE_M, corners.max(axis=0) + EDGE_M
    missing = np.maximum(LEAST_ASPECT * (high - low)[::-1] - (high - low), 0.0) / 2
    return np.stack([low - missing, high + missing])


def _draw_line(axes: Any, path: Float64Array, blocker: Float64Array) -> None:
    """A sight line along positions, and its blocker (1, 2 or more), if it has one."""
    if not len(path):
        return
    from matplotlib.patheffects import withStroke

    rim = [withStroke(linewidth=2.0, foreground="white")]
    look: dict[str, Any] = {"linewidth": 0.9, "zorder": 5, "label": "sight line"}
    axes.plot(path[:, 0], path[:, 1], color=INK, path_effects=rim, **look)
    dots(axes, path[-1:], s=16, color=INK, edgecolor="white", linewidths=0.4, zorder=6)
    if np.isfinite(blocker).all():
        look = {"s": 34, "marker": "X", "color": NODE, "edgecolor": "white", "linewidths": 0.5}
        dots(axes, blocker, label="blocked here", zorder=7, **look)


def _numbers(point: Float64Array) -> str:
    return ", ".join(f"{value:.1f}" for value in point)
