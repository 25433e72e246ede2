"""Sight lines of a run: the state of every return of a frame, beside the paper's result."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from intervis.arrays import Float32Array, Float64Array, FloatArray
from intervis.errors import DriveError, SettingsError
from intervis.sight import OCCLUDED, UNKNOWN, VISIBLE, Scene
from intervis.sight.occupancy_model import DEFAULT_RISK
from intervis.sight.query_checks import thresholds_of
from intervis.transform import inverse, transform

if TYPE_CHECKING:
    from intervis.drives import Drive, Frame

SightFrom = Literal["viewpoint", "next"]
PLACES: tuple[str, ...] = get_args(SightFrom)
WORDS = {VISIBLE: "visible", OCCLUDED: "occluded", UNKNOWN: "unknown"}


@dataclass(frozen=True)
class SightRequest:
    """Which sight lines a run asks in every frame, from the scan of that frame alone.

    Parameters
    ----------
    place : {"viewpoint", "next"}
        Where the lines start: the viewpoint of the run, or the place of the scanner in the next
        frame of the drive.
    risk : float
        See `intervis.Scene.sight`.

    Raises
    ------
    SettingsError
        There is no such place, or the risk is out of range.
    """

    place: SightFrom = "viewpoint"
    risk: float = DEFAULT_RISK

    def __post_init__(self) -> None:
        if self.place not in PLACES:
            raise SettingsError(
                f"sight lines start at {' or '.join(PLACES)}, and {self.place!r} was given."
            )
        thresholds_of(self.risk)

    def described(self) -> dict[str, Any]:
        """The request as values for JSON."""
        return {"from": self.place, "risk": float(self.risk)}

    def check(self, drive: "Drive") -> None:
        """Raise where a drive cannot be asked.

        Raises
        ------
        DriveError
            The next place is asked, and the drive has no poses.
        """
        if self.place == "next" and not drive.poses:
            raise DriveError(
                f"{drive.name} has no poses, which tell where the next frame was scanned: take the"
                " sight lines from the viewpoint."
            )

    def start(self, drive: "Drive", frame: "Frame", viewpoint: Float64Array) -> Float64Array | None:
        """Where the lines of a frame start (3,), sensor frame, metres.

        None where the drive has no later frame.

        Raises
        ------
        DriveError
            The next place is asked, and this frame or the next one has no pose.
        """
        if self.place == "viewpoint":
            return viewpoint
        later = min((n for n in drive.frame_numbers if n > frame.number), default=None)
        if later is None:
            return None
        ahead = (drive.poses or {}).get(later)
        if frame.pose is None or ahead is None:
            lacking = frame.number if frame.pose is None else later
            raise DriveError(
                f"frame {lacking} has no pose, so it is not known where the frame after"
                f" {frame.number} was scanned."
            )
        return transform(inverse(frame.pose), ahead[:3, 3])


@dataclass(frozen=True, eq=False)
class FrameSight:
    """Sight lines from one place to every row of a scan.

    Attributes
    ----------
    viewpoint : (3,) float64 array
        Where the lines start, sensor frame, metres; NaN if there was no such place.
    state : (N,) int8 array
        1 visible, 0 occluded, -1 unknown; rows that are no return are unknown.
    probability : (N,) float32 array
        P(visible); NaN for rows that are no return.
    """

    viewpoint: Float64Array
    state: NDArray[np.int8]
    probability: Float32Array

    @property
    def shares(self) -> dict[str, float]:
        """Shares of the returns by state; NaN where no line was asked."""
        asked = np.isfinite(self.probability)
        return {
            word: float((self.state[asked] == state).mean()) if asked.any() else np.nan
            for state, word in WORDS.items()
        }


def sight_of_scan(points_velo: FloatArray, start: Float64Array | None, risk: float) -> FrameSight:
    """Ask every return of a scan from a place, by that scan alone.

    Parameters
    ----------
    points_velo : (N, 3) or (N, 4) float array
        Sensor frame, metres. Rows that are not finite, or 0, 0, 0, are no returns.
    start : (3,) float64 array or None
        None: all are unknown.
    risk : float

    Examples
    --------
    >>> y, z = np.meshgrid(np.arange(-5, 5, 0.04), np.arange(-1.5, 1.5, 0.06))
    >>> wall = np.stack([np.full(y.size, 10.0), y.ravel(), z.ravel()], axis=1)
    >>> scan = np.vstack([wall, [[np.nan, 0, 0], [0, 0, 0]]])
    >>> sight_of_scan(scan, np.zeros(3), 0.05).state[[0, -2, -1]]
    array([ 1, -1, -1], dtype=int8)
    """
    targets = np.array(points_velo[:, :3], np.float64)
    targets[~targets.any(axis=1)] = np.nan
    if start is None:
        none = np.full(len(targets), UNKNOWN, np.int8)
        return FrameSight(np.full(3, np.nan), none, np.full(len(targets), np.nan, np.float32))
    sight = Scene.from_scan(points_velo).sight(start, targets, risk=risk)
    return FrameSight(start, sight.state, sight.probability.astype(np.float32))
