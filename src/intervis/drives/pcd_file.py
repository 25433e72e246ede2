"""Reading PCD files (ascii, binary, binary_compressed)."""

import logging
import struct
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from intervis.arrays import Float64Array
from intervis.drives.kernels.lzf import unpack_lzf
from intervis.drives.pcd_header import PADDING, PcdError, PcdHeader, read_header
from intervis.drives.regular_file import open_regular
from intervis.drives.scan import Scan, scan_of_table
from intervis.errors import ScanError
from intervis.transform import rigid

log = logging.getLogger(__name__)

FARTHEST_M = 1e9
"""Coordinates of a VIEWPOINT at most: beyond any on Earth."""

LZF_RATIO = 88
"""Highest compression ratio of LZF: 3 bytes encode at most 264."""


def read_pcd(path: Path, velo_from_file: Float64Array | None = None) -> Scan:
    """Read a PCD file: x, y, z as points, every other field as an attribute.

    A field of several numbers becomes an attribute (N, numbers).

    Raises
    ------
    ScanError
        The header is invalid, the data is truncated, or there are no points.
    """
    return scan_of_table(path, read_table(path), velo_from_file)


def read_table(path: Path) -> NDArray[Any]:
    """The fields of all points of a PCD file, as they stand there, without padding.

    Raises
    ------
    ScanError
        The header is invalid, or the data is truncated.
    """
    try:
        with open_regular(path) as file:
            header = read_header(file)
            table = _READERS[header.encoding](file, header, path)
    except PcdError as error:
        raise ScanError(f"the scan {path} is not a readable PCD file: {error}.") from None
    return table[[name for name in table.dtype.names or () if not name.startswith(PADDING)]]


def read_viewpoint(path: Path) -> Float64Array | None:
    """The pose of the scanner in the header's VIEWPOINT; None where it is absent or the identity.

    Returns
    -------
    (4, 4) float64 array or None
        Position and orientation, as they stand in the file. Whether the points are in the scanner's
        frame or in the frame of the pose, the format does not say.

    Raises
    ------
    ScanError
        The header is invalid.
    """
    try:
        with open_regular(path) as file:
            words = read_header(file).viewpoint
    except PcdError as error:
        raise ScanError(f"the scan {path} is not a readable PCD file: {error}.") from None
    if not words:
        return None
    try:
        values = np.array([float(word) for word in words])
    except ValueError:
        values = np.zeros(0)
    position, quaternion_wxyz = values[:3], values[3:]
    is_pose = len(values) == 7 and np.abs(values).max() < FARTHEST_M  # False for NaN
    if not is_pose or not 1e-3 < np.linalg.norm(quaternion_wxyz) < 1e3:
        log.warning("%s: its VIEWPOINT is not a position and a quaternion, and is ignored.", path)
        return None
    rotation = rotation_of_quaternion(quaternion_wxyz)
    if np.allclose(rotation, np.eye(3), atol=1e-9) and not position.any():
        return None
    return rigid(rotation, position)


def rotation_of_quaternion(wxyz: NDArray[Any]) -> Float64Array:
    """(3, 3) rotation of a quaternion w, x, y, z of any length.

    Examples
    --------
    >>> rotation_of_quaternion(np.array([2.0, 0, 0, 2])).round(9).tolist()  # 90 degrees about z
    [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    """
    w, x, y, z = np.asarray(wxyz, dtype=np.float64) / np.linalg.norm(wxyz)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def _read_ascii(file: BinaryIO, header: PcdHeader, path: Path) -> NDArray[Any]:
    """The points of a text: one line each, numbers apart by any blanks."""
    row = header.row()
    values = sum(field.count for field in header.fields)
    _check_bytes(file, header, max(0, 2 * header.points * values - 1))  # digit and separator
    if header.points == 0:
        return np.empty(0, row)
    lines = [line for line in file if line.strip()]
    if len(lines) < header.points:
        raise PcdError(
            f"it is truncated: its header declares {header.points} points, but it holds"
            f" {len(lines)}"
        )
    words = len(lines[0].split())
    if len(lines) > header.points or words > values:
        log.warning(
            "%s: its header declares %d points of %d numbers, and it holds %d of %d: the surplus"
            " is left out.",
            *(path, header.points, values, len(lines), words),
        )
    return _parse_rows(lines[: header.points], row, values)


