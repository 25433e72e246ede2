"""Columns of whole numbers as compressed bytes that a browser reads.

A block is a zlib stream of: the length of a directory (uint32, little-endian), the directory as
JSON, and the columns. The directory lists ``[name, count, planes, by_difference, signed]`` for each
column. A column is stored as planes: the lowest byte of all values, then the next byte of all, as
many planes as its largest value needs. Values of nearby returns differ little, so coordinates are
stored as differences; signed values are stored as 0, -1, 1, -2, 2 ... = 0, 1, 2, 3, 4 ...
"""

import json
import zlib
from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from intervis.arrays import IntArray

Columns = dict[str, IntArray]

MEMORY_LEVEL = 9
"""Of zlib: the most."""


def packed(columns: Mapping[str, NDArray[Any]], by_difference: Collection[str] = ()) -> bytes:
    """A block of columns of whole numbers, each (N,).

    Parameters
    ----------
    columns : mapping of str to integer array
    by_difference : collection of str
        Columns that are stored as differences of successive values.

    Examples
    --------
    >>> block = packed({"x": np.array([100, 101, 99])}, by_difference=["x"])
    >>> content = zlib.decompress(block)
    >>> content[4:-3], list(content[-3:])
    (b'[["x",3,1,1,1]]', [200, 2, 3])
    """
    directory, planes_of_all = [], []
    for name, column in columns.items():
        values = np.asarray(column, np.int64)
        differs = name in by_difference
        if differs:
            values = np.diff(values, prepend=np.int64(0))
        signed = bool(len(values)) and bool(values.min() < 0)
        if signed:
            values = (values << 1) ^ (values >> 63)
        planes = max(1, (int(values.max()).bit_length() + 7) // 8) if len(values) else 1
        octets = values.astype("<u8").view(np.uint8).reshape(-1, 8)
        directory.append([name, len(values), planes, int(differs), int(signed)])
        planes_of_all += [octets[:, plane].tobytes() for plane in range(planes)]
    head = json.dumps(directory, separators=(",", ":")).encode()
    return _compressed([len(head).to_bytes(4, "little") + head, *planes_of_all])


def _compressed(parts: Sequence[bytes]) -> bytes:
    """One zlib stream of parts that differ in kind.

    The low bytes of measurements hardly repeat, so that only runs are looked for: the search for
    longer repetitions takes five times as long. A flush after each part gives it a code of its own,
    which saves more than the search does.
    """
    deflate = zlib.compressobj(
        zlib.Z_BEST_COMPRESSION, zlib.DEFLATED, zlib.MAX_WBITS, MEMORY_LEVEL, zlib.Z_RLE
    )
    flushed = [deflate.compress(part) + deflate.flush(zlib.Z_SYNC_FLUSH) for part in parts]
    return b"".join(flushed) + deflate.flush()
