"""Pictures of one frame: camera view, scan from above, surface, intervisibility."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from intervis.arrays import BoolArray, Float64Array, finite_rows
from intervis.method.field_of_view import AZIMUTH_FOV_DEG, image_from_velo
from intervis.method.surface import chart_coordinates
from intervis.plots.style import (
    FAINT,
    INK,
    INTERVISIBLE,
    NODE,
    REGION,
    SEQUENTIAL,
    colour_bar,
    dots,
    legend_below,
    mark_viewpoint,
    page_figure,
    save_figure,
)
from intervis.progress import Progress, reporter
from intervis.transform import inverse

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from intervis.drives import Frame
    from intervis.method.analysis import Analysis

CHART_AXES = {
    "ground": ("forward of the viewpoint, m", "left of the viewpoint, m"),
    "angles": ("azimuth, rad", "elevation, rad"),
    "polar": ("azimuth, rad", "log of ground range in m"),
}
SHOWN_PERCENT = 98.0
"""Percentage of the returns that a view from above shows; outliers lie outside."""

LEAST_ASPECT = 0.9
"""Smallest ratio of the short side of a mesh view to its long side, for panels of equal size."""

MIDDLE_PERCENT = 90.0
NEAR_PERCENT = 70.0
"""Percentages of the nodes that the mesh in the overview, and the close-up, show."""


def overview(frame: "Frame", analysis: "Analysis") -> "Figure":
    """One frame in one picture: camera, scan from above, intervisibility.

    Raises
    ------
    MissingExtraError
        matplotlib or Pillow (extra ``plots``) is not installed.
    """
    if frame.camera is None:
        with page_figure(3.6, ncols=2) as (figure, axes):
            draw_scan(axes[0], frame, analysis)
            draw_intervisibility(axes[1], analysis, MIDDLE_PERCENT)
            legend_below(figure, axes[1])
            return figure
    mosaic = [["camera", "camera"], ["scan", "mesh"]]
    with page_figure(5.6, mosaic=mosaic, height_ratios=[1.0, 1.45]) as (figure, axes):
        draw_camera_view(axes["camera"], frame, analysis)
        draw_scan(axes["scan"], frame, analysis)
        draw_intervisibility(axes["mesh"], analysis, MIDDLE_PERCENT)
        legend_below(figure, axes["mesh"])
        return figure


def camera_view(frame: "Frame", analysis: "Analysis") -> "Figure":
    """The returns in view over the camera image; the frame must have a camera."""
    with page_figure(2.5) as (figure, axes):
        draw_camera_view(axes, frame, analysis)
        return figure


def scan_from_above(frame: "Frame", analysis: "Analysis") -> "Figure":
    """The whole scan from above, with the field of view."""
    with page_figure(5.8) as (figure, axes):
        draw_scan(axes, frame, analysis)
        legend_below(figure, axes)
        return figure


def surface(analysis: "Analysis") -> "Figure":
    """The manifold auxiliary surface: the nodes before and after the forces."""
    with page_figure(3.5, ncols=2) as (figure, axes):
        draw_surface(axes[0], analysis)
        draw_displacement(axes[1], analysis)
        legend_below(figure, axes[0])
        return figure


def intervisibility(analysis: "Analysis") -> "Figure":
    """The mesh from above with intervisibility points, edges and region, whole and close up."""
    with page_figure(3.7, ncols=2) as (figure, axes):
        draw_intervisibility(axes[0], analysis)
        draw_intervisibility(axes[1], analysis, NEAR_PERCENT, scale=2.0)
        axes[1].set_title("Close up")
        _outline(axes[0], axes[1])
        legend_below(figure, axes[1])
        return figure


def draw_camera_view(axes: Any, frame: "Frame", analysis: "Analysis") -> None:
    """Returns in view over the image, coloured by range from the viewpoint."""
    from matplotlib.colors import LogNorm

    camera = frame.camera
    assert camera is not None
    points = np.asarray(frame.points[analysis.in_view], dtype=np.float64)
    pixel, ahead = pixels_of(frame, points)
    range_m = np.linalg.norm(points[ahead] - analysis.viewpoint, axis=1)
    near_m, far_m = np.percentile(range_m, [1, 99])

    has_image = draw_image(axes, frame)
    order = np.argsort(-range_m)  # the nearest is drawn last, over the farther ones
    shown = dots(
        axes,
        pixel[order],
        c=range_m[order],
        s=1.0,
        cmap=f"{SEQUENTIAL}_r",
        norm=LogNorm(near_m, max(far_m, 1.01 * near_m)),
    )
    axes.set_title(
        f"{len(points):,} returns in view of {camera.name or 'the camera'}"
        + ("" if has_image else " (this frame has no image)")
    )
    bar = colour_bar(axes, shown, "range, m")
    ticks = [m for m in (1, 2, 3, 5, 7, 10, 15, 20, 30, 50, 80, 120, 200) if near_m <= m <= far_m]
    bar.set_ticks(ticks, labels=[str(m) for m in ticks], minor=False)
    bar.minorticks_off()


def draw_image(axes: Any, frame: "Frame") -> bool:
    """The image of the frame, or an empty one of the camera's size; whether there is an image."""
    camera, image = frame.camera, frame.image
    assert camera is not None
    if image is None:
        axes.set_facecolor("#eceef1")
    else:
        axes.imshow(image, extent=(0, camera.width_px, camera.height_px, 0))
    axes.set(
        xlim=(0, camera.width_px),
        ylim=(camera.height_px, 0),
        aspect="equal",
        xlabel="column, px",
        ylabel="row, px",
    )
    return image is not None


