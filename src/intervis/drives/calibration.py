"""KITTI's calibration files, and the cameras that they describe."""

import logging
import math
import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from intervis.arrays import Float64Array
from intervis.camera import Camera
from intervis.errors import CalibrationError, CameraError, DriveError, PoseError
from intervis.transform import checked_pose

log = logging.getLogger(__name__)

KITTI_SIZE_PX = (1242, 375)
"""Default image width and height, where neither the calibration nor an image gives them."""

TEXT_KEYS = ("calib_time",)
"""Keys whose lines hold text instead of numbers."""


@dataclass(frozen=True, eq=False)
class CameraCalibration:
    """A camera's intrinsics and extrinsics.

    Attributes
    ----------
    camera : Camera
    cam_from_velo : (4, 4) float64 array
        Rectified camera coordinates from the LiDAR's. In all KITTI layouts this is the rectified
        frame of camera 0; the baseline of the other cameras is part of their projection.
    """

    camera: Camera
    cam_from_velo: Float64Array


@dataclass(frozen=True)
class CalibrationFile:
    """A file of lines ``KEY: number number ...``.

    Attributes
    ----------
    path : Path
    lines : mapping of str to (int, tuple of float)
        Line number (from 1) and values, by key.
    """

    path: Path
    lines: Mapping[str, tuple[int, tuple[float, ...]]]

    def matrix(self, key: str, *shape: int) -> Float64Array:
        """The values of one key as an array of the given shape.

        Raises
        ------
        CalibrationError
            The key is missing, or has another number of values.
        """
        if key not in self.lines:
            raise CalibrationError(f"{self.path} has no line {key!r}.")
        values = self.lines[key][1]
        if len(values) != math.prod(shape):
            raise CalibrationError(
                f"{self.where(key)}: {key} needs {math.prod(shape)} numbers, it has {len(values)}."
            )
        return np.array(values).reshape(shape)

    def rotation(self, key: str) -> Float64Array:
        """(4, 4) motion without translation: the 3x3 rotation in the line of `key`."""
        return self._rigid_motion(key, np.hstack([self.matrix(key, 3, 3), np.zeros((3, 1))]))

    def rigid_motion(self, key: str) -> Float64Array:
        """(4, 4) rigid motion: the 3x4 matrix in the line of `key`."""
        return self._rigid_motion(key, self.matrix(key, 3, 4))

    def rotation_and_translation(self) -> Float64Array:
        """(4, 4) rigid motion: the 3x3 rotation in the line ``R`` and the 3 metres in ``T``."""
        return self._rigid_motion("R", np.hstack([self.matrix("R", 3, 3), self.matrix("T", 3, 1)]))

    def _rigid_motion(self, key: str, matrix: Float64Array) -> Float64Array:
        try:
            return checked_pose(matrix, key)
        except PoseError as error:
            raise CalibrationError(f"{self.where(key)}: {error}") from None

    def camera_names(self, prefix: str) -> tuple[str, ...]:
        """Names of the cameras with a projection: ``image_02`` for the key ``P_rect_02``.

        Parameters
        ----------
        prefix : str
            The key of a projection without the camera's number.
        """
        numbers = (re.fullmatch(prefix + r"(\d+)", key) for key in self.lines)
        return tuple(sorted(f"image_{match[1]}" for match in numbers if match))

    def camera(self, key: str, size_px: tuple[int, int], name: str) -> Camera:
        """The camera with the 3x4 projection in the line of `key`.

        Raises
        ------
        CalibrationError
            The matrix is not a valid projection.
        """
        try:
            return Camera(self.matrix(key, 3, 4), *size_px, name=name)
        except CameraError as error:
            raise CalibrationError(f"{self.where(key)}: {error}") from None

    def where(self, key: str) -> str:
        """File and line of a key, for the start of an error message."""
        return f"{self.path}, line {self.lines[key][0]}"


def read_calibration_file(path: Path) -> CalibrationFile:
    """Read a KITTI calibration file and check every line.

    Raises
    ------
    CalibrationError
        The file is missing or unreadable, or a line is not a key, a colon and finite numbers.
    """
    lines: dict[str, tuple[int, tuple[float, ...]]] = {}
    for line_number, line in enumerate(read_lines(path), start=1):
        key, colon, text = (part.strip() for part in line.partition(":"))
        if not line.strip() or key in TEXT_KEYS:
            continue
        if not colon or not key:
            raise CalibrationError(
                f"{path}, line {line_number}: expected KEY: numbers, got {line.strip()[:60]!r}."
            )
        lines[key] = (line_number, parse_numbers(text, path, line_number))
    return CalibrationFile(path, lines)


def read_lines(path: Path) -> list[str]:
    """Lines of a small text file, without blank lines at its end.

    Raises
    ------
    CalibrationError
        The file is missing or cannot be read.
    """
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
    except FileNotFoundError:
        raise CalibrationError(f"the calibration file {path} is missing.") from None
    except OSError as error:
        raise CalibrationError(f"cannot read {path}: {error.strerror}.") from None
    return text.rstrip().splitlines()


