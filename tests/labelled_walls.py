"""A hedge before a wall, scanned with labels from two places; every distance is on paper."""

from pathlib import Path

import numpy as np

HEDGE_X_M, WALL_X_M = 8.0, 12.0
BESIDE_Y_M = 6.0
"""The hedge stands at x = 8, from y = -1 to 1; the wall at x = 12. The first scanner stands at the
origin, the second one at y = 6: it sees past the hedge."""

VEGETATION, BUILDING = 70, 50


def walls_from(y_m: float) -> tuple[np.ndarray, np.ndarray]:
    """(N, 3) returns of rays 0.3 degrees apart from (0, y_m, 0), own frame, and labels (N,)."""
    azimuth, elevation = np.meshgrid(
        np.radians(np.arange(-75, 75, 0.3)), np.radians(np.arange(-12, 12, 0.3))
    )
    ray = np.stack([np.cos(azimuth), np.sin(azimuth), np.tan(elevation)], -1).reshape(-1, 3)
    y_at_hedge = y_m + ray[:, 1] / ray[:, 0] * HEDGE_X_M
    on_hedge = np.abs(y_at_hedge) < 1.0
    points = ray * (np.where(on_hedge, HEDGE_X_M, WALL_X_M) / ray[:, 0])[:, None]
    return points.astype(np.float32), np.where(on_hedge, VEGETATION, BUILDING)


def write_walls(folder: Path, labels: bool = True, order: np.ndarray | None = None) -> Path:
    """A folder of the two scans with poses and SemanticKITTI's labels."""
    folder.mkdir(parents=True, exist_ok=True)
    for number, y_m in enumerate((0.0, BESIDE_Y_M)):
        points, classes = walls_from(y_m)
        rows = np.column_stack([points, np.zeros(len(points))]).astype("<f4")
        chosen = slice(None) if order is None else order[: len(rows)]
        rows[chosen].tofile(folder / f"{number:06d}.bin")
        if labels:
            classes.astype("<u4")[chosen].tofile(folder / f"{number:06d}.label")
    (folder / "poses.txt").write_text(
        f"1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 0 0 1 0 {BESIDE_Y_M} 0 0 1 0\n"
    )
    return folder
