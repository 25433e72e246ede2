"""Opening of files that are given by a path: a pipe or a device would block for ever."""

import errno
import stat
from io import BufferedReader
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray


def open_regular(path: Path) -> BufferedReader:
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


def rest_as_numbers(file: BufferedReader, kind: str) -> NDArray[Any]:
    """The numbers from the file's place to its end; bytes that make no whole number are left out.

    Parameters
    ----------
    file : BufferedReader
    kind : str
        Their type, as ``<f4``.
    """
    start = file.tell()
    left_bytes = file.seek(0, 2) - start
    file.seek(start)
    numbers = np.empty(left_bytes // np.dtype(kind).itemsize, kind)
    return numbers[: file.readinto(numbers.data) // numbers.itemsize]


def files_with_ending(folder: Path, ending: str) -> list[Path]:
    """Regular files of a folder with an ending, in any case, by name, without hidden ones."""
    return sorted(
        file
        for file in folder.iterdir()
        if file.name.lower().endswith(ending) and file.is_file() and not file.name.startswith(".")
    )
