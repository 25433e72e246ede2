"""What a page shall show: the choices of a user, and what follows for each frame."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from intervis.arguments import is_count, shown
from intervis.arrays import Float64Array
from intervis.drives import Drive, Frame
from intervis.errors import DriveError, SettingsError
from intervis.sight.occupancy_model import DEFAULT_RISK, RISK_RANGE
from intervis.sight.query_checks import finite_number
from intervis.transform import inverse, transform

Place = str | tuple[float, float, float]
"""``camera``, ``sensor``, or coordinates in the sensor frame, metres."""

BYTES_PER_RETURN = 8.0
BYTES_PER_FRAME = 90_000
"""What a frame takes in a page, for the estimate: its returns; image, mesh and blind spots."""


@dataclass(frozen=True)
class ViewRequest:
    """What a page shows.

    Attributes
    ----------
    viewpoint : str or three floats
        ``camera``, ``sensor``, or coordinates in the sensor frame, metres.
    is_fixed : bool
        Keep the viewpoint of the first frame where it is in the world, by the poses.
    ends : sequence of str or three floats
        Ends of lines that are explained in every frame.
    risk : float
        See `intervis.Scene.sight`.
    memory : int
        Scans before and after each frame that are used besides its own, where there are poses.
    most_frames, most_returns : int
        Frames of a page, and returns of a frame, at most; more are thinned evenly.
    has_blind_spots : bool
        Whether the ground around the viewpoint is judged, too.
    has_method : bool
        Whether the paper's method is applied, too.

    Raises
    ------
    SettingsError
        A number is out of range.
    """

    viewpoint: Place = "camera"
    is_fixed: bool = False
    ends: Sequence[Place] = ()
    risk: float = DEFAULT_RISK
    memory: int = 2
    most_frames: int = 24
    most_returns: int = 50_000
    has_blind_spots: bool = True
    has_method: bool = True

    def __post_init__(self) -> None:
        risk = finite_number("--risk", self.risk, f"{RISK_RANGE[0]} to {RISK_RANGE[1]}")
        object.__setattr__(self, "risk", risk)
        if not RISK_RANGE[0] <= self.risk <= RISK_RANGE[1]:
            raise SettingsError(
                f"--risk must be from {RISK_RANGE[0]} to {RISK_RANGE[1]}, got {self.risk}."
            )
        for option, value, least in (
            ("--memory", self.memory, 0),
            ("--most", self.most_frames, 1),
            ("--returns", self.most_returns, 1),
        ):
            if not is_count(value, least):
                raise SettingsError(f"{option} must be {least} or more, got {shown(value)}.")


def thinned_frames(numbers: Sequence[int], most: int) -> list[int]:
    """At most so many frame numbers, evenly chosen, the first and the last among them.

    Examples
    --------
    >>> thinned_frames(range(100), 4)
    [0, 33, 66, 99]
    """
    if len(numbers) <= most:
        return list(numbers)
    if most == 1:
        return [numbers[0]]
    return [numbers[k * (len(numbers) - 1) // (most - 1)] for k in range(most)]


def estimated_bytes(frames: int, returns: int) -> float:
    """Size of a page of so many frames with so many returns each, bytes."""
    return frames * (BYTES_PER_FRAME + BYTES_PER_RETURN * returns)


def remembered_frames(drive: Drive, number: int, memory: int) -> list[int]:
    """The frames before and after one frame whose scans are used besides its own.

    Only those that have poses; none where the frame itself has none.
    """
    poses = drive.poses or {}
    if number not in poses:
        return []
    numbers = drive.frame_numbers
    at = numbers.index(number)
    around = numbers[max(0, at - memory) : at + memory + 1]
    return [other for other in around if other != number and other in poses]


def place_in_frame(frame: Frame, place: Place) -> Float64Array:
    """(3,) a place in the sensor frame, metres.

    Raises
    ------
    DriveError
        The place is the camera, and the drive has none.
    """
    if not isinstance(place, str):
        return np.array(place, np.float64)
    if place == "sensor":
        return np.zeros(3)
    if frame.camera is None:
        raise DriveError("this drive has no camera: give --from as X,Y,Z, or sensor.")
    return frame.viewpoint_velo


def fixed_place_world(first: Frame, place: Place) -> Float64Array:
    """(3,) world coordinates of a place in the first frame.

    Raises
    ------
    DriveError
        The frame has no pose.
    """
    if first.pose is None:
        raise DriveError(
            f"--fixed keeps the viewpoint by the poses, and frame {first.number} has none."
        )
    return transform(first.pose, place_in_frame(first, place))


def viewpoint_in_frame(
    frame: Frame, place: Place, fixed_world: Float64Array | None
) -> Float64Array:
    """(3,) the viewpoint of a frame, sensor frame, metres.

    Raises
    ------
    DriveError
        The viewpoint is fixed in the world, and the frame has no pose.
    """
    if fixed_world is None:
        return place_in_frame(frame, place)
    if frame.pose is None:
        raise DriveError(
            f"--fixed keeps the viewpoint by the poses, and frame {frame.number} has none."
        )
    return np.asarray(transform(inverse(frame.pose), fixed_world).round(3))
