"""Picture of labelled objects: boxes over the image of a frame and from above, by visible share."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from intervis.arrays import Float64Array, checked_point, finite_rows
from intervis.plots.figures import draw_image, pixels_of
from intervis.plots.style import FAINT, INK, INTERVISIBLE, NODE, dots, page_figure
from intervis.transform import transform

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from intervis.drives import Frame
    from intervis.uses.objects import ObjectSight

CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
EDGES = [(a, b) for a in range(8) for b in range(a) if bin(a ^ b).count("1") == 1]
"""Corners of a unit box, and its twelve edges."""

FARTHEST_M = 60.0
SHOWN_M = 5.0
"""Objects within the first length are drawn; the view from above has that much around them."""


def object_picture(
    frame: "Frame", objects: Sequence["ObjectSight"], viewpoint: ArrayLike
) -> "Figure":
    """The boxes of a frame: over its image, if it has one, and from above.

    Blue: at least half visible; red: at least half occluded; black: else. A star stands at the
    viewpoint (3,): sensor frame, metres.

    Raises
    ------
    MissingExtraError
        matplotlib or Pillow (extra ``plots``) is not installed.
    """
    star = checked_point(viewpoint)[:2]
    near = [one for one in objects if one.range_m < FARTHEST_M] or list(objects[:1])
    camera = frame.camera
    if camera is None or not frame.has_image:
        with page_figure(4.5) as (figure, axes):
            _draw_above(axes, frame, near, star)
            return figure
    image_in = 0.4 + 6.2 * camera.height_px / camera.width_px
    with page_figure(image_in + 4.2, nrows=2, height_ratios=[image_in, 4.2]) as (figure, axes):
        _draw_over_image(axes[0], frame, near)
        _draw_above(axes[1], frame, near, star)
        return figure


def _colour(one: "ObjectSight") -> str:
    if one.visible >= 0.5:
        return INTERVISIBLE
    return NODE if one.occluded >= 0.5 else INK


def _percent(one: "ObjectSight") -> str:
    return f"{100 * one.visible:.0f}" if np.isfinite(one.visible) else ""


def _corners(one: "ObjectSight") -> Float64Array:
    return transform(one.box.velo_from_box, CORNERS * one.box.size_m)


def _draw_over_image(axes: Any, frame: "Frame", objects: Sequence["ObjectSight"]) -> None:
    draw_image(axes, frame)
    assert frame.camera is not None
    width_px, height_px = frame.camera.width_px, frame.camera.height_px
    for one in reversed(objects):
        pixels, ahead = pixels_of(frame, _corners(one))
        if not ahead.all():
            continue
        for a, b in EDGES:
            axes.plot(*pixels[[a, b]].T, color=_colour(one), linewidth=0.8)
        column, row = pixels[:, 0].mean(), pixels[:, 1].min()
        if 0 <= column < width_px and 0 <= row < height_px:
            _write(axes, column, row - 4, one)
    axes.set(xlim=(0, width_px), ylim=(height_px, 0))
    many = "s" if len(objects) != 1 else ""
    axes.set_title(f"{len(objects)} object{many} of frame {frame.number}")


def _draw_above(
    axes: Any, frame: "Frame", objects: Sequence["ObjectSight"], star: Float64Array
) -> None:
    points = frame.points[finite_rows(frame.points)]
    dots(axes, points, s=0.6, color=FAINT)
    for one in objects:
        corners = _corners(one)[[0, 2, 6, 4, 0], :2]  # the lower four, in turn
        axes.plot(*corners.T, color=_colour(one), linewidth=0.9)
        x, y = corners[:4].mean(axis=0)
        _write(axes, x, y, one)
    dots(axes, star[None], marker="*", s=40, color=INK)
    places = np.array([one.box.velo_from_box[:2, 3] for one in objects] + [star])
    low, high = places.min(axis=0) - SHOWN_M, places.max(axis=0) + SHOWN_M
    axes.set(
        xlim=(low[0], high[0]),
        ylim=(low[1], high[1]),
        aspect="equal",
        xlabel="x forward, m",
        ylabel="y left, m",
        title="Visible, per cent. Blue: half or more; red: half or more occluded",
    )


def _write(axes: Any, x: float, y: float, one: "ObjectSight") -> None:
    from matplotlib.patheffects import withStroke

    rim = [withStroke(linewidth=1.6, foreground="white")]
    look: dict[str, Any] = {"ha": "center", "va": "bottom", "fontsize": 6.5, "clip_on": True}
    axes.text(x, y, _percent(one), color=_colour(one), path_effects=rim, **look)
