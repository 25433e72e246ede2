"""Houses: walls with recessed windows and doors, roofs, chimneys, balconies."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from intervis.arrays import Float64Array
from intervis.lab.worlds import materials, shapes
from intervis.lab.worlds.triangles import Material, Triangles
from intervis.transform import rigid, transform

PLASTERS = (
    (0.66, 0.60, 0.47), (0.70, 0.68, 0.62), (0.62, 0.45, 0.31), (0.55, 0.56, 0.55),
    (0.68, 0.56, 0.36), (0.50, 0.57, 0.50), (0.58, 0.36, 0.27), (0.72, 0.70, 0.66),
    (0.46, 0.50, 0.57), (0.40, 0.19, 0.13), (0.64, 0.52, 0.46),
)  # fmt: skip
ROOFS = ((0.30, 0.10, 0.06), (0.24, 0.09, 0.06), (0.10, 0.10, 0.11), (0.20, 0.13, 0.10))
DOORS = ((0.20, 0.10, 0.05), (0.06, 0.13, 0.09), (0.30, 0.05, 0.04), (0.10, 0.11, 0.13))
FRAME = Material("window", (0.72, 0.72, 0.70), 0.45)
RECESS_M, DOOR_RECESS_M = 0.17, 0.25
SILL = Material("building", (0.60, 0.59, 0.56), 0.42)


@dataclass(frozen=True)
class Opening:
    """A window or door in a wall: its extent along and up the wall, metres."""

    left_m: float
    right_m: float
    low_m: float
    high_m: float
    door: bool = False


@dataclass(frozen=True)
class Front:
    """A flat wall from `corner` along `along` for `width_m`, facing `along` x up.

    Its parts are built in its own coordinates: along the wall, up, outwards.
    """

    corner: tuple[float, float, float]
    along: tuple[float, float, float]
    width_m: float
    height_m: float

    @property
    def pose(self) -> Float64Array:
        """(4, 4) house_from_front."""
        up = np.array([0.0, 0.0, 1.0])
        return rigid(np.stack([self.along, up, np.cross(self.along, up)], axis=1), self.corner)


def _flat(left: float, right: float, low: float, high: float, out: float = 0.0) -> Float64Array:
    """(2, 3, 3) a rectangle parallel to a wall."""
    return shapes.quad([left, low, out], [right, low, out], [right, high, out], [left, high, out])


def _slab(
    left: float, right: float, low: float, high: float, depth: tuple[float, float]
) -> Float64Array:
    """(10, 3, 3) a box on a wall, from `depth[0]` to `depth[1]` in front of it."""
    return shapes.box([left, low, depth[0]], [right, high, depth[1]], bottom=False)


def _wall(width_m: float, height_m: float, openings: list[Opening]) -> Float64Array:
    """A wall around its openings, as rectangles between their edges."""
    u_cuts = sorted({0.0, width_m, *(x for o in openings for x in (o.left_m, o.right_m))})
    v_cuts = sorted({0.0, height_m, *(x for o in openings for x in (o.low_m, o.high_m))})
    pieces = []
    for low, high in pairwise(v_cuts):
        here = [o for o in openings if o.low_m < (low + high) / 2 < o.high_m]
        left = None
        for start, end in pairwise(u_cuts):
            free = not any(o.left_m < (start + end) / 2 < o.right_m for o in here)
            if free and left is None:
                left = start
            if left is not None and not free:
                pieces.append(_flat(left, start, low, high))
                left = None
        if left is not None:
            pieces.append(_flat(left, width_m, low, high))
    return np.concatenate(pieces)


def _reveal(opening: Opening, depth_m: float) -> Float64Array:
    """(8, 3, 3) the four sides of a recess."""
    u = [opening.left_m, opening.right_m, opening.right_m, opening.left_m]
    v = [opening.low_m, opening.low_m, opening.high_m, opening.high_m]
    face, back = np.column_stack([u, v, [0.0] * 4]), np.column_stack([u, v, [-depth_m] * 4])
    return np.concatenate(
        [shapes.quad(face[k - 1], face[k], back[k], back[k - 1]) for k in range(4)]
    )


def _window(width: float, height: float, shutters: Material | None) -> Triangles:
    """A window with its lower left corner at the origin, recessed by `RECESS_M`."""
    bar, before, middle = 0.06, -RECESS_M + 0.04, width / 2
    bars = [
        _flat(0, bar, 0, height, before),
        _flat(width - bar, width, 0, height, before),
        _flat(bar, width - bar, height - bar, height, before),
        _flat(bar, width - bar, 0, bar, before),
        _flat(middle - bar / 2, middle + bar / 2, bar, height - bar, before),
    ]
    parts = [
        Triangles.of(_flat(0, width, 0, height, -RECESS_M), materials.PANE),
        Triangles.of(np.concatenate(bars), FRAME),
        Triangles.of(_slab(-0.05, width + 0.05, -0.06, 0.0, (0.0, 0.09)), SILL),
    ]
    if shutters is not None:
        wings = [
            _slab(-middle, 0.0, 0.0, height, (0.0, 0.045)),
            _slab(width, width + middle, 0.0, height, (0.0, 0.045)),
        ]
        parts.append(Triangles.of(np.concatenate(wings), shutters))
    return Triangles.joined(parts)


def _door(opening: Opening, material: Material) -> Triangles:
    left, right, low, high = opening.left_m, opening.right_m, opening.low_m, opening.high_m
    canopy = _slab(left - 0.25, right + 0.25, high + 0.12, high + 0.22, (0.0, 0.75))
    step = _slab(left - 0.15, right + 0.15, 0.0, low, (0.0, 0.55))
    return Triangles.joined(
        [
            Triangles.of(_flat(left, right, low, high - 0.4, -DOOR_RECESS_M), material),
            Triangles.of(_flat(left, right, high - 0.4, high, -DOOR_RECESS_M), materials.PANE),
            Triangles.of(np.concatenate([canopy, step]), SILL),
        ]
    )


def _windows(
    rng: np.random.Generator, front: Front, floors: int, storey_m: float, door: bool, spacing: float
) -> list[Opening]:
    """Windows in rows and columns, optionally with a door on the ground floor."""
    columns = max(1, int((front.width_m - 0.6) / spacing))
    pitch = front.width_m / columns
    width = min(1.25, pitch * 0.45)
    entrance = int(rng.integers(columns)) if door else -1
    openings = []
    for floor in range(floors):
        for column in range(columns):
            middle = (column + 0.5) * pitch
            if floor == 0 and column == entrance:
                openings.append(Opening(middle - 0.55, middle + 0.55, 0.32, 2.55, door=True))
                continue
            sill = 0.5 + floor * storey_m + 0.85
            openings.append(Opening(middle - width / 2, middle + width / 2, sill, sill + 1.35))
    return openings


def _face(
    rng: np.random.Generator,
    front: Front,
    openings: list[Opening],
    plaster: Material,
    shutters: Material | None,
) -> Triangles:
    """A wall with windows, door and plinth, in the house frame."""
    door = Material("building", DOORS[int(rng.integers(len(DOORS)))], 0.3)
    parts = [
        Triangles.of(_wall(front.width_m, front.height_m, openings), plaster),
        Triangles.of(_slab(0, front.width_m, 0.0, 0.32, (0.0, 0.03)), plaster.tinted(0.55)),
    ]
    parts += [_door(opening, door) for opening in openings if opening.door]
    reveals = [_reveal(o, DOOR_RECESS_M if o.door else RECESS_M) for o in openings]
    parts += [Triangles.of(reveal, plaster.tinted(0.9)) for reveal in reveals]
    windows = [opening for opening in openings if not opening.door]
    if windows:
        size = windows[0].right_m - windows[0].left_m, windows[0].high_m - windows[0].low_m
        one = _window(*size, shutters)
        parts += [one.translated(o.left_m, o.low_m, 0.0) for o in windows]
    return Triangles.joined(parts).transformed(front.pose)


def _gable_roof(
    rng: np.random.Generator, width: float, depth: float, eaves: float, plaster: Material
) -> Triangles:
    """A gable roof with its ridge at half the depth, and a chimney."""
    ridge = eaves + depth / 2 * float(rng.uniform(0.7, 1.05))
    tile = Material("roof", ROOFS[int(rng.integers(len(ROOFS)))], 0.3)
    pitch = (ridge - eaves) / (depth / 2)
    over, half = 0.45, width / 2
    x = [-half - 0.2, half + 0.2]
    slopes = []
    for lift in (0.0, 0.14):
        low, top = eaves - over * pitch + lift, ridge + lift
        slopes.append(
            shapes.quad([x[0], -over, low], [x[1], -over, low], [x[1], depth / 2, top],
                        [x[0], depth / 2, top])
        )  # fmt: skip
        slopes.append(
            shapes.quad([x[1], depth + over, low], [x[0], depth + over, low],
                        [x[0], depth / 2, top], [x[1], depth / 2, top])
        )  # fmt: skip
    gables = np.array(
        [
            [[-half, depth, eaves], [-half, 0, eaves], [-half, depth / 2, ridge]],
            [[half, 0, eaves], [half, depth, eaves], [half, depth / 2, ridge]],
        ]
    )
    edge = eaves - over * pitch
    gutter = [
        shapes.box([x[0], -over - 0.09, edge - 0.02], [x[1], -over + 0.02, edge + 0.13]),
        shapes.box([x[0], depth + over, edge - 0.02], [x[1], depth + over + 0.09, edge + 0.13]),
    ]
    place = float(rng.uniform(-0.3, 0.3)) * width
    chimney = shapes.box(
        [place - 0.3, depth / 2 + 0.3, eaves + 0.5], [place + 0.3, depth / 2 + 1.0, ridge + 0.9]
    )
    return Triangles.joined(
        [
            Triangles.of(np.concatenate(slopes), tile),
            Triangles.of(gables, plaster),
            Triangles.of(np.concatenate(gutter), Material("roof", (0.3, 0.31, 0.32), 0.4)),
            Triangles.of(chimney, Material("building", (0.30, 0.13, 0.09), 0.3)),
        ]
    )


def _flat_roof(width: float, depth: float, eaves: float, plaster: Material) -> Triangles:
    half = width / 2
    deck = shapes.quad([-half, 0, eaves], [half, 0, eaves], [half, depth, eaves],
                       [-half, depth, eaves])  # fmt: skip
    rim = [
        shapes.box([-half - 0.08, -0.08, eaves], [half + 0.08, 0.2, eaves + 0.45]),
        shapes.box([-half - 0.08, depth - 0.2, eaves], [half + 0.08, depth + 0.08, eaves + 0.45]),
        shapes.box([-half - 0.08, 0.2, eaves], [-half + 0.2, depth - 0.2, eaves + 0.45]),
        shapes.box([half - 0.2, 0.2, eaves], [half + 0.08, depth - 0.2, eaves + 0.45]),
    ]
    return Triangles.joined(
        [
            Triangles.of(deck, Material("roof", (0.16, 0.16, 0.16), 0.2)),
            Triangles.of(np.concatenate(rim), plaster.tinted(0.8)),
        ]
    )


def _balconies(front: Front, openings: list[Opening], storey_m: float) -> Triangles:
    """A balcony at every third window above the ground floor, in the house frame."""
    steel = Material("building", (0.14, 0.15, 0.16), 0.25)
    parts = []
    upper = [opening for opening in openings if opening.low_m > storey_m]
    for opening in upper[1::3]:
        left, right, floor = opening.left_m - 0.5, opening.right_m + 0.5, opening.low_m - 0.85
        slab = _slab(left, right, floor - 0.16, floor, (0.0, 1.2))
        bars = [
            _slab(left, right, floor + 0.95, floor + 1.0, (1.15, 1.2)),
            _slab(left, left + 0.05, floor + 0.95, floor + 1.0, (0.0, 1.2)),
            _slab(right - 0.05, right, floor + 0.95, floor + 1.0, (0.0, 1.2)),
        ]
        for place in np.arange(left, right, 0.22):
            bars.append(_flat(place, place + 0.04, floor, floor + 0.95, 1.18))
        parts += [Triangles.of(slab, SILL), Triangles.of(np.concatenate(bars), steel)]
    return Triangles.joined(parts).transformed(front.pose)


def house(rng: np.random.Generator, width_m: float, depth_m: float, floors: int) -> Triangles:
    """A house on the ground: its front along x, centred on the origin, facing -y.

    Parameters
    ----------
    rng : numpy Generator
        Selects storey height, colours, windows and roof.
    width_m, depth_m : float
        The walls extend over x from -width / 2 to width / 2 and y from 0 to depth.
    floors : int
        Number of storeys; four or more give a flat roof.
    """
    storey = float(rng.uniform(2.7, 3.0))
    eaves = 0.5 + floors * storey + 0.25
    plaster = Material("building", PLASTERS[int(rng.integers(len(PLASTERS)))], 0.45)
    plaster = plaster.tinted(float(rng.uniform(0.85, 1.0)))
    shutters = None
    if floors < 4 and rng.random() < 0.4:
        shutters = Material("building", DOORS[int(rng.integers(len(DOORS)))], 0.3).tinted(1.3)
    half = width_m / 2
    street = Front((-half, 0, 0), (1, 0, 0), width_m, eaves)
    sides = [
        Front((-half, depth_m, 0), (0, -1, 0), depth_m, eaves),
        Front((half, 0, 0), (0, 1, 0), depth_m, eaves),
    ]
    openings = _windows(rng, street, floors, storey, True, 2.5)
    parts = [_face(rng, street, openings, plaster, shutters)]
    for side in sides:
        few = _windows(rng, side, floors, storey, False, 4.2)
        parts.append(_face(rng, side, few, plaster, None))
    back = Front((half, depth_m, 0), (-1, 0, 0), width_m, eaves)
    parts.append(Triangles.of(_wall(width_m, eaves, []), plaster).transformed(back.pose))
    if floors >= 4:
        parts += [
            _flat_roof(width_m, depth_m, eaves, plaster),
            _balconies(street, openings, storey),
        ]
    else:
        parts.append(_gable_roof(rng, width_m, depth_m, eaves, plaster))
    return Triangles.joined(parts)


def shed(rng: np.random.Generator, width_m: float, depth_m: float) -> Triangles:
    """A garage: its door along x, centred on the origin, facing -y."""
    plaster = Material("building", PLASTERS[int(rng.integers(len(PLASTERS)))], 0.42)
    half = width_m / 2
    body = shapes.box([-half, 0, -0.1], [half, depth_m, 2.55])
    door = shapes.box([-half + 0.3, -0.03, 0.05], [half - 0.3, 0.02, 2.15])
    metal = Material("building", DOORS[int(rng.integers(len(DOORS)))], 0.35).tinted(1.6)
    return Triangles.joined(
        [
            Triangles.of(body, plaster),
            Triangles.of(door, metal),
            _flat_roof(width_m, depth_m, 2.55, plaster),
        ]
    )


def far_house(rng: np.random.Generator, width_m: float, depth_m: float, floors: int) -> Triangles:
    """A simple house for the second row: walls, roof, flat windows."""
    eaves = 0.5 + floors * 2.9
    plaster = Material("building", PLASTERS[int(rng.integers(len(PLASTERS)))], 0.45)
    half = width_m / 2
    walls = shapes.box([-half, 0, -1.5], [half, depth_m, eaves], bottom=False)
    panes = []
    for front in (
        Front((-half, 0, 0), (1, 0, 0), width_m, eaves),
        Front((-half, depth_m, 0), (0, -1, 0), depth_m, eaves),
        Front((half, 0, 0), (0, 1, 0), depth_m, eaves),
    ):
        for opening in _windows(rng, front, floors, 2.9, False, 2.8):
            pane = _flat(opening.left_m, opening.right_m, opening.low_m, opening.high_m, 0.02)
            panes.append(transform(front.pose, pane))
    return Triangles.joined(
        [
            Triangles.of(walls, plaster),
            Triangles.of(np.concatenate(panes), materials.PANE),
            _gable_roof(rng, width_m, depth_m, eaves, plaster),
        ]
    )
