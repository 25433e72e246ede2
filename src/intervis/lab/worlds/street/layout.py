"""The built-in street: two rows of houses, parked cars, trees, a bridge, a hill at its end."""

from collections.abc import Iterator
from functools import partial

import numpy as np

from intervis.arrays import Float64Array
from intervis.lab.worlds.street import furniture, plants, terrain, traffic
from intervis.lab.worlds.street.cars import car
from intervis.lab.worlds.street.centreline import Centreline
from intervis.lab.worlds.street.houses import PLASTERS, far_house, house, shed
from intervis.lab.worlds.triangles import Material, Triangles
from intervis.lab.worlds.world import World
from intervis.transform import inverse

FIRST_M, LAST_M = -110.0, 430.0
DRIVE_M = 300.0
CROSSING_M = 33.0
BRIDGE = terrain.Bridge()
PAVEMENT_M = terrain.KERB_HIGH_M


def _sides() -> Iterator[tuple[int, float]]:
    """Left (1) and right (-1), each with the yaw for which y points away from the street."""
    yield 1, 0.0
    yield -1, np.pi


def _lots(rng: np.random.Generator) -> list[tuple[float, float, float]]:
    """Building lots on one side: middle, width, gap after it; none at the bridge."""
    lots = []
    s = FIRST_M + float(rng.uniform(1, 6))
    while s < LAST_M - 16:
        width = float(rng.uniform(8.5, 15.0))
        gap = float(rng.choice([0.0, 0.0, 2.5, 4.5, 7.5]))
        if s + width > BRIDGE.s - 17 and s < BRIDGE.s + 17:
            s = BRIDGE.s + 17.5
            continue
        lots.append((s + width / 2, width, gap))
        s += width + gap
    return lots


def _houses(centreline: Centreline, rng: np.random.Generator) -> Triangles:
    """Both rows of houses, garages in the wider gaps, and the boundaries of the front gardens."""
    parts = []
    for side, yaw in _sides():
        for middle, width, gap in _lots(rng):
            block = width > 12.0 and rng.random() < 0.45
            floors = 4 if block else int(rng.choice([2, 2, 3]))
            garden = float(rng.choice([0.2, 1.6, 2.6, 3.4]))
            depth = float(rng.uniform(8.5, 11.5))
            front = terrain.WALK_M + garden
            home = house(rng, width, depth, floors)
            parts.append(
                home.transformed(centreline.upright(middle, side * front, PAVEMENT_M, yaw))
            )
            if garden > 1:
                parts.append(_boundary(centreline, rng, side, middle, width))
            if gap > 4:
                place = middle + width / 2 + gap / 2
                parts.append(_yard(centreline, rng, side, yaw, place, gap))
    return Triangles.joined(parts)


def _boundary(
    centreline: Centreline, rng: np.random.Generator, side: int, middle: float, width: float
) -> Triangles:
    """Hedge, wall or fence in front of a garden, with a gate, and bushes behind it."""
    gate = float(rng.uniform(-0.2, 0.3)) * width
    kind = int(rng.integers(4))
    parts = []
    for start, end in ((-width / 2, gate - 0.7), (gate + 0.7, width / 2)):
        length = end - start
        if length < 0.8:
            continue
        pose = centreline.upright(middle + start, side * (terrain.WALK_M + 0.35), PAVEMENT_M)
        if kind == 0:
            piece = plants.hedge(rng, length, float(rng.uniform(0.9, 1.6)), 0.6)
        elif kind == 1:
            stone = Material("fence", PLASTERS[int(rng.integers(len(PLASTERS)))], 0.4)
            piece = furniture.wall(length, float(rng.uniform(0.5, 1.1)), stone.tinted(0.75))
        elif kind == 2:
            piece = furniture.fence(rng, length)
        else:
            piece = furniture.wall(length, 0.35, Material("fence", (0.3, 0.28, 0.26), 0.35))
        parts.append(piece.transformed(pose))
        if kind != 0 and rng.random() < 0.7:
            place = middle + start + length * float(rng.uniform(0.2, 0.8))
            bush = plants.bush(rng, float(rng.uniform(0.45, 0.8)))
            parts.append(
                bush.transformed(
                    centreline.upright(place, side * (terrain.WALK_M + 1.1), PAVEMENT_M)
                )
            )
    return Triangles.joined(parts)


