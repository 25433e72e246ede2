"""Writing KITTI's raw layout: paths and contents of a drive's files."""

import re
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np

from intervis.arrays import Float32Array, Float64Array

DATE, DRIVE = "2011_09_26", "2011_09_26_drive_0001_sync"
START = datetime(2011, 9, 26, 13, 2, 25)
FRAME_FILE = re.compile(r"[0-9]{10}\.(bin|png|label)|\.[0-9]{10}\.(bin|png|label)\.[0-9a-f]+\.part")


@dataclass(frozen=True)
class Layout:
    """Paths of one drive under a root folder.

    Examples
    --------
    >>> Layout(Path("out")).scan(7).name
    '0000000007.bin'
    """

    root: Path

    @property
    def date(self) -> Path:
        """Folder of the day, with the calibration files."""
        return self.root / DATE

    @property
    def drive(self) -> Path:
        """Folder of the drive."""
        return self.date / DRIVE

    def scan(self, number: int) -> Path:
        """Path of a scan: x, y, z, intensity as little-endian float32."""
        return self.drive / "velodyne_points" / "data" / f"{number:010d}.bin"

    def image(self, number: int) -> Path:
        """Path of an image of camera 2."""
        return self.drive / "image_02" / "data" / f"{number:010d}.png"

    def labels(self, number: int) -> Path:
        """Path of the labels of a scan's points, as SemanticKITTI writes them."""
        return self.drive / "velodyne_points" / "labels" / f"{number:010d}.label"

    def expected(self, frames: int) -> set[Path]:
        """Paths of the scans, labels and images of the first `frames` frames."""
        numbers = range(frames)
        return {
            path for kind in (self.scan, self.labels, self.image) for path in map(kind, numbers)
        }

    def frame_files(self) -> list[Path]:
        """The scans, labels and images that exist, half written ones too, sorted by path."""
        folders = [kind(0).parent for kind in (self.scan, self.labels, self.image)]
        return sorted(
            path
            for folder in folders
            for path in folder.glob("*")
            if FRAME_FILE.fullmatch(path.name) and path.is_file()
        )


def scan_bytes(points: Float32Array, intensity: Float32Array) -> bytes:
    """The bytes of a scan file, from points (N, 3) in metres and intensities (N,)."""
    return np.column_stack([points, intensity]).astype("<f4").tobytes()


def pose_text(poses: Float64Array) -> str:
    """Poses (F, 4, 4) in the format of KITTI odometry: the upper three rows, one line a frame."""
    return "".join(" ".join(f"{x:.15e}" for x in pose[:3].ravel()) + "\n" for pose in poses)


def timestamp_text(frames: int, period_s: float) -> str:
    """The lines of ``timestamps.txt``, with nanoseconds.

    Examples
    --------
    >>> timestamp_text(2, 0.1).splitlines()[1]
    '2011-09-26 13:02:25.100000000'
    """
    times = (START + timedelta(seconds=number * period_s) for number in range(frames))
    return "".join(f"{time:%Y-%m-%d %H:%M:%S.%f}000\n" for time in times)
