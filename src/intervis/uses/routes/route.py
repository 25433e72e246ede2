"""A route: places in travelled order, with chainage, speed and time."""

from __future__ import annotations  # help() then shows ArrayLike by its name

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from intervis.arrays import LARGEST_M, Float64Array, numbers_of
from intervis.errors import PointsError, SettingsError
from intervis.sight.query_checks import finite_number, positive_length

LEAST_SPACING_M = 0.2
"""Places nearer to the one before are left out: a standing vehicle has no direction."""

LARGEST = 1e12
"""Times and speeds are no larger."""

MOST_STATIONS = 2_000_000
POINTS_AT_ONCE = 64
"""Of points that are located: one that is far away may have all samples of a route near."""
STRAIGHT_M = 5.0
"""The last part of a route, whose direction an extension keeps."""


@dataclass(frozen=True, eq=False, repr=False)
class Route:
    """A polyline through the scene, in the order of travel.

    Attributes
    ----------
    points : (K, 3) float64 array
        Scene frame, metres.
    chainage_m : (K,) float64 array
        Horizontal distance from the first place along the polyline; strictly rising from 0.
    speed_mps : (K,) float64 array
        Metres per second; NaN where not known.
    time_s : (K,) float64 array
        On the clock of the scene; NaN where not known.

    Raises
    ------
    PointsError
        The arrays do not fit each other, or the chainages do not rise.

    Examples
    --------
    >>> bend = Route.through([[0, 0, 0], [30, 0, 0], [30, 40, 2]])
    >>> bend
    <Route: 3 places, 70.0 m>
    >>> bend.at([10.0, 50.0]).tolist()
    [[10.0, 0.0, 0.0], [30.0, 20.0, 1.0]]
    """

    points: Float64Array
    chainage_m: Float64Array
    speed_mps: Float64Array
    time_s: Float64Array

    def __post_init__(self) -> None:
        for name in ("points", "chainage_m", "speed_mps", "time_s"):
            object.__setattr__(self, name, numbers_of(getattr(self, name), f"a route's {name}"))
        count = len(self.points) if self.points.ndim else 0
        if count < 2 or self.points.shape != (count, 3):
            raise PointsError("a route needs two places or more, of shape (K, 3).")
        if not (np.abs(self.points[:, :2]) <= LARGEST_M).all():
            raise PointsError(f"the places of a route must be within {LARGEST_M:g} m.")
        if {self.chainage_m.shape, self.speed_mps.shape, self.time_s.shape} != {(count,)}:
            raise PointsError(f"a route of {count} places needs as many chainages, speeds, times.")
        if (
            not (np.abs(self.chainage_m) <= LARGEST).all()
            or not (np.diff(self.chainage_m) > 0).all()
        ):
            raise PointsError("the chainages of a route must be finite and rise.")

    @classmethod
    def through(
        cls,
        points: ArrayLike,
        *,
        speed_mps: ArrayLike | None = None,
        time_s: ArrayLike | None = None,
    ) -> Self:
        """The route through places in their order.

        Parameters
        ----------
        points : (N, 3) array
            Scene frame, metres. Places within 0.2 m of the one before are left out.
        speed_mps : (N,) array or None
            None: from the times, where they are given.
        time_s : (N,) array or None
            Rising.

        Raises
        ------
        PointsError
            Wrong shape, a place that is not finite, times that do not rise, a speed that is not
            positive, or less than two places apart.
        """
        xyz = numbers_of(points, "the places of a route")
        if xyz.ndim != 2 or xyz.shape[1] != 3 or not (np.abs(xyz) <= LARGEST_M).all():
            raise PointsError(
                f"the places of a route must have the shape (N, 3), in metres up to {LARGEST_M:g}."
            )
        times = _column(time_s, len(xyz), "times")
        step_s = np.diff(times)
        if (step_s <= 0).any():
            place = int(np.argmax(step_s <= 0)) + 1
            raise PointsError(
                f"the times of a route must rise, and place {place} ({times[place]:.3f} s) is not"
                f" later than the one before it ({times[place - 1]:.3f} s): sort the track."
            )
        speeds = _column(speed_mps, len(xyz), "speeds")
        if (speeds <= 0).any():
            raise PointsError("the speeds of a route must be positive.")
        kept = _apart(xyz)
        if len(kept) < 2:
            raise PointsError(
                f"a route needs two places that are {LEAST_SPACING_M:g} m apart or more."
            )
        xyz, times, speeds = xyz[kept], times[kept], speeds[kept]
        chainage_m = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(xyz[:, :2], axis=0), axis=1)))
        if speed_mps is None and np.isfinite(times).all():
            with np.errstate(over="ignore", divide="ignore"):
                speeds = np.gradient(chainage_m, times)
            if not np.isfinite(speeds).all():
                raise PointsError("the times of a route are too close to each other.")
        return cls(xyz, chainage_m, speeds, times)

    def __repr__(self) -> str:
        return f"<Route: {len(self.points)} places, {self.length_m:.1f} m>"

    @property
    def length_m(self) -> float:
        """Horizontal length, metres."""
        return float(self.chainage_m[-1])

    def stations(self, step_m: float) -> Float64Array:
        """(S,) chainages from 0 on, `step_m` apart.

        Raises
        ------
        SettingsError
            The step is not positive and finite, or makes more than `MOST_STATIONS`.
        """
        step = positive_length("the step", step_m)
        if self.length_m / step > MOST_STATIONS:
            raise SettingsError(
                f"steps of {step:g} m along {self.length_m:.0f} m are too many: take larger ones."
            )
        return np.asarray(np.minimum(np.arange(0.0, self.length_m + 1e-9, step), self.length_m))

    def at(self, chainage_m: ArrayLike) -> Float64Array:
        """(..., 3) places at chainages, linear in between; NaN beyond the ends."""
        where = numbers_of(chainage_m, "chainage_m")
        columns = [
            np.interp(where, self.chainage_m, column, np.nan, np.nan) for column in self.points.T
        ]
        return np.stack(columns, axis=-1)

    def above(self, chainage_m: ArrayLike, height_m: float) -> Float64Array:
        """(..., 3) places at chainages, so much higher than the route."""
        places = self.at(chainage_m)
        places[..., 2] += finite_number("height_m", height_m, "metres")
        return places

    def speed_at(self, chainage_m: ArrayLike) -> Float64Array:
        """Speed at chainages, metres per second; NaN where not known."""
        return np.asarray(
            np.interp(numbers_of(chainage_m, "chainage_m"), self.chainage_m, self.speed_mps)
        )

    def time_at(self, chainage_m: ArrayLike) -> Float64Array:
        """Time at chainages, seconds; NaN where not known."""
        return np.asarray(
            np.interp(numbers_of(chainage_m, "chainage_m"), self.chainage_m, self.time_s)
        )

    def locate(self, xy: ArrayLike) -> tuple[Float64Array, Float64Array]:
        """Chainage and offset of points: of the nearest place of the route.

        Parameters
        ----------
        xy : (M, 2) array
            Scene frame, metres; rows that are not finite, or beyond 1e9 m, get NaN.

        Returns
        -------
        chainage_m, offset_m : (M,) float64 arrays
            The offset is positive to the left of the direction of travel.

        Examples
        --------
        >>> straight = Route.through([[0, 0, 0], [50, 0, 0], [100, 0, 0]])
        >>> chainage_m, offset_m = straight.locate([[20, 3], [70, -4]])
        >>> chainage_m.tolist(), offset_m.tolist()
        ([20.0, 70.0], [3.0, -4.0])
        """
        given = np.atleast_2d(numbers_of(xy, "xy"))
        if given.size and (given.ndim != 2 or given.shape[1] != 2):
            raise PointsError(f"xy must have the shape (M, 2), got {given.shape}.")
        given = given.reshape(-1, 2)
        chainage_m, offset_m = np.full(len(given), np.nan), np.full(len(given), np.nan)
        known = (np.abs(given) <= LARGEST_M).all(axis=1)
        # Samples of the route, among them all its points, at most `apart_m` from each other.
        apart_m = max(0.25, self.length_m / 1e5)
        sample_m = np.union1d(self.stations(apart_m), self.chainage_m)
        samples = cKDTree(self.at(sample_m)[:, :2])
        rows = np.flatnonzero(known)
        for begin in range(0, len(rows), POINTS_AT_ONCE):
            some = rows[begin : begin + POINTS_AT_ONCE]
            # The nearest place is on a segment of a sample that is farther by no more than that.
            near = samples.query_ball_point(given[some], samples.query(given[some])[0] + apart_m)
            chainage_m[some], offset_m[some] = self._located(given[some], near, sample_m)
        return chainage_m, offset_m

    def _located(
        self, xy: Float64Array, near: NDArray[np.object_], sample_m: Float64Array
    ) -> tuple[Float64Array, Float64Array]:
        """As `locate`, of points (M, 2), by the segments of the samples `near` each."""
        row = np.repeat(np.arange(len(xy)), [len(one) for one in near])
        after = np.searchsorted(self.chainage_m, sample_m[np.concatenate(near)], side="right") - 1
        # A sample that is a point of the route belongs to the segment before it as well.
        row, segment = np.tile(row, 2), np.concatenate([after, after - 1])
        segment = np.clip(segment, 0, len(self.points) - 2)
        start, step = self.points[segment, :2], np.diff(self.points[:, :2], axis=0)[segment]
        length_m = np.linalg.norm(step, axis=1)
        along = np.clip(((xy[row] - start) * step).sum(axis=1) / length_m**2, 0.0, 1.0)
        beside = xy[row] - (start + along[:, None] * step)
        distance_m = np.linalg.norm(beside, axis=1)
        # Of equally near places the first along the route.
        order = np.lexsort((segment, distance_m, row))
        best = order[np.searchsorted(row[order], np.arange(len(xy)))]
        step, beside = step[best], beside[best]
        # Beyond an end the nearest place is the end: the offset is the distance to it there.
        side = np.where(step[:, 0] * beside[:, 1] < step[:, 1] * beside[:, 0], -1.0, 1.0)
        chainage_m = self.chainage_m[segment[best]] + along[best] * length_m[best]
        return chainage_m, side * distance_m[best]

    def reversed(self) -> Route:
        """The same places in the other direction; without times, with the speeds."""
        return Route(
            self.points[::-1],
            self.length_m - self.chainage_m[::-1],
            self.speed_mps[::-1],
            np.full(len(self.points), np.nan),
        )

    def shifted(self, offset_m: float) -> Route:
        """The route moved sideways, positive to the left; chainages, speeds and times stay.

        Raises
        ------
        SettingsError
            The offset is not finite, or beyond 1e9 m.
        """
        offset_m = finite_number("the offset", offset_m, "metres")
        if abs(offset_m) > LARGEST_M:
            raise SettingsError(f"the offset must be at most {LARGEST_M:g} m, got {offset_m:g}.")
        tangent = np.gradient(self.points[:, :2], self.chainage_m, axis=0)
        length = np.linalg.norm(tangent, axis=1, keepdims=True)
        turns_back = length[:, 0] < 1e-9  # there the way before it counts
        before = np.diff(self.points[:, :2], axis=0)
        tangent[turns_back] = before[np.flatnonzero(turns_back) - 1]
        tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
        moved = self.points.copy()
        moved[:, 0] -= offset_m * tangent[:, 1]
        moved[:, 1] += offset_m * tangent[:, 0]
        return Route(moved, self.chainage_m, self.speed_mps, self.time_s)

    def extended(self, length_m: float) -> Route:
        """The route with a straight end of this length, in the direction of its last 5 m.

        The speed of the last place holds on.
        """
        length_m = positive_length("the extension", length_m)
        end = self.points[-1]
        back = self.at(max(self.length_m - STRAIGHT_M, 0.0))
        if not (end - back)[:2].any():  # it has come back
            back = self.points[-2]
        step = (end - back) / np.linalg.norm((end - back)[:2])
        return Route(
            np.vstack([self.points, end + length_m * step]),
            np.append(self.chainage_m, self.length_m + length_m),
            np.append(self.speed_mps, self.speed_mps[-1]),
            np.append(self.time_s, np.nan),
        )

    def refined(self, step_m: float) -> Route:
        """The same polyline with places at every `step_m` as well."""
        fine_m = np.union1d(self.chainage_m, self.stations(step_m))
        kept = np.append(True, np.diff(fine_m) > 1e-6)
        fine_m = fine_m[kept]
        return Route(self.at(fine_m), fine_m, self.speed_at(fine_m), self.time_at(fine_m))

    def with_heights(self, z_m: Float64Array) -> Route:
        """The route at other heights (K,), metres."""
        heights_m = numbers_of(z_m, "z_m")
        if heights_m.shape != (len(self.points),):
            raise PointsError(f"{len(self.points)} places need as many heights.")
        points = np.column_stack([self.points[:, :2], heights_m])
        return Route(points, self.chainage_m, self.speed_mps, self.time_s)


def _column(values: ArrayLike | None, count: int, name: str) -> Float64Array:
    """Values (N,) of the places; NaN without any."""
    if values is None:
        return np.full(count, np.nan)
    column = numbers_of(values, name)
    if column.shape != (count,) or not (np.abs(column) <= LARGEST).all():
        raise PointsError(
            f"a route of {count} places needs as many finite {name}, up to {LARGEST:g}."
        )
    return column


def _apart(xyz: Float64Array) -> list[int]:
    """Indices of the places that are apart from the one kept before them."""
    kept = [0] if len(xyz) else []
    for nth in range(1, len(xyz)):
        if np.hypot(*(xyz[nth, :2] - xyz[kept[-1], :2])) >= LEAST_SPACING_M:
            kept.append(nth)
    return kept
