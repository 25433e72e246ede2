"""The interactive page in a notebook: an object that Jupyter shows as the page."""

import html
from collections.abc import Sequence
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from intervis.arguments import flag_of, is_count, objects_of, shown, whole_numbers_of
from intervis.arrays import Float32Array, checked_place, checked_points
from intervis.drives import Drive, Frame
from intervis.errors import ArgumentError, PointsError, SettingsError
from intervis.sight import Scene
from intervis.sight.occupancy_model import DEFAULT_RISK
from intervis.view.frame_data import frame_data
from intervis.view.frame_judge import FrameJudge, frame_judge
from intervis.view.live_page import live_page, require_anywidget
from intervis.view.page_engine import PageEngine
from intervis.view.page_file import page_html, page_of_frames, save_page
from intervis.view.view_request import (
    Place,
    ViewRequest,
    place_in_frame,
    thinned_frames,
)

MOST_MB = 25.0
"""Pages of a notebook are no larger: it stores each, and loads all of them."""

NAMED_PLACES = ("camera", "sensor")

FARTHEST_M = 1e5
"""Coordinates of a scene that is shown: single precision is exact to a centimetre up to there."""


class NotebookPage:
    """The interactive page of `intervis view`; a notebook shows it where it is the last value.

    It is an iframe that holds the whole page (``srcdoc``): it needs no server, loads nothing, and
    can reach neither the notebook nor the network. The notebook stores it with its outputs.

    Parameters
    ----------
    content : bytes
        The page, UTF-8.
    height_px : int
        Height of the frame on the notebook's page.

    Raises
    ------
    SettingsError
        The page is too large for a notebook.
    """

    def __init__(self, content: bytes, height_px: int) -> None:
        if len(content) > 1e6 * MOST_MB:
            raise SettingsError(
                f"the page takes {len(content) / 1e6:.0f} MB, and a notebook shows up to"
                f" {MOST_MB:.0f} MB: show fewer frames or returns, or write a file with"
                " 'intervis view --html'."
            )
        self.content = content
        self.height_px = height_px

    def __repr__(self) -> str:
        return f"<NotebookPage: {len(self.content) / 1e6:.1f} MB>"

    def _repr_html_(self) -> str:
        """The page as an iframe whose scripts are cut off from the notebook."""
        page = html.escape(self.content.decode("utf-8"), quote=True)
        return (
            '<iframe sandbox="allow-scripts" title="intervis view"'
            f' style="width:100%;height:{self.height_px}px;border:0"'
            f' srcdoc="{page}"></iframe>'
        )

    def save(self, path: str | Path) -> None:
        """Write the page as a file; only an earlier page is replaced.

        Raises
        ------
        OutputError
            The file cannot be written, or another file stands there.
        """
        save_page(Path(path), self.content)


def show(
    source: Drive | Frame | Scene,
    points: ArrayLike | None = None,
    *,
    viewpoint: ArrayLike | str | None = None,
    ends: Sequence[ArrayLike] = (),
    frames: Sequence[int] | None = None,
    most_frames: int = 8,
    most_returns: int = 20_000,
    risk: float = DEFAULT_RISK,
    moment_s: float | None = None,
    height_px: int = 900,
    is_live: bool = False,
) -> Any:
    """What a viewpoint sees, as the interactive page in a notebook.

    It is a function and no method of `Scene`, because the page is built on scenes, and not the
    other way round.

    Parameters
    ----------
    source : Drive, Frame or Scene
        A drive's frames are judged with the scans around them, a frame by its own scan.
    points : (N, 3) array or None
        The points to judge, for a scene: a scene keeps range images, and no points. Scene frame,
        metres.
    viewpoint : (3,) array, ``camera``, ``sensor`` or None
        Metres, in the sensor's frame; for a scene in the scene's. None: the camera, without one the
        sensor; of a scene the place of its newest scan.
    ends : sequence of (3,) arrays
        Ends of lines that are explained, in the same frame.
    frames : sequence of int or None
        Numbers of a drive's frames; None: all, thinned evenly to `most_frames`.
    most_frames, most_returns : int
        Frames of the page, and returns of a frame, at most.
    risk : float
        See `intervis.Scene.sight`.
    moment_s : float or None
        The query time of a scene: see `intervis.Scene.sight`.
    height_px : int
        Height on the notebook's page, pixels.
    is_live : bool
        Put the engine behind the page: the viewpoint can be dragged, and lines be asked for, while
        the notebook's kernel runs. It takes anywidget (extra ``notebook``).

    Returns
    -------
    NotebookPage or anywidget.AnyWidget
        The widget with `is_live`.

    Raises
    ------
    PointsError
        A scene is given without points, points without a scene, or coordinates are not finite or
        too large.
    SettingsError
        A number is out of range, an argument is not about the source, or the page is too large for
        a notebook.
    MissingExtraError
        A live page is asked for, and anywidget is not installed.
    DriveError
        The source lacks the camera that the viewpoint needs, or a frame cannot be read.

    Examples
    --------
    >>> y, z = np.meshgrid(np.arange(-5, 5, 0.1), np.arange(-1.5, 1.5, 0.1))
    >>> wall = np.stack([np.full(y.size, 10.0), y.ravel(), z.ravel()], axis=1)
    >>> show(Scene.from_scan(wall), wall, viewpoint=[0, 2, 0])
    <NotebookPage: 0.1 MB>
    """
    is_live = flag_of(is_live, "is_live")
    if not is_count(height_px):
        raise SettingsError(f"height_px must be 1 or more, got {shown(height_px)}.")
    if not isinstance(source, Drive | Frame | Scene):
        raise ArgumentError(f"source must be a Drive, a Frame or a Scene, got {shown(source)}.")
    if frames is not None and not isinstance(source, Drive):
        raise SettingsError("frames are the frame numbers of a drive: leave them out.")
    if moment_s is not None and not isinstance(source, Scene):
        raise SettingsError("moment_s is the query time of a scene: leave it out.")
    if frames is not None:
        frames = whole_numbers_of(frames, "frames")
    if (points is None) == isinstance(source, Scene):
        raise PointsError("show takes points with a scene, and only with a scene.")
    if is_live:
        require_anywidget()
    request = ViewRequest(
        viewpoint=_viewpoint(source, viewpoint),
        ends=[_place(end) for end in cast(list[ArrayLike], objects_of(ends, object, "ends"))],
        risk=risk,
        most_frames=most_frames,
        most_returns=most_returns,
        has_method=not isinstance(source, Scene),
    )
    content, engine = _content(source, points, frames, request, moment_s, is_live=is_live)
    page = NotebookPage(content, height_px)
    return live_page(content, height_px, engine) if is_live else page


