"""Serializing ROS 2 messages in CDR: clouds of points, cameras, images, transforms.

The definitions list the fields of each type, as recordings carry them.
"""

import struct
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from intervis.arrays import Float64Array
from intervis.camera import Camera
from intervis.drives.drive_writer import quaternions

CLOUD_TYPE, TRANSFORMS_TYPE = "sensor_msgs/msg/PointCloud2", "tf2_msgs/msg/TFMessage"
INFO_TYPE, IMAGE_TYPE = "sensor_msgs/msg/CameraInfo", "sensor_msgs/msg/CompressedImage"
_HEADER = """
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec"""
DEFINITIONS = {
    CLOUD_TYPE: f"""std_msgs/Header header
uint32 height
uint32 width
sensor_msgs/PointField[] fields
bool is_bigendian
uint32 point_step
uint32 row_step
uint8[] data
bool is_dense
================================================================================
MSG: sensor_msgs/PointField
uint8 INT8=1
uint8 UINT8=2
uint8 INT16=3
uint8 UINT16=4
uint8 INT32=5
uint8 UINT32=6
uint8 FLOAT32=7
uint8 FLOAT64=8
string name
uint32 offset
uint8 datatype
uint32 count{_HEADER}""",
    INFO_TYPE: f"""std_msgs/Header header
uint32 height
uint32 width
string distortion_model
float64[] d
float64[9] k
float64[9] r
float64[12] p
uint32 binning_x
uint32 binning_y
sensor_msgs/RegionOfInterest roi
================================================================================
MSG: sensor_msgs/RegionOfInterest
uint32 x_offset
uint32 y_offset
uint32 height
uint32 width
bool do_rectify{_HEADER}""",
    IMAGE_TYPE: f"""std_msgs/Header header
string format
uint8[] data{_HEADER}""",
    TRANSFORMS_TYPE: f"""geometry_msgs/TransformStamped[] transforms
================================================================================
MSG: geometry_msgs/TransformStamped
std_msgs/Header header
string child_frame_id
geometry_msgs/Transform transform
================================================================================
MSG: geometry_msgs/Transform
geometry_msgs/Vector3 translation
geometry_msgs/Quaternion rotation
================================================================================
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
================================================================================
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w{_HEADER}""",
}
"""Definitions of the message types, each followed by those of the types in it."""

DATATYPES = {"f4": 7, "u2": 4, "u4": 6}


class _Cdr:
    """Bytes that grow; numbers are aligned to their size, little-endian."""

    def __init__(self) -> None:
        self._content = bytearray()

    def numbers(self, kinds: str, *values: float) -> None:
        """Numbers of one size, as `struct` names their kinds."""
        self._content += bytes(-len(self._content) % struct.calcsize("=" + kinds[0]))
        self._content += struct.pack("<" + kinds, *values)

    def text(self, text: str) -> None:
        """A text with its length and a zero at its end."""
        octets = text.encode() + b"\0"
        self.numbers("I", len(octets))
        self._content += octets

    def octets(self, octets: bytes) -> None:
        """A sequence of bytes."""
        self.numbers("I", len(octets))
        self._content += octets

    def header(self, time_ns: int, frame_id: str) -> None:
        """``std_msgs/Header``."""
        self.numbers("iI", time_ns // 10**9, time_ns % 10**9)
        self.text(frame_id)

    def message(self) -> bytes:
        """The bytes after the four that tell the byte order."""
        return b"\0\1\0\0" + bytes(self._content)


def cloud_message(table: NDArray[np.void], time_ns: int, frame_id: str) -> bytes:
    """``sensor_msgs/PointCloud2`` of a packed structured array (N,) of float32, uint16, uint32."""
    names = table.dtype.names or ()
    cdr = _Cdr()
    cdr.header(time_ns, frame_id)
    cdr.numbers("II", 1, len(table))
    cdr.numbers("I", len(names))
    offset = 0
    for name in names:
        cdr.text(name)
        cdr.numbers("I", offset)
        cdr.numbers("B", DATATYPES[table.dtype[name].str[1:]])
        cdr.numbers("I", 1)
        offset += table.dtype[name].itemsize
    cdr.numbers("B", 0)
    cdr.numbers("II", offset, offset * len(table))
    cdr.octets(table.tobytes())
    cdr.numbers("B", 1)
    return cdr.message()


def camera_info_message(camera: Camera, time_ns: int, frame_id: str) -> bytes:
    """``sensor_msgs/CameraInfo`` of a camera without distortion, whose images are rectified."""
    cdr = _Cdr()
    cdr.header(time_ns, frame_id)
    cdr.numbers("II", camera.height_px, camera.width_px)
    cdr.text("plumb_bob")
    cdr.numbers("I", 5)
    cdr.numbers("ddddd", *np.zeros(5))
    for matrix in (camera.projection[:, :3], np.eye(3), camera.projection):
        cdr.numbers("d" * matrix.size, *matrix.ravel().tolist())
    cdr.numbers("IIIIII", 0, 0, 0, 0, 0, 0)  # neither binned nor cut
    cdr.numbers("B", 0)
    return cdr.message()


def compressed_image_message(jpeg: bytes, time_ns: int, frame_id: str) -> bytes:
    """``sensor_msgs/CompressedImage`` of a JPEG image."""
    cdr = _Cdr()
    cdr.header(time_ns, frame_id)
    cdr.text("jpeg")
    cdr.octets(jpeg)
    return cdr.message()


def transforms_message(
    transforms: Sequence[tuple[int, str, str, Float64Array]],
) -> bytes:
    """``tf2_msgs/TFMessage`` of times, names of parent and child, and parent_from_child (4, 4)."""
    cdr = _Cdr()
    cdr.numbers("I", len(transforms))
    for time_ns, parent, child, motion in transforms:
        w, x, y, z = quaternions([motion])[0].tolist()
        cdr.header(time_ns, parent)
        cdr.text(child)
        cdr.numbers("ddddddd", *motion[:3, 3].tolist(), x, y, z, w)
    return cdr.message()
