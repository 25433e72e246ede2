"""Zones: polygons between two heights above the ground, whose visible share is asked."""

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from intervis.arguments import object_of, shown
from intervis.arrays import BoolArray, Float64Array, numbers_of
from intervis.drives.calibration import read_lines
from intervis.errors import DriveError, PointsError, SettingsError
from intervis.sight import Scene

SAMPLES = 400
"""Points of a zone at most, unless it is long and thin."""
LEAST_SPACING_M = 0.25
"""Distance of the points of a small zone."""
LEVELS = 3
"""Heights at which points are placed, from the lower to the upper height."""
MOST_CORNERS, FARTHEST_M, LARGEST_WEIGHT = 500, 1e7, 1e9
MOST_CELLS = 1_000_000
"""Cells of the rectangle around a zone that are looked at, to sample it."""

GROUND_SCANS = 5
"""Where the cells are given, the ground is the median of so many scans."""

LEAST_AREA_M2 = 1e-4
DEFAULT_HEIGHTS_M = (0.2, 2.0)


@dataclass(frozen=True, eq=False)
class Zone:
    """A polygon between two heights above the ground.

    Parameters
    ----------
    name : str
    corners : (K, 2) array
        In order, without the first one again at the end; scene frame, metres.
    low_m, high_m : float
        Heights above the ground.
    weight : float
        How much a square metre counts beside those of other zones, where that is asked.

    Raises
    ------
    PointsError
        Fewer than three corners or more than 500, corners that are not finite or beyond
        10,000 km, edges that cross, no area, heights that are not in order, or a weight that is
        negative.

    Examples
    --------
    >>> zone = Zone("crossing", [[0, 0], [4, 0], [4, 3], [0, 3]], 0.0, 2.0)
    >>> zone.area_m2
    12.0
    """

    name: str
    corners: Float64Array
    low_m: float = DEFAULT_HEIGHTS_M[0]
    high_m: float = DEFAULT_HEIGHTS_M[1]
    weight: float = 1.0

    def __init__(
        self,
        name: str,
        corners: ArrayLike,
        low_m: float = DEFAULT_HEIGHTS_M[0],
        high_m: float = DEFAULT_HEIGHTS_M[1],
        weight: float = 1.0,
    ) -> None:
        object_of(name, str, "the name of a zone")
        ring = np.atleast_1d(numbers_of(corners, f"the corners of zone {shown(name)}"))
        heights_m = numbers_of([low_m, high_m], f"zone {shown(name)}: its heights")
        if len(ring) > 1 and (ring[0] == ring[-1]).all():
            ring = ring[:-1]
        if ring.ndim != 2 or ring.shape[1] != 2 or len(ring) < 3 or not np.isfinite(ring).all():
            raise PointsError(f"zone {shown(name)} needs three corners or more, x and y in metres.")
        if len(ring) > MOST_CORNERS or np.abs(ring).max() > FARTHEST_M:
            raise PointsError(
                f"zone {shown(name)} may have {MOST_CORNERS} corners, within {FARTHEST_M:g} m of"
                " the origin: simplify it, or give it in the frame of the drive's poses."
            )
        if heights_m.shape != (2,) or not (
            -FARTHEST_M <= heights_m[0] <= heights_m[1] <= FARTHEST_M
        ):
            raise PointsError(
                f"zone {shown(name)} needs a lower and an upper height, got {shown(low_m)}"
                f" and {shown(high_m)}."
            )
        share = numbers_of(weight, f"the weight of zone {shown(name)}")
        if share.ndim or not 0.0 <= share <= LARGEST_WEIGHT:  # nor is NaN
            raise PointsError(
                f"the weight of zone {shown(name)} must be from 0 to {LARGEST_WEIGHT:g}, got"
                f" {shown(weight)}."
            )
        object.__setattr__(self, "name", name)
        object.__setattr__(self, "corners", ring)
        object.__setattr__(self, "low_m", float(low_m))
        object.__setattr__(self, "high_m", float(high_m))
        object.__setattr__(self, "weight", float(weight))
        crossing = _crossing_edges(ring)
        if crossing is not None:
            raise PointsError(
                f"zone {shown(name)} crosses itself: its edges {crossing[0] + 1} and"
                f" {crossing[1] + 1} meet; put its corners in order."
            )
        if self.area_m2 < LEAST_AREA_M2:
            raise PointsError(
                f"zone {shown(name)} has no area: its corners must be metres in the frame of the"
                " poses, not longitude and latitude."
            )

    @property
    def area_m2(self) -> float:
        """Area of the polygon."""
        x, y = self.corners.T
        return abs(float(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1)))) / 2.0

    def contains(self, xy: Float64Array) -> BoolArray:
        """Which points (N, 2) lie inside, by the number of edges to their right."""
        xy = numbers_of(xy, "xy")
        if xy.ndim != 2 or xy.shape[1] != 2:
            raise PointsError(f"xy must have the shape (N, 2), got {xy.shape}.")
        inside = np.zeros(len(xy), np.bool_)
        for (x0, y0), (x1, y1) in zip(self.corners, np.roll(self.corners, -1, axis=0), strict=True):
            spans = np.flatnonzero((y0 > xy[:, 1]) != (y1 > xy[:, 1]))  # none if level
            if len(spans):
                height = (xy[spans, 1] - y0) / (y1 - y0)
                inside[spans] ^= xy[spans, 0] < x0 + height * (x1 - x0)
        return inside

    def samples(self, scene: Scene, cell_m: float | None = None) -> Float64Array:
        """(N, 3) points of the zone, scene frame: cells of equal area at `LEVELS` heights.

        Heights count from the ground of the scene. NaN where it shows no ground. `cell_m` is the
        edge of the cells; None: so that there are some `SAMPLES` points. With it the ground is the
        median of `GROUND_SCANS` scans, otherwise that of the nearest scan.

        Raises
        ------
        SettingsError
            As `cells`.
        """
        object_of(scene, Scene, "scene")
        xy = self._cells() if cell_m is None else self.cells(cell_m)
        levels_m = np.linspace(self.low_m, self.high_m, LEVELS if self.high_m > self.low_m else 1)
        ground_m = scene.ground_height(xy, 1 if cell_m is None else GROUND_SCANS)
        heights = (ground_m[:, None] + levels_m).ravel()
        return np.column_stack([np.repeat(xy, len(levels_m), axis=0), heights])

    def cells(self, cell_m: float) -> Float64Array:
        """(N, 2) middles of cells of an edge of `cell_m` or less; at least one point.

        Raises
        ------
        SettingsError
            There are too many cells in the rectangle around the zone.
        """
        middles = self._middles(cell_m)
        if middles is None:
            raise SettingsError(
                f"zone {self.name!r} has too many cells of {cell_m:g} m: take larger cells, or cut"
                " the zone into parts."
            )
        return middles if len(middles) else self._inner_point()

    def _cells(self) -> Float64Array:
        """(N, 2) middles of square cells inside; at least one point."""
        spacing_m = max(LEAST_SPACING_M, math.sqrt(self.area_m2 * LEVELS / SAMPLES))
        while True:
            middles = self._middles(spacing_m)
            if middles is None:  # a thin zone between the middles of all cells
                return self._inner_point()
            if len(middles):
                return middles
            spacing_m /= 2.0

    def _middles(self, spacing_m: float) -> Float64Array | None:
        """(N, 2) middles of the cells that lie inside; None if there are too many to look at."""
        low, high = self.corners.min(axis=0), self.corners.max(axis=0)
        count = np.maximum(np.ceil((high - low) / spacing_m), 1.0)
        if count[0] > MOST_CELLS / count[1]:  # their product may be infinite
            return None
        i, j = np.indices(count.astype(np.int64)).reshape(2, -1)
        middles = low + (np.column_stack([i, j]) + 0.5) * ((high - low) / count)
        return np.asarray(middles[self.contains(middles)])

    def _inner_point(self) -> Float64Array:
        """(1, 2) a point inside: between two edges, half way up the widest gap of heights."""
        levels = np.unique(self.corners[:, 1])
        widest = int(np.argmax(np.diff(levels)))
        y = 0.5 * (levels[widest] + levels[widest + 1])
        ends = np.roll(self.corners, -1, axis=0)
        spans = (self.corners[:, 1] > y) != (ends[:, 1] > y)
        (x0, y0), (x1, y1) = self.corners[spans].T, ends[spans].T
        x = np.sort(x0 + (y - y0) / (y1 - y0) * (x1 - x0))
        return np.array([[0.5 * (x[0] + x[1]), y]])


