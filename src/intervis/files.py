"""Writing of files that appear whole or not at all."""

import contextlib
import errno
import glob
import os
import secrets
import shutil
import stat
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import BinaryIO

from intervis.arguments import address_of
from intervis.errors import OutputError


def refuse_address(path: Path) -> None:
    """Refuse an output in storage that is reached over a network.

    Raises
    ------
    OutputError
        The path is an address, as ``s3://bucket/out``.
    """
    address = address_of(path)
    if address is not None:
        raise OutputError(
            f"cannot write {address}: results are written to a local disk; give a local path, and"
            " copy the results from there."
        )


def check_replaceable(path: Path) -> Path:
    """The file that a write to `path` creates or replaces: links are followed to their target.

    Raises
    ------
    OutputError
        Something that is no regular file stands there (a folder, a device, a pipe), the path cannot
        be looked up, or it is an address.
    """
    refuse_address(path)
    try:
        target = Path(os.path.realpath(path))
        mode = target.stat().st_mode
    except FileNotFoundError:
        return target
    except OSError as error:
        raise OutputError(_write_failure(path, error)) from None
    if stat.S_ISDIR(mode):
        raise OutputError(f"{path} is a folder: give the path of a file.")
    if not stat.S_ISREG(mode):
        raise OutputError(f"{path} is a device, a pipe or a socket: give the path of a file.")
    return target


@contextlib.contextmanager
def whole_file(path: Path) -> Iterator[BinaryIO]:
    """A file to write into, which gets its name only when it is complete.

    Until then it is ``.NAME.*.part`` in the same folder, under a name that no other process or
    thread takes. A failure removes this file; a process that is killed leaves it. A link is kept
    and its target written.

    Yields
    ------
    BinaryIO
        The file, open for writing.

    Raises
    ------
    OutputError
        The system refuses: disk full, no permission, not a folder; or `path` is no regular file.
    """
    target = check_replaceable(path)
    part = target.with_name(f".{target.name}.{secrets.token_hex(6)}.part")
    try:
        try:
            with open(part, "xb") as file:
                yield file
            os.replace(part, target)
        except BaseException:
            with contextlib.suppress(OSError):
                part.unlink(missing_ok=True)
            raise
    except OSError as error:
        raise OutputError(_write_failure(path, error)) from None


def write_whole(path: Path, write: Callable[[BinaryIO], object]) -> None:
    """Call `write` on a file that gets its name only when it is complete; see `whole_file`.

    Raises
    ------
    OutputError
        As `whole_file`.
    """
    with whole_file(path) as file:
        write(file)


def remove_parts(path: Path) -> None:
    """Remove what killed processes have left of a file; only where no other process writes it.

    Raises
    ------
    OutputError
        The system refuses.
    """
    try:
        for part in path.parent.glob(f".{glob.escape(path.name)}.*.part"):
            if not part.is_symlink():
                part.unlink()
    except OSError as error:
        raise OutputError(_write_failure(path, error)) from None


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file whole or not at all, unless it already has this content.

    Missing parent folders are created.

    Raises
    ------
    OutputError
        As `write_whole`.
    """
    check_replaceable(path)
    try:
        if path.is_file() and path.read_bytes() == content:
            return
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(_write_failure(path, error)) from None
    write_whole(path, lambda file: file.write(content))


def write_text(path: Path, text: str) -> None:
    """Write a text file whole or not at all, as `write_whole`."""
    # The text may hold a file name that is not valid UTF-8: its bytes are written escaped.
    content = text.encode("utf-8", errors="backslashreplace")
    write_whole(path, lambda file: file.write(content))


@contextlib.contextmanager
def whole_folder(path: Path) -> Iterator[Path]:
    """A folder to write into, which gets its name only when it is complete.

    Until then it is ``.NAME.XXXX.part`` beside it, with random letters. A failure removes it; a
    killed process leaves it.

    Yields
    ------
    Path
        The folder to write into, empty.

    Raises
    ------
    OutputError
        Something stands at `path` that is no empty folder, or the system refuses: disk full, no
        permission.
    """
    check_new_folder(path)
    target = Path(os.path.realpath(path))
    part = target.with_name(f".{target.name}.{secrets.token_hex(6)}.part")
    try:
        part.mkdir(parents=True)
        try:
            yield part
            os.rename(part, target)  # onto an empty folder, or nothing
        except BaseException:
            shutil.rmtree(part, ignore_errors=True)
            raise
    except OSError as error:
        raise OutputError(_write_failure(path, error)) from None


def check_new_folder(path: Path) -> None:
    """Check that a folder can be made at `path`: there is nothing, or an empty folder.

    Raises
    ------
    OutputError
        Something else stands there, and is not changed; or the path is an address.
    """
    refuse_address(path)
    try:
        if not os.path.lexists(path) or (path.is_dir() and not any(path.iterdir())):
            return
    except OSError as error:
        raise OutputError(_write_failure(path, error)) from None
    what = "holds files already" if path.is_dir() else "is a file"
    raise OutputError(f"{path} {what} and was not changed; choose another output folder.")


def make_folder(path: Path) -> None:
    """Make a folder, with its parents, and check that files can be written into it.

    Raises
    ------
    OutputError
        The folder cannot be made or written to, or its path is an address.
    """
    refuse_address(path)
    probe = path / ".intervis.part"
    try:
        path.mkdir(parents=True, exist_ok=True)
        probe.unlink(missing_ok=True)
        open(probe, "xb").close()
        probe.unlink()
    except OSError as error:
        raise OutputError(
            f"cannot write in {path}: {(error.strerror or str(error)).lower()}; choose another"
            " folder."
        ) from None


def _write_failure(path: Path, error: OSError) -> str:
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        return f"cannot write {path}: the disk is full; free some space and run the command again."
    return f"cannot write {path}: {(error.strerror or str(error)).lower()}."
