"""A level square with a wall through its middle, scanned from both sides; sight on paper."""

from pathlib import Path

import numpy as np

from intervis.sight import Scene
from intervis.transform import rigid

HALF_M, WALL_M = 30.0, 10.0
"""The square reaches to walls at |x|, |y| = 30 m; the wall at x = 0 from y = -10 to 10 m."""
WALL_TOP_M, SIDE_TOP_M, HEIGHT_M = 6.0, 14.0, 1.7
PLACES = [(-18, -18), (-18, 6), (-8, -6), (-6, 18), (6, 18), (8, -6), (18, 6), (18, -18)]
THICK_M = 0.1


def returns(x_m: float, y_m: float, phase_deg: float = 0.0) -> np.ndarray:
    """(N, 3) returns in the frame of a level scanner 1.7 m above (x, y)."""
    azimuth = np.radians(np.arange(-180, 180, 0.5) + phase_deg)
    elevation = np.radians(np.linspace(-24, 24, 97))
    azimuth, elevation = (one.ravel() for one in np.meshgrid(azimuth, elevation))
    level = np.stack([np.cos(azimuth), np.sin(azimuth)], axis=1) * np.cos(elevation)[:, None]
    rays = np.column_stack([level, np.sin(elevation)])
    here = np.array([x_m, y_m, HEIGHT_M])
    with np.errstate(divide="ignore", invalid="ignore"):
        sides = np.maximum((HALF_M - here[:2]) / rays[:, :2], (-HALF_M - here[:2]) / rays[:, :2])
        reach = sides.min(axis=1)
        reach = np.where(here[2] + reach * rays[:, 2] > SIDE_TOP_M, np.inf, reach)
        reach = np.minimum(reach, np.where(rays[:, 2] < 0, HEIGHT_M / -rays[:, 2], np.inf))
        low = np.array([-THICK_M, -WALL_M, 0.0]) - here
        high = np.array([THICK_M, WALL_M, WALL_TOP_M]) - here
        near = np.minimum(low / rays, high / rays).max(axis=1)
        far = np.maximum(low / rays, high / rays).min(axis=1)
        reach = np.where((near < far) & (near > 0), np.minimum(reach, near), reach)
    hit = np.isfinite(reach)
    return (rays[hit] * reach[hit, None]).astype(np.float32)


def scene() -> Scene:
    """The square scanned from eight places."""
    found = Scene()
    for x_m, y_m in PLACES:
        found.add(returns(x_m, y_m), rigid(np.eye(3), [x_m, y_m, HEIGHT_M]))
    return found


def write(folder: Path) -> Path:
    """The scans as a folder with poses."""
    folder.mkdir()
    poses = []
    for nth, (x_m, y_m) in enumerate(PLACES):
        points = returns(x_m, y_m)
        rows = np.column_stack([points, np.zeros(len(points))]).astype("<f4")
        rows.tofile(folder / f"{nth:06d}.bin")
        poses.append(f"1 0 0 {x_m} 0 1 0 {y_m} 0 0 1 {HEIGHT_M}")
    (folder / "poses.txt").write_text("\n".join(poses) + "\n")
    return folder


def sees(place: np.ndarray, targets: np.ndarray) -> np.ndarray:
    """Which targets (T, 3) a place sees: the line must pass x = 0 beside the wall or above it."""
    crosses = place[0] * targets[:, 0] < 0
    along = np.where(crosses, place[0] / np.where(crosses, place[0] - targets[:, 0], 1.0), 0.0)
    where = place + along[:, None] * (targets - place)
    return ~crosses | (np.abs(where[:, 1]) > WALL_M) | (where[:, 2] > WALL_TOP_M)
