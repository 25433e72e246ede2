"""Writing Argoverse 2's layout of sensor data: a log with two stacked scanners of up to 32 rows.

A sweep holds the points of both scanners in the vehicle's frame at the sweep's time: each return of
a moving scanner is moved there from its own time, as the data set does. Coordinates are 16-bit
floats, which round by up to 31 mm beyond 64 m.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from intervis.arrays import Float64Array
from intervis.drives.argoverse import SCANNERS
from intervis.drives.drive_writer import (
    FrameRecord,
    Rig,
    ego_points,
    quaternions,
    returns_inside,
    write_jpeg,
)
from intervis.errors import MissingExtraError, SettingsError
from intervis.transform import inverse, transform

ROWS = 32
CATEGORIES = {"car": "REGULAR_VEHICLE", "bicycle": "BICYCLIST", "person": "PEDESTRIAN"}
CAMERAS = {"front": "ring_front_center", "rear": "ring_rear_left"}
"""Names of the data set; our rear camera looks straight back."""


def check_rig(rig: Rig) -> None:
    """Check that the layout can hold the scanners of a rig.

    Raises
    ------
    SettingsError
        There are not two of them, or one has more than 32 rows.
    """
    if len(rig.scanners) != len(SCANNERS):
        raise SettingsError(
            f"Argoverse 2's layout takes two scanners (the upper and the lower one), not"
            f" {len(rig.scanners)}."
        )
    for scanner in rig.scanners:
        if not 1 <= scanner.rows <= ROWS:
            raise SettingsError(
                f"Argoverse 2's layout takes scanners of 1 to {ROWS} rows; {scanner.model} has"
                f" {scanner.rows}."
            )


class ArgoverseWriter:
    """Writes one log; see `drive_writer.DriveWriter`.

    Parameters
    ----------
    root : Path
        An empty folder, in which the log's folder is made.
    rig : Rig
        Two scanners, the upper one first.
    name : str
        Of the log.
    """

    def __init__(self, root: Path, rig: Rig, name: str = "log-0001") -> None:
        require_pyarrow()
        check_rig(rig)
        self._log, self._rig = root / name, rig
        self._poses: dict[int, Float64Array] = {}
        self._annotations: list[dict[str, Any]] = []
        for folder in ("calibration", "sensors/lidar"):
            (self._log / folder).mkdir(parents=True)
        for camera in rig.cameras:
            (self._log / "sensors" / "cameras" / CAMERAS[camera.name]).mkdir(parents=True)
        self._write_calibration()

    def _write_calibration(self) -> None:
        sensors = {
            **dict(zip(SCANNERS, (one.ego_from_velo for one in self._rig.scanners), strict=True)),
            **{CAMERAS[one.name]: one.ego_from_cam for one in self._rig.cameras},
        }
        extrinsics = {"sensor_name": list(sensors), **_motions(list(sensors.values()))}
        write_table(self._log / "calibration" / "egovehicle_SE3_sensor.feather", extrinsics)
        if self._rig.cameras:
            models = [one.camera for one in self._rig.cameras]
            intrinsics = {
                "sensor_name": [CAMERAS[one.name] for one in self._rig.cameras],
                "fx_px": [float(one.projection[0, 0]) for one in models],
                "fy_px": [float(one.projection[1, 1]) for one in models],
                "cx_px": [float(one.projection[0, 2]) for one in models],
                "cy_px": [float(one.projection[1, 2]) for one in models],
                **{name: [0.0] * len(models) for name in ("k1", "k2", "k3")},
                "height_px": np.array([one.height_px for one in models], np.uint16),
                "width_px": np.array([one.width_px for one in models], np.uint16),
            }
            write_table(self._log / "calibration" / "intrinsics.feather", intrinsics)

    def add(self, frame: FrameRecord) -> None:
        """See `drive_writer.DriveWriter`."""
        points_ego = [  # as they are stored
            ego_points(scanner, scan, frame).astype(np.float16).astype(np.float64)
            for scanner, scan in zip(self._rig.scanners, frame.scans, strict=True)
        ]
        sweep = _sweep(frame, points_ego)
        write_table(self._log / "sensors" / "lidar" / f"{frame.time_ns}.feather", sweep)
        for camera, image in zip(self._rig.cameras, frame.images, strict=False):
            folder = self._log / "sensors" / "cameras" / CAMERAS[camera.name]
            write_jpeg(folder / f"{image.time_ns}.jpg", image)
            self._poses[image.time_ns] = image.world_from_ego
        times_ns = frame.track.times_ns.tolist()
        self._poses.update(zip(times_ns, frame.track.poses, strict=True))
        self._annotate(frame, np.concatenate(points_ego))

    def _annotate(self, frame: FrameRecord, points_ego: Float64Array) -> None:
        points_world = transform(frame.world_from_ego, points_ego)
        ego_from_world = inverse(frame.world_from_ego)
        for box in frame.boxes:
            length_m, width_m, height_m = box.size_m.tolist()
            (motion,) = _rows(_motions([ego_from_world @ box.world_from_box]))
            self._annotations.append(
                {
                    "timestamp_ns": frame.time_ns,
                    "track_uuid": box.track,
                    "category": CATEGORIES[box.category],
                    "length_m": length_m,
                    "width_m": width_m,
                    "height_m": height_m,
                    **motion,
                    "num_interior_pts": returns_inside(box, points_world),
                }
            )

    def close(self) -> Path:
        """See `drive_writer.DriveWriter`."""
        times_ns = sorted(self._poses)
        motions = _motions([self._poses[time_ns] for time_ns in times_ns])
        write_table(
            self._log / "city_SE3_egovehicle.feather",
            {"timestamp_ns": np.array(times_ns, np.int64), **motions},
        )
        if self._annotations:
            columns = {
                name: [row[name] for row in self._annotations] for name in self._annotations[0]
            }
            write_table(self._log / "annotations.feather", columns)
        return Path(self._log.name)

    def release(self) -> None:
        """See `drive_writer.DriveWriter`; no file stays open."""


def _sweep(frame: FrameRecord, points_ego: Sequence[Float64Array]) -> dict[str, NDArray[Any]]:
    """The columns of a sweep."""
    x, y, z = np.concatenate(points_ego).astype(np.float16).T
    lasers, offsets = [], []
    for first, scan in zip((low for low, _ in SCANNERS.values()), frame.scans, strict=True):
        assert scan.ring is not None  # see check_rig
        lasers.append((scan.ring + first).astype(np.uint8))
        offset_ns = np.zeros(len(scan.points)) if scan.offset_ns is None else scan.offset_ns
        offsets.append(offset_ns.astype(np.int32))
    intensity = np.concatenate([scan.intensity for scan in frame.scans])
    return {
        "x": x,
        "y": y,
        "z": z,
        "intensity": np.round(255 * intensity).astype(np.uint8),
        "laser_number": np.concatenate(lasers),
        "offset_ns": np.concatenate(offsets),
    }


def _motions(motions: Sequence[Float64Array]) -> dict[str, Float64Array]:
    """Columns of rigid motions."""
    columns = np.column_stack([quaternions(motions), [motion[:3, 3] for motion in motions]])
    return dict(zip(("qw", "qx", "qy", "qz", "tx_m", "ty_m", "tz_m"), columns.T, strict=True))


def _rows(columns: Mapping[str, Float64Array]) -> list[dict[str, float]]:
    numbers = zip(*(column.tolist() for column in columns.values()), strict=True)
    return [dict(zip(columns, row, strict=True)) for row in numbers]


def require_pyarrow() -> Any:
    """The packages pyarrow and pyarrow.feather.

    Raises
    ------
    MissingExtraError
        pyarrow is not installed.
    """
    try:
        import pyarrow
        from pyarrow import feather
    except ImportError:
        raise MissingExtraError("pyarrow", "argoverse", "Writing Argoverse 2") from None
    return pyarrow, feather


def write_table(path: Path, columns: Mapping[str, Any]) -> None:
    """Write a Feather file; its folder must exist."""
    pyarrow, feather = require_pyarrow()
    arrays = {name: np.ascontiguousarray(column) for name, column in columns.items()}
    table = {
        name: pyarrow.array(column.tolist() if column.dtype.kind == "U" else column)
        for name, column in arrays.items()
    }
    with path.open("wb") as file:
        feather.write_feather(pyarrow.table(table), file, compression="lz4")
