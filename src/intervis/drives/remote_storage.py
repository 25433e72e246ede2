"""Storage that fsspec reads, and what is known of its entries.

A request takes tens of milliseconds: what a folder holds is asked once. What the storage refuses is
raised as `OSError`, as a disk raises it, whichever exception the library of the storage has for it.
"""

import errno
import os
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import PurePosixPath
from typing import Any, NamedTuple

from intervis.errors import DriveError, MissingExtraError

LISTED_AFTER = 8
"""Questions about single entries of a folder after which the whole folder is listed."""

AHEAD_BYTES = 2**18
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
    NotADirectoryError: errno.ENOTDIR,
    IsADirectoryError: errno.EISDIR,
}
"""What storage raises without the number of the error."""


class Entry(NamedTuple):
    """What storage tells of a file or a folder."""

    kind: str
    """``file`` or ``directory``; of some storage also others."""
    size_bytes: int


class Storage:
    """A file system of fsspec, and what is known of its entries."""

    def __init__(self, scheme: str) -> None:
        self.scheme = scheme
        self._files = _file_system(scheme)
        self._files.invalidate_cache()  # what it knows of drives that were opened before
        self._known: dict[PurePosixPath, Entry | None] = {}
        self._listings: dict[PurePosixPath, dict[str, Entry]] = {}
        self._questions: Counter[PurePosixPath] = Counter()
        self._unlisted = {PurePosixPath()}
        """Folders that may not be listed; buckets are not searched for."""

    def __reduce__(self) -> tuple[type["Storage"], tuple[str]]:
        return type(self), (self.scheme,)  # a worker process asks for itself

    def address(self, path: PurePosixPath) -> str:
        """The address of a path in this storage."""
        return f"{self.scheme}://{'' if path == PurePosixPath() else path}"

    def entry(self, path: PurePosixPath) -> Entry | None:
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

    def listing(self, folder: PurePosixPath) -> dict[str, Entry]:
        """The entries of a folder by name."""
        if folder not in self._listings:
            with told(self.address(folder)):
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
        with told(self.address(path)):
            return self._files.open(self.address(path), "rb", block_size=AHEAD_BYTES)

    def _ask(self, path: PurePosixPath) -> Entry | None:
        try:
            with told(self.address(path)):
                return _entry(self._files.info(self.address(path)))
        except (FileNotFoundError, NotADirectoryError):
            return None

    def _try_to_list(self, folder: PurePosixPath) -> None:
        try:
            self.listing(folder)
        except OSError:
            self._unlisted.add(folder)


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
    with told(f"{scheme}://"):
        return fsspec.filesystem(scheme)


@contextmanager
def told(address: str) -> Iterator[None]:
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


def _entry(info: dict[str, Any]) -> Entry:
    size_bytes = info.get("size")
    return Entry(str(info.get("type", "file")), -1 if size_bytes is None else int(size_bytes))
