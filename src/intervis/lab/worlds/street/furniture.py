"""Street furniture: lamps, signs, bins, benches, walls and fences."""

import numpy as np

from intervis.arrays import Float64Array
from intervis.lab.worlds import materials, shapes
from intervis.lab.worlds.triangles import Material, Triangles

SIGN_WHITE = Material("sign", (0.80, 0.80, 0.78), 1.6)
SIGN_RED = Material("sign", (0.55, 0.03, 0.03), 1.3)
SIGN_BLUE = Material("sign", (0.02, 0.10, 0.42), 1.2)
SIGN_YELLOW = Material("sign", (0.80, 0.55, 0.03), 1.4)


def lamp(height_m: float = 7.2, reach_m: float = 1.9) -> Triangles:
    """A street lamp at the origin whose arm extends along -y, towards the road."""
    pole = shapes.tube([0.085, 0.08, 0.05], [-0.1, 1.2, height_m], 8)
    arm = shapes.box([-0.03, -reach_m, height_m - 0.05], [0.03, 0.0, height_m + 0.01])
    head = shapes.box([-0.14, -reach_m - 0.55, height_m - 0.09], [0.14, -reach_m, height_m + 0.05])
    glow = shapes.box(
        [-0.11, -reach_m - 0.5, height_m - 0.11], [0.11, -reach_m - 0.05, height_m - 0.088]
    )
    return Triangles.joined(
        [
            Triangles.of(np.concatenate([pole, arm]), materials.STEEL),
            Triangles.of(head, Material("pole", (0.2, 0.21, 0.22), 0.3)),
            Triangles.of(glow, Material("pole", (0.85, 0.85, 0.78), 0.5)),
        ]
    )


def _disc(radius_m: float, corners: int, turn_rad: float, x_m: float) -> Float64Array:
    """A flat regular polygon about the x axis, facing -x."""
    angle = turn_rad + np.linspace(0, 2 * np.pi, corners, endpoint=False)
    rim = np.stack(
        [np.full(corners, x_m), -radius_m * np.cos(angle), radius_m * np.sin(angle)], axis=1
    )
    return shapes.fan(rim)


def sign(rng: np.random.Generator) -> Triangles:
    """A traffic sign at the origin, facing -x, towards traffic that drives along x."""
    pole = Triangles.of(shapes.tube([0.032, 0.032], [-0.1, 2.75], 6), materials.STEEL)
    back = _disc(0.31, 16, 0.0, 0.012)[:, ::-1]
    kind = int(rng.integers(4))
    if kind == 0:  # a limit
        faces = [
            (_disc(0.31, 18, 0, 0), SIGN_RED),
            (_disc(0.23, 18, 0, -0.006), SIGN_WHITE),
            (shapes.quad([-0.012, 0.09, -0.1], [-0.012, 0.03, -0.1], [-0.012, 0.03, 0.1],
                         [-0.012, 0.09, 0.1]), materials.TYRE),
            (shapes.quad([-0.012, -0.02, -0.1], [-0.012, -0.1, -0.1], [-0.012, -0.1, 0.1],
                         [-0.012, -0.02, 0.1]), materials.TYRE),
        ]  # fmt: skip
    elif kind == 1:  # priority
        faces = [
            (_disc(0.36, 4, 0, 0), SIGN_WHITE),
            (_disc(0.26, 4, 0, -0.006), SIGN_YELLOW),
        ]
    elif kind == 2:  # no stopping
        faces = [
            (_disc(0.31, 18, 0, 0), SIGN_RED),
            (_disc(0.24, 18, 0, -0.006), SIGN_BLUE),
            (shapes.quad([-0.012, 0.2, 0.15], [-0.012, 0.15, 0.2], [-0.012, -0.2, -0.15],
                         [-0.012, -0.15, -0.2]), SIGN_RED),
        ]  # fmt: skip
    else:  # a parking place
        faces = [
            (_disc(0.38, 4, np.pi / 4, 0), SIGN_WHITE),
            (_disc(0.35, 4, np.pi / 4, -0.006), SIGN_BLUE),
        ]
    raised = [0.0, 0.0, 2.4]
    parts = [Triangles.of(face + raised + [-0.05, 0, 0], material) for face, material in faces]
    return Triangles.joined(
        [pole, Triangles.of(back + raised + [-0.05, 0, 0], materials.STEEL), *parts]
    )


def bin_(rng: np.random.Generator) -> Triangles:
    """A wheeled dustbin at the origin."""
    colours = ((0.03, 0.035, 0.03), (0.02, 0.08, 0.22), (0.45, 0.33, 0.02), (0.13, 0.08, 0.04))
    material = Material("furniture", colours[int(rng.integers(4))], 0.2)
    body = shapes.box([-0.27, -0.25, 0.04], [0.27, 0.3, 0.95])
    body[:, :, 1] *= np.where(body[:, :, 2] < 0.5, 0.82, 1.0)
    body[:, :, 0] *= np.where(body[:, :, 2] < 0.5, 0.85, 1.0)
    lid = shapes.box([-0.3, -0.3, 0.95], [0.3, 0.36, 1.06])
    return Triangles.joined([Triangles.of(body, material), Triangles.of(lid, material.tinted(1.3))])


