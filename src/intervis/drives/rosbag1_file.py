"""ROS 1 bags, version 2.0: records in chunks, each chunk followed by its index.

The file is walked from record to record; chunks are skipped where they have an index. So a bag
whose recorder was killed, which has no index at its end, is read up to its damage.
Source: wiki.ros.org/Bags/Format/2.0.
"""

import struct
from collections.abc import Iterator, Mapping
from typing import BinaryIO, NamedTuple

import numpy as np

from intervis.drives.chunked_file import ChunkedFile, span
from intervis.drives.message_file import (
    ENTRY,
    Chunk,
    DamageError,
    Topic,
    kind_of,
    topic_of,
)
from intervis.errors import ScanError

MAGIC = b"#ROSBAG V2.0\n"
PLAIN = "none"
MESSAGE, INDEX, CHUNK, CONNECTION = 2, 4, 5, 7
MOST_HEADER_BYTES = 2**16
MOST_CONNECTION_BYTES = 2**24
"""Size of a connection's data at most: it holds the definition of a message type."""

STEP = np.dtype([("s", "<u4"), ("ns", "<u4"), ("offset", "<u4")])
"""An entry of an index record."""


class _Record(NamedTuple):
    """A record: its place, the fields of its header, and place and size of its data."""

    start: int
    fields: Mapping[str, bytes]
    place: int
    size: int

    @property
    def kind(self) -> int:
        return self.number("op", "<B")

    def number(self, name: str, layout: str = "<I") -> int:
        """A number of the header."""
        value = self.fields.get(name, b"")
        if len(value) != struct.calcsize(layout):
            raise DamageError(f"a record at {self.start} has no {name}")
        return int(struct.unpack(layout, value)[0])

    def text(self, name: str) -> str:
        """A text of the header."""
        return self.fields.get(name, b"").decode(errors="replace")

    def time_ns(self) -> int:
        """The time of a message."""
        value = self.fields.get("time", b"")
        if len(value) != 8:
            raise DamageError(f"a record at {self.start} has no time")
        seconds, nanoseconds = struct.unpack("<II", value)
        return int(seconds) * 10**9 + int(nanoseconds)


class Rosbag1File(ChunkedFile[_Record]):
    """The messages of a bag; see `message_file.MessageFile`.

    Raises
    ------
    ScanError
        The file is no bag of version 2.0.
    """

    def _records(self, source: BinaryIO, start: int, end: int) -> Iterator[_Record]:
        return _records(source, start, end)

    def _is_definition(self, record: _Record) -> bool:
        return record.kind == CONNECTION

    def _message(self, source: BinaryIO, offset: int, end: int) -> tuple[int, int]:
        records = _records(source, offset, end)
        record = next((one for one in records if one.kind != CONNECTION), None)
        if record is None or record.kind != MESSAGE:
            raise DamageError(f"there is none at {offset}")
        return record.place, record.size

    # --- the index ---

    def _index(self, file: BinaryIO) -> None:
        magic = file.read(len(MAGIC))
        if magic != MAGIC:
            start = magic.split(b"\n")[0].decode("ascii", errors="replace")
            raise ScanError(f"{self.path} is no ROS 1 bag of version 2.0: it starts {start!r:.40}.")
        unindexed: int | None = None  # number of the chunk whose index may follow
        try:
            for record in _records(file, len(MAGIC), file.seek(0, 2)):
                if record.kind == INDEX and self._chunks:
                    self._add_index(file, record)
                    unindexed = None
                    continue
                if unindexed is not None:
                    self._scan(unindexed)
                    unindexed = None
                if record.kind == CHUNK:
                    size, compression = record.number("size"), record.text("compression")
                    compression = "" if compression == PLAIN else compression
                    self._chunks.append(Chunk(record.place, record.size, compression, size))
                    unindexed = len(self._chunks) - 1
                self._add(file, record, -1)
        except DamageError as error:
            self.damage = str(error)
        self._find_topics(unindexed)

    def _add(self, source: BinaryIO, record: _Record, chunk: int) -> None:
        """Enter a message that no index names, or a connection."""
        if record.kind == MESSAGE:
            entry = np.array([(record.time_ns(), chunk, record.start)], ENTRY)
            self._entries[record.number("conn")].append(entry)
        elif record.kind == CONNECTION:
            if record.size > MOST_CONNECTION_BYTES:
                raise DamageError(f"a connection at {record.start} has {record.size} bytes")
            kind = _fields(span(source, record.place, record.size)).get("type", b"")
            topic = topic_of(record.text("topic"))
            self._topic_of[record.number("conn")] = topic
            self.topics[topic] = Topic(kind_of(kind.decode(errors="replace")), "ros1")

    def _add_index(self, file: BinaryIO, record: _Record) -> None:
        """Enter an index record, which follows its chunk."""
        content = span(file, record.place, record.size)
        steps = np.frombuffer(content, STEP, record.size // STEP.itemsize)
        times_ns = steps["s"].astype(np.int64) * 10**9 + steps["ns"]
        self._enter(record.number("conn"), times_ns, steps["offset"])


def _records(source: BinaryIO, start: int, end: int) -> Iterator[_Record]:
    """The records between two places."""
    while 0 <= start < end:
        (size,) = struct.unpack("<I", span(source, start, 4))
        if size > MOST_HEADER_BYTES:
            raise DamageError(f"a record at {start} has a header of {size} bytes")
        fields = _fields(span(source, start + 4, size))
        place = start + 8 + size
        (data,) = struct.unpack("<I", span(source, place - 4, 4))
        if place + data > end:
            raise DamageError(f"it ends within a record at {start}")
        yield _Record(start, fields, place, data)
        start = place + data


def _fields(header: bytes) -> dict[str, bytes]:
    """Fields ``name=value``, each behind its length."""
    fields, place = {}, 0
    while place + 4 <= len(header):
        (size,) = struct.unpack_from("<I", header, place)
        name, equals, value = header[place + 4 : place + 4 + size].partition(b"=")
        if not equals or place + 4 + size > len(header):
            raise DamageError("a header of a record has a field that is none")
        fields[name.decode(errors="replace")] = value
        place += 4 + size
    return fields
