"""KITTI's calibration files, and the cameras that they describe."""

import codecs
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from intervis.arrays import Float64Array
from intervis.camera import Camera
from intervis.drives.image_size import image_size_px
from intervis.drives.regular_file import open_regular
from intervis.errors import CalibrationError, CameraError, PoseError
from intervis.transform import checked_pose

KEY_WITHOUT_COLON = re.compile(r"\s*[A-Za-z]\w*\s+[-+.\d]", re.ASCII)

COMMENT = "#"
"""Lines that start so are passed over."""

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
    """A file of lines ``KEY: number number ...``; the colon may be missing.

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

    def rect_from_velo(self) -> Float64Array:
        """(4, 4) rectified camera coordinates from the LiDAR's, of KITTI object and tracking.

        The rectifying rotation after the extrinsics. Their lines are called ``R0_rect`` and
        ``Tr_velo_to_cam``, in the tracking set ``R_rect`` and ``Tr_velo_cam``.
        """
        rectifying, extrinsics = (
            next((key for key in keys if key in self.lines), keys[0])
            for keys in (("R0_rect", "R_rect"), ("Tr_velo_to_cam", "Tr_velo_cam"))
        )
        unrectified_from_velo = self.rigid_motion(extrinsics)
        return self.rotation(rectifying) @ unrectified_from_velo

    def camera_names(self, prefix: str, digits: int = 0) -> tuple[str, ...]:
        """Names of the cameras with a projection: ``image_02`` for the key ``P_rect_02``.

        Parameters
        ----------
        prefix : str
            The key of a projection without the camera's number.
        digits : int
            Digits of the number in the name; 0 for those of the key.
        """
        numbers = (re.fullmatch(prefix + r"([0-9]{1,4})", key) for key in self.lines)
        return tuple(sorted(f"image_{match[1].zfill(digits)}" for match in numbers if match))

    def camera(self, key: str, size_px: tuple[int, int] | Mapping[int, Path], name: str) -> Camera:
        """The camera with the 3x4 projection in the line of `key`.

        Parameters
        ----------
        key : str
        size_px : tuple of two int, or mapping of int to Path
            Width and height of its images, or the images, which tell their size.
        name : str
            The camera's name.

        Raises
        ------
        CalibrationError
            The matrix is not a valid projection.
        DriveError
            None of the images can be read.
        """
        projection = self.matrix(key, 3, 4)
        if isinstance(size_px, Mapping):
            size_px = image_size_px(size_px, projection, name)
        try:
            return Camera(projection, *size_px, name=name)
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
        if not colon and KEY_WITHOUT_COLON.match(line):  # as in KITTI's tracking set
            key, colon, text = line.split(maxsplit=1)[0], ":", line.split(maxsplit=1)[1]
        if not line.strip() or key in TEXT_KEYS or line.lstrip().startswith(COMMENT):
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
        with open_regular(path) as file:
            content = file.read()
    except FileNotFoundError:
        raise CalibrationError(f"the calibration file {path} is missing.") from None
    except OSError as error:
        raise CalibrationError(f"cannot read {path}: {error.strerror}.") from None
    # Editors and shells of some systems put a byte order mark first, or write 16 bits a letter.
    wide = content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    text = content.decode("utf-16" if wide else "utf-8-sig", errors="replace")
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
    size_px = np.clip(cameras.matrix(f"S_rect_{number}", 2), -1e9, 1e9)
    width_px, height_px = (round(float(size)) for size in size_px)
    camera = cameras.camera(f"P_rect_{number}", (width_px, height_px), name)
    return CameraCalibration(
        camera, cameras.rotation("R_rect_00") @ velo.rotation_and_translation()
    )


RAW_FILES = ("calib_cam_to_cam.txt", "calib_velo_to_cam.txt")


def raw_camera_names(folder: Path) -> tuple[str, ...]:
    """Names of the cameras in KITTI raw's calibration: ``image_00`` and so on."""
    return read_calibration_file(folder / RAW_FILES[0]).camera_names("P_rect_")
