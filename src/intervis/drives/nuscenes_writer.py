"""Writing nuScenes' layout: tables, sweeps with x right and y forward, images.

Files of key frames stand in ``samples``, the others in ``sweeps``. The rows of a sweep are x, y, z,
intensity (0 to 255) and ring as float32; times of points have no place in them, so points of a
moving scanner stay as they were measured. There is no map: its mask is blank.
"""

import struct
import zlib
from pathlib import Path

import numpy as np

from intervis.drives.drive_writer import (
    FrameRecord,
    Rig,
    ScanRecord,
    returns_inside,
    write_jpeg,
)
from intervis.drives.nuscenes_table_writer import VERSION, NuScenesTables, channel_of, sensor_axes
from intervis.transform import transform

MAP_FILE = "maps/blank.png"
BLANK_PX = 16


class NuScenesWriter:
    """Writes one scene; see `drive_writer.DriveWriter`.

    Parameters
    ----------
    root : Path
        An empty folder.
    rig : Rig
    name : str
        Of the scene.
    """

    def __init__(self, root: Path, rig: Rig, name: str = "scene-0001") -> None:
        self._root, self._rig, self._name = root, rig, name
        (root / VERSION).mkdir()
        for scanner in rig.scanners:
            self._make_folders(channel_of(scanner.name, "lidar"))
        for camera in rig.cameras:
            self._make_folders(channel_of(camera.name, "camera"))
        (root / MAP_FILE).parent.mkdir()
        (root / MAP_FILE).write_bytes(blank_png(BLANK_PX))
        self._tables = NuScenesTables(root / VERSION, rig, MAP_FILE)
        self._begun = False

    def _make_folders(self, channel: str) -> None:
        for kind in ("samples", "sweeps"):
            (self._root / kind / channel).mkdir(parents=True)

    def add(self, frame: FrameRecord) -> None:
        """See `drive_writer.DriveWriter`."""
        if not self._begun:
            models = ", ".join(scanner.model for scanner in self._rig.scanners)
            self._tables.begin_scene(self._name, f"simulated street, {models}", frame.time_ns)
            self._begun = True
        points_world = np.concatenate(
            [
                transform(frame.world_from_ego @ scanner.ego_from_velo, scan.points)
                for scanner, scan in zip(self._rig.scanners, frame.scans, strict=True)
            ]
        )
        returns = [returns_inside(box, points_world) for box in frame.boxes]
        paths = [self._root / name for name in self._tables.add(frame, returns)]
        for path, scan in zip(paths, frame.scans, strict=False):
            path.write_bytes(sweep_bytes(scan))
        for path, image in zip(paths[len(frame.scans) :], frame.images, strict=True):
            write_jpeg(path, image)

    def close(self) -> Path:
        """See `drive_writer.DriveWriter`."""
        self._tables.close()
        return Path(VERSION) / self._name

    def release(self) -> None:
        """See `drive_writer.DriveWriter`."""
        self._tables.release()


def sweep_bytes(scan: ScanRecord) -> bytes:
    """The bytes of a ``.pcd.bin``; the ring is 0 where the scanner has no rows."""
    ring = np.zeros(len(scan.points)) if scan.ring is None else scan.ring
    intensity = np.round(255 * scan.intensity)
    return np.column_stack([sensor_axes(scan.points), intensity, ring]).astype("<f4").tobytes()


def blank_png(size_px: int) -> bytes:
    """A black square as PNG, 8 bits of grey."""
    head = struct.pack(">IIBBBBB", size_px, size_px, 8, 0, 0, 0, 0)
    rows = zlib.compress(bytes(size_px * (size_px + 1)))
    chunks = ((b"IHDR", head), (b"IDAT", rows), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
        for kind, body in chunks
    )
