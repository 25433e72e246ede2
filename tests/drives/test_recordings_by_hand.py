"""Recordings and messages written byte by byte: values at the limits, and every row of a table."""

import struct
from pathlib import Path

import numpy as np
import pytest

from intervis.drives import mcap_file, message_file, rosbag1_file
from intervis.drives.mcap_file import McapFile
from intervis.drives.message_file import Chunk, chunk_records
from intervis.drives.ros_encoding import Cursor
from intervis.drives.ros_image import decode_image
from intervis.drives.rosbag1_file import Rosbag1File
from intervis.errors import ScanError

# --- ROS 1 bags ---


def bag_record(fields: dict[str, bytes], data: bytes) -> bytes:
    header = b"".join(
        struct.pack("<I", len(name) + 1 + len(value)) + name.encode() + b"=" + value
        for name, value in fields.items()
    )
    return struct.pack("<I", len(header)) + header + struct.pack("<I", len(data)) + data


def number(value: int) -> bytes:
    return struct.pack("<I", value)


CONNECTION_DATA = b"".join(
    struct.pack("<I", len(field)) + field
    for field in (b"topic=/points", b"type=sensor_msgs/PointCloud2", b"md5sum=*")
)
CONNECTION = bag_record({"op": b"\x07", "conn": number(3), "topic": b"/points"}, CONNECTION_DATA)
MESSAGES = [
    bag_record({"op": b"\x02", "conn": number(3), "time": struct.pack("<II", 7, nth)}, b"abc")
    for nth in (1, 2)
]
BAG = b"#ROSBAG V2.0\n" + bag_record({"op": b"\x03", "index_pos": bytes(8)}, b"    ")


def bag_of(folder: Path, content: bytes) -> Rosbag1File:
    path = folder / "a.bag"
    path.write_bytes(BAG + content)
    return Rosbag1File(path)


def test_a_bag_without_chunks_by_hand(tmp_path):
    file = bag_of(tmp_path, CONNECTION + b"".join(MESSAGES))
    assert file.damage == ""
    assert file.topics["/points"] == message_file.Topic("sensor_msgs/PointCloud2", "ros1")
    assert file.entries("/points")["time_ns"].tolist() == [7_000_000_001, 7_000_000_002]
    assert list(file.read_many(file.entries("/points"))) == [b"abc", b"abc"]


@pytest.mark.parametrize(("less", "damage"), [(0, ""), (1, "a connection at 55 has 61 bytes")])
def test_bytes_of_a_connection_at_most(tmp_path, monkeypatch, less, damage):
    assert (len(BAG), len(CONNECTION_DATA)) == (55, 61)
    monkeypatch.setattr(rosbag1_file, "MOST_CONNECTION_BYTES", len(CONNECTION_DATA) - less)
    file = bag_of(tmp_path, CONNECTION + MESSAGES[0])
    assert file.damage == damage
    assert list(file.topics) == ([] if damage else ["/points"])


@pytest.mark.parametrize(("less", "damage"), [(0, False), (1, True)])
def test_bytes_of_the_header_of_a_record_at_most(tmp_path, monkeypatch, less, damage):
    longest = bag_record({"op": b"\x07", "conn": number(3), "topic": b"/" + 60 * b"x"}, b"")
    header_bytes = len(longest) - 8
    monkeypatch.setattr(rosbag1_file, "MOST_HEADER_BYTES", header_bytes - less)
    file = bag_of(tmp_path, MESSAGES[0] + longest)
    found = f"a header of {header_bytes} bytes" in file.damage
    assert found == damage
    assert bool(file.topics) != damage


@pytest.mark.parametrize(
    ("fields", "damage"),
    [
        ({"op": b"\x02", "conn": number(3), "time": bytes(7)}, "has no time"),
        ({"op": b"\x02", "conn": number(3)[:3], "time": bytes(8)}, "has no conn"),
        ({"conn": number(3)}, "has no op"),
    ],
)
def test_fields_of_a_record_that_are_none(tmp_path, fields, damage):
    file = bag_of(tmp_path, CONNECTION + MESSAGES[0] + bag_record(fields, b"") + MESSAGES[1])
    assert file.damage == f"a record at {len(BAG) + len(CONNECTION + MESSAGES[0])} {damage}"
    assert len(file.entries("/points")) == 1


