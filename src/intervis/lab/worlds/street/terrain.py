"""The ground: carriageway, markings, kerbs, pavements, gardens, hills, and a bridge over it all."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from intervis.arrays import Float64Array
from intervis.lab.worlds import materials as of
from intervis.lab.worlds import shapes
from intervis.lab.worlds.street.centreline import Path
from intervis.lab.worlds.triangles import Material, Soup

ROAD_M = 3.8
"""Half the carriageway; beyond it cars park."""
KERB_M = 5.9
KERB_HIGH_M = 0.12
WALK_M = 8.2
"""Where the pavement ends and the gardens begin."""
FAR_M = 95.0
ABOVE_M = 0.006
"""How far paint lies above asphalt."""


@dataclass(frozen=True)
class Bridge:
    """A road that crosses over the street.

    Attributes
    ----------
    s : float
        Where its middle crosses, metres along the street.
    half_m, clearance_m, depth_m : float
        Half its width, room under it, thickness of its deck.
    span_m : float
        Where the deck ends and the embankments stand, metres across.
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
    """Height of gardens and hills above the street's line, at `s` along and `d` across."""
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


def _strip(path: Path, s: Float64Array, d: ArrayLike, h: ArrayLike, material: Material) -> Soup:
    """A band along the street through the offsets `d` at the heights `h`, facing up."""
    across, above = np.asarray(d, float), np.asarray(h, float)
    return Soup.of(shapes.grid(path.points(s[:, None], across, above)), material)


def carriageway(path: Path, rng: np.random.Generator) -> Soup:
    """Road, parking strips, kerbs and pavements."""
    coarse = np.arange(path.first_m, path.last_m + 0.1, 2.0)
    fine = np.arange(path.first_m, path.last_m + 0.1, 1.0)
    parts = [_strip(path, coarse, np.linspace(-ROAD_M, ROAD_M, 5), np.zeros(5), of.ASPHALT)]
    for side in (1, -1):
        bands = [
            (coarse, [ROAD_M, ROAD_M + 0.25], [0, 0], of.KERB, 0.08),
            (coarse, [ROAD_M + 0.25, KERB_M], [0, 0.02], of.PARKING, 0.04),
            (fine, [KERB_M, KERB_M + 0.02, KERB_M + 0.16], [0.02, KERB_HIGH_M, KERB_HIGH_M],
             of.KERB, 0.08),
            (fine, np.linspace(KERB_M + 0.16, WALK_M, 4), np.full(4, KERB_HIGH_M), of.SLABS, 0.10),
        ]  # fmt: skip
        for s, d, h, material, spread in bands:
            across = np.asarray(d, float) * side
            strip = _strip(path, s, across[::side], np.asarray(h, float)[::side], material)
            parts.append(_by_pairs(strip, rng, spread))
    return Soup.joined(parts)


