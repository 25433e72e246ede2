"""The ground: carriageway, markings, kerbs, pavements, gardens, hills; and the bridge."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from intervis.arrays import Float64Array
from intervis.lab.worlds import materials, shapes
from intervis.lab.worlds.street.centreline import Centreline
from intervis.lab.worlds.triangles import Material, Triangles

ROAD_M = 3.8
"""Half width of the carriageway, between the parking strips."""
KERB_M = 5.9
KERB_HIGH_M = 0.12
WALK_M = 8.2
"""Offset at which the pavement ends and the gardens begin."""
FAR_M = 95.0
ABOVE_M = 0.006
"""Height of markings above the asphalt."""


@dataclass(frozen=True)
class Bridge:
    """A bridge that carries a road over the street.

    Attributes
    ----------
    s : float
        Distance of its middle along the street, metres.
    half_m, clearance_m, depth_m : float
        Half width, clear height below, thickness of the deck.
    span_m : float
        Offset from the street at which the deck ends, metres.
    """

    s: float = 66.0
    half_m: float = 4.2
    clearance_m: float = 4.7
    depth_m: float = 0.95
    span_m: float = 19.0

    @property
    def top_m(self) -> float:
        """Height of its road above the street."""
        return self.clearance_m + self.depth_m


def _smooth(x: ArrayLike) -> Float64Array:
    t = np.clip(np.asarray(x, float), 0, 1)
    return np.asarray(t * t * (3 - 2 * t))


def terrain_height(s: ArrayLike, d: ArrayLike, bridge: Bridge) -> Float64Array:
    """Height of gardens and hills above the centreline, at `s` along and `d` across."""
    along, across = np.broadcast_arrays(np.asarray(s, float), np.asarray(d, float))
    out = np.abs(across)
    lawn = KERB_HIGH_M + 0.02 * np.sin(0.9 * along) * _smooth((out - WALK_M) / 3)
    roll = 0.5 + 0.5 * np.sin(along / 23.0 + np.sign(across) * 1.3) * np.cos(along / 61.0)
    hills = (2.0 + 7.0 * roll) * _smooth((out - 34.0) / 50.0)
    bank = _smooth((out - (bridge.span_m - 7.0)) / 7.0) * _smooth(
        (bridge.half_m + 8.5 - np.abs(along - bridge.s)) / 7.5
    )
    rest = lawn + hills
    return np.asarray(rest + bank * (bridge.top_m - 0.05 - rest))


def _strip(
    centreline: Centreline, s: Float64Array, d: ArrayLike, h: ArrayLike, material: Material
) -> Triangles:
    """A strip along the street through the offsets `d` at the heights `h`, facing up."""
    across, above = np.asarray(d, float), np.asarray(h, float)
    return Triangles.of(shapes.grid(centreline.points(s[:, None], across, above)), material)


def carriageway(centreline: Centreline, rng: np.random.Generator) -> Triangles:
    """Road, parking strips, kerbs and pavements."""
    coarse = np.arange(centreline.first_m, centreline.last_m + 0.1, 2.0)
    fine = np.arange(centreline.first_m, centreline.last_m + 0.1, 1.0)
    parts = [
        _strip(centreline, coarse, np.linspace(-ROAD_M, ROAD_M, 5), np.zeros(5), materials.ASPHALT)
    ]
    for side in (1, -1):
        bands = [
            (coarse, [ROAD_M, ROAD_M + 0.25], [0, 0], materials.KERB, 0.08),
            (coarse, [ROAD_M + 0.25, KERB_M], [0, 0.02], materials.PARKING, 0.04),
            (fine, [KERB_M, KERB_M + 0.02, KERB_M + 0.16], [0.02, KERB_HIGH_M, KERB_HIGH_M],
             materials.KERB, 0.08),
            (fine, np.linspace(KERB_M + 0.16, WALK_M, 4), np.full(4, KERB_HIGH_M),
             materials.SLABS, 0.10),
        ]  # fmt: skip
        for s, d, h, material, spread in bands:
            across = np.asarray(d, float) * side
            strip = _strip(centreline, s, across[::side], np.asarray(h, float)[::side], material)
            parts.append(_speckled_by_cell(strip, rng, spread))
    return Triangles.joined(parts)


def _speckled_by_cell(triangles: Triangles, rng: np.random.Generator, spread: float) -> Triangles:
    """`Triangles.speckled` with the same factor for both triangles of a cell."""
    factor = np.repeat(rng.uniform(1 - spread, 1 + spread, len(triangles) // 2), 2).astype(
        np.float32
    )
    return Triangles(
        triangles.corners,
        triangles.labels,
        triangles.colours * factor[:, None],
        triangles.reflectances * factor,
    )


def _patch(
    centreline: Centreline, s: tuple[float, float], d: tuple[float, float], material: Material
) -> Triangles:
    """A painted rectangle on the road."""
    along = np.linspace(s[0], s[1], max(2, round((s[1] - s[0]) / 2) + 1))
    return _strip(centreline, along, np.array(d), np.full(2, ABOVE_M), material)


def markings(centreline: Centreline, crossings: tuple[float, ...]) -> Triangles:
    """The broken middle line, stop lines, zebra crossings and manhole covers."""
    parts = []
    for s in np.arange(centreline.first_m + 2, centreline.last_m - 5, 9.0):
        if not any(abs(s + 1.5 - crossing) < 6 for crossing in crossings):
            parts.append(_patch(centreline, (s, s + 3.0), (-0.06, 0.06), materials.PAINT))
    for crossing in crossings:
        for d in np.arange(-3.5, 3.4, 1.0):
            parts.append(
                _patch(centreline, (crossing - 1.5, crossing + 1.5), (d, d + 0.5), materials.PAINT)
            )
        for near, side in ((-2.9, -1), (2.5, 1)):
            lane = sorted((side * 0.2, side * 3.5))
            line = (crossing + near, crossing + near + 0.4)
            parts.append(_patch(centreline, line, (lane[0], lane[1]), materials.PAINT))
    angle_rad = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    iron = Material("road", (0.06, 0.058, 0.055), 0.3)
    for number, s in enumerate(np.arange(centreline.first_m + 11, centreline.last_m - 5, 31.0)):
        d = (-1.1, 0.9, 2.2)[number % 3]
        rim = centreline.points(s + 0.33 * np.cos(angle_rad), d + 0.33 * np.sin(angle_rad), ABOVE_M)
        parts.append(Triangles.of(shapes.fan(rim), iron))
    return Triangles.joined(parts)


def patch(centreline: Centreline, s: float, side: int, width_m: float) -> Triangles:
    """A paved drive from the pavement to a garage, slightly above the lawn."""
    across = np.linspace(WALK_M, WALK_M + 4.6, 4)[::side] * side
    along = np.array([s - width_m / 2, s, s + width_m / 2])
    return _strip(
        centreline, along, across, np.full(4, KERB_HIGH_M + 0.035), materials.SLABS.tinted(0.8)
    )


def terrain(centreline: Centreline, bridge: Bridge, rng: np.random.Generator) -> Triangles:
    """Gardens on both sides that rise to hills, with the embankments of the bridge."""
    s = np.arange(centreline.first_m, centreline.last_m + 0.1, 3.0)
    near = np.arange(bridge.s - 14.0, bridge.s + 14.1, 1.0)
    s = np.unique(np.concatenate([s[np.abs(s - bridge.s) > 14.5], near]))
    out = [WALK_M, 9.0, 10.0, 12.0, 13.5, 15.0, 16.5, 18.0, 19.0, 20.0, 24.0, 30.0, 36.0, 43.0,
           51.0, 60.0, 70.0, 82.0, FAR_M]  # fmt: skip
    parts = []
    for side in (1, -1):
        across = np.array(out)[::side] * side
        height = terrain_height(s[:, None], across, bridge)
        strip = Triangles.of(
            shapes.grid(centreline.points(s[:, None], across, height)), materials.GRASS
        )
        parts.append(strip.speckled(rng, 0.10))
    return Triangles.joined(parts)


def bridge_over(centreline: Centreline, bridge: Bridge) -> Triangles:
    """Deck, parapets with railings, piers and abutments."""
    low, top, half = bridge.clearance_m, bridge.top_m, bridge.half_m
    base = centreline.upright(bridge.s)
    ends = np.array([0.0, -bridge.span_m - 2.5, 0.0]), np.array([0.0, bridge.span_m + 2.5, 0.0])
    girder = [[half, 0, top - 0.35], [half, 0, top], [-half, 0, top], [-half, 0, top - 0.35],
              [-half + 1.2, 0, low], [half - 1.2, 0, low]]  # fmt: skip
    parts = [Triangles.of(shapes.extruded(girder, *ends), materials.CONCRETE)]
    road = shapes.quad(
        [-half + 0.5, ends[0][1], top + 0.01], [half - 0.5, ends[0][1], top + 0.01],
        [half - 0.5, ends[1][1], top + 0.01], [-half + 0.5, ends[1][1], top + 0.01],
    )  # fmt: skip
    parts.append(Triangles.of(road, materials.ASPHALT))
    steel = Material("bridge", (0.10, 0.22, 0.20), 0.3)
    for side in (1, -1):
        edge = side * (half - 0.15)
        curb = shapes.box([edge - 0.17, ends[0][1], top], [edge + 0.17, ends[1][1], top + 0.32])
        parts.append(Triangles.of(curb, materials.CONCRETE.tinted(1.15)))
        rails = [
            shapes.box([edge - 0.03, ends[0][1], z], [edge + 0.03, ends[1][1], z + 0.06])
            for z in (top + 0.7, top + 1.1)
        ]
        posts = [
            shapes.box([edge - 0.04, y - 0.04, top + 0.3], [edge + 0.04, y + 0.04, top + 1.16])
            for y in np.arange(ends[0][1], ends[1][1], 1.6)
        ]
        parts.append(Triangles.of(np.concatenate([*rails, *posts]), steel))
        for x in (-half + 2.0, half - 2.0):
            pier = Triangles.of(
                shapes.tube([0.42, 0.42], [-0.3, low + 0.02], 14), materials.CONCRETE
            )
            parts.append(pier.translated(x, side * 9.2, 0.0))
        beam = shapes.box([-half + 0.7, side * 9.2 - 0.5, low - 0.55],
                          [half - 0.7, side * 9.2 + 0.5, low + 0.02])  # fmt: skip
        parts.append(Triangles.of(beam, materials.CONCRETE))
        wall = sorted((side * (bridge.span_m - 1.6), side * (bridge.span_m - 1.0)))
        abutment = shapes.box([-half - 0.3, wall[0], -0.3], [half + 0.3, wall[1], top])
        parts.append(Triangles.of(abutment, materials.CONCRETE.tinted(0.85)))
    return Triangles.joined(parts).transformed(base)
