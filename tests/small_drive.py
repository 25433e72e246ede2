"""Small drives for tests: a bumpy street of a few hundred returns, in memory or on disk."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from intervis.camera import Camera
from intervis.drives import Frame
from intervis.run.frame_file import load_frame

CAM_FROM_VELO_AXES = np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]])
"""Rotation from x forward, y left, z up to x right, y down, z forward."""

CAMERA_CENTRE_VELO = np.array([0.3, 0.06, -0.08])


def street(seed: int, returns: int = 400) -> np.ndarray:
    """(N, 3) float32 scan: uneven ground ahead and behind, and a few posts."""
    rng = np.random.default_rng(seed)
    ground = np.column_stack([rng.uniform(-20, 30, returns), rng.uniform(-8, 8, returns)])
    height = -1.7 + 0.1 * np.sin(ground[:, 0]) + rng.normal(0, 0.02, returns)
    posts = np.column_stack(
        [
            np.repeat([8.0, 14.0], 20),
            np.repeat([-3.0, 4.0], 20),
            np.tile(np.arange(20) / 10 - 1.6, 2),
        ]
    )
    return np.vstack([np.column_stack([ground, height]), posts]).astype(np.float32)


def camera() -> Camera:
    """A camera with 90 degrees of view across, its principal point in the middle."""
    return Camera(np.array([[100.0, 0, 100, 0], [0, 100, 40, 0], [0, 0, 1, 0]]), 200, 80, "test")


def cam_from_velo() -> np.ndarray:
    """(4, 4) a camera that looks along x from CAMERA_CENTRE_VELO."""
    matrix = np.eye(4)
    matrix[:3, :3] = CAM_FROM_VELO_AXES
    matrix[:3, 3] = -CAM_FROM_VELO_AXES @ CAMERA_CENTRE_VELO
    return matrix


class MemoryDrive:
    """The part of a drive that a run uses; `failing` maps frame numbers to exceptions."""

    def __init__(
        self,
        numbers: tuple[int, ...] = (0, 1, 2, 5),
        *,
        with_camera: bool = True,
        poses: Mapping[int, np.ndarray] | None = None,
        failing: Mapping[int, Exception] | None = None,
        name: str = "memory",
    ) -> None:
        self.frame_numbers = numbers
        self.camera = camera() if with_camera else None
        self.poses = poses
        self.failing = dict(failing or {})
        self.name = name
        self.root = Path("/nowhere") / name
        self.read: list[int] = []

    def fingerprint(self) -> dict[str, Any]:
        return {"layout": "memory", "name": self.name, "frames": len(self.frame_numbers)}

    def __getitem__(self, number: int) -> Frame:
        self.read.append(number)
        if number in self.failing:
            raise self.failing[number]
        return Frame(
            number=number,
            points=street(number),
            camera=self.camera,
            cam_from_velo=cam_from_velo() if self.camera else None,
            pose=(self.poses or {}).get(number),
            timestamp_ns=number * 100_000_000,
        )


def scan_folder(folder: Path, numbers: tuple[int, ...] = (0, 1, 2)) -> Path:
    """A folder of .bin scans on disk, without camera or poses."""
    folder.mkdir(parents=True, exist_ok=True)
    for number in numbers:
        points = street(number)
        rows = np.column_stack([points, np.zeros(len(points))]).astype("<f4")
        rows.tofile(folder / f"{number:06d}.bin")
    return folder


def files_below(folder: Path) -> dict[str, tuple[int, int]]:
    """Every file below a folder, hidden ones too, with size and time of last change."""
    return {
        path.relative_to(folder).as_posix(): (path.stat().st_size, path.stat().st_mtime_ns)
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def results(out: Path) -> dict[str, dict[str, bytes]]:
    """All arrays of the frame files of a run but the stage times, which differ between runs."""
    frames = {}
    for path in sorted((out / "frames").glob("*.npz")):
        arrays = load_frame(path)
        del arrays["times_s"]
        frames[path.name] = {name: array.tobytes() for name, array in arrays.items()}
    return frames
