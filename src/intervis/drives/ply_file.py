"""Reading the vertices of PLY files: ascii, binary little endian, binary big endian."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from intervis.arrays import Float64Array, IntArray
from intervis.drives.regular_file import open_regular
from intervis.drives.scan import Scan, scan_of_table
from intervis.errors import ScanError

ORDERS = {"ascii": "=", "binary_little_endian": "<", "binary_big_endian": ">"}
TYPES = {
    **{"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"},
    **{"int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4"},
    **{"int64": "i8", "uint64": "u8", "float": "f4", "double": "f8"},
    **{"float32": "f4", "float64": "f8"},
}
LONGEST_HEADER = 1000
"""Lines after which a header without its last line is rejected."""


class _BrokenError(Exception):
    """An invalid PLY file; the message is the end of a sentence."""


@dataclass(frozen=True)
class _Property:
    """A property of the header: name, type, and the type of the count where it is a list."""

    name: str
    kind: str
    count_kind: str = ""


@dataclass
class _Element:
    """An element of the header: name, count, and properties in order."""

    name: str
    count: int
    properties: list[_Property] = field(default_factory=list)

    @property
    def has_lists(self) -> bool:
        """Whether rows differ in length."""
        return any(prop.count_kind for prop in self.properties)

    def row(self, order: str) -> np.dtype[Any]:
        """Type of one row without its lists, in the file's byte order."""
        return np.dtype(
            [(prop.name, order + prop.kind) for prop in self.properties if not prop.count_kind]
        )


def read_ply(path: Path, velo_from_file: Float64Array | None = None) -> Scan:
    """Read the vertices of a PLY file: x, y, z as points, other properties as attributes.

    Lists are passed over, those of the vertices too.

    Raises
    ------
    ScanError
        The header is invalid, the data is truncated, or there are no vertices.
    """
    try:
        with open_regular(path) as file:
            order, elements = _read_header(file)
            table = _read_vertices(file, order, elements)
    except _BrokenError as error:
        raise ScanError(f"the scan {path} is not a readable PLY file: {error}.") from None
    return scan_of_table(path, table, velo_from_file)


def _read_header(file: BinaryIO) -> tuple[str, list[_Element]]:
    """Format and elements; leaves the file at the start of the data."""
    if file.readline(16).removeprefix(b"\xef\xbb\xbf").strip() != b"ply":
        raise _BrokenError('its first line is not "ply"')
    order, elements = "", list[_Element]()
    for _ in range(LONGEST_HEADER):
        text = file.readline(4096)
        line = text.decode("ascii", "replace").strip()
        match line.split():
            case ["end_header"]:
                break
            case ["format", word, *_] if word in ORDERS:
                order = word
            case ["comment" | "obj_info", *_]:
                pass
            case [] if text:
                pass
            case ["element", name, count] if count.isdecimal() and len(count) < 13:
                elements.append(_Element(name, int(count)))
            case ["property", "list", count_kind, kind, name] if (
                elements and kind.lower() in TYPES and TYPES.get(count_kind.lower(), "f")[0] != "f"
            ):
                prop = _Property(name, TYPES[kind.lower()], TYPES[count_kind.lower()])
                elements[-1].properties.append(prop)
            case ["property", kind, name] if elements and kind.lower() in TYPES:
                elements[-1].properties.append(_Property(name, TYPES[kind.lower()]))
            case _:
                raise _BrokenError(f"its header has the invalid line {line[:60]!r}")
    else:
        raise _BrokenError("its header has no end_header")
    if not order:
        raise _BrokenError("its header names no format")
    for element in elements:
        names = [prop.name for prop in element.properties]
        if len(set(names)) < len(names):
            raise _BrokenError(f"its {element.name} names a property twice")
    return order, elements


def _read_vertices(file: BinaryIO, order: str, elements: list[_Element]) -> NDArray[Any]:
    """The rows of the element "vertex"; elements before it are skipped."""
    names = [element.name for element in elements]
    if "vertex" not in names:
        raise _BrokenError('its header has no element "vertex"')
    before, vertex = elements[: names.index("vertex")], elements[names.index("vertex")]
    if not vertex.row(ORDERS[order]).names:
        raise _BrokenError("its vertices have no coordinates")
    if order == "ascii":
        lines = (line for line in file if line.strip())
        for element in before:
            if element.properties and sum(1 for _ in islice(lines, element.count)) < element.count:
                raise _BrokenError("it ends before its vertices")
        return _read_text_rows(lines, vertex)
    for element in before:
        _skip(file, element, ORDERS[order])
    if vertex.has_lists:
        return _read_rows_with_lists(file, vertex, ORDERS[order])
    return _read_binary_rows(file, vertex.row(ORDERS[order]), vertex.count)


