"""ROS point clouds (``sensor_msgs/PointCloud2``) as scans, from bytes or from message objects.

A cloud has any fields, in any order, of any type, at any offset: also padded, unaligned and in the
other byte order. Rows 0, 0, 0 are no returns and become NaN. Times of points are among the other
fields, where `deskew.point_times_ns` finds them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from intervis.arrays import Float64Array
from intervis.drives.ros_encoding import Cursor, Encoding, decoding
from intervis.drives.scan import Scan, scan_of_rows
from intervis.errors import ScanError

TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
"""numpy's types of ``PointField.datatype``."""

MOST_FIELDS = 1000


@dataclass(frozen=True)
class PointField:
    """A field of the points: name, offset in bytes, code of its type, number of values."""

    name: str
    offset: int
    datatype: int
    count: int


@dataclass(frozen=True, eq=False)
class PointCloud2:
    """A message ``sensor_msgs/PointCloud2``.

    Attributes
    ----------
    time_ns : int
        Stamp of the header, nanoseconds.
    frame_id : str
        Name of the coordinate frame.
    height, width : int
        Rows, and points of a row.
    fields : sequence of PointField
    is_bigendian : bool
    point_step, row_step : int
        Bytes from a point to the next, and from a row to the next.
    data : (B,) uint8 array
    """

    time_ns: int
    frame_id: str
    height: int
    width: int
    fields: Sequence[PointField]
    is_bigendian: bool
    point_step: int
    row_step: int
    data: NDArray[np.uint8] = field(repr=False)


def decode_point_cloud2(content: bytes | memoryview, encoding: Encoding, name: Path) -> PointCloud2:
    """The message in serialized bytes.

    Parameters
    ----------
    content : bytes-like
    encoding : Encoding
        ``cdr`` (ROS 2) or ``ros1``.
    name : Path
        Where the bytes are from, for messages.

    Raises
    ------
    ScanError
        They are no PointCloud2.
    """
    with decoding(name, "PointCloud2", ScanError):
        cursor = Cursor(content, encoding)
        time_ns, frame_id = cursor.header()
        height, width = cursor.number("I"), cursor.number("I")
        fields = [_decoded_field(cursor) for _ in range(cursor.count(MOST_FIELDS))]
        is_bigendian = bool(cursor.number("B"))
        point_step, row_step = cursor.number("I"), cursor.number("I")
        data = np.frombuffer(cursor.octets(), np.uint8)
    return PointCloud2(
        *(time_ns, frame_id, height, width, fields, is_bigendian, point_step, row_step, data)
    )


def _decoded_field(cursor: Cursor) -> PointField:
    return PointField(cursor.text(), cursor.number("I"), cursor.number("B"), cursor.number("I"))


def point_cloud2_of(message: Any) -> PointCloud2:
    """The cloud in a message object, as rclpy, rospy and rosbags give it.

    Raises
    ------
    ScanError
        The object lacks an attribute of PointCloud2, or one is of another type.

    Examples
    --------
    >>> from types import SimpleNamespace as Message
    >>> stamp = Message(sec=3, nanosec=500)
    >>> x, y, z = (Message(name=name, offset=4 * n, datatype=7, count=1)
    ...            for n, name in enumerate("xyz"))
    >>> cloud = point_cloud2_of(Message(
    ...     header=Message(stamp=stamp, frame_id="velodyne"), height=1, width=2, fields=[x, y, z],
    ...     is_bigendian=False, point_step=12, row_step=24, is_dense=True,
    ...     data=np.arange(6, dtype=np.float32).tobytes()))
    >>> cloud.time_ns, cloud.frame_id, scan_of_cloud(cloud, Path("message")).points.tolist()
    (3000000500, 'velodyne', [[0.0, 1.0, 2.0], [3.0, 4.0, 5.0]])
    """
    if isinstance(message, PointCloud2):
        return message
    try:
        stamp = message.header.stamp
        seconds = stamp.sec if hasattr(stamp, "sec") else stamp.secs
        nanoseconds = stamp.nanosec if hasattr(stamp, "nanosec") else stamp.nsecs
        return PointCloud2(
            int(seconds) * 10**9 + int(nanoseconds),
            str(message.header.frame_id),
            int(message.height),
            int(message.width),
            [
                PointField(str(f.name), int(f.offset), int(f.datatype), int(f.count))
                for f in message.fields
            ],
            bool(message.is_bigendian),
            int(message.point_step),
            int(message.row_step),
            _octets(message.data),
        )
    except (AttributeError, TypeError, ValueError, OverflowError) as error:
        raise ScanError(f"the object is no message PointCloud2: {error}.") from None


