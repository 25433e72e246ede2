"""Houses: fronts with recessed windows and doors, roofs, chimneys, balconies."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from intervis.arrays import Float64Array
from intervis.lab.worlds import materials as of
from intervis.lab.worlds import shapes
from intervis.lab.worlds.triangles import Material, Soup
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
    """A window or door in a front: from, to, metres along and up it."""

    left_m: float
    right_m: float
    low_m: float
    high_m: float
    door: bool = False


@dataclass(frozen=True)
class Front:
    """A flat wall standing on `corner`, running `width_m` along `along`, facing along x up.

    What belongs to it is built in its own coordinates: along it, up it, out of it.
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
    """(2, 3, 3) a rectangle parallel to a front."""
    return shapes.quad([left, low, out], [right, low, out], [right, high, out], [left, high, out])


def _slab(
    left: float, right: float, low: float, high: float, depth: tuple[float, float]
) -> Float64Array:
    """(10, 3, 3) a box on a front, from `depth[0]` to `depth[1]` before it."""
    return shapes.box([left, low, depth[0]], [right, high, depth[1]], bottom=False)


def _wall(width_m: float, height_m: float, openings: list[Opening]) -> Float64Array:
    """A front around its openings: rectangles between the lines that they draw."""
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
    """(8, 3, 3) the four cheeks of a recess."""
    u = [opening.left_m, opening.right_m, opening.right_m, opening.left_m]
    v = [opening.low_m, opening.low_m, opening.high_m, opening.high_m]
    face, back = np.column_stack([u, v, [0.0] * 4]), np.column_stack([u, v, [-depth_m] * 4])
    return np.concatenate(
        [shapes.quad(face[k - 1], face[k], back[k], back[k - 1]) for k in range(4)]
    )


def _window(width: float, height: float, shutters: Material | None) -> Soup:
    """A window with its lower left corner at the origin, set back by `RECESS_M`."""
    bar, before, middle = 0.06, -RECESS_M + 0.04, width / 2
    bars = [
        _flat(0, bar, 0, height, before),
        _flat(width - bar, width, 0, height, before),
        _flat(bar, width - bar, height - bar, height, before),
        _flat(bar, width - bar, 0, bar, before),
        _flat(middle - bar / 2, middle + bar / 2, bar, height - bar, before),
    ]
    parts = [
        Soup.of(_flat(0, width, 0, height, -RECESS_M), of.PANE),
        Soup.of(np.concatenate(bars), FRAME),
        Soup.of(_slab(-0.05, width + 0.05, -0.06, 0.0, (0.0, 0.09)), SILL),
    ]
    if shutters is not None:
        wings = [
            _slab(-middle, 0.0, 0.0, height, (0.0, 0.045)),
            _slab(width, width + middle, 0.0, height, (0.0, 0.045)),
        ]
        parts.append(Soup.of(np.concatenate(wings), shutters))
    return Soup.joined(parts)


def _door(opening: Opening, material: Material) -> Soup:
    left, right, low, high = opening.left_m, opening.right_m, opening.low_m, opening.high_m
    canopy = _slab(left - 0.25, right + 0.25, high + 0.12, high + 0.22, (0.0, 0.75))
    step = _slab(left - 0.15, right + 0.15, 0.0, low, (0.0, 0.55))
    return Soup.joined(
        [
            Soup.of(_flat(left, right, low, high - 0.4, -DOOR_RECESS_M), material),
            Soup.of(_flat(left, right, high - 0.4, high, -DOOR_RECESS_M), of.PANE),
            Soup.of(np.concatenate([canopy, step]), SILL),
        ]
    )


def _windows(
    rng: np.random.Generator, front: Front, floors: int, storey_m: float, door: bool, spacing: float
) -> list[Opening]:
    """Windows in rows and columns, with a door in one of the columns on the ground floor."""
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
) -> Soup:
    """A wall with its windows, door and plinth, in the house's frame."""
    door = Material("building", DOORS[int(rng.integers(len(DOORS)))], 0.3)
    parts = [
        Soup.of(_wall(front.width_m, front.height_m, openings), plaster),
        Soup.of(_slab(0, front.width_m, 0.0, 0.32, (0.0, 0.03)), plaster.tinted(0.55)),
    ]
    parts += [_door(opening, door) for opening in openings if opening.door]
    reveals = [_reveal(o, DOOR_RECESS_M if o.door else RECESS_M) for o in openings]
    parts += [Soup.of(reveal, plaster.tinted(0.9)) for reveal in reveals]
    windows = [opening for opening in openings if not opening.door]
    if windows:
        size = windows[0].right_m - windows[0].left_m, windows[0].high_m - windows[0].low_m
        one = _window(*size, shutters)
        parts += [one.shifted(o.left_m, o.low_m, 0.0) for o in windows]
    return Soup.joined(parts).moved(front.pose)


