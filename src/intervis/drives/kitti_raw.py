"""KITTI raw: a folder for a date with calibration, and in it drives with LiDAR, cameras, GPS/IMU.

``DATE/calib_*.txt``, ``DATE/DATE_drive_NNNN_sync/velodyne_points/data/*.bin``,
``.../image_0K/data/*.png``, ``.../oxts/data/*.txt``. An optional ``.../poses.txt`` (LiDAR poses in
KITTI's odometry format) takes precedence over oxts. Labels of points may stand beside the scans or
in ``velodyne_points/labels``, as SemanticKITTI writes them.
"""

import logging
from pathlib import Path

from intervis.arrays import Float64Array
from intervis.drives.calibration import (
    RAW_FILES,
    raw_camera_calibration,
    raw_camera_names,
    read_calibration_file,
)
from intervis.drives.drive import Drive
from intervis.drives.image_size import warn_of_other_size
from intervis.drives.kitti_files import image_folders, kitti_camera
from intervis.drives.numbering import lines_by_number, numbered_files, numbered_scans
from intervis.drives.point_labels import label_files
from intervis.drives.remote_path import for_each
from intervis.drives.trajectory import (
    known_timestamps,
    poses_from_oxts,
    read_oxts_file,
    read_poses,
    read_timestamps,
)

log = logging.getLogger(__name__)

EXPECTED_FILES = "velodyne_points/data/*.bin (KITTI raw)"


def find_roots(path: Path) -> list[Path]:
    """Folders of drives: `path` itself, or the drives of a date or of a folder of dates."""
    for pattern in ("velodyne_points", "*/velodyne_points", "*/*/velodyne_points"):
        drives = sorted(folder.parent for folder in path.glob(pattern) if folder.is_dir())
        if drives:
            return drives
    return []


def read_drive(root: Path, camera: str | None) -> Drive:
    """Read the drive in a folder that `find_roots` returned."""
    scans = numbered_scans(root, "velodyne_points/data", EXPECTED_FILES)
    date, numbers = root.parent, list(scans)
    folders = image_folders(root, "data")
    names: tuple[str, ...] = ()
    if folders or all((date / file).is_file() for file in RAW_FILES):
        names = raw_camera_names(date)
    chosen = kitti_camera(camera, names, folders, root)
    calibration = raw_camera_calibration(date, chosen.name) if chosen.name else None
    if calibration:
        warn_of_other_size(calibration.camera, chosen.images)
    else:
        log.info("%s has no images and no complete calibration: it is read without a camera.", root)
    poses, pose_files = _read_poses(root, numbers)
    timestamps_ns, timestamp_files = _read_timestamps(root, numbers)
    calibration_files = [date / file for file in RAW_FILES] if calibration else []
    return Drive(
        root=root,
        name=root.name,
        layout="kitti_raw",
        scan_paths=scans,
        image_paths=chosen.images,
        camera_names=chosen.names,
        camera_name=chosen.name,
        calibration=calibration,
        poses=poses,
        timestamps_ns=timestamps_ns,
        metadata_files=(*calibration_files, *pose_files, *timestamp_files),
        label_paths=label_files(scans),
    )


def _read_poses(
    root: Path, numbers: list[int]
) -> tuple[dict[int, Float64Array] | None, list[Path]]:
    """LiDAR poses by frame number, and the files that they were read from."""
    estimated = root / "poses.txt"
    if estimated.is_file():
        return lines_by_number(read_poses(estimated), numbers, estimated), [estimated]
    records = numbered_files(root / "oxts" / "data", ".txt")
    if not records:
        return None, []
    imu = root.parent / "calib_imu_to_velo.txt"
    velo_from_imu = read_calibration_file(imu).rotation_and_translation()
    values = for_each(read_oxts_file, records.values())
    return poses_from_oxts(dict(zip(records, values, strict=True)), velo_from_imu), [
        imu,
        *records.values(),
    ]


def _read_timestamps(root: Path, numbers: list[int]) -> tuple[dict[int, int], list[Path]]:
    """Timestamps of the scans by frame number, and the file that they were read from."""
    path = root / "velodyne_points" / "timestamps.txt"
    if not path.is_file():
        return {}, []
    lines = lines_by_number(read_timestamps(path), numbers, path, may_be_longer=True)
    return known_timestamps(lines), [path]
