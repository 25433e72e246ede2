"""ROS point clouds: every layout of their bytes gives the same points."""

import struct
from array import array
from pathlib import Path
from types import SimpleNamespace as Message

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from intervis.drives import open_drive
from intervis.drives.deskew import point_times_ns
from intervis.drives.point_cloud2 import decode_point_cloud2, point_cloud2_of, scan_of_cloud
from intervis.errors import ScanError

NAME = Path("a.mcap/points")
CODES = {"i1": 1, "u1": 2, "i2": 3, "u2": 4, "i4": 5, "u4": 6, "f4": 7, "f8": 8}
LETTERS = {"i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I", "f4": "f", "f8": "d"}
STAMP_NS = 1_700_000_000_250_000_000


def message(rows, fields, *, order="<", step=None, height=1, row_padding=0, data=bytes):
    """A message object; fields are (name, type, offset), values are packed one by one."""
    step = step or max(offset + np.dtype(kind).itemsize for _, kind, offset in fields)
    width = len(rows) // height
    content = bytearray()
    for nth, row in enumerate(rows):
        point = bytearray(b"\xee" * step)
        for value, (_, kind, offset) in zip(row, fields, strict=True):
            struct.pack_into(order + LETTERS[kind], point, offset, value)
        content += point
        if (nth + 1) % width == 0:
            content += b"\xdd" * row_padding
    return Message(
        header=Message(
            stamp=Message(sec=STAMP_NS // 10**9, nanosec=STAMP_NS % 10**9), frame_id="velodyne"
        ),
        height=height,
        width=width,
        fields=[
            Message(name=name, offset=offset, datatype=CODES[kind], count=1)
            for name, kind, offset in fields
        ],
        is_bigendian=order == ">",
        point_step=step,
        row_step=width * step + row_padding,
        data=data(bytes(content)),
        is_dense=False,
    )


def read(one):
    return scan_of_cloud(point_cloud2_of(one), NAME)


XYZ = [("x", "f4", 0), ("y", "f4", 4), ("z", "f4", 8)]


@given(
    kinds=st.lists(st.sampled_from(sorted(CODES)), min_size=1, max_size=4),
    order=st.sampled_from("<>"),
    gaps=st.lists(st.integers(0, 3), min_size=8, max_size=8),
    height=st.sampled_from([1, 2, 3]),
    row_padding=st.integers(0, 5),
    axis=st.sampled_from(["f4", "f8"]),
)
def test_any_layout_gives_the_values_that_were_packed(
    kinds, order, gaps, height, row_padding, axis
):
    names = ["a", "z", "b", "x", "c", "y", "d"]
    of_name = {"x": axis, "y": axis, "z": axis}
    of_name |= dict(zip("abcd", kinds, strict=False))
    fields, place = [], 0
    for gap, name in zip(gaps, names, strict=False):
        if name in of_name:
            fields.append((name, of_name[name], place + gap))
            place += gap + np.dtype(of_name[name]).itemsize
    rows = [[(3 * nth + 7 * column) % 100 + 1 for column in range(len(fields))] for nth in range(6)]
    scan = read(
        message(
            rows, fields, order=order, step=place + gaps[7], height=height, row_padding=row_padding
        )
    )
    columns = {name: np.array(rows)[:, nth] for nth, (name, _, _) in enumerate(fields)}
    assert np.array_equal(scan.points, np.stack([columns[axis] for axis in "xyz"], axis=1))
    assert scan.points.dtype == np.float32
    assert set(scan.attributes) == set(columns) - set("xyz")
    for name, values in scan.attributes.items():
        assert np.array_equal(values, columns[name])
        assert values.dtype == np.dtype(of_name[name])
        assert values.flags.c_contiguous


def test_points_are_taken_to_the_bit_and_zeros_are_no_returns():
    rows = [(0.1, -2.3, 1e-40), (0, 0, 0), (-0.0, 0, 0), (np.nan, 1, 2), (np.inf, 0, 0), (0, 0, 1)]
    points = read(message(rows, XYZ)).points
    expected = np.array(rows, np.float32)
    assert np.array_equal(points[[0, 4, 5]], expected[[0, 4, 5]])
    assert np.isnan(points[[1, 2]]).all()
    assert np.isnan(points[3, 0])
    assert points[3, 1:].tolist() == [1, 2]


def test_fields_of_several_values_and_a_count_of_zero():
    one = message([(1, 2, 3, 4, 5)], [*XYZ, ("n", "u2", 12), ("m", "u2", 14)])
    one.fields[3].count = 2
    one.fields[0].count = 0
    scan = read(one)
    assert scan.attributes["n"].tolist() == [[4, 5]]
    assert scan.attributes["m"].tolist() == [5]
    assert scan.points.tolist() == [[1, 2, 3]]


@pytest.mark.parametrize(
    ("name", "kind", "values", "expected"),
    [
        ("t", "u4", [0, 99_000_000], [0, 99_000_000]),
        ("offset_time", "u4", [5, 100_000_005], [5, 100_000_005]),
        ("time", "f4", [-0.0625, 0.0], [-62_500_000, 0]),
        ("timestamp", "f8", [1_700_000_000.25, 1_700_000_000.375], [0, 125_000_000]),
        ("timestamp", "f8", [1.70000000025e18, 1.70000000035e18], [0, 100_000_000]),
        ("intensity", "f4", [0.0, 1.0], None),
    ],
)
def test_times_of_points_are_found_among_the_fields(name, kind, values, expected):
    rows = [(1, 2, 3, value) for value in values]
    cloud = point_cloud2_of(message(rows, [*XYZ, (name, kind, 12)]))
    attributes = scan_of_cloud(cloud, NAME).attributes
    assert attributes.keys() == {name}
    times_ns = point_times_ns(attributes, cloud.time_ns)
    if expected is None:
        assert times_ns is None
    else:
        assert np.allclose(times_ns - cloud.time_ns, expected, rtol=0, atol=1_000)


@pytest.mark.parametrize(
    "data",
    [bytes, bytearray, memoryview, list, lambda b: array("B", b), lambda b: np.frombuffer(b, "u1")],
)
def test_data_of_every_client_library_is_taken(data):
    assert read(message([(1, 2, 3)], XYZ, data=data)).points.tolist() == [[1, 2, 3]]


def test_stamps_of_ros_1_are_taken():
    one = message([(1, 2, 3)], XYZ)
    one.header.stamp = Message(secs=3, nsecs=4)
    assert point_cloud2_of(one).time_ns == 3_000_000_004


def damaged(**changes):
    one = message([(1, 2, 3)] * 6, XYZ, height=2)
    for name, value in changes.items():
        setattr(one, name, value)
    return one


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"width": 4}, "declares 2 x 4 points"),
        ({"height": 10**12}, "declares 1000000000000 x 3"),
        ({"width": -1}, "negative size"),
        ({"height": 0}, "holds no points"),
        ({"width": 0}, "holds no points"),
        ({"point_step": 0}, "points of 0 bytes"),
        ({"row_step": 35}, "rows of 35"),
        ({"data": b""}, "it holds 0 bytes"),
        ({"data": "text"}, "no message PointCloud2"),
        ({"data": None}, "no message PointCloud2"),
        ({"header": None}, "no message PointCloud2"),
        ({"fields": [Message(name="x", offset=0, datatype=7, count=1)]}, "has no y z"),
        ({"fields": [Message(name="x", offset=9, datatype=7, count=1)]}, "does not fit"),
        ({"fields": [Message(name="x", offset=-4, datatype=7, count=1)]}, "does not fit"),
        ({"fields": [Message(name="x", offset=0, datatype=9, count=1)]}, "does not fit"),
        ({"fields": [Message(name="x", offset=0, datatype=7, count=2**40)]}, "does not fit"),
    ],
)
def test_a_message_that_contradicts_itself_is_refused_in_one_sentence(changes, reason):
    with pytest.raises(ScanError, match=reason) as caught:
        read(damaged(**changes))
    assert "\n" not in str(caught.value)


