"""Masks of the frames of a drive: which scans and cameras a frame's masks are made of."""

from __future__ import annotations  # help() shows the names of the array types

import json
import os
from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import cast

import numpy as np
from numpy.typing import NDArray

from intervis.arguments import is_count, mapping_of, object_of, objects_of, shown
from intervis.arrays import BoolArray, Float64Array, FloatArray
from intervis.drives import Drive, Frame, open_drive
from intervis.drives.regular_file import open_regular
from intervis.errors import DriveError, SettingsError
from intervis.progress import Progress
from intervis.transform import checked_pose, inverse, transform
from intervis.uses.voxels.camera_voxels import PosedCamera
from intervis.uses.voxels.masks import Masks, PosedScan, masks_of
from intervis.uses.voxels.voxel_grid import VoxelGrid
from intervis.uses.voxels.voxelizer import CAR_X_M

MOST_CLASSES_BYTES = 1_000_000
OWN_WIDTH_M = 2.4
"""Returns below the scanner in a box so wide, and as long as `CAR_X_M`, lie on the own vehicle."""


@dataclass(frozen=True, eq=False)
class MaskSettings:
    """How the masks of each frame are made.

    Attributes
    ----------
    grid : VoxelGrid
    definition : str
        See `intervis.uses.voxels.masks`.
    later : int
        So many frames after each frame are added to its target.
    keep_moving : bool
        Whether returns of moving classes of added frames are kept.
    grid_from_velo : (4, 4) float64 array
        The frame of the grid from that of the scanner.
    classes : mapping of int to int, or None
        Replaces the classes of the labels; those not listed become 0.

    Raises
    ------
    ArgumentError, PoseError, SettingsError
        A value is of the wrong kind or out of range.
    """

    grid: VoxelGrid
    definition: str = "exact"
    later: int = 0
    keep_moving: bool = False
    grid_from_velo: Float64Array = field(default_factory=lambda: np.eye(4))
    classes: Mapping[int, int] | None = None

    def __post_init__(self) -> None:
        object_of(self.grid, VoxelGrid, "grid")
        if not is_count(self.later, least=0):
            raise SettingsError(
                f"later must be a whole number of 0 or more, got {shown(self.later)}."
            )
        pose = checked_pose(self.grid_from_velo, "grid_from_velo")
        object.__setattr__(self, "grid_from_velo", pose)
        if self.classes is not None:
            numbers = mapping_of(self.classes, "classes")
            if not all(_is_class(number) for pair in numbers.items() for number in pair):
                raise SettingsError("classes must map whole numbers from 0 to 65535 to others.")


def _is_class(number: object) -> bool:
    return is_count(number, least=0) and cast(int, number) < 1 << 16


def drive_cameras(
    source: str | os.PathLike[str], drive: Drive, *, only_selected: bool = False
) -> dict[str, Drive]:
    """The drive opened with each of its cameras, or with the selected one, by the camera's name."""
    names = drive.camera_names if drive.camera_name else ()
    if only_selected and drive.camera_name:
        names = (drive.camera_name,)
    opened = {drive.camera_name: drive}
    return {name: opened.get(name) or open_drive(source, camera=name) for name in names}


def frame_masks(
    drive: Drive,
    number: int,
    settings: MaskSettings,
    cameras: Mapping[str, Drive] | None = None,
    progress: Progress | None = None,
) -> Masks:
    """The masks of one frame of a drive.

    Parameters
    ----------
    drive : Drive
    number : int
        Of the frame.
    settings : MaskSettings
    cameras : mapping of str to Drive
        As `drive_cameras` returns it; without it no masks of cameras are made.
    progress : callable, optional
        Called with a note for each scan.

    Raises
    ------
    DriveError
        There is no such frame, or frames are added and have no poses.
    SettingsError
        As `intervis.uses.voxels.masks.masks_of`.
    """
    object_of(drive, Drive, "drive")
    object_of(settings, MaskSettings, "settings")
    if cameras is not None:
        objects_of(mapping_of(cameras, "cameras").values(), Drive, "cameras")
    now = drive[number]
    scans = _scans_of(now, settings)
    for later in later_frames(drive, number, settings.later):
        scans.append(_later_scan(now, drive[later], settings))
    masks = masks_of(
        settings.grid,
        scans,
        definition=settings.definition,
        cameras=_cameras_of(number, settings, cameras or {}),
        keep_moving=settings.keep_moving,
        progress=progress,
    )
    return masks if settings.classes is None else _with_classes(masks, settings.classes)


