"""Paths in storage that is reached over a network: ``s3://``, ``gs://`` and others of fsspec.

`RemotePath` has what the readers use of `pathlib.Path`, so that one reader reads local and remote
drives. A request takes tens of milliseconds: what a folder holds is asked once, and is known for as
long as the paths of the drive live. What the storage refuses is raised as `OSError`, as a disk
raises it, whichever exception the library of the storage has for it.
"""

import errno
import io
import os
import stat
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from fnmatch import fnmatchcase
from functools import total_ordering
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar, cast

from intervis.errors import DriveError, MissingExtraError

if TYPE_CHECKING:
    from _typeshed import WriteableBuffer

Result = TypeVar("Result")

AT_ONCE = 16
"""Requests that wait at the same time."""

LISTED_AFTER = 8
"""Questions about single entries of a folder after which the whole folder is listed."""

AHEAD_BYTES, BUFFER_BYTES = 2**18, 2**16
"""Bytes that are read beyond those asked for: a header takes one request, and not the file."""

EXTRAS = {
    "s3": ("s3fs", "s3"),
    "s3a": ("s3fs", "s3"),
    "gs": ("gcsfs", "gs"),
    "gcs": ("gcsfs", "gs"),
}
"""Package and extra that read an address, by how it starts."""

KINDS = {
    FileNotFoundError: errno.ENOENT,
    PermissionError: errno.EACCES,
    TimeoutError: errno.ETIMEDOUT,
}
"""What storage raises without the number of the error."""


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
    return cast(Path, RemotePath(_Storage(scheme.lower()), PurePosixPath(rest.strip("/"))))


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


class _Entry(NamedTuple):
    """What storage tells of a file or a folder."""

    kind: str
    """``file`` or ``directory``; of some storage also others."""
    size_bytes: int


class _Stat(NamedTuple):
    """What is asked of `os.stat_result`."""

    st_mode: int
    st_size: int
    st_mtime_ns: int = 0  # a drive is taken for what it was when it was opened


class _Storage:
    """A file system of fsspec, and what is known of its entries."""

    def __init__(self, scheme: str) -> None:
        self.scheme = scheme
        self._files = _file_system(scheme)
        self._files.invalidate_cache()  # what it knows of drives that were opened before
        self._known: dict[PurePosixPath, _Entry | None] = {}
        self._listings: dict[PurePosixPath, dict[str, _Entry]] = {}
        self._questions: Counter[PurePosixPath] = Counter()
        self._unlisted = {PurePosixPath()}
        """Folders that may not be listed; buckets are not searched for."""

    def __reduce__(self) -> tuple[type["_Storage"], tuple[str]]:
        return type(self), (self.scheme,)  # a worker process asks for itself

    def address(self, path: PurePosixPath) -> str:
        """The address of a path in this storage."""
        return f"{self.scheme}://{'' if path == PurePosixPath() else path}"

    def entry(self, path: PurePosixPath) -> _Entry | None:
        """What stands at a path; None where there is nothing."""
        if path in self._known:
            return self._known[path]
        folder = path.parent
        self._questions[folder] += 1
        if self._questions[folder] > LISTED_AFTER and folder not in self._unlisted:
            self._try_to_list(folder)
        if folder in self._listings:
            return self._listings[folder].get(path.name)
        return self._known.setdefault(path, self._ask(path))

    def listing(self, folder: PurePosixPath) -> dict[str, _Entry]:
        """The entries of a folder by name."""
        if folder not in self._listings:
            with _told(self.address(folder)):
                found = self._files.ls(self.address(folder), detail=True)
            own = self._files._strip_protocol(self.address(folder)).rstrip("/")
            self._listings[folder] = {
                one["name"].rstrip("/").rpartition("/")[2]: _entry(one)
                for one in found
                if one["name"].rstrip("/") != own  # object storage lists the mark of a folder
            }
        return self._listings[folder]

    def open(self, path: PurePosixPath) -> Any:
        """A file of fsspec, open for reading."""
        with _told(self.address(path)):
            return self._files.open(self.address(path), "rb", block_size=AHEAD_BYTES)

    def _ask(self, path: PurePosixPath) -> _Entry | None:
        try:
            with _told(self.address(path)):
                return _entry(self._files.info(self.address(path)))
        except (FileNotFoundError, NotADirectoryError):
            return None

    def _try_to_list(self, folder: PurePosixPath) -> None:
        try:
            self.listing(folder)
        except OSError:
            self._unlisted.add(folder)


@total_ordering
class RemotePath:
    """A path in remote storage.

    Parameters
    ----------
    storage : _Storage
        Shared by the paths of a drive.
    path : PurePosixPath
        The bucket (or host) and the place in it.
    """

    def __init__(self, storage: _Storage, path: PurePosixPath) -> None:
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
        with _told(self._address):
            return int(self._file.seek(place, whence))

    def tell(self) -> int:
        return int(self._file.tell())

    def readinto(self, buffer: "WriteableBuffer") -> int:
        with _told(self._address):
            return int(self._file.readinto(buffer))

    def readall(self) -> bytes:
        with _told(self._address):
            return bytes(self._file.read())

    def close(self) -> None:
        if not self.closed:
            self._file.close()
        super().close()


def _file_system(scheme: str) -> Any:
    """The file system for addresses that start so."""
    purpose = f"Reading {scheme}:// addresses"
    try:
        import fsspec
    except ImportError:
        package, extra = EXTRAS.get(scheme, ("fsspec", "remote"))
        raise MissingExtraError(package, extra, purpose) from None
    try:
        fsspec.get_filesystem_class(scheme)
    except ImportError as error:
        if scheme in EXTRAS:
            raise MissingExtraError(*EXTRAS[scheme], purpose) from None
        raise DriveError(f"{purpose} needs another package: {_reason(error)}.") from None
    except ValueError:
        raise DriveError(
            f"there is no storage {scheme}://: give a local path, or an address that fsspec reads"
            " (s3://, gs://)."
        ) from None
    with _told(f"{scheme}://"):
        return fsspec.filesystem(scheme)


@contextmanager
def _told(address: str) -> Iterator[None]:
    """Raise what storage refuses as `OSError` with a reason."""
    try:
        yield
    except Exception as error:  # each storage has its own types
        number = next((KINDS[kind] for kind in KINDS if isinstance(error, kind)), None)
        if number is not None:
            raise OSError(number, os.strerror(number), address) from None
        number = getattr(error, "errno", None) or errno.EIO
        raise OSError(number, _reason(error), address) from None


def _reason(error: Exception) -> str:
    reason = getattr(error, "strerror", None) or str(error) or type(error).__name__
    return str(reason).splitlines()[0][:200].rstrip(".: ")


def _entry(info: dict[str, Any]) -> _Entry:
    size_bytes = info.get("size")
    return _Entry(str(info.get("type", "file")), -1 if size_bytes is None else int(size_bytes))
