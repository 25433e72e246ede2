"""Routes from files: poses of KITTI and TUM, way points as CSV."""

import csv
from pathlib import Path

import numpy as np

from intervis.arguments import object_of, path_of
from intervis.arrays import Float64Array
from intervis.drives import Drive
from intervis.drives.calibration import COMMENT, parse_numbers, read_lines
from intervis.drives.trajectory import read_poses
from intervis.errors import CalibrationError, DriveError, PointsError
from intervis.sight.query_checks import finite_number, rate_of
from intervis.uses.routes.route import Route

KMH_PER_MPS = 3.6
TUM_NUMBERS = 8
"""A line of TUM's format: time, position, quaternion."""
WAY_POINT_COLUMNS = ("x", "y", "z", "speed_kmh", "time_s")


def route_of_drive(drive: Drive, scans_per_s: float | None = None) -> Route:
    """The way of the drive's scanner.

    Parameters
    ----------
    drive : Drive
    scans_per_s : float or None
        Gives times to a drive that has none.

    Raises
    ------
    DriveError
        Fewer than two frames have a pose.
    PointsError
        The times of the frames do not rise, or the scanner stood still.
    """
    object_of(drive, Drive, "drive")
    poses = drive.poses or {}
    numbers = [number for number in drive.frame_numbers if number in poses]
    if len(numbers) < 2:
        raise DriveError(
            f"{drive.name} has poses for fewer than two frames, so it has no route of its own: give"
            " one as a file."
        )
    time_s = frame_times_s(drive, numbers, scans_per_s)
    places = np.array([poses[number][:3, 3] for number in numbers])
    return Route.through(places, time_s=time_s)


def frame_times_s(
    drive: Drive, numbers: list[int], scans_per_s: float | None = None
) -> Float64Array | None:
    """Times (N,) of frames, seconds after the first frame of the drive; None without times.

    Raises
    ------
    SettingsError
        `scans_per_s` is not from 1e-6 to 1e6.
    """
    known = drive.timestamps_ns
    if all(number in known for number in numbers):
        start_ns = min(known.values())
        return np.array([1e-9 * (known[number] - start_ns) for number in numbers])
    if scans_per_s is None:
        return None
    rate_hz = rate_of("the scans a second", scans_per_s)
    first = drive.frame_numbers[0]
    return np.array([(number - first) / rate_hz for number in numbers])


def drive_start_s(drive: Drive) -> float:
    """Time of the drive's first scan on its own clock, seconds; 0 without times."""
    return 1e-9 * min(drive.timestamps_ns.values(), default=0)


def read_route(path: Path, start_s: float = 0.0) -> Route:
    """Read a route; the first line tells the format.

    - KITTI: 12 or 16 numbers a line, a pose each. Only the places are used.
    - TUM: 8 numbers a line, time in seconds, place, quaternion.
    - CSV: a heading with ``x`` and ``y``, and any of ``z``, ``speed_kmh`` and ``time_s``.

    Places are in the scene's frame, metres; `start_s` is subtracted from the times.

    Raises
    ------
    DriveError
        There is no such file.
    CalibrationError
        It cannot be read, or a line does not parse.
    PointsError
        As `Route.through`; the message names the file.
    """
    path, start_s = path_of(path, "path"), finite_number("start_s", start_s, "seconds")
    if not path.exists():
        raise DriveError(f"there is no route at {path}: check the path.")
    first = next((line for line in read_lines(path) if _has_values(line)), "")
    try:
        if "," in first:
            return _read_way_points(path, start_s)
        if len(first.split()) == TUM_NUMBERS:
            rows = _read_rows(path)
            return Route.through(rows[:, 1:4], time_s=rows[:, 0] - start_s)
        return Route.through(np.array([pose[:3, 3] for pose in read_poses(path)]).reshape(-1, 3))
    except PointsError as error:
        raise PointsError(f"{path}: {error}") from None


def _has_values(line: str) -> bool:
    return bool(line.strip()) and not line.lstrip().startswith(COMMENT)


def _read_rows(path: Path) -> Float64Array:
    """(N, 8) lines of TUM's format."""
    rows = []
    for number, line in enumerate(read_lines(path), start=1):
        if _has_values(line):
            rows.append(parse_numbers(line, path, number))
            if len(rows[-1]) != TUM_NUMBERS:
                raise CalibrationError(
                    f"{path}, line {number}: expected {TUM_NUMBERS} numbers, got {len(rows[-1])}."
                )
    return np.array(rows)


def _read_way_points(path: Path, start_s: float) -> Route:
    lines = [line for line in read_lines(path) if _has_values(line)]
    try:
        heading, *rows = csv.reader(lines, skipinitialspace=True)
    except csv.Error as error:
        raise CalibrationError(f"{path} does not parse as CSV ({error}).") from None
    names = [name.strip().lower() for name in heading]
    if not {"x", "y"} <= set(names) or not set(names) <= set(WAY_POINT_COLUMNS):
        raise CalibrationError(
            f"{path}: the heading of way points must have x and y, and may have z, speed_kmh and"
            f" time_s, got {', '.join(names)[:80]}."
        )
    columns = _columns(path, names, rows)
    places = np.column_stack([columns["x"], columns["y"], columns.get("z", 0.0 * columns["x"])])
    speed_kmh, time_s = columns.get("speed_kmh"), columns.get("time_s")
    return Route.through(
        places,
        speed_mps=None if speed_kmh is None else speed_kmh / KMH_PER_MPS,
        time_s=None if time_s is None else time_s - start_s,
    )


def _columns(path: Path, names: list[str], rows: list[list[str]]) -> dict[str, Float64Array]:
    for nth, row in enumerate(rows, start=1):
        if len(row) != len(names):
            raise CalibrationError(
                f"{path}, way point {nth}: expected {len(names)} values, got {len(row)}."
            )
    try:
        table = np.array(rows, dtype=np.float64).reshape(-1, len(names))
    except ValueError:
        raise CalibrationError(f"{path}: a value of the way points is no number.") from None
    return dict(zip(names, table.T, strict=True))
