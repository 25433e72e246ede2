"""Cars: a body lofted through cross-sections, with windows, lights and wheels."""

from dataclasses import dataclass

import numpy as np

from intervis.arrays import Float64Array
from intervis.lab.worlds import materials, shapes
from intervis.lab.worlds.triangles import Material, Triangles
from intervis.transform import rigid

PAINTS: tuple[tuple[tuple[float, float, float], float], ...] = (
    ((0.55, 0.56, 0.57), 0.45),
    ((0.32, 0.33, 0.35), 0.32),
    ((0.02, 0.02, 0.025), 0.06),
    ((0.70, 0.70, 0.68), 0.55),
    ((0.035, 0.055, 0.16), 0.14),
    ((0.36, 0.03, 0.03), 0.36),
    ((0.08, 0.10, 0.09), 0.12),
    ((0.06, 0.17, 0.30), 0.24),
    ((0.42, 0.37, 0.27), 0.38),
    ((0.62, 0.26, 0.03), 0.42),
)
"""Colour, and reflectance for the laser; dark paint reflects very little."""

HEADLAMP = Material("car", (0.85, 0.86, 0.82), 0.7)
TAILLAMP = Material("car", (0.45, 0.015, 0.01), 0.85)
PLATE = Material("sign", (0.75, 0.75, 0.7), 1.4)
RIM = Material("car", (0.45, 0.46, 0.47), 0.5)
TRIM = Material("car", (0.025, 0.025, 0.027), 0.07)
PAINT, TRIMMED, GLAZED, HEADLIT, TAILLIT = range(5)


@dataclass(frozen=True)
class Body:
    """Side profile of a car, front first: stations along x with their heights, metres.

    Attributes
    ----------
    width_m : float
        Largest width.
    x_m, belt_m, top_m : tuples of n floats
        Stations from front to rear, height of the lower edge of the side windows, and height of
        the upper outline (bonnet, roof, boot).
    girth, roof : tuples of n floats
        Half width at the belt and at the top, as fractions of half the car's width.
    side_glass, top_glass : tuples of int
        Stations after which the side, or the top (windscreen, rear window), is glass.
    axles_m : two floats
        Positions of the axles along x.
    wheel_m : float
        Radius of the wheels.
    """

    width_m: float
    x_m: tuple[float, ...]
    belt_m: tuple[float, ...]
    top_m: tuple[float, ...]
    girth: tuple[float, ...]
    roof: tuple[float, ...]
    side_glass: tuple[int, ...]
    top_glass: tuple[int, ...]
    axles_m: tuple[float, float]
    wheel_m: float = 0.32


