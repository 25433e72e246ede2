"""The viewpoint of a run: P0 of each frame, in the sensor frame of that frame."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal

import numpy as np

from intervis.arrays import Float64Array, checked_point
from intervis.errors import DriveError, SettingsError
from intervis.transform import inverse, transform

if TYPE_CHECKING:
    from intervis.drives import Drive, Frame

NamedViewpoint = Literal["camera", "sensor", "start"]
Viewpoint = NamedViewpoint | Sequence[float]


class MetaViewpoint:
    """P0 of the frames of a drive.

    Parameters
    ----------
    drive : Drive
        Its first frame is read for ``"start"``.
    viewpoint : {"camera", "sensor", "start"} or three numbers
        As `intervis.run.run_drive`.

    Attributes
    ----------
    requested : str or list of float
        The viewpoint asked for.

    Raises
    ------
    SettingsError
        An unknown name.
    PointsError
        The coordinates are not three finite numbers.
    DriveError
        ``"start"``, and the first frame has no pose.
    """

    def __init__(self, drive: "Drive", viewpoint: Viewpoint) -> None:
        self.requested: str | list[float]
        self._fixed: Float64Array | None = None
        self._world: Float64Array | None = None
        if not isinstance(viewpoint, str):
            self._fixed = checked_point(viewpoint)
            self.requested = self._fixed.tolist()
            return
        self.requested = viewpoint
        if viewpoint == "sensor":
            self._fixed = np.zeros(3)
        elif viewpoint == "start":
            self._world = start_viewpoint_world(drive)
        elif viewpoint != "camera":
            raise SettingsError(
                f"the viewpoint must be camera, sensor, start or three coordinates,"
                f" got {viewpoint!r}."
            )

    def in_frame(self, frame: "Frame") -> Float64Array | None:
        """(3,) metres; None stands for the camera centre.

        Raises
        ------
        DriveError
            ``"start"``, and the frame has no pose.
        """
        if self._world is None:
            return self._fixed
        if frame.pose is None:
            raise DriveError(
                f"frame {frame.number} has no pose, so the viewpoint 'start' cannot be"
                " transformed into it."
            )
        return transform(inverse(frame.pose), self._world)


def start_viewpoint_world(drive: "Drive") -> Float64Array:
    """(3,) world coordinates of the camera centre (or sensor) in the drive's first frame, metres.

    Raises
    ------
    DriveError
        The first frame has no pose.
    """
    first = drive[min(drive.frame_numbers)]
    if first.pose is None:
        raise DriveError(
            "the viewpoint 'start' needs poses, and this drive has none: choose camera, sensor"
            " or coordinates."
        )
    return transform(first.pose, first.viewpoint_velo)