def cdr(order="<", frame="lidar"):
    """One point 1, 2, 3, packed by hand as the standard says."""
    flag = 1 if order == "<" else 0
    text = frame.encode() + b"\0"
    content = struct.pack(order + "iII", 3, 4, len(text)) + text
    content += b"\0" * (-len(content) % 4)
    content += struct.pack(order + "III", 1, 1, 3)
    for nth, axis in enumerate(b"xyz"):
        content += struct.pack(order + "I2s2xIB3xI", 2, bytes([axis, 0]), 4 * nth, 7, 1)
    content += struct.pack(order + "B3xIII", 0, 12, 12, 12) + struct.pack("<3f", 1, 2, 3) + b"\1"
    return bytes([0, flag, 0, 0]) + content


@pytest.mark.parametrize("order", "<>")
@pytest.mark.parametrize("frame", ["", "a", "ab", "abc", "abcd"])
def test_cdr_of_both_byte_orders(order, frame):
    cloud = decode_point_cloud2(cdr(order, frame), "cdr", NAME)
    assert (cloud.time_ns, cloud.frame_id) == (3_000_000_004, frame)
    assert scan_of_cloud(cloud, NAME).points.tolist() == [[1, 2, 3]]


@pytest.mark.parametrize("name", ["a.cdr", "a.bin"])
def test_a_message_in_a_file_of_its_own_is_a_scan(tmp_path, name):
    (tmp_path / name).write_bytes(cdr())
    for path in (tmp_path, tmp_path / name):
        assert open_drive(path)[0].points.tolist() == [[1, 2, 3]]


