"""Stations of a terrestrial scanner in PTX files: one or more in a file, each with its place.

A station starts with ten lines: columns, rows, the scanner's position, its three axes, and a 4x4
matrix that moves row vectors ``x y z 1`` from the scanner's frame into the world (the translation
stands in its last row). Then follow columns x rows lines ``x y z intensity``, with or without
``red green blue``; ``0 0 0`` means that nothing came back.
"""

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import BinaryIO

import numpy as np

from intervis.arrays import Float64Array
from intervis.drives.calibration import parse_numbers
from intervis.drives.drive import Drive
from intervis.drives.regular_file import files_with_ending, open_regular
from intervis.drives.scan import Scan, scan_of_rows
from intervis.drives.viewpoint import stands_at_pose
from intervis.errors import CalibrationError, DriveError, PoseError, ScanError
from intervis.transform import checked_pose, rigid

log = logging.getLogger(__name__)

ENDING = ".ptx"
EXPECTED_FILES = "*.ptx (stations)"
COLUMNS = {4: ("intensity",), 7: ("intensity", "red", "green", "blue"), 3: ()}
"""Names of the columns after x, y, z, by the number of columns."""

MOST_STATIONS = 100_000
FARTHEST_M = 1e9
BLOCK_BYTES = 2**20


@dataclass(frozen=True)
class Station:
    """A station in a file: where its points start, how many there are, where the scanner stood.

    Attributes
    ----------
    path : Path
    start : int
        Offset of the first point in the file, bytes.
    points : int
    world_from_velo : (4, 4) float64 array or None
        None where the file states nothing but the identity.
    position : (3,) float64 array
        The scanner's position in the header, apart from the matrix.
    """

    path: Path
    start: int
    points: int
    world_from_velo: Float64Array | None
    position: Float64Array


@dataclass(frozen=True)
class StationReader:
    """Reads the points of stations."""

    stations: Sequence[Station]

    def __call__(self, number: int) -> Scan:
        """Read the scan of a station, into the scanner's frame."""
        return read_station(self.stations[number])


def find_roots(path: Path) -> list[Path]:
    """`path`, if there are PTX files in it."""
    return [path] if files_with_ending(path, ENDING) else []


def read_drive(root: Path, camera: str | None) -> Drive:
    """Read the stations of a file, or of all files of a folder, numbered from 0."""
    if camera is not None:
        raise DriveError(f"{root} has no camera {camera!r}: PTX files hold no images.")
    paths = [root] if root.is_file() else files_with_ending(root, ENDING)
    if root.is_dir() and any(path.suffix.lower() == ".e57" for path in root.iterdir()):
        raise DriveError(f"{root} holds stations in PTX and in E57; give the path of one file.")
    stations = [station for path in paths for station in read_stations(path)]
    poses = {
        number: station.world_from_velo
        for number, station in enumerate(stations)
        if station.world_from_velo is not None
    }
    return Drive(
        root=root,
        name=root.name,
        layout="ptx_stations",
        scan_paths={number: station.path for number, station in enumerate(stations)},
        poses=poses or None,
        read=StationReader(tuple(stations)),
    )


def read_stations(path: Path) -> list[Station]:
    """The stations of a file, from their headers.

    Raises
    ------
    ScanError
        There is no station.
    CalibrationError
        A header does not parse; the message names file and line.
    """
    stations: list[Station] = []
    with open_regular(path) as file:
        end = file.seek(0, 2)
        file.seek(0)
        line_number = 1
        while len(stations) < MOST_STATIONS and _skip_blank_lines(file):
            station = _read_header(file, path, line_number, end)
            stations.append(station)
            _skip_lines(file, station.points)
            line_number += HEADER_LINES + station.points
    if not stations:
        raise ScanError(f"the scan {path} holds no station.")
    return stations


HEADER_LINES = 10


def _skip_blank_lines(file: BinaryIO) -> bool:
    """Leave the file before the next line with content; False at its end."""
    while line := file.readline(65536):
        if line.strip():
            file.seek(-len(line), 1)
            return True
    return False


