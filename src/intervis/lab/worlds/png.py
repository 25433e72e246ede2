"""Pictures as PNG files with nothing but zlib: eight bits, red, green, blue."""

import struct
import zlib

import numpy as np
from numpy.typing import NDArray

from intervis.errors import PointsError

SIGNATURE = b"\x89PNG\r\n\x1a\n"


def _chunk(kind: bytes, body: bytes) -> bytes:
    return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))


def png_bytes(image: NDArray[np.uint8], level: int = 4) -> bytes:
    r"""The bytes of a PNG file.

    Parameters
    ----------
    image : (H, W, 3) uint8 array
        Red, green, blue.
    level : int
        Effort of the compression, 0 to 9.

    Raises
    ------
    PointsError
        Another shape or type.

    Examples
    --------
    >>> png_bytes(np.zeros((2, 3, 3), np.uint8))[:4]
    b'\x89PNG'
    """
    if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3 or image.size == 0:
        raise PointsError(
            f"a picture must be a uint8 array (H, W, 3), got {image.dtype} {image.shape}."
        )
    height, width = image.shape[:2]
    # Filter 2, "up": each row as its difference from the row above, modulo 256.
    rows = np.empty((height, 1 + 3 * width), np.uint8)
    rows[:, 0] = 2
    flat = image.reshape(height, 3 * width)
    rows[0, 1:] = flat[0]
    np.subtract(flat[1:], flat[:-1], out=rows[1:, 1:])
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return b"".join(
        [
            SIGNATURE,
            _chunk(b"IHDR", header),
            _chunk(b"IDAT", zlib.compress(rows.tobytes(), level)),
            _chunk(b"IEND", b""),
        ]
    )
