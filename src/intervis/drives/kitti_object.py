"""KITTI object: single scans, each with an own image and calibration, without poses.

``training/velodyne/NNNNNN.bin``, ``training/image_2/NNNNNN.png``, ``training/calib/NNNNNN.txt``.
The frames are not a sequence: successive numbers are unrelated places and times.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from intervis.drives.boxes import Box, kitti_boxes
from intervis.drives.calibration import CameraCalibration, read_calibration_file
from intervis.drives.drive import Drive
from intervis.drives.kitti_files import image_folders, kitti_camera, kitti_drive
from intervis.drives.numbering import numbered_files, numbered_scans
from intervis.errors import CalibrationError

EXPECTED_FILES = "velodyne/*.bin beside calib/ or image_2/, also under training/ (KITTI object)"


def find_roots(path: Path) -> list[Path]:
    """The first of `path`, its ``training`` and its ``testing`` that has the expected files."""
    for folder in (path, path / "training", path / "testing"):
        if (folder / "velodyne").is_dir() and (
            (folder / "calib").is_dir() or any(folder.glob("image_*"))
        ):
            return [folder]
    return []


def read_drive(root: Path, camera: str | None) -> Drive:
    """Read the drive in a folder that `find_roots` returned."""
    scans = numbered_scans(root, "velodyne", EXPECTED_FILES)
    calibrations = numbered_files(root / "calib", ".txt")
    folders = image_folders(root)
    if folders and not calibrations:
        raise CalibrationError(
            f"{root} has images but no calibration; each frame needs a file in {root / 'calib'}."
        )
    names = _camera_names(calibrations, scans)
    chosen = kitti_camera(camera, names, folders, root)
    calibration_of = None
    if chosen.name:
        calibration_of = ObjectCalibrations(
            root / "calib", chosen.name, calibrations, chosen.images
        )
    labels = numbered_files(root / "label_2", ".txt")
    return kitti_drive(
        root,
        "kitti_object",
        scans,
        chosen,
        calibration_of,
        tuple(calibrations.values()),
        read_boxes=_Labels(labels, calibration_of) if calibration_of and labels else None,
    )


@dataclass(frozen=True)
class ObjectCalibrations:
    """Camera and extrinsics of each frame, from the frame's calibration file and image."""

    folder: Path
    name: str
    files: Mapping[int, Path]
    images: Mapping[int, Path]

    def __call__(self, number: int) -> CameraCalibration:
        """Camera and cam_from_velo = R0_rect Tr_velo_to_cam of one frame."""
        missing = self.folder / f"{number:06d}.txt"  # for the error message
        calibration = read_calibration_file(self.files.get(number, missing))
        # Sizes differ by a few pixels between frames: without its own image, a frame's neighbour.
        nearest = sorted(self.images, key=lambda other: (abs(other - number), other))[:1]
        key = self.name.replace("image_", "P")
        camera = calibration.camera(
            key, {other: self.images[other] for other in nearest}, self.name
        )
        return CameraCalibration(camera, calibration.rect_from_velo())


@dataclass(frozen=True)
class _Labels:
    """Reads the boxes of a frame."""

    files: Mapping[int, Path]
    calibration_of: ObjectCalibrations

    def __call__(self, number: int) -> tuple[Box, ...]:
        if number not in self.files:
            return ()
        return kitti_boxes(self.files[number], self.calibration_of(number).cam_from_velo, None)


def _camera_names(calibrations: Mapping[int, Path], scans: Mapping[int, Path]) -> tuple[str, ...]:
    """Cameras in the first readable calibration; invalid files are reported with their frames."""
    for number in sorted(calibrations.keys() & scans.keys()):
        try:
            names = read_calibration_file(calibrations[number]).camera_names("P")
        except CalibrationError:
            continue
        if names:
            return names
    # No file can be read: with the usual camera name, each frame reports its own file.
    return ("image_2",) if calibrations else ()
