"""Unpacking of LZF, the compression of PCD files."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from intervis.kernels import kernel

LITERALS = 32
"""Control bytes below this announce a run of literal bytes."""


@kernel
def unpack_lzf(packed: NDArray[np.uint8], unpacked: NDArray[np.uint8]) -> Any:
    """Unpack into an array of the expected size; how many bytes came out, -1 for invalid input.

    A control byte below 32 is followed by that many literal bytes plus one. Any other refers back:
    three bits of length, and thirteen bits of distance.

    Parameters
    ----------
    packed : (P,) uint8 array
    unpacked : (U,) uint8 array
        Receives the result.
    """
    place: Any = 0
    filled: Any = 0
    while place < len(packed):
        control = np.int64(packed[place])
        place += 1
        if control < LITERALS:
            length: Any = control + 1
            if place + length > len(packed) or filled + length > len(unpacked):
                return -1
            for k in range(length):
                unpacked[filled + k] = packed[place + k]
            place += length
        else:
            length = control // 32
            extra = 1 if length == 7 else 0  # a further byte of length
            if place + extra >= len(packed):
                return -1
            length += 2
            if extra:
                length += np.int64(packed[place])
            start = filled - (control % 32) * 256 - np.int64(packed[place + extra]) - 1
            place += extra + 1
            if start < 0 or filled + length > len(unpacked):
                return -1
            for k in range(length):  # byte by byte: source and target may overlap
                unpacked[filled + k] = unpacked[start + k]
        filled += length
    return filled
