"""Small worlds with closed-form visibility: plane, wall, step, box, sphere, valley.

Each has triangles to be scanned and, derived independently, a formula for the visibility of two
points. The formula holds for points in free space between `lower` and `upper`. A line that touches
a surface counts as visible.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from intervis.arrays import BoolArray, Float64Array
from intervis.lab.worlds import shapes
from intervis.lab.worlds.triangles import Material, Triangles
from intervis.lab.worlds.world import World
from intervis.transform import rigid

GREY = Material("building", (0.4, 0.4, 0.4), 0.5)
EARTH = Material("terrain", (0.2, 0.25, 0.08), 0.4)

Answer = Callable[[Float64Array, Float64Array], BoolArray]
Region = Callable[[Float64Array], BoolArray]


@dataclass(frozen=True, eq=False)
class AnalyticWorld:
    """A world with closed-form visibility.

    Attributes
    ----------
    name : str
        For example ``wall``.
    surfaces : Triangles
        World frame, metres.
    lower, upper : (3,) float64 arrays
        Corners of the box in which the formula holds, metres.
    sensor : (3,) float64 array
        A position for a scanner, metres.
    """

    name: str
    surfaces: Triangles = field(repr=False)
    lower: Float64Array
    upper: Float64Array
    sensor: Float64Array
    _visible: Answer = field(repr=False)
    _free: Region = field(repr=False)

    @property
    def triangles(self) -> Float64Array:
        """(T, 3, 3) corners, metres."""
        return self.surfaces.corners

    def visible(self, first: ArrayLike, second: ArrayLike) -> BoolArray:
        """Whether (M,) the line between two points is free, for points in `free`.

        Parameters
        ----------
        first, second : (M, 3) or (3,) arrays
            Metres.

        Examples
        --------
        >>> wall().visible([0.0, 0, 1], [[20.0, 0, 1], [20, 0, 9]])
        array([False,  True])
        """
        starts, ends = np.broadcast_arrays(
            np.atleast_2d(np.asarray(first, float)), np.atleast_2d(np.asarray(second, float))
        )
        return self._visible(starts, ends)

    def free(self, points: ArrayLike) -> BoolArray:
        """Whether (M,) points lie within the bounds and outside of solid bodies."""
        places = np.atleast_2d(np.asarray(points, float))
        inside = ((self.lower <= places) & (places <= self.upper)).all(axis=1)
        return np.asarray(inside & self._free(places))

    def world(self) -> World:
        """A world of these triangles, with a scanner at `sensor`."""
        pose = rigid(np.eye(3), self.sensor)
        return World(self.surfaces, (), lambda time_s: pose)


def _heights_at(starts: Float64Array, ends: Float64Array, x: float) -> Float64Array:
    """Height of each line at x; infinity where x is not strictly between its ends."""
    before, after = starts[:, 0] - x, ends[:, 0] - x
    passes = before * after < 0
    fraction = before / np.where(passes, before - after, 1.0)
    height = starts[:, 2] + fraction * (ends[:, 2] - starts[:, 2])
    return np.where(passes, height, np.inf)


def profile(
    name: str,
    corners_xz: ArrayLike,
    sensor: ArrayLike,
    half_width_m: float = 40.0,
    sky_m: float = 15.0,
) -> AnalyticWorld:
    """Ground whose height is a piecewise linear function of x.

    Two points above it see each other exactly when their line passes above every corner between
    them, because a line that is above both ends of a straight piece is above the whole piece.

    Parameters
    ----------
    name : str
    corners_xz : (n, 2) array
        Corners of the profile, metres, x not decreasing; two with the same x make a cliff.
    sensor : (3,) array
        A position for a scanner, metres.
    half_width_m, sky_m : float
        Extent of the world to each side, and above its highest corner.
    """
    chain = np.asarray(corners_xz, dtype=np.float64)

    def visible(starts: Float64Array, ends: Float64Array) -> BoolArray:
        clear = np.ones(len(starts), np.bool_)
        for x, z in chain:
            clear &= _heights_at(starts, ends, float(x)) >= z
        return clear

    def free(points: Float64Array) -> BoolArray:
        return np.asarray(points[:, 2] >= np.interp(points[:, 0], chain[:, 0], chain[:, 1]))

    y = np.array([-half_width_m, half_width_m])
    points = np.empty((len(chain), 2, 3))
    points[:, :, 0], points[:, :, 1], points[:, :, 2] = chain[:, :1], y, chain[:, 1:]
    lower = np.array([chain[0, 0], -half_width_m, chain[:, 1].min()])
    upper = np.array([chain[-1, 0], half_width_m, chain[:, 1].max() + sky_m])
    place = np.asarray(sensor, dtype=np.float64)
    return AnalyticWorld(
        name, Triangles.of(shapes.grid(points), EARTH), lower, upper, place, visible, free
    )


def plane() -> AnalyticWorld:
    """Level ground at height 0: all points above it see each other."""
    return profile("plane", [[-60, 0], [60, 0]], [0.0, 0.0, 1.73])


def step(rise_m: float = 2.5) -> AnalyticWorld:
    """Level ground with an upward cliff at x = 8, whose edge occludes the ground behind it."""
    chain: list[tuple[float, float]] = [(-50, 0), (8, 0), (8, rise_m), (50, rise_m)]
    return profile("step", chain, [0.0, 0.0, 1.73])


def valley(depth_m: float = 3.0) -> AnalyticWorld:
    """A sensor in front of a valley, a ridge and a second valley."""
    chain = [(-40, 0), (6, 0), (14, -depth_m), (26, -depth_m), (34, 1), (42, -1), (60, 0.5)]
    return profile("valley", chain, [0.0, 0.0, 1.73])


def wall(height_m: float = 3.0, half_width_m: float = 6.0) -> AnalyticWorld:
    """A thin upright wall in the plane x = 10, standing on level ground."""
    ground = plane()
    corners = [[10, w, z] for w, z in ((-half_width_m, 0), (half_width_m, 0))]
    tops = [[10, w, height_m] for w in (half_width_m, -half_width_m)]

    def visible(starts: Float64Array, ends: Float64Array) -> BoolArray:
        before, after = starts[:, 0] - 10.0, ends[:, 0] - 10.0
        passes = before * after < 0
        fraction = before / np.where(passes, before - after, 1.0)
        y = starts[:, 1] + fraction * (ends[:, 1] - starts[:, 1])
        z = starts[:, 2] + fraction * (ends[:, 2] - starts[:, 2])
        return np.asarray(~(passes & (np.abs(y) < half_width_m) & (z < height_m)))

    surfaces = Triangles.joined([ground.surfaces, Triangles.of(shapes.quad(*corners, *tops), GREY)])
    return AnalyticWorld(
        "wall", surfaces, ground.lower, ground.upper, ground.sensor, visible, ground._free
    )


def box(
    lower_m: tuple[float, float, float] = (8.0, -2.0, 0.0),
    upper_m: tuple[float, float, float] = (12.0, 2.0, 1.5),
) -> AnalyticWorld:
    """A solid box on level ground; a line is blocked where it is inside all three slabs at once."""
    ground = plane()
    low, high = np.asarray(lower_m), np.asarray(upper_m)

    def visible(starts: Float64Array, ends: Float64Array) -> BoolArray:
        segment = ends - starts
        with np.errstate(divide="ignore", invalid="ignore"):
            one, two = (low - starts) / segment, (high - starts) / segment
        parallel = segment == 0
        within = (low < starts) & (starts < high)
        enter = np.where(parallel, np.where(within, -np.inf, np.inf), np.minimum(one, two))
        leave = np.where(parallel, np.where(within, np.inf, -np.inf), np.maximum(one, two))
        first, last = enter.max(axis=1), leave.min(axis=1)
        return np.asarray(~((first < last) & (last > 0) & (first < 1)))

    def free(points: Float64Array) -> BoolArray:
        inside = ((low < points) & (points < high)).all(axis=1)
        return np.asarray((points[:, 2] >= 0) & ~inside)

    surfaces = Triangles.joined([ground.surfaces, Triangles.of(shapes.box(low, high), GREY)])
    return AnalyticWorld("box", surfaces, ground.lower, ground.upper, ground.sensor, visible, free)


def sphere(
    radius_m: float = 2.0,
    centre_m: tuple[float, float, float] = (10.0, 0.0, 2.5),
    rings: int = 48,
) -> AnalyticWorld:
    """A sphere above level ground; a line is blocked where its distance to the centre is less.

    The corners of the triangles lie on the sphere, so the faces lie inside it by at most
    `sagitta_m`.
    """
    ground = plane()
    centre = np.asarray(centre_m)

    def visible(starts: Float64Array, ends: Float64Array) -> BoolArray:
        segment = ends - starts
        square = np.maximum(np.einsum("ij,ij->i", segment, segment), 1e-300)
        fraction = np.clip(np.einsum("ij,ij->i", centre - starts, segment) / square, 0, 1)
        nearest = starts + fraction[:, None] * segment
        return np.asarray(np.linalg.norm(nearest - centre, axis=1) >= radius_m)

    def free(points: Float64Array) -> BoolArray:
        outside = np.linalg.norm(points - centre, axis=1) >= radius_m
        return np.asarray((points[:, 2] >= 0) & outside)

    faces = shapes.ellipsoid([radius_m] * 3, rings, 2 * rings) + centre
    surfaces = Triangles.joined([ground.surfaces, Triangles.of(faces, GREY)])
    return AnalyticWorld(
        "sphere", surfaces, ground.lower, ground.upper, ground.sensor, visible, free
    )


def sagitta_m(radius_m: float = 2.0, rings: int = 48) -> float:
    """Largest distance of the faces of `sphere` from the sphere, metres."""
    # A face spans the angle pi / rings in both directions: the sagitta of half that angle, twice.
    return float(radius_m * 2 * (1 - np.cos(np.pi / rings / 2)))


ANALYTIC_WORLDS: dict[str, Callable[[], AnalyticWorld]] = {
    "plane": plane,
    "wall": wall,
    "step": step,
    "box": box,
    "sphere": sphere,
    "valley": valley,
}
"""The worlds by name."""