def _left_bytes(file: BinaryIO) -> int:
    start = file.tell()
    left_bytes = max(0, file.seek(0, 2) - start)
    file.seek(start)
    return left_bytes


def _read_binary_rows(file: BinaryIO, row: np.dtype[Any], count: int) -> NDArray[Any]:
    left_bytes = _left_bytes(file)
    if count * row.itemsize > left_bytes:
        raise _BrokenError(
            f"it is truncated: {count} vertices need {count * row.itemsize} bytes,"
            f" but it has {left_bytes}"
        )
    table = np.frombuffer(file.read(count * row.itemsize), dtype=row)
    return table.astype(row.newbyteorder("="))


def _skip(file: BinaryIO, element: _Element, order: str) -> None:
    """Leave the file behind the rows of an element."""
    if element.has_lists and element.count:
        data = file.read()
        _, end = _walk(data, element, order)
        file.seek(end - len(data), 1)
    else:
        file.seek(element.count * element.row(order).itemsize, 1)


def _read_rows_with_lists(file: BinaryIO, element: _Element, order: str) -> NDArray[Any]:
    """The scalar properties of an element whose rows differ in length."""
    data = file.read()
    starts, _ = _walk(data, element, order)
    content = np.frombuffer(data, np.uint8)
    row = element.row("=")
    table = np.empty(element.count, row)
    scalars = [prop for prop in element.properties if not prop.count_kind]
    for prop, start in zip(scalars, starts, strict=True):
        size = np.dtype(prop.kind).itemsize
        table[prop.name] = content[start[:, None] + np.arange(size)].view(order + prop.kind)[:, 0]
    return table


def _walk(data: bytes, element: _Element, order: str) -> tuple[list[IntArray], int]:
    """Where each scalar of each row stands, and where the element ends.

    Returns
    -------
    starts : list of (count,) int64 arrays
        Offsets into `data`, one array for each property that is no list.
    end : int
        Offset behind the last row.
    """
    kinds = [
        (np.dtype(prop.kind).itemsize, np.dtype(prop.count_kind).itemsize if prop.count_kind else 0)
        for prop in element.properties
    ]
    shortest = sum(count_size or size for size, count_size in kinds)
    if element.count * shortest > len(data):
        raise _BrokenError(
            f"it is truncated: {element.count} rows of {element.name} need more than"
            f" {element.count * shortest} bytes, but it has {len(data)}"
        )
    signed = [prop.count_kind.startswith("i") for prop in element.properties]
    endian: Any = "big" if order == ">" else "little"
    places: list[list[int]] = [[] for size, count_size in kinds if not count_size]
    place = 0
    for _ in range(element.count):
        nth = 0
        for (size, count_size), is_signed in zip(kinds, signed, strict=True):
            if not count_size:
                places[nth].append(place)
                nth, place = nth + 1, place + size
                continue
            length = int.from_bytes(data[place : place + count_size], endian, signed=is_signed)
            if length < 0:
                raise _BrokenError(f"a list of its {element.name} has {length} items")
            place += count_size + length * size
        if place > len(data):
            raise _BrokenError(f"it is truncated: it ends in its {element.name}")
    return [np.array(start, dtype=np.int64) for start in places], place


def _read_text_rows(text: Iterator[bytes], element: _Element) -> NDArray[Any]:
    row, count = element.row("="), element.count
    lines = list(islice(text, count))
    if len(lines) < count:
        raise _BrokenError(f"it is truncated: it declares {count} vertices and has {len(lines)}")
    if count == 0:
        return np.empty(0, row)
    if element.has_lists:
        lines = [_without_lists(line, element) for line in lines]
    try:
        return np.atleast_1d(np.loadtxt(lines, dtype=row, comments=None))
    except (ValueError, OverflowError) as error:
        raise _BrokenError(f"its vertices do not parse ({str(error).splitlines()[0]})") from None


def _without_lists(line: bytes, element: _Element) -> bytes:
    """A line of text without the words of its lists."""
    words, kept = line.split(), list[bytes]()
    place = 0
    for prop in element.properties:
        word = words[place] if place < len(words) else b""
        if not prop.count_kind:
            kept.append(word)
            place += 1
        elif word.isdigit() and len(word) < 10:
            place += 1 + int(word)
        else:
            raise _BrokenError(
                f"its {element.name} has a list of {word[:20].decode(errors='replace')!r} items"
            )
    return b" ".join(kept)
