"""KITTI object: single scans with an image and a calibration of their own, and no poses.

``training/velodyne/NNNNNN.bin``, ``training/image_2/NNNNNN.png``, ``training/calib/NNNNNN.txt``.
The frames are no sequence: neighbours in number are years and streets apart.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from intervis.drives.calibration import (
    CameraCalibration,
    pick_camera,
    read_calibration_file,
    size_of_pictures,
)
from intervis.drives.drive import Drive
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
    """The frames in a folder that `find_roots` returned."""
    scans = numbered_scans(root, "velodyne", EXPECTED_FILES)
    calibrations = numbered_files(root / "calib", ".txt")
    pictured = {folder.name for folder in root.glob("image_*") if folder.is_dir()}
    if pictured and not calibrations:
        raise CalibrationError(
            f"{root} has images and no calibration: each frame needs a file in {root / 'calib'}."
        )
    names = _camera_names(calibrations, scans)
    chosen = pick_camera(camera, names, pictured, root)
    images = numbered_files(root / chosen, ".png") if chosen else {}
    return Drive(
        root=root,
        name=root.name,
        layout="kitti_object",
        scan_paths=scans,
        image_paths=images,
        camera_names=names,
        camera_name=chosen,
        calibration=ObjectCalibrations(root / "calib", chosen, calibrations, images)
        if chosen
        else None,
        metadata_files=tuple(calibrations.values()),
    )


@dataclass(frozen=True)
class ObjectCalibrations:
    """The camera of each frame, read from that frame's calibration and picture."""

    folder: Path
    name: str
    calibrations: Mapping[int, Path]
    images: Mapping[int, Path]

    def __call__(self, number: int) -> CameraCalibration:
        """Camera and cam_from_velo = R0_rect Tr_velo_to_cam of one frame."""
        missing = self.folder / f"{number:06d}.txt"
        calibration = read_calibration_file(self.calibrations.get(number, missing))
        own = {number: self.images[number]} if number in self.images else {}
        key = self.name.replace("image_", "P")
        camera = calibration.camera(key, size_of_pictures(own), self.name)
        unrectified_from_velo = calibration.rigid_motion("Tr_velo_to_cam")
        return CameraCalibration(camera, calibration.rotation("R0_rect") @ unrectified_from_velo)


def _camera_names(calibrations: Mapping[int, Path], scans: Mapping[int, Path]) -> tuple[str, ...]:
    """Cameras of the first calibration that can be read; a broken one is its own frame's matter."""
    for number in sorted(calibrations.keys() & scans.keys()):
        try:
            names = read_calibration_file(calibrations[number]).camera_names("P")
        except CalibrationError:
            continue
        if names:
            return names
    # None can be read: the usual name, so that each frame reports its own calibration.
    return ("image_2",) if calibrations else ()
