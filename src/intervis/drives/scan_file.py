"""Reading a scan file in any supported format, selected by the ending of its name."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from intervis.drives.pcd_file import read_pcd
from intervis.drives.ply_file import read_ply
from intervis.drives.scan import Scan, scan_of_rows
from intervis.errors import ScanError


def read_bin(path: Path) -> Scan:
    """Read a KITTI scan: x, y, z and intensity of each point as little-endian float32.

    Raises
    ------
    ScanError
        The file holds no points, or its size is not a multiple of a point's size.
    """
    return _read_float32_rows(path, ("intensity",))


def read_nuscenes(path: Path) -> Scan:
    """Read a nuScenes sweep: x, y, z, intensity and ring as little-endian float32."""
    return _read_float32_rows(path, ("intensity", "ring"))


def read_npy(path: Path) -> Scan:
    """Read an array (N, 3) or (N, 4) of float32 or float64; the fourth column is intensity.

    Raises
    ------
    ScanError
        The file is not a plain array (pickled objects are never loaded), has another shape or
        type, or holds no points.
    """
    try:
        # A memory map fails on a header that declares more than the file holds, and allocates
        # nothing.
        rows = np.load(path, mmap_mode="r", allow_pickle=False)
    except OSError:
        raise
    except Exception as error:  # numpy evaluates the header as a literal: various types
        raise ScanError(f"the scan {path} is not a readable .npy array: {_brief(error)}.") from None
    if not isinstance(rows, np.ndarray):
        raise ScanError(f"the scan {path} is an archive of arrays, not one .npy array.")
    if rows.ndim != 2 or rows.shape[1] not in (3, 4):
        raise ScanError(f"the scan {path} must have the shape (N, 3) or (N, 4), not {rows.shape}.")
    if rows.dtype.kind != "f" or rows.dtype.itemsize not in (4, 8):
        raise ScanError(f"the scan {path} must be float32 or float64 metres, not {rows.dtype}.")
    return scan_of_rows(path, np.array(rows), ("intensity",)[: rows.shape[1] - 3])


READERS: dict[str, Callable[[Path], Scan]] = {
    ".pcd.bin": read_nuscenes,
    ".bin": read_bin,
    ".npy": read_npy,
    ".pcd": read_pcd,
    ".ply": read_ply,
}
"""Readers by ending of the file name; a longer ending stands before its own suffix."""


def scan_ending(path: Path) -> str | None:
    """The supported ending of a file's name, or None.

    Examples
    --------
    >>> scan_ending(Path("sweep.pcd.bin")), scan_ending(Path("0000000017.BIN"))
    ('.pcd.bin', '.bin')
    >>> scan_ending(Path("notes.txt")) is None
    True
    """
    name = path.name.lower()
    return next((ending for ending in READERS if name.endswith(ending)), None)


def read_scan(path: Path) -> Scan:
    """Read a scan file with the reader for its ending.

    Raises
    ------
    ScanError
        The ending is unknown, or the file cannot be read, is empty or is not in the format of its
        ending.
    """
    ending = scan_ending(path)
    if ending is None:
        raise ScanError(f"{path} is not a scan: its name must end in {' '.join(READERS)}.")
    try:
        if path.is_file() and path.stat().st_size == 0:
            raise ScanError(f"the scan {path} holds no points: the file is empty.")
        return READERS[ending](path)
    except OSError as error:
        raise ScanError(f"cannot read the scan {path}: {_brief(error)}.") from None


def _read_float32_rows(path: Path, names: tuple[str, ...]) -> Scan:
    columns = 3 + len(names)
    size_bytes = path.stat().st_size
    if size_bytes % (4 * columns):
        raise ScanError(
            f"the scan {path} is truncated: its {size_bytes} bytes are not a multiple of"
            f" {4 * columns}, the {columns} float32 numbers of a point."
        )
    return scan_of_rows(path, np.fromfile(path, dtype="<f4").reshape(-1, columns), names)


def _brief(error: Exception) -> str:
    """The reason in an exception, without number, path and full stop."""
    reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
    return reason.splitlines()[0].rstrip(".") if reason else type(error).__name__
