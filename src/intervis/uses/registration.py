"""Scenes of several scans of a drive, registered to one frame by the poses."""

from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

from intervis.arrays import Float64Array
from intervis.drives import Drive, Frame
from intervis.errors import DriveError
from intervis.progress import Progress, reporter
from intervis.sight import Scene
from intervis.transform import inverse


class RegisteredFrame(NamedTuple):
    """A frame, its pose in the sensor frame of another one (None: it is that one), and its time.

    The time is in seconds after that frame; None without timestamps.
    """

    frame: Frame
    now_from_frame: Float64Array | None
    time_s: float | None


def registered_frames(
    drive: Drive, now: Frame, numbers: Sequence[int]
) -> Iterator[RegisteredFrame]:
    """Other frames of a drive, registered to frame `now`, and `now` itself as the last one.

    Raises
    ------
    DriveError
        A frame has no pose, or cannot be read.
    """
    yield from registered_to(now, (drive[number] for number in numbers))


def registered_to(now: Frame, others: Iterable[Frame]) -> Iterator[RegisteredFrame]:
    """As `registered_frames`, of frames that are read already, or while this is iterated.

    Raises
    ------
    DriveError
        A frame has no pose.
    """
    for other in others:
        if now.pose is None or other.pose is None:
            raise DriveError(
                f"--frames registers scans by their poses, and frame"
                f" {other.number if now.pose is not None else now.number} has none."
            )
        yield RegisteredFrame(other, inverse(now.pose) @ other.pose, _seconds_between(now, other))
    yield RegisteredFrame(now, None, 0.0)


def scene_for(numbers: Sequence[int], up: Float64Array | None = None) -> Scene:
    """An empty scene that will hold a frame and so many others."""
    return Scene(max_scans=max(64, len(numbers) + 1), up=up)


def registered_scene(
    drive: Drive, now: Frame, numbers: Sequence[int], progress: Progress | None = None
) -> Scene:
    """A scene of frame `now` and other frames, in the sensor frame of `now`.

    Timestamps are seconds after frame `now`, if the drive has timestamps.

    Raises
    ------
    DriveError
        A frame has no pose, or cannot be read.
    """
    report, scene = reporter(progress), scene_for(numbers)
    for frame, now_from_frame, time_s in registered_frames(drive, now, numbers):
        scene.add(frame.points, now_from_frame, time_s)
        report(f"frame {frame.number}")
    return scene


def scene_of_frames(now: Frame, others: Sequence[Frame]) -> Scene:
    """As `registered_scene`, of frames that are read already.

    Raises
    ------
    DriveError
        A frame has no pose.
    """
    scene = scene_for([other.number for other in others])
    for frame, now_from_frame, time_s in registered_to(now, others):
        scene.add(frame.points, now_from_frame, time_s)
    return scene


def query_moment_s(scene: Scene) -> float | None:
    """Query time of a registered scene: that of its frame, if every scan has a timestamp."""
    return None if any(time_s != time_s for time_s in scene.timestamps_s) else 0.0


def _seconds_between(now: Frame, other: Frame) -> float | None:
    """Time of a frame in seconds after frame `now`; None without timestamps."""
    if now.timestamp_ns is None or other.timestamp_ns is None:
        return None
    return 1e-9 * (other.timestamp_ns - now.timestamp_ns)