@pytest.mark.parametrize("field", [b"\x09\0\0\0conn=abc", b"\x04\0\0\0conn"])
def test_a_field_that_is_longer_than_its_header_or_has_no_value(tmp_path, field):
    header = b"\x04\0\0\0op=\x02" + field
    record = number(len(header)) + header + number(0)
    file = bag_of(tmp_path, MESSAGES[0] + record)
    assert file.damage == "a header of a record has a field that is none"


def test_stated_sizes_of_a_bag(tmp_path):
    """Headers of 65,536 bytes and connections of 16,777,216 bytes are taken, longer ones not."""
    plain = {"op": b"\x07", "conn": number(3), "topic": b"/points"}
    used = len(bag_record(plain, b"")) - 8 + 4 + len("more=")
    for header_bytes, data_bytes, damage in (
        (65_536, 0, ""),
        (65_537, 0, "a record at 55 has a header of 65537 bytes"),
        (used, 2**24 - 4, ""),
        (used, 2**24 - 3, f"a connection at 55 has {2**24 + 1} bytes"),
    ):
        fields = {**plain, "more": bytes(header_bytes - used)}
        file = bag_of(tmp_path, bag_record(fields, number(data_bytes) + bytes(data_bytes)))
        # A field of zeros has no name: of connections it is read, and damaged, where not too long.
        assert file.damage == (damage or "a header of a record has a field that is none")


@pytest.mark.parametrize("kind", ["connection", "index"])
def test_an_index_that_leads_to_no_message(tmp_path, kind):
    """To the last record of a chunk, which is a connection, and to the index behind it."""
    records = MESSAGES[0] + CONNECTION
    chunk = bag_record(
        {"op": b"\x05", "compression": b"none", "size": number(len(records))}, records
    )
    offset = len(MESSAGES[0]) if kind == "connection" else len(records)
    fields = {"op": b"\x04", "ver": number(1), "conn": number(3), "count": number(2)}
    places = struct.pack("<III", 7, 1, 0) + struct.pack("<III", 7, 2, offset)
    file = bag_of(tmp_path, chunk + bag_record(fields, places))
    entries = file.entries("/points")
    assert (file.damage, entries["time_ns"].tolist()) == ("", [7_000_000_001, 7_000_000_002])
    assert list(file.read_many(entries)) == [b"abc", None]
    with pytest.raises(ScanError, match=r"has a damaged message: there is none at \d+\."):
        file.read(entries[1])


# --- MCAP ---


def mcap_record(kind: int, content: bytes) -> bytes:
    return struct.pack("<BQ", kind, len(content)) + content


def text(letters: bytes) -> bytes:
    return number(len(letters)) + letters


SCHEMA = struct.pack("<H", 5) + text(b"sensor_msgs/msg/PointCloud2") + text(b"ros2msg") + text(b"")
CHANNEL = struct.pack("<HH", 9, 5) + text(b"/points") + text(b"cdr") + number(0)
MCAP_MESSAGE = mcap_record(0x05, struct.pack("<HIQQ", 9, 1, 7, 8) + b"abc")
MCAP_HEAD = mcap_file.MAGIC + mcap_record(0x01, text(b"ros2") + text(b""))
MCAP_END = mcap_record(0x0F, bytes(4)) + mcap_record(0x02, bytes(20)) + mcap_file.MAGIC
DEFINED = mcap_record(0x03, SCHEMA) + mcap_record(0x04, CHANNEL)


def mcap_of(folder: Path, content: bytes, end: bytes = MCAP_END) -> McapFile:
    path = folder / "a.mcap"
    path.write_bytes(MCAP_HEAD + content + end)
    return McapFile(path)


@pytest.mark.parametrize("end", [MCAP_END, MCAP_END[:13], MCAP_END[13:], b""])
def test_a_recording_without_chunks_by_hand(tmp_path, end):
    """Either of the records at the end says that nothing is missing."""
    file = mcap_of(tmp_path, DEFINED + MCAP_MESSAGE, end)
    assert file.damage == ("" if end else "it has no end")
    assert file.topics == {"/points": message_file.Topic("sensor_msgs/PointCloud2", "cdr")}
    entries = file.entries("/points")
    assert entries["time_ns"].tolist() == [7]
    assert file.read(entries[0]) == b"abc"


@pytest.mark.parametrize(("less", "is_damaged"), [(0, False), (1, True)])
def test_bytes_of_a_definition_at_most(tmp_path, monkeypatch, less, is_damaged):
    monkeypatch.setattr(mcap_file, "MOST_DEFINITION_BYTES", max(len(SCHEMA), len(CHANNEL)) - less)
    file = mcap_of(tmp_path, DEFINED + MCAP_MESSAGE)
    assert ("a definition at" in file.damage) == is_damaged
    assert bool(file.topics) != is_damaged


