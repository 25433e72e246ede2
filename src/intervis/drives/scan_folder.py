"""A folder of scans of one format, directly in it or in its subfolder ``pcd`` or ``scans``.

Optional files in the folder: ``poses.txt`` (LiDAR poses, KITTI's odometry format), ``times.txt``
(seconds, a line for each scan), and KITTI raw's ``calib_cam_to_cam.txt`` with
``calib_velo_to_cam.txt``. Without ``poses.txt`` the poses are those
that PCD files state (VIEWPOINT), or those in 3DTK's ``.pose`` files.
"""

from collections import Counter
from pathlib import Path

from intervis.drives.calibration import RAW_FILES, raw_camera_calibration, raw_camera_names
from intervis.drives.camera_choice import pick_camera
from intervis.drives.drive import Drive
from intervis.drives.numbering import lines_by_number, numbered_by_name
from intervis.drives.point_labels import label_files
from intervis.drives.scan_file import READERS, scan_ending
from intervis.drives.threedtk import ENDING, station_poses
from intervis.drives.trajectory import known_timestamps, read_poses, read_seconds
from intervis.drives.viewpoint import stated_poses
from intervis.errors import CalibrationError, DriveError

EXPECTED_FILES = (
    f"scans ending in {' '.join(READERS)}, in it, in pcd/ or in scans/ (a folder of scans)"
)

SUBFOLDERS, TRACK_FILES = ("pcd", "scans"), ("poses.txt", "times.txt")


def find_roots(path: Path) -> list[Path]:
    """`path`, if there are scans in it or in its ``scans``.

    Where it is that subfolder itself, and poses, times or a calibration lie beside it: the folder
    above, whose files belong to the scans.
    """
    scans = _scans(path)
    if path.name in SUBFOLDERS and scans and _scans(path.parent) == scans:
        beside = (*TRACK_FILES, *RAW_FILES)
        if any((path.parent / file).is_file() for file in beside):
            return [path.parent]
    return [path] if scans else []


def read_drive(root: Path, camera: str | None) -> Drive:
    """Read the drive in a folder that `find_roots` returned."""
    paths = _scans(root)
    endings = Counter(scan_ending(path) for path in paths)
    if len(endings) > 1:
        kinds = ", ".join(f"{count} {ending}" for ending, count in endings.most_common())
        raise DriveError(f"{root} holds scans of several formats ({kinds}); keep one format.")
    scans = numbered_by_name(paths)
    present = [file for file in RAW_FILES if (root / file).is_file()]
    if len(present) == 1:
        (missing,) = set(RAW_FILES) - set(present)
        raise CalibrationError(f"the calibration file {root / missing} is missing.")
    names = raw_camera_names(root) if present else ()
    chosen = pick_camera(camera, names, (), root)
    poses, read = stated_poses(scans)
    pose_files: list[Path] = []
    pose_path, time_path = (root / file for file in TRACK_FILES)
    if pose_path.is_file():
        poses = lines_by_number(read_poses(pose_path), list(scans), pose_path)
        pose_files = [pose_path]
    elif ENDING in endings:
        stations, pose_files = station_poses(scans)
        poses = stations or None
    timestamps_ns = {}
    if time_path.is_file():
        lines = lines_by_number(read_seconds(time_path), list(scans), time_path)
        timestamps_ns = known_timestamps(lines)
        pose_files = [*pose_files, time_path]
    return Drive(
        root=root,
        name=root.name,
        layout="scan_folder",
        scan_paths=scans,
        camera_names=names,
        camera_name=chosen,
        calibration=raw_camera_calibration(root, chosen) if chosen else None,
        poses=poses,
        timestamps_ns=timestamps_ns,
        metadata_files=(*(root / file for file in present), *pose_files),
        read=read,
        label_paths=label_files(scans),
    )


def _scans(root: Path) -> list[Path]:
    """The scan files in the ``pcd`` of `root`, or else those in it, or else in its ``scans``.

    The DynamicMap benchmark keeps scans in ``pcd``, and maps of all of them beside that folder.
    """
    first, last = SUBFOLDERS
    for folder in (root / first, root, root / last):
        if folder.is_dir():
            paths = [
                path
                for path in folder.iterdir()
                if scan_ending(path) and path.is_file() and not path.name.startswith(".")
            ]
            if paths:
                return paths
    return []
