"""Columns of whole numbers as compressed bytes that a browser reads.

A block is a zlib stream of: the length of a directory (uint32, little-endian), the directory as
JSON, and the columns. The directory lists ``[name, count, planes, by_difference, signed]`` for each
column. A column is stored as planes: the lowest byte of all values, then the next byte of all, as
many planes as its largest value needs. Values of nearby returns differ little, so coordinates are
stored as differences; signed values are stored as 0, -1, 1, -2, 2 ... = 0, 1, 2, 3, 4 ...
"""

import json
import zlib
from collections.abc import Collection, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from intervis.arrays import IntArray

Columns = dict[str, IntArray]

LEVEL = 6
"""Of zlib: higher levels take several times as long and save 1 %."""


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
    directory, body = [], []
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
        body.append(octets[:, :planes].T.tobytes())
    head = json.dumps(directory, separators=(",", ":")).encode()
    return zlib.compress(len(head).to_bytes(4, "little") + head + b"".join(body), LEVEL)
