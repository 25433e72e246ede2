"""A scene: sight lines through the space that one scan or many posed scans observed."""

from __future__ import annotations  # help() then shows ArrayLike by its name

from typing import Self

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from intervis.arguments import flag_of, is_count, shown
from intervis.arrays import (
    LARGEST_M,
    Float64Array,
    IntArray,
    checked_place,
    checked_point,
    checked_points,
    finite_rows,
    numbers_of,
)
from intervis.errors import PointsError, SceneError, SettingsError
from intervis.result_table import metres, result_table
from intervis.sight.answers import answer_lines, sum_lines
from intervis.sight.box_sight import BoxSight, box_sight
from intervis.sight.box_surface import facing_surfaces
from intervis.sight.gravity import level_rotation, tilt_of, up_of_scan
from intervis.sight.ground_map import ground_height
from intervis.sight.kernels.packed_scans import PackedScans
from intervis.sight.occupancy_model import DEFAULT_RISK
from intervis.sight.projected_scan import project_scan
from intervis.sight.query_checks import (
    boxes_of,
    finite_number,
    positive_length,
    targets_of,
    thresholds_of,
    viewpoints_of,
)
from intervis.sight.range_image import range_image_of_projected
from intervis.sight.scan_buffer import ScanBuffer
from intervis.sight.sensor import Sensor, sensor_named, sensor_of_projected
from intervis.sight.sight import Sight
from intervis.transform import checked_pose