def _gable_roof(
    rng: np.random.Generator, width: float, depth: float, eaves: float, plaster: Material
) -> Soup:
    """Two slopes that meet over the middle of the depth, gables, a chimney."""
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
    return Soup.joined(
        [
            Soup.of(np.concatenate(slopes), tile),
            Soup.of(gables, plaster),
            Soup.of(np.concatenate(gutter), Material("roof", (0.3, 0.31, 0.32), 0.4)),
            Soup.of(chimney, Material("building", (0.30, 0.13, 0.09), 0.3)),
        ]
    )


def _flat_roof(width: float, depth: float, eaves: float, plaster: Material) -> Soup:
    half = width / 2
    deck = shapes.quad([-half, 0, eaves], [half, 0, eaves], [half, depth, eaves],
                       [-half, depth, eaves])  # fmt: skip
    rim = [
        shapes.box([-half - 0.08, -0.08, eaves], [half + 0.08, 0.2, eaves + 0.45]),
        shapes.box([-half - 0.08, depth - 0.2, eaves], [half + 0.08, depth + 0.08, eaves + 0.45]),
        shapes.box([-half - 0.08, 0.2, eaves], [-half + 0.2, depth - 0.2, eaves + 0.45]),
        shapes.box([half - 0.2, 0.2, eaves], [half + 0.08, depth - 0.2, eaves + 0.45]),
    ]
    return Soup.joined(
        [
            Soup.of(deck, Material("roof", (0.16, 0.16, 0.16), 0.2)),
            Soup.of(np.concatenate(rim), plaster.tinted(0.8)),
        ]
    )


def _balconies(front: Front, openings: list[Opening], storey_m: float) -> Soup:
    """A balcony before every third window above the ground floor, in the house's frame."""
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
        parts += [Soup.of(slab, SILL), Soup.of(np.concatenate(bars), steel)]
    return Soup.joined(parts).moved(front.pose)


def house(rng: np.random.Generator, width_m: float, depth_m: float, floors: int) -> Soup:
    """A house on the ground: its front along x about the origin, looking along -y.

    Parameters
    ----------
    rng : numpy Generator
        Which house it becomes.
    width_m, depth_m : float
        Of its walls; the house takes x from -width / 2 to width / 2 and y from 0 to depth.
    floors : int
        Storeys; four or more give a block with a flat roof.
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
    parts.append(Soup.of(_wall(width_m, eaves, []), plaster).moved(back.pose))
    if floors >= 4:
        parts += [
            _flat_roof(width_m, depth_m, eaves, plaster),
            _balconies(street, openings, storey),
        ]
    else:
        parts.append(_gable_roof(rng, width_m, depth_m, eaves, plaster))
    return Soup.joined(parts)


def shed(rng: np.random.Generator, width_m: float, depth_m: float) -> Soup:
    """A garage: its door along x about the origin, looking along -y."""
    plaster = Material("building", PLASTERS[int(rng.integers(len(PLASTERS)))], 0.42)
    half = width_m / 2
    body = shapes.box([-half, 0, -0.1], [half, depth_m, 2.55])
    door = shapes.box([-half + 0.3, -0.03, 0.05], [half - 0.3, 0.02, 2.15])
    metal = Material("building", DOORS[int(rng.integers(len(DOORS)))], 0.35).tinted(1.6)
    return Soup.joined(
        [
            Soup.of(body, plaster),
            Soup.of(door, metal),
            _flat_roof(width_m, depth_m, 2.55, plaster),
        ]
    )


def far_house(rng: np.random.Generator, width_m: float, depth_m: float, floors: int) -> Soup:
    """A plain house for the second row: walls, roof, flat windows."""
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
    return Soup.joined(
        [
            Soup.of(walls, plaster),
            Soup.of(np.concatenate(panes), of.PANE),
            _gable_roof(rng, width_m, depth_m, eaves, plaster),
        ]
    )
