"""The built-in street."""

import numpy as np

from intervis.arrays import Float64Array
from intervis.transform import inverse
from intervis.worlds import materials as of
from intervis.worlds import shapes
from intervis.worlds.path import Path
from intervis.worlds.soup import Material, Soup
from intervis.worlds.world import Mover, World

SENSOR_HEIGHT_M = 1.73
LANE_M = -1.85
DRIVE_M = 300.0


def _ground(path: Path) -> Soup:
    s = np.arange(path.first_m, path.last_m, 2.0)
    strips: list[tuple[float, float, float, float, Material]] = [
        (-5.9, 5.9, 0.0, 0.0, of.ASPHALT),
        (5.9, 5.9, 0.0, 0.12, of.KERB),
        (5.9, 8.2, 0.12, 0.12, of.SLABS),
        (8.2, 80.0, 0.12, 0.12, of.GRASS),
    ]
    parts = []
    for start, end, low, high, material in strips:
        for sign in (1, -1) if start > 0 else (1,):
            d = np.linspace(start, end, 4) * sign
            h = np.linspace(low, high, 4)
            parts.append(Soup.of(shapes.grid(path.points(s[:, None], d, h)), material))
    return Soup.joined(parts)


def build_street(seed: int = 0) -> World:
    """The street, the same for the same seed."""
    rng = np.random.default_rng(seed)
    path = Path(-100.0, DRIVE_M + 130.0)
    parts = [_ground(path)]
    for sign in (1, -1):
        s = path.first_m + 8
        while s < path.last_m - 10:
            width, depth = rng.uniform(9, 13), rng.uniform(8, 11)
            house = Material("building", tuple(rng.uniform(0.4, 0.8, 3)), 0.4)
            body = shapes.box([-width / 2, 0, 0], [width / 2, depth, rng.uniform(6, 10)])
            pose = path.upright(s, sign * rng.uniform(8.5, 12), 0.1, 0 if sign > 0 else np.pi)
            parts.append(Soup.of(body, house).moved(pose))
            s += width + rng.uniform(1, 6)
    world_from_street = inverse(_vehicle(path, 0.0))

    def vehicle_pose_at(time_s: float) -> Float64Array:
        return world_from_street @ _vehicle(path, time_s)

    car = Soup.of(
        shapes.box([-2.1, -0.9, 0.2], [2.1, 0.9, 1.45]), Material("car", (0.5, 0.05, 0.05), 0.3)
    )
    movers = tuple(
        Mover(
            f"car {number}",
            car,
            lambda time_s, start=start, speed=speed, d=d: (
                world_from_street @ path.pose(start + speed * time_s, d)
            ),
        )
        for number, (start, speed, d) in enumerate([(22.0, 8.6, LANE_M), (60.0, -9.0, 1.85)])
    )
    return World(
        Soup.joined(parts).moved(world_from_street), movers, vehicle_pose_at, DRIVE_M / 8.8
    )


def _vehicle(path: Path, time_s: float) -> Float64Array:
    return path.pose(8.8 * time_s, LANE_M, SENSOR_HEIGHT_M)
