"""A scene: what one scan or many posed scans say about who sees whom."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from intervis.arrays import (
    Float64Array,
    IntArray,
    checked_point,
    checked_points,
    finite_rows,
)
from intervis.errors import PointsError, SceneError, SettingsError
from intervis.sight.answers import OCCLUDED, UNKNOWN, VISIBLE, answer_lines
from intervis.sight.atlas import Memory
from intervis.sight.chart import chart_of
from intervis.sight.engine import judge_lines
from intervis.sight.memory import ScanMemory
from intervis.sight.occupancy_model import VISIBLE_FROM
from intervis.sight.sensor import Sensor, sensor_named, sensor_of_scan
from intervis.transform import checked_pose

__all__ = ["OCCLUDED", "UNKNOWN", "VISIBLE", "Scene", "Sight"]


@dataclass(frozen=True, eq=False)
class Sight:
    """Answers for sight lines; every array has the lines' shape, (M,) or (N, M).

    Attributes
    ----------
    state : int8 array
        1 visible, 0 occluded, -1 unknown (see `intervis.sight.occupancy_model`).
    probability : float64 array
        Of being visible, calibrated on held-out returns; NaN where an end of the line was not
        finite or the line was longer than asked for.
    blocker : (..., 3) float64 array
        Where an occluded line meets the surface that most likely blocks it, scene frame, metres;
        NaN for the other states. The same place whichever end is the viewpoint.
    clearance : float64 array
        Metres. Of a line not occluded: the least gap between the marks in free space and the
        surface behind them, along the beam of a scan, or their height above ground if that is
        less; inf where nothing is known beside the line. Of an occluded line: minus the shift,
        up, down or sideways, that would bring it past the blocking surface.
    """

    state: NDArray[np.int8]
    probability: Float64Array
    blocker: Float64Array
    clearance: Float64Array


class Scene:
    """Observed space: a bounded memory of posed scans that answers sight lines.

    Parameters
    ----------
    sensor : Sensor, str or None
        The sensor, or the name of a preset (`intervis.sight.SENSORS`); None derives field of
        view, beam spacing and range from each scan.
    most_scans, most_bytes : int
        Bounds of the memory; the oldest and farthest scan goes first.

    Examples
    --------
    A wall 10 m ahead; behind it nothing is known, before it everything is seen:

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
        most_scans: int = 64,
        most_bytes: int = 1 << 28,
    ) -> None:
        self.sensor = sensor_named(sensor) if isinstance(sensor, str) else sensor
        self._memory = ScanMemory(most_scans, most_bytes)

    @classmethod
    def from_scan(
        cls, points: ArrayLike, pose: ArrayLike | None = None, sensor: Sensor | str | None = None
    ) -> Self:
        """A scene of one scan; see `add`."""
        scene = cls(sensor=sensor)
        scene.add(points, pose)
        return scene

    def __len__(self) -> int:
        return len(self._memory)

    @property
    def bytes(self) -> int:
        """Memory that the remembered scans take."""
        return self._memory.bytes

    @property
    def poses(self) -> Float64Array:
        """(S, 4, 4) poses of the scans remembered, oldest first."""
        return self._memory.poses

    @property
    def timestamps_s(self) -> Float64Array:
        """(S,) when they were taken, seconds; NaN where that was not said."""
        return self._memory.timestamps_s

    def add(
        self, points: ArrayLike, pose: ArrayLike | None = None, timestamp_s: float | None = None
    ) -> None:
        """Remember a scan; non-finite returns are left out.

        Parameters
        ----------
        points : (N, 3) or (N, 4) float32 or float64 array
            In the sensor's frame: sensor at the origin, x forward, y left, z up, metres.
        pose : (4, 4) array or None
            world_from_velo: the scene's frame is the world's. None: it is the sensor's.
        timestamp_s : float or None
            When the scan was taken, seconds from any start; see `moment_s` of `sight`.

        Raises
        ------
        PointsError
            Wrong shape or type.
        PoseError
            No rigid motion.
        SettingsError
            The stamp is not finite.
        """
        xyz = checked_points(np.asarray(points))
        scene_from_sensor = np.eye(4) if pose is None else checked_pose(pose)
        finite = finite_rows(xyz)
        kept = xyz if finite.all() else xyz[finite]
        sensor = sensor_of_scan(kept) if self.sensor is None else self.sensor
        stamp = np.nan if timestamp_s is None else _finite_time("timestamp_s", timestamp_s)
        self._memory.add(chart_of(kept, sensor), scene_from_sensor, stamp)

    def sight(
        self,
        viewpoint: ArrayLike,
        targets: ArrayLike,
        *,
        max_range_m: float | None = None,
        visible_from: float = VISIBLE_FROM,
        moment_s: float | None = None,
    ) -> Sight:
        """Which targets are visible from a viewpoint, or from each of many.

        Parameters
        ----------
        viewpoint : (3,) or (N, 3) array
            Metres, scene frame.
        targets : (M, 3) array
            Metres, scene frame. A target that is not finite is unknown.
        max_range_m : float or None
            Longer lines are not judged: unknown, probability NaN.
        visible_from : float
            Least probability at which a line is called visible. More caution leaves more lines
            unknown, and fewer wrong ones visible.
        moment_s : float or None
            When the lines are to be seen along, in the time of the scans' stamps: scans taken
            near that moment count most. None: at no moment in particular, as on a map; scans
            taken near the line count most.

        Returns
        -------
        Sight
            Of shape (M,), or (N, M) for many viewpoints.

        Raises
        ------
        PointsError
            Wrong shape or type, or a viewpoint that is not finite.
        SceneError
            The scene holds no scan; a moment is asked about and a scan has no stamp.
        SettingsError
            `visible_from` is no probability, or `moment_s` is not finite.
        """
        if not 0.0 <= visible_from <= 1.0:
            raise SettingsError(f"visible_from is a probability, got {visible_from}.")
        from_points, to_points = _viewpoints(viewpoint), _targets(targets)
        found = answer_lines(
            self._packed(moment_s),
            from_points,
            to_points,
            paired=False,
            max_range_m=max_range_m,
            visible_from=visible_from,
        )
        shape = (len(from_points), len(to_points)) if np.ndim(viewpoint) == 2 else (-1,)
        return Sight(
            found.state.reshape(shape),
            found.probability.reshape(shape),
            found.blocker.reshape((*shape, 3)),
            found.clearance.reshape(shape),
        )

    def sight_lines(
        self, starts: ArrayLike, ends: ArrayLike, *, moment_s: float | None = None
    ) -> Sight:
        """Sight lines given by their two ends, (L, 3) each, scene frame; a Sight of shape (L,).

        Raises
        ------
        PointsError
            Wrong shape or type, or starts and ends differ in number.
        SceneError
            The scene holds no scan.
        """
        from_points = _targets(starts, "starts")
        to_points = _targets(ends, "ends")
        if len(from_points) != len(to_points):
            raise PointsError(
                f"each line needs two ends, got {len(from_points)} starts and"
                f" {len(to_points)} ends."
            )
        return Sight(*answer_lines(self._packed(moment_s), from_points, to_points, paired=True))

    def sight_within(
        self,
        viewpoints: ArrayLike,
        targets: ArrayLike,
        max_range_m: float,
        *,
        moment_s: float | None = None,
    ) -> tuple[IntArray, IntArray, Sight]:
        """Only the lines of many viewpoints and targets that are short enough.

        Returns
        -------
        row, column : (L,) int64 arrays
            Which viewpoint and which target, in ascending order.
        sight : Sight
            Of shape (L,).
        """
        if not (np.isfinite(max_range_m) and max_range_m > 0):
            raise SettingsError(f"max_range_m must be a positive length, got {max_range_m}.")
        from_points = _viewpoints(np.atleast_2d(np.asarray(viewpoints, dtype=np.float64)))
        to_points = _targets(targets)
        finite = np.flatnonzero(np.isfinite(to_points).all(axis=1))
        found = cKDTree(from_points).sparse_distance_matrix(
            cKDTree(to_points[finite]), max_range_m, output_type="ndarray"
        )
        row, column = found["i"].astype(np.int64), finite[found["j"]].astype(np.int64)
        order = np.lexsort((column, row))
        row, column = row[order], column[order]
        starts, ends = from_points[row], to_points[column]
        return row, column, self.sight_lines(starts, ends, moment_s=moment_s)

    def unknown_length(
        self, viewpoint: ArrayLike, target: ArrayLike, *, moment_s: float | None = None
    ) -> float:
        """Metres of one line that no scan saw, its last 0.4 m at either end left aside."""
        start, end = checked_point(viewpoint)[None], checked_point(target)[None]
        return float(judge_lines(self._packed(moment_s), start, end).unknown_m[0])

    def _packed(self, moment_s: float | None = None) -> Memory:
        if len(self._memory) == 0:
            raise SceneError("the scene holds no scan: call scene.add(points, pose) first.")
        if moment_s is None:
            return self._memory.packed()
        if np.isnan(self._memory.timestamps_s).any():
            raise SceneError(
                "moment_s needs to know when each scan was taken: call"
                " scene.add(points, pose, timestamp_s)."
            )
        return self._memory.packed_at(_finite_time("moment_s", moment_s))


def _finite_time(name: str, seconds: float) -> float:
    if not np.isfinite(seconds):
        raise SettingsError(f"{name} must be a finite number of seconds, got {seconds}.")
    return float(seconds)


def _viewpoints(viewpoint: ArrayLike) -> Float64Array:
    """(N, 3) finite viewpoints."""
    if np.ndim(viewpoint) != 2:
        return checked_point(viewpoint)[None]
    points = _targets(viewpoint, "viewpoint")
    if not np.isfinite(points).all():
        raise PointsError("every viewpoint must be three finite numbers in metres.")
    return points


def _targets(points: ArrayLike, name: str = "targets") -> Float64Array:
    """(M, 3) float64 points, finite or not; an empty list is no target."""
    array = np.asarray(points)
    if array.size == 0 and array.ndim <= 2:
        return np.empty((0, 3))
    if array.dtype.kind in "iu":
        array = array.astype(np.float64)
    # kernels are compiled for arrays that can be written to: one that cannot is copied
    return np.require(checked_points(array, name), np.float64, ["C", "W"])
