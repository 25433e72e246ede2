"""Tables in the schema of nuScenes: JSON files of records that name each other by tokens.

Tables of a whole data set have millions of records. Large ones are searched record by record for
those of one scene, so that their size costs time but no memory.
"""

import json
import re
from collections.abc import Iterator, Mapping, Set
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from intervis.arrays import Float64Array
from intervis.drives.pcd_file import rotation_of_quaternion
from intervis.drives.regular_file import open_regular
from intervis.errors import CalibrationError
from intervis.transform import rigid

Record = Mapping[str, Any]

WHOLE_BYTES = 8_000_000
"""Size up to which a table is parsed at once."""

BLOCK_BYTES = 16_000_000
"""A large table is read in blocks of this size."""

LONGEST_VALUE = 200
"""Bytes after a key in which its value is looked for."""

FARTHEST_M = 1e9
LATEST_US = 9e15
"""Times at most, microseconds: 64 bits of nanoseconds end at 9.2e15."""


def read_table(
    folder: Path, name: str, key: str | None = None, wanted: Set[str] | None = None
) -> dict[str, Record]:
    """Records of a table by token, or those whose text under `key` is among the wanted ones.

    Parameters
    ----------
    folder : Path
        Holds the tables.
    name : str
        The table's name, ``sample_data``.
    key : str, optional
    wanted : set of str, optional

    Raises
    ------
    CalibrationError
        The table is missing, cannot be read, or is not a list of records with tokens.
    """
    path = folder / f"{name}.json"
    try:
        with open_regular(path) as file:
            if file.seek(0, 2) > WHOLE_BYTES and key is not None and wanted is not None:
                file.seek(0)
                records: list[Any] = list(_search(file, key, wanted))
            else:
                file.seek(0)
                records = json.loads(file.read())
    except FileNotFoundError:
        raise CalibrationError(f"the table {path} is missing.") from None
    except OSError as error:
        raise CalibrationError(f"cannot read the table {path}: {error.strerror}.") from None
    except (ValueError, RecursionError):
        raise CalibrationError(f"the table {path} is not valid JSON.") from None
    if not isinstance(records, list):
        raise CalibrationError(f"the table {path} is not a list of records.")
    by_token: dict[str, Record] = {}
    for record in records:
        if not isinstance(record, dict) or not isinstance(record.get("token"), str):
            raise CalibrationError(f"the table {path} has a record without a token.")
        if key is None or wanted is None or text_of(path, record, key) in wanted:
            by_token[record["token"]] = record
    return by_token


def _search(file: BinaryIO, key: str, wanted: Set[str]) -> Iterator[Any]:
    """The wanted records of a large table, whose records hold no records themselves."""
    quoted, rest = b'"' + key.encode() + b'"', b""
    values = re.compile(re.escape(quoted) + rb'\s*:\s*"([^"]*)"')
    encoded = {text.encode(errors="replace") for text in wanted}
    while block := file.read(BLOCK_BYTES):
        block = rest + block
        end = block.rfind(b"}") + 1
        if not encoded.isdisjoint(values.findall(block, 0, end)):  # few blocks hold a scene
            yield from _search_block(block[:end], quoted, wanted)
        rest = block[end:]


def _search_block(block: bytes, key: bytes, wanted: Set[str]) -> Iterator[Any]:
    place = block.find(key)
    while place >= 0:
        place += len(key)
        parts = block[place : place + LONGEST_VALUE].split(b'"', 2)
        if (
            len(parts) == 3
            and parts[0].strip() == b":"
            and parts[1].decode(errors="replace") in wanted
        ):
            yield json.loads(block[block.rfind(b"{", 0, place) : block.find(b"}", place) + 1])
        place = block.find(key, place)


def _wrong(table: Path, record: Record, key: str, needed: str) -> CalibrationError:
    return CalibrationError(
        f"{table}: the record {record.get('token', '')!r:.60} has no {needed} under {key!r}."
    )


def text_of(table: Path, record: Record, key: str) -> str:
    """A text of a record.

    Raises
    ------
    CalibrationError
        It is missing or no text; so do the functions below for what they return.
    """
    value = record.get(key)
    if not isinstance(value, str):
        raise _wrong(table, record, key, "text")
    return value


def record_of(folder: Path, records: Mapping[str, Record], record: Record, table: str) -> Record:
    """The record of another table that a record names."""
    token = text_of(folder, record, f"{table}_token")
    if token not in records:
        raise CalibrationError(f"{folder / table}.json has no record {token!r:.60}.")
    return records[token]


def numbers_of(table: Path, record: Record, key: str, *shape: int) -> Float64Array:
    """Finite numbers of a record in the given shape."""
    try:
        values = np.array(record.get(key), dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        values = np.empty(0)
    if values.shape != shape or not np.all(np.abs(values) < FARTHEST_M):
        raise _wrong(table, record, key, f"{' x '.join(map(str, shape))} numbers")
    return values


def pose_of(table: Path, record: Record) -> Float64Array:
    """(4, 4) rigid motion of a record with a translation and a quaternion w, x, y, z."""
    quaternion = numbers_of(table, record, "rotation", 4)
    if not 1e-3 < np.linalg.norm(quaternion) < 1e3:
        raise _wrong(table, record, "rotation", "quaternion")
    return rigid(rotation_of_quaternion(quaternion), numbers_of(table, record, "translation", 3))


def time_ns_of(table: Path, record: Record) -> int:
    """Time of a record in nanoseconds; it holds microseconds, Lyft's with fractions."""
    value = record.get("timestamp")
    if not isinstance(value, int | float) or not abs(value) < LATEST_US:
        raise _wrong(table, record, "timestamp", "time in microseconds")
    whole_us = int(value)
    return 1000 * whole_us + round(1000 * (value - whole_us))
