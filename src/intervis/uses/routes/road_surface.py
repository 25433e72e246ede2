"""The road surface along a route: heights from the returns in a strip along it."""

from bisect import bisect_left
from itertools import pairwise

import numpy as np
from scipy import ndimage
from scipy.spatial import cKDTree

from intervis.arrays import BoolArray, Float64Array, FloatArray, IntArray
from intervis.errors import SceneError
from intervis.uses.routes.route import Route

HALF_WIDTH_M = 1.0
"""Half of the width of the strip: most of a vehicle's track, no kerb."""
BIN_M = 1.0
"""Length of the pieces of the strip that get a height each."""
NEAR_M = 25.0
"""Farther returns are left out: beams meet the road at less than 4 degrees there."""
OWN_M = 3.0
"""Nearer returns may lie on the vehicle that carries the scanner."""
CELL_M = 0.5
"""Cells in which the strip is looked up."""
LEAST_RETURNS = 5
"""Pieces with fewer returns have no height of their own."""
LAYER_M = 0.15
"""Returns so far above the lowest tenth of a piece are not on the road."""
RISE, FALL, STEP_M = 0.06, 0.15, 0.05
"""Largest rise and fall from piece to piece, against the way of the scanners, and a step."""
SMOOTH_M = 4.0
"""Heights are smoothed by a straight line through the pieces within this distance."""
MOST_CELLS = 50_000_000