def _content(
    source: Drive | Frame | Scene,
    points: ArrayLike | None,
    frames: Sequence[int] | None,
    request: ViewRequest,
    moment_s: float | None,
    *,
    is_live: bool,
) -> tuple[bytes, PageEngine]:
    """The page, and the engine that answers its questions."""
    if isinstance(source, Drive):
        given = source.frame_numbers if frames is None else frames
        if not len(given):
            raise SettingsError("frames holds no frame number: give at least one, or None for all.")
        numbers = thinned_frames(given, request.most_frames)
        content = page_html(source, numbers, request, is_live=is_live)
        return content, PageEngine(lambda number: frame_judge(source, number, request), numbers)
    if isinstance(source, Frame):
        scene = Scene.from_scan(source.points)
        judge = FrameJudge(source, scene, request, [], None)
        name, axes = f"Frame {source.number}", "sensor's"
    else:
        assert points is not None
        judge = FrameJudge(Frame(0, _checked_near(points)), source, request, [], moment_s)
        name, axes = "Scene", "scene's"
    content = _page(judge, request, name, axes, is_live=is_live)
    return content, PageEngine(lambda number: judge, [judge.frame.number])


def _page(judge: FrameJudge, request: ViewRequest, name: str, axes: str, *, is_live: bool) -> bytes:
    """The page of one judged frame."""
    viewpoint = place_in_frame(judge.frame, request.viewpoint)
    data = frame_data(judge.judged(viewpoint))
    place = ", ".join(f"{value:g}" for value in viewpoint.round(2) + 0.0)
    scans = len(judge.scene)
    lead = (
        f"What a viewpoint at ({place}) sees: {data.header['stored']:,} points, judged by"
        f" {scans:,} scan{'' if scans == 1 else 's'}. Coordinates are metres in the {axes} frame."
    )
    return page_of_frames(name, lead, [data], request, is_live=is_live, has_command=False)


def _viewpoint(source: Drive | Frame | Scene, viewpoint: ArrayLike | str | None) -> Place:
    """The viewpoint of a request: what is given, or the source's own."""
    if isinstance(viewpoint, str):
        if viewpoint not in NAMED_PLACES or isinstance(source, Scene):
            names = "X, Y, Z" if isinstance(source, Scene) else "camera, sensor, or X, Y, Z"
            raise PointsError(f"viewpoint must be {names} in metres, got {shown(viewpoint)}.")
        return viewpoint
    if viewpoint is not None:
        return _place(viewpoint)
    if isinstance(source, Scene):
        source.packed_scans()  # which says that an empty scene cannot answer
        return _place(source.poses[-1][:3, 3])
    camera = source.camera_name if isinstance(source, Drive) else source.camera
    return "sensor" if camera is None else "camera"


def _place(point: ArrayLike) -> tuple[float, float, float]:
    x, y, z = checked_place(point, "a place").tolist()
    return x, y, z


def _checked_near(points: ArrayLike) -> Float32Array:
    """Points (N, 3), float32, whose coordinates single precision can hold to a centimetre."""
    checked = checked_points(points)
    if np.abs(checked[np.isfinite(checked)]).max(initial=0.0) > FARTHEST_M:
        raise PointsError(
            f"a scene is shown up to {FARTHEST_M / 1000:g} km from its origin: add its scans with"
            " poses relative to a place nearby."
        )
    return checked.astype(np.float32)
