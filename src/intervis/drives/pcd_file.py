"""Reading PCD files (ascii, binary, binary_compressed) with pypcd4."""

import struct
from pathlib import Path
from typing import BinaryIO

import numpy as np

from intervis.drives.scan import Scan, scan_of_table
from intervis.errors import MissingExtraError, ScanError

PADDING = "#$%&~~"
"""Start of the names that pypcd4 gives to padding columns, which PCD declares as "_"."""

LONGEST_HEADER = 100
"""Lines after which a header without its last line is rejected."""

LZF_RATIO = 88
"""Highest compression ratio of LZF: 3 bytes encode at most 264."""


def read_pcd(path: Path) -> Scan:
    """Read a PCD file: x, y, z as points, every other field as an attribute.

    Raises
    ------
    MissingExtraError
        pypcd4 (extra ``pcd``) is not installed.
    ScanError
        The header is invalid, the data is truncated, or there are no points.
    """
    try:
        from pypcd4.pypcd4 import PointCloud
    except ImportError:
        raise MissingExtraError("pypcd4", "pcd", "Reading a PCD file") from None
    declared = _declared_points(path)
    try:
        cloud = PointCloud.from_path(path)
        table = np.atleast_1d(cloud.pc_data)
    except Exception as error:  # pypcd4, lzf, pydantic and numpy raise various types
        raise ScanError(
            f"the scan {path} is not a readable PCD file ({type(error).__name__})."
        ) from None
    if len(table) != declared:
        raise ScanError(
            f"the scan {path} is truncated or invalid: its header declares {declared} points, but"
            f" it holds {len(table)}."
        )
    names = [name for name in table.dtype.names or () if not name.startswith(PADDING)]
    return scan_of_table(path, table[names])


def _declared_points(path: Path) -> int:
    """POINTS of the header, after a check that the file is large enough to hold them.

    pypcd4 does not check this: it would return fewer points from a truncated file, and allocate
    memory for any number in the header.
    """
    with path.open("rb") as file:
        header = _read_header(file)
        start = file.tell()
        packed_sizes = file.read(8)
        data_bytes = file.seek(0, 2) - start
    missing = [key for key in ("FIELDS", "SIZE", "TYPE", "POINTS", "DATA") if not header.get(key)]
    if missing:
        raise ScanError(
            f"the scan {path} is not a PCD file: its header has no {' '.join(missing)}."
        )
    try:
        points, needed_bytes = _needed_bytes(header, packed_sizes)
    except ValueError:
        raise ScanError(
            f"the scan {path} has an invalid PCD header: SIZE, COUNT, POINTS and the sizes of the"
            " compressed data are inconsistent."
        ) from None
    if needed_bytes > data_bytes:
        raise ScanError(
            f"the scan {path} is truncated: the {points} points of its header need {needed_bytes}"
            f" bytes, but it has {data_bytes}."
        )
    return points


def _read_header(file: BinaryIO) -> dict[str, list[str]]:
    """Values of the header by key; leaves the file at the start of the data."""
    header: dict[str, list[str]] = {}
    for _ in range(LONGEST_HEADER):
        key, *values = file.readline(4096).decode("ascii", "replace").split() or [""]
        header.setdefault(key, values)
        if key == "DATA":
            break
    return header


def _needed_bytes(header: dict[str, list[str]], packed_sizes: bytes) -> tuple[int, int]:
    """Number of points and the minimum size of their data; ValueError if inconsistent."""
    points = int(header["POINTS"][0])
    sizes = [int(size) for size in header["SIZE"]]
    counts = [int(count) for count in header.get("COUNT", ["1"] * len(sizes))]
    table_bytes = points * sum(size * count for size, count in zip(sizes, counts, strict=True))
    if points < 0:
        raise ValueError
    match header["DATA"][0]:
        case "ascii":
            return points, max(0, 2 * points * sum(counts) - 1)  # digit and separator
        case "binary":
            return points, table_bytes
    if points == 0:
        return 0, 0
    packed_bytes, unpacked_bytes = struct.unpack("<II", packed_sizes.ljust(8, b"\0"))
    if unpacked_bytes != table_bytes:
        raise ValueError
    return points, 8 + max(packed_bytes, unpacked_bytes // LZF_RATIO)