def cabinet(rng: np.random.Generator) -> Triangles:
    """A switch cabinet at the origin."""
    width = float(rng.uniform(0.4, 0.75))
    grey = Material("furniture", (0.36, 0.38, 0.35), 0.42)
    top = shapes.box([-width - 0.03, -0.2, 1.2], [width + 0.03, 0.2, 1.26])
    body = shapes.box([-width, -0.17, 0.0], [width, 0.17, 1.2])
    return Triangles.joined([Triangles.of(body, grey), Triangles.of(top, grey.tinted(0.8))])


def bollard() -> Triangles:
    """A bollard at the origin."""
    post = shapes.tube([0.055, 0.055, 0.03], [-0.1, 0.92, 1.0], 8)
    ring = shapes.tube([0.058, 0.058], [0.72, 0.84], 8, closed=False)
    return Triangles.joined(
        [
            Triangles.of(post, Material("pole", (0.5, 0.04, 0.03), 0.4)),
            Triangles.of(ring, SIGN_WHITE),
        ]
    )


def bench() -> Triangles:
    """A bench at the origin, facing -y."""
    slats = [shapes.box([-0.9, y, 0.43], [0.9, y + 0.1, 0.46]) for y in (-0.25, -0.12, 0.01, 0.14)]
    slats += [shapes.box([-0.9, 0.25, z], [0.9, 0.28, z + 0.11]) for z in (0.56, 0.72)]
    legs = [shapes.box([x, -0.25, 0.0], [x + 0.06, 0.28, 0.43]) for x in (-0.75, 0.7)]
    legs += [shapes.box([x, 0.28, 0.0], [x + 0.06, 0.32, 0.83]) for x in (-0.75, 0.7)]
    return Triangles.joined(
        [
            Triangles.of(np.concatenate(slats), Material("furniture", (0.28, 0.16, 0.07), 0.35)),
            Triangles.of(np.concatenate(legs), Material("furniture", (0.1, 0.1, 0.1), 0.15)),
        ]
    )


def shelter() -> Triangles:
    """A bus shelter at the origin, open towards -y."""
    steel = Material("furniture", (0.12, 0.13, 0.14), 0.25)
    posts = [
        shapes.box([x - 0.04, y - 0.04, 0.0], [x + 0.04, y + 0.04, 2.35])
        for x in (-1.9, 0.0, 1.9)
        for y in (0.6, -0.45)
        if x != 0.0 or y > 0
    ]
    roof = shapes.box([-2.1, -0.75, 2.35], [2.1, 0.8, 2.46])
    rail = shapes.box([-1.9, 0.5, 0.44], [1.9, 0.56, 0.5])
    seat = shapes.box([-1.2, 0.15, 0.44], [1.2, 0.5, 0.49])
    poster = shapes.box([1.86, -0.4, 0.35], [1.96, 0.55, 2.1])
    panes = [
        shapes.quad([-1.86, 0.6, 0.2], [1.86, 0.6, 0.2], [1.86, 0.6, 2.25], [-1.86, 0.6, 2.25])
    ]
    panes.append(
        shapes.quad([-1.9, 0.55, 0.2], [-1.9, -0.4, 0.2], [-1.9, -0.4, 2.25], [-1.9, 0.55, 2.25])
    )
    return Triangles.joined(
        [
            Triangles.of(np.concatenate([*posts, roof, rail, seat]), steel),
            Triangles.of(poster, Material("furniture", (0.6, 0.35, 0.1), 0.4)),
            Triangles.of(np.concatenate(panes), materials.GLASS),
        ]
    )


def wall(length_m: float, height_m: float, material: Material) -> Triangles:
    """A garden wall with a coping along x from the origin."""
    body = shapes.box([0.0, -0.12, -0.2], [length_m, 0.12, height_m], bottom=False)
    coping = shapes.box([-0.02, -0.16, height_m], [length_m + 0.02, 0.16, height_m + 0.07])
    return Triangles.joined(
        [Triangles.of(body, material), Triangles.of(coping, material.tinted(1.15))]
    )


def fence(rng: np.random.Generator, length_m: float, height_m: float = 1.1) -> Triangles:
    """A picket fence along x from the origin; beams pass between the pickets."""
    wood = Material("fence", (0.5, 0.48, 0.44), 0.45) if rng.random() < 0.5 else materials.WOOD
    pickets = np.arange(0.06, length_m - 0.05, 0.19)
    one = shapes.box([-0.045, -0.015, 0.05], [0.045, 0.015, height_m], bottom=False)
    many = (
        one[None] + np.stack([pickets, 0 * pickets, 0 * pickets], axis=1)[:, None, None]
    ).reshape(-1, 3, 3)
    rails = [
        shapes.box([0.0, 0.015, z], [length_m, 0.05, z + 0.08]) for z in (0.25, height_m - 0.25)
    ]
    posts = [
        shapes.box([x - 0.05, 0.0, -0.1], [x + 0.05, 0.1, height_m + 0.06])
        for x in np.linspace(0, length_m, max(2, round(length_m / 2.4) + 1))
    ]
    return Triangles.joined(
        [
            Triangles.of(many, wood).speckled(rng, 0.1),
            Triangles.of(np.concatenate([*rails, *posts]), wood),
        ]
    )
