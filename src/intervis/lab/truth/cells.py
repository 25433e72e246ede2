"""Cells of a matrix of scanners, mounts and worlds: one scan each, and lines with exact labels.

The sight lines of a cell, a quarter each, at most 60 m long:

- *returns*: from free points anywhere to returns of the scan;
- *beam points*: from free points on the beams to returns;
- *anywhere*: between free points of the place;
- *space*: from free points to points of space, which may lie in bodies and below the ground.

Apart from these, `lines_without_echo` draws lines from beside the scanner along beams without echo.

The truth follows `intervis.lab.truth.exact_world.exact_labels`.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from intervis.arrays import BoolArray, Float64Array, IntArray
from intervis.lab.truth.exact_world import exact_labels, in_the_open
from intervis.lab.worlds.beam_pattern import PATTERNS, PatternScan
from intervis.lab.worlds.mounts import MOUNTS
from intervis.lab.worlds.places import PLACES, Place
from intervis.transform import transform

MAX_LENGTH_M = 60.0
MOUNTS_OF = {"terrestrial": ("tripod",), "ring": ("upright", "upside-down", "tilted")}
"""Mounts that make sense for a scanner; all but the tripod for the others."""
KINDS = ("returns", "beam points", "anywhere", "space")
NO_ECHO = "no echo"
"""The kind of the lines of `lines_without_echo`."""
NEAR_SCANNER_M = (0.3, 0.3, 0.15)
"""Standard deviation of viewpoints beside a scanner."""
SPACE_RANGE_M, SPACE_RISE = (1.5, 40.0), 0.35
"""Ranges of points in space, and the vertical part of their directions (horizontal ones: 1)."""


@dataclass(frozen=True)
class Cell:
    """One scanner on one mount in one world."""

    scanner: str
    mount: str
    world: str


@dataclass(frozen=True, eq=False)
class ExactLines:
    """L sight lines of a cell with exact labels, scene frame."""

    starts: Float64Array
    ends: Float64Array
    visible: BoolArray
    kind: IntArray


def cells(
    scanners: Sequence[str] | None = None,
    mounts: Sequence[str] | None = None,
    worlds: Sequence[str] | None = None,
) -> list[Cell]:
    """The cells that make sense: the terrestrial scanner on its tripod only, no mast in the hall.

    Examples
    --------
    >>> cells(["terrestrial"], None, ["hall"])
    [Cell(scanner='terrestrial', mount='tripod', world='hall')]
    """
    usual = tuple(name for name in MOUNTS if name != "tripod")
    return [
        Cell(scanner, mount, world)
        for scanner in scanners or PATTERNS
        for mount in mounts or MOUNTS
        for world in worlds or PLACES
        if mount in MOUNTS_OF.get(scanner, usual) and not (mount == "mast" and world == "hall")
    ]


def random_of(cell: Cell, seed: int) -> np.random.Generator:
    """The random numbers of a cell."""
    numbers = [list(PATTERNS).index(cell.scanner), list(MOUNTS).index(cell.mount)]
    return np.random.default_rng([seed, *numbers, list(PLACES).index(cell.world)])


def scan_of(cell: Cell, place: Place, rng: np.random.Generator) -> PatternScan:
    """One scan of a place from one of its sites, at a random yaw."""
    site = place.sites[rng.integers(len(place.sites))]
    pose = MOUNTS[cell.mount].pose(place.ground(site[None])[0], float(rng.uniform(0, 2 * np.pi)))
    return PATTERNS[cell.scanner]().scan(place.caster, pose, rng, place.lost_share)


def exact_lines(
    place: Place, scan: PatternScan, count: int, rng: np.random.Generator
) -> ExactLines:
    """About `count` labelled lines of a scan, a quarter of each kind."""
    each = count // len(KINDS)
    origin = scan.pose[:3, 3]
    free = free_points(place, origin, 4 * each, rng)
    returns = transform(scan.pose, scan.points.astype(np.float64))
    chosen = returns[rng.integers(0, len(returns), 2 * each)]
    beam_ends = returns[rng.integers(0, len(returns), each)]
    on_beams = origin + rng.uniform(0.05, 0.95, (each, 1)) * (beam_ends - origin)
    viewpoints = free[2 * each : 3 * each]
    starts = np.concatenate([free[:each], on_beams, free[each : 2 * each], viewpoints])
    ends = np.concatenate([chosen, free[3 * each :], _points_in_space(viewpoints, rng)])
    kind = np.repeat(np.arange(len(KINDS)), each)
    near = np.linalg.norm(ends - starts, axis=1) <= MAX_LENGTH_M
    starts, ends, kind = starts[near], ends[near], kind[near]
    visible, occluded = exact_labels(place.caster, starts, ends, kind < 2)
    labelled = visible | occluded
    return ExactLines(starts[labelled], ends[labelled], visible[labelled], kind[labelled])


def lines_without_echo(
    place: Place, scan: PatternScan, count: int, rng: np.random.Generator
) -> ExactLines:
    """At most `count` labelled lines from beside the scanner to points of beams without echo.

    The points lie 1.5 to 40 m from the scanner, 0.1 m above the ground to the place's ceiling:
    before, in and behind bodies that return nothing, and in the open.
    """
    origin = scan.pose[:3, 3]
    silent = np.flatnonzero(~np.isfinite(scan.ranges_m))
    beams = rng.choice(silent, 8 * count) if len(silent) else silent
    toward = scan.pattern.directions[beams] @ scan.pose[:3, :3].T
    ends = origin + rng.uniform(*SPACE_RANGE_M, (len(beams), 1)) * toward
    height_m = ends[:, 2] - place.ground(ends[:, :2])[:, 2]
    ends = ends[(height_m > 0.1) & (height_m < place.ceiling_m)][:count]
    starts = origin + rng.normal(size=ends.shape) * NEAR_SCANNER_M
    visible, occluded = exact_labels(place.caster, starts, ends, np.zeros(len(ends), np.bool_))
    labelled = visible | occluded
    kind = np.full(np.count_nonzero(labelled), len(KINDS))
    return ExactLines(starts[labelled], ends[labelled], visible[labelled], kind)


def _points_in_space(viewpoints: Float64Array, rng: np.random.Generator) -> Float64Array:
    """A point (M, 3) for each viewpoint, at a uniform range in a random direction near the horizon.

    It may lie inside a body or below the ground.
    """
    toward = rng.normal(size=viewpoints.shape) * np.array([1.0, 1.0, SPACE_RISE])
    toward /= np.linalg.norm(toward, axis=1, keepdims=True)
    return np.asarray(viewpoints + rng.uniform(*SPACE_RANGE_M, (len(viewpoints), 1)) * toward)


def free_points(
    place: Place, origin: Float64Array, count: int, rng: np.random.Generator
) -> Float64Array:
    """Points (count, 3) of the place within 60 m of the scanner, uniform over the ground."""
    found = np.empty((0, 3))
    while len(found) < count:
        xy = rng.uniform(place.bounds[0], place.bounds[1], (2 * count, 2))
        points = place.ground(xy[np.linalg.norm(xy - origin[:2], axis=1) < MAX_LENGTH_M])
        points = points[np.isfinite(points[:, 2])]
        points[:, 2] += rng.uniform(0.2, place.ceiling_m, len(points))
        points = points[place.free(points)]
        if not len(place.solids):
            points = points[in_the_open(place.caster, points)]
        found = np.concatenate([found, points])
    return found[:count]
