"""ROS 1 bags, version 2.0: records in chunks, each chunk followed by its index.

The file is walked from record to record; chunks are skipped where they have an index. So a bag
whose recorder was killed, which has no index at its end, is read up to its damage.
Source: wiki.ros.org/Bags/Format/2.0.
"""

import contextlib
import io
import struct
from collections import defaultdict
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from intervis.drives.message_file import (
    ENTRY,
    Chunk,
    DamageError,
    Topic,
    chunk_records,
    kind_of,
    topic_of,
)
from intervis.drives.regular_file import open_regular
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


class Rosbag1File:
    """The messages of a bag; see `message_file.MessageFile`.

    Raises
    ------
    ScanError
        The file is no bag of version 2.0.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.topics: dict[str, Topic] = {}
        self.damage = ""
        self._chunks: list[Chunk] = []
        self._entries: dict[int, list[NDArray[Any]]] = defaultdict(list)
        self._topic_of: dict[int, str] = {}
        try:
            with open_regular(path) as file:
                self._index(file)
        except OSError as error:
            raise ScanError(f"cannot read {path}: {error.strerror}.") from None

    def entries(self, topic: str) -> NDArray[Any]:
        """See `message_file.MessageFile`; several connections may share a topic."""
        found = [
            part
            for connection, parts in self._entries.items()
            if self._topic_of.get(connection) == topic
            for part in parts
        ]
        return np.concatenate(found) if found else np.empty(0, ENTRY)

    def read(self, entry: Any, most: int | None = None) -> bytes:
        """See `message_file.MessageFile`."""
        try:
            with open_regular(self.path) as file:
                return self._content(file, file.seek(0, 2), entry, most)
        except DamageError as error:
            raise ScanError(f"{self.path} has a damaged message: {error}.") from None
        except OSError as error:
            raise ScanError(f"cannot read {self.path}: {error.strerror}.") from None

    def read_many(self, entries: NDArray[Any], most: int | None = None) -> Iterator[bytes | None]:
        """See `message_file.MessageFile`."""
        try:
            with open_regular(self.path) as file:
                end = file.seek(0, 2)
                for entry in entries:
                    try:
                        yield self._content(file, end, entry, most)
                    except ScanError:
                        yield None
        except OSError as error:
            raise ScanError(f"cannot read {self.path}: {error.strerror}.") from None

    def _content(self, source: BinaryIO, end: int, entry: Any, most: int | None) -> bytes:
        """The content of a message; `source` is the file, `end` its size."""
        number, offset = int(entry["chunk"]), int(entry["offset"])
        if number >= 0:
            content = chunk_records(self.path, self._chunks[number])
            source, end = io.BytesIO(content), len(content)
        records = _records(source, offset, end)
        record = next((one for one in records if one.kind != CONNECTION), None)
        if record is None or record.kind != MESSAGE:
            raise DamageError(f"there is none at {offset}")
        return _span(source, record.place, min(record.size, most or record.size))

    @contextlib.contextmanager
    def _opened(self, chunk: Chunk) -> Iterator[tuple[BinaryIO, int, int]]:
        """Where the records of a chunk can be read: source, first, end."""
        if chunk.compression != PLAIN:
            content = chunk_records(self.path, chunk)
            yield io.BytesIO(content), 0, len(content)
            return
        with open_regular(self.path) as file:
            yield file, chunk.place, chunk.place + chunk.bytes

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
                    self._chunks.append(Chunk(record.place, record.size, compression, size))
                    unindexed = len(self._chunks) - 1
                self._add(file, record, -1)
        except DamageError as error:
            self.damage = str(error)
        try:
            if unindexed is not None:
                self._scan(unindexed)
            for nth in range(len(self._chunks)):  # a bag that was cut has its connections there
                if not self._entries.keys() <= self._topic_of.keys():
                    self._scan(nth, connections_only=True)
        except ScanError as error:
            self.damage = self.damage or str(error).rstrip(".")

    def _add(self, source: BinaryIO, record: _Record, chunk: int) -> None:
        """Enter a message that no index names, or a connection."""
        if record.kind == MESSAGE:
            entry = np.array([(record.time_ns(), chunk, record.start)], ENTRY)
            self._entries[record.number("conn")].append(entry)
        elif record.kind == CONNECTION:
            if record.size > MOST_CONNECTION_BYTES:
                raise DamageError(f"a connection at {record.start} has {record.size} bytes")
            kind = _fields(_span(source, record.place, record.size)).get("type", b"")
            topic = topic_of(record.text("topic"))
            self._topic_of[record.number("conn")] = topic
            self.topics[topic] = Topic(kind_of(kind.decode(errors="replace")), "ros1")

    def _add_index(self, file: BinaryIO, record: _Record) -> None:
        """Enter an index record, which follows its chunk."""
        chunk = self._chunks[-1]
        content = _span(file, record.place, record.size)
        steps = np.frombuffer(content, STEP, record.size // STEP.itemsize)
        found = np.empty(len(steps), ENTRY)
        found["time_ns"] = steps["s"].astype(np.int64) * 10**9 + steps["ns"]
        is_plain = chunk.compression == PLAIN
        found["chunk"] = -1 if is_plain else len(self._chunks) - 1
        found["offset"] = steps["offset"] + np.int64(chunk.place if is_plain else 0)
        self._entries[record.number("conn")].append(found)

    def _scan(self, number: int, *, connections_only: bool = False) -> None:
        """Enter what is in a chunk."""
        chunk = self._chunks[number]
        with self._opened(chunk) as (source, first, end):
            for record in _records(source, first, end):
                if not connections_only or record.kind == CONNECTION:
                    self._add(source, record, -1 if chunk.compression == PLAIN else number)


def _records(source: BinaryIO, start: int, end: int) -> Iterator[_Record]:
    """The records between two places."""
    while 0 <= start < end:
        (size,) = struct.unpack("<I", _span(source, start, 4))
        if size > MOST_HEADER_BYTES:
            raise DamageError(f"a record at {start} has a header of {size} bytes")
        fields = _fields(_span(source, start + 4, size))
        place = start + 8 + size
        (data,) = struct.unpack("<I", _span(source, place - 4, 4))
        if place + data > end:
            raise DamageError(f"it ends within a record at {start}")
        yield _Record(start, fields, place, data)
        start = place + data


def _span(source: BinaryIO, place: int, size: int) -> bytes:
    source.seek(place)
    content = source.read(size)
    if len(content) < size:
        raise DamageError(f"it ends within a record at {place}")
    return content


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
