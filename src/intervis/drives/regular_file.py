"""Opening of files that are given by a path: a pipe or a device would block for ever."""

import errno
import stat
from pathlib import Path
from typing import BinaryIO


def open_regular(path: Path) -> BinaryIO:
    """Open a file for reading.

    Raises
    ------
    OSError
        There is no such file, it may not be read, or it is a pipe, a socket or a device.
    """
    mode = path.stat().st_mode
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):  # opening a folder has its own error
        raise OSError(errno.EINVAL, "it is a pipe or a device, not a file", str(path))
    return path.open("rb")


def files_with_ending(folder: Path, ending: str) -> list[Path]:
    """Regular files of a folder with an ending, in any case, by name, without hidden ones."""
    return sorted(
        file
        for file in folder.iterdir()
        if file.name.lower().endswith(ending) and file.is_file() and not file.name.startswith(".")
    )
