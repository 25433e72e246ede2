"""The SQLite files of ROS 2 bags (``.db3``): a table of topics and a table of messages."""

import contextlib
import sqlite3
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
from numpy.typing import NDArray

from intervis.drives.message_file import (
    ENTRY,
    MOST_CHUNK_BYTES,
    Topic,
    kind_of,
    topic_of,
    zstd_decompressor,
)
from intervis.drives.regular_file import open_regular
from intervis.drives.remote_path import check_on_disk
from intervis.errors import MissingExtraError, ScanError

MAGIC = b"SQLite format 3\0"
ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
MOST_MESSAGE_BYTES = 2**30
MOST_TOPICS = 100_000
DATABASE_ERRORS = (sqlite3.Error, ValueError, TypeError, OverflowError)
"""What reading a damaged database raises."""


class Rosbag2Database:
    """The messages of a file; see `message_file.MessageFile`.

    Raises
    ------
    ScanError
        The file is no database with topics and messages.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.topics: dict[str, Topic] = {}
        self.damage = ""
        self._numbers: dict[str, list[int]] = {}
        with self._opened() as database:
            rows = database.execute("SELECT id, name, type, serialization_format FROM topics")
            for number, name, kind, encoding in rows.fetchmany(MOST_TOPICS):
                topic = topic_of(str(name))
                self._numbers.setdefault(topic, []).append(int(number))
                self.topics[topic] = Topic(kind_of(str(kind)), str(encoding))
            database.execute("SELECT topic_id, timestamp, data FROM messages LIMIT 1").fetchone()

    def entries(self, topic: str) -> NDArray[Any]:
        """See `message_file.MessageFile`; the offset is the number of the row."""
        found = []
        ask = "SELECT timestamp, -1, id FROM messages WHERE topic_id = ? ORDER BY timestamp, id"
        try:
            with self._opened() as database:
                for number in self._numbers.get(topic, []):
                    rows = database.execute(ask, (number,))
                    while part := rows.fetchmany(10_000):
                        found.append(np.array(part, ENTRY))
        except ScanError as error:
            self.damage = str(error).rstrip(".")
        return np.concatenate(found) if found else np.empty(0, ENTRY)

    def read(self, entry: Any, most: int | None = None) -> bytes:
        """See `message_file.MessageFile`."""
        with self._opened() as database:
            return self._content(database, entry, most)

    def read_many(self, entries: NDArray[Any], most: int | None = None) -> Iterator[bytes | None]:
        """See `message_file.MessageFile`."""
        with self._opened() as database:
            for entry in entries:
                try:
                    yield self._content(database, entry, most)
                except (ScanError, *DATABASE_ERRORS):
                    yield None

    def _content(self, database: sqlite3.Connection, entry: Any, most: int | None) -> bytes:
        row = int(entry["offset"])
        with database.blobopen("messages", "data", row, readonly=True) as blob:
            if len(blob) > MOST_MESSAGE_BYTES:
                raise ScanError(f"{self.path} holds a message of {len(blob)} bytes, too many.")
            start = blob.read(len(ZSTD_MAGIC))
            if start == ZSTD_MAGIC:
                return self._decompressed(start + blob.read())
            return start + blob.read(max(0, min(most or len(blob), len(blob)) - len(start)))

    def _decompressed(self, content: bytes) -> bytes:
        try:
            one = zstd_decompressor()()
        except ImportError:
            purpose = f"Reading {self.path.name}, which is compressed with zstd,"
            raise MissingExtraError("backports.zstd", "ros", purpose) from None
        try:
            message: bytes = one.decompress(content, max_length=MOST_CHUNK_BYTES)
        except Exception as error:  # the library's own
            raise ScanError(f"{self.path} has a damaged message ({error}).") from None
        if not one.eof:
            raise ScanError(f"{self.path} has a message that is cut, or too large.")
        return message

    @contextlib.contextmanager
    def _opened(self) -> Iterator[sqlite3.Connection]:
        check_on_disk(self.path)
        try:
            with open_regular(self.path) as file:
                if file.read(len(MAGIC)) != MAGIC:
                    raise ScanError(f"{self.path} is no SQLite database.")
            # Without a lock, and without the file of a recorder's journal: nothing is written.
            name = f"file:{quote(str(self.path))}?mode=ro&immutable=1"
            with contextlib.closing(sqlite3.connect(name, uri=True)) as database:
                database.text_factory = lambda text: text.decode(errors="replace")
                yield database
        except OSError as error:
            raise ScanError(f"cannot read {self.path}: {error.strerror}.") from None
        except DATABASE_ERRORS as error:
            reason = " ".join(str(error).split())[:120].rstrip(".")
            raise ScanError(f"{self.path} is no readable ROS 2 bag ({reason}).") from None
