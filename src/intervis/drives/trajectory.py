"""Poses and timestamps: KITTI's odometry format, GPS/IMU records (oxts), lists of times."""

import re
from collections.abc import Iterator, Mapping, Sequence
from decimal import Decimal
from pathlib import Path

import numpy as np

from intervis.arrays import Float64Array
from intervis.drives.calibration import COMMENT, parse_numbers, read_lines
from intervis.drives.numbering import MOST_DIGITS
from intervis.errors import CalibrationError, PoseError
from intervis.transform import checked_pose, inverse, rigid

EARTH_RADIUS_M = 6_378_137.0
"""Radius of the sphere of KITTI's Mercator projection."""

FARTHEST_M = 1e9
"""Coordinates of a pose at most: beyond any on Earth, in any unit that is meant."""

LATEST_S = 9e9
"""Times at most, seconds: 64 bits of nanoseconds end at 9.2e9."""

YEARS = ("1678", "2261")
"""First and last year that 64 bits of nanoseconds since 1970 hold completely."""

DATE_AND_TIME = re.compile(r"\d{4}-\d\d-\d\d[ T]\d\d:\d\d:\d\d(\.\d{1,9})?", re.ASCII)


def read_poses(path: Path) -> list[Float64Array]:
    """Read poses in KITTI's odometry format: each line holds the upper three rows of a 4x4 matrix.

    All four rows are taken too. Blank lines and lines that start with # are passed over.

    Returns
    -------
    list of (4, 4) float64 arrays
        One pose for each line.

    Raises
    ------
    CalibrationError
        A line does not parse or is not a rigid motion; the message names file and line.
    """
    return [
        _pose(parse_numbers(line, path, line_number), path, line_number)
        for line_number, line in _lines_with_values(path)
    ]


def read_numbered_poses(path: Path) -> dict[int, Float64Array]:
    """Read poses with the number of their frame before them, as in KITTI-360.

    Raises
    ------
    CalibrationError
        As `read_poses`; or a line does not start with a frame number, or repeats one.
    """
    poses: dict[int, Float64Array] = {}
    for line_number, line in _lines_with_values(path):
        number, *values = parse_numbers(line, path, line_number)
        if not (number.is_integer() and 0 <= number < 10**MOST_DIGITS) or number in poses:
            raise CalibrationError(
                f"{path}, line {line_number}: expected a frame number of its own, got"
                f" {line.split()[0]:.40}."
            )
        poses[int(number)] = _pose(tuple(values), path, line_number)
    return poses


def _pose(values: tuple[float, ...], path: Path, line_number: int) -> Float64Array:
    """The pose in 12 or 16 numbers of a line."""
    if len(values) not in (12, 16):
        raise CalibrationError(
            f"{path}, line {line_number}: a pose needs 12 numbers, this line has {len(values)}."
        )
    if max(map(abs, values)) > FARTHEST_M:
        raise CalibrationError(
            f"{path}, line {line_number}: the pose has a number beyond {FARTHEST_M:.0e}: its"
            " lengths must be metres."
        )
    try:
        return checked_pose(np.reshape(values, (-1, 4)))
    except PoseError as error:
        raise CalibrationError(f"{path}, line {line_number}: {error}") from None


def _lines_with_values(path: Path) -> Iterator[tuple[int, str]]:
    """Line numbers (from 1) and lines of a file, without blank ones and comments."""
    for line_number, line in enumerate(read_lines(path), start=1):
        if line.strip() and not line.lstrip().startswith(COMMENT):
            yield line_number, line


def poses_from_oxts(
    records: Mapping[int, tuple[float, ...]], velo_from_imu: Float64Array
) -> dict[int, Float64Array]:
    """LiDAR poses from KITTI's oxts records.

    The world frame is x east, y north, z up, with its origin at the IMU of the first record.
    Positions come from latitude and longitude by a Mercator projection with scale 1 at the first
    record.
    Source: KITTI raw development kit, convertOxtsToPose.

    Parameters
    ----------
    records : mapping of frame number to six floats
        Latitude and longitude in degrees, altitude in metres, roll, pitch and yaw in radians.
    velo_from_imu : (4, 4) array

    Returns
    -------
    dict of frame number to (4, 4) float64 array
        world_from_velo.
    """
    from scipy.spatial.transform import Rotation  # 0.4 s to import: only for drives with oxts

    imu_from_velo = inverse(velo_from_imu)
    origin: Float64Array | None = None
    scale = 1.0
    poses = {}
    for number in sorted(records):
        latitude_deg, longitude_deg, altitude_m, *angles_rad = records[number]
        if origin is None:
            scale = float(np.cos(np.radians(latitude_deg)))
        east_m = scale * EARTH_RADIUS_M * np.radians(longitude_deg)
        north_m = scale * EARTH_RADIUS_M * np.log(np.tan(np.radians(90 + latitude_deg) / 2))
        position = np.array([east_m, north_m, altitude_m])
        origin = position if origin is None else origin
        rotation = Rotation.from_euler("xyz", angles_rad)  # fixed axes: roll, then pitch, then yaw
        world_from_imu = rigid(rotation.as_matrix(), position - origin)
        poses[number] = world_from_imu @ imu_from_velo
    return poses


