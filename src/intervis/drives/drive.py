"""A drive: frames by frame number, each read from disk when it is accessed."""

from __future__ import annotations  # help() shows the names of the array types

import hashlib
import operator
from bisect import bisect_left
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np

from intervis.arguments import shown
from intervis.arrays import Float64Array, UInt8Array
from intervis.camera import Camera
from intervis.drives.boxes import Box
from intervis.drives.calibration import CameraCalibration
from intervis.drives.frame import Frame, ScannerScan
from intervis.drives.pose_track import PoseTrack
from intervis.drives.regular_file import open_regular
from intervis.drives.remote_path import for_each
from intervis.drives.scan import Scan
from intervis.drives.scan_file import read_scan
from intervis.errors import DriveError

SAMPLE_BYTES = 4096
"""Bytes from the middle of each scan that enter `Drive.fingerprint`."""


@dataclass(frozen=True, eq=False, repr=False)
class Drive:
    """A sequence of scans with camera, poses and timestamps; made by `intervis.open_drive`.

    A drive holds paths and the content of small files. Scans and images are read when a frame is
    accessed, and are not kept. The paths of a remote drive are no `pathlib.Path`, but have what
    reading needs of it; their text is the address.

    Attributes
    ----------
    root : Path
        The drive's folder, or the file of a single scan.
    name : str
        The folder's (or file's) name.
    layout : str
        ``kitti_raw``, ``kitti_odometry``, ``kitti_object``, ``kitti_tracking``, ``kitti_360``,
        ``nuscenes``, ``argoverse``, ``ros_bag``, ``las_mapping``, ``e57_stations``,
        ``ptx_stations``, ``scan_folder`` or ``single_scan``.
    scan_paths, image_paths : mapping of int to Path
        Files by frame number; a frame may have no image.
    image_readers : mapping of int to function
        Functions that read images which have no file of their own, by frame number.
    camera_names : tuple of str
        Cameras that `open_drive` can select.
    camera_name : str or None
        The selected camera.
    calibration : CameraCalibration, or function of a frame number to CameraCalibration, or None
        Of the selected camera: one for all frames, or one for each frame.
    poses : mapping of int to (4, 4) float64 array, or None
        world_from_velo by frame number.
    timestamps_ns : mapping of int to int
        Time of each scan by frame number, nanoseconds.
    metadata_files : tuple of Path
        The files that calibration, poses and timestamps were read from.
    read : function of a frame number to Scan, or None
        Reads the scan of a frame into the scanner's frame. None: by the ending of the scan's file,
        which holds points in the scanner's frame.
    label_paths : mapping of int to Path
        Files with labels of points by frame number; a frame may have none.
    scanner : str
        Name of the scanner whose scans are the frames, where the drive has several.
    read_other_scans : function of a frame number to tuple of ScannerScan, or None
        Reads the scans of the other scanners at the moment of a frame.
    read_boxes : function of a frame number to tuple of Box, or None
        Reads the boxes of the objects at the moment of a frame.
    ego_from_velo : (4, 4) float64 array or None
        The vehicle's frame from the scanner's, where the drive says how the scanner is mounted.
    is_deskewed : bool
        Whether the files hold points that were moved to the time of their scan already.
    frame_numbers : tuple of int
        Numbers of the frames that have a scan, sorted.
    """

    root: Path
    name: str
    layout: str
    scan_paths: Mapping[int, Path]
    image_paths: Mapping[int, Path] = field(default_factory=dict)
    image_readers: Mapping[int, Callable[[], UInt8Array]] = field(default_factory=dict)
    camera_names: tuple[str, ...] = ()
    camera_name: str | None = None
    calibration: CameraCalibration | Callable[[int], CameraCalibration] | None = None
    poses: Mapping[int, Float64Array] | None = None
    timestamps_ns: Mapping[int, int] = field(default_factory=dict)
    metadata_files: tuple[Path, ...] = ()
    read: Callable[[int], Scan] | None = None
    label_paths: Mapping[int, Path] = field(default_factory=dict)
    scanner: str = ""
    read_other_scans: Callable[[int], tuple[ScannerScan, ...]] | None = None
    read_boxes: Callable[[int], tuple[Box, ...]] | None = None
    ego_from_velo: Float64Array | None = None
    is_deskewed: bool = False
    frame_numbers: tuple[int, ...] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "frame_numbers", tuple(sorted(self.scan_paths)))

    def __repr__(self) -> str:
        numbers = self.frame_numbers
        if len(numbers) > 1:
            frames = f"{len(numbers):,} frames {numbers[0]}-{numbers[-1]}"
        else:
            frames = f"frame {numbers[0]}" if numbers else "no frames"
        known = [
            self.layout.replace("kitti", "KITTI").replace("ros", "ROS").replace("_", " "),
            frames,
        ]
        if self.camera_name is not None:
            known.append(f"camera {self.camera_name}")
        known += ["poses"] if self.poses else []
        known += ["timestamps"] if self.timestamps_ns else []
        return f"<Drive {self.name}: {', '.join(known)}>"

    @property
    def camera(self) -> Camera | None:
        """The selected camera; of the first readable frame where frames have own calibrations.

        Raises
        ------
        CalibrationError
            The calibration of no frame can be read.
        """
        unreadable: DriveError | None = None
        for number in self.frame_numbers:
            try:
                calibration = self.calibration_of(number)
            except DriveError as error:
                unreadable = unreadable or error
                continue
            return None if calibration is None else calibration.camera
        assert unreadable is not None  # there is at least one frame
        raise unreadable

    def calibration_of(self, number: int) -> CameraCalibration | None:
        """Camera and extrinsics of one frame; None where the drive has no camera.

        Raises
        ------
        CalibrationError
            The frame's own calibration is missing or does not parse.
        """
        return self.calibration(number) if callable(self.calibration) else self.calibration

    def __len__(self) -> int:
        return len(self.frame_numbers)

    def __contains__(self, number: object) -> bool:
        return number in self.scan_paths

    def __iter__(self) -> Iterator[Frame]:
        return (self[number] for number in self.frame_numbers)

    def __getitem__(self, number: int) -> Frame:
        """Read the frame with this frame NUMBER.

        Raises
        ------
        DriveError
            There is no such frame; the message names the range and the nearest numbers.
        ScanError
            The scan cannot be read, or is truncated or empty.
        CalibrationError
            The frame's own calibration cannot be read (layouts with one for each frame).
        """
        try:
            number = operator.index(number)
        except TypeError:
            raise DriveError(f"a frame number must be an integer, got {shown(number)}.") from None
        if number not in self.scan_paths:
            raise DriveError(self._no_such_frame(number))
        scan = self.read(number) if self.read else read_scan(self.scan_paths[number])
        calibration = self.calibration_of(number)
        pose = self.poses.get(number) if self.poses else None
        return Frame(
            number=number,
            points=scan.points,
            attributes=scan.attributes,
            camera=calibration.camera if calibration else None,
            cam_from_velo=calibration.cam_from_velo.copy() if calibration else None,
            pose=None if pose is None else pose.copy(),
            timestamp_ns=self.timestamps_ns.get(number),
            image_path=self.image_paths.get(number),
            read_image=self.image_readers.get(number),
            scan_path=self.scan_paths[number],
            label_path=self.label_paths.get(number),
            scanner=self.scanner,
            read_other_scans=(
                partial(self.read_other_scans, number) if self.read_other_scans else None
            ),
            read_boxes=partial(self.read_boxes, number) if self.read_boxes else None,
            pose_track=self._pose_track,
            is_deskewed=self.is_deskewed,
        )

    @cached_property
    def _pose_track(self) -> PoseTrack | None:
        """The poses of frames with times; None with fewer than two."""
        times_ns = {self.timestamps_ns[n]: n for n in self.poses or () if n in self.timestamps_ns}
        if self.poses is None or len(times_ns) < 2:
            return None
        rising = sorted(times_ns)
        return PoseTrack.over_gaps(
            np.array(rising, np.int64), [self.poses[times_ns[time_ns]] for time_ns in rising]
        )

    def fingerprint(self) -> dict[str, Any]:
        """Identification of the drive's content, independent of its place on disk.

        Only a part of each scan is read, so that long drives take little time. It is the same
        wherever the files lie: on a disk, or in storage that is reached over a network.

        Returns
        -------
        dict
            ``layout``, ``name``, ``frames``, ``first``, ``last``, ``camera``, ``scan_bytes``, and
            ``digest``: SHA-256 over the number, the size and the middle 4096 bytes of every scan,
            the size of every image, and the whole of calibration, poses and times.

        Raises
        ------
        DriveError
            A file cannot be read.
        """
        digest, scan_bytes = hashlib.sha256(), 0
        try:
            paths = [self.scan_paths[number] for number in self.frame_numbers]
            for number, (size, part) in zip(
                self.frame_numbers, for_each(_size_and_middle, paths), strict=True
            ):
                digest.update(f"scan {number} {size}\n".encode() + part)
                scan_bytes += size
            for number, path in sorted(self.image_paths.items()):
                digest.update(f"image {number} {path.stat().st_size}\n".encode())
            contents = for_each(_content, self.metadata_files)
            for path, content in zip(self.metadata_files, contents, strict=True):
                digest.update(f"file {path.name}\n".encode(errors="surrogateescape"))
                digest.update(content)
        except OSError as error:
            raise DriveError(f"cannot read {error.filename}: {error.strerror}.") from None
        return {
            "layout": self.layout,
            "name": self.name,
            "frames": len(self),
            "first": self.frame_numbers[0],
            "last": self.frame_numbers[-1],
            "camera": self.camera_name,
            "scan_bytes": scan_bytes,
            "digest": digest.hexdigest(),
        }

    def _no_such_frame(self, number: int) -> str:
        numbers = self.frame_numbers
        place = bisect_left(numbers, number)
        nearest = " and ".join(str(n) for n in numbers[max(0, place - 1) : place + 1])
        return (
            f"{self.name} has no frame {number}: its {len(self)} frames are numbered"
            f" {numbers[0]} to {numbers[-1]}, nearest {nearest}."
        )


def _size_and_middle(path: Path) -> tuple[int, bytes]:
    """Size of a file, and the bytes in its middle, `SAMPLE_BYTES` at most."""
    with open_regular(path) as file:
        size = file.seek(0, 2)
        file.seek(max(0, (size - SAMPLE_BYTES) // 2))
        return size, file.read(SAMPLE_BYTES)


def _content(path: Path) -> bytes:
    with open_regular(path) as file:
        return file.read()
