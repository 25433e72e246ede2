"""A simulated drive, written in KITTI's raw layout."""

import io
import os
from collections.abc import Callable
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np

from intervis.errors import OutputError, SettingsError
from intervis.worlds.calibration import Calibration
from intervis.worlds.png import png_bytes
from intervis.worlds.renderer import render
from intervis.worlds.scanner import Scanner
from intervis.worlds.street import build_street

DATE, DRIVE = "2011_09_26", "2011_09_26_drive_0001_sync"
PERIOD_S = 0.1
START = datetime(2011, 9, 26, 13, 0, 0)


def _write(path: Path, content: bytes) -> None:
    partial = path.with_name(f".{path.name}.{os.getpid()}.partial")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        partial.write_bytes(content)
        os.replace(partial, path)
    except OSError as error:
        partial.unlink(missing_ok=True)
        raise OutputError(f"cannot write {path}: {error.strerror or error}.") from None


def simulate(
    out: Path | str,
    *,
    frames: int = 10,
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Write a simulated drive; its folder."""
    if frames < 1:
        raise SettingsError(f"frames must be 1 or more, got {frames}.")
    drive = Path(out) / DATE / DRIVE
    world, scanner, calibration = build_street(seed), Scanner(), Calibration()
    for name, text in calibration.files(START).items():
        _write(drive.parent / name, text.encode())
    camera, cam_from_velo = calibration.camera(), calibration.cam_from_velo
    poses, stamps = [], []
    for number in range(frames):
        time_s = number * PERIOD_S
        moment, pose = world.at(time_s), world.vehicle_pose_at(time_s)
        points, attributes = scanner.scan(moment, pose, np.random.default_rng([seed, number]))
        rows = np.column_stack([points, attributes["intensity"]]).astype("<f4")
        _write(drive / "velodyne_points" / "data" / f"{number:010d}.bin", rows.tobytes())
        picture = render(moment, camera, cam_from_velo, pose)
        _write(drive / "image_02" / "data" / f"{number:010d}.png", png_bytes(picture))
        poses.append(" ".join(f"{part:.12e}" for part in pose[:3].ravel()) + "\n")
        stamps.append(f"{START + timedelta(seconds=time_s):%Y-%m-%d %H:%M:%S.%f}000\n")
        if progress:
            progress(number + 1, frames)
    for folder in ("velodyne_points", "image_02"):
        _write(drive / folder / "timestamps.txt", "".join(stamps).encode())
    _write(drive / "poses.txt", "".join(poses).encode())
    buffer = io.BytesIO()
    np.savez(buffer, static=world.static.triangles, labels=world.static.labels)
    _write(drive / "world.npz", buffer.getvalue())
    return drive