def _octets(data: Any) -> NDArray[np.uint8]:
    if isinstance(data, list | tuple):
        return np.array(data, np.uint8)
    return np.frombuffer(memoryview(data).cast("B"), np.uint8)


def scan_of_cloud(
    cloud: PointCloud2, name: Path, velo_from_cloud: Float64Array | None = None
) -> Scan:
    """The points of a cloud, row after row, with its other fields as attributes.

    Parameters
    ----------
    cloud : PointCloud2
    name : Path
        Where it is from, for messages.
    velo_from_cloud : (4, 4) array, optional
        Motion that moves the points into the scanner's frame.

    Returns
    -------
    Scan
        Points (N, 3), N = height x width; rows without return are NaN.

    Raises
    ------
    ScanError
        A coordinate is missing, a field lies outside of the points, the data is too short, or
        there are no points.
    """
    _check(cloud, name)
    values = {one.name: _values(cloud, one) for one in reversed(cloud.fields)}
    axes = [axis if axis in values else axis.upper() for axis in "xyz"]
    missing = [axis.lower() for axis in axes if axis not in values]
    if missing:
        shown = " ".join(" ".join(one.name for one in cloud.fields).split())[:200]
        raise ScanError(f"the scan {name} has no {' '.join(missing)}: its fields are {shown}.")
    if any(values[axis].ndim != 1 for axis in axes):
        raise ScanError(f"the scan {name} has several values in a coordinate.")
    points = np.column_stack([values[axis] for axis in axes])
    if points.dtype.kind != "f":
        points = points.astype(np.float64)
    with np.errstate(invalid="ignore", over="ignore"):  # of a signalling NaN
        points[~points.any(axis=1)] = np.nan
        scan = scan_of_rows(name, points, velo_from_file=velo_from_cloud)
    others = {key: column for key, column in reversed(values.items()) if key not in axes}
    return Scan(scan.points, others)


def _check(cloud: PointCloud2, name: Path) -> None:
    """Sizes and offsets, before memory is taken for them."""
    if min(cloud.height, cloud.width, cloud.point_step, cloud.row_step) < 0:
        raise ScanError(f"the scan {name} declares a negative size.")
    if cloud.height == 0 or cloud.width == 0:
        raise ScanError(f"the scan {name} holds no points.")
    row_bytes = cloud.width * cloud.point_step
    row_step = cloud.row_step if cloud.height > 1 else max(cloud.row_step, row_bytes)
    needed = (cloud.height - 1) * row_step + row_bytes
    if cloud.point_step == 0 or row_step < row_bytes or needed > len(cloud.data):
        raise ScanError(
            f"the scan {name} declares {cloud.height} x {cloud.width} points of"
            f" {cloud.point_step} bytes in rows of {cloud.row_step}, it holds"
            f" {len(cloud.data)} bytes."
        )
    if len(cloud.fields) > MOST_FIELDS:
        raise ScanError(f"the scan {name} has {len(cloud.fields)} fields, which is too many.")
    for one in cloud.fields:
        size = np.dtype(TYPES[one.datatype]).itemsize if one.datatype in TYPES else 0
        end = one.offset + size * max(1, one.count)
        if size == 0 or one.offset < 0 or one.count < 0 or end > cloud.point_step:
            raise ScanError(
                f"the scan {name} has a field {one.name!r:.60} of type {one.datatype} at"
                f" {one.offset} that does not fit its points of {cloud.point_step} bytes."
            )


def _values(cloud: PointCloud2, one: PointField) -> NDArray[Any]:
    """(N,) values of a field in the native byte order, (N, k) where it has k of them."""
    kind = np.dtype((">" if cloud.is_bigendian else "<") + TYPES[one.datatype])
    count = max(1, one.count)  # some writers leave it at 0
    view: NDArray[Any] = np.ndarray(
        (cloud.height, cloud.width, count),
        kind,
        cloud.data,
        one.offset,
        (cloud.row_step, cloud.point_step, kind.itemsize),
    )
    points = cloud.height * cloud.width
    native = view.astype(kind.newbyteorder("="))  # a copy: contiguous, aligned
    return native.reshape((points, count) if count > 1 else points)
