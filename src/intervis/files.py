"""Files that appear whole or not at all."""

import contextlib
import errno
import os
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

from intervis.errors import OutputError


def write_whole(path: Path, write: Callable[[BinaryIO], None]) -> None:
    """Let `write` fill a file that appears under its name only when it is complete.

    The unfinished file lies beside it as ``.NAME.part``; a failure removes it, and the next
    attempt overwrites what a killed process may have left.

    Raises
    ------
    OutputError
        The system refuses: disk full, no permission, not a folder.
    """
    part = path.with_name(f".{path.name}.part")
    try:
        try:
            with open(part, "wb") as file:
                write(file)
            os.replace(part, path)
        except BaseException:
            with contextlib.suppress(OSError):
                part.unlink(missing_ok=True)
            raise
    except OSError as error:
        raise OutputError(_write_failure(path, error)) from None


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file whole or not at all; one that already holds this content is left alone.

    Folders on the way are made.

    Raises
    ------
    OutputError
        As `write_whole`.
    """
    try:
        if path.is_file() and path.read_bytes() == content:
            return
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(_write_failure(path, error)) from None
    write_whole(path, lambda file: _write(file, content))


def write_text(path: Path, text: str) -> None:
    """Write a text file whole or not at all, as `write_whole`."""
    # A file name that is no valid text may stand in it: it is shown escaped, not refused.
    content = text.encode("utf-8", errors="backslashreplace")
    write_whole(path, lambda file: _write(file, content))


def _write(file: BinaryIO, content: bytes) -> None:
    file.write(content)


def _write_failure(path: Path, error: OSError) -> str:
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        return f"cannot write {path}: the disk is full; free some space and run the command again."
    return f"cannot write {path}: {(error.strerror or str(error)).lower()}."
