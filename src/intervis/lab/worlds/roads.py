"""Roads whose sight distance follows from a formula: a crest, a curve with a hedge, parked cars.

Each has triangles to be scanned and the path on the road. The formulas contain no sight line: they
are those of the textbooks, or similar triangles.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation

from intervis.arrays import Float32Array, Float64Array
from intervis.lab.worlds import shapes
from intervis.lab.worlds.materials import ASPHALT, GRASS, HEDGE
from intervis.lab.worlds.scanner import Scanner
from intervis.lab.worlds.triangles import Material, Triangles
from intervis.lab.worlds.world import Snapshot, World
from intervis.sight import Scene
from intervis.transform import rigid
from intervis.uses.routes.route import Route

SENSOR_M = 1.73
"""Height of the scanner above the road."""
CAR = Material("car", (0.3, 0.3, 0.35), 0.3)
FACADE = Material("building", (0.4, 0.4, 0.4), 0.5)


@dataclass(frozen=True, eq=False)
class RoadWorld:
    """A road to be scanned.

    Attributes
    ----------
    name : str
    surfaces : Triangles
        Scene frame, metres.
    road : Route
        The path on the road surface.
    """

    name: str
    surfaces: Triangles = field(repr=False)
    road: Route = field(repr=False)

    @cached_property
    def snapshot(self) -> Snapshot:
        """The surfaces with their ray caster."""
        return World(self.surfaces, (), lambda _: np.eye(4)).at(0.0)

    def poses(self, spacing_m: float) -> list[Float64Array]:
        """Poses (4, 4) of a scanner above the path, level across it."""
        chainage_m = self.road.stations(spacing_m)
        here, ahead = (self.road.at(chainage_m + shift) for shift in (-0.5, 0.5))
        poses = []
        for at_m, before, after in zip(chainage_m, here, ahead, strict=True):
            if np.isfinite(before).all() and np.isfinite(after).all():
                x, y, z = after - before
                turn = Rotation.from_euler(
                    "ZY", [math.atan2(y, x), -math.atan2(z, math.hypot(x, y))]
                )
                place = self.road.above(at_m, SENSOR_M)
                poses.append(rigid(turn.as_matrix(), place))
        return poses

    def scans(
        self, spacing_m: float, rng: np.random.Generator, columns: int = 1000
    ) -> Iterator[tuple[Float32Array, Float64Array]]:
        """Scans of an HDL-64E along the path, with noise and dropout, and their poses."""
        for pose in self.poses(spacing_m):
            points, _ = Scanner(columns=columns).scan(self.snapshot, pose, rng)
            yield points, pose

    def scene(
        self,
        spacing_m: float,
        rng: np.random.Generator,
        columns: int = 1000,
        sensor: str | None = None,
    ) -> Scene:
        """A scene of these scans; `sensor` as in `Scene`."""
        scene = Scene(sensor=sensor, max_scans=10_000, max_bytes=1 << 31)
        for points, pose in self.scans(spacing_m, rng, columns):
            scene.add(points, pose)
        return scene


def crest_road(radius_m: float = 600.0, half_length_m: float = 90.0) -> RoadWorld:
    """A road over a parabolic crest, z = -x^2 / (2 R), with facades 14 m to either side."""
    x = np.arange(-half_length_m - 60.0, half_length_m + 61.0, 0.5)
    ground = _strip(x, (-60.0, 60.0), -(x**2) / (2 * radius_m))
    road = Route.through(np.column_stack([x, 0 * x, -(x**2) / (2 * radius_m)])[120:-120])
    walls = [_facade(x, y, -(x**2) / (2 * radius_m)) for y in (-14.0, 14.0)]
    return RoadWorld("crest", Triangles.joined([Triangles.of(ground, ASPHALT), *walls]), road)


def crest_sight_m(radius_m: float, eye_m: float, object_m: float) -> float:
    """Sight distance over a parabolic crest that is longer than it.

    The sight line touches the parabola; from the point of contact the eye's height rises with the
    square of the distance: h1 = a^2 / (2 R), h2 = b^2 / (2 R), and S = a + b.

    Examples
    --------
    >>> round(crest_sight_m(600.0, 1.08, 0.60), 1)
    62.8
    """
    return math.sqrt(2 * radius_m) * (math.sqrt(eye_m) + math.sqrt(object_m))


def curve_road(radius_m: float = 80.0, hedge_m: float = 5.0, turn_deg: float = 150.0) -> RoadWorld:
    """A level curve to the left; a hedge of 2 m at a distance inside, a facade 8 m outside."""
    angle = np.radians(np.arange(0.0, turn_deg, 0.25))
    path = _arc(radius_m, angle)
    hedge = _arc(radius_m - hedge_m, angle), _arc(radius_m - hedge_m - 1.0, angle)
    parts = [
        Triangles.of(_strip(np.array([-250.0, 250.0]), (-250.0, 250.0), np.zeros(2)), GRASS),
        *(_wall(side, 0.0, 2.0, HEDGE) for side in hedge),
        _lid(*hedge, 2.0, HEDGE),
        _wall(_arc(radius_m + 8.0, angle), 0.0, 6.0, FACADE),
    ]
    route = Route.through(np.column_stack([path, np.zeros(len(path))]))
    return RoadWorld("curve", Triangles.joined(parts), route)


def curve_sight_m(radius_m: float, hedge_m: float) -> float:
    """Sight distance along a curve with a hedge inside: the arc whose sagitta reaches the hedge.

    M = R (1 - cos(S / (2 R))), hence S = 2 R acos((R - M) / R). The chord is shorter.

    Examples
    --------
    >>> round(curve_sight_m(80.0, 5.0), 1)
    56.9
    """
    return 2 * radius_m * math.acos((radius_m - hedge_m) / radius_m)


@dataclass(frozen=True)
class ParkedRow:
    """A row of parked cars at a junction, and a driver who turns right out of a side road.

    The driver comes along y, turns at the origin into x, and looks past the cars. The cars fill
    x from `near_m` to `far_m` and y from -`front_m` - `width_m` to -`front_m`.
    """

    near_m: float = 8.0
    far_m: float = 13.0
    front_m: float = 1.5
    width_m: float = 1.8
    height_m: float = 1.5

    def first_hidden_m(self, before_m: float) -> float:
        """Distance along the path to the first hidden object, from a driver before the corner.

        The line from (0, -d) to (x, 0) meets the near front edge where similar triangles give
        x = d near / (d - front); the path is d longer.

        Examples
        --------
        >>> round(ParkedRow().first_hidden_m(5.0), 2)  # 5 + 5 * 8 / 3.5
        16.43
        """
        return before_m + before_m * self.near_m / (before_m - self.front_m)

    def last_hidden_m(self, before_m: float) -> float:
        """Distance to the last hidden object: beyond it the line passes behind the far back edge.

        Infinite where the driver is not behind the cars.
        """
        back_m = before_m - self.front_m - self.width_m
        return before_m + (before_m * self.far_m / back_m if back_m > 0 else math.inf)


def junction_road(row: ParkedRow | None = None, length_m: float = 110.0) -> RoadWorld:
    """A junction with parked cars (`ParkedRow`); facades far enough to hide nothing."""
    cars = row or ParkedRow()
    low = np.array([cars.near_m, -cars.front_m - cars.width_m, 0.0])
    high = np.array([cars.far_m, -cars.front_m, cars.height_m])
    side = np.array([[-60.0, 15.0], [length_m + 40.0, 15.0]])
    end = np.array([[length_m + 40.0, 15.0], [length_m + 40.0, -70.0]])
    back = np.array([[-20.0, -70.0], [length_m + 40.0, -70.0]])
    parts = [
        Triangles.of(_strip(np.array([-250.0, 250.0]), (-250.0, 250.0), np.zeros(2)), ASPHALT),
        Triangles.of(shapes.box(low, high), CAR),
        *(_wall(line, 0.0, 8.0, FACADE) for line in (side, end, back)),
    ]
    places = [[0.0, -30.0, 0.0], [0.0, 0.0, 0.0], [length_m, 0.0, 0.0]]
    return RoadWorld("junction", Triangles.joined(parts), Route.through(places))


def _strip(x: Float64Array, y: tuple[float, float], z: Float64Array) -> Float64Array:
    """Ground over two values of y, its height given along x."""
    points = np.empty((len(x), 2, 3))
    points[..., 0], points[..., 1], points[..., 2] = x[:, None], y, z[:, None]
    return shapes.grid(points)


def _facade(x: Float64Array, y: float, foot_m: Float64Array) -> Triangles:
    line = np.column_stack([x, np.full(len(x), y)])
    return _wall(line, foot_m, foot_m + 8.0, FACADE)


def _wall(
    line: Float64Array,
    foot_m: Float64Array | float,
    top_m: Float64Array | float,
    material: Material,
) -> Triangles:
    """An upright wall over a line (K, 2)."""
    points = np.empty((len(line), 2, 3))
    points[..., :2] = line[:, None]
    points[:, 0, 2], points[:, 1, 2] = foot_m, top_m
    return Triangles.of(shapes.grid(points), material)


def _lid(one: Float64Array, other: Float64Array, height_m: float, material: Material) -> Triangles:
    """A level surface between two lines (K, 2)."""
    points = np.full((len(one), 2, 3), height_m)
    points[:, 0, :2], points[:, 1, :2] = one, other
    return Triangles.of(shapes.grid(points), material)


def _arc(radius_m: float, angle_rad: Float64Array) -> Float64Array:
    """(K, 2) places on a circle about the origin, anticlockwise from (0, -radius)."""
    return radius_m * np.column_stack([np.sin(angle_rad), -np.cos(angle_rad)])
