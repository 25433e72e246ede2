"""A folder of scans of one format, in it or in its subfolder ``scans``; the least that is a drive.

Beside the scans, or one folder up where they lie in ``scans``: ``poses.txt`` (LiDAR poses, KITTI's
odometry format) and KITTI raw's ``calib_cam_to_cam.txt`` with ``calib_velo_to_cam.txt``, each used
where it is there.
"""

from collections import Counter
from pathlib import Path

from intervis.arrays import Float64Array
from intervis.drives.calibration import (
    RAW_FILES,
    pick_camera,
    raw_camera_calibration,
    raw_camera_names,
)
from intervis.drives.drive import Drive
from intervis.drives.numbering import lines_by_number, numbered_by_name
from intervis.drives.scan_file import READERS, scan_ending
from intervis.drives.trajectory import read_poses
from intervis.errors import CalibrationError, DriveError

EXPECTED_FILES = f"scans ending in {' '.join(READERS)}, in it or in scans/ (a folder of scans)"


def find_roots(path: Path) -> list[Path]:
    """`path`, if there are scans in it or in its ``scans``."""
    return [path] if _scans(path) else []


def read_drive(root: Path, camera: str | None) -> Drive:
    """The scans of a folder that `find_roots` returned."""
    paths = _scans(root)
    endings = Counter(scan_ending(path) for path in paths)
    if len(endings) > 1:
        kinds = ", ".join(f"{count} {ending}" for ending, count in endings.most_common())
        raise DriveError(f"{root} mixes scans of several formats ({kinds}); keep one of them.")
    scans = numbered_by_name(paths)
    there = [file for file in RAW_FILES if (root / file).is_file()]
    if len(there) == 1:
        (missing,) = set(RAW_FILES) - set(there)
        raise CalibrationError(f"the calibration file {root / missing} is missing.")
    names = raw_camera_names(root) if there else ()
    chosen = pick_camera(camera, names, (), root)
    poses: dict[int, Float64Array] | None = None
    pose_path = root / "poses.txt"
    if pose_path.is_file():
        poses = lines_by_number(read_poses(pose_path), list(scans), pose_path)
    return Drive(
        root=root,
        name=root.name,
        layout="scan_folder",
        scan_paths=scans,
        camera_names=names,
        camera_name=chosen,
        calibration=raw_camera_calibration(root, chosen) if chosen else None,
        poses=poses,
        metadata_files=(*(root / file for file in there), *([pose_path] if poses else [])),
    )


def _scans(root: Path) -> list[Path]:
    """Scan files of the first of the two places that has any."""
    for folder in (root, root / "scans"):
        if folder.is_dir():
            paths = [
                path
                for path in folder.iterdir()
                if scan_ending(path) and path.is_file() and not path.name.startswith(".")
            ]
            if paths:
                return paths
    return []
