"""Stations of a terrestrial scanner in E57 files: one or more in a file, each with its pose.

The points of a station are in its scanner's frame; its pose moves them into the frame of the file.
A pose may lack its rotation or its translation. Read with pye57 (extra ``e57``).
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from intervis.arrays import Float64Array
from intervis.drives.drive import Drive
from intervis.drives.pcd_file import rotation_of_quaternion
from intervis.drives.regular_file import files_with_ending, open_regular
from intervis.drives.remote_path import check_on_disk
from intervis.drives.scan import Scan, scan_of_rows
from intervis.errors import CalibrationError, DriveError, MissingExtraError, ScanError
from intervis.transform import rigid

ENDING = ".e57"
EXPECTED_FILES = "*.e57 (stations)"
CARTESIAN = ("cartesianX", "cartesianY", "cartesianZ")
SPHERICAL = ("sphericalRange", "sphericalAzimuth", "sphericalElevation")
INVALID = ("cartesianInvalidState", "sphericalInvalidState")
FARTHEST_M = 1e9

MOST_POINTS = 2**31
"""Points of a station at most: memory is taken for what a file declares."""


@dataclass(frozen=True)
class StationReader:
    """Reads the points of stations, each given by its file and its place in it."""

    stations: Sequence[tuple[Path, int]]

    def __call__(self, number: int) -> Scan:
        """Read the scan of a station, in the scanner's frame."""
        path, index = self.stations[number]
        return _scan(path, _columns(path, index))


def find_roots(path: Path) -> list[Path]:
    """`path`, if there are E57 files in it."""
    return [path] if files_with_ending(path, ENDING) else []


def read_drive(root: Path, camera: str | None) -> Drive:
    """Read the stations of a file, or of all files of a folder, numbered from 0."""
    if camera is not None:
        raise DriveError(f"{root} has no camera {camera!r:.60}: no camera is read from E57.")
    stations: list[tuple[Path, int]] = []
    poses: dict[int, Float64Array] = {}
    for path in [root] if root.is_file() else files_with_ending(root, ENDING):
        for index, pose in enumerate(_poses(path)):
            if pose is not None:
                poses[len(stations)] = pose
            stations.append((path, index))
    if not stations:
        raise ScanError(f"{root} holds no station.")
    return Drive(
        root=root,
        name=root.name,
        layout="e57_stations",
        scan_paths={number: path for number, (path, _) in enumerate(stations)},
        poses=poses or None,
        read=StationReader(tuple(stations)),
    )


def _opened(path: Path) -> Any:
    check_on_disk(path)
    try:
        import pye57
    except ImportError:
        raise MissingExtraError("pye57", "e57", "Reading an E57 file") from None
    with _readable(path):
        open_regular(path).close()
        return pye57.E57(str(path))


@contextmanager
def _readable(path: Path) -> Iterator[None]:
    """Report what pye57 raises as an error of this file, in one sentence."""
    try:
        yield
    except DriveError:
        raise
    except OSError as error:
        raise ScanError(
            f"cannot read the scan {path}: {error.strerror or _brief(error)}."
        ) from None
    except Exception as error:  # pye57 raises various types on damaged files
        raise ScanError(f"{path} is not a readable E57 file ({_brief(error)}).") from None


def _brief(error: Exception) -> str:
    """The reason in an exception of pye57, which may have several lines."""
    words = str(error).split()
    return " ".join(words)[:120].rstrip(".") if words else type(error).__name__


def _poses(path: Path) -> list[Float64Array | None]:
    """Poses of the stations of a file; None where the file states none."""
    with closing(_opened(path)) as file, _readable(path):
        headers = [file.get_header(index) for index in range(file.scan_count)]
        return [pose_of_node(path, header.node) for header in headers]


def pose_of_node(path: Path, node: Any) -> Float64Array | None:
    """(4, 4) pose of a station; what it lacks is the identity, None where it has no pose.

    Parameters
    ----------
    path : Path
        The file, for messages.
    node : node of E57
        ``isDefined(name)`` says whether it has a child, ``node[name]`` is the child.

    Raises
    ------
    CalibrationError
        The rotation is no quaternion, or a number is not finite.
    """
    if not node.isDefined("pose"):
        return None
    pose = node["pose"]
    parts = {"rotation": {"w": 1.0, "x": 0.0, "y": 0.0, "z": 0.0}}
    parts["translation"] = {"x": 0.0, "y": 0.0, "z": 0.0}
    for name, values in parts.items():
        if pose.isDefined(name):
            for axis in values:
                values[axis] = float(pose[name][axis].value())
    quaternion = np.array(list(parts["rotation"].values()))
    translation = np.array(list(parts["translation"].values()))
    if not (np.abs(translation) < FARTHEST_M).all() or not 1e-3 < np.linalg.norm(quaternion) < 1e3:
        raise CalibrationError(
            f"{path} has a station whose pose is not a quaternion and a translation in metres."
        )
    return rigid(rotation_of_quaternion(quaternion), translation)


def _columns(path: Path, index: int) -> dict[str, NDArray[Any]]:
    with closing(_opened(path)) as file, _readable(path):
        points = int(file.get_header(index).point_count)
        if not 0 <= points < MOST_POINTS:
            raise ScanError(f"the scan {path} declares {points} points, which is too many.")
        if points == 0:
            raise ScanError(f"the scan {path} holds no points in its station {index}.")
        return dict(file.read_scan_raw(index, ignore_unsupported_fields=True))


def _scan(path: Path, columns: Mapping[str, NDArray[Any]]) -> Scan:
    """Points and attributes; rows that are marked invalid become NaN."""
    with np.errstate(over="ignore", invalid="ignore"):
        if all(name in columns for name in CARTESIAN):
            points = np.column_stack([columns[name] for name in CARTESIAN]).astype(np.float64)
        elif all(name in columns for name in SPHERICAL):
            range_m, azimuth, elevation = (columns[name].astype(np.float64) for name in SPHERICAL)
            level_m = range_m * np.cos(elevation)
            points = np.column_stack(
                [level_m * np.cos(azimuth), level_m * np.sin(azimuth), range_m * np.sin(elevation)]
            )
        else:
            raise ScanError(f"the scan {path} has neither cartesian nor spherical coordinates.")
    for name in INVALID:
        if name in columns:
            points[columns[name] != 0] = np.nan
    used = {*CARTESIAN, *SPHERICAL, *INVALID}
    others = {name: np.ascontiguousarray(c) for name, c in columns.items() if name not in used}
    return Scan(scan_of_rows(path, points).points, others)
