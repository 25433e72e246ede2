"""One frame of a drive: a scan with its attributes, camera, image, pose and timestamp."""

from __future__ import annotations  # help() shows the names of the array types

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from intervis.arguments import mapping_of, object_of, shown, whole_numbers_of
from intervis.arrays import Float32Array, Float64Array, UInt8Array, array_of, checked_points
from intervis.camera import Camera, default_viewpoint
from intervis.drives.boxes import Box
from intervis.drives.deskew import TIME_NAMES, deskewed_points, point_times_ns
from intervis.drives.image_file import decoded_image
from intervis.drives.point_labels import read_labels
from intervis.drives.pose_track import PoseTrack
from intervis.errors import DriveError, PointsError
from intervis.result_table import result_table
from intervis.transform import checked_pose


@dataclass(frozen=True, eq=False)
class ScannerScan:
    """The scan of one scanner at the moment of a frame.

    Attributes
    ----------
    name : str
        The scanner's name, for example ``LIDAR_TOP``; empty where a drive has one scanner only.
    points : (N, 3) float32 array
        In this scanner's own frame, metres.
    attributes : mapping of str to array
        Further values of each point.
    pose : (4, 4) float64 array or None
        World from this scanner's frame, at the time of its scan.
    timestamp_ns : int or None
        Time of the scan, nanoseconds.
    """

    name: str
    points: Float32Array = field(repr=False)
    attributes: Mapping[str, NDArray[Any]] = field(default_factory=dict, repr=False)
    pose: Float64Array | None = field(default=None, repr=False)
    timestamp_ns: int | None = None