def pixels_of(frame: "Frame", points: Float64Array) -> tuple[Float64Array, BoolArray]:
    """(K, 2) pixels of the points in front of the camera, and the (N,) mask of these points."""
    assert frame.camera is not None
    assert frame.cam_from_velo is not None
    matrix = image_from_velo(frame.camera, frame.cam_from_velo)
    projected = points @ matrix[:, :3].T + matrix[:, 3]
    ahead = projected[:, 2] > 0
    return projected[ahead, :2] / projected[ahead, 2:], ahead


def draw_scan(axes: Any, frame: "Frame", analysis: "Analysis") -> None:
    """The whole scan from above: returns in view coloured by elevation, the others grey."""
    outside = finite_rows(frame.points)
    count = int(outside.sum())
    reach_m = np.percentile(np.abs(frame.points[outside, :2]).max(axis=1), SHOWN_PERCENT)
    outside[analysis.in_view] = False
    inside = frame.points[analysis.in_view]
    low, high = np.percentile(inside[:, 2], [1, 99])
    if outside.any():
        dots(axes, frame.points[outside], s=0.15, color=FAINT, label="returns out of view")
    shown = dots(
        axes,
        inside,
        c=inside[:, 2],
        s=0.3,
        cmap=SEQUENTIAL,
        vmin=low,
        vmax=high,
        label="returns in view",
    )
    for nth, border in enumerate(_view_borders(frame, analysis, 3 * reach_m)):
        label = "_" if nth else "border of the view"
        axes.plot(border[:, 0], border[:, 1], color=INK, linewidth=0.8, label=label)
    mark_viewpoint(axes, analysis.viewpoint)
    _top_view(axes, (-reach_m, reach_m), (-reach_m, reach_m))
    axes.set_title(f"Scan from above: {count:,} returns")
    colour_bar(axes, shown, "elevation z, m")


def draw_surface(axes: Any, analysis: "Analysis") -> None:
    """Nodes in the chart before and after the displacement by the forces."""
    from matplotlib.collections import LineCollection

    before = _undisplaced_chart(analysis)
    dots(axes, before, s=3, color="#9aa1ab", label="node as measured")
    moves = np.stack([before, analysis.chart], axis=1)
    axes.add_collection(LineCollection(list(moves), colors="#9aa1ab", linewidths=0.4))
    shown = dots(
        axes,
        analysis.chart,
        c=analysis.flow_distance,
        cmap=SEQUENTIAL,
        s=5,
        label="node on the auxiliary surface",
    )
    horizontal, vertical = CHART_AXES[analysis.settings.chart]
    axes.set(xlabel=horizontal, ylabel=vertical, title="Manifold auxiliary surface")
    if analysis.settings.chart == "ground":
        both = np.vstack([before, analysis.chart])
        x, y = _extent(both, np.zeros(2), 100.0)
        axes.set(xlim=x, ylim=y, aspect="equal", anchor="N")
    colour_bar(axes, shown, f"flow distance D′, {_unit(analysis)}")


def draw_displacement(axes: Any, analysis: "Analysis") -> None:
    """Displacement of each node in the chart, over its ground range."""
    before = _undisplaced_chart(analysis)
    offset = analysis.node_points[:, :2] - analysis.viewpoint[:2]
    range_m = np.linalg.norm(offset, axis=1)
    if analysis.settings.chart == "ground":
        moved = np.linalg.norm(analysis.chart, axis=1) - np.linalg.norm(before, axis=1)
    else:
        moved = analysis.chart[:, 1] - before[:, 1]
    axes.axhline(0.0, color=FAINT, linewidth=0.8, zorder=0)
    dots(axes, np.column_stack([range_m, moved]), c=analysis.flow_distance, cmap=SEQUENTIAL, s=5)
    axes.set(
        xlabel="ground range from the viewpoint, m",
        ylabel="outward displacement, m"
        if analysis.settings.chart == "ground"
        else "displacement along the second chart axis",
        title="Displacement by the forces",
    )


