"""A scene whose returns have classes: without some of them, and with the class of what blocks."""

from __future__ import annotations  # help() shows the names of the array types

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from intervis.arguments import object_of, whole_numbers_of
from intervis.arrays import BoolArray, Float64Array, IntArray, finite_rows
from intervis.drives import Drive, Frame
from intervis.errors import DriveError, SettingsError
from intervis.progress import Progress, reporter
from intervis.sight import (
    OCCLUDED,
    VISIBLE,
    Explanation,
    Scene,
    Sight,
    explain,
    sensor_of_scan,
)
from intervis.sight.occupancy_model import DEFAULT_RISK
from intervis.transform import transform
from intervis.uses.registration import (
    RegisteredFrame,
    query_moment_s,
    registered_frames,
    scene_for,
)
from intervis.uses.semantics.classed_returns import (
    NAMED_WITHIN_M,
    PARKED,
    ClassedReturns,
    check_choices,
    checked_classes,
    joined,
    no_classes,
    returns_with_classes,
)
from intervis.uses.semantics.parked import parked_tracks


@dataclass(frozen=True, eq=False)
class LabelledScene:
    """A scene of one or more frames of a drive, in the sensor frame of one of them.

    Attributes
    ----------
    scene : Scene
        Without the returns of the classes in `without`, as if these beams had not returned: for
        what takes a Scene. `sight` knows more.
    whole : Scene
        As scanned; `scene` itself where nothing is left out.
    frame : Frame
        The one whose sensor frame is that of the scenes.
    targets : (K, 3) float64 array
        The returns of `frame` that are left: finite, and of no class that was left out.
    without : tuple of str
        The classes that were left out.
    left_out : int
        Number of returns, over all frames, that were left out.
    returns : ClassedReturns or None
        The returns that are left of all frames with classes, scene frame; None where none has.
    """

    scene: Scene
    whole: Scene
    frame: Frame
    targets: Float64Array = field(repr=False)
    without: tuple[str, ...]
    left_out: int
    returns: ClassedReturns | None

    def sight(
        self, viewpoint: ArrayLike, targets: ArrayLike, *, risk: float = DEFAULT_RISK
    ) -> Sight:
        """Which targets would be visible if the classes in `without` were gone.

        The answers of `scene`, at the time of the frame if every scan has a timestamp. What was
        left out can only have occluded: a line that is visible as scanned stays visible, and one
        that is unknown does not become occluded.

        Parameters
        ----------
        viewpoint, targets, risk
            See `intervis.Scene.sight`.

        Returns
        -------
        Sight

        Raises
        ------
        PointsError, SettingsError
            As `intervis.Scene.sight`.
        """
        moment_s = query_moment_s(self.scene)
        cut = self.scene.sight(viewpoint, targets, risk=risk, moment_s=moment_s)
        if self.whole is self.scene:
            return cut
        whole = self.whole.sight(viewpoint, targets, risk=risk, moment_s=moment_s)
        kept = _stays(whole.state, whole.probability, cut.state, cut.probability)
        return Sight(
            np.where(kept, whole.state, cut.state),
            np.where(kept, whole.probability, cut.probability),
            np.where(kept[..., None], whole.blocker, cut.blocker),
            np.where(kept, whole.clearance, cut.clearance),
            np.where(kept, whole.observed, cut.observed),
        )

    def explain(
        self, viewpoint: ArrayLike, target: ArrayLike, *, risk: float = DEFAULT_RISK
    ) -> Explanation:
        """One line of `sight`, explained; see `intervis.explain`."""
        moment_s = query_moment_s(self.scene)
        cut = explain(self.scene, viewpoint, target, risk=risk, moment_s=moment_s)
        if self.whole is self.scene:
            return cut
        whole = explain(self.whole, viewpoint, target, risk=risk, moment_s=moment_s)
        kept = _stays(whole.state, whole.probability, cut.state, cut.probability)
        return whole if kept else cut

    def blocker_classes(self, sight: Sight, within_m: float = NAMED_WITHIN_M) -> NDArray[np.str_]:
        """The class of what occludes each line.

        That of the return nearest to the blocker, among those of all frames with classes.
        ``unlabelled`` is a line whose blocker has no labelled return within `within_m`, or that no
        single surface blocks.

        Parameters
        ----------
        sight : Sight
            Answers of `sight` or `scene`.
        within_m : float
            Metres.

        Returns
        -------
        array of str, of the shape of `sight`
            Empty where the line is not occluded.

        Raises
        ------
        DriveError
            The frame has neither labels nor boxes.
        SettingsError
            `within_m` is not positive and finite.
        """
        object_of(sight, Sight, "sight")
        if self.returns is None:
            raise DriveError(no_classes(self.frame))
        names = self.returns.names_at(sight.blocker, within_m)
        return np.where(sight.occluded, names, "")


