"""The header of a PCD file: fields, number of points, encoding, place of the scanner.

Headers of other writers are taken as other readers take them: SIZE, TYPE and COUNT have defaults,
POINTS follows from WIDTH and HEIGHT, unknown lines and comments are skipped, keys and types may be
in lower case. Format: https://pointclouds.org/documentation/tutorials/pcd_file_format.html
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, BinaryIO

import numpy as np

from intervis.errors import ScanError

LONGEST_HEADER = 200
"""Lines after which a header without its last line is rejected."""

MOST_VALUES = 4096
"""Numbers of a point from which a header is rejected."""

KINDS = {
    **{("F", size): f"<f{size}" for size in (2, 4, 8)},
    **{("I", size): f"<i{size}" for size in (1, 2, 4, 8)},
    **{("U", size): f"<u{size}" for size in (1, 2, 4, 8)},
}
"""Types of numpy by TYPE and SIZE."""

ENCODINGS = ("ascii", "binary", "binary_compressed")


class PcdError(ScanError):
    """An invalid PCD file; the message is the end of a sentence, which `pcd_file` begins."""


@dataclass(frozen=True)
class PcdField:
    """A field of a point: name, type, and how many numbers it has."""

    name: str
    kind: str
    count: int

    @property
    def size_bytes(self) -> int:
        """Bytes of the field in a point."""
        return np.dtype(self.kind).itemsize * self.count

    @property
    def is_padding(self) -> bool:
        """Whether the field only fills space: PCD names it "_"."""
        return self.name == "_"


@dataclass(frozen=True)
class PcdHeader:
    """What a PCD file says of its data.

    Attributes
    ----------
    fields : tuple of PcdField
        In the order of the file.
    points : int
    encoding : str
        ``ascii``, ``binary`` or ``binary_compressed``.
    viewpoint : tuple of str
        The words after VIEWPOINT, empty without such a line.
    """

    fields: tuple[PcdField, ...]
    points: int
    encoding: str
    viewpoint: tuple[str, ...]

    def row(self) -> np.dtype[Any]:
        """Type of one point; fields that hold nothing new get names that no field can have."""
        names: list[str] = []
        for place, field in enumerate(self.fields):
            repeated = field.is_padding or field.name in names
            names.append(f"{PADDING}{place}" if repeated else field.name)
        return np.dtype(
            [
                (name, field.kind) if field.count == 1 else (name, field.kind, (field.count,))
                for name, field in zip(names, self.fields, strict=True)
            ]
        )


PADDING = " padding "
"""Start of the names of columns that are left out; a name in a header holds no blank."""


def read_header(file: BinaryIO) -> PcdHeader:
    """Read the header; leaves the file at the start of the data.

    Raises
    ------
    PcdError
        A line that is needed is missing or does not parse.
    """
    lines = _lines_by_key(file)
    missing = [key for key in ("FIELDS", "DATA") if not lines.get(key)]
    if missing:
        raise PcdError(f"its header has no {' '.join(missing)}")
    encoding = lines["DATA"][0].lower()
    if encoding not in ENCODINGS:
        raise PcdError(f"its header has the unknown encoding {encoding[:40]!r}")
    fields = _fields(lines)
    points = _points(lines)
    return PcdHeader(fields, points, encoding, tuple(lines.get("VIEWPOINT", ())))


def _lines_by_key(file: BinaryIO) -> dict[str, list[str]]:
    lines: dict[str, list[str]] = {}
    for _ in range(LONGEST_HEADER):
        text = file.readline(65536).decode("utf-8-sig", "replace")
        key, *values = text.split() or [""]
        key = {"COLUMNS": "FIELDS"}.get(key.upper(), key.upper())  # the name up to version 0.5
        lines.setdefault(key, values)
        if key == "DATA":
            break
    return lines


def _fields(lines: Mapping[str, list[str]]) -> tuple[PcdField, ...]:
    names = lines["FIELDS"]
    sizes, types, counts = (
        lines.get(key) or [default] * len(names)
        for key, default in (("SIZE", "4"), ("TYPE", "F"), ("COUNT", "1"))
    )
    for key, values in (("SIZE", sizes), ("TYPE", types), ("COUNT", counts)):
        if len(values) != len(names):
            raise PcdError(f"its header has {len(names)} FIELDS and {len(values)} of {key}")
    fields = []
    for name, size, kind, count in zip(names, sizes, types, counts, strict=True):
        size_bytes = _whole_number("SIZE", size)
        if (kind.upper(), size_bytes) not in KINDS:
            raise PcdError(f"its header has the unknown type {kind[:20]} of {size_bytes} bytes")
        number = _whole_number("COUNT", count)
        if number:  # COUNT 0: the field holds nothing
            fields.append(PcdField(name, KINDS[kind.upper(), size_bytes], number))
    if sum(field.count for field in fields) > MOST_VALUES:
        raise PcdError(f"its header declares more than {MOST_VALUES} numbers for each point")
    for field in fields:
        if field.name.lower() in ("x", "y", "z") and field.count > 1:
            raise PcdError(f"its field {field.name} has {field.count} numbers instead of one")
    return tuple(fields)


def _points(lines: Mapping[str, list[str]]) -> int:
    if lines.get("POINTS"):
        return _whole_number("POINTS", lines["POINTS"][0])
    if not lines.get("WIDTH"):
        raise PcdError("its header has neither POINTS nor WIDTH")
    keys = ("WIDTH", "HEIGHT") if lines.get("HEIGHT") else ("WIDTH",)
    return math.prod(_whole_number(key, lines[key][0]) for key in keys)


def _whole_number(key: str, word: str) -> int:
    if not (word.isascii() and word.isdecimal() and len(word) < 16):
        raise PcdError(f"its header has the invalid line {f'{key} ... {word[:40]} ...'!r}")
    return int(word)
