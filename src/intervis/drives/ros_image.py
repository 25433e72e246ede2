"""Messages of ROS cameras: ``CameraInfo``, ``Image`` and ``CompressedImage``, from their bytes."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from intervis.arrays import Float64Array, UInt8Array
from intervis.drives.image_file import MOST_PIXELS, decoded_image
from intervis.drives.ros_encoding import Cursor, Encoding, decoding
from intervis.drives.transform_tree import bare
from intervis.errors import CalibrationError, ScanError

MOST_DISTORTION = 100
"""Numbers of a model of distortion at most."""

CHANNELS = {
    **{"rgb8": (3, (0, 1, 2)), "rgba8": (4, (0, 1, 2)), "bgr8": (3, (2, 1, 0))},
    **{"bgra8": (4, (2, 1, 0)), "8UC3": (3, (2, 1, 0)), "8UC4": (4, (2, 1, 0))},
    **{"mono8": (1, (0, 0, 0)), "8UC1": (1, (0, 0, 0))},
}
"""Bytes of a pixel by the encoding of an image, and where in it red, green and blue stand."""
DEEP = ("mono16", "16UC1")
"""Encodings of 16 bits, of which the upper eight are shown."""


class CameraInfo(NamedTuple):
    """A message ``sensor_msgs/CameraInfo``.

    Attributes
    ----------
    frame_id : str
        Name of the camera's optical frame: x right, y down, z ahead.
    width_px, height_px : int
    distortion : tuple of float
    intrinsic, rectification : (3, 3) float64 arrays
        K, of the image as it was taken, and R, the rectified frame from the optical one.
    projection : (3, 4) float64 array
        P, of the rectified image.
    is_whole : bool
        Whether the images are neither binned nor cut.
    """

    frame_id: str
    width_px: int
    height_px: int
    distortion: tuple[float, ...]
    intrinsic: Float64Array
    rectification: Float64Array
    projection: Float64Array
    is_whole: bool


def decode_camera_info(content: bytes, encoding: Encoding, name: Path) -> CameraInfo:
    """A calibration from its bytes.

    Raises
    ------
    CalibrationError
        The bytes are no such message.
    """
    with decoding(name, "CameraInfo", CalibrationError):
        cursor = Cursor(content, encoding)
        _, frame_id = cursor.header()
        height, width = cursor.numbers("II")
        cursor.text()
        count = cursor.count(MOST_DISTORTION)
        distortion = cursor.numbers("d" * count) if count else ()
        intrinsic, rectification, projection = (
            np.array(cursor.numbers("d" * size)).reshape(3, -1) for size in (9, 9, 12)
        )
        binning_x, binning_y, left, top, cut_height, cut_width = cursor.numbers("I" * 6)
        is_cut = (left, top) != (0, 0) or (cut_width, cut_height) not in ((0, 0), (width, height))
        is_whole = max(binning_x, binning_y) <= 1 and not is_cut
        return CameraInfo(
            bare(frame_id),
            *(width, height, distortion, intrinsic, rectification, projection, is_whole),
        )


def decode_image(content: bytes, encoding: Encoding, name: Path) -> UInt8Array:
    """(H, W, 3) red, green and blue of a message ``sensor_msgs/Image``.

    Raises
    ------
    ScanError
        The bytes are no such message, or its encoding is not read.
    """
    with decoding(name, "Image", ScanError):
        cursor = Cursor(content, encoding)
        cursor.header()
        height, width = cursor.numbers("II")
        kind = cursor.text()
        (is_bigendian,) = cursor.numbers("B")
        step = cursor.number("I")
        data = np.frombuffer(cursor.octets(), np.uint8)
    if kind not in CHANNELS and kind not in DEEP:
        raise ScanError(
            f"{name} holds images of the encoding {kind!r:.40}, and {', '.join((*CHANNELS, *DEEP))}"
            " are read: convert them, for example with image_proc."
        )
    size, order = CHANNELS.get(kind, (2, (0 if is_bigendian else 1,) * 3))
    row = width * size
    if not (0 < width * height <= MOST_PIXELS and row <= step and step * height <= len(data)):
        raise ScanError(
            f"{name} holds an image of {width} x {height} pixels in {len(data)} bytes, which do not"
            " fit each other."
        )
    rows = data[: step * height].reshape(height, step)[:, :row]
    return np.ascontiguousarray(rows.reshape(height, width, size)[..., list(order)])


def decode_compressed_image(content: bytes, encoding: Encoding, name: Path) -> UInt8Array:
    """(H, W, 3) red, green and blue of a message ``sensor_msgs/CompressedImage``.

    Raises
    ------
    MissingExtraError
        Pillow (extra ``plots``) is not installed.
    ScanError, DriveError
        The bytes are no such message, or no JPEG or PNG image.
    """
    with decoding(name, "CompressedImage", ScanError):
        cursor = Cursor(content, encoding)
        cursor.header()
        cursor.text()
        data = bytes(cursor.octets())
    return decoded_image(data, name)
