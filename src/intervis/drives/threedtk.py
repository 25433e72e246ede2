"""Stations as 3DTK writes them: ``scanNNN.3d`` with points, ``scanNNN.pose`` with the place.

Lengths are centimetres. Axes are left-handed: x right, y up, z ahead. A pose holds a translation
and three angles in degrees, of the rotations about x, y and z: R = Rx Ry Rz.
Source: 3DTK, EulerToMatrix4.
"""

import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from intervis.arrays import Float64Array
from intervis.drives.calibration import parse_numbers, read_lines
from intervis.drives.regular_file import open_regular
from intervis.drives.scan import Scan, scan_of_rows
from intervis.errors import CalibrationError, ScanError
from intervis.transform import rigid

log = logging.getLogger(__name__)

ENDING = ".3d"
POSE_ENDING = ".pose"

AXES = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Our x forward, y left, z up from 3DTK's x right, y up, z ahead; a reflection."""

METRES = 0.01
FARTHEST = 1e11
"""Numbers of a pose at most, in centimetres."""

PILE_M, BEFORE_M, PILE_SHARE = 0.02, 1.0, 1e-3
"""Ranges that mean no return: at least this share of all lies within `PILE_M` of the largest, and
fewer in the `BEFORE_M` before them. Scanners of 15 bits of millimetres send 32.75 to 32.767 m."""


def read_3d(path: Path, velo_from_file: Float64Array | None = None) -> Scan:
    """Read a station's points; rows that mean no return become NaN.

    Raises
    ------
    ScanError
        A line does not hold three numbers or more, or there are no points.
    """
    with open_regular(path) as file:
        lines = [line for line in file if line.strip()]
    if lines and len(_numbers(lines[0])) < 3:
        del lines[0]  # some writers put the number of points first
    if not lines:
        raise ScanError(f"the scan {path} holds no points.")
    columns = min(4, max(3, len(lines[0].split())))
    try:
        rows = np.loadtxt(lines, comments=None, usecols=range(columns), ndmin=2)
    except (ValueError, OverflowError) as error:
        reason = str(error).splitlines()[0]
        raise ScanError(f"the scan {path} does not parse as points of 3DTK ({reason}).") from None
    with np.errstate(over="ignore", invalid="ignore"):
        rows[:, :3] = rows[:, :3] @ AXES.T * METRES
        _mark_no_returns(path, rows)
    return scan_of_rows(path, rows, ("reflectance",)[: columns - 3], velo_from_file)


def _numbers(line: bytes) -> list[float]:
    try:
        return [float(word) for word in line.split()[:3]]
    except ValueError:
        return []


def _mark_no_returns(path: Path, rows: NDArray[Any]) -> None:
    """Set the coordinates of rows to NaN whose range is the scanner's sign for no return."""
    range_m = np.linalg.norm(rows[:, :3], axis=1)
    largest_m = np.max(range_m, where=np.isfinite(range_m), initial=0.0)
    pile = range_m > largest_m - PILE_M
    before = (range_m > largest_m - PILE_M - BEFORE_M) & ~pile
    count = int(np.count_nonzero(pile))
    if count >= max(8.0, PILE_SHARE * len(rows)) and count > np.count_nonzero(before):
        rows[pile, :3] = np.nan
        log.info(
            "%s: %d ranges near %.2f m mark beams without a return and become NaN.",
            *(path, count, largest_m),
        )


def station_poses(scan_paths: Mapping[int, Path]) -> tuple[dict[int, Float64Array], list[Path]]:
    """Poses of stations from the files beside their points, and these files.

    Parameters
    ----------
    scan_paths : mapping of int to Path
        Scan files by frame number.

    Returns
    -------
    poses : dict of int to (4, 4) float64 array
        world_from_velo, of the stations that have a pose.
    files : list of Path

    Raises
    ------
    CalibrationError
        A file of a pose does not hold six numbers.
    """
    poses, files = {}, []
    for number, path in scan_paths.items():
        pose_path = path.with_suffix(POSE_ENDING)
        if pose_path.is_file():
            poses[number] = _read_pose(pose_path)
            files.append(pose_path)
    return poses, files


def _read_pose(path: Path) -> Float64Array:
    values: list[float] = []
    for line_number, line in enumerate(read_lines(path), start=1):
        values += parse_numbers(line, path, line_number)
    if len(values) != 6 or max(map(abs, values)) > FARTHEST:
        raise CalibrationError(
            f"{path} does not hold a translation in centimetres and three angles in degrees."
        )
    rotation = AXES @ euler_xyz(*values[3:]) @ AXES.T
    return rigid(rotation, AXES @ values[:3] * METRES)


def euler_xyz(x_deg: float, y_deg: float, z_deg: float) -> Float64Array:
    """(3, 3) rotation Rx Ry Rz.

    Examples
    --------
    >>> euler_xyz(0, 0, 90).round(9).tolist()
    [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    >>> np.allclose(euler_xyz(90, 90, 0) @ [0, 0, 1], [1, 0, 0])  # Ry: z to x; Rx leaves x
    True
    """
    (sx, sy, sz), (cx, cy, cz) = (
        function(np.radians([x_deg, y_deg, z_deg])) for function in (np.sin, np.cos)
    )
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    return np.asarray(about_x @ about_y @ about_z, dtype=np.float64)