class RoadSurface:
    """Collects the returns near a route, scan by scan, and gives the height of the road below it.

    Parameters
    ----------
    route : Route
        Scene frame.
    half_width_m : float
        Half of the width of the strip along the route.

    Examples
    --------
    >>> route = Route.through([[0, 0, 1.7], [20, 0, 1.7]])
    >>> x, y = np.meshgrid(np.arange(0, 20, 0.1), np.arange(-3, 3, 0.1))
    >>> ramp = np.stack([x.ravel(), y.ravel(), 0.05 * x.ravel()], axis=1)
    >>> road = RoadSurface(route)
    >>> road.add(ramp, np.array([8.0, 0.0, 1.7]))
    >>> float(road.heights(np.array([10.0]))[0].round(1))
    0.5
    """

    def __init__(self, route: Route, half_width_m: float = HALF_WIDTH_M) -> None:
        self._route = route
        fine_m = np.append(route.stations(0.5 * CELL_M), route.length_m)
        self._middles = np.append(route.stations(BIN_M), route.length_m + BIN_M)[:-1] + 0.5 * BIN_M
        track = route.at(fine_m)[:, :2]
        self._corner = track.min(axis=0) - half_width_m - CELL_M
        shape = np.ceil((track.max(axis=0) + half_width_m + CELL_M - self._corner) / CELL_M) + 1
        if shape.prod() > MOST_CELLS:
            raise SceneError(
                f"the route covers {shape[0] * CELL_M:.0f} x {shape[1] * CELL_M:.0f} m: cut it into"
                " parts, or give the height of its places above the road."
            )
        cells = np.indices(shape.astype(np.int64)).reshape(2, -1).T
        self._bins = np.full(shape.astype(np.int64), -1, np.int32)
        middles = self._corner + (cells + 0.5) * CELL_M
        chainage_m, offset_m = _near(route, middles, half_width_m + CELL_M)
        inside = np.abs(offset_m) <= half_width_m
        self._bins[tuple(cells[inside].T)] = (chainage_m[inside] / BIN_M).astype(np.int32)
        self._found: list[tuple[IntArray, Float64Array]] = []
        self._sensors: list[Float64Array] = []

    def add(self, points: FloatArray, sensor: Float64Array) -> None:
        """Take up the returns (N, 3) of a scan, scene frame, from a sensor at a place (3,)."""
        self._sensors.append(sensor)
        range_m = np.linalg.norm(points[:, :2] - sensor[:2], axis=1)
        near = points[(range_m > OWN_M) & (range_m < NEAR_M)]
        near = near[near[:, 2] < sensor[2]]
        cell = np.floor((near[:, :2] - self._corner) / CELL_M).astype(np.int64)
        inside = ((cell >= 0) & (cell < self._bins.shape)).all(axis=1)
        piece = self._bins[tuple(cell[inside].T)]
        self._found.append((piece[piece >= 0].astype(np.int64), near[inside][piece >= 0, 2]))

    def heights(self, chainage_m: Float64Array) -> Float64Array:
        """Height (S,) of the road at chainages, scene frame, metres.

        The lowest layer of the returns of each piece, smoothed along the route, linear in between.
        Beyond the first and the last piece with returns the road is as far below the route as
        there. NaN where no piece has returns.
        """
        z_m = self._piece_heights()
        known = np.isfinite(z_m)
        if not known.any():
            return np.full(len(chainage_m), np.nan)
        below_m = self._route.at(np.minimum(self._middles, self._route.length_m))[:, 2] - z_m
        below_at_m = np.interp(chainage_m, self._middles[known], below_m[known])
        return np.asarray(self._route.at(chainage_m)[:, 2] - below_at_m)

    @property
    def known_share(self) -> float:
        """Share of the pieces of the route that have returns on the road."""
        return float(np.isfinite(self._piece_heights()).mean())

    def _piece_heights(self) -> Float64Array:
        """Smoothed heights of the pieces; NaN without returns."""
        raw_m = np.full(len(self._middles), np.nan)
        if self._found:
            piece = np.concatenate([one for one, _ in self._found])
            z_m = np.concatenate([one for _, one in self._found])
            order = np.lexsort((z_m, piece))
            piece, z_m = piece[order], z_m[order]
            starts = np.searchsorted(piece, np.arange(len(raw_m) + 1))
            for nth, (begin, end) in enumerate(pairwise(starts)):
                if end - begin >= LEAST_RETURNS:
                    own = z_m[begin:end]  # rising
                    low = own[len(own) // 10]
                    raw_m[nth] = np.median(own[own < low + LAYER_M])
            raw_m[self._bodies(raw_m)] = np.nan
        return _smoothed(self._middles, raw_m)

    def _bodies(self, raw_m: Float64Array) -> BoolArray:
        """Which pieces (P,) hold a vehicle or another body that hides the road."""
        sensors = np.array(self._sensors)
        middles = self._route.at(np.minimum(self._middles, self._route.length_m))
        distance_m, nearest = cKDTree(sensors[:, :2]).query(middles[:, :2])
        return bodies_on_road(self._middles, raw_m - sensors[nearest, 2], distance_m)


def _near(route: Route, xy: Float64Array, within_m: float) -> tuple[Float64Array, Float64Array]:
    """As `Route.locate`, for points within a distance only; NaN for others."""
    chainage_m, offset_m = np.full(len(xy), np.nan), np.full(len(xy), np.nan)
    fine = route.at(np.append(route.stations(CELL_M), route.length_m))[:, :2]
    distance_m, _ = cKDTree(fine).query(xy, distance_upper_bound=within_m + CELL_M)
    near = np.isfinite(distance_m)
    chainage_m[near], offset_m[near] = route.locate(xy[near])
    return chainage_m, offset_m


def bodies_on_road(
    middle_m: Float64Array, below_m: Float64Array, distance_m: Float64Array
) -> BoolArray:
    """Pieces that are too high or low for the road, from the scanners' way outwards.

    Parameters
    ----------
    middle_m, below_m, distance_m : (P,) float64 arrays
        Chainage of the pieces, height against the nearest scanner (NaN: not known), and distance
        from it.

    Returns
    -------
    (P,) bool array

    Examples
    --------
    A car of 4 m on level ground, and a kerb of 5 cm:

    >>> below_m = np.array([0, 0, 0, 0.5, 0.9, 1.4, 0.9, 0, 0, 0.05])
    >>> np.flatnonzero(bodies_on_road(np.arange(10.0), below_m, np.arange(10.0)))
    array([3, 4, 5, 6])
    """
    known = np.flatnonzero(np.isfinite(below_m))
    order = known[np.argsort(distance_m[known], kind="stable")]
    is_body = np.zeros(len(below_m), np.bool_)
    accepted: list[int] = []
    for nth in order.tolist():
        at = bisect_left(accepted, nth)
        around = accepted[max(at - 1, 0) : at + 1]
        if around:
            other = min(around, key=lambda one: abs(middle_m[one] - middle_m[nth]))
            rise_m = below_m[nth] - below_m[other]
            apart_m = abs(middle_m[nth] - middle_m[other])
            is_body[nth] = not -FALL * apart_m - STEP_M <= rise_m <= RISE * apart_m + STEP_M
        if not is_body[nth]:
            accepted.insert(at, nth)
    return is_body


def _smoothed(middle_m: Float64Array, raw_m: Float64Array) -> Float64Array:
    """Outliers by a running median of five replaced, then a line through the neighbours of each."""
    known = np.isfinite(raw_m)
    if known.sum() < 3:
        return raw_m
    x_m, z_m = middle_m[known], raw_m[known]
    z_m = ndimage.median_filter(z_m, size=5, mode="nearest")
    smooth_m = np.full(len(raw_m), np.nan)
    for nth in np.flatnonzero(known):
        near = np.abs(x_m - middle_m[nth]) <= SMOOTH_M
        if near.sum() >= 3:
            line = np.polyfit(x_m[near] - middle_m[nth], z_m[near], 1)
            smooth_m[nth] = line[1]
    return smooth_m
