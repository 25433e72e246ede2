"""Reading a scan file in any supported format, selected by the ending of its name."""

import logging
from collections.abc import Callable
from pathlib import Path

import numpy as np

from intervis.arrays import Float32Array, Float64Array
from intervis.drives.float_columns import column_names, likely_width
from intervis.drives.pcd_file import read_pcd
from intervis.drives.ply_file import read_ply
from intervis.drives.point_cloud2 import decode_point_cloud2, scan_of_cloud
from intervis.drives.regular_file import open_regular, rest_as_numbers
from intervis.drives.scan import Scan, scan_of_rows
from intervis.drives.threedtk import read_3d
from intervis.drives.vehicle_axes import X_RIGHT
from intervis.errors import ScanError

log = logging.getLogger(__name__)

CDR_START = b"\0\1\0\0"
"""First bytes of a message in CDR, little-endian: as a coordinate 4e-43 m, which none is."""


def read_bin(path: Path, velo_from_file: Float64Array | None = None) -> Scan:
    """Read a KITTI scan: x, y, z and intensity of each point as little-endian float32.

    Points of three, five or more numbers are recognised by the data, with a warning. A serialized
    message PointCloud2, which some tools save under this ending too, is recognised by its start.

    Raises
    ------
    ScanError
        The file holds no points, its size is not a multiple of a point's size, or its points have
        not four numbers and the data does not show how many.
    """
    numbers, size_bytes = _float32_numbers(path)
    if numbers[:1].tobytes() == CDR_START:
        return read_cdr(path, velo_from_file)
    return _scan_of_numbers(path, numbers, size_bytes, 4, velo_from_file)


def read_cdr(path: Path, velo_from_file: Float64Array | None = None) -> Scan:
    """Read one message ``sensor_msgs/PointCloud2`` in CDR, as ROS 2 sends it."""
    with open_regular(path) as file:
        content = file.read()
    return scan_of_cloud(decode_point_cloud2(content, "cdr", path), path, velo_from_file)


def read_nuscenes(path: Path, velo_from_file: Float64Array | None = None) -> Scan:
    """Read a nuScenes sweep: x, y, z, intensity and ring as little-endian float32.

    Its x looks right and its y forward. Unless another motion is given, the points are turned into
    x forward, y left.
    """
    velo_from_file = X_RIGHT.T if velo_from_file is None else velo_from_file
    return _scan_of_numbers(path, *_float32_numbers(path), 5, velo_from_file)


def read_npy(path: Path, velo_from_file: Float64Array | None = None) -> Scan:
    """Read an array (N, 3) or (N, 4) of float32 or float64; the fourth column is intensity.

    Raises
    ------
    ScanError
        The file is not a plain array (pickled objects are never loaded), has another shape or
        type, or holds no points.
    """
    try:
        with open_regular(path) as file:
            rows = np.load(file, allow_pickle=False)
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
    names = ("intensity",)[: rows.shape[1] - 3]
    return scan_of_rows(path, np.array(rows), names, velo_from_file)


READERS: dict[str, Callable[[Path, Float64Array | None], Scan]] = {
    ".pcd.bin": read_nuscenes,
    ".bin": read_bin,
    ".cdr": read_cdr,
    ".npy": read_npy,
    ".pcd": read_pcd,
    ".ply": read_ply,
    ".3d": read_3d,
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


def read_scan(path: Path, velo_from_file: Float64Array | None = None) -> Scan:
    """Read a scan file with the reader for its ending.

    Parameters
    ----------
    path : Path
    velo_from_file : (4, 4) array, optional
        Motion that moves the points of the file into the sensor's frame.

    Raises
    ------
    ScanError
        The ending is unknown, or the file cannot be read, is empty or is not in the format of its
        ending.
    """
    ending = scan_ending(path)
    if ending is None:
        raise ScanError(f"{path} is not a scan: its name must end in {' '.join(READERS)}.")
    return reading(path, lambda file: READERS[ending](file, velo_from_file))


def reading(path: Path, reader: Callable[[Path], Scan]) -> Scan:
    """The scan that a reader makes of a file; what the system refuses becomes a `ScanError`."""
    try:
        if path.is_file() and path.stat().st_size == 0:
            raise ScanError(f"the scan {path} holds no points: the file is empty.")
        return reader(path)
    except OSError as error:
        raise ScanError(f"cannot read the scan {path}: {_brief(error)}.") from None


def _float32_numbers(path: Path) -> tuple[Float32Array, int]:
    """The numbers of a file, and its size in bytes."""
    with open_regular(path) as file:
        return rest_as_numbers(file, "<f4"), file.seek(0, 2)


def _scan_of_numbers(
    path: Path,
    values: Float32Array,
    size_bytes: int,
    usual: int,
    velo_from_file: Float64Array | None,
) -> Scan:
    width, certain = likely_width(values, usual) if size_bytes % 4 == 0 else (None, True)
    if width is None:
        raise ScanError(
            f"the scan {path} is truncated: its {size_bytes} bytes are not a multiple of"
            f" {4 * usual}, the {usual} float32 numbers of a point."
        )
    if not certain:
        raise ScanError(
            f"the scan {path} does not have the {usual} columns of a {scan_ending(path)} file, but"
            f" perhaps {width} ({4 * width} bytes a point), which its data does not confirm: save"
            " its columns x, y, z and intensity as .npy."
        )
    names = column_names(values, width)
    if width != usual:
        log.warning(
            "%s is read with %d columns (x y z %s) instead of %d: with these, successive returns"
            " lie at neighbouring azimuths.",
            *(path, width, " ".join(names), usual),
        )
    elif usual == 5:
        names = ("intensity", "ring")
    return scan_of_rows(path, values.reshape(-1, width), names, velo_from_file)


def _brief(error: Exception) -> str:
    """The reason in an exception, without number, path and full stop."""
    reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
    return reason.splitlines()[0].rstrip(".") if reason else type(error).__name__
