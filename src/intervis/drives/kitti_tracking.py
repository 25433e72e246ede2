"""KITTI tracking: sequences whose files lie in one folder for each kind.

``training/velodyne/NNNN/NNNNNN.bin``, ``training/image_02/NNNN/NNNNNN.png``,
``training/calib/NNNN.txt`` and ``training/oxts/NNNN.txt`` (a line for each frame). A sequence is
given by the folder of its scans, ``training/velodyne/NNNN``.
"""

import logging
from dataclasses import dataclass
from pathlib import Path

from intervis.arrays import Float64Array
from intervis.drives.boxes import Box, kitti_boxes
from intervis.drives.calibration import CalibrationFile, CameraCalibration, read_calibration_file
from intervis.drives.drive import Drive
from intervis.drives.kitti_files import image_folders, kitti_camera, kitti_drive
from intervis.drives.numbering import lines_by_number, numbered_scans
from intervis.drives.trajectory import poses_from_oxts, read_oxts_lines

log = logging.getLogger(__name__)

EXPECTED_FILES = "velodyne/NNNN/*.bin beside calib/NNNN.txt, also under training/ (KITTI tracking)"


def find_roots(path: Path) -> list[Path]:
    """Folders of the scans of sequences: `path` itself, or those of a training or testing set."""
    if path.parent.name == "velodyne" and _is_sequence(path):
        return [path]
    for folder in (path, path / "training", path / "testing", path.parent):
        velodyne = folder / "velodyne"
        if (folder == path.parent and path.name != "velodyne") or not velodyne.is_dir():
            continue
        roots = [scans for scans in sorted(velodyne.iterdir()) if _is_sequence(scans)]
        if roots:
            return roots
    return []


def _is_sequence(scans: Path) -> bool:
    if not scans.is_dir():
        return False
    base = scans.parent.parent
    files = (base / "calib" / f"{scans.name}.txt", base / "oxts" / f"{scans.name}.txt")
    return any(file.is_file() for file in files) or any(
        (folder / scans.name).is_dir() for folder in base.glob("image_*")
    )


def read_drive(root: Path, camera: str | None) -> Drive:
    """Read the drive in a folder that `find_roots` returned."""
    base, sequence = root.parent.parent, root.name
    scans = numbered_scans(root, ".", EXPECTED_FILES)
    calibration_path, oxts_path = (base / kind / f"{sequence}.txt" for kind in ("calib", "oxts"))
    folders = image_folders(base, sequence)
    calibration = None
    if folders or calibration_path.is_file():
        calibration = read_calibration_file(calibration_path)
    names = calibration.camera_names("P", digits=2) if calibration else ()
    chosen = kitti_camera(camera, names, folders, root)
    camera_calibration = None
    if calibration and chosen.name:
        key = f"P{int(chosen.name.removeprefix('image_'))}"
        camera_calibration = CameraCalibration(
            calibration.camera(key, chosen.images, chosen.name), calibration.rect_from_velo()
        )
    label_path = base / "label_02" / f"{sequence}.txt"
    poses, metadata_files = None, [calibration_path] if calibration else []
    if calibration and oxts_path.is_file():
        poses = _poses(oxts_path, calibration, list(scans))
        metadata_files.append(oxts_path)
    return kitti_drive(
        root,
        "kitti_tracking",
        scans,
        chosen,
        camera_calibration,
        tuple(metadata_files),
        poses=poses,
        read_boxes=_Labels(label_path, camera_calibration.cam_from_velo)
        if camera_calibration and label_path.is_file()
        else None,
    )


@dataclass(frozen=True, eq=False)
class _Labels:
    """Reads the boxes of a frame."""

    path: Path
    cam_from_velo: Float64Array

    def __call__(self, number: int) -> tuple[Box, ...]:
        return kitti_boxes(self.path, self.cam_from_velo, number)


def _poses(
    path: Path, calibration: CalibrationFile, numbers: list[int]
) -> dict[int, Float64Array] | None:
    """LiDAR poses by frame number, from GPS/IMU; None where their calibration is missing."""
    key = next((key for key in IMU_KEYS if key in calibration.lines), None)
    if key is None:
        log.warning("%s has no line %s: the drive has no poses.", calibration.path, IMU_KEYS[0])
        return None
    records = lines_by_number(read_oxts_lines(path), numbers, path, may_be_longer=True)
    return poses_from_oxts(records, calibration.rigid_motion(key))


IMU_KEYS = ("Tr_imu_velo", "Tr_imu_to_velo")
