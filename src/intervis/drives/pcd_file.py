"""Reading PCD files (ascii, binary, binary_compressed) through pypcd4."""

from pathlib import Path

import numpy as np

from intervis.drives.scan import Scan, scan_of_table
from intervis.errors import MissingExtraError, ScanError

PADDING = "#$%&~~"
"""What pypcd4 calls the columns that PCD's "_" declares as padding."""


def read_pcd(path: Path) -> Scan:
    """A PCD file: x, y, z, and every other field as an attribute.

    Raises
    ------
    MissingExtraError
        pypcd4 (extra ``pcd``) is not installed.
    ScanError
        The header is broken, the data ends early, or there are no points.
    """
    try:
        from pypcd4.pypcd4 import PointCloud
    except ImportError:
        raise MissingExtraError("pypcd4", "pcd", "Reading a PCD file") from None
    promised = _promised_points(path)
    try:
        cloud = PointCloud.from_path(path)
        table = np.atleast_1d(cloud.pc_data)
    except Exception as error:  # whatever pypcd4, lzf, pydantic or numpy make of a broken file
        raise ScanError(
            f"the scan {path} is no readable PCD file ({type(error).__name__})."
        ) from None
    if len(table) != promised:
        raise ScanError(
            f"the scan {path} is truncated: its header promises {promised} points,"
            f" it holds {len(table)}."
        )
    names = [name for name in table.dtype.names or () if not name.startswith(PADDING)]
    return scan_of_table(path, table[names])


def _promised_points(path: Path) -> int:
    """POINTS of the header, once it is clear that the file can hold them."""
    try:
        with path.open("rb") as file:
            lines = [file.readline(4096).decode("ascii", "replace").strip() for _ in range(40)]
        size_bytes = path.stat().st_size
    except OSError as error:
        raise ScanError(f"cannot read the scan {path}: {error.strerror}.") from None
    header: dict[str, list[str]] = {}
    for line in lines:
        key, *values = line.split() or [""]
        header.setdefault(key, values)
        if key == "DATA":
            break
    if size_bytes == 0:
        raise ScanError(f"the scan {path} holds no points: the file is empty.")
    missing = [key for key in ("FIELDS", "SIZE", "TYPE", "POINTS", "DATA") if not header.get(key)]
    if missing:
        raise ScanError(f"the scan {path} is no PCD file: its header has no {' '.join(missing)}.")
    try:
        points = int(header["POINTS"][0])
        sizes = [int(size) for size in header["SIZE"]]
        counts = [int(count) for count in header.get("COUNT", ["1"] * len(sizes))]
        point_bytes = sum(size * count for size, count in zip(sizes, counts, strict=True))
    except ValueError:
        raise ScanError(
            f"the scan {path} has a broken PCD header: SIZE, COUNT and POINTS must be numbers."
        ) from None
    # Only binary data has a size known beforehand; LZF packs at most 1 : 133, text 1 byte a number.
    least_bytes = {"binary": point_bytes, "ascii": 2 * len(sizes)}.get(
        header["DATA"][0], point_bytes / 133
    )
    if points * least_bytes > size_bytes:
        raise ScanError(
            f"the scan {path} is truncated: its header promises {points} points,"
            f" more than its {size_bytes} bytes can hold."
        )
    return points