def _crossing_edges(ring: Float64Array) -> tuple[int, int] | None:
    """Two edges of a closed ring that meet though they are not neighbours."""
    ends = np.roll(ring, -1, axis=0)
    count = len(ring)
    for a in range(count):
        for b in range(a + 1, count):
            neighbours = b == a + 1 or (a == 0 and b == count - 1)
            if not neighbours and _meet(ring[a], ends[a], ring[b], ends[b]):
                return a, b
            if neighbours and _folds_back(ring, a, b):
                return a, b
    return None


def _meet(p: Float64Array, q: Float64Array, r: Float64Array, s: Float64Array) -> bool:
    """Whether the segments from p to q and from r to s have a common point."""
    sides = [_side(p, q, r), _side(p, q, s), _side(r, s, p), _side(r, s, q)]
    if sides[0] * sides[1] < 0 and sides[2] * sides[3] < 0:
        return True
    touching = ((p, q, r), (p, q, s), (r, s, p), (r, s, q))
    return any(
        side == 0 and _between(*points) for side, points in zip(sides, touching, strict=True)
    )


def _side(p: Float64Array, q: Float64Array, r: Float64Array) -> float:
    cross = (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])
    return float(np.sign(cross))


def _between(p: Float64Array, q: Float64Array, r: Float64Array) -> bool:
    """Whether r, on the line through p and q, lies between them."""
    return bool((np.minimum(p, q) <= r).all() and (r <= np.maximum(p, q)).all())


