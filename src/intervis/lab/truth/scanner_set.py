"""Several scanners of one moment, with the pose of each: a TOML file, or a folder with poses.

The file lists the scans. Paths are relative to it. A pose is a 4x4 matrix, or a translation with
roll, pitch and yaw about the fixed axes x, y, z; without one it is the identity::

    pairs = ["roof:left", "left:roof"]   # optional: known scanner : reference scanner

    [[scanner]]
    name = "roof"
    scan = "roof.pcd"

    [[scanner]]
    name = "left"
    scan = "left.pcd"
    translation_m = [0.0, 0.6, -0.4]
    roll_pitch_yaw_deg = [0.0, 45.0, 90.0]

The scene's frame should be level (z up): methods may use the direction of gravity.
"""

import hashlib
import tomllib
from dataclasses import dataclass
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from intervis.arrays import Float32Array, Float64Array
from intervis.drives import Drive
from intervis.drives.scan_file import read_scan
from intervis.errors import DriveError, PoseError, SettingsError
from intervis.lab.truth.pairs import NamedPairs, Pairs, split_pairs
from intervis.transform import checked_pose, rigid

MAX_FRAMES = 6
"""A folder of more scans is taken as a drive: its pairs must be named."""


@dataclass(frozen=True, eq=False)
class Scanner:
    """One scan of the moment.

    Attributes
    ----------
    name : str
    points : (N, 3) float32 array
        In the scanner's frame, metres; may hold non-finite rows.
    pose : (4, 4) float64 array
        scene_from_scanner.
    """

    name: str
    points: Float32Array
    pose: Float64Array


@dataclass(frozen=True, eq=False)
class ScannerSet:
    """The scanners of one moment.

    Attributes
    ----------
    name : str
        Name of the file or the folder.
    scanners : tuple of Scanner
    pairs : tuple of (str, str)
        Names of the known and the reference scanner of each pair to evaluate, where the caller
        names none.
    """

    name: str
    scanners: tuple[Scanner, ...]
    pairs: NamedPairs

    def scanner(self, name: str) -> Scanner:
        """The scanner of that name.

        Raises
        ------
        DriveError
            There is none.
        """
        for scanner in self.scanners:
            if scanner.name == name:
                return scanner
        names = ", ".join(scanner.name for scanner in self.scanners)
        raise DriveError(f"{self.name} has no scanner {name!r}: its scanners are {names}.")

    def index(self, name: str) -> int:
        """Position of the scanner of that name."""
        return self.scanners.index(self.scanner(name))

    def fingerprint(self) -> dict[str, Any]:
        """Identification of the content: names, and SHA-256 over all points and poses."""
        digest = hashlib.sha256()
        for scanner in self.scanners:
            digest.update(scanner.name.encode())
            digest.update(np.ascontiguousarray(scanner.points).tobytes() + scanner.pose.tobytes())
        return {
            "layout": "scanners",
            "name": self.name,
            "scanners": [scanner.name for scanner in self.scanners],
            "points": [len(scanner.points) for scanner in self.scanners],
            "digest": digest.hexdigest(),
        }


class _Entry(BaseModel):
    model_config = ConfigDict(extra="forbid")

    name: str = Field(min_length=1, pattern=r"^[^:,]+$")
    scan: str = Field(min_length=1)
    scene_from_scanner: list[list[float]] | None = None
    translation_m: tuple[float, float, float] | None = None
    roll_pitch_yaw_deg: tuple[float, float, float] | None = None


class _File(BaseModel):
    model_config = ConfigDict(extra="forbid")

    pairs: list[str] = []
    scanner: list[_Entry] = Field(min_length=2)


def read_scanners(path: Path) -> ScannerSet:
    """Read the scanners that a TOML file lists.

    Raises
    ------
    SettingsError
        The file cannot be read, is not TOML, has an unknown or invalid entry, or two scanners of
        one name.
    PoseError
        A pose is not a rigid motion.
    ScanError
        A scan cannot be read.
    DriveError
        A pair names a scanner that is not listed.
    """
    listed = _parsed(path)
    names = [entry.name for entry in listed.scanner]
    if len(set(names)) < len(names):
        raise SettingsError(f"{path} lists two scanners of one name: {', '.join(names)}.")
    scanners = tuple(
        Scanner(entry.name, read_scan(path.parent / entry.scan).points, _pose(entry, path))
        for entry in listed.scanner
    )
    pairs = parsed_scanner_pairs(",".join(listed.pairs)) if listed.pairs else None
    pairs = pairs or tuple(permutations(names, 2))
    return checked_pairs(ScannerSet(path.stem, scanners, pairs))


