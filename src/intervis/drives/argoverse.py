"""Argoverse 2, sensor data set: a log is a drive, its sweeps are the frames, numbered from 0.

``LOG/sensors/lidar/TIME.feather``, ``LOG/sensors/cameras/NAME/TIME.jpg``,
``LOG/calibration/*.feather``, ``LOG/city_SE3_egovehicle.feather``. A sweep holds the points of two
scanners in the vehicle's frame at the sweep's time: lasers 0 to 31 belong to ``up_lidar``, 32 to 63
to ``down_lidar``. Each is moved into its own scanner's frame, where it stood; the upper one gives
the points of the frame. Images are shipped without distortion. Source: av2-api.
"""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from intervis.arrays import Float64Array
from intervis.camera import Camera
from intervis.drives.argoverse_tables import (
    motions_of,
    numbers_of,
    read_extrinsics,
    read_feather,
    read_trajectory,
    sensor_names,
)
from intervis.drives.boxes import Box
from intervis.drives.calibration import CameraCalibration
from intervis.drives.camera_choice import pick_named_camera
from intervis.drives.drive import Drive
from intervis.drives.frame import ScannerScan
from intervis.drives.pose_track import PoseTrack, nearest_time
from intervis.drives.scan import Scan, coordinates, scan_of_rows
from intervis.drives.vehicle_axes import sensor_from_velo
from intervis.errors import CalibrationError, CameraError, ScanError
from intervis.transform import inverse

log = logging.getLogger(__name__)

EXPECTED_FILES = "sensors/lidar/*.feather (Argoverse 2)"
SCANNERS = {"up_lidar": (0, 32), "down_lidar": (32, 64)}
"""Laser numbers of each scanner; the first scanner gives the points of a frame."""

MAIN_CAMERA = "ring_front_center"
LATEST_NS = 2**63
IMAGE_WITHIN_NS = 100_000_000
"""An image belongs to a sweep where it was taken within this time of it."""


def find_roots(path: Path) -> list[Path]:
    """Folders of logs: `path` itself, or those in it (``val``) or in its folders."""
    for pattern in ("sensors/lidar", "*/sensors/lidar", "*/*/sensors/lidar"):
        logs = [folder.parent.parent for folder in sorted(path.glob(pattern)) if _times(folder)]
        if logs:
            return logs
    return []


def _times(folder: Path, *endings: str) -> dict[int, Path]:
    """Files that are named by nanoseconds, by time, sorted."""
    if not folder.is_dir():
        return {}
    files = {
        int(path.stem): path
        for path in folder.iterdir()
        if path.suffix.lower() in (endings or (".feather",))
        and path.stem.isascii()
        and path.stem.isdigit()
        and len(path.stem) < 20
        and int(path.stem) < LATEST_NS
    }
    return dict(sorted(files.items()))


