"""Places: static worlds of known triangles with positions for a scanner.

A crossing with hedges, a road with crest and dip, a hall with a gallery, a forest track, a
roadside, a car park, the built-in street, and parked cars of dark paint and glass that return few
echoes. The scene's z is up.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from intervis.arrays import BoolArray, Float64Array
from intervis.lab.worlds import shapes
from intervis.lab.worlds.ray_casting import RayCaster

GRADE = 0.15
"""Gradient of the road with crest and dip."""
_DEPTH_M = 60.0


@dataclass(frozen=True, eq=False)
class Place:
    """A static world.

    Attributes
    ----------
    name : str
    triangles : (T, 3, 3) float64 array
        Metres.
    solids : (K, 2, 3) float64 array
        Lower and upper corners of boxes that hold all bodies: no viewpoint lies in them.
    bounds : (2, 2) float64 array
        Lower and upper x, y of the region of viewpoints and free points.
    sites : (P, 2) float64 array
        x, y at which a scanner may stand.
    ceiling_m : float
        Free points lie lower than this above the ground.
    lost_share : (T,) float64 array or None
        Share of the echoes that each triangle loses, for dark or shining surfaces; None: nowhere.
    """

    name: str
    triangles: Float64Array = field(repr=False)
    solids: Float64Array = field(repr=False)
    bounds: Float64Array
    sites: Float64Array
    ceiling_m: float = 8.0
    lost_share: Float64Array | None = field(default=None, repr=False)

    @cached_property
    def caster(self) -> RayCaster:
        """Over the triangles."""
        return RayCaster(self.triangles)

    def ground(self, xy: Float64Array) -> Float64Array:
        """(M, 3) points of the lowest surface at (M, 2) positions; NaN where there is none."""
        foot = np.column_stack([xy, np.full(len(xy), -_DEPTH_M)])
        rise_m = self.caster.first_hit(foot, foot + np.array([0.0, 0.0, 2 * _DEPTH_M]))
        foot[:, 2] += np.where(np.isfinite(rise_m), rise_m, np.nan)
        return foot

    def free(self, points: Float64Array, margin_m: float = 0.1) -> BoolArray:
        """Whether points (M, 3) lie within the bounds, above the ground and outside the solids."""
        inside = np.zeros(len(points), np.bool_)
        for low, high in self.solids:
            inside |= ((points > low - margin_m) & (points < high + margin_m)).all(axis=1)
        xy = points[:, :2]
        within = ((xy >= self.bounds[0]) & (xy <= self.bounds[1])).all(axis=1)
        height_m = points[:, 2] - self.ground(xy)[:, 2]
        return np.asarray(within & ~inside & (height_m > margin_m) & (height_m < self.ceiling_m))


def _ground(
    x_m: float,
    y_m: float,
    height: Callable[[Float64Array], Float64Array] | None = None,
    step_m: float = 2.0,
) -> Float64Array:
    """Ground over -x_m to x_m and -y_m to y_m, its height a function of x."""
    x = np.linspace(-x_m, x_m, round(2 * x_m / step_m) + 1)
    y = np.array([-y_m, y_m])
    points = np.empty((len(x), 2, 3))
    points[..., 0], points[..., 1] = x[:, None], y
    points[..., 2] = 0.0 if height is None else height(x)[:, None]
    return shapes.grid(points)


class _Builder:
    """Triangles and the boxes around them."""

    def __init__(self, ground: Float64Array) -> None:
        self.parts = [ground]
        self.lost: list[Float64Array] = [np.zeros(len(ground))]
        self.solids: list[Float64Array] = []

    def add(self, triangles: Float64Array, lost_share: ArrayLike = 0.0) -> None:
        """A body that loses a share of its echoes; nothing can stand in its bounding box."""
        self.parts.append(triangles)
        self.lost.append(np.broadcast_to(np.asarray(lost_share, np.float64), len(triangles)))
        self.solids.append(np.array([triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))]))

    def box(self, lower: tuple[float, float, float], upper: tuple[float, float, float]) -> None:
        self.add(shapes.box(lower, upper))

    def car(
        self,
        x: float,
        y: float,
        z: float = 0.0,
        along_x: bool = True,
        lost_share: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        """Body 4.4 x 1.8 m with a cabin; shares of the echoes that paint and windows lose."""
        half = np.array([2.2, 0.9] if along_x else [0.9, 2.2])
        low, high = np.array([x, y]) - half, np.array([x, y]) + half
        cabin = half * ([0.55, 0.9] if along_x else [0.9, 0.55])
        body = shapes.box([*low, z + 0.25], [*high, z + 0.85])
        top = shapes.box(
            [x - cabin[0], y - cabin[1], z + 0.85], [x + cabin[0], y + cabin[1], z + 1.5]
        )
        paint, windows = lost_share
        shares = np.repeat([paint, windows], [len(body), len(top)])
        roof = np.isclose(top[:, :, 2], z + 1.5).all(axis=1)
        shares[len(body) :][roof] = paint
        self.add(np.concatenate([body, top]), shares)

    def tree(self, rng: np.random.Generator, x: float, y: float, z: float = 0.0) -> None:
        """Trunk and a crown of leaves."""
        radius, height = float(rng.uniform(0.12, 0.3)), float(rng.uniform(2.5, 5.0))
        self.add(shapes.tube([radius, 0.7 * radius], [-0.3, height + 1]) + np.array([x, y, z]))
        crown = rng.uniform([1.0, 1.0, 1.2], [2.2, 2.2, 2.5])
        self.add(
            shapes.leaves(rng, 500, crown, 0.3) + np.array([x, y, z + height + crown[2] * 0.8])
        )

    def place(
        self,
        name: str,
        half_x: float,
        half_y: float,
        sites: list[tuple[float, float]],
        ceiling_m: float = 8.0,
    ) -> Place:
        return Place(
            name,
            np.concatenate(self.parts),
            np.array(self.solids).reshape(-1, 2, 3),
            np.array([[-half_x, -half_y], [half_x, half_y]]),
            np.array(sites),
            ceiling_m,
            lost if (lost := np.concatenate(self.lost)).any() else None,
        )


def crossing(seed: int = 0) -> Place:
    """Two roads; hedges and houses at the four corners, cars on the roads."""
    rng = np.random.default_rng(seed)
    made = _Builder(_ground(70, 70))
    for sx in (-1, 1):
        for sy in (-1, 1):
            height = float(rng.uniform(1.2, 2.2))
            for x0, x1, y0, y1 in ((6, 30, 6, 6.8), (6, 6.8, 7, 30)):
                xs, ys = sorted((sx * x0, sx * x1)), sorted((sy * y0, sy * y1))
                made.box((xs[0], ys[0], 0), (xs[1], ys[1], height))
            x, y = sx * float(rng.uniform(14, 20)), sy * float(rng.uniform(14, 20))
            made.box((x - 4, y - 4, 0), (x + 4, y + 4, float(rng.uniform(4, 8))))
    for x in (-38.0, -16.0, 14.0, 33.0):
        made.car(x + float(rng.uniform(-2, 2)), float(rng.choice([-3.5, 3.5])))
    for y in (-30.0, 17.0, 42.0):
        made.car(float(rng.choice([-3.5, 3.5])), y + float(rng.uniform(-2, 2)), along_x=False)
    return made.place("crossing", 55, 55, [(-9, 0), (0, -10), (0, 0), (24, 0)])


def crest_height_m(x: Float64Array) -> Float64Array:
    """Height of the road at x: up at 15 % to a crest at 20 m, down to a dip at 60 m, and up.

    Examples
    --------
    >>> crest_height_m(np.array([-20.0, 0.0, 20.0, 60.0, 80.0])).round(6)
    array([ 0.,  0.,  3., -3.,  0.])
    """
    return np.asarray(np.interp(x, [-200, 0, 20, 60, 80], np.array([0, 0, 20, -20, 0]) * GRADE))


def crest(seed: int = 0) -> Place:
    """A road with crest and dip of 15 %, cars on it, trees beside it."""
    rng = np.random.default_rng(seed)
    made = _Builder(_ground(110, 40, crest_height_m))
    for x in (10.0, 38.0, 58.0, 72.0):
        made.car(x, float(rng.choice([-3.5, 3.5])), float(crest_height_m(np.array(x))))
    for _ in range(14):
        x, y = float(rng.uniform(-40, 90)), float(rng.choice([-1, 1]) * rng.uniform(8, 30))
        made.tree(rng, x, y, float(crest_height_m(np.array(x))))
    return made.place("crest", 95, 36, [(-12, 0), (19, 0), (30, 0), (60, 0)])


def hall(seed: int = 0) -> Place:
    """A hall 40 x 24 x 9 m with pillars, racks and a gallery at 4 m along one side."""
    rng = np.random.default_rng(seed)
    made = _Builder(_ground(20.5, 12.5))
    for low, high in (
        ((-20.5, 12, 0), (20.5, 12.5, 9)),
        ((-20.5, -12.5, 0), (20.5, -12, 9)),
        ((20, -12, 0), (20.5, 12, 9)),
        ((-20.5, -12, 0), (-20, 12, 9)),
        ((-20.5, -12.5, 9), (20.5, 12.5, 9.3)),
        ((-20, 8, 4), (20, 12, 4.3)),  # gallery
        ((-20, 7.95, 4.3), (20, 8.0, 5.3)),  # its parapet
    ):
        made.box(low, high)
    for x in (-12.0, -4.0, 4.0, 12.0):
        made.box((x - 0.2, 7.6, 0), (x + 0.2, 7.95, 4))
    for k in range(5):
        x, y = -14 + 6.5 * k + float(rng.uniform(-1, 1)), float(rng.uniform(-9, -4))
        made.box((x - 1.5, y - 0.6, 0), (x + 1.5, y + 0.6, float(rng.uniform(1, 3.2))))
    return made.place("hall", 19.8, 11.8, [(-16, 2), (0, 1), (9, 4), (-6, 9.5)], 8.8)


def forest(seed: int = 0) -> Place:
    """A track through trunks and crowns."""
    rng = np.random.default_rng(seed)
    made = _Builder(_ground(70, 50))
    for _ in range(150):
        made.tree(
            rng, float(rng.uniform(-60, 60)), float(rng.choice([-1, 1]) * rng.uniform(4.5, 40))
        )
    return made.place("forest", 55, 38, [(-20, 0), (0, 1), (15, -1), (30, 0)])


def roadside(seed: int = 0) -> Place:
    """A road of two lanes seen from its verge: cars, lorries, a barrier, poles and a house."""
    rng = np.random.default_rng(seed)
    made = _Builder(_ground(90, 60))
    for x in (-50.0, -30.0, -11.0, 12.0, 27.0, 48.0):
        shift, y = float(rng.uniform(-3, 3)), float(rng.choice([5.0, 9.0]))
        if rng.random() < 0.35:
            made.box((x + shift - 5, y - 1.25, 0.5), (x + shift + 5, y + 1.25, 3.8))
        else:
            made.car(x + shift, y)
    made.box((-70, 12, 0.3), (70, 12.1, 0.8))
    for x in (-45.0, -15.0, 15.0, 45.0):
        made.add(shapes.tube([0.08, 0.06], [-0.2, 8.0]) + np.array([x, 13.0, 0.0]))
    made.box((-8, 24, 0), (6, 34, float(rng.uniform(5, 9))))
    return made.place("roadside", 65, 45, [(0, 0), (-20, 1), (20, 1), (35, 0)], 9.0)


def car_park(seed: int = 0) -> Place:
    """Rows of parked cars, some bays empty, lamp posts between them."""
    rng = np.random.default_rng(seed)
    made = _Builder(_ground(60, 60))
    for y in (-23.0, -13.0, 10.0, 20.0):
        for x in np.arange(-30, 31, 2.6):
            if rng.random() < 0.7:
                made.car(float(x), y, along_x=False)
    for x in (-20.0, 0.0, 20.0):
        made.add(shapes.tube([0.1, 0.08], [-0.2, 6.0]) + np.array([x, -18.0, 0.0]))
    return made.place("car-park", 45, 45, [(-15, -2), (0, 0), (12, 3), (25, -4)])


def street(seed: int = 0) -> Place:
    """The built-in street without its moving cars; the sites are poses of its vehicle.

    Its houses have no boxes here: points inside of them are free, and their truth is exact too.
    """
    from intervis.lab.worlds.street.layout import build_street

    world = build_street(seed)
    poses = np.array([world.vehicle_pose_at(time_s) for time_s in (2.0, 5.0, 8.0, 11.0)])
    sites = poses[:, :2, 3]
    middle = sites.mean(axis=0)
    return Place(
        "street",
        world.static.corners,
        np.empty((0, 2, 3)),
        np.array([middle - 70, middle + 70]),
        sites,
    )


def dark_cars(seed: int = 0) -> Place:
    """A street of parked cars, half of them dark, between houses with shop windows.

    Dark paint loses 60 to 97 % of the echoes, glass 80 % (cars) and 90 % (shops). The shares were
    chosen by hand: at 8 m, a black car of the KITTI raw drive returns ten echoes around its edges.
    """
    rng = np.random.default_rng(seed)
    made = _Builder(_ground(70, 50))

    def car(x: float, y: float) -> None:
        paint = float(rng.choice([0.0, 0.6, 0.9, 0.97], p=[0.4, 0.1, 0.2, 0.3]))
        made.car(x, y, lost_share=(paint, max(paint, 0.8)))

    for y in (-6.0, 6.5):
        for x in np.arange(-50, 51, 6.2):
            if rng.random() < 0.75:
                car(float(x + rng.uniform(-0.5, 0.5)), y)
    for x in (-40.0, -15.0, 12.0, 33.0):
        car(x + float(rng.uniform(-3, 3)), float(rng.choice([-2.0, 2.0])))
    for side in (-1, 1):
        for x in (-40.0, -14.0, 12.0, 38.0):
            near, far = sorted((side * 11.0, side * 18.0))
            made.box((x - 9, near, 0), (x + 9, far, float(rng.uniform(4, 9))))
            if rng.random() < 0.6:
                near, far = sorted((side * 10.9, side * 11.0))
                made.add(shapes.box((x - 6, near, 0.6), (x + 6, far, 2.6)), 0.9)
    return made.place("dark-cars", 55, 30, [(-20, 0), (0, 0), (5, 4.2), (25, -4.2)])


PLACES: dict[str, Callable[[int], Place]] = {
    "street": street,
    "crossing": crossing,
    "crest": crest,
    "hall": hall,
    "forest": forest,
    "roadside": roadside,
    "car-park": car_park,
    "dark-cars": dark_cars,
}
"""Makers of the places by name, each with a seed."""
