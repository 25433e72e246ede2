"""Targets from files: named places as CSV, or the points of a scan file."""

import csv
import math
from pathlib import Path

import numpy as np

from intervis.arrays import LARGEST_M, Float64Array, finite_rows
from intervis.drives.calibration import read_lines
from intervis.drives.scan_file import read_scan
from intervis.errors import CalibrationError, DriveError, SceneError
from intervis.sight import Scene
from intervis.uses.routes.survey import distance_to_scans

FARTHEST_M = 150.0
"""A target that is farther from every scan lies outside the scene."""


def read_targets(path: Path) -> tuple[list[str], Float64Array]:
    """Names and places (M, 3) of targets, in the file's frame, metres.

    A ``.csv`` has a heading with ``x``, ``y``, ``z`` and maybe ``name``; others are scan files.
    Targets without a name have their number, from 1.

    Raises
    ------
    DriveError
        There is no such file.
    CalibrationError
        A line of the CSV does not parse.
    ScanError
        The scan file cannot be read.
    """
    if not path.exists():
        raise DriveError(f"there are no targets at {path}: check the path.")
    if path.suffix.lower() != ".csv":
        scan = read_scan(path).points
        places = scan[finite_rows(scan), :3].astype(np.float64)
        return [str(nth) for nth in range(1, len(places) + 1)], places
    rows = read_rows(path)
    if not rows or not {"x", "y", "z"} <= set(rows[0]):
        raise CalibrationError(f"{path}: targets need a heading with x, y, z, and rows below it.")
    names = [row.get("name") or str(nth) for nth, row in enumerate(rows, start=1)]
    return names, np.array([_place(path, nth, row) for nth, row in enumerate(rows, start=1)])


def read_rows(path: Path) -> list[dict[str, str]]:
    """Rows of a CSV file by the names of its heading; empty lines are left out.

    Raises
    ------
    CalibrationError
        The file does not parse, two columns have one name, or a row has more values than the
        heading.
    """
    lines = [line for line in read_lines(path) if line.strip()]
    try:
        rows = list(csv.DictReader(lines, skipinitialspace=True))
    except csv.Error as error:
        raise CalibrationError(f"{path} does not parse as CSV ({error}).") from None
    heads = [name.strip() for name in next(csv.reader(lines[:1], skipinitialspace=True), [])]
    if len(heads) == 1 and any(mark in heads[0] for mark in ";\t"):
        raise CalibrationError(f"{path}: separate the columns by commas, got {heads[0][:40]!r}.")
    twice = [name for name in heads if name and heads.count(name) > 1]
    if twice:
        raise CalibrationError(f"{path}: two columns are called {twice[0][:40]!r}.")
    if any(None in row for row in rows):
        raise CalibrationError(f"{path}: a row has more values than the heading.")
    return rows


def cell_number(path: Path, row: str, column: str, text: object) -> float | None:
    """A number of a row; None where the cell is empty.

    Raises
    ------
    CalibrationError
        It is no number, not finite, or larger than `LARGEST_M`; the message names file, row and
        column.

    Examples
    --------
    >>> cell_number(Path("a.csv"), "agent 1", "yaw_deg", " 90"), cell_number(Path(), "", "", "")
    (90.0, None)
    """
    if text is None or (isinstance(text, str) and not text.strip()):
        return None
    try:
        is_number = isinstance(text, str | int | float) and not isinstance(text, bool)
        value = float(text) if is_number else math.nan  # type: ignore[arg-type]
    except (ValueError, OverflowError):
        value = math.nan
    if not abs(value) <= LARGEST_M:  # nor is NaN
        raise CalibrationError(f"{path}, {row}: {column} must be a number, got {str(text)[:40]!r}.")
    return value


def _place(path: Path, nth: int, row: dict[str, str]) -> list[float]:
    try:
        place = [float(row[axis]) for axis in "xyz"]
    except (TypeError, ValueError):
        place = [math.nan]
    if not all(abs(value) <= LARGEST_M for value in place):  # nor is NaN
        raise CalibrationError(f"{path}, target {nth}: x, y and z must be numbers in metres.")
    return place


def check_targets_in_scene(scene: Scene, points: Float64Array) -> None:
    """Raise where targets lie outside the scene.

    Raises
    ------
    SceneError
        A target is farther than `FARTHEST_M` from every scan.
    """
    far = distance_to_scans(scene, points) > FARTHEST_M
    if far.any():
        first = ", ".join(f"{value:.1f}" for value in points[far][0])
        raise SceneError(
            f"{int(far.sum()):,} of {len(points):,} targets lie more than {FARTHEST_M:g} m from"
            f" every scan, the first at ({first}): give them in the frame of the drive's poses, or"
            " leave them out."
        )