def draw_intervisibility(
    axes: Any, analysis: "Analysis", percent: float = 100.0, scale: float = 1.0
) -> None:
    """The mesh from above, with the intervisible nodes and edges of Algorithm 1.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
    analysis : Analysis
    percent : float
        Percentage of the nodes, nearest first, that the view shows.
    scale : float
        Size of dots and lines.
    """
    from matplotlib.collections import LineCollection, PolyCollection

    ground = analysis.node_points[:, :2]
    region = list(ground[analysis.triangles[analysis.region]])
    lines, good = ground[analysis.edges], analysis.edge_intervisible
    size = scale * float(np.clip(np.sqrt(600 / max(len(ground), 1)), 0.3, 1.0))
    axes.add_collection(
        PolyCollection(region, facecolor=REGION, alpha=0.65, linewidths=0, label="region")
    )
    for chosen, colour, label in (
        (~good, FAINT, "other edge"),
        (good, INTERVISIBLE, "intervisible edge"),
    ):
        axes.add_collection(
            LineCollection(list(lines[chosen]), colors=colour, linewidths=0.5 * size, label=label)
        )
    point = analysis.node_intervisible
    dots(axes, ground[~point], s=2 * size, color="#9aa1ab", zorder=3, label="other node")
    dots(axes, ground[point], s=3 * size, color=NODE, zorder=4, label="intervisibility point")
    mark_viewpoint(axes, analysis.viewpoint)
    _top_view(axes, *_extent(ground, analysis.viewpoint, percent))
    axes.set_title(f"Intervisibility: {len(ground):,} nodes")


def save_pictures(
    frame: "Frame", analysis: "Analysis", folder: Path, *, progress: Progress | None = None
) -> list[Path]:
    """Draw all pictures of a frame as PNG files.

    Parameters
    ----------
    frame : Frame
    analysis : Analysis
        Of this frame.
    folder : Path
        Created if it does not exist.
    progress : callable, optional
        Called after each picture with its name.

    Returns
    -------
    list of Path
        The files written; without ``camera.png`` if the frame has no camera.

    Raises
    ------
    MissingExtraError
        matplotlib or Pillow (extra ``plots``) is not installed.
    OutputError
        A file cannot be written.
    """
    progress = reporter(progress)
    pictures: dict[str, Callable[[], Figure]] = {"overview": lambda: overview(frame, analysis)}
    if frame.camera is not None:
        pictures["camera"] = lambda: camera_view(frame, analysis)
    pictures["scan"] = lambda: scan_from_above(frame, analysis)
    pictures["surface"] = lambda: surface(analysis)
    pictures["intervisibility"] = lambda: intervisibility(analysis)
    written = []
    for name, draw in pictures.items():
        figure, path = draw(), folder / f"{name}.png"
        folder.mkdir(parents=True, exist_ok=True)
        save_figure(figure, path)
        written.append(path)
        progress(name)
    return written


def _undisplaced_chart(analysis: "Analysis") -> Float64Array:
    """(V, 2) chart coordinates of the nodes without forces."""
    still = np.zeros_like(analysis.node_points)
    return chart_coordinates(
        analysis.node_points, still, analysis.viewpoint, analysis.settings.chart
    )


def _unit(analysis: "Analysis") -> str:
    return "m" if analysis.metric in ("euclidean", "ground") else "whitened units"


def _extent(
    ground: Float64Array, viewpoint: Float64Array, percent: float
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Limits in x and y: the viewpoint and this percentage of the nodes, nearest first."""
    range_m = np.linalg.norm(ground - viewpoint[:2], axis=1)
    kept = np.vstack([ground[range_m <= np.percentile(range_m, percent)], viewpoint[:2]])
    low, high = kept.min(axis=0), kept.max(axis=0)
    middle, half = (low + high) / 2, 0.54 * (high - low) + 0.5
    half = np.maximum(half, LEAST_ASPECT * half.max())
    low, high = middle - half, middle + half
    return (low[0], high[0]), (low[1], high[1])


def _outline(axes: Any, close_up: Any) -> None:
    """Draw the limits of a close-up as a rectangle on another view from above."""
    from matplotlib.patches import Rectangle

    (x0, x1), (y0, y1) = close_up.get_xlim(), close_up.get_ylim()
    axes.add_patch(
        Rectangle((x0, y0), x1 - x0, y1 - y0, fill=False, edgecolor=INK, linewidth=0.8, zorder=6)
    )


def _view_borders(frame: "Frame", analysis: "Analysis", far_m: float) -> list[Float64Array]:
    """Borders of the field of view from above, (2, 2) lines; none for a full circle."""
    view = analysis.settings.view
    if view == "camera" and frame.camera is not None and frame.cam_from_velo is not None:
        camera, velo_from_cam = frame.camera, inverse(frame.cam_from_velo)
        centre = frame.viewpoint_velo
        sides = []
        for column in (0.0, float(camera.width_px)):
            ray_cam = np.linalg.solve(camera.projection[:, :3], [column, camera.cy_px, 1.0])
            ray = velo_from_cam[:3, :3] @ (ray_cam / np.linalg.norm(ray_cam))
            sides.append(np.array([centre[:2], centre[:2] + far_m * ray[:2]]))
        return sides
    half_rad = np.radians(AZIMUTH_FOV_DEG.get(view, 360.0)) / 2
    if half_rad >= np.pi:
        return []
    ends = [[np.cos(side), np.sin(side)] for side in (half_rad, -half_rad)]
    return [np.array([[0.0, 0.0], far_m * np.array(end)]) for end in ends]


def _top_view(axes: Any, x: tuple[float, float], y: tuple[float, float]) -> None:
    axes.set(xlim=x, ylim=y, aspect="equal", xlabel="x forward, m", ylabel="y left, m")
    axes.set_anchor("N")
