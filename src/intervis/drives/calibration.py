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
"""Width and height taken where neither calibration nor picture tells."""

TEXT_KEYS = ("calib_time",)
"""Lines of a calibration file that hold no numbers."""


@dataclass(frozen=True, eq=False)
class CameraCalibration:
    """A camera and where it sits: `cam_from_velo` leads to KITTI's rectified camera-0 frame."""

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
        """The values of one key, shaped.

        Raises
        ------
        CalibrationError
            The key is not there, or has another number of values.
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
            What stands before the camera's number in the key of its projection.
        """
        numbers = (re.fullmatch(prefix + r"(\d+)", key) for key in self.lines)
        return tuple(sorted(f"image_{match[1]}" for match in numbers if match))

    def camera(self, key: str, size_px: tuple[int, int], name: str) -> Camera:
        """The camera whose 3x4 projection stands in the line of `key`.

        Raises
        ------
        CalibrationError
            It is no projection of a camera.
        """
        try:
            return Camera(self.matrix(key, 3, 4), *size_px, name=name)
        except CameraError as error:
            raise CalibrationError(f"{self.where(key)}: {error}") from None

    def where(self, key: str) -> str:
        """File and line of a key, as the start of a sentence."""
        return f"{self.path}, line {self.lines[key][0]}"


def read_calibration_file(path: Path) -> CalibrationFile:
    """A KITTI calibration file, every line of it checked.

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
    """Lines of a small text file, without the blank ones at its end.

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
    """The finite numbers of one line.

    Raises
    ------
    CalibrationError
        A word is no finite number; names file and line.
    """
    values = []
    for word in text.split():
        try:
            value = float(word)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise CalibrationError(f"{path}, line {line_number}: {word[:40]!r} is no number.")
        values.append(value)
    return tuple(values)


def raw_camera_calibration(folder: Path, name: str) -> CameraCalibration:
    """The camera ``image_0K`` of KITTI raw's calib_cam_to_cam.txt and calib_velo_to_cam.txt.

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
    """Names of the cameras that KITTI raw's calibration knows: ``image_00`` and so on."""
    return read_calibration_file(folder / RAW_FILES[0]).camera_names("P_rect_")


def pick_camera(
    asked: str | None, names: tuple[str, ...], with_images: Collection[str], drive: Path
) -> str | None:
    """Name of the camera to use: the one asked for, else the left colour camera (number 2).

    Where number 2 has no pictures and another camera has, that one.

    Parameters
    ----------
    asked : str or None
        A name (``image_03``), or a camera's number alone (``3``).
    names : tuple of str
        Cameras of the calibration.
    with_images : collection of str
        Names of the folders with images.
    drive : Path
        For the error message.

    Raises
    ------
    DriveError
        There is no such camera.

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
        there = f"it has {', '.join(names)}" if names else "it has none"
        raise DriveError(f"{drive} has no camera {asked!r}: {there}.")
    candidates = [name for name in names if name in with_images] or list(names)
    left_colour = [name for name in candidates if int(name.removeprefix("image_")) == 2]
    return next(iter(left_colour + candidates), None)


def png_size_px(path: Path) -> tuple[int, int]:
    """Width and height of a PNG picture, from its first 24 bytes.

    Raises
    ------
    DriveError
        The file cannot be read or is no PNG.
    """
    try:
        with path.open("rb") as file:
            head = file.read(24)
    except OSError as error:
        raise DriveError(f"cannot read the image {path}: {error.strerror}.") from None
    if len(head) < 24 or head[:8] != b"\x89PNG\r\n\x1a\n" or head[12:16] != b"IHDR":
        raise DriveError(f"the image {path} is no PNG picture.")
    return int.from_bytes(head[16:20], "big"), int.from_bytes(head[20:24], "big")


def size_of_pictures(images: Mapping[int, Path]) -> tuple[int, int]:
    """Size of the first readable picture; KITTI's usual one, said in the log, where there is none.

    Raises
    ------
    DriveError
        There are pictures, and none can be read.
    """
    broken: DriveError | None = None
    for number in sorted(images):
        try:
            return png_size_px(images[number])
        except DriveError as error:
            broken = broken or error
    if broken:
        raise broken
    log.info("no pictures: the image size is taken as KITTI's %d x %d pixels.", *KITTI_SIZE_PX)
    return KITTI_SIZE_PX


def compare_sizes(camera: Camera, images: Mapping[int, Path]) -> None:
    """Warn where the first picture is not of the calibration's size; the calibration counts."""
    if not images:
        return
    try:
        width_px, height_px = size_of_pictures(images)
    except DriveError as error:
        log.warning("%s", error)
        return
    if (width_px, height_px) != (camera.width_px, camera.height_px):
        log.warning(
            "the pictures of %s are %d x %d pixels, its calibration says %d x %d: the calibration"
            " counts.",
            camera.name,
            width_px,
            height_px,
            camera.width_px,
            camera.height_px,
        )
