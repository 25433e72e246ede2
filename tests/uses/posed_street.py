"""A street of four posed scans on disk: level road, facades, and a parked van."""

from pathlib import Path

import numpy as np

VAN = np.array([[22.0, 1.0, 0.0], [26.0, 3.0, 2.4]])
"""Lower and upper corner; the road is z = 0, the scanner drives along x at 1.7 m."""
HEIGHT_M = 1.7


def returns(x_m: float, van: np.ndarray | None = VAN) -> np.ndarray:
    """(N, 3) returns in the sensor's frame at x: rays at road, facades (|y| = 9) and van."""
    azimuth = np.radians(np.arange(-180, 180, 0.5))
    elevation = np.radians(np.linspace(-24, 8, 64))
    azimuth, elevation = (one.ravel() for one in np.meshgrid(azimuth, elevation))
    rays = np.stack(
        [
            np.cos(elevation) * np.cos(azimuth),
            np.cos(elevation) * np.sin(azimuth),
            np.sin(elevation),
        ],
        axis=1,
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = np.minimum(9.0 / np.abs(rays[:, 1]), 80.0)
        reach = np.minimum(reach, np.where(rays[:, 2] < 0, HEIGHT_M / -rays[:, 2], np.inf))
        if van is not None:
            low, high = van - [x_m, 0.0, HEIGHT_M]
            near = np.minimum(low / rays, high / rays).max(axis=1)
            far = np.maximum(low / rays, high / rays).min(axis=1)
            reach = np.where((near < far) & (near > 0), np.minimum(reach, near), reach)
    return (rays * reach[:, None])[reach < 79.0].astype(np.float32)


def write(folder: Path, count: int = 4, step_m: float = 4.0) -> Path:
    """A folder of scans with poses; the scanner drives along x, `step_m` from scan to scan."""
    folder.mkdir()
    poses = []
    for nth in range(count):
        points = returns(nth * step_m)
        rows = np.column_stack([points, np.zeros(len(points))]).astype("<f4")
        rows.tofile(folder / f"{nth:06d}.bin")
        poses.append(f"1 0 0 {nth * step_m} 0 1 0 0 0 0 1 {HEIGHT_M}")
    (folder / "poses.txt").write_text("\n".join(poses) + "\n")
    return folder
