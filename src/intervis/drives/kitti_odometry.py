"""KITTI odometry (and SemanticKITTI): one folder for each sequence, poses of camera 0 beside them.

``sequences/NN/velodyne/*.bin``, ``.../image_2/*.png``, ``.../calib.txt``, ``.../times.txt``, and
``poses/NN.txt`` (or ``sequences/NN/poses.txt``, as in SemanticKITTI, which adds ``.../labels``).
The files hold poses of the rectified camera 0. They are converted to LiDAR poses with the line `Tr`
of calib.txt.
"""

from pathlib import Path

from intervis.drives.calibration import CameraCalibration, read_calibration_file
from intervis.drives.drive import Drive
from intervis.drives.kitti_files import image_folders, kitti_camera, kitti_drive
from intervis.drives.numbering import lines_by_number, numbered_scans
from intervis.drives.trajectory import known_timestamps, lidar_poses, read_poses, read_seconds

EXPECTED_FILES = "velodyne/*.bin beside calib.txt or times.txt (KITTI odometry)"


def find_roots(path: Path) -> list[Path]:
    """Folders of sequences: `path` itself, or those under its ``sequences``."""
    if _is_sequence(path):
        return [path]
    return [
        folder
        for parent in (path, path / "sequences", path / "dataset" / "sequences")
        if parent.name == "sequences" and parent.is_dir()
        for folder in sorted(parent.iterdir())
        if _is_sequence(folder)
    ]


def _is_sequence(folder: Path) -> bool:
    if not (folder / "velodyne").is_dir():
        return False
    has_metadata = any((folder / file).is_file() for file in ("calib.txt", "times.txt"))
    return has_metadata or folder.parent.name == "sequences"


def read_drive(root: Path, camera: str | None) -> Drive:
    """Read the drive in a folder that `find_roots` returned."""
    scans = numbered_scans(root, "velodyne", EXPECTED_FILES)
    numbers = list(scans)
    folders = image_folders(root)
    pose_path = _pose_file(root)
    calibration = None
    if folders or pose_path or (root / "calib.txt").is_file():
        calibration = read_calibration_file(root / "calib.txt")
    names = calibration.camera_names("P") if calibration else ()
    chosen = kitti_camera(camera, names, folders, root)
    camera_calibration, poses = None, None
    metadata_files = [root / "calib.txt"] if calibration else []
    if calibration and chosen.name:
        key = chosen.name.replace("image_", "P")
        model = calibration.camera(key, chosen.images, chosen.name)
        camera_calibration = CameraCalibration(model, calibration.rigid_motion("Tr"))
    if calibration and pose_path:
        poses_velo = lidar_poses(read_poses(pose_path), calibration.rigid_motion("Tr"))
        poses = lines_by_number(poses_velo, numbers, pose_path, may_be_longer=True)
        metadata_files.append(pose_path)
    timestamps_ns, times = {}, root / "times.txt"
    if times.is_file():
        lines = lines_by_number(read_seconds(times), numbers, times, may_be_longer=True)
        timestamps_ns = known_timestamps(lines)
        metadata_files.append(times)
    return kitti_drive(
        root,
        "kitti_odometry",
        scans,
        chosen,
        camera_calibration,
        tuple(metadata_files),
        poses=poses,
        timestamps_ns=timestamps_ns,
    )


def _pose_file(root: Path) -> Path | None:
    paths = (root.parent.parent / "poses" / f"{root.name}.txt", root / "poses.txt")
    return next((path for path in paths if path.is_file()), None)