def read_oxts_file(path: Path) -> tuple[float, ...]:
    """The six numbers of a record in a file of its own, as in KITTI raw.

    Raises
    ------
    CalibrationError
        It does not start with six numbers: latitude and longitude in degrees, altitude in metres,
        roll, pitch and yaw in radians.
    """
    lines = read_lines(path)
    return _record(lines[0] if lines else "", path, 1)


def read_oxts_lines(path: Path) -> list[tuple[float, ...]]:
    """The records in the lines of one file, as in KITTI tracking; errors as `read_oxts_file`."""
    return [_record(line, path, number) for number, line in enumerate(read_lines(path), start=1)]


def _record(line: str, path: Path, line_number: int) -> tuple[float, ...]:
    values = parse_numbers(line, path, line_number)
    if (
        len(values) < 6
        or not abs(values[0]) < 90
        or not abs(values[1]) <= 360
        or max(map(abs, values[:6])) > FARTHEST_M
    ):
        raise CalibrationError(
            f"{path}, line {line_number}: expected latitude, longitude, altitude, roll, pitch and"
            " yaw."
        )
    return values[:6]


def read_timestamps(path: Path) -> list[int | None]:
    """Read KITTI raw's timestamps.txt: nanoseconds since 1970, None for a blank line.

    Raises
    ------
    CalibrationError
        A line is not a date and time; the message names file and line.
    """
    timestamps_ns: list[int | None] = []
    for line_number, line in enumerate(read_lines(path), start=1):
        text = line.strip()
        try:
            if text and not (DATE_AND_TIME.fullmatch(text) and YEARS[0] <= text[:4] <= YEARS[1]):
                raise ValueError
            timestamps_ns.append(int(np.datetime64(text, "ns").astype(np.int64)) if text else None)
        except ValueError:
            raise CalibrationError(
                f"{path}, line {line_number}: {text[:40]!r} is not a date and time from"
                f" {YEARS[0]} to {YEARS[1]}."
            ) from None
    return timestamps_ns


def read_seconds(path: Path) -> list[int | None]:
    """Read KITTI odometry's times.txt (one time in seconds a line): nanoseconds."""
    timestamps_ns: list[int | None] = []
    for line_number, line in _lines_with_values(path):
        values = parse_numbers(line, path, line_number)
        if len(values) != 1:
            raise CalibrationError(f"{path}, line {line_number}: expected one time in seconds.")
        if abs(values[0]) > LATEST_S:
            raise CalibrationError(
                f"{path}, line {line_number}: {line.strip()[:40]!r} is beyond {LATEST_S:.0e}"
                " seconds, which 64 bits of nanoseconds do not hold."
            )
        # Exact: a float of seconds since 1970 has no nanoseconds.
        try:
            timestamps_ns.append(round(Decimal(line.strip()) * 10**9))
        except ArithmeticError:  # an exponent of many digits
            timestamps_ns.append(round(values[0] * 1e9))
    return timestamps_ns


def known_timestamps(timestamps_ns: Mapping[int, int | None]) -> dict[int, int]:
    """The timestamps without the missing ones."""
    return {number: time_ns for number, time_ns in timestamps_ns.items() if time_ns is not None}


def lidar_poses(
    world_from_cam: Sequence[Float64Array], cam_from_velo: Float64Array
) -> list[Float64Array]:
    """LiDAR poses from poses of camera 0.

    KITTI's first camera pose is the identity. The world frame of the result is then the LiDAR's
    frame at the first pose.

    Examples
    --------
    >>> cam_from_velo = np.array([[0.0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]])
    >>> ten_metres_ahead = rigid(np.eye(3), [0.0, 0.0, 10.0])
    >>> lidar_poses([ten_metres_ahead], cam_from_velo)[0][:3, 3].tolist()
    [10.0, 0.0, 0.0]
    """
    velo_from_cam = inverse(cam_from_velo)
    return [velo_from_cam @ pose @ cam_from_velo for pose in world_from_cam]