HATCHBACK = Body(
    1.76,
    (2.08, 2.02, 1.72, 1.05, 0.42, 0.28, -0.38, -0.48, -1.18, -1.36, -1.66, -1.92, -2.02),
    (0.52, 0.66, 0.76, 0.88, 0.92, 0.92, 0.95, 0.95, 0.99, 1.00, 1.02, 0.94, 0.50),
    (0.56, 0.72, 0.86, 0.98, 1.40, 1.44, 1.48, 1.48, 1.44, 1.40, 1.24, 1.00, 0.54),
    (0.72, 0.86, 0.95, 0.99, 1.00, 1.00, 1.00, 1.00, 0.99, 0.98, 0.96, 0.93, 0.88),
    (0.60, 0.70, 0.78, 0.82, 0.72, 0.71, 0.70, 0.70, 0.69, 0.69, 0.70, 0.78, 0.80),
    (5, 7),
    (3, 10),
    (1.30, -1.25),
)
SALOON = Body(
    1.80,
    (2.32, 2.25, 1.92, 1.15, 0.42, 0.28, -0.38, -0.48, -1.05, -1.18, -1.72, -2.20, -2.30),
    (0.50, 0.64, 0.74, 0.86, 0.90, 0.90, 0.93, 0.93, 0.95, 0.96, 0.97, 0.94, 0.52),
    (0.54, 0.70, 0.84, 0.94, 1.36, 1.40, 1.43, 1.43, 1.38, 1.34, 1.04, 1.00, 0.56),
    (0.72, 0.86, 0.95, 0.99, 1.00, 1.00, 1.00, 1.00, 1.00, 0.99, 0.97, 0.93, 0.86),
    (0.60, 0.70, 0.78, 0.82, 0.70, 0.69, 0.68, 0.68, 0.67, 0.67, 0.78, 0.80, 0.80),
    (5, 7),
    (3, 9),
    (1.42, -1.36),
)
ESTATE = Body(
    1.80,
    (2.30, 2.23, 1.90, 1.15, 0.45, 0.30, -0.36, -0.46, -1.20, -1.30, -2.00, -2.22, -2.30),
    (0.50, 0.64, 0.74, 0.86, 0.90, 0.90, 0.93, 0.93, 0.96, 0.96, 1.00, 0.96, 0.52),
    (0.54, 0.70, 0.84, 0.94, 1.38, 1.42, 1.47, 1.47, 1.46, 1.46, 1.42, 1.02, 0.56),
    (0.72, 0.86, 0.95, 0.99, 1.00, 1.00, 1.00, 1.00, 1.00, 1.00, 0.97, 0.93, 0.88),
    (0.60, 0.70, 0.78, 0.82, 0.71, 0.70, 0.70, 0.70, 0.70, 0.70, 0.70, 0.78, 0.80),
    (5, 7, 9),
    (3, 10),
    (1.40, -1.36),
)
VAN = Body(
    1.92,
    (2.55, 2.48, 2.20, 1.85, 1.25, 1.10, 0.48, 0.38, -0.80, -0.92, -2.20, -2.42, -2.50),
    (0.60, 0.78, 0.98, 1.08, 1.12, 1.12, 1.14, 1.14, 1.16, 1.16, 1.16, 1.10, 0.56),
    (0.64, 0.86, 1.10, 1.22, 1.86, 1.92, 1.96, 1.96, 1.97, 1.97, 1.96, 1.88, 0.60),
    (0.80, 0.92, 0.98, 1.00, 1.00, 1.00, 1.00, 1.00, 1.00, 1.00, 1.00, 0.98, 0.96),
    (0.70, 0.80, 0.84, 0.86, 0.82, 0.82, 0.83, 0.83, 0.83, 0.83, 0.83, 0.83, 0.90),
    (5,),
    (3,),
    (1.60, -1.50),
    0.34,
)
BODIES = (HATCHBACK, HATCHBACK, SALOON, ESTATE, ESTATE, VAN)


def _rings(body: Body) -> Float64Array:
    """(n, 13, 3) cross-sections, each from the right sill over the top to the left sill."""
    half = body.width_m / 2
    belt, top = np.asarray(body.belt_m), np.asarray(body.top_m)
    girth, roof = np.asarray(body.girth) * half, np.asarray(body.roof) * half
    low = np.full(len(belt), 0.24)
    low[[0, -1]] = 0.30
    waist = np.minimum(belt - 0.06, 0.62)
    y = np.stack([girth * 0.80, girth * 0.95, girth, girth * 0.97, roof, roof * 0.80], axis=1)
    z = np.stack([low, low + 0.07, waist, belt, top - 0.05, top - 0.005], axis=1)
    ridge_y, ridge_z = np.zeros((len(belt), 1)), (top + 0.006)[:, None]
    across = np.concatenate([-y, ridge_y, y[:, ::-1]], axis=1)
    above = np.concatenate([z, ridge_z, z[:, ::-1]], axis=1)
    along = np.broadcast_to(np.asarray(body.x_m)[:, None], across.shape)
    return np.stack([along, across, above], axis=-1)