def _by_pairs(soup: Soup, rng: np.random.Generator, spread: float) -> Soup:
    """Speckled, but the two triangles of a slab alike."""
    factor = np.repeat(rng.uniform(1 - spread, 1 + spread, len(soup) // 2), 2).astype(np.float32)
    return Soup(
        soup.triangles, soup.labels, soup.colours * factor[:, None], soup.reflectances * factor
    )


def _patch(path: Path, s: tuple[float, float], d: tuple[float, float], material: Material) -> Soup:
    """A painted rectangle on the road."""
    along = np.linspace(s[0], s[1], max(2, round((s[1] - s[0]) / 2) + 1))
    return _strip(path, along, np.array(d), np.full(2, ABOVE_M), material)


def markings(path: Path, crossings: tuple[float, ...]) -> Soup:
    """The broken middle line, stop lines and zebra crossings, covers of manholes."""
    parts = []
    for s in np.arange(path.first_m + 2, path.last_m - 5, 9.0):
        if not any(abs(s + 1.5 - crossing) < 6 for crossing in crossings):
            parts.append(_patch(path, (s, s + 3.0), (-0.06, 0.06), of.PAINT))
    for crossing in crossings:
        for d in np.arange(-3.5, 3.4, 1.0):
            parts.append(_patch(path, (crossing - 1.5, crossing + 1.5), (d, d + 0.5), of.PAINT))
        for near, side in ((-2.9, -1), (2.5, 1)):
            lane = sorted((side * 0.2, side * 3.5))
            line = (crossing + near, crossing + near + 0.4)
            parts.append(_patch(path, line, (lane[0], lane[1]), of.PAINT))
    turn = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    iron = Material("road", (0.06, 0.058, 0.055), 0.3)
    for number, s in enumerate(np.arange(path.first_m + 11, path.last_m - 5, 31.0)):
        d = (-1.1, 0.9, 2.2)[number % 3]
        rim = path.points(s + 0.33 * np.cos(turn), d + 0.33 * np.sin(turn), ABOVE_M)
        parts.append(Soup.of(shapes.fan(rim), iron))
    return Soup.joined(parts)


def patch(path: Path, s: float, side: int, width_m: float) -> Soup:
    """A paved drive from the pavement to a garage, a finger above the lawn."""
    across = np.linspace(WALK_M, WALK_M + 4.6, 4)[::side] * side
    along = np.array([s - width_m / 2, s, s + width_m / 2])
    return _strip(path, along, across, np.full(4, KERB_HIGH_M + 0.035), of.SLABS.tinted(0.8))


def terrain(path: Path, bridge: Bridge, rng: np.random.Generator) -> Soup:
    """Gardens on either side, rising to hills, with the bridge's embankments."""
    s = np.arange(path.first_m, path.last_m + 0.1, 3.0)
    near = np.arange(bridge.s - 14.0, bridge.s + 14.1, 1.0)
    s = np.unique(np.concatenate([s[np.abs(s - bridge.s) > 14.5], near]))
    out = [WALK_M, 9.0, 10.0, 12.0, 13.5, 15.0, 16.5, 18.0, 19.0, 20.0, 24.0, 30.0, 36.0, 43.0,
           51.0, 60.0, 70.0, 82.0, FAR_M]  # fmt: skip
    parts = []
    for side in (1, -1):
        across = np.array(out)[::side] * side
        height = terrain_height(s[:, None], across, bridge)
        strip = Soup.of(shapes.grid(path.points(s[:, None], across, height)), of.GRASS)
        parts.append(strip.speckled(rng, 0.10))
    return Soup.joined(parts)


def bridge_over(path: Path, bridge: Bridge) -> Soup:
    """Deck, parapets with railings, piers and abutments."""
    low, top, half = bridge.clearance_m, bridge.top_m, bridge.half_m
    base = path.upright(bridge.s)
    ends = np.array([0.0, -bridge.span_m - 2.5, 0.0]), np.array([0.0, bridge.span_m + 2.5, 0.0])
    girder = [[half, 0, top - 0.35], [half, 0, top], [-half, 0, top], [-half, 0, top - 0.35],
              [-half + 1.2, 0, low], [half - 1.2, 0, low]]  # fmt: skip
    parts = [Soup.of(shapes.swept(girder, *ends), of.CONCRETE)]
    road = shapes.quad(
        [-half + 0.5, ends[0][1], top + 0.01], [half - 0.5, ends[0][1], top + 0.01],
        [half - 0.5, ends[1][1], top + 0.01], [-half + 0.5, ends[1][1], top + 0.01],
    )  # fmt: skip
    parts.append(Soup.of(road, of.ASPHALT))
    steel = Material("bridge", (0.10, 0.22, 0.20), 0.3)
    for side in (1, -1):
        edge = side * (half - 0.15)
        curb = shapes.box([edge - 0.17, ends[0][1], top], [edge + 0.17, ends[1][1], top + 0.32])
        parts.append(Soup.of(curb, of.CONCRETE.tinted(1.15)))
        rails = [
            shapes.box([edge - 0.03, ends[0][1], z], [edge + 0.03, ends[1][1], z + 0.06])
            for z in (top + 0.7, top + 1.1)
        ]
        posts = [
            shapes.box([edge - 0.04, y - 0.04, top + 0.3], [edge + 0.04, y + 0.04, top + 1.16])
            for y in np.arange(ends[0][1], ends[1][1], 1.6)
        ]
        parts.append(Soup.of(np.concatenate([*rails, *posts]), steel))
        for x in (-half + 2.0, half - 2.0):
            pier = Soup.of(shapes.tube([0.42, 0.42], [-0.3, low + 0.02], 14), of.CONCRETE)
            parts.append(pier.shifted(x, side * 9.2, 0.0))
        beam = shapes.box([-half + 0.7, side * 9.2 - 0.5, low - 0.55],
                          [half - 0.7, side * 9.2 + 0.5, low + 0.02])  # fmt: skip
        parts.append(Soup.of(beam, of.CONCRETE))
        wall = sorted((side * (bridge.span_m - 1.6), side * (bridge.span_m - 1.0)))
        abutment = shapes.box([-half - 0.3, wall[0], -0.3], [half + 0.3, wall[1], top])
        parts.append(Soup.of(abutment, of.CONCRETE.tinted(0.85)))
    return Soup.joined(parts).moved(base)
