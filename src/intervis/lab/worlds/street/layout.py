"""The built-in street: two rows of houses, parked cars, trees, a bridge, a hill at its end."""

from collections.abc import Iterator
from functools import partial

import numpy as np

from intervis.arrays import Float64Array
from intervis.lab.worlds.street import furniture, plants, terrain, traffic
from intervis.lab.worlds.street.cars import car
from intervis.lab.worlds.street.centreline import Path
from intervis.lab.worlds.street.houses import PLASTERS, far_house, house, shed
from intervis.lab.worlds.triangles import Material, Soup
from intervis.lab.worlds.world import World
from intervis.transform import inverse

FIRST_M, LAST_M = -110.0, 430.0
DRIVE_M = 300.0
CROSSING_M = 33.0
BRIDGE = terrain.Bridge()
PAVEMENT_M = terrain.KERB_HIGH_M


def _sides() -> Iterator[tuple[int, float]]:
    """Left (1) and right (-1), each with the turn that makes y point away from the street."""
    yield 1, 0.0
    yield -1, np.pi


def _lots(rng: np.random.Generator) -> list[tuple[float, float, float]]:
    """Building lots on one side: middle, width, gap behind it; none where the bridge lands."""
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


def _houses(path: Path, rng: np.random.Generator) -> Soup:
    """Both rows of houses, garages in the wider gaps, and what bounds the front gardens."""
    parts = []
    for side, yaw in _sides():
        for middle, width, gap in _lots(rng):
            block = width > 12.0 and rng.random() < 0.45
            floors = 4 if block else int(rng.choice([2, 2, 3]))
            garden = float(rng.choice([0.2, 1.6, 2.6, 3.4]))
            depth = float(rng.uniform(8.5, 11.5))
            front = terrain.WALK_M + garden
            home = house(rng, width, depth, floors)
            parts.append(home.moved(path.upright(middle, side * front, PAVEMENT_M, yaw)))
            if garden > 1:
                parts.append(_boundary(path, rng, side, middle, width))
            if gap > 4:
                place = middle + width / 2 + gap / 2
                parts.append(_yard(path, rng, side, yaw, place, gap))
    return Soup.joined(parts)


def _boundary(path: Path, rng: np.random.Generator, side: int, middle: float, width: float) -> Soup:
    """Hedge, wall or fence before a garden, with a way in, and bushes behind it."""
    gate = float(rng.uniform(-0.2, 0.3)) * width
    kind = int(rng.integers(4))
    parts = []
    for start, end in ((-width / 2, gate - 0.7), (gate + 0.7, width / 2)):
        length = end - start
        if length < 0.8:
            continue
        pose = path.upright(middle + start, side * (terrain.WALK_M + 0.35), PAVEMENT_M)
        if kind == 0:
            piece = plants.hedge(rng, length, float(rng.uniform(0.9, 1.6)), 0.6)
        elif kind == 1:
            stone = Material("fence", PLASTERS[int(rng.integers(len(PLASTERS)))], 0.4)
            piece = furniture.wall(length, float(rng.uniform(0.5, 1.1)), stone.tinted(0.75))
        elif kind == 2:
            piece = furniture.fence(rng, length)
        else:
            piece = furniture.wall(length, 0.35, Material("fence", (0.3, 0.28, 0.26), 0.35))
        parts.append(piece.moved(pose))
        if kind != 0 and rng.random() < 0.7:
            place = middle + start + length * float(rng.uniform(0.2, 0.8))
            bush = plants.bush(rng, float(rng.uniform(0.45, 0.8)))
            parts.append(bush.moved(path.upright(place, side * (terrain.WALK_M + 1.1), PAVEMENT_M)))
    return Soup.joined(parts)


def _yard(
    path: Path, rng: np.random.Generator, side: int, yaw: float, middle: float, gap: float
) -> Soup:
    """What fills the gap between two houses: a garage, or trees behind a hedge."""
    if rng.random() < 0.5:
        box = shed(rng, min(gap - 0.8, 3.4), 5.5)
        place = path.upright(middle, side * (terrain.WALK_M + 4.5), PAVEMENT_M, yaw)
        drive = terrain.patch(path, middle, side, 3.0)
        return Soup.joined([box.moved(place), drive])
    parts = []
    hedge = plants.hedge(rng, gap - 0.4, 1.5, 0.7)
    start = path.upright(middle - gap / 2 + 0.2, side * (terrain.WALK_M + 0.5), PAVEMENT_M)
    parts.append(hedge.moved(start))
    shade = plants.tree(rng, float(rng.uniform(6, 9)))
    parts.append(shade.moved(path.upright(middle, side * (terrain.WALK_M + 6.0), PAVEMENT_M)))
    return Soup.joined(parts)