def test_every_cut_of_a_serialized_message_is_refused():
    whole = cdr()
    for length in range(len(whole) - 1):  # the last byte, is_dense, is not needed
        with pytest.raises(ScanError, match="holds a message that is no PointCloud2"):
            decode_point_cloud2(whole[:length], "cdr", NAME)


@pytest.mark.realdata
def test_a_real_message(shared_data):
    path = shared_data / "pointcloud2" / "dds_message.bin"
    content = path.read_bytes()
    cloud = decode_point_cloud2(content, "cdr", path)
    assert cloud.frame_id == "lidar_link"
    assert len(open_drive(path.parent)[0].points) == 64_000
    scan = scan_of_cloud(cloud, path)
    # The points are the 64,000 steps of 26 bytes before the last four bytes: read by hand.
    rows = np.frombuffer(
        content[-4 - 64_000 * 26 : -4],
        np.dtype([("xyz", "<f4", 3), ("i", "<f4"), ("ring", "<u2"), ("time", "<f8")]),
    )
    returns = rows["xyz"].any(axis=1)
    assert np.array_equal(scan.points[returns], rows["xyz"][returns])
    assert np.isnan(scan.points[~returns]).all()
    assert set(scan.attributes["ring"]) == set(range(32))
    assert np.array_equal(scan.attributes["timestamp"], rows["time"])
    after_ns = point_times_ns(scan.attributes, cloud.time_ns) - cloud.time_ns
    assert -1_000 < after_ns.min() < after_ns.max() < 110_000_000
    # Each ring keeps its elevation: the bytes were taken apart at the right places.
    far = returns & (np.linalg.norm(scan.points, axis=1) > 5)
    x, y, z = scan.points[far].T
    elevation = np.degrees(np.arctan2(z, np.hypot(x, y)))
    ring = scan.attributes["ring"][far]
    assert all(np.ptp(np.percentile(elevation[ring == n], [5, 95])) < 0.1 for n in range(32))


@pytest.mark.parametrize("row_step", [0, 12, 10_000])
def test_the_row_step_of_a_single_row_does_not_matter(row_step):
    rows = [(1.0, 2.0, 3.0), (4.0, 5.0, 6.0)]
    one = message(rows, XYZ)
    one.row_step = row_step
    assert read(one).points.tolist() == [list(row) for row in rows]
