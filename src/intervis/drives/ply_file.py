"""Reading the vertices of PLY files: ascii, binary little endian, binary big endian."""

from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from intervis.drives.scan import Scan, scan_of_table
from intervis.errors import ScanError

ORDERS = {"ascii": "=", "binary_little_endian": "<", "binary_big_endian": ">"}
TYPES = {
    **{"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"},
    **{"int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4"},
    **{"float": "f4", "double": "f8", "float32": "f4", "float64": "f8"},
}
LONGEST_HEADER = 1000
"""Lines after which a header without its last line is rejected."""


class _BrokenError(Exception):
    """An invalid PLY file; the message is the end of a sentence."""


@dataclass
class _Element:
    """An element of the header: name, count, and properties in order."""

    name: str
    count: int
    properties: list[tuple[str, str]] = field(default_factory=list)

    def dtype(self, order: str) -> np.dtype[Any]:
        """Type of one row in the file's byte order."""
        if any(kind == "list" for _, kind in self.properties):
            raise _BrokenError(f"its {self.name} has a list property, which is not supported")
        return np.dtype([(name, order + kind) for name, kind in self.properties])


def read_ply(path: Path) -> Scan:
    """Read the vertices of a PLY file: x, y, z as points, other properties as attributes.

    Raises
    ------
    ScanError
        The header is invalid, the data is truncated, a vertex has a list property, or there are no
        vertices.
    """
    try:
        with path.open("rb") as file:
            order, elements = _read_header(file)
            table = _read_vertices(file, order, elements)
    except _BrokenError as error:
        raise ScanError(f"the scan {path} is not a readable PLY file: {error}.") from None
    return scan_of_table(path, table)


def _read_header(file: BinaryIO) -> tuple[str, list[_Element]]:
    """Format and elements; leaves the file at the start of the data."""
    if file.readline(16).strip() != b"ply":
        raise _BrokenError('its first line is not "ply"')
    order, elements = "", list[_Element]()
    for _ in range(LONGEST_HEADER):
        line = file.readline(4096).decode("ascii", "replace").strip()
        match line.split():
            case ["end_header"]:
                break
            case ["format", word, _] if word in ORDERS:
                order = word
            case ["comment" | "obj_info", *_]:
                pass
            case ["element", name, count] if count.isdecimal() and len(count) < 13:
                elements.append(_Element(name, int(count)))
            case ["property", "list", _, _, name] if elements:
                elements[-1].properties.append((name, "list"))
            case ["property", kind, name] if elements and kind in TYPES:
                elements[-1].properties.append((name, TYPES[kind]))
            case _:
                raise _BrokenError(f"its header has the invalid line {line[:60]!r}")
    else:
        raise _BrokenError("its header has no end_header")
    if not order:
        raise _BrokenError("its header names no format")
    for element in elements:
        names = [name for name, _ in element.properties]
        if len(set(names)) < len(names):
            raise _BrokenError(f"its {element.name} names a property twice")
    return order, elements


def _read_vertices(file: BinaryIO, order: str, elements: list[_Element]) -> NDArray[Any]:
    """The rows of the element "vertex"; elements before it are skipped."""
    for element in elements:
        if element.name == "vertex":
            row = element.dtype(ORDERS[order])
            read = _read_text_rows if order == "ascii" else _read_binary_rows
            return read(file, row, element.count)
        if order == "ascii":
            for _ in range(element.count):
                if not file.readline():
                    raise _BrokenError("it ends before its vertices")
        else:
            file.seek(element.count * element.dtype(ORDERS[order]).itemsize, 1)
    raise _BrokenError('its header has no element "vertex"')


def _read_binary_rows(file: BinaryIO, row: np.dtype[Any], count: int) -> NDArray[Any]:
    start = file.tell()
    left_bytes = max(0, file.seek(0, 2) - start)
    if count * row.itemsize > left_bytes:
        raise _BrokenError(
            f"it is truncated: {count} vertices need {count * row.itemsize} bytes,"
            f" but it has {left_bytes}"
        )
    file.seek(start)
    table = np.frombuffer(file.read(count * row.itemsize), dtype=row)
    return table.astype(row.newbyteorder("="))


def _read_text_rows(file: BinaryIO, row: np.dtype[Any], count: int) -> NDArray[Any]:
    lines = [line for line in islice(file, count) if line.strip()]
    if len(lines) < count:
        raise _BrokenError(f"it is truncated: it declares {count} vertices and has {len(lines)}")
    if count == 0:
        return np.empty(0, row)
    try:
        return np.atleast_1d(np.loadtxt(lines, dtype=row, comments=None))
    except (ValueError, OverflowError, UnicodeDecodeError) as error:
        raise _BrokenError(f"its vertices do not parse ({str(error).splitlines()[0]})") from None
