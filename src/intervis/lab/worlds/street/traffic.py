"""The actors of the street and the scanning vehicle: their routes and poses."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from intervis.arrays import Float64Array
from intervis.lab.worlds.street import terrain
from intervis.lab.worlds.street.cars import ESTATE, HATCHBACK, SALOON, VAN, car
from intervis.lab.worlds.street.centreline import Centreline
from intervis.lab.worlds.street.people import cyclist, person
from intervis.lab.worlds.triangles import Triangles
from intervis.lab.worlds.world import Actor
from intervis.transform import rigid

SENSOR_HEIGHT_M = 1.73
LANE_M = 1.9
"""Offset of the middle of a lane; traffic keeps to the right."""
SPEED_M_S = 8.8


def distance_m(time_s: float) -> float:
    """Distance that the scanning vehicle has driven, metres, at 8 to 9.6 m/s."""
    return SPEED_M_S * time_s + 1.6 * float(1 - np.cos(0.45 * time_s))


def vehicle_pose(centreline: Centreline, time_s: float) -> Float64Array:
    """street_from_velo (4, 4): on the right lane, with small roll and pitch oscillations."""
    s = distance_m(time_s)
    drift = 0.12 * np.sin(0.31 * time_s)
    pose = centreline.pose(
        s, -LANE_M + drift, SENSOR_HEIGHT_M, yaw_rad=0.004 * np.sin(0.8 * time_s)
    )
    pitch_rad, roll_rad = 0.0035 * np.sin(4.1 * time_s), 0.0025 * np.sin(2.7 * time_s)
    rotation = Rotation.from_euler("XY", [roll_rad, pitch_rad]).as_matrix()
    return np.asarray(pose @ rigid(rotation, [0.0, 0.0, 0.0]))


@dataclass(frozen=True)
class Course:
    """A course along the street at constant speed and offset.

    Attributes
    ----------
    start_m, speed_m_s : float
        Position at time 0 and speed along the street (negative: oncoming).
    offset_m, height_m : float
        Across and above the centreline.
    """

    start_m: float
    speed_m_s: float
    offset_m: float
    height_m: float = 0.0

    def pose(self, centreline: Centreline, time_s: float) -> Float64Array:
        """street_from_actor (4, 4)."""
        yaw = 0.0 if self.speed_m_s >= 0 else np.pi
        s = self.start_m + self.speed_m_s * time_s
        return centreline.pose(s, self.offset_m, self.height_m, yaw)


def _crossing_pose(centreline: Centreline, s: float, start_m: float, time_s: float) -> Float64Array:
    """street_from_actor (4, 4): over the zebra crossing to the right pavement, and stop there."""
    d = max(-7.0, start_m - 1.45 * time_s)
    height = terrain.KERB_HIGH_M if abs(d) > terrain.KERB_M else 0.0
    return centreline.upright(s, d, height, -np.pi / 2)


def actors(
    centreline: Centreline,
    rng: np.random.Generator,
    world_from_street: Float64Array,
    crossing_s: float,
) -> tuple[Actor, ...]:
    """Cars ahead and oncoming, pedestrians, a cyclist, a pedestrian on the crossing."""
    found: list[Actor] = []

    def add(name: str, triangles: Triangles, pose: Callable[[float], Float64Array]) -> None:
        found.append(
            Actor(name, triangles.rounded(), lambda time_s: world_from_street @ pose(time_s))
        )

    def follow(course: Course) -> Callable[[float], Float64Array]:
        return lambda time_s: course.pose(centreline, time_s)

    def lead(ahead_m: float) -> Callable[[float], Float64Array]:
        return lambda time_s: centreline.pose(
            distance_m(time_s) + ahead_m + 2.5 * np.sin(0.25 * time_s), -LANE_M - 0.05
        )

    add("car 1", car(rng, ESTATE), lead(17.5))
    add("car 2", car(rng, HATCHBACK), lead(47.0))
    bodies = (SALOON, HATCHBACK, VAN, ESTATE)
    for number, start in enumerate((27.0, 92.0, 128.0, 205.0, 300.0, 342.0, 410.0)):
        course = Course(start, -float(rng.uniform(8.2, 8.8)), LANE_M + 0.1)
        add(f"car {3 + number}", car(rng, bodies[number % 4]), follow(course))
    add("bicycle 1", cyclist(rng), follow(Course(12.0, 4.6, -3.35)))
    add(
        "person 1",
        person(rng, stride=0.5),
        lambda time_s: _crossing_pose(centreline, crossing_s, -0.7, time_s),
    )
    for number in range(14):
        side = 1 if number % 2 else -1
        start = -20.0 + 24.0 * number + float(rng.uniform(-8, 8))
        speed = float(rng.choice([-1.0, 1.0]) * rng.uniform(1.0, 1.5))
        offset = side * float(rng.uniform(terrain.KERB_M + 0.7, terrain.WALK_M - 0.4))
        walker = person(rng, stride=float(rng.uniform(0.2, 0.55)))
        course = Course(start, speed, offset, terrain.KERB_HIGH_M)
        add(f"person {2 + number}", walker, follow(course))
    return tuple(found)
