"""What KITTI's layouts share: numbered scans, and the numbered images of the chosen camera."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from intervis.arrays import Float64Array
from intervis.drives.boxes import Box
from intervis.drives.calibration import CameraCalibration
from intervis.drives.camera_choice import pick_camera
from intervis.drives.drive import Drive
from intervis.drives.image_file import IMAGE_ENDINGS
from intervis.drives.numbering import numbered_files
from intervis.drives.point_labels import label_files


@dataclass(frozen=True)
class KittiCamera:
    """The camera of a drive.

    Attributes
    ----------
    names : tuple of str
        Cameras in the calibration.
    name : str or None
        The chosen one.
    images : mapping of int to Path
        Its images by frame number.
    """

    names: tuple[str, ...]
    name: str | None
    images: Mapping[int, Path]


def image_folders(parent: Path, inside: str = "") -> dict[str, Path]:
    """Folders with images by the camera's name: ``image_02``, or a folder inside of it."""
    return {
        folder.name: folder / inside
        for folder in parent.glob("image_*")
        if (folder / inside).is_dir()
    }


def kitti_camera(
    asked: str | None, names: tuple[str, ...], folders: Mapping[str, Path], drive: Path
) -> KittiCamera:
    """Choose a camera as `pick_camera` does, and list its images.

    Parameters
    ----------
    asked : str or None
        A camera's name or number; None for the default.
    names : tuple of str
        Cameras in the calibration.
    folders : mapping of str to Path
        See `image_folders`.
    drive : Path
        The drive's path, for the error message.
    """
    name = pick_camera(asked, names, folders.keys(), drive)
    folder = folders.get(name) if name else None
    return KittiCamera(names, name, numbered_files(folder, *IMAGE_ENDINGS) if folder else {})


def kitti_drive(
    root: Path,
    layout: str,
    scans: Mapping[int, Path],
    camera: KittiCamera,
    calibration: CameraCalibration | Callable[[int], CameraCalibration] | None,
    metadata_files: tuple[Path, ...],
    *,
    poses: Mapping[int, Float64Array] | None = None,
    timestamps_ns: Mapping[int, int] | None = None,
    read_boxes: Callable[[int], tuple[Box, ...]] | None = None,
) -> Drive:
    """The drive of a KITTI layout, with the labels beside its scans; parameters as in `Drive`."""
    return Drive(
        root=root,
        name=root.name,
        layout=layout,
        scan_paths=scans,
        image_paths=camera.images,
        camera_names=camera.names,
        camera_name=camera.name,
        calibration=calibration,
        poses=poses,
        timestamps_ns=timestamps_ns or {},
        metadata_files=metadata_files,
        label_paths=label_files(scans),
        read_boxes=read_boxes,
    )
