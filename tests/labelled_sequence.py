"""A small labelled sequence in SemanticKITTI's layout: a road and a wall ahead."""

from pathlib import Path

import numpy as np


def ring(x_shift_m: float, step_deg: float = 0.8) -> np.ndarray:
    """Ground around a scanner and a wall 12 m ahead of the first one."""
    azimuth, elevation = np.meshgrid(
        np.radians(np.arange(0, 360, step_deg)), np.radians(np.arange(-24, 4, step_deg))
    )
    rays = np.stack([np.cos(azimuth), np.sin(azimuth), np.tan(elevation)], axis=-1).reshape(-1, 3)
    ground = np.where(rays[:, 2] < -1e-3, -1.7 / np.minimum(rays[:, 2], -1e-3), 1e6)
    wall = np.where(rays[:, 0] > 1e-3, (12.2 - x_shift_m) / np.maximum(rays[:, 0], 1e-3), 1e6)
    range_m = np.minimum(ground, wall)
    kept = range_m < 60
    return (rays[kept] * range_m[kept, None]).astype(np.float32)


def write_sequence(
    root: Path, count: int, *, distance_m: float = 1.0, step_deg: float = 0.8
) -> Path:
    """Labelled scans a distance apart; the camera axes are KITTI's. The folder is returned."""
    (root / "velodyne").mkdir(parents=True)
    (root / "labels").mkdir()
    (root / "calib.txt").write_text(
        "P2: 700 0 600 0 0 700 180 0 0 0 1 0\nP3: 700 0 600 -350 0 700 180 0 0 0 1 0\n"
        "Tr: 0 -1 0 0 0 0 -1 0 1 0 0 0\n"
    )
    (root / "times.txt").write_text("".join(f"{number / 10:g}\n" for number in range(count)))
    places_m = [distance_m * number for number in range(count)]
    lines = [f"1 0 0 0 0 1 0 0 0 0 1 {place_m}\n" for place_m in places_m]  # z ahead of camera 0
    (root / "poses.txt").write_text("".join(lines))
    for number, place_m in enumerate(places_m):
        points = ring(place_m, step_deg)
        rows = np.column_stack([points, np.zeros(len(points))]).astype(np.float32)
        rows.tofile(root / "velodyne" / f"{number:06d}.bin")
        labels = np.where(points[:, 2] < -1.6, 40, 50).astype(np.uint32) | (7 << 16)
        labels.tofile(root / "labels" / f"{number:06d}.label")
    return root
