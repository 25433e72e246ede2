"""What the writers of layouts take: a rig of sensors, then one frame after the other.

The frame of the vehicle (ego) has x forward, y left, z up, its origin on the ground below the rear
axle. A writer keeps no scan: each frame is on disk when `DriveWriter.add` returns.
"""

import io
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from intervis.arrays import Float32Array, Float64Array, IntArray
from intervis.camera import Camera
from intervis.drives.deskew import deskewed_points
from intervis.drives.pose_track import PoseTrack
from intervis.errors import MissingExtraError
from intervis.transform import inverse, transform


@dataclass(frozen=True, eq=False)
class RigScanner:
    """A scanner of the vehicle.

    Attributes
    ----------
    name : str
        Where it is mounted: ``roof``, ``left`` ...
    model : str
        For example ``HDL-32E``.
    ego_from_velo : (4, 4) float64 array
        The vehicle's frame from the scanner's.
    rows : int
        Number of its rows; 0 where it has none.
    """

    name: str
    model: str
    ego_from_velo: Float64Array = field(repr=False)
    rows: int


@dataclass(frozen=True, eq=False)
class RigCamera:
    """A camera of the vehicle without distortion: z ahead, x right, y down of the image.

    Attributes
    ----------
    name : str
        Where it looks: ``front``, ``rear``.
    camera : Camera
    ego_from_cam : (4, 4) float64 array
    """

    name: str
    camera: Camera
    ego_from_cam: Float64Array = field(repr=False)


@dataclass(frozen=True)
class Rig:
    """The sensors of a vehicle; scans and images of a frame have their order."""

    scanners: tuple[RigScanner, ...]
    cameras: tuple[RigCamera, ...] = ()


@dataclass(frozen=True, eq=False)
class ScanRecord:
    """A sweep of one scanner.

    Attributes
    ----------
    points : (N, 3) float32 array
        In the scanner's frame, each at its own time, metres.
    intensity : (N,) float32 array
        0 to 1.
    ring : (N,) int array or None
        Row of each point, 0 the highest.
    offset_ns : (N,) int64 array or None
        Time of each point after the frame's; None: all at the frame's time.
    """

    points: Float32Array
    intensity: Float32Array
    ring: IntArray | None = None
    offset_ns: IntArray | None = None


@dataclass(frozen=True, eq=False)
class ImageRecord:
    """An image: (H, W, 3) uint8 red, green, blue; its time; world_from_ego (4, 4) at that time."""

    pixels: NDArray[np.uint8] = field(repr=False)
    time_ns: int
    world_from_ego: Float64Array = field(repr=False)


@dataclass(frozen=True, eq=False)
class BoxRecord:
    """A box around an object at the frame's time.

    Attributes
    ----------
    track : str
        The same for one object in all frames.
    category : str
        ``car``, ``bicycle`` (with its rider) or ``person``.
    world_from_box : (4, 4) float64 array
        Centre at the origin, x forward, y left, z up of the object.
    size_m : (3,) float64 array
        Length, width and height.
    """

    track: str
    category: str
    world_from_box: Float64Array = field(repr=False)
    size_m: Float64Array


@dataclass(frozen=True, eq=False)
class FrameRecord:
    """All sensors at one moment.

    Attributes
    ----------
    time_ns : int
        At which the sweeps begin.
    track : PoseTrack
        world_from_ego from the frame's time to the end of its sweeps at least.
    scans : tuple of ScanRecord
    images : tuple of ImageRecord
        Empty where the drive has none.
    boxes : tuple of BoxRecord
    """

    time_ns: int
    track: PoseTrack = field(repr=False)
    scans: tuple[ScanRecord, ...]
    images: tuple[ImageRecord, ...] = ()
    boxes: tuple[BoxRecord, ...] = ()

    @property
    def world_from_ego(self) -> Float64Array:
        """Pose (4, 4) of the vehicle at the frame's time."""
        pose = self.track.at(self.time_ns)
        assert pose is not None  # the track begins there
        return pose


class DriveWriter(Protocol):
    """Writes a layout into an empty folder."""

    def add(self, frame: FrameRecord) -> None:
        """Write the next frame."""

    def close(self) -> Path:
        """Write what is known at the end only.

        Returns
        -------
        Path
            What `open_drive` takes, below the folder.
        """

    def release(self) -> None:
        """Close the files that are open, complete or not."""


def ego_points(scanner: RigScanner, scan: ScanRecord, frame: FrameRecord) -> Float64Array:
    """Points (N, 3) of a sweep in the vehicle's frame at the frame's time, each moved from its own.

    Examples
    --------
    The vehicle drives 10 m/s; what lies 5 m ahead after 0.1 s lay 6 m ahead at first:

    >>> from intervis.transform import rigid
    >>> track = PoseTrack(np.array([0, 10**9]), [np.eye(4), rigid(np.eye(3), [10.0, 0, 0])])
    >>> scan = ScanRecord(np.array([[5, 0, 0]], np.float32), np.ones(1, np.float32), None,
    ...     np.array([10**8]))
    >>> scanner = RigScanner("roof", "one beam", np.eye(4), 1)
    >>> ego_points(scanner, scan, FrameRecord(0, track, (scan,))).tolist()
    [[6.0, 0.0, 0.0]]
    """
    in_ego = transform(scanner.ego_from_velo, scan.points)
    if scan.offset_ns is None:
        return in_ego
    times_ns = frame.time_ns + scan.offset_ns
    moved = deskewed_points(in_ego.astype(np.float32), times_ns, frame.track, frame.time_ns)
    return moved.astype(np.float64)


def returns_inside(box: BoxRecord, points_world: Float64Array) -> int:
    """How many points (N, 3) of the world lie in a box.

    Examples
    --------
    >>> box = BoxRecord("1", "car", np.eye(4), np.array([4.0, 2.0, 1.5]))
    >>> returns_inside(box, np.array([[1.9, 0, 0], [2.1, 0, 0], [0, 0, -0.7]]))
    2
    """
    centre = box.world_from_box[:3, 3]
    near = points_world[np.abs(points_world - centre).max(axis=1) <= np.linalg.norm(box.size_m)]
    inside = np.abs(transform(inverse(box.world_from_box), near)) <= box.size_m / 2
    return int(inside.all(axis=1).sum())


def quaternions(motions: Sequence[Float64Array]) -> Float64Array:
    """(M, 4) quaternions w, x, y, z of rigid motions.

    Examples
    --------
    >>> quaternions([np.eye(4)]).tolist()
    [[1.0, 0.0, 0.0, 0.0]]
    """
    from scipy.spatial.transform import Rotation  # 0.4 s to import

    rotations = np.array([motion[:3, :3] for motion in motions]).reshape(-1, 3, 3)
    xyzw = Rotation.from_matrix(rotations).as_quat(canonical=True)
    return np.asarray(np.roll(xyzw, 1, axis=1))


JPEG_QUALITY = 90


def write_jpeg(path: Path, image: ImageRecord) -> None:
    """Write an image as JPEG; the folder must exist.

    Raises
    ------
    MissingExtraError
        Pillow is not installed.
    """
    path.write_bytes(jpeg_of(image))


def jpeg_of(image: ImageRecord) -> bytes:
    """An image as the content of a JPEG file.

    Raises
    ------
    MissingExtraError
        Pillow is not installed.
    """
    try:
        from PIL import Image
    except ImportError:
        raise MissingExtraError("pillow", "lab", "writing the pictures of a drive") from None
    file = io.BytesIO()
    Image.fromarray(image.pixels).save(file, "JPEG", quality=JPEG_QUALITY)
    return file.getvalue()
