"""What the files of recorded messages have in common: an index, chunks, and bounded reading.

A file is indexed when it is opened: where each message lies, by topic. Messages are read on
demand. Nothing holds a file open, so that drives travel between processes.
"""

import bz2
from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from intervis.drives.regular_file import open_regular
from intervis.drives.ros_encoding import Encoding, readable
from intervis.errors import MissingExtraError, ScanError

MOST_CHUNK_BYTES = 2**28
"""Size of a decompressed chunk at most: memory is taken for what a file declares."""

ENTRY = np.dtype([("time_ns", "i8"), ("chunk", "i8"), ("offset", "i8")])
"""Where a message lies: the number of its chunk, -1 for none, and the offset of its record in the
decompressed chunk, or in the file."""


class Topic(NamedTuple):
    """A topic: the name of its message type (``sensor_msgs/PointCloud2``) and its encoding."""

    kind: str
    encoding: Encoding | str


class MessageFile(Protocol):
    """A file of recorded messages.

    Attributes
    ----------
    path : Path
    topics : mapping of str to Topic
    damage : str
        What keeps the file from being read to its end; empty for a whole file.
    """

    path: Path
    damage: str

    @property
    def topics(self) -> Mapping[str, Topic]:
        """The topics by their names."""

    def entries(self, topic: str) -> NDArray[Any]:
        """(M,) array of `ENTRY` with the messages of a topic, in the order of the file."""

    def read(self, entry: Any, most: int | None = None) -> bytes:
        """The content of a message, or its first `most` bytes where the file can stop there.

        Raises
        ------
        ScanError
            The message is damaged.
        """

    def read_many(self, entries: NDArray[Any], most: int | None = None) -> Iterator[bytes | None]:
        """The contents of many messages, as `read`; None for a damaged one."""


class Chunk(NamedTuple):
    """A chunk of records: place and size of its data in the file, compression, size of it all."""

    place: int
    bytes: int
    compression: str
    whole_bytes: int


class DamageError(ScanError):
    """A record does not hold what it declares."""


def kind_of(name: str) -> str:
    """A message type without the middle part of ROS 2.

    Examples
    --------
    >>> kind_of("sensor_msgs/msg/PointCloud2")
    'sensor_msgs/PointCloud2'
    """
    parts = readable(name).split("/")
    return f"{parts[0]}/{parts[-1]}"


def topic_of(name: str) -> str:
    """A topic with one slash before it.

    Examples
    --------
    >>> topic_of("lidar/points")
    '/lidar/points'
    """
    return f"/{readable(name).strip('/')}"


def read_span(path: Path, place: int, size: int) -> bytes:
    """Bytes of a file.

    Raises
    ------
    ScanError
        The file ends before.
    """
    try:
        with open_regular(path) as file:
            if place < 0 or size < 0 or place + size > file.seek(0, 2):
                raise ScanError(f"{path} ends within a message at {place}.")
            file.seek(place)
            return file.read(size)
    except OSError as error:
        raise ScanError(f"cannot read {path}: {error.strerror}.") from None


@lru_cache(maxsize=1)  # the messages of a chunk are mostly asked for one after the other
def decompressed(path: Path, chunk: Chunk, size: int, time_ns: int) -> bytes:
    """The records of a chunk.

    Parameters
    ----------
    path : Path
    chunk : Chunk
    size, time_ns : int
        Of the file, so that a changed file is read again.

    Raises
    ------
    ScanError
        The chunk is damaged, or too large, or of an unknown compression.
    MissingExtraError
        The decompressor is not installed.
    """
    if chunk.whole_bytes > MOST_CHUNK_BYTES:
        raise ScanError(
            f"{path} declares a chunk of {chunk.whole_bytes} bytes at {chunk.place}, more than"
            f" {MOST_CHUNK_BYTES}."
        )
    content = read_span(path, chunk.place, chunk.bytes)
    new = _decompressor(path, chunk.compression)
    whole = bytearray()
    try:
        while content and len(whole) <= chunk.whole_bytes:
            one = new()
            whole += one.decompress(content, max_length=chunk.whole_bytes + 1 - len(whole))
            if not one.eof:
                break
            content = one.unused_data or b""
    except Exception as error:  # each library has its own
        reason = " ".join(str(error).split())[:120].rstrip(".")
        raise ScanError(f"{path} has a damaged chunk at {chunk.place} ({reason}).") from None
    if len(whole) != chunk.whole_bytes:
        raise ScanError(f"{path} has a chunk at {chunk.place} of another size than it declares.")
    return bytes(whole)


def _decompressor(path: Path, compression: str) -> Callable[[], Any]:
    try:
        if compression == "bz2":
            return bz2.BZ2Decompressor
        if compression == "lz4":
            import lz4.frame

            return lz4.frame.LZ4FrameDecompressor  # type: ignore[no-any-return]
        if compression == "zstd":
            return zstd_decompressor()
    except ImportError:
        package = {"lz4": "lz4", "zstd": "backports.zstd"}[compression]
        purpose = f"Reading {path.name}, which is compressed with {compression},"
        raise MissingExtraError(package, "ros", purpose) from None
    raise ScanError(f"{path} has chunks of the unknown compression {compression!r:.40}.")


def zstd_decompressor() -> Callable[[], Any]:
    """The class that decompresses Zstandard: of Python 3.14, or of its backport."""
    try:
        from compression import zstd
    except ImportError:
        from backports import zstd
    return zstd.ZstdDecompressor  # type: ignore[no-any-return]


def chunk_records(path: Path, chunk: Chunk) -> bytes:
    """The records of a compressed chunk; see `decompressed`."""
    try:
        stat = path.stat()
    except OSError as error:
        raise ScanError(f"cannot read {path}: {error.strerror}.") from None
    return decompressed(path, chunk, stat.st_size, stat.st_mtime_ns)
