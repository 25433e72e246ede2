"""MCAP files: records, mostly in chunks, each chunk followed by the indexes of its channels.

The file is walked from record to record; chunks are skipped where they have an index. So a file
whose recorder was killed, which has no summary at its end, is read up to its damage.
Source: mcap.dev/spec.
"""

import io
import struct
from collections.abc import Iterator
from pathlib import Path
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


class McapFile(ChunkedFile[_Record]):
    """The messages of a file; see `message_file.MessageFile`.

    Raises
    ------
    ScanError
        The file is no MCAP.
    """

    def __init__(self, path: Path) -> None:
        self._schemas: dict[int, str] = {}
        super().__init__(path)

    def _records(self, source: BinaryIO, start: int, end: int) -> Iterator[_Record]:
        return _records(source, start, end)

    def _is_definition(self, record: _Record) -> bool:
        return record.kind != MESSAGE

    def _message(self, source: BinaryIO, offset: int, end: int) -> tuple[int, int]:
        record = next(_records(source, offset, end), None)
        if record is None or record.kind != MESSAGE or record.size < MESSAGE_HEAD.size:
            raise DamageError(f"there is none at {offset}")
        return record.place + MESSAGE_HEAD.size, record.size - MESSAGE_HEAD.size

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
        self._find_topics(unindexed)

    def _add(self, source: BinaryIO, record: _Record, chunk: int) -> None:
        """Enter a message that no index names, or a channel or its schema."""
        if record.kind == MESSAGE:
            channel, _, time_ns, _ = MESSAGE_HEAD.unpack(
                span(source, record.place, MESSAGE_HEAD.size)
            )
            entry = np.array([(np.uint64(time_ns).astype(np.int64), chunk, record.start)], ENTRY)
            self._entries[channel].append(entry)
        elif record.kind in (SCHEMA, CHANNEL):
            if record.size > MOST_DEFINITION_BYTES:
                raise DamageError(f"a definition at {record.start} has {record.size} bytes")
            content = io.BytesIO(span(source, record.place, record.size))
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
        content = span(file, record.place, record.size)
        if len(content) < 6:
            raise DamageError(f"an index at {record.start} is too short")
        channel, size = struct.unpack_from("<HI", content)
        if size > len(content) - 6 or size % STEP.itemsize:
            raise DamageError(f"an index at {record.start} declares {size} bytes")
        steps = np.frombuffer(content, STEP, size // STEP.itemsize, 6)
        self._enter(channel, steps["time_ns"].astype(np.int64), steps["offset"])


def _chunk(file: BinaryIO, record: _Record) -> Chunk:
    """A chunk from its head; its data is passed over."""
    head = io.BytesIO(span(file, record.place, min(record.size, CHUNK_HEAD.size + 256)))
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
        kind, size = struct.unpack("<BQ", span(source, start, HEAD_BYTES))
        place = start + HEAD_BYTES
        if place + size > end:
            raise DamageError(f"it ends within a record at {start}")
        yield _Record(start, kind, place, size)
        start = place + size


def _take(source: BinaryIO, size: int) -> bytes:
    return span(source, source.tell(), size)


def _text(source: BinaryIO) -> str:
    size = int.from_bytes(_take(source, 4), "little")
    if size > MOST_DEFINITION_BYTES:
        raise DamageError(f"a text has {size} letters")
    return _take(source, size).decode(errors="replace")
