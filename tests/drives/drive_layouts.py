"""Small drives on disk for the tests of the readers."""

import struct
import zlib
from collections.abc import Iterable
from pathlib import Path

import numpy as np

P_RECT_02 = "7.0e+02 0 6.0e+02 3.5e+01 0 7.0e+02 1.8e+02 0 0 0 1 0"
P_RECT_03 = "7.0e+02 0 6.0e+02 -3.5e+02 0 7.0e+02 1.8e+02 0 0 0 1 0"
CAM_TO_CAM = f"""calib_time: 09-Jan-2012 13:57:47
corner_dist: 9.950000e-02
S_rect_00: 1.242e+03 3.75e+02
R_rect_00: 0 1 0 -1 0 0 0 0 1
P_rect_00: 7.0e+02 0 6.0e+02 0 0 7.0e+02 1.8e+02 0 0 0 1 0
S_rect_02: 64 32
R_rect_02: 1 0 0 0 1 0 0 0 1
P_rect_02: {P_RECT_02}
S_rect_03: 64 32
P_rect_03: {P_RECT_03}
"""
# The camera looks along the LiDAR's x, 0.27 m ahead of it and 0.08 m below.
AXES = "0 -1 0 0 0 -1 1 0 0"
VELO_TO_CAM = f"calib_time: 15-Mar-2012 11:37:16\nR: {AXES}\nT: 0 -0.08 -0.27\ndelta_f: 0 0\n"
TR = "0 -1 0 0 0 0 -1 -0.08 1 0 0 -0.27"
IMU_TO_VELO = "calib_time: 25-May-2012\nR: 1 0 0 0 1 0 0 0 1\nT: -0.81 0.32 -0.80\n"
IDENTITY_LINE = "1 0 0 0 0 1 0 0 0 0 1 0"


def pose_line(x: float, y: float = 0.0, z: float = 0.0) -> str:
    """A pose without rotation, in KITTI's odometry format."""
    return f"1 0 0 {x} 0 1 0 {y} 0 0 1 {z}"


def scan_rows(number: int, count: int = 5) -> np.ndarray:
    """(count, 4) float32 rows with values that depend on the frame number."""
    rows = np.arange(count * 4, dtype=np.float32).reshape(count, 4)
    rows[:, 0] += 100 * number
    return rows


def write_scan(path: Path, number: int, count: int = 5) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    scan_rows(number, count).tofile(path)


def write_png(path: Path, width_px: int, height_px: int, grey: int = 0) -> None:
    """Write a grey RGB image."""

    def chunk(kind: bytes, body: bytes) -> bytes:
        return (
            struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
        )

    path.parent.mkdir(parents=True, exist_ok=True)
    rows = (b"\0" + bytes([grey, grey, grey]) * width_px) * height_px
    path.write_bytes(
        b"\x89PNG\r\n\x1a\n"
        + chunk(b"IHDR", struct.pack(">IIBBBBB", width_px, height_px, 8, 2, 0, 0, 0))
        + chunk(b"IDAT", zlib.compress(rows))
        + chunk(b"IEND", b"")
    )


def write_text(path: Path, text: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return path


def write_kitti_raw(
    folder: Path,
    scans: Iterable[int] = (0, 1, 2),
    images: Iterable[int] = (),
    camera: str = "image_02",
) -> Path:
    """A date folder with calibration and one drive in it; returns the drive's folder."""
    date = folder / "2011_09_26"
    drive = date / "2011_09_26_drive_0001_sync"
    write_text(date / "calib_cam_to_cam.txt", CAM_TO_CAM)
    write_text(date / "calib_velo_to_cam.txt", VELO_TO_CAM)
    write_text(date / "calib_imu_to_velo.txt", IMU_TO_VELO)
    for number in scans:
        write_scan(drive / "velodyne_points" / "data" / f"{number:010d}.bin", number)
    for number in images:
        write_png(drive / camera / "data" / f"{number:010d}.png", 64, 32, grey=number)
    return drive


def write_kitti_odometry(folder: Path, scans: Iterable[int] = (0, 1), name: str = "04") -> Path:
    """A sequence with calibration, scans and images; returns its folder."""
    sequence = folder / "sequences" / name
    calibration = f"P0: {P_RECT_02}\nP2: {P_RECT_02}\nP3: {P_RECT_03}\nTr: {TR}\n"
    write_text(sequence / "calib.txt", calibration)
    for number in scans:
        write_scan(sequence / "velodyne" / f"{number:06d}.bin", number)
        write_png(sequence / "image_2" / f"{number:06d}.png", 62, 18)
    return sequence


OBJECT_CALIBRATION = (
    f"P0: {P_RECT_02}\nP2: {P_RECT_02}\nP3: {P_RECT_03}\n"
    f"R0_rect: 0 1 0 -1 0 0 0 0 1\nTr_velo_to_cam: {TR}\nTr_imu_to_velo: {IDENTITY_LINE}\n\n"
)


def write_kitti_object(folder: Path, scans: Iterable[int] = (0, 3)) -> Path:
    """A training folder; returns it."""
    training = folder / "training"
    for number in scans:
        write_scan(training / "velodyne" / f"{number:06d}.bin", number)
        write_png(training / "image_2" / f"{number:06d}.png", 60 + number, 20)
        write_text(training / "calib" / f"{number:06d}.txt", OBJECT_CALIBRATION)
    return training