def _folds_back(ring: Float64Array, a: int, b: int) -> bool:
    """Whether two neighbouring edges lie on each other, or one has no length."""
    first, shared, last = (ring[a], ring[b], ring[(b + 1) % len(ring)])
    if a == 0 and b == len(ring) - 1:
        first, shared, last = ring[b], ring[0], ring[1]
    before, after = first - shared, last - shared
    parallel = before[0] * after[1] - before[1] * after[0] == 0
    return bool(parallel and before @ after >= 0)


def read_zones(path: Path) -> list[Zone]:
    """Zones of a GeoJSON file: polygons, with coordinates in metres in the scene's frame.

    Their properties may be ``name``, ``low_m``, ``high_m`` and ``weight``.

    Raises
    ------
    DriveError
        The file is missing or no GeoJSON with polygons.
    PointsError
        As `Zone`; or a polygon has holes.
    """
    if not path.exists():
        raise DriveError(f"there are no zones at {path}: check the path.")
    try:
        content: Any = json.loads("\n".join(read_lines(path)))
    except (ValueError, RecursionError):
        raise DriveError(f"{path} is no JSON: zones are polygons in GeoJSON.") from None
    features = content.get("features") if isinstance(content, dict) else None
    if not isinstance(features, list) or not features:
        raise DriveError(f"{path} has no features: zones are polygons in a FeatureCollection.")
    return [_zone(path, nth, feature) for nth, feature in enumerate(features, start=1)]


def _zone(path: Path, nth: int, feature: Any) -> Zone:
    wrong = DriveError(f"{path}: feature {nth} is no polygon of numbers.")
    try:
        geometry, properties = feature["geometry"], feature.get("properties") or {}
        if geometry["type"] != "Polygon":
            raise wrong
        rings = geometry["coordinates"]
        corners = np.array([corner[:2] for corner in rings[0]], dtype=np.float64)
        name = str(properties.get("name", f"zone {nth}"))
        low_m, high_m = (
            float(properties.get(key, value))
            for key, value in zip(("low_m", "high_m"), DEFAULT_HEIGHTS_M, strict=True)
        )
        weight = float(properties.get("weight", 1.0))
    except (KeyError, IndexError, TypeError, ValueError, AttributeError, OverflowError):
        raise wrong from None
    if len(rings) > 1:
        raise PointsError(f"zone {shown(name)} has holes: cut it into polygons without any.")
    return Zone(name, corners, low_m, high_m, weight)
