"""Scans of worlds with a closed formula: rays against planes, boxes and poles, by hand."""

import numpy as np

from intervis.transform import inverse, rigid, transform

GROUND_M = -1.73
BOXES = np.array(
    [  # x0 y0 z0 x1 y1 z1, scene frame: two parked cars, a house, a low wall
        [6.0, 3.0, GROUND_M, 10.5, 4.8, -0.2],
        [14.0, -5.0, GROUND_M, 18.5, -3.2, -0.2],
        [-10.0, 8.0, GROUND_M, 25.0, 20.0, 6.0],
        [-20.0, -9.0, GROUND_M, 5.0, -8.6, -0.7],
        [24.0, -0.2, GROUND_M, 24.3, 0.1, 3.0],
    ]
)


def directions(lowest_deg=-24.8, highest_deg=2.0, beams=64, step_deg=0.18):
    azimuth = np.radians(np.arange(0.0, 360.0, step_deg))
    elevation = np.radians(np.linspace(highest_deg, lowest_deg, beams))
    e, a = np.meshgrid(elevation, azimuth, indexing="ij")
    return np.stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)], -1).reshape(-1, 3)


def ranges(origin, rays, boxes=BOXES, ground_m=GROUND_M):
    """(R,) distance along each ray to the first box or the ground; inf where there is neither."""
    with np.errstate(divide="ignore", invalid="ignore"):
        nearest = np.where(rays[:, 2] < 0, (ground_m - origin[2]) / rays[:, 2], np.inf)
        for box in boxes:
            low, high = (box[:3] - origin) / rays, (box[3:] - origin) / rays
            enter = np.nanmax(np.minimum(low, high), axis=1)
            leave = np.nanmin(np.maximum(low, high), axis=1)
            hit = (enter <= leave) & (enter > 0)
            nearest = np.where(hit & (enter < nearest), enter, nearest)
    return nearest


def clear(a, b, boxes=BOXES, ground_m=GROUND_M):
    """(L,) whether the open segments a-b meet no box and stay above the ground: the truth."""
    length = np.linalg.norm(b - a, axis=1)
    rays = (b - a) / length[:, None]
    reached = np.array(
        [ranges(p, r[None], boxes, ground_m)[0] for p, r in zip(a, rays, strict=True)]
    )
    return reached >= length - 1e-6


def street_scan(pose=None, boxes=BOXES, seed=0, noise_m=0.02, range_m=80.0, **beams):
    """(N, 3) float32 returns of a spinning sensor at `pose`, in its own frame."""
    pose = np.eye(4) if pose is None else pose
    rays = directions(**beams)
    range_of = ranges(pose[:3, 3], rays @ pose[:3, :3].T, boxes)
    hit = range_of < range_m
    noise = np.random.default_rng(seed).normal(0.0, noise_m, int(hit.sum()))
    return (rays[hit] * (range_of[hit] + noise)[:, None]).astype(np.float32)


def seen_from(pose, points_scene):
    """Points of the scene in a sensor's frame."""
    return transform(inverse(pose), points_scene)


def turned(yaw_rad, x_m, y_m):
    """A pose at (x, y, 0), turned about the upward axis."""
    c, s = np.cos(yaw_rad), np.sin(yaw_rad)
    return rigid([[c, -s, 0], [s, c, 0], [0, 0, 1]], [x_m, y_m, 0.0])