def _parse_rows(lines: list[bytes], row: np.dtype[Any], values: int) -> NDArray[Any]:
    columns = range(values)
    try:
        return np.atleast_1d(np.loadtxt(lines, dtype=row, comments=None, usecols=columns))
    except (ValueError, OverflowError):
        pass  # whole numbers may be written as 3.0, 1e3 or nan
    try:
        table = np.loadtxt(lines, dtype=np.float64, comments=None, usecols=columns, ndmin=2)
    except (ValueError, OverflowError) as error:
        raise PcdError(f"its points do not parse ({str(error).splitlines()[0]})") from None
    result = np.empty(len(table), row)
    start = 0
    with np.errstate(invalid="ignore", over="ignore"):
        for name in row.names or ():
            target = result[name]
            stop = start + (target.shape[1] if target.ndim == 2 else 1)
            column = table[:, start:stop].reshape(target.shape)
            if target.dtype.kind in "iu":
                limits = np.iinfo(target.dtype)
                column = np.clip(np.nan_to_num(column), limits.min, limits.max)
            target[...] = column
            start = stop
    return result


def _read_binary(file: BinaryIO, header: PcdHeader, path: Path) -> NDArray[Any]:
    row = header.row()
    _check_bytes(file, header, header.points * row.itemsize)
    return np.frombuffer(file.read(header.points * row.itemsize), row, header.points)


def _read_compressed(file: BinaryIO, header: PcdHeader, path: Path) -> NDArray[Any]:
    """Columns one after the other, packed; what packing cannot shrink is stored as it is."""
    if header.points == 0:
        return np.empty(0, header.row())
    row = header.row()
    sizes = file.read(8)
    packed_bytes, unpacked_bytes = struct.unpack("<II", sizes.ljust(8, b"\0"))
    padding = [field.is_padding for field in header.fields]
    whole_bytes = header.points * row.itemsize
    without_padding = whole_bytes - header.points * sum(
        field.size_bytes for field in header.fields if field.is_padding
    )
    if unpacked_bytes not in (whole_bytes, without_padding):
        raise PcdError(
            f"its {header.points} points need {whole_bytes} bytes, but its compressed data"
            f" declares {unpacked_bytes}"
        )
    _check_bytes(file, header, max(packed_bytes, -(-unpacked_bytes // LZF_RATIO)))
    packed = np.frombuffer(file.read(packed_bytes), np.uint8)
    if packed_bytes == unpacked_bytes:
        unpacked = packed
    else:
        unpacked = np.zeros(unpacked_bytes, np.uint8)
        if unpack_lzf(packed, unpacked) != unpacked_bytes:
            raise PcdError("its compressed data is invalid")
    left_out = unpacked_bytes != whole_bytes  # writers of PCL leave padding out
    table, start = np.zeros(header.points, row), 0
    for name, field, is_padding in zip(row.names or (), header.fields, padding, strict=True):
        if is_padding and left_out:
            continue
        stop = start + header.points * field.size_bytes
        column = unpacked[start:stop].view(field.kind)
        table[name] = column.reshape(table[name].shape)
        start = stop
    return table


_READERS = {"ascii": _read_ascii, "binary": _read_binary, "binary_compressed": _read_compressed}


def _check_bytes(file: BinaryIO, header: PcdHeader, needed_bytes: int) -> None:
    """Check that the file holds the declared data, before memory is taken for it."""
    start = file.tell()
    left_bytes = file.seek(0, 2) - start
    file.seek(start)
    if needed_bytes > left_bytes:
        raise PcdError(
            f"it is truncated: the {header.points} points of its header need {needed_bytes}"
            f" bytes, but it has {left_bytes}"
        )
