"""Image files beside scans: their endings, and their size from the first bytes.

Pillow is an optional dependency, and a drive with images must open without it.
"""

import io
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import BinaryIO

import numpy as np

from intervis.arrays import UInt8Array
from intervis.drives.regular_file import open_regular
from intervis.errors import DriveError, MissingExtraError

IMAGE_ENDINGS = (".png", ".jpg", ".jpeg")
"""Endings of image files, in any case; where a frame has several images, the first counts."""

MOST_PIXELS = 80_000_000
"""Pixels beyond which an image is not decoded: it would take 0.25 GB and more."""

PNG_START = b"\x89PNG\r\n\x1a\n"
JPEG_START = b"\xff\xd8"
JPEG_FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
"""Markers of JPEG whose segment holds the size (SOF0 to SOF15)."""

MOST_SEGMENTS = 1000
"""Segments of a JPEG file after which it is given up."""


def image_file_size_px(path: Path) -> tuple[int, int]:
    """Width and height of a PNG or JPEG image, from its header.

    Raises
    ------
    DriveError
        The file cannot be read, or is neither.
    """
    try:
        with open_regular(path) as file:
            return _size_px(file, path)
    except OSError as error:
        raise DriveError(f"cannot read the image {path}: {error.strerror}.") from None


def _size_px(file: BinaryIO, name: Path) -> tuple[int, int]:
    """Width and height of a PNG or JPEG image that begins at the start of a file."""
    start = file.read(24)
    if start.startswith(PNG_START) and start[12:16] == b"IHDR" and len(start) == 24:
        return int.from_bytes(start[16:20], "big"), int.from_bytes(start[20:24], "big")
    size_px = _jpeg_size_px(file) if start.startswith(JPEG_START) else None
    if size_px is None:
        raise DriveError(f"the image {name} is neither a PNG nor a JPEG image.")
    return size_px


def _jpeg_size_px(file: BinaryIO) -> tuple[int, int] | None:
    """Width and height in the first segment that holds them: marker, length, precision, size."""
    file.seek(len(JPEG_START))
    for _ in range(MOST_SEGMENTS):
        marker = file.read(2)
        while marker[:1] == b"\xff" == marker[1:]:  # any number of fill bytes may come before
            marker = b"\xff" + file.read(1)
        head = file.read(7)
        if len(head) < 7 or marker[:1] != b"\xff":
            return None
        if marker[1] in JPEG_FRAMES:
            return int.from_bytes(head[5:7], "big"), int.from_bytes(head[3:5], "big")
        file.seek(max(2, int.from_bytes(head[:2], "big")) - len(head), 1)
    return None


def checked_image_size_px(path: Path) -> tuple[int, int]:
    """Width and height of an image that may be decoded.

    Raises
    ------
    DriveError
        The file cannot be read, is no image, or has more than `MOST_PIXELS` pixels.
    """
    return _check_size(image_file_size_px(path), path)


def _check_size(size_px: tuple[int, int], name: Path) -> tuple[int, int]:
    width_px, height_px = size_px
    if width_px * height_px > MOST_PIXELS:
        raise DriveError(
            f"the image {name} declares {width_px} x {height_px} pixels, more than this program"
            f" decodes ({MOST_PIXELS})."
        )
    return size_px


def decoded_image(source: Path | bytes, name: Path) -> UInt8Array:
    """(H, W, 3) red, green and blue of a PNG or JPEG image.

    Parameters
    ----------
    source : Path or bytes
        The file, or its content.
    name : Path
        Of the image, for messages.

    Raises
    ------
    MissingExtraError
        Pillow (extra ``plots``) is not installed.
    DriveError
        It is no readable image, or has more than `MOST_PIXELS` pixels.
    """
    try:
        from PIL import Image
    except ImportError:
        raise MissingExtraError("pillow", "plots", "Decoding an image") from None
    if isinstance(source, bytes):
        _check_size(_size_px(io.BytesIO(source), name), name)
    else:
        checked_image_size_px(source)
    try:
        with (
            warnings.catch_warnings(),
            io.BytesIO(source) if isinstance(source, bytes) else open_regular(source) as file,
            Image.open(file) as image,
        ):
            warnings.simplefilter("ignore")  # of damage that does not keep it from decoding
            return np.asarray(image.convert("RGB"))
    except Exception as error:  # Pillow raises various types on damaged files
        reason = (str(error) or type(error).__name__).splitlines()[0].rstrip(".")
        raise DriveError(f"cannot read the image {name}: {reason}.") from None


def first_image_size_px(images: Mapping[int, Path]) -> tuple[int, int]:
    """Width and height of the first image, in the order of frames, that can be read.

    Raises
    ------
    DriveError
        None of them can be read.
    """
    unreadable: DriveError | None = None
    for number in sorted(images):
        try:
            return image_file_size_px(images[number])
        except DriveError as error:
            unreadable = unreadable or error
    raise unreadable or DriveError("there is no image.")