def later_frames(drive: Drive, number: int, count: int) -> tuple[int, ...]:
    """The next frames of a drive after a frame; fewer at its end."""
    begin = bisect_right(drive.frame_numbers, number)
    return tuple(drive.frame_numbers[begin : begin + count])


def _scans_of(now: Frame, settings: MaskSettings) -> list[PosedScan]:
    """The scans of all scanners at the moment of a frame."""
    scans = []
    for nth, scan in enumerate(now.scans):
        velo_from_sensor = np.eye(4)
        if nth > 0:
            if now.pose is None or scan.pose is None:
                continue  # where it stands is not known
            velo_from_sensor = inverse(now.pose) @ scan.pose
        labels = _labels(now) if nth == 0 else None
        pose = settings.grid_from_velo @ velo_from_sensor
        one = PosedScan(scan.points, pose, scan.name or "lidar", labels)
        scans.append(one.only(~on_own_car(transform(velo_from_sensor, scan.points))))
    return scans


def on_own_car(points_velo: FloatArray) -> BoolArray:
    """Which returns (N, 3), in the frame of the main scanner, lie on the own vehicle.

    It would occlude all that its cameras see.
    """
    x, y, z = points_velo.T
    with np.errstate(invalid="ignore"):
        inside = (x > CAR_X_M[0]) & (x < CAR_X_M[1]) & (np.abs(y) < OWN_WIDTH_M / 2) & (z < 0.0)
    return np.asarray(inside)


def _later_scan(now: Frame, frame: Frame, settings: MaskSettings) -> PosedScan:
    if now.pose is None or frame.pose is None:
        without = now if now.pose is None else frame
        raise DriveError(
            f"later frames are added by their poses, and frame {without.number} has none: add"
            " poses to the drive, or give --later 0."
        )
    pose = settings.grid_from_velo @ inverse(now.pose) @ frame.pose
    one = PosedScan(frame.points, pose, labels=_labels(frame), is_now=False)
    return one.only(~on_own_car(frame.points))


def _labels(frame: Frame) -> NDArray[np.uint16] | None:
    """Class of each point; None without labels, and where no point has one."""
    classes = frame.point_classes
    return classes if classes is not None and classes.any() else None


def _cameras_of(
    number: int, settings: MaskSettings, cameras: Mapping[str, Drive]
) -> dict[str, PosedCamera]:
    posed = {}
    for name, drive in cameras.items():
        calibration = drive.calibration_of(number)
        if calibration is not None:
            cam_from_grid = calibration.cam_from_velo @ inverse(settings.grid_from_velo)
            posed[name] = PosedCamera(calibration.camera, cam_from_grid)
    return posed


def _with_classes(masks: Masks, classes: Mapping[int, int]) -> Masks:
    if masks.label is None:
        return masks
    table = np.zeros(1 << 16, np.uint16)
    table[list(classes)] = list(classes.values())
    return replace(masks, label=table[masks.label])


def read_classes(path: Path) -> dict[int, int]:
    """Read a map of classes: a JSON object of numbers, ``{"10": 4, "40": 11}``.

    Raises
    ------
    SettingsError
        The file cannot be read, or is no such object.
    """
    try:
        with open_regular(path) as file:
            content = json.loads(file.read(MOST_CLASSES_BYTES))
        pairs = {int(key): value for key, value in content.items()}
        if not all(type(value) is int for value in pairs.values()):  # nor is true a number
            raise ValueError
        if not all(0 <= number < 1 << 16 for pair in pairs.items() for number in pair):
            raise ValueError
    except OSError as error:
        raise SettingsError(f"cannot read the classes {path}: {error.strerror}.") from None
    except (ValueError, TypeError, AttributeError, RecursionError):
        raise SettingsError(
            f"the classes {path} must be a JSON object of whole numbers from 0 to 65535, as in"
            ' {"10": 4, "40": 11}.'
        ) from None
    return pairs