def read_drive(root: Path, camera: str | None) -> Drive:
    """Read the log in a folder that `find_roots` returned."""
    sweeps = list(_times(root / "sensors" / "lidar").items())
    extrinsics_path = root / "calibration" / "egovehicle_SE3_sensor.feather"
    extrinsics = read_extrinsics(extrinsics_path)
    missing = [name for name in SCANNERS if name not in extrinsics]
    if missing:
        raise CalibrationError(
            f"{extrinsics_path} has no row for {' and '.join(missing)}: the extrinsics of both"
            " scanners are needed."
        )
    trajectory, pose_files = None, []
    pose_path = root / "city_SE3_egovehicle.feather"
    if pose_path.is_file():
        trajectory, pose_files = read_trajectory(pose_path), [pose_path]
    poses = {}
    for number, (time_ns, _) in enumerate(sweeps):
        world_from_ego = trajectory.at(time_ns) if trajectory else None
        if world_from_ego is not None:
            poses[number] = world_from_ego
    annotations = root / "annotations.feather"
    cameras = _cameras(root, extrinsics)
    chosen = pick_named_camera(camera, cameras, MAIN_CAMERA, root)
    images = _times(root / "sensors" / "cameras" / chosen, ".jpg", ".png") if chosen else {}
    nearest = {
        number: _nearest(list(images), time_ns) for number, (time_ns, _) in enumerate(sweeps)
    }
    reader = _Sweeps(tuple(path for _, path in sweeps), extrinsics, poses)
    return Drive(
        root=root,
        name=root.name,
        layout="argoverse",
        scan_paths=dict(enumerate(path for _, path in sweeps)),
        image_paths={
            number: images[time_ns] for number, time_ns in nearest.items() if time_ns is not None
        },
        camera_names=tuple(cameras),
        camera_name=chosen,
        calibration=_Calibrations(
            cameras[chosen],
            extrinsics[chosen],
            extrinsics["up_lidar"] @ sensor_from_velo(extrinsics["up_lidar"]),
            {number: time_ns for number, time_ns in nearest.items() if time_ns is not None},
            poses,
            trajectory,
        )
        if chosen
        else None,
        poses={
            number: world_from_ego @ reader.ego_from_velo("up_lidar")
            for number, world_from_ego in poses.items()
        }
        or None,
        timestamps_ns={number: time_ns for number, (time_ns, _) in enumerate(sweeps)},
        metadata_files=(*sorted((root / "calibration").glob("*.feather")), *pose_files),
        read=reader,
        scanner="up_lidar",
        ego_from_velo=reader.ego_from_velo("up_lidar"),
        is_deskewed=True,  # the points of a sweep are in the vehicle frame at its time
        read_other_scans=_OtherScans(reader, tuple(time_ns for time_ns, _ in sweeps)),
        read_boxes=_Boxes(
            annotations, reader.ego_from_velo("up_lidar"), tuple(time_ns for time_ns, _ in sweeps)
        )
        if annotations.is_file()
        else None,
    )


def _nearest(times_ns: Sequence[int], time_ns: int) -> int | None:
    """The time nearest to another within `IMAGE_WITHIN_NS`; None where there is none."""
    place = nearest_time(times_ns, time_ns, IMAGE_WITHIN_NS)
    return None if place is None else times_ns[place]


# --- scanners ---


@dataclass(frozen=True, eq=False)
class _Sweeps:
    """Reads the points of one scanner of a sweep, into this scanner's frame."""

    paths: tuple[Path, ...]
    extrinsics: Mapping[str, Float64Array]
    world_from_ego: Mapping[int, Float64Array]

    def __call__(self, number: int) -> Scan:
        return self.scan("up_lidar", number)

    def ego_from_velo(self, scanner: str) -> Float64Array:
        """The vehicle's frame from the scanner's."""
        place = self.extrinsics[scanner]
        return place @ sensor_from_velo(place)

    def pose(self, scanner: str, number: int) -> Float64Array | None:
        """World from the scanner's frame."""
        if number not in self.world_from_ego:
            return None
        return self.world_from_ego[number] @ self.ego_from_velo(scanner)

    def scan(self, scanner: str, number: int) -> Scan:
        """The points of one scanner; `row` among the attributes is their row in the file."""
        path = self.paths[number]
        table = read_feather(path, ScanError)
        axes, points = coordinates(path, table)
        names = table.dtype.names or ()
        if "laser_number" not in names:
            raise ScanError(
                f"the scan {path} has no column laser_number, which tells its two scanners apart."
            )
        if any(table[name].dtype.kind not in "fiu" for name in (*axes, "laser_number")):
            raise ScanError(f"the scan {path} needs numbers in x, y, z and laser_number.")
        first, end = SCANNERS[scanner]
        own = np.flatnonzero((table["laser_number"] >= first) & (table["laser_number"] < end))
        others = [name for name in names if name not in axes and table[name].dtype.kind in "fiu"]
        scan = scan_of_rows(
            path,
            points[own].astype(np.float64),
            velo_from_file=inverse(self.ego_from_velo(scanner)),
        )
        attributes = {name: np.ascontiguousarray(table[name][own]) for name in others}
        return Scan(scan.points, {**attributes, "row": own})