def _read_header(file: BinaryIO, path: Path, line_number: int, end: int) -> Station:
    rows = []
    for nth in range(HEADER_LINES):
        text = file.readline(65536).decode("utf-8-sig", "replace")
        rows.append(parse_numbers(text, path, line_number + nth))
    counts = [row[0] if len(row) == 1 else -1.0 for row in rows[:2]]
    widths = [len(row) for row in rows[2:]]
    start = file.tell()
    points = counts[0] * counts[1]
    if (
        min(counts) < 0
        or any(count != round(count) for count in counts)
        or widths != [3, 3, 3, 3, 4, 4, 4, 4]
    ):
        raise CalibrationError(
            f"{path}, line {line_number}: expected the ten lines of a station of PTX: columns,"
            " rows, position, three axes and a 4x4 matrix."
        )
    if points * len("0 0 0\n") - 1 > end - start:
        raise CalibrationError(
            f"{path}, line {line_number}: the station is truncated: it declares {points:.0f}"
            f" points, and {end - start} bytes follow."
        )
    matrix, position = np.array(rows[6:]).T, np.array(rows[2])
    if max(np.abs(matrix).max(), np.abs(position).max()) > FARTHEST_M:
        raise CalibrationError(
            f"{path}, line {line_number}: the station has a number beyond {FARTHEST_M:.0e}: its"
            " lengths must be metres."
        )
    try:
        pose = checked_pose(matrix, "the matrix of the station")
    except PoseError as error:
        raise CalibrationError(f"{path}, line {line_number + 6}: {error}") from None
    stated = None if np.array_equal(pose, np.eye(4)) else pose
    return Station(path, start, int(points), stated, position)


def _skip_lines(file: BinaryIO, count: int) -> None:
    """Leave the file behind `count` further lines, or at its end."""
    while count > 0 and (block := file.read(BLOCK_BYTES)):
        ends = np.flatnonzero(np.frombuffer(block, np.uint8) == ord("\n"))
        if len(ends) >= count:
            file.seek(int(ends[count - 1]) + 1 - len(block), 1)
            return
        count -= len(ends)


def read_station(station: Station) -> Scan:
    """Read the points of a station; rows where nothing came back become NaN.

    Raises
    ------
    ScanError
        A line does not parse, or there are fewer points than declared.
    """
    path = station.path
    try:
        with open_regular(path) as file:
            file.seek(station.start)
            lines = list(islice(file, station.points))
    except OSError as error:
        raise ScanError(f"cannot read the scan {path}: {error.strerror}.") from None
    columns = len(lines[0].split()) if lines else 0
    if columns not in COLUMNS:
        raise ScanError(
            f"the scan {path} has {columns} numbers a point: PTX has x y z intensity, with or"
            " without red green blue."
        )
    try:
        rows = np.loadtxt(lines, comments=None, ndmin=2)
    except (ValueError, OverflowError) as error:
        reason = str(error).splitlines()[0]
        raise ScanError(f"the scan {path} does not parse as points of PTX ({reason}).") from None
    if len(rows) != station.points:
        raise ScanError(
            f"the scan {path} is truncated: its station declares {station.points} points, and"
            f" {len(rows)} are there."
        )
    rows[~rows[:, :3].any(axis=1), :3] = np.nan
    return scan_of_rows(path, rows, COLUMNS[columns], _velo_from_file(station, rows[:, :3]))


def _velo_from_file(station: Station, points: Float64Array) -> Float64Array | None:
    """Motion into the scanner's frame, where the points are not in it.

    Points of the world have the identity for a matrix, and the scanner's position beside it.
    """
    if station.world_from_velo is not None or not station.position.any():
        return None
    known = points[np.isfinite(points).all(axis=1)]
    if not stands_at_pose(known, station.position):
        return None
    log.info(
        "the points of %s are in world coordinates: they are moved into the scanner's frame.",
        station.path,
    )
    return rigid(np.eye(3), -station.position)
