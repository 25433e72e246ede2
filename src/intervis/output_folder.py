"""Ownership of an output folder: a file marks it as ours, and is locked while a run writes.

The lock is the operating system's (``flock``) and ends with the process that holds it, however it
ends. Without ``fcntl`` (Windows), or where the file system knows no locks, nothing is locked.
"""

import contextlib
import errno
import logging
import os
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from intervis.errors import OutputError

fcntl: Any
try:
    import fcntl
except ImportError:  # Windows
    fcntl = None

log = logging.getLogger(__name__)

MARKER = ".intervis"
"""Name of the marker file in an output folder."""

_TEXT = b"This folder was made by intervis. The file is locked while a run writes here.\n"


def is_marked(folder: Path) -> bool:
    """Whether intervis made the folder, or has written into it before."""
    return _is_regular(folder / MARKER)


def is_own_file(path: Path) -> bool:
    """Whether a file of an output folder can be one of ours: regular, and reached by no link.

    We never make links, so what a link below the output folder leads to is someone else's.
    """
    return _is_regular(path) and not path.parent.is_symlink()


def refuse_links(*paths: Path) -> None:
    """Refuse to write through links that stand where files and folders of ours would.

    Raises
    ------
    OutputError
        One of the paths is a link.
    """
    for path in paths:
        if path.is_symlink():
            raise OutputError(
                f"{path} is a link, and results are not written through links: remove it, or choose"
                " another folder."
            )


def refuse_links_below(folder: Path, path: Path) -> None:
    """Refuse to write a file of an output folder through a link that stands in that folder.

    Raises
    ------
    OutputError
        The file, or a folder between it and the output folder, is a link.
    """
    parts = path.relative_to(folder).parts
    refuse_links(*(folder.joinpath(*parts[: depth + 1]) for depth in range(len(parts))))


@contextlib.contextmanager
def locked(folder: Path, *, shared: bool = False, name: str = MARKER) -> Iterator[None]:
    """Hold an existing output folder while writing to it.

    Parameters
    ----------
    folder : Path
        The folder; the file `name` is made in it, and stays.
    shared : bool
        Let others hold it too, if they share it as well.
    name : str
        The file to lock.

    Raises
    ------
    OutputError
        Another process holds the folder, or the file cannot be made.
    """
    path = folder / name
    refuse_links(path)
    try:
        file = os.open(path, os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), 0o666)
    except OSError as error:
        raise OutputError(
            f"cannot write in {folder}: {(error.strerror or str(error)).lower()}."
        ) from None
    try:
        _lock(file, folder, shared=shared)
        if os.fstat(file).st_size == 0:
            os.write(file, _TEXT)
        yield
    finally:
        os.close(file)  # which ends the lock


def _lock(file: int, folder: Path, *, shared: bool) -> None:
    if fcntl is None:
        return
    try:
        fcntl.flock(file, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno in (errno.EWOULDBLOCK, errno.EACCES):
            raise OutputError(
                f"another process is writing to {folder}: wait until it has ended, or choose"
                " another folder."
            ) from None
        log.warning("%s cannot be locked (%s): start no second run there.", folder, error.strerror)


def _is_regular(path: Path) -> bool:
    try:
        return stat.S_ISREG(path.lstat().st_mode)
    except OSError:
        return False