@dataclass(frozen=True, eq=False)
class _OtherScans:
    """Reads the lower scanner's points of a sweep."""

    sweeps: _Sweeps
    times_ns: tuple[int, ...]

    def __call__(self, number: int) -> tuple[ScannerScan, ...]:
        scan = self.sweeps.scan("down_lidar", number)
        pose = self.sweeps.pose("down_lidar", number)
        time_ns = self.times_ns[number]
        return (ScannerScan("down_lidar", scan.points, scan.attributes, pose, time_ns),)


# --- boxes ---


@dataclass(frozen=True, eq=False)
class _Boxes:
    """Reads the annotations of a sweep; they stand in the vehicle's frame."""

    path: Path
    ego_from_velo: Float64Array
    times_ns: tuple[int, ...]

    def __call__(self, number: int) -> tuple[Box, ...]:
        rows = read_feather(self.path, CalibrationError)
        names = rows.dtype.names or ()
        missing = [name for name in ("timestamp_ns", "track_uuid", "category") if name not in names]
        if missing:
            raise CalibrationError(f"{self.path} has no column {' '.join(missing)}.")
        if rows["timestamp_ns"].dtype.kind != "i":
            raise CalibrationError(f"{self.path} has no times in whole nanoseconds.")
        rows = rows[rows["timestamp_ns"] == self.times_ns[number]]
        sizes_m = numbers_of(self.path, rows, "length_m", "width_m", "height_m")
        velo_from_ego = inverse(self.ego_from_velo)
        counts = rows["num_interior_pts"].tolist() if "num_interior_pts" in names else []
        return tuple(
            Box(
                velo_from_ego @ ego_from_box,
                size_m,
                str(row["category"]),
                str(row["track_uuid"]),
                counts[nth] if counts and isinstance(counts[nth], int) else None,
            )
            for nth, (row, ego_from_box, size_m) in enumerate(
                zip(rows, motions_of(self.path, rows), sizes_m, strict=True)
            )
        )


# --- cameras ---


def _cameras(root: Path, extrinsics: Mapping[str, Float64Array]) -> dict[str, Camera]:
    """Cameras by name; none where their intrinsics are not there."""
    path = root / "calibration" / "intrinsics.feather"
    if not path.is_file():
        log.info("%s has no intrinsics of cameras: it is read without a camera.", root)
        return {}
    rows = read_feather(path, CalibrationError)
    keys = ("fx_px", "fy_px", "cx_px", "cy_px", "width_px", "height_px")
    cameras = {}
    for name, values in zip(
        sensor_names(path, rows), numbers_of(path, rows, *keys).tolist(), strict=True
    ):
        fx, fy, cx, cy, width, height = values
        projection = np.array([[fx, 0, cx, 0], [0, fy, cy, 0], [0, 0, 1, 0]])
        if name not in extrinsics:
            raise CalibrationError(
                f"{path} has the camera {name!r:.60}, but its extrinsics are missing."
            )
        try:
            cameras[name] = Camera(projection, round(width), round(height), name=name)
        except CameraError as error:
            raise CalibrationError(f"{path}, {name!r:.60}: {error}") from None
    return dict(sorted(cameras.items()))


@dataclass(frozen=True, eq=False)
class _Calibrations:
    """Camera and extrinsics of each frame: the vehicle moves between sweep and image."""

    camera: Camera
    ego_from_cam: Float64Array
    ego_from_velo: Float64Array
    image_times_ns: Mapping[int, int]
    world_from_ego: Mapping[int, Float64Array]
    trajectory: PoseTrack | None

    def __call__(self, number: int) -> CameraCalibration:
        ego_from_ego = np.eye(4)  # of the image from that of the sweep
        time_ns = self.image_times_ns.get(number)
        if self.trajectory and time_ns is not None and number in self.world_from_ego:
            at_image = self.trajectory.at(time_ns)
            if at_image is not None:
                ego_from_ego = inverse(at_image) @ self.world_from_ego[number]
        cam_from_velo = inverse(self.ego_from_cam) @ ego_from_ego @ self.ego_from_velo
        return CameraCalibration(self.camera, cam_from_velo)
