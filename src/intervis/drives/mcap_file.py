"""MCAP files: records, mostly in chunks, each chunk followed by the indexes of its channels.

The file is walked from record to record; chunks are skipped where they have an index. So a file
whose recorder was killed, which has no summary at its end, is read up to its damage.
Source: mcap.dev/spec.
"""

import contextlib
import io
import struct
from collections import defaultdict
from collections.abc import Iterator
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

MAGIC = b"\x89MCAP0\r\n"
FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, INDEX, DATA_END = 0x02, 0x03, 0x04, 0x05, 0x06, 0x07, 0x0F
HEAD_BYTES = 9
"""Kind and size of a record."""

MESSAGE_HEAD = struct.Struct("<HIQQ")
CHUNK_HEAD = struct.Struct("<QQQI")
MOST_DEFINITION_BYTES = 2**24
"""Size of a schema or a channel at most."""

STEP = np.dtype([("time_ns", "<u8"), ("offset", "<u8")])
"""An entry of an index."""


class _Record(NamedTuple):
    """A record: its place, its kind, and place and size of its content."""

    start: int
    kind: int
    place: int
    size: int


class McapFile:
    """The messages of a file; see `message_file.MessageFile`.

    Raises
    ------
    ScanError
        The file is no MCAP.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.topics: dict[str, Topic] = {}
        self.damage = ""
        self._chunks: list[Chunk] = []
        self._entries: dict[int, list[NDArray[Any]]] = defaultdict(list)
        self._topic_of: dict[int, str] = {}
        self._schemas: dict[int, str] = {}
        try:
            with open_regular(path) as file:
                self._index(file)
        except OSError as error:
            raise ScanError(f"cannot read {path}: {error.strerror}.") from None

    def entries(self, topic: str) -> NDArray[Any]:
        """See `message_file.MessageFile`; several channels may share a topic."""
        found = [
            part
            for channel, parts in self._entries.items()
            if self._topic_of.get(channel) == topic
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
        record = next(_records(source, offset, end), None)
        if record is None or record.kind != MESSAGE or record.size < MESSAGE_HEAD.size:
            raise DamageError(f"there is none at {offset}")
        size = record.size - MESSAGE_HEAD.size
        return _span(source, record.place + MESSAGE_HEAD.size, min(size, most or size))

    @contextlib.contextmanager
    def _opened(self, chunk: Chunk) -> Iterator[tuple[BinaryIO, int, int]]:
        """Where the records of a chunk can be read: source, first, end."""
        if chunk.compression:
            content = chunk_records(self.path, chunk)
            yield io.BytesIO(content), 0, len(content)
            return
        with open_regular(self.path) as file:
            yield file, chunk.place, chunk.place + chunk.bytes

    # --- the index ---

    def _index(self, file: BinaryIO) -> None:
        if file.read(len(MAGIC)) != MAGIC:
            raise ScanError(f"{self.path} is no MCAP file: it does not start like one.")
        unindexed: int | None = None  # number of the chunk whose indexes may follow
        ended = False
        try:
            for record in _records(file, len(MAGIC), file.seek(0, 2)):
                ended = ended or record.kind in (DATA_END, FOOTER)
                if record.kind == INDEX and self._chunks:
                    self._add_index(file, record)
                    unindexed = None
                    continue
                if unindexed is not None:
                    self._scan(unindexed)
                    unindexed = None
                if record.kind == FOOTER:
                    break
                if record.kind == CHUNK:
                    self._chunks.append(_chunk(file, record))
                    unindexed = len(self._chunks) - 1
                self._add(file, record, -1)
        except DamageError as error:
            self.damage = str(error)
        if not ended:
            self.damage = self.damage or "it has no end"
        try:
            if unindexed is not None:
                self._scan(unindexed)
            for nth in range(len(self._chunks)):  # channels are in chunks, and in the summary
                if not self._entries.keys() <= self._topic_of.keys():
                    self._scan(nth, definitions_only=True)
        except ScanError as error:
            self.damage = self.damage or str(error).rstrip(".")

    def _add(self, source: BinaryIO, record: _Record, chunk: int) -> None:
        """Enter a message that no index names, or a channel or its schema."""
        if record.kind == MESSAGE:
            channel, _, time_ns, _ = MESSAGE_HEAD.unpack(
                _span(source, record.place, MESSAGE_HEAD.size)
            )
            entry = np.array([(np.uint64(time_ns).astype(np.int64), chunk, record.start)], ENTRY)
            self._entries[channel].append(entry)
        elif record.kind in (SCHEMA, CHANNEL):
            if record.size > MOST_DEFINITION_BYTES:
                raise DamageError(f"a definition at {record.start} has {record.size} bytes")
            content = io.BytesIO(_span(source, record.place, record.size))
            number = int.from_bytes(_take(content, 2), "little")
            if record.kind == SCHEMA:
                self._schemas[number] = _text(content)
                return
            kind = self._schemas.get(int.from_bytes(_take(content, 2), "little"), "")
            topic = topic_of(_text(content))
            self._topic_of[number] = topic
            self.topics[topic] = Topic(kind_of(kind), _text(content))

    def _add_index(self, file: BinaryIO, record: _Record) -> None:
        """Enter an index, which follows its chunk."""
        chunk = self._chunks[-1]
        content = _span(file, record.place, record.size)
        if len(content) < 6:
            raise DamageError(f"an index at {record.start} is too short")
        channel, size = struct.unpack_from("<HI", content)
        if size > len(content) - 6 or size % STEP.itemsize:
            raise DamageError(f"an index at {record.start} declares {size} bytes")
        steps = np.frombuffer(content, STEP, size // STEP.itemsize, 6)
        found = np.empty(len(steps), ENTRY)
        found["time_ns"] = steps["time_ns"].astype(np.int64)
        found["chunk"] = len(self._chunks) - 1 if chunk.compression else -1
        start = 0 if chunk.compression else chunk.place
        found["offset"] = steps["offset"].astype(np.int64) + start
        self._entries[channel].append(found)

    def _scan(self, number: int, *, definitions_only: bool = False) -> None:
        """Enter what is in a chunk."""
        chunk = self._chunks[number]
        with self._opened(chunk) as (source, first, end):
            for record in _records(source, first, end):
                if not definitions_only or record.kind != MESSAGE:
                    self._add(source, record, number if chunk.compression else -1)


def _chunk(file: BinaryIO, record: _Record) -> Chunk:
    """A chunk from its head; its data is passed over."""
    head = io.BytesIO(_span(file, record.place, min(record.size, CHUNK_HEAD.size + 256)))
    _, _, whole_bytes, _ = CHUNK_HEAD.unpack(_take(head, CHUNK_HEAD.size))
    compression = _text(head)
    size = int.from_bytes(_take(head, 8), "little")
    place = record.place + head.tell()
    if place + size > record.place + record.size:
        raise DamageError(f"a chunk at {record.start} is larger than its record")
    return Chunk(place, size, compression, whole_bytes)


def _records(source: BinaryIO, start: int, end: int) -> Iterator[_Record]:
    """The records between two places."""
    while 0 <= start < end:
        kind, size = struct.unpack("<BQ", _span(source, start, HEAD_BYTES))
        place = start + HEAD_BYTES
        if place + size > end:
            raise DamageError(f"it ends within a record at {start}")
        yield _Record(start, kind, place, size)
        start = place + size


def _span(source: BinaryIO, place: int, size: int) -> bytes:
    source.seek(place)
    return _take(source, size)


def _take(source: BinaryIO, size: int) -> bytes:
    place = source.tell()
    content = source.read(size)
    if len(content) < size:
        raise DamageError(f"it ends within a record at {place}")
    return content


def _text(source: BinaryIO) -> str:
    size = int.from_bytes(_take(source, 4), "little")
    if size > MOST_DEFINITION_BYTES:
        raise DamageError(f"a text has {size} letters")
    return _take(source, size).decode(errors="replace")
