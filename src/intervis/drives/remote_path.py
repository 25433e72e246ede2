"""Paths in storage that is reached over a network: ``s3://``, ``gs://`` and others of fsspec.

`RemotePath` has what the readers use of `pathlib.Path`, so that one reader reads local and remote
drives. They share what is known of the storage, for as long as the drive lives.
"""

import errno
import io
import os
import stat
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from fnmatch import fnmatchcase
from functools import total_ordering
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar, cast

from intervis.drives.remote_storage import Storage, told
from intervis.errors import DriveError

if TYPE_CHECKING:
    from _typeshed import WriteableBuffer

Result = TypeVar("Result")

BUFFER_BYTES = 2**16
"""Bytes that readers of lines and headers are given at a time."""

AT_ONCE = 16
"""Requests that wait at the same time."""


def remote_path(address: str) -> Path:
    """The path of an address: `RemotePath`, which readers take for a `Path`.

    Parameters
    ----------
    address : str
        ``SCHEME://BUCKET/PLACE``.

    Raises
    ------
    MissingExtraError
        fsspec is not installed, or what it needs for this storage.
    DriveError
        It knows no such storage.
    OSError
        The storage refuses to be opened.
    """
    scheme, _, rest = address.partition("://")
    return cast(Path, RemotePath(Storage(scheme.lower()), PurePosixPath(rest.strip("/"))))


def is_remote(path: object) -> bool:
    """Whether a path is an address of storage, and not a path on a disk."""
    return isinstance(path, RemotePath)


def check_on_disk(path: Path) -> None:
    """Refuse a remote file of a format whose library opens files on a disk only.

    Raises
    ------
    DriveError
        The path is remote.
    """
    if is_remote(path):
        raise DriveError(
            f"{path} is of a format that is read from local files only: copy it, and give the path"
            " of the copy."
        )


def for_each(function: Callable[[Path], Result], paths: Iterable[Path]) -> Iterable[Result]:
    """What a function returns for each path, in their order; of remote paths, several at once.

    Parameters
    ----------
    function : function of a Path
        Asks for little, so that it mostly waits. What it raises is raised.
    paths : iterable of Path
    """
    listed = list(paths)
    if not any(map(is_remote, listed)):
        return map(function, listed)
    with ThreadPoolExecutor(AT_ONCE) as pool:
        return list(pool.map(function, listed))


class _Stat(NamedTuple):
    """What is asked of `os.stat_result`."""

    st_mode: int
    st_size: int
    st_mtime_ns: int = 0  # a drive is taken for what it was when it was opened


@total_ordering
class RemotePath:
    """A path in remote storage.

    Parameters
    ----------
    storage : Storage
        Shared by the paths of a drive.
    path : PurePosixPath
        The bucket (or host) and the place in it.
    """

    def __init__(self, storage: Storage, path: PurePosixPath) -> None:
        self._storage, self._path = storage, path

    def _at(self, path: PurePosixPath) -> "RemotePath":
        return RemotePath(self._storage, path)

    # --- names ---

    def __str__(self) -> str:
        return self._storage.address(self._path)

    def __repr__(self) -> str:
        return f"RemotePath({str(self)!r})"

    def __hash__(self) -> int:
        return hash((self._storage.scheme, self._path))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, RemotePath) and str(self) == str(other)

    def __lt__(self, other: "RemotePath") -> bool:
        return self._path < other._path

    def __truediv__(self, name: str | PurePosixPath) -> "RemotePath":
        return self._at(self._path / name)

    @property
    def name(self) -> str:
        """The last part."""
        return self._path.name

    @property
    def stem(self) -> str:
        """The name without its last ending."""
        return self._path.stem

    @property
    def suffix(self) -> str:
        """The name's last ending."""
        return self._path.suffix

    @property
    def parent(self) -> "RemotePath":
        """The folder; a bucket is its own."""
        return self._at(self._path.parent) if len(self._path.parts) > 1 else self

    @property
    def parents(self) -> list["RemotePath"]:
        """All folders above, the nearest first, up to the bucket."""
        return [self._at(above) for above in self._path.parents if above != PurePosixPath()]

    def with_name(self, name: str) -> "RemotePath":
        """The path beside this one with another name."""
        return self._at(self._path.with_name(name))

    def with_suffix(self, suffix: str) -> "RemotePath":
        """The path with another last ending."""
        return self._at(self._path.with_suffix(suffix))

    def relative_to(self, other: "RemotePath") -> PurePosixPath:
        """The part below another path."""
        return self._path.relative_to(other._path)

    def resolve(self) -> "RemotePath":
        """Itself: storage has no links, and an address is absolute."""
        return self

    absolute = resolve

    # --- what is there ---

    def exists(self) -> bool:
        """Whether there is a file or a folder."""
        return self._storage.entry(self._path) is not None

    def is_file(self) -> bool:
        """Whether there is a file."""
        return self.exists() and stat.S_ISREG(self.stat().st_mode)

    def is_dir(self) -> bool:
        """Whether there is a folder."""
        return self.exists() and stat.S_ISDIR(self.stat().st_mode)

    def stat(self) -> _Stat:
        """Kind and size.

        Raises
        ------
        OSError
            There is nothing, or the storage refuses.
        """
        entry = self._storage.entry(self._path)
        if entry is None:
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(self))
        modes = {"file": stat.S_IFREG, "directory": stat.S_IFDIR}
        return _Stat(modes.get(entry.kind, 0), entry.size_bytes)

    def iterdir(self) -> Iterator["RemotePath"]:
        """The entries of a folder."""
        return (self / name for name in self._storage.listing(self._path))

    def glob(self, pattern: str) -> Iterator["RemotePath"]:
        """The entries whose names below this folder match a pattern, part by part."""
        first, _, rest = pattern.partition("/")
        for path in self._matching(first):
            if not rest:
                yield path
            elif path.is_dir():
                yield from path.glob(rest)

    def _matching(self, pattern: str) -> list["RemotePath"]:
        if not any(mark in pattern for mark in "*?["):
            path = self / pattern
            return [path] if path.exists() else []
        if not self.is_dir():
            return []
        return [path for path in self.iterdir() if fnmatchcase(path.name, pattern)]

    def open(self, mode: str = "rb") -> io.BufferedReader:
        """The file, open for reading; it is fetched in parts, as they are read.

        Raises
        ------
        OSError
            There is no such file, or the storage refuses.
        """
        if mode != "rb":
            raise OSError(errno.EROFS, "addresses are read and not written", str(self))
        return io.BufferedReader(
            _RemoteFile(self._storage.open(self._path), str(self)), BUFFER_BYTES
        )


class _RemoteFile(io.RawIOBase):
    """A file of fsspec whose failures are those of a disk."""

    def __init__(self, file: Any, address: str) -> None:
        self._file, self._address = file, address

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def seek(self, place: int, whence: int = 0) -> int:
        with told(self._address):
            return int(self._file.seek(place, whence))

    def tell(self) -> int:
        return int(self._file.tell())

    def readinto(self, buffer: "WriteableBuffer") -> int:
        with told(self._address):
            return int(self._file.readinto(buffer))

    def readall(self) -> bytes:
        with told(self._address):
            return bytes(self._file.read())

    def close(self) -> None:
        if not self.closed:
            self._file.close()
        super().close()
