"""The yard: a world of known triangles, flat ground and a house, and simulated scans of it."""

import numpy as np

from intervis.lab.worlds.ray_casting import RayCaster
from intervis.transform import inverse, rigid, transform


def rectangle(corner, one, other):
    a, b, c = (np.asarray(v, float) for v in (corner, one, other))
    return np.array([[a, a + b, a + c], [a + b + c, a + b, a + c]])


def box(low, high):
    low, high = np.asarray(low, float), np.asarray(high, float)
    x, y, z = np.diag(high - low)
    return np.concatenate(
        [
            face
            for a, b, offset in [(x, y, z), (y, z, x), (z, x, y)]
            for face in (rectangle(low, a, b), rectangle(low + offset, a, b))
        ]
    )


GROUND = rectangle([-200, -200, 0], [400, 0, 0], [0, 400, 0])
HOUSE = box([8, -6, 0], [16, 6, 5])
YARD = np.concatenate([GROUND, HOUSE])
SENSOR = rigid(np.eye(3), [0.0, 0.0, 1.7])


def scan_of(triangles, pose, noise_m=0.0, step_deg=1.5):
    rng = np.random.default_rng(7)
    azimuth = np.radians(np.arange(0, 360, step_deg))
    elevation = np.radians(np.arange(-25, 3, step_deg * 2 / 3))
    a, e = (grid.ravel() for grid in np.meshgrid(azimuth, elevation))
    directions = np.column_stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    start = pose[:3, 3]
    reach = RayCaster(triangles).first_hit(start, start + 100 * directions)
    reach += noise_m * rng.normal(size=len(reach))
    hit = np.isfinite(reach)
    return transform(inverse(pose), start + directions[hit] * reach[hit, None])


def write_drive(folder, triangles, x_m, *, step_deg=1.5):
    """A folder of scans with poses: the sensor is at each x, 1.7 m above the ground."""
    lines = []
    for number, x in enumerate(x_m):
        pose = rigid(np.eye(3), [x, 0.0, 1.7])
        scan = scan_of(triangles, pose, noise_m=0.02, step_deg=step_deg)
        rows = np.column_stack([scan, np.zeros(len(scan))]).astype("<f4")
        rows.tofile(folder / f"{number:06d}.bin")
        lines.append(" ".join(f"{value:.9e}" for value in pose[:3].ravel()))
    (folder / "poses.txt").write_text("\n".join(lines) + "\n")
