"""Scenes of several scans of a drive, registered to one frame by the poses."""

from collections.abc import Iterable, Sequence

from intervis.drives import Drive, Frame
from intervis.errors import DriveError
from intervis.progress import Progress, reporter
from intervis.sight import Scene
from intervis.transform import inverse


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
    return scene_of_frames(now, (drive[number] for number in numbers), len(numbers), progress)


def scene_of_frames(
    now: Frame, others: Iterable[Frame], count: int, progress: Progress | None = None
) -> Scene:
    """As `registered_scene`, of at most `count` other frames that are read already.

    Raises
    ------
    DriveError
        A frame has no pose.
    """
    report = reporter(progress)
    scene = Scene(max_scans=max(64, count + 1))
    for other in others:
        if now.pose is None or other.pose is None:
            raise DriveError(
                f"--frames registers scans by their poses, and frame"
                f" {other.number if now.pose is not None else now.number} has none."
            )
        scene.add(other.points, inverse(now.pose) @ other.pose, _seconds_between(now, other))
        report(f"frame {other.number}")
    scene.add(now.points, None, 0.0)
    report(f"frame {now.number}")
    return scene


def query_moment_s(scene: Scene) -> float | None:
    """Query time of a registered scene: that of its frame, if every scan has a timestamp."""
    return None if any(time_s != time_s for time_s in scene.timestamps_s) else 0.0


def _seconds_between(now: Frame, other: Frame) -> float | None:
    """Time of a frame in seconds after frame `now`; None without timestamps."""
    if now.timestamp_ns is None or other.timestamp_ns is None:
        return None
    return 1e-9 * (other.timestamp_ns - now.timestamp_ns)