def parse_numbers(text: str, path: Path, line_number: int) -> tuple[float, ...]:
    """The numbers of one line.

    Raises
    ------
    CalibrationError
        A word is not a finite number; the message names file and line.
    """
    values = []
    for word in text.split():
        try:
            value = float(word)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise CalibrationError(
                f"{path}, line {line_number}: {word[:40]!r} is not a finite number."
            )
        values.append(value)
    return tuple(values)


def raw_camera_calibration(folder: Path, name: str) -> CameraCalibration:
    """Camera ``image_0K`` from KITTI raw's calib_cam_to_cam.txt and calib_velo_to_cam.txt.

    Source: Geiger et al., Vision meets Robotics: The KITTI Dataset, IJRR 2013, Eq. 4 to 8.
    """
    cameras, velo = (read_calibration_file(folder / file) for file in RAW_FILES)
    number = name.removeprefix("image_")
    width_px, height_px = (round(float(size)) for size in cameras.matrix(f"S_rect_{number}", 2))
    camera = cameras.camera(f"P_rect_{number}", (width_px, height_px), name)
    return CameraCalibration(
        camera, cameras.rotation("R_rect_00") @ velo.rotation_and_translation()
    )


RAW_FILES = ("calib_cam_to_cam.txt", "calib_velo_to_cam.txt")


def raw_camera_names(folder: Path) -> tuple[str, ...]:
    """Names of the cameras in KITTI raw's calibration: ``image_00`` and so on."""
    return read_calibration_file(folder / RAW_FILES[0]).camera_names("P_rect_")


def pick_camera(
    asked: str | None, names: tuple[str, ...], with_images: Collection[str], drive: Path
) -> str | None:
    """Name of the camera to use, None where there is none.

    The default is the left colour camera (number 2). If only other cameras have images, the
    default is the first of those.

    Parameters
    ----------
    asked : str or None
        A camera's name (``image_03``) or number (``3``); None for the default.
    names : tuple of str
        Cameras in the calibration.
    with_images : collection of str
        Names of the folders with images.
    drive : Path
        The drive's path, for the error message.

    Raises
    ------
    DriveError
        The drive has no such camera.

    Examples
    --------
    >>> pick_camera(None, ("image_00", "image_02"), ("image_00", "image_02"), Path("drive"))
    'image_02'
    >>> pick_camera("0", ("image_00", "image_02"), (), Path("drive"))
    'image_00'
    """
    if asked is not None:
        number = asked.removeprefix("image_")
        for name in names:
            own = name.removeprefix("image_")
            if asked == name or (number.isdecimal() and int(number) == int(own)):
                return name
        available = ", ".join(names) or "none"
        raise DriveError(f"{drive} has no camera {asked!r}; available cameras: {available}.")
    candidates = [name for name in names if name in with_images] or list(names)
    left_colour = [name for name in candidates if int(name.removeprefix("image_")) == 2]
    return next(iter(left_colour + candidates), None)


def png_size_px(path: Path) -> tuple[int, int]:
    """Width and height of a PNG image, from its first 24 bytes.

    Pillow is an optional dependency, and a drive with images must open without it.

    Raises
    ------
    DriveError
        The file cannot be read or is not a PNG image.
    """
    try:
        with path.open("rb") as file:
            head = file.read(24)
    except OSError as error:
        raise DriveError(f"cannot read the image {path}: {error.strerror}.") from None
    if len(head) < 24 or head[:8] != b"\x89PNG\r\n\x1a\n" or head[12:16] != b"IHDR":
        raise DriveError(f"the image {path} is not a PNG image.")
    return int.from_bytes(head[16:20], "big"), int.from_bytes(head[20:24], "big")


def image_size_px(images: Mapping[int, Path]) -> tuple[int, int]:
    """Width and height of the first readable image; KITTI's usual size where there is no image.

    Raises
    ------
    DriveError
        There are images, and none of them can be read.
    """
    unreadable: DriveError | None = None
    for number in sorted(images):
        try:
            return png_size_px(images[number])
        except DriveError as error:
            unreadable = unreadable or error
    if unreadable:
        raise unreadable
    log.info("no images: KITTI's image size of %d x %d pixels is used.", *KITTI_SIZE_PX)
    return KITTI_SIZE_PX


def warn_of_other_size(camera: Camera, images: Mapping[int, Path]) -> None:
    """Log a warning where the images do not have the size in the calibration."""
    if not images:
        return
    try:
        width_px, height_px = image_size_px(images)
    except DriveError as error:
        log.warning("%s", error)
        return
    if (width_px, height_px) != (camera.width_px, camera.height_px):
        log.warning(
            "the images of %s are %d x %d pixels, but its calibration gives %d x %d: the size in"
            " the calibration is used.",
            camera.name,
            width_px,
            height_px,
            camera.width_px,
            camera.height_px,
        )