def _parked(path: Path, rng: np.random.Generator) -> Soup:
    """Cars along both kerbs, some turned round, some slots empty; none at the crossing."""
    parts = []
    for side, _ in _sides():
        s = FIRST_M + 4.0
        while s < LAST_M - 4:
            clear = abs(s - CROSSING_M) < 8 or abs(s - BRIDGE.s) < 4
            if not clear and rng.random() < 0.62:
                turned = np.pi if (rng.random() < 0.15) != (side > 0) else 0.0
                yaw = turned + float(rng.normal(scale=0.015))
                offset = side * (4.88 + float(rng.normal(scale=0.05)))
                place = path.pose(s + float(rng.uniform(-0.3, 0.3)), offset, 0.012, yaw)
                parts.append(car(rng).moved(place))
            s += float(rng.uniform(5.4, 6.3))
    return Soup.joined(parts)


def _trees(path: Path, rng: np.random.Generator) -> Soup:
    """Street trees, and woods on the hills: a few trees, each turned and scaled anew."""
    near = [plants.tree(rng, 7.0) for _ in range(7)]
    far = [plants.tree(rng, 10.0, near=False) for _ in range(5)]
    far += [plants.conifer(rng, 10.0) for _ in range(3)]
    parts = []

    def plant(kinds: list[Soup], scale: float, s: float, d: float, h: float) -> None:
        kind = kinds[int(rng.integers(len(kinds)))].scaled(scale)
        parts.append(kind.moved(path.upright(s, d, h, float(rng.uniform(0, 2 * np.pi)))))

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
    return Soup.joined(parts)


def _second_row(path: Path, rng: np.random.Generator) -> Soup:
    parts = []
    for side, yaw in _sides():
        for s in np.arange(FIRST_M + 5, LAST_M - 5, 19.0):
            if abs(s - BRIDGE.s) < 24 or rng.random() < 0.25:
                continue
            out = float(rng.uniform(31, 37))
            level = float(terrain.terrain_height(s, side * out, BRIDGE))
            home = far_house(rng, float(rng.uniform(9, 13)), 9.0, int(rng.choice([2, 2, 3])))
            parts.append(home.moved(path.upright(s, side * out, level, yaw)))
    return Soup.joined(parts)


def _furniture(path: Path, rng: np.random.Generator) -> Soup:
    """Lamps, signs, bins, cabinets, benches, a shelter, bollards at the crossing."""
    parts = []

    def put(soup: Soup, s: float, d: float, yaw: float = 0.0) -> None:
        parts.append(soup.moved(path.upright(s, d, PAVEMENT_M, yaw)))

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
    return Soup.joined(parts)


def build_street(seed: int = 0) -> World:
    """The street with all that stands and moves in it, the same for the same seed.

    The world's frame is the sensor's at time 0: x ahead, y left, z up, metres.

    Examples
    --------
    >>> world = build_street(seed=3)
    >>> world.vehicle_pose_at(0.0).round(9).tolist()[0]
    [1.0, 0.0, 0.0, 0.0]
    """
    path = Path(FIRST_M, LAST_M)
    # A stream of its own for each part: a change to one leaves the others as they are.
    streams = [np.random.default_rng([seed, part]) for part in range(8)]
    parts = [
        terrain.carriageway(path, streams[0]),
        terrain.markings(path, (CROSSING_M,)),
        terrain.terrain(path, BRIDGE, streams[1]),
        terrain.bridge_over(path, BRIDGE),
        _houses(path, streams[2]),
        _second_row(path, streams[3]),
        _parked(path, streams[4]),
        _trees(path, streams[5]),
        _furniture(path, streams[6]),
    ]
    world_from_street = inverse(traffic.vehicle_pose(path, 0.0))
    return World(
        Soup.joined(parts).moved(world_from_street).stored(),
        traffic.movers(path, streams[7], world_from_street, CROSSING_M),
        partial(_vehicle_pose, path, world_from_street),
        DRIVE_M / (traffic.SPEED_M_S + 0.1),
    )


def _vehicle_pose(path: Path, world_from_street: Float64Array, time_s: float) -> Float64Array:
    if time_s == 0.0:
        return np.eye(4)
    return np.asarray(world_from_street @ traffic.vehicle_pose(path, time_s))