def _shell(body: Body, paint: Material) -> Triangles:
    """The body without wheels; each cell between two cross-sections has one material."""
    rings = _rings(body)
    stations, columns = len(rings) - 1, rings.shape[1] - 1
    cells = shapes.grid(rings).reshape(stations, columns, 2, 3, 3)
    depth = np.minimum(np.arange(columns), columns - 1 - np.arange(columns))
    cell_materials = np.full((stations, columns), PAINT)
    cell_materials[:, depth == 0] = TRIMMED
    cell_materials[np.ix_(np.array(body.side_glass), np.flatnonzero(depth == 3))] = GLAZED
    cell_materials[np.ix_(np.array(body.top_glass), np.flatnonzero(depth >= 4))] = GLAZED
    cell_materials[np.ix_(np.array([0, 1]), np.flatnonzero(depth == 2))] = HEADLIT
    cell_materials[
        np.ix_(np.array([stations - 1]), np.flatnonzero((depth == 2) | (depth == 3)))
    ] = TAILLIT
    material_by_number = {
        PAINT: paint,
        TRIMMED: TRIM,
        GLAZED: materials.GLASS,
        HEADLIT: HEADLAMP,
        TAILLIT: TAILLAMP,
    }
    parts = [
        Triangles.of(cells[cell_materials == number], material)
        for number, material in material_by_number.items()
    ]
    under = [shapes.fan(rings[0, ::-1]), shapes.fan(rings[-1]), shapes.grid(rings[:, [-1, 0]])]
    return Triangles.joined([*parts, Triangles.of(np.concatenate(under), TRIM)])


def _wheel(radius_m: float) -> Triangles:
    """A wheel about the origin, axle along y, outer side towards +y."""
    to_axle = rigid([[1, 0, 0], [0, 0, 1], [0, -1, 0]], [0.0, 0.0, 0.0])
    tread = shapes.tube([radius_m, radius_m], [-0.2, 0.0], 14, closed=False)
    angle_rad = np.linspace(0, 2 * np.pi, 14, endpoint=False)
    circle = np.stack([np.cos(angle_rad), np.sin(angle_rad), np.zeros(14)], axis=1)
    tyre = np.concatenate([tread, shapes.fan(circle * radius_m)])
    rim = shapes.fan(circle * (0.62 * radius_m) + [0, 0, 0.006])
    return Triangles.joined(
        [Triangles.of(tyre, materials.TYRE), Triangles.of(rim, RIM)]
    ).transformed(to_axle)


def _wheels(body: Body) -> Triangles:
    """Four wheels, each in front of a dark wheel arch."""
    half = body.width_m / 2
    wheel = _wheel(body.wheel_m)
    angle_rad = np.linspace(0, 2 * np.pi, 14, endpoint=False)
    circle = np.stack([np.cos(angle_rad), np.zeros(14), np.sin(angle_rad)], axis=1)[::-1]
    parts = []
    for axle in body.axles_m:
        for side in (1, -1):
            place = [axle, side * (half + 0.01), body.wheel_m]
            facing = 0.0 if side > 0 else np.pi
            parts.append(wheel.transformed(shapes.upright_rotation(facing, place)))
            arch = Triangles.of(shapes.fan(circle * (body.wheel_m + 0.07) * [1, side, 1]), TRIM)
            parts.append(arch.translated(axle, side * (half + 0.003), body.wheel_m + 0.02))
    return Triangles.joined(parts)


def _fittings(body: Body, paint: Material) -> Triangles:
    """Mirrors and number plates."""
    half, base = body.width_m / 2, body.x_m[4] + 0.3
    mirror = Triangles.of(shapes.box([-0.08, -0.08, 0.0], [0.02, 0.08, 0.13]), paint.tinted(0.7))
    parts = [mirror.translated(base, side * (half + 0.02), body.belt_m[4]) for side in (1, -1)]
    for x, sign in ((body.x_m[0] + 0.01, 1), (body.x_m[-1] - 0.01, -1)):
        left, right, low, high = -0.26 * sign, 0.26 * sign, 0.38, 0.49
        plate = shapes.quad([x, left, low], [x, right, low], [x, right, high], [x, left, high])
        parts.append(Triangles.of(plate, PLATE))
    return Triangles.joined(parts)


def car(rng: np.random.Generator, body: Body | None = None) -> Triangles:
    """A car on the ground at the origin, front along x.

    Parameters
    ----------
    rng : numpy Generator
        Selects body and paint.
    body : Body, optional
        Instead of a random one.
    """
    chosen = BODIES[int(rng.integers(len(BODIES)))] if body is None else body
    colour, reflectance = PAINTS[int(rng.integers(len(PAINTS)))]
    paint = Material("car", colour, reflectance)
    return Triangles.joined([_shell(chosen, paint), _wheels(chosen), _fittings(chosen, paint)])
