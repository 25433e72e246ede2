"""The header of a LAS or LAZ file, checked against the file before a library reads it.

laspy and lazrs believe what a header declares: numbers of records, of chunks and of points. Here
all of them are held against the size of the file. Source: ASPRS LAS 1.4 R15; laszip.
"""

import struct
from pathlib import Path
from typing import BinaryIO, NamedTuple

import numpy as np

from intervis.drives.regular_file import open_regular
from intervis.errors import DriveError, ScanError

MAGIC = b"LASF"
SMALLEST_HEADER, HEADER_OF_1_4 = 227, 375
VLR_HEAD = struct.Struct("<H16sHH32s")
LASZIP = (b"laszip encoded", 22204)
GEO_KEYS, WKT = (b"LASF_Projection", 34735), (b"LASF_Projection", 2112)
LINEAR_UNITS = (3076, 4099)
"""GeoTIFF keys of the units of coordinates and heights."""

FEET = (9002, 9003)
COMPRESSED = 0x80
WITHOUT_TIME = (0, 2)
SIZE_OF_FORMAT = (20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67)
POINTS_PER_BYTE = 100
"""Compressed points in a byte of a file at most: memory and time are taken for what it declares."""


class LasHeader(NamedTuple):
    """What is needed of a header.

    Attributes
    ----------
    points : int
    point_bytes : int
        Size of a point without compression.
    start : int
        Where the points start.
    compression : bytes
        The record of the compression; empty without.
    has_time : bool
    in_feet : bool
        Whether the file says that its coordinates or heights are in feet.
    """

    points: int
    point_bytes: int
    start: int
    compression: bytes
    has_time: bool
    in_feet: bool


def read_las_header(path: Path) -> LasHeader:
    """Read a header, and check that the file can hold what it declares.

    Raises
    ------
    ScanError
        The file is no LAS, or its header contradicts it.
    """
    try:
        with open_regular(path) as file:
            return _read(path, file, file.seek(0, 2))
    except OSError as error:
        raise ScanError(f"cannot read {path}: {error.strerror}.") from None


def _read(path: Path, file: BinaryIO, size: int) -> LasHeader:
    file.seek(0)
    head = file.read(HEADER_OF_1_4)
    if len(head) < SMALLEST_HEADER or head[:4] != MAGIC:
        raise ScanError(f"{path} is no LAS file: it does not start like one.")
    minor = head[25]
    head_bytes, start, records, kind, point_bytes, points = struct.unpack_from("<HIIBHI", head, 94)
    if minor >= 4:
        if len(head) < HEADER_OF_1_4:
            raise ScanError(f"{path} is cut within its header.")
        points = struct.unpack_from("<Q", head, 247)[0]
    is_compressed, kind = bool(kind & COMPRESSED), kind & 0x3F
    if kind >= len(SIZE_OF_FORMAT) or point_bytes < SIZE_OF_FORMAT[kind]:
        raise ScanError(
            f"{path} has points of format {kind} in {point_bytes} bytes, which is none."
        )
    room = size - start
    most = room * POINTS_PER_BYTE if is_compressed else room // point_bytes
    if not SMALLEST_HEADER <= head_bytes <= start <= size or points > most:
        raise ScanError(
            f"{path} declares {points} points behind {start} bytes of header, it has {size} bytes."
        )
    scales = struct.unpack_from("<3d3d", head, 131)
    if not np.isfinite(scales).all() or max(map(abs, scales)) > 1e12:
        raise ScanError(f"{path} has scales or offsets that are no numbers of metres.")
    vlrs = _records(path, file, head_bytes, start, records)
    if is_compressed:
        _check_compression(path, file, vlrs.get(LASZIP), (start, size, points, point_bytes))
    compression = vlrs[LASZIP] if is_compressed else b""
    has_time = kind not in WITHOUT_TIME
    return LasHeader(points, point_bytes, start, compression, has_time, _in_feet(vlrs))


def _records(
    path: Path, file: BinaryIO, first: int, end: int, count: int
) -> dict[tuple[bytes, int], bytes]:
    """The variable length records between the header and the points."""
    found, place = {}, first
    for _ in range(count):
        file.seek(place)
        head = file.read(VLR_HEAD.size)
        place += VLR_HEAD.size
        if len(head) < VLR_HEAD.size or place > end:
            raise ScanError(f"{path} declares {count} records in {end - first} bytes.")
        _, user, number, size, _ = VLR_HEAD.unpack(head)
        content = file.read(size)
        place += size
        if len(content) < size or place > end:
            raise ScanError(f"{path} has a record that is longer than its header.")
        found[(user.split(b"\0")[0], number)] = content
    return found


def _check_compression(
    path: Path, file: BinaryIO, record: bytes | None, sizes: tuple[int, int, int, int]
) -> None:
    """The record of the compression, and the number of chunks in the table of a file."""
    start, size, points, point_bytes = sizes
    if record is None or len(record) < 34:
        raise ScanError(f"{path} is compressed, and its header does not say how.")
    (items,) = struct.unpack_from("<H", record, 32)
    (chunk_points,) = struct.unpack_from("<I", record, 12)
    if len(record) < 34 + 6 * items or chunk_points == 0:
        raise ScanError(f"{path} has a damaged record of its compression.")
    widths = [struct.unpack_from("<HHH", record, 34 + 6 * nth)[1] for nth in range(items)]
    if sum(widths) != point_bytes:
        raise ScanError(f"{path} has compressed points of {sum(widths)} bytes, not {point_bytes}.")
    if not points:
        return
    file.seek(start)
    table = int.from_bytes(file.read(8), "little", signed=True)
    if table == -1:  # written at the end of a stream
        file.seek(size - 8)
        table = int.from_bytes(file.read(), "little", signed=True)
    if not start < table <= size - 8:
        raise ScanError(f"{path} has a damaged table of chunks: it would lie at byte {table}.")
    file.seek(table + 4)
    chunks = int.from_bytes(file.read(4), "little")
    if chunks * point_bytes > size:  # the first point of a chunk is not compressed
        raise ScanError(f"{path} has a damaged table of {chunks} chunks.")


def _in_feet(records: dict[tuple[bytes, int], bytes]) -> bool:
    keys = records.get(GEO_KEYS, b"")
    numbers = np.frombuffer(keys[: len(keys) // 8 * 8], "<u2").reshape(-1, 4)
    if any(key in LINEAR_UNITS and value in FEET for key, _, _, value in numbers.tolist()):
        return True
    return b"foot" in records.get(WKT, b"").lower()


def check_las_times(path: Path, header: LasHeader) -> None:
    """Refuse a file that cannot be cut into scans.

    Raises
    ------
    DriveError
        It has no points, no times, or coordinates in feet.
    """
    if header.points == 0:
        raise DriveError(f"{path} holds no points.")
    if not header.has_time:
        raise DriveError(f"{path} has no times of its points, which tell where the scanner stood.")
    if header.in_feet:
        raise DriveError(
            f"{path} has coordinates in feet: convert it and its trajectory to metres."
        )