def _yard(
    centreline: Centreline,
    rng: np.random.Generator,
    side: int,
    yaw: float,
    middle: float,
    gap: float,
) -> Triangles:
    """The gap between two houses: a garage, or trees behind a hedge."""
    if rng.random() < 0.5:
        box = shed(rng, min(gap - 0.8, 3.4), 5.5)
        place = centreline.upright(middle, side * (terrain.WALK_M + 4.5), PAVEMENT_M, yaw)
        drive = terrain.patch(centreline, middle, side, 3.0)
        return Triangles.joined([box.transformed(place), drive])
    parts = []
    hedge = plants.hedge(rng, gap - 0.4, 1.5, 0.7)
    start = centreline.upright(middle - gap / 2 + 0.2, side * (terrain.WALK_M + 0.5), PAVEMENT_M)
    parts.append(hedge.transformed(start))
    shade = plants.tree(rng, float(rng.uniform(6, 9)))
    parts.append(
        shade.transformed(centreline.upright(middle, side * (terrain.WALK_M + 6.0), PAVEMENT_M))
    )
    return Triangles.joined(parts)


def _parked(centreline: Centreline, rng: np.random.Generator) -> Triangles:
    """Cars along both kerbs, some reversed, some slots empty; none at the crossing."""
    parts = []
    for side, _ in _sides():
        s = FIRST_M + 4.0
        while s < LAST_M - 4:
            clear = abs(s - CROSSING_M) < 8 or abs(s - BRIDGE.s) < 4
            if not clear and rng.random() < 0.62:
                turned = np.pi if (rng.random() < 0.15) != (side > 0) else 0.0
                yaw = turned + float(rng.normal(scale=0.015))
                offset = side * (4.88 + float(rng.normal(scale=0.05)))
                place = centreline.pose(s + float(rng.uniform(-0.3, 0.3)), offset, 0.012, yaw)
                parts.append(car(rng).transformed(place))
            s += float(rng.uniform(5.4, 6.3))
    return Triangles.joined(parts)


def _trees(centreline: Centreline, rng: np.random.Generator) -> Triangles:
    """Street trees, and woods on the hills: copies of a few trees, rotated and scaled at random."""
    near = [plants.tree(rng, 7.0) for _ in range(7)]
    far = [plants.tree(rng, 10.0, near=False) for _ in range(5)]
    far += [plants.conifer(rng, 10.0) for _ in range(3)]
    parts = []

    def plant(kinds: list[Triangles], scale: float, s: float, d: float, h: float) -> None:
        kind = kinds[int(rng.integers(len(kinds)))].scaled(scale)
        parts.append(
            kind.transformed(centreline.upright(s, d, h, float(rng.uniform(0, 2 * np.pi))))
        )

    for side, _ in _sides():
        for s in np.arange(FIRST_M + 7, LAST_M - 5, 17.0) + 4.0 * side:
            if abs(s - BRIDGE.s) < 9 or abs(s - CROSSING_M) < 5 or rng.random() < 0.2:
                continue
            offset = side * (terrain.KERB_M + 0.55)
            scale, shift = float(rng.uniform(0.8, 1.2)), float(rng.uniform(-2, 2))
            plant(near, scale, s + shift, offset, PAVEMENT_M)
        for s in np.arange(FIRST_M, LAST_M, 6.5):
            out = float(rng.uniform(26, 90))
            if abs(s - BRIDGE.s) > 8:
                level = float(terrain.terrain_height(s, side * out, BRIDGE)) - 0.1
                plant(far, float(rng.uniform(0.7, 1.3)), s, side * out, level)
    return Triangles.joined(parts)