@dataclass(frozen=True, eq=False, repr=False)
class Frame:
    """One frame of a drive.

    Attributes
    ----------
    number : int
        The frame number in its drive, not a position in a list.
    points : (N, 3) float32 array
        The raw scan in the sensor's frame, metres, in the order of the file. Rows with non-finite
        coordinates are kept, so that an index into `points` is an index into the file.
    attributes : mapping of str to (N,) array
        Further values of each point (``intensity``, ``ring``, ``time`` ...).
    camera, cam_from_velo : Camera, (4, 4) float64 array, or None
        The drive's selected camera, and its rectified frame from the sensor's frame.
    pose : (4, 4) float64 array or None
        world_from_velo.
    timestamp_ns : int or None
        Time of the scan, nanoseconds.
    image_path : Path or None
        The camera's image of this frame.
    read_image : function, or None
        Reads the image where it has no file of its own: see `image`.
    scan_path : Path or None
        The file that the points were read from.
    label_path : Path or None
        The file with labels of the points (SemanticKITTI).
    scanner : str
        Name of the scanner of `points`, where the drive has several.
    read_other_scans : function, or None
        Reads the scans of the other scanners: see `scans`.
    read_boxes : function, or None
        Reads the boxes of the objects: see `boxes`.
    pose_track : PoseTrack or None
        The poses of the drive over time, for `deskewed`.
    is_deskewed : bool
        Whether the files hold points that were moved to the scan's time already.

    Examples
    --------
    >>> Frame(number=17, points=np.zeros((121_403, 3), np.float32), pose=np.eye(4))
    <Frame 17: 121,403 points, pose>
    """

    number: int
    points: Float32Array
    attributes: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    camera: Camera | None = None
    cam_from_velo: Float64Array | None = None
    pose: Float64Array | None = None
    timestamp_ns: int | None = None
    image_path: Path | None = None
    read_image: Callable[[], UInt8Array] | None = None
    scan_path: Path | None = None
    label_path: Path | None = None
    scanner: str = ""
    read_other_scans: Callable[[], tuple[ScannerScan, ...]] | None = None
    read_boxes: Callable[[], tuple[Box, ...]] | None = None
    pose_track: PoseTrack | None = None
    is_deskewed: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "number", whole_numbers_of([self.number], "number")[0])
        points = checked_points(self.points)
        if np.shape(self.points) != points.shape or not isinstance(self.points, np.ndarray):
            object.__setattr__(self, "points", points)
        if self.camera is not None:
            object_of(self.camera, Camera, "camera")
        for name in ("pose", "cam_from_velo"):
            matrix = getattr(self, name)
            if matrix is not None:
                object.__setattr__(self, name, checked_pose(matrix, name))
        if self.timestamp_ns is not None:
            (time_ns,) = whole_numbers_of([self.timestamp_ns], "timestamp_ns")
            object.__setattr__(self, "timestamp_ns", time_ns)
        if self.pose_track is not None:
            object_of(self.pose_track, PoseTrack, "pose_track")
        for name, values in mapping_of(self.attributes, "attributes").items():
            shape = array_of(values, f"the attribute {shown(name)}").shape
            if shape[:1] != (len(self.points),):
                raise PointsError(
                    f"{len(self.points)} points need as many values of {shown(name)}, got {shape}."
                )

    @property
    def timestamp_s(self) -> float | None:
        """Time of the scan, seconds; None without a timestamp, as `intervis.Scene.add` takes it."""
        return None if self.timestamp_ns is None else 1e-9 * self.timestamp_ns

    def __repr__(self) -> str:
        known = [f"{len(self.points):,} points"]
        if self.camera is not None:
            known.append(f"camera {self.camera.name}")
        known += ["image"] if self.has_image else []
        known += ["labels"] if self.label_path is not None else []
        known += ["pose"] if self.pose is not None else []
        known += ["timestamp"] if self.timestamp_ns is not None else []
        return f"<Frame {self.number}: {', '.join(known)}>"

    def _repr_html_(self) -> str:
        """What the frame holds, as a notebook shows it; nothing is read."""
        rows = {
            "points": f"{len(self.points):,}",
            "attributes": ", ".join(self.attributes) or "-",
            "camera": "-" if self.camera is None else self.camera.name,
            "image": self.image_path.name if self.image_path else "yes" if self.has_image else "-",
            "pose": "-" if self.pose is None else "yes",
            "timestamp": "-" if self.timestamp_ns is None else f"{self.timestamp_ns:,} ns",
        }
        return result_table(f"Frame {self.number}", rows)

    @property
    def viewpoint_velo(self) -> Float64Array:
        """(3,) default viewpoint, sensor frame, metres.

        The camera's centre; the sensor's origin where the frame has no camera.
        """
        return default_viewpoint(self.camera, self.cam_from_velo)

    @property
    def scans(self) -> tuple[ScannerScan, ...]:
        """The scans of all scanners at this moment, each in its own frame; `points` comes first.

        Those of other scanners are read at each access.

        Raises
        ------
        ScanError
            The scan of another scanner cannot be read.
        """
        main = ScannerScan(self.scanner, self.points, self.attributes, self.pose, self.timestamp_ns)
        return (main, *(self.read_other_scans() if self.read_other_scans else ()))

    @property
    def point_times_ns(self) -> NDArray[np.int64] | None:
        """(N,) time of each point, nanoseconds, on the clock of `timestamp_ns`.

        From the attribute that holds times (``t``, ``time``, ``timestamp``, ``offset_ns`` ...);
        their span tells the unit. None where there is none.

        Raises
        ------
        DriveError
            The times span no sweep in any unit, or are on another clock than the scan's time.
        """
        return point_times_ns(self.attributes, self.timestamp_ns)

    def deskewed(self) -> Float32Array:
        """The points as from one place: the scanner's at the scan's time, `timestamp_ns`.

        A scanner moves while it scans. Each point is moved by the motion between its own time and
        the scan's. Files that hold such points already are returned as they are.

        Returns
        -------
        (N, 3) float32 array
            In the scanner's frame at the scan's time, metres; the rows of `points`.

        Raises
        ------
        DriveError
            The points or the scan have no times, the drive has no poses with times, or these do
            not cover the scan.
        """
        if self.is_deskewed:
            return self.points
        times_ns = self.point_times_ns
        if times_ns is None or self.timestamp_ns is None:
            raise DriveError(
                f"frame {self.number} cannot be deskewed: it needs a time of the scan and of each"
                f" point, as one of the attributes {', '.join(TIME_NAMES)}."
            )
        if self.pose_track is None:
            raise DriveError(
                f"frame {self.number} cannot be deskewed: the drive has fewer than two poses with"
                " times."
            )
        return deskewed_points(self.points, times_ns, self.pose_track, self.timestamp_ns)

    @property
    def boxes(self) -> tuple[Box, ...]:
        """Boxes of the objects at this moment; read at each access, empty where there are none.

        Raises
        ------
        CalibrationError
            The labels cannot be read.
        """
        return self.read_boxes() if self.read_boxes else ()

    @property
    def point_classes(self) -> NDArray[np.uint16] | None:
        """(N,) class of each point, the lower 16 bits of SemanticKITTI's label.

        Read at each access; None where the frame has no labels.

        Raises
        ------
        ScanError
            The file of labels cannot be read, or does not fit the points.
        """
        if self.label_path is None:
            return None
        return (read_labels(self.label_path, len(self.points)) & 0xFFFF).astype(np.uint16)

    @property
    def point_instances(self) -> NDArray[np.uint16] | None:
        """(N,) instance of each point, the upper 16 bits of its label, as `point_classes`."""
        if self.label_path is None:
            return None
        return (read_labels(self.label_path, len(self.points)) >> 16).astype(np.uint16)

    @property
    def has_image(self) -> bool:
        """Whether `image` reads one."""
        return self.image_path is not None or self.read_image is not None

    @property
    def image(self) -> NDArray[np.uint8] | None:
        """(H, W, 3) uint8 RGB image, decoded at each access; None where the frame has none.

        Raises
        ------
        MissingExtraError
            Pillow (extra ``plots``) is not installed.
        DriveError
            The file is not a readable image.
        """
        if self.image_path is not None:
            return decoded_image(self.image_path, self.image_path)
        return None if self.read_image is None else self.read_image()