def indexed(index: bytes, compression: bytes = b"") -> bytes:
    records = DEFINED + MCAP_MESSAGE
    head = struct.pack("<QQQI", 7, 7, len(records), 0)
    chunk = head + text(compression) + struct.pack("<Q", len(records)) + records
    return mcap_record(0x06, chunk) + mcap_record(0x07, index)


@pytest.mark.parametrize(
    ("index", "messages", "damage"),
    [
        (struct.pack("<HIQQ", 9, 16, 7, len(DEFINED)), 1, ""),
        (struct.pack("<HIQQ", 9, 16, 7, len(DEFINED)) + b"more", 1, ""),
        (struct.pack("<HI", 9, 0), 0, ""),
        (struct.pack("<HI", 9, 0)[:5], 0, "is too short"),
        (struct.pack("<HIQQ", 9, 17, 7, 0) + b"x", 0, "declares 17 bytes"),
        (struct.pack("<HIQQ", 9, 32, 7, 0), 0, "declares 32 bytes"),
    ],
)
def test_indexes_of_a_chunk(tmp_path, index, messages, damage):
    file = mcap_of(tmp_path, indexed(index))
    assert file.damage.endswith(damage)
    assert bool(file.damage) == bool(damage)
    if not damage:
        entries = file.entries("/points")
        assert list(file.read_many(entries)) == [b"abc"] * messages


@pytest.mark.parametrize(("size", "reason"), [(0, None), (1, "larger than its record")])
def test_a_chunk_ends_with_its_record_at_most(tmp_path, size, reason):
    records = DEFINED + MCAP_MESSAGE
    head = struct.pack("<QQQI", 7, 7, len(records), 0) + text(b"")
    chunk = mcap_record(0x06, head + struct.pack("<Q", len(records) + size) + records)
    file = mcap_of(tmp_path, chunk)
    if reason:
        assert reason in file.damage
    else:
        assert (file.damage, len(file.entries("/points"))) == ("", 1)


def test_a_message_of_a_recording_holds_its_head_at_least(tmp_path):
    short = mcap_record(0x05, struct.pack("<HIQQ", 9, 1, 7, 8)[:21])
    whole = mcap_record(0x05, struct.pack("<HIQQ", 9, 1, 7, 8))
    index = struct.pack("<HIQQQQ", 9, 32, 7, len(DEFINED), 8, len(DEFINED + short))
    records = DEFINED + short + whole
    head = struct.pack("<QQQI", 7, 7, len(records), 0) + text(b"")
    chunk = mcap_record(0x06, head + struct.pack("<Q", len(records)) + records)
    file = mcap_of(tmp_path, chunk + mcap_record(0x07, index))
    assert list(file.read_many(file.entries("/points"))) == [None, b""]


# --- chunks ---


@pytest.mark.parametrize(("less", "valid"), [(0, True), (1, False)])
def test_bytes_of_a_chunk_at_most(tmp_path, monkeypatch, less, valid):
    import bz2

    packed, path = bz2.compress(b"x" * 500), tmp_path / "a"
    path.write_bytes(b"before" + packed + b"behind")
    chunk = Chunk(6, len(packed), "bz2", 500)
    monkeypatch.setattr(message_file, "MOST_CHUNK_BYTES", 500 - less)
    if valid:
        assert chunk_records(path, chunk) == b"x" * 500
    else:
        with pytest.raises(ScanError, match="declares a chunk of 500 bytes at 6, more than 499"):
            chunk_records(path, chunk)


def test_a_chunk_of_a_quarter_of_a_gibibyte_is_the_largest(tmp_path):
    import bz2

    packed, path = bz2.compress(b"x"), tmp_path / "a"
    path.write_bytes(packed)
    with pytest.raises(ScanError, match="of another size than it declares"):
        chunk_records(path, Chunk(0, len(packed), "bz2", 2**28))
    with pytest.raises(ScanError, match="more than 268435456"):
        chunk_records(path, Chunk(0, len(packed), "bz2", 2**28 + 1))


