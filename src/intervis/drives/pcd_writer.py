"""Writing a folder of PCD files of one scanner, with its poses and times.

``000000.pcd`` ... hold x, y, z, intensity, ring and, where the scanner moved while it scanned, t:
the time of a point in nanoseconds after the scan's. ``poses.txt`` has a pose of the scanner for
each scan (KITTI's odometry format), ``times.txt`` its time in seconds.
"""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from intervis.arrays import Float64Array
from intervis.drives.drive_writer import FrameRecord, Rig, ScanRecord
from intervis.drives.kitti_writer import pose_text
from intervis.errors import SettingsError

TYPES = {"f": "F", "u": "U", "i": "I"}


def check_rig(rig: Rig) -> None:
    """Check that the layout can hold the scanners of a rig.

    Raises
    ------
    SettingsError
        There are several.
    """
    if len(rig.scanners) != 1:
        raise SettingsError(
            f"a folder of PCD files takes one scanner, not {len(rig.scanners)}: choose nuscenes or"
            " mcap for several."
        )


class PcdWriter:
    """Writes one folder; see `drive_writer.DriveWriter`."""

    def __init__(self, root: Path, rig: Rig) -> None:
        check_rig(rig)
        self._root, self._scanner = root, rig.scanners[0]
        self._poses: list[Float64Array] = []
        self._times_ns: list[int] = []

    def add(self, frame: FrameRecord) -> None:
        """See `drive_writer.DriveWriter`."""
        (scan,) = frame.scans
        path = self._root / f"{len(self._poses):06d}.pcd"
        path.write_bytes(pcd_bytes(point_table(scan)))
        self._poses.append(frame.world_from_ego @ self._scanner.ego_from_velo)
        self._times_ns.append(frame.time_ns)

    def close(self) -> Path:
        """See `drive_writer.DriveWriter`."""
        (self._root / "poses.txt").write_text(pose_text(np.array(self._poses)))
        times = "".join(f"{ns // 10**9}.{ns % 10**9:09d}\n" for ns in self._times_ns)
        (self._root / "times.txt").write_text(times)
        return Path()

    def release(self) -> None:
        """See `drive_writer.DriveWriter`; no file stays open."""


def point_table(scan: ScanRecord) -> NDArray[Any]:
    """The points of a sweep as a packed structured array: x y z intensity [ring] [t].

    Examples
    --------
    >>> point_table(ScanRecord(np.zeros((2, 3), np.float32), np.ones(2, np.float32))).dtype.names
    ('x', 'y', 'z', 'intensity')
    """
    kinds = [(name, "<f4") for name in ("x", "y", "z", "intensity")]
    kinds += [("ring", "<u2")] if scan.ring is not None else []
    kinds += [("t", "<u4")] if scan.offset_ns is not None else []
    table = np.empty(len(scan.points), kinds)
    table["x"], table["y"], table["z"] = scan.points.T
    table["intensity"] = scan.intensity
    if scan.ring is not None:
        table["ring"] = scan.ring
    if scan.offset_ns is not None:
        table["t"] = scan.offset_ns
    return table


def pcd_bytes(table: NDArray[Any]) -> bytes:
    """A binary PCD file of a packed structured array (N,)."""
    names = table.dtype.names or ()
    columns = [table.dtype[name] for name in names]
    header = (
        "# .PCD v0.7 - Point Cloud Data file format",
        "VERSION 0.7",
        f"FIELDS {' '.join(names)}",
        f"SIZE {' '.join(str(column.itemsize) for column in columns)}",
        f"TYPE {' '.join(TYPES[column.kind] for column in columns)}",
        f"COUNT {' '.join('1' for _ in columns)}",
        f"WIDTH {len(table)}",
        "HEIGHT 1",
        "VIEWPOINT 0 0 0 1 0 0 0",
        f"POINTS {len(table)}",
        "DATA binary",
        "",
    )
    return "\n".join(header).encode() + table.tobytes()