class Scene:
    """Observed space: a bounded buffer of posed scans that answers sight lines.

    Any thread may add scans and ask: each answer is that of a state that the scene had.

    Parameters
    ----------
    sensor : Sensor, str or None
        The sensor, or the name of a preset (`intervis.sight.SENSORS`). None derives field of view,
        beam spacing and range from each scan.
    max_scans, max_bytes : int
        Limits of the buffer. A full buffer evicts the scan with the largest
        age / max(age) + distance / max(distance).
    up : (3,) array or None
        The direction against gravity in the scene's frame, of any length, for example of an
        accelerometer. None: that of the poses, or as the first scan shows; see the property `up`.

    Examples
    --------
    A wall 10 m ahead. The space in front of it is observed, the space behind it is not:

    >>> y, z = np.meshgrid(np.arange(-5, 5, 0.04), np.arange(-1.5, 1.5, 0.06))
    >>> wall = np.stack([np.full(y.size, 10.0), y.ravel(), z.ravel()], axis=1)
    >>> scene = Scene.from_scan(wall)
    >>> sight = scene.sight([0.0, 0.0, 0.0], [[9.0, 1.0, 0.0], [30.0, 1.0, 0.0], [-9.0, 0, 0]])
    >>> sight.state
    array([ 1,  0, -1], dtype=int8)
    >>> sight.blocker[1].round(1)
    array([10. ,  0.3,  0. ])
    """

    def __init__(
        self,
        *,
        sensor: Sensor | str | None = None,
        max_scans: int = 64,
        max_bytes: int = 1 << 28,
        up: ArrayLike | None = None,
    ) -> None:
        if not (sensor is None or isinstance(sensor, str | Sensor)):
            raise SettingsError(
                f"sensor must be a Sensor, the name of a preset, or None, got {shown(sensor)}."
            )
        limits: dict[str, object] = {"max_scans": max_scans, "max_bytes": max_bytes}
        for name, limit in limits.items():
            if not is_count(limit):
                raise SettingsError(
                    f"{name} must be a whole number of 1 or more, got {shown(limit)}."
                )
        self.sensor = sensor_named(sensor) if isinstance(sensor, str) else sensor
        self._buffer = ScanBuffer(max_scans, max_bytes)
        if up is not None:
            direction = checked_point(up, "up")
            length = float(np.linalg.norm(direction))
            if not (length > 0.0 and np.isfinite(length)):
                raise SettingsError(f"up must be a direction, got {shown(up)}.")
            self._buffer.level_with(lambda: level_rotation(direction / length))

    @classmethod
    def from_scan(
        cls, points: ArrayLike, pose: ArrayLike | None = None, sensor: Sensor | str | None = None
    ) -> Self:
        """A scene of one scan; see `add`."""
        scene = cls(sensor=sensor)
        scene.add(points, pose)
        return scene

    def snapshot(self) -> Self:
        """A scene with the scans of this moment, which later additions to this one leave alone.

        Nothing is copied; both hold the memory of the scans, until one of them gets another scan.
        """
        copy = type(self)(sensor=self.sensor)
        copy._buffer = self._buffer.snapshot()
        return copy

    def __len__(self) -> int:
        return len(self._buffer)

    def __repr__(self) -> str:
        scans = len(self)
        size = f"{scans} scan{'' if scans == 1 else 's'}, {self.bytes / 1e6:.1f} MB"
        tilted = f", tilted by {self.tilt_deg:.0f} degrees" if self.tilt_deg else ""
        return f"<Scene: {size}{tilted}>"

    def _repr_html_(self) -> str:
        """How many scans over which time and way, as a notebook shows it."""
        times_s, places = self.timestamps_s, self.poses[:, :3, 3]
        timed = len(times_s) and np.isfinite(times_s).all()
        way_m = float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum())
        rows = {
            "scans": f"{len(self):,}",
            "memory": f"{self.bytes / 1e6:.1f} MB",
            "time from first to last": f"{np.ptp(times_s):.1f} s" if timed else "-",
            "way from scan to scan": metres(way_m),
        }
        if self.tilt_deg:
            rows["tilt, estimated"] = f"{self.tilt_deg:.0f} degrees"
        return result_table("Scene", rows)

    @property
    def bytes(self) -> int:
        """Memory of the scans, bytes."""
        return self._buffer.bytes

    @property
    def up(self) -> Float64Array:
        """(3,) unit vector against gravity, scene frame.

        As given to the scene; otherwise the z axis, unless the first scan came without a pose and
        shows that the sensor is tilted (`intervis.sight.gravity`). It decides on heights above the
        ground.

        Examples
        --------
        >>> Scene.from_scan(np.zeros((0, 3))).up
        array([0., 0., 1.])
        """
        return np.array(self._buffer.level_from_scene[2])

    @property
    def tilt_deg(self) -> float:
        """Angle between `up` and the scene's z axis, degrees; 0 where they are one."""
        return tilt_of(self.up)

    @property
    def poses(self) -> Float64Array:
        """(S, 4, 4) poses of the scans, oldest first."""
        return self._buffer.poses

    @property
    def timestamps_s(self) -> Float64Array:
        """(S,) times of the scans, seconds; NaN if not given."""
        return self._buffer.timestamps_s

    def add(
        self,
        points: ArrayLike,
        pose: ArrayLike | None = None,
        timestamp_s: float | None = None,
        *,
        complete: bool = True,
    ) -> None:
        """Add a scan. Non-finite returns are left out.

        Parameters
        ----------
        points : (N, 3) or (N, 4) float32 or float64 array
            In the sensor's frame: sensor at the origin, x forward, y left, z up, metres.
        pose : (4, 4) array or None
            world_from_velo: the scene's frame is the world's, whose z axis points up. None: it is
            the sensor's. The first scan of a scene, if it has none, shows whether the sensor is
            tilted; see `up`.
        timestamp_s : float or None
            Time of the scan, seconds from any start; see `moment_s` of `sight`.
        complete : bool
            Whether these are all returns of the scan. False: some were left out (of a class, of the
            own vehicle), so that a gap between two returns of one surface is no dropout.

        Raises
        ------
        PointsError
            Wrong shape or type.
        PoseError
            No rigid motion.
        SettingsError
            The timestamp is not finite.
        ArgumentError
            `complete` is neither True nor False.
        """
        xyz, is_complete = checked_points(points), flag_of(complete, "complete")
        scene_from_sensor = np.eye(4) if pose is None else checked_pose(pose)
        finite = finite_rows(xyz)
        kept = xyz if finite.all() else xyz[finite]
        scan = project_scan(kept, scene_from_sensor[:3, :3])
        level_from_scene = self._buffer.level_with(
            lambda: np.eye(3) if pose is not None else level_rotation(up_of_scan(scan))
        )
        if tilt_of(level_from_scene[2]):
            scan.turn_level(level_from_scene @ scene_from_sensor[:3, :3])
        sensor = sensor_of_projected(scan) if self.sensor is None else self.sensor
        time_s = (
            np.nan if timestamp_s is None else finite_number("timestamp_s", timestamp_s, "seconds")
        )
        image = range_image_of_projected(scan, sensor, is_complete=is_complete)
        self._buffer.add(image, scene_from_sensor, time_s)

    def sight(
        self,
        viewpoint: ArrayLike,
        targets: ArrayLike,
        *,
        max_range_m: float | None = None,
        risk: float = DEFAULT_RISK,
        moment_s: float | None = None,
    ) -> Sight:
        """Which targets are visible from a viewpoint, or from each of several viewpoints.

        Parameters
        ----------
        viewpoint : (3,) or (N, 3) array
            Metres, scene frame.
        targets : (M, 3) or (3,) array
            Metres, scene frame; (3,) is one target, M = 1. A target that is not finite is unknown.
        max_range_m : float or None
            Longer lines are unknown, with probability NaN. None: no limit.
        risk : float
            Share of the "visible" answers, and of the "occluded" ones, that may be wrong, from
            0.001 to 0.2. A lower value leaves more lines unknown. `docs/sight.md` states what the
            bound assumes.
        moment_s : float or None
            Query time, on the clock of the scans' timestamps: scans near that time contribute
            most. None: no particular time, as on a map; scans near the line contribute most.

        Returns
        -------
        Sight
            Of shape (M,), or (N, M) for several viewpoints.

        Raises
        ------
        PointsError
            Wrong shape or type, or a viewpoint that is not finite.
        SceneError
            The scene holds no scan; or a query time is given and a scan has no timestamp.
        SettingsError
            `risk` is not from 0.001 to 0.2, `max_range_m` is not positive and finite, or
            `moment_s` is not finite.
        """
        thresholds = thresholds_of(risk)
        if max_range_m is not None:
            max_range_m = positive_length("max_range_m", max_range_m)
        from_points, to_points = viewpoints_of(viewpoint), targets_of(targets)
        answers = answer_lines(
            self.packed_scans(moment_s),
            from_points,
            to_points,
            paired=False,
            max_range_m=max_range_m,
            thresholds=thresholds,
        )
        shape = (len(from_points), len(to_points)) if np.ndim(viewpoint) == 2 else (-1,)
        return Sight(
            answers.state.reshape(shape),
            answers.probability.reshape(shape),
            answers.blocker.reshape((*shape, 3)),
            answers.clearance.reshape(shape),
            answers.observed.reshape(shape),
        )

    def sight_lines(
        self,
        starts: ArrayLike,
        ends: ArrayLike,
        *,
        risk: float = DEFAULT_RISK,
        moment_s: float | None = None,
    ) -> Sight:
        """Sight lines given by their two ends, (L, 3) each, scene frame; a Sight of shape (L,).

        Ends of shape (3,) are one line, L = 1.

        Raises
        ------
        PointsError
            Wrong shape or type, or starts and ends differ in number.
        SceneError
            The scene holds no scan.
        """
        from_points = targets_of(starts, "starts")
        to_points = targets_of(ends, "ends")
        if len(from_points) != len(to_points):
            raise PointsError(
                f"each line needs two ends, got {len(from_points)} starts and"
                f" {len(to_points)} ends."
            )
        return Sight(
            *answer_lines(
                self.packed_scans(moment_s),
                from_points,
                to_points,
                paired=True,
                thresholds=thresholds_of(risk),
            )
        )

    def sight_within(
        self,
        viewpoints: ArrayLike,
        targets: ArrayLike,
        max_range_m: float,
        *,
        risk: float = DEFAULT_RISK,
        moment_s: float | None = None,
    ) -> tuple[IntArray, IntArray, Sight]:
        """Sight lines between several viewpoints and targets that are at most `max_range_m` long.

        Returns
        -------
        row, column : (L,) int64 arrays
            Index of viewpoint and target of each line, in ascending order.
        sight : Sight
            Of shape (L,).
        """
        max_range_m = positive_length("max_range_m", max_range_m)
        from_points = viewpoints_of(viewpoints)
        if from_points.size and np.abs(from_points).max() > LARGEST_M:
            raise PointsError(f"the viewpoints must be within {LARGEST_M:g} m.")
        to_points = targets_of(targets)
        finite = np.flatnonzero((np.abs(to_points) <= LARGEST_M).all(axis=1))
        near = cKDTree(from_points).sparse_distance_matrix(
            cKDTree(to_points[finite]), max_range_m, output_type="ndarray"
        )
        row, column = near["i"].astype(np.int64), finite[near["j"]].astype(np.int64)
        order = np.lexsort((column, row))
        row, column = row[order], column[order]
        starts, ends = from_points[row], to_points[column]
        return row, column, self.sight_lines(starts, ends, risk=risk, moment_s=moment_s)

    def sight_boxes(
        self,
        viewpoint: ArrayLike,
        scene_from_box: ArrayLike,
        size_m: ArrayLike,
        *,
        risk: float = DEFAULT_RISK,
        moment_s: float | None = None,
    ) -> BoxSight:
        """Which share of objects in boxes is visible from a viewpoint.

        Each object is judged by lines to points on the faces of its box that face the viewpoint.
        The box is grown by 0.2 m, but not downwards: the lines end before the object's own returns.

        Parameters
        ----------
        viewpoint : (3,) array
            Scene frame, metres.
        scene_from_box : (B, 4, 4) array
            The boxes' frames: centre at the origin.
        size_m : (B, 3) array
            Length, width and height: along x, y and z of the box, metres.
        risk, moment_s
            See `sight`.

        Returns
        -------
        BoxSight
            Of B boxes.

        Raises
        ------
        PointsError
            The viewpoint is not finite, or a size is not positive and finite.
        PoseError
            A pose is not a rigid motion.
        SceneError, SettingsError
            As `sight`.

        Examples
        --------
        Two cars behind a wall, and one in front of it:

        >>> y, z = np.meshgrid(np.arange(-9, 9, 0.05), np.arange(-3.8, 0.2, 0.05))
        >>> wall = np.stack([np.full(y.size, 12.0), y.ravel(), z.ravel()], axis=1)
        >>> poses = np.tile(np.eye(4), (3, 1, 1))
        >>> poses[:, :3, 3] = [[20, 2, -1], [20, -3, -1], [8, 0, -1]]
        >>> seen = Scene.from_scan(wall).sight_boxes([0, 0, 0], poses, [[4.2, 1.8, 1.5]] * 3)
        >>> seen.occluded.round(1), seen.visible.round(1)
        (array([1., 1., 0.]), array([0., 0., 1.]))
        """
        start = checked_place(viewpoint)
        poses, sizes = boxes_of(scene_from_box, size_m)
        surface = facing_surfaces(start, poses, sizes)
        sight = self.sight(start, surface.points, risk=risk, moment_s=moment_s)
        return box_sight(start, surface, sight, len(sizes))

    def ground_height(self, xy: ArrayLike, scans: int = 1) -> Float64Array:
        """Height (N,) of the ground below points (N, 2), scene frame, metres.

        From the scan that is nearest to each point. Where it does not show the ground, that of the
        nearest square metre where it does; NaN if it shows none, or for a point that is not finite.

        Parameters
        ----------
        xy : (N, 2) array
        scans : int
            More than 1: the median of so many nearest scans that show the ground at the point,
            if any does.

        Raises
        ------
        PointsError
            Wrong shape or type.
        SceneError
            The scene holds no scan, or its z axis is not up (see `up`).

        Examples
        --------
        >>> x, y = np.meshgrid(np.arange(-9, 9, 0.2), np.arange(-9, 9, 0.2))
        >>> flat = np.stack([x.ravel(), y.ravel(), np.full(x.size, -2.0)], axis=1)
        >>> Scene.from_scan(flat).ground_height([[3.0, 4.0], [20.0, 0.0]])
        array([-2., -2.])
        """
        points = numbers_of(xy, "xy")
        if points.ndim != 2 or points.shape[1] != 2:
            raise PointsError(f"xy must have the shape (N, 2), got {points.shape}.")
        return ground_height(self.packed_scans(), points, scans)

    def unobserved_length(
        self, viewpoint: ArrayLike, target: ArrayLike, *, moment_s: float | None = None
    ) -> float:
        """Metres of one line that no scan observed; 0.4 m at either end are not counted."""
        start, end = checked_point(viewpoint)[None], checked_point(target)[None]
        return float(sum_lines(self.packed_scans(moment_s), start, end).unobserved_m[0])

    def packed_scans(self, moment_s: float | None = None) -> PackedScans:
        """The scans as the compiled kernels and the reference implementation read them.

        Immutable: a later `add`, also in another thread, leaves them as they are.

        Parameters
        ----------
        moment_s : float or None
            Query time; see `sight`.

        Raises
        ------
        SceneError
            The scene holds no scan; or a query time is given and a scan has no timestamp.
        SettingsError
            `moment_s` is not finite.
        """
        with self._buffer.lock:
            if len(self._buffer) == 0:
                raise SceneError("the scene holds no scan: call scene.add(points, pose) first.")
            if moment_s is None:
                return self._buffer.packed()
            if np.isnan(self._buffer.timestamps_s).any():
                raise SceneError(
                    "moment_s needs the time of every scan: call scene.add(points, pose,"
                    " timestamp_s)."
                )
            return self._buffer.packed_at(finite_number("moment_s", moment_s, "seconds"))