def scanners_of_drive(drive: Drive, pairs: Pairs | None = None) -> ScannerSet:
    """The scans of a folder with poses as scanners of one moment, named by frame number.

    Parameters
    ----------
    drive : Drive
        With the pose of every scan that is used, scene_from_scanner.
    pairs : tuple of (int, int), optional
        Frame numbers; only these scans are read. Default: all pairs, in a folder of up to six
        scans.

    Raises
    ------
    DriveError
        A scan has no pose, there is no such frame, or pairs must be named.
    """
    if pairs is None and not 2 <= len(drive) <= MAX_FRAMES:
        raise DriveError(
            f"{drive.name} holds {len(drive)} scans: name the pairs of scans of one moment, as in"
            " --pairs 0:1."
        )
    chosen = tuple(permutations(drive.frame_numbers, 2)) if pairs is None else pairs
    scanners = []
    for number in sorted({number for pair in chosen for number in pair}):
        frame = drive[number]
        if frame.pose is None:
            raise DriveError(
                f"frame {number} of {drive.name} has no pose: put a poses.txt beside the scans, or"
                " list the scans with their poses in a TOML file."
            )
        scanners.append(Scanner(str(number), frame.points, frame.pose))
    named = tuple((str(known), str(reference)) for known, reference in chosen)
    return checked_pairs(ScannerSet(drive.name, tuple(scanners), named))


def parsed_scanner_pairs(text: str) -> NamedPairs:
    """Pairs of names from ``roof:left,left:roof``.

    Raises
    ------
    SettingsError
        The text has another form.

    Examples
    --------
    >>> parsed_scanner_pairs("roof:left, left:roof")
    (('roof', 'left'), ('left', 'roof'))
    """
    form = (
        "pairs of scanners must be KNOWN:REFERENCE with commas between, as in roof:left,left:roof"
    )
    return split_pairs(text, form)


def checked_pairs(scanners: ScannerSet) -> ScannerSet:
    """The same scanners; every pair names two of them.

    Raises
    ------
    DriveError
        A pair names a scanner that is not there, or one scanner twice.
    """
    for known, reference in scanners.pairs:
        if scanners.scanner(known) is scanners.scanner(reference):
            raise DriveError(f"scanner {known!r} cannot be its own reference: name two scanners.")
    return scanners


def _parsed(path: Path) -> _File:
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise SettingsError(f"cannot read the scanners {path}: {error.strerror}.") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise SettingsError(f"{path} is not valid TOML: {error}.") from None
    try:
        return _File(**content)
    except (ValidationError, TypeError) as error:
        raise SettingsError(f"{path}: {_first_error(error)}.") from None


def _first_error(error: ValidationError | TypeError) -> str:
    if isinstance(error, TypeError):
        return str(error)
    first = error.errors()[0]
    where = " ".join(str(part) for part in first["loc"])
    return f"{where}: {first['msg'].lower()}"


def _pose(entry: _Entry, path: Path) -> Float64Array:
    name = f"the pose of scanner {entry.name!r} in {path}"
    parts = (entry.translation_m, entry.roll_pitch_yaw_deg)
    if entry.scene_from_scanner is not None:
        if any(part is not None for part in parts):
            raise PoseError(f"{name} is given twice: keep the matrix or translation and angles.")
        return checked_pose(entry.scene_from_scanner, name)
    from scipy.spatial.transform import Rotation  # 0.4 s to import

    angles_deg = entry.roll_pitch_yaw_deg or (0.0, 0.0, 0.0)
    rotation = Rotation.from_euler("xyz", angles_deg, degrees=True)  # fixed axes: roll first
    return checked_pose(rigid(rotation.as_matrix(), entry.translation_m or (0.0, 0.0, 0.0)), name)
