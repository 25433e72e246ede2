"""Reading PCD files (ascii, binary, binary_compressed) through pypcd4."""

import struct
from pathlib import Path
from typing import BinaryIO

import numpy as np

from intervis.drives.scan import Scan, scan_of_table
from intervis.errors import MissingExtraError, ScanError

PADDING = "#$%&~~"
"""What pypcd4 calls the columns that PCD's "_" declares as padding."""

LONGEST_HEADER = 100
"""Lines of header read before a file is taken for something else."""

LZF_RATIO = 88
"""LZF's three bytes stand for 264 at most."""


def read_pcd(path: Path) -> Scan:
    """A PCD file: x, y, z, and every other field as an attribute.

    Raises
    ------
    MissingExtraError
        pypcd4 (extra ``pcd``) is not installed.
    ScanError
        The header is broken, the data ends early, or there are no points.
    """
    try:
        from pypcd4.pypcd4 import PointCloud
    except ImportError:
        raise MissingExtraError("pypcd4", "pcd", "Reading a PCD file") from None
    promised = _promised_points(path)
    try:
        cloud = PointCloud.from_path(path)
        table = np.atleast_1d(cloud.pc_data)
    except Exception as error:  # whatever pypcd4, lzf, pydantic or numpy make of a broken file
        raise ScanError(
            f"the scan {path} is no readable PCD file ({type(error).__name__})."
        ) from None
    if len(table) != promised:
        raise ScanError(
            f"the scan {path} is truncated or broken: its header promises {promised} points,"
            f" it holds {len(table)}."
        )
    names = [name for name in table.dtype.names or () if not name.startswith(PADDING)]
    return scan_of_table(path, table[names])


def _promised_points(path: Path) -> int:
    """POINTS of the header, once it is clear that the file can hold them.

    pypcd4 takes the header's word for it: a short file would come back short, and a wild number
    would be allocated.
    """
    with path.open("rb") as file:
        header = _read_header(file)
        start = file.tell()
        packed_sizes = file.read(8)
        data_bytes = file.seek(0, 2) - start
    missing = [key for key in ("FIELDS", "SIZE", "TYPE", "POINTS", "DATA") if not header.get(key)]
    if missing:
        raise ScanError(f"the scan {path} is no PCD file: its header has no {' '.join(missing)}.")
    try:
        points, needed_bytes = _needed_bytes(header, packed_sizes)
    except ValueError:
        raise ScanError(
            f"the scan {path} has a broken PCD header: SIZE, COUNT, POINTS and the sizes of packed"
            " data do not agree."
        ) from None
    if needed_bytes > data_bytes:
        raise ScanError(
            f"the scan {path} is truncated: the {points} points of its header need {needed_bytes}"
            f" bytes, {data_bytes} are there."
        )
    return points


def _read_header(file: BinaryIO) -> dict[str, list[str]]:
    """Words by key; leaves the file where the data starts."""
    header: dict[str, list[str]] = {}
    for _ in range(LONGEST_HEADER):
        key, *values = file.readline(4096).decode("ascii", "replace").split() or [""]
        header.setdefault(key, values)
        if key == "DATA":
            break
    return header


def _needed_bytes(header: dict[str, list[str]], packed_sizes: bytes) -> tuple[int, int]:
    """Points, and the least bytes of data that hold them; ValueError where numbers disagree."""
    points = int(header["POINTS"][0])
    sizes = [int(size) for size in header["SIZE"]]
    counts = [int(count) for count in header.get("COUNT", ["1"] * len(sizes))]
    table_bytes = points * sum(size * count for size, count in zip(sizes, counts, strict=True))
    if points < 0:
        raise ValueError
    match header["DATA"][0]:
        case "ascii":
            return points, max(0, 2 * points * sum(counts) - 1)  # a digit and a blank a number
        case "binary":
            return points, table_bytes
    if points == 0:
        return 0, 0
    packed_bytes, unpacked_bytes = struct.unpack("<II", packed_sizes.ljust(8, b"\0"))
    if unpacked_bytes != table_bytes:
        raise ValueError
    return points, 8 + max(packed_bytes, unpacked_bytes // LZF_RATIO)