def _second_row(centreline: Centreline, rng: np.random.Generator) -> Triangles:
    parts = []
    for side, yaw in _sides():
        for s in np.arange(FIRST_M + 5, LAST_M - 5, 19.0):
            if abs(s - BRIDGE.s) < 24 or rng.random() < 0.25:
                continue
            out = float(rng.uniform(31, 37))
            level = float(terrain.terrain_height(s, side * out, BRIDGE))
            home = far_house(rng, float(rng.uniform(9, 13)), 9.0, int(rng.choice([2, 2, 3])))
            parts.append(home.transformed(centreline.upright(s, side * out, level, yaw)))
    return Triangles.joined(parts)


def _furniture(centreline: Centreline, rng: np.random.Generator) -> Triangles:
    """Lamps, signs, bins, cabinets, benches, a bus shelter, bollards at the crossing."""
    parts = []

    def put(object_: Triangles, s: float, d: float, yaw: float = 0.0) -> None:
        parts.append(object_.transformed(centreline.upright(s, d, PAVEMENT_M, yaw)))

    edge = terrain.KERB_M + 0.4
    for number, s in enumerate(np.arange(FIRST_M + 14, LAST_M - 5, 26.0)):
        side = 1 if number % 2 else -1
        put(furniture.lamp(), s, side * edge, 0.0 if side > 0 else np.pi)
    for s in np.arange(FIRST_M + 20, LAST_M - 5, 21.0):
        side = int(rng.choice([-1, 1]))
        put(
            furniture.sign(rng),
            s + float(rng.uniform(-4, 4)),
            side * edge,
            0.0 if side < 0 else np.pi,
        )
    for s in np.arange(FIRST_M + 9, LAST_M - 5, 11.0):
        side, kind = int(rng.choice([-1, 1])), float(rng.random())
        place, yaw = s + float(rng.uniform(-4, 4)), 0.0 if side > 0 else np.pi
        if kind < 0.35:
            for step in range(int(rng.integers(1, 4))):
                put(furniture.bin_(rng), place + 0.72 * step, side * (terrain.WALK_M - 0.4), yaw)
        elif kind < 0.5:
            put(furniture.cabinet(rng), place, side * (terrain.WALK_M - 0.3), yaw)
        elif kind < 0.6:
            put(furniture.bench(), place, side * (terrain.WALK_M - 0.45), yaw)
    put(furniture.shelter(), CROSSING_M + 18, -(terrain.WALK_M - 0.95), np.pi)
    for side in (1, -1):
        for along in (-3.2, 3.2):
            put(furniture.bollard(), CROSSING_M + along, side * (edge + 0.1))
    return Triangles.joined(parts)


def build_street(seed: int = 0) -> World:
    """The street with all static objects and actors; the same seed gives the same street.

    The world frame is the sensor frame at time 0: x ahead, y left, z up, metres.

    Examples
    --------
    >>> world = build_street(seed=3)
    >>> world.vehicle_pose_at(0.0).round(9).tolist()[0]
    [1.0, 0.0, 0.0, 0.0]
    """
    centreline = Centreline(FIRST_M, LAST_M)
    # One random stream for each part: a change to one part does not change the others.
    streams = [np.random.default_rng([seed, part]) for part in range(8)]
    parts = [
        terrain.carriageway(centreline, streams[0]),
        terrain.markings(centreline, (CROSSING_M,)),
        terrain.terrain(centreline, BRIDGE, streams[1]),
        terrain.bridge_over(centreline, BRIDGE),
        _houses(centreline, streams[2]),
        _second_row(centreline, streams[3]),
        _parked(centreline, streams[4]),
        _trees(centreline, streams[5]),
        _furniture(centreline, streams[6]),
    ]
    world_from_street = inverse(traffic.vehicle_pose(centreline, 0.0))
    return World(
        Triangles.joined(parts).transformed(world_from_street).rounded(),
        traffic.actors(centreline, streams[7], world_from_street, CROSSING_M),
        partial(_vehicle_pose, centreline, world_from_street),
        DRIVE_M / (traffic.SPEED_M_S + 0.1),
    )


def _vehicle_pose(
    centreline: Centreline, world_from_street: Float64Array, time_s: float
) -> Float64Array:
    if time_s == 0.0:
        return np.eye(4)
    return np.asarray(world_from_street @ traffic.vehicle_pose(centreline, time_s))