def labelled_scene(
    drive: Drive,
    number: int,
    *,
    frames: Sequence[int] = (),
    without: Iterable[str] = (),
    progress: Progress | None = None,
) -> LabelledScene:
    """A scene of a frame, and maybe others, that knows classes and can leave some of them out.

    Nothing was observed behind the returns that are left out. A line through there is unknown, or
    visible or occluded where the rest of it and the prior of unobserved space decide, unless
    another frame saw past. The stated risk was calibrated on whole scans. The spacing of the beams
    is that of the whole scan. ``docs/semantics.md`` says more.

    Parameters
    ----------
    drive : Drive
    number : int
        Number of the frame whose sensor frame is the scene's.
    frames : sequence of int
        Numbers of other frames, registered to it by the poses; its own is skipped.
    without : sequence of str
        Classes as the data set names them, or ``parked CLASS``.
    progress : callable, optional
        Called with a note after each frame.

    Returns
    -------
    LabelledScene

    Raises
    ------
    DriveError
        A frame cannot be read, has no pose, or has no classes to leave out.
    SettingsError
        No frame has a class of `without`, or no return is left.

    Examples
    --------
    A hedge 8 m ahead, 1 m high, and a wall 12 m ahead:

    >>> import tempfile
    >>> from pathlib import Path
    >>> from intervis.drives import open_drive
    >>> y, z = np.meshgrid(np.arange(-5, 5, 0.05), np.arange(-1.5, 1.5, 0.05))
    >>> x = np.where(z < -0.5, 8.0, 12.0)
    >>> scan = np.stack([x, y, z, 0 * x], axis=-1).reshape(-1, 4).astype(np.float32)
    >>> labels = np.where(scan[:, 0] < 9, 70, 50).astype("<u4")  # vegetation, building
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     scan.tofile(Path(folder) / "000000.bin")
    ...     labels.tofile(Path(folder) / "000000.label")
    ...     drive = open_drive(folder)
    ...     whole = labelled_scene(drive, 0)
    ...     cut = labelled_scene(drive, 0, without=["vegetation"])
    >>> line = [0, 0, 0], [[11, 0, -1.3]]
    >>> whole.blocker_classes(whole.sight(*line)), cut.left_out
    (array(['vegetation'], dtype='<U10'), 4000)
    >>> cut.sight(*line).state  # nothing was observed behind the hedge
    array([-1], dtype=int8)
    """
    object_of(drive, Drive, "drive")
    classes, numbers = checked_classes(without), whole_numbers_of(frames, "frames")
    now = drive[number]
    others = [other for other in numbers if other != now.number]
    return scene_of_frames(drive, now, others, classes, progress)


def scene_of_frames(
    drive: Drive,
    now: Frame,
    others: Sequence[int],
    without: tuple[str, ...] = (),
    progress: Progress | None = None,
) -> LabelledScene:
    """As `labelled_scene`, of a frame that was read already."""
    report = reporter(progress)
    scene = whole = scene_for(others)
    tracks = parked_tracks(drive) if any(name.startswith(PARKED) for name in without) else {}
    parts: list[ClassedReturns] = []
    choices: list[str] = []
    left_out = 0
    for registered in registered_frames(drive, now, others):
        returns = returns_with_classes(registered.frame, tracks)
        kept = _kept(registered.frame, returns, without)
        _add(whole, registered, np.ones_like(kept))
        if without:
            # up is as the whole scan shows it: the ground may be among what is left out
            scene = scene_for(others, whole.up) if scene is whole else scene
            _add(scene, registered, kept)
        if returns is not None:
            choices += returns.choices
            parts.append(_in_scene(returns, kept, registered))
        left_out += int(np.count_nonzero(~kept))
        report(f"frame {registered.frame.number}")
    check_choices(without, choices)
    if without and not any(len(part) for part in parts):
        raise SettingsError(
            f"no return is left without {', '.join(without)}: leave out fewer classes."
        )
    targets = now.points[kept & finite_rows(now.points)].astype(np.float64)  # `now` came last
    every = joined(parts) if parts else None
    return LabelledScene(scene, whole, now, targets, without, left_out, every)


def _kept(frame: Frame, returns: ClassedReturns | None, without: tuple[str, ...]) -> BoolArray:
    """(N,) mask of the returns of a frame that are of none of the classes."""
    if returns is not None:
        return ~returns.any_of(without)
    if without:
        raise DriveError(no_classes(frame))
    return np.ones(len(frame.points), np.bool_)


def _add(scene: Scene, registered: RegisteredFrame, kept: BoolArray) -> None:
    """Add the kept returns of a scan; the beams are those of the whole scan."""
    points = registered.frame.points
    if not kept.all():
        scene.sensor = sensor_of_scan(points)
        points = points[kept]
    scene.add(points, registered.now_from_frame, registered.time_s, complete=bool(kept.all()))
    scene.sensor = None


def _stays(whole: ArrayLike, p_whole: ArrayLike, cut: ArrayLike, p_cut: ArrayLike) -> BoolArray:
    """Lines whose answer as scanned, by state and probability, is the more visible one.

    Never an occluded one: it may be occluded by what was left out.
    """
    before, after = _rank(whole), _rank(cut)
    better = (before > after) | ((before == after) & (np.asarray(p_whole) > np.asarray(p_cut)))
    return np.asarray(better & (before > 0))


def _rank(state: ArrayLike) -> IntArray:
    """Order of the states: occluded 0, unknown 1, visible 2."""
    states = np.asarray(state)
    return np.asarray((states != OCCLUDED) + (states == VISIBLE).astype(np.int64))


def _in_scene(
    returns: ClassedReturns, kept: BoolArray, registered: RegisteredFrame
) -> ClassedReturns:
    """The kept finite returns, in the frame of the scene."""
    left = returns.only(kept & finite_rows(returns.points))
    if registered.now_from_frame is None:
        return left
    return left.at(transform(registered.now_from_frame, left.points).astype(np.float32))
