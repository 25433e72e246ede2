"""A stream of scans: pushed by any thread, asked by any thread, in bounded memory."""

from __future__ import annotations  # help() then shows ArrayLike by its name

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from intervis.drives.point_cloud2 import point_cloud2_of, scan_of_cloud
from intervis.errors import SceneError
from intervis.sight import Scene, Sensor, Sight
from intervis.sight.occupancy_model import DEFAULT_RISK


class Stream:
    """The newest scans of a sensor that is running.

    Threads may push and ask at once. An answer is that of a state the stream had: either before or
    after a push, never between. A push waits for no answer and an answer for no push: a scan's
    memory is not written to while an answer reads it.

    Parameters
    ----------
    sensor : Sensor, str or None
        See `intervis.Scene`.
    max_scans, max_bytes : int
        Limits of the memory, as of `intervis.Scene`. There is no queue: a push returns when its
        scan is part of the scene. Answers that are being given may keep four scans more.

    Examples
    --------
    >>> y, z = np.meshgrid(np.arange(-5, 5, 0.04), np.arange(-1.5, 1.5, 0.06))
    >>> wall = np.stack([np.full(y.size, 10.0), y.ravel(), z.ravel()], axis=1)
    >>> stream = Stream()
    >>> stream.push(wall, np.eye(4), time_s=12.3)
    >>> stream.sight([0.0, 0.0, 0.0], [[9.0, 1.0, 0.0], [30.0, 1.0, 0.0]]).state
    array([1, 0], dtype=int8)
    """

    def __init__(
        self,
        *,
        sensor: Sensor | str | None = None,
        max_scans: int = 20,
        max_bytes: int = 1 << 28,
    ) -> None:
        self._scene = Scene(sensor=sensor, max_scans=max_scans, max_bytes=max_bytes)

    def __len__(self) -> int:
        return len(self._scene)

    def __repr__(self) -> str:
        return repr(self._scene).replace("Scene", "Stream", 1)

    @property
    def bytes(self) -> int:
        """Memory of the scans, bytes."""
        return self._scene.bytes

    @property
    def newest_s(self) -> float | None:
        """Time of the newest scan, seconds; None without scans, or where one has no time."""
        return _newest_s(self._scene)

    def push(self, scan: Any, pose: ArrayLike | None, time_s: float | None = None) -> None:
        """Add a scan.

        Parameters
        ----------
        scan : (N, 3) or (N, 4) float array, or message ``sensor_msgs/PointCloud2``
            In the sensor's frame, metres. A message is any object with the attributes of one, as
            rclpy, rospy and rosbags give it.
        pose : (4, 4) array or None
            world_from_sensor at the time of the scan. None: the sensor does not move.
        time_s : float or None
            Time of the scan, seconds. None: the stamp of a message.

        Raises
        ------
        ScanError
            The message is none, or has no points.
        PointsError, PoseError, SettingsError
            As `intervis.Scene.add`.
        """
        if hasattr(scan, "point_step"):
            cloud = point_cloud2_of(scan)
            scan = scan_of_cloud(cloud, Path("the message")).points
            time_s = 1e-9 * cloud.time_ns if time_s is None else time_s
        self._scene.add(scan, pose, time_s)

    def sight(
        self,
        viewpoint: ArrayLike,
        targets: ArrayLike,
        *,
        moment_s: float | None = None,
        max_range_m: float | None = None,
        risk: float = DEFAULT_RISK,
    ) -> Sight:
        """Which targets are visible, as `intervis.Scene.sight`.

        Parameters
        ----------
        viewpoint : (3,) or (N, 3) array
        targets : (M, 3) array
        moment_s : float or None
            Query time. None: that of the newest scan, if every scan has a time.
        max_range_m, risk : float
            See `intervis.Scene.sight`.

        Raises
        ------
        SceneError
            There is no scan yet.
        """
        scene = self.snapshot()
        return scene.sight(
            viewpoint,
            targets,
            moment_s=_newest_s(scene) if moment_s is None else moment_s,
            max_range_m=max_range_m,
            risk=risk,
        )

    def snapshot(self) -> Scene:
        """The scene of this moment, for several questions to one state; see `intervis.explain`.

        Later pushes leave it alone. While it is kept, so is its memory.

        Raises
        ------
        SceneError
            There is no scan yet.
        """
        if len(self._scene) == 0:
            raise SceneError("the stream holds no scan: call stream.push(points, pose) first.")
        return self._scene.snapshot()


def _newest_s(scene: Scene) -> float | None:
    """Time of the newest scan; None without scans, or where one has no time."""
    times_s = scene.timestamps_s
    return float(times_s[-1]) if len(times_s) and not np.isnan(times_s).any() else None