def test_a_chunk_of_several_streams_and_one_of_another_size(tmp_path):
    import bz2

    first, second = bz2.compress(b"a" * 9), bz2.compress(b"b" * 5)
    path = tmp_path / "a"
    path.write_bytes(first + second)
    whole = Chunk(0, len(first + second), "bz2", 14)
    assert chunk_records(path, whole) == b"a" * 9 + b"b" * 5
    for size in (13, 15):
        with pytest.raises(ScanError, match="a chunk at 0 of another size than it declares"):
            chunk_records(path, whole._replace(whole_bytes=size))
    with pytest.raises(ScanError, match="ends within a message at 0"):
        chunk_records(path, whole._replace(bytes=len(first + second) + 1))
    with pytest.raises(ScanError, match="unknown compression 'snappy'"):
        chunk_records(path, whole._replace(compression="snappy"))
    with pytest.raises(ScanError, match=r"cannot read .*gone: No such file"):
        chunk_records(tmp_path / "gone", whole)


@pytest.mark.parametrize("reader", [McapFile, Rosbag1File])
def test_messages_of_a_file_that_has_gone_are_told(tmp_path, reader):
    if reader is McapFile:
        file = mcap_of(tmp_path, DEFINED + MCAP_MESSAGE)
    else:
        file = bag_of(tmp_path, CONNECTION + MESSAGES[0])
    entries = file.entries("/points")
    file.path.unlink()
    with pytest.raises(ScanError, match=r"cannot read .*: No such file"):
        file.read(entries[0])
    with pytest.raises(ScanError, match=r"cannot read .*: No such file"):
        list(file.read_many(entries))


# --- the encoding of messages ---


@pytest.mark.parametrize(("letters", "valid"), [(1000, True), (1001, False)])
def test_letters_of_a_name_in_a_message(letters, valid):
    cursor = Cursor(text(letters * b"n"), "ros1")
    if valid:
        assert cursor.text() == letters * "n"
    else:
        with pytest.raises(ValueError, match="a name is too long"):
            cursor.text()


def test_the_length_of_a_sequence_at_most():
    assert Cursor(number(7), "ros1").count(7) == 7
    with pytest.raises(ValueError, match="a sequence of 8"):
        Cursor(number(8), "ros1").count(7)


@pytest.mark.parametrize(("first", "valid"), [(b"\0\0", True), (b"\0\1", True), (b"\1\0", False)])
def test_cdr_begins_with_its_byte_order(first, valid):
    content = first + b"\0\0" + struct.pack("<I" if first[1] else ">I", 258)
    if valid:
        assert Cursor(content, "cdr").number("I") == 258
        with pytest.raises(ValueError, match="no CDR"):
            Cursor(content[:3], "cdr")
    else:
        with pytest.raises(ValueError, match="no CDR"):
            Cursor(content, "cdr")


# --- images ---

PIXEL = bytes([11, 22, 33, 44])


@pytest.mark.parametrize(
    ("encoding", "pixel", "shown", "is_bigendian"),
    [
        ("rgb8", PIXEL[:3], [11, 22, 33], 0),
        ("rgba8", PIXEL, [11, 22, 33], 0),
        ("bgr8", PIXEL[:3], [33, 22, 11], 0),
        ("bgra8", PIXEL, [33, 22, 11], 0),
        ("8UC3", PIXEL[:3], [33, 22, 11], 0),
        ("8UC4", PIXEL, [33, 22, 11], 0),
        ("mono8", PIXEL[:1], [11, 11, 11], 0),
        ("8UC1", PIXEL[:1], [11, 11, 11], 0),
        ("mono16", PIXEL[:2], [22, 22, 22], 0),
        ("16UC1", PIXEL[:2], [22, 22, 22], 0),
        ("mono16", PIXEL[:2], [11, 11, 11], 1),
        ("16UC1", PIXEL[:2], [11, 11, 11], 1),
    ],
)
def test_every_encoding_of_an_image_byte_by_byte(encoding, pixel, shown, is_bigendian):
    """Two rows of three pixels, each larger by the number of the pixel; one byte behind a row."""
    rows = [
        b"".join(
            bytes(value + nth for value in pixel) for nth in (3 * row, 3 * row + 1, 3 * row + 2)
        )
        for row in range(2)
    ]
    step = len(rows[0]) + 1
    head = number(0) + struct.pack("<II", 3, 4) + text(b"optical") + struct.pack("<II", 2, 3)
    head += text(encoding.encode()) + bytes([is_bigendian]) + number(step)
    content = head + text(b"".join(row + b"\xff" for row in rows))
    expected = np.array(shown) + np.arange(6).reshape(2, 3, 1)
    assert decode_image(content, "ros1", Path("a")).tolist() == expected.tolist()
    with pytest.raises(ScanError, match=f"3 x 2 pixels in {2 * step - 1} bytes"):
        decode_image(head + text(b"x" * (2 * step - 1)), "ros1", Path("a"))
