"""Recordings of records in chunks: what ROS 1 bags and MCAP files have in common."""

import contextlib
import io
from abc import ABC, abstractmethod
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from intervis.drives.message_file import ENTRY, Chunk, DamageError, Topic, chunk_records
from intervis.drives.regular_file import open_regular
from intervis.errors import ScanError

Record = TypeVar("Record")


class ChunkedFile(ABC, Generic[Record]):
    """The messages of a file; see `message_file.MessageFile`.

    A format says how records are walked, which of them are definitions, and where the message
    of an entry lies. The records of a chunk without compression are read where they lie in the
    file.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.topics: dict[str, Topic] = {}
        self.damage = ""
        self._chunks: list[Chunk] = []
        self._entries: dict[int, list[NDArray[Any]]] = defaultdict(list)
        """Entries of messages by the number of their channel or connection."""
        self._topic_of: dict[int, str] = {}
        try:
            with open_regular(path) as file:
                self._index(file)
        except OSError as error:
            raise ScanError(f"cannot read {path}: {error.strerror}.") from None

    @abstractmethod
    def _index(self, file: BinaryIO) -> None:
        """Walk the file, and enter topics and messages."""

    @abstractmethod
    def _records(self, source: BinaryIO, start: int, end: int) -> Iterator[Record]:
        """The records between two places."""

    @abstractmethod
    def _is_definition(self, record: Record) -> bool:
        """Whether a record defines topics."""

    @abstractmethod
    def _add(self, source: BinaryIO, record: Record, chunk: int) -> None:
        """Enter a message that no index names, or a definition."""

    @abstractmethod
    def _message(self, source: BinaryIO, offset: int, end: int) -> tuple[int, int]:
        """Place and size of the content of the message whose record starts at an offset."""

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
        place, size = self._message(source, offset, end)
        return span(source, place, min(size, most or size))

    @contextlib.contextmanager
    def _opened(self, chunk: Chunk) -> Iterator[tuple[BinaryIO, int, int]]:
        """Where the records of a chunk can be read: source, first, end."""
        if chunk.compression:
            content = chunk_records(self.path, chunk)
            yield io.BytesIO(content), 0, len(content)
            return
        with open_regular(self.path) as file:
            yield file, chunk.place, chunk.place + chunk.bytes

    def _enter(self, channel: int, times_ns: NDArray[np.int64], offsets: NDArray[Any]) -> None:
        """Enter messages of the last chunk; offsets count from the start of its records."""
        chunk, found = self._chunks[-1], np.empty(len(times_ns), ENTRY)
        found["time_ns"] = times_ns
        found["chunk"] = len(self._chunks) - 1 if chunk.compression else -1
        found["offset"] = offsets.astype(np.int64) + (0 if chunk.compression else chunk.place)
        self._entries[channel].append(found)

    def _scan(self, number: int, *, definitions_only: bool = False) -> None:
        """Enter what is in a chunk."""
        chunk = self._chunks[number]
        with self._opened(chunk) as (source, first, end):
            for record in self._records(source, first, end):
                if not definitions_only or self._is_definition(record):
                    self._add(source, record, number if chunk.compression else -1)

    def _find_topics(self, unindexed: int | None) -> None:
        """Scan the last chunk, if no index followed it, and chunks for topics that are missing."""
        try:
            if unindexed is not None:
                self._scan(unindexed)
            for nth in range(len(self._chunks)):  # definitions stand in chunks, too
                if not self._entries.keys() <= self._topic_of.keys():
                    self._scan(nth, definitions_only=True)
        except ScanError as error:
            self.damage = self.damage or str(error).rstrip(".")


def span(source: BinaryIO, place: int, size: int) -> bytes:
    """Bytes of a source; `DamageError` where it ends before."""
    source.seek(place)
    content = source.read(size)
    if len(content) < size:
        raise DamageError(f"it ends within a record at {place}")
    return content
