"""The content of a scan file: coordinates, and further attributes of each point."""

import logging
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from intervis.arrays import Float32Array, Float64Array
from intervis.errors import ScanError
from intervis.transform import transform

log = logging.getLogger(__name__)

FAR_M = 16_384.0
"""Magnitude from which the spacing of float32 numbers exceeds 1 mm."""


@dataclass(frozen=True, eq=False)
class Scan:
    """The points of a scan file in the order of the file.

    Attributes
    ----------
    points : (N, 3) float32 array
        Sensor frame, metres; rows with non-finite coordinates are kept.
    attributes : mapping of str to (N,) array
        Further values of each point; (N, k) where a file has k numbers under one name.
    """

    points: Float32Array
    attributes: Mapping[str, NDArray[Any]] = field(default_factory=dict)


def scan_of_rows(
    path: Path,
    rows: NDArray[Any],
    names: tuple[str, ...] = (),
    velo_from_file: Float64Array | None = None,
) -> Scan:
    """A scan from rows x, y, z and further columns with the given names.

    Parameters
    ----------
    path : Path
        The file, for messages.
    rows : (N, 3 + len(names)) float array
    names : tuple of str
        Names of the further columns.
    velo_from_file : (4, 4) array, optional
        Motion that moves the points of the file into the sensor's frame.

    Raises
    ------
    ScanError
        There are no rows.
    """
    others = {name: rows[:, column] for column, name in enumerate(names, start=3)}
    return _scan(path, rows[:, :3], others, velo_from_file)


def scan_of_table(
    path: Path, table: NDArray[Any], velo_from_file: Float64Array | None = None
) -> Scan:
    """A scan from a structured array (N,) with the fields x, y, z (or X, Y, Z) and others.

    Parameters
    ----------
    path : Path
        The file, for messages.
    table : (N,) structured array
    velo_from_file : (4, 4) array, optional
        Motion that moves the points of the file into the sensor's frame.

    Raises
    ------
    ScanError
        There are no rows, or a coordinate is missing.
    """
    axes, xyz = coordinates(path, table)
    others = {name: table[name] for name in table.dtype.names or () if name not in axes}
    return _scan(path, xyz, others, velo_from_file)


def coordinates(path: Path, table: NDArray[Any]) -> tuple[list[str], NDArray[Any]]:
    """Names of the three coordinates of a structured array, and their values (N, 3).

    Raises
    ------
    ScanError
        A coordinate is missing.
    """
    names = table.dtype.names or ()
    axes = [axis if axis in names else axis.upper() for axis in "xyz"]
    missing = [axis.lower() for axis in axes if axis not in names]
    if missing:
        shown = " ".join(" ".join(names).split())[:200]
        raise ScanError(f"the scan {path} has no {' '.join(missing)}: its fields are {shown}.")
    with np.errstate(invalid="ignore"):  # casting a signalling NaN
        return axes, np.column_stack([table[axis] for axis in axes])


def _scan(
    path: Path,
    xyz: NDArray[Any],
    others: Mapping[str, NDArray[Any]],
    velo_from_file: Float64Array | None,
) -> Scan:
    if len(xyz) == 0:
        raise ScanError(f"the scan {path} holds no points.")
    if velo_from_file is not None:
        xyz = _moved(velo_from_file, xyz)
    columns = {name: np.ascontiguousarray(column) for name, column in others.items()}
    return Scan(_float32(path, xyz), columns)


def _moved(velo_from_file: Float64Array, xyz: NDArray[Any]) -> NDArray[Any]:
    """Points after a motion; a turn by right angles exchanges coordinates and changes no bit."""
    rotation = velo_from_file[:3, :3]
    signs = rotation.sum(axis=1)
    is_exchange = np.array_equal(np.abs(rotation).sum(axis=0), np.ones(3)) and np.array_equal(
        np.abs(signs), np.ones(3)
    )
    if is_exchange and not velo_from_file[:3, 3].any():
        order = np.abs(rotation).argmax(axis=1)
        return np.where(signs < 0, -xyz[:, order], xyz[:, order])
    with np.errstate(invalid="ignore", over="ignore"):
        return transform(velo_from_file, xyz)


def _float32(path: Path, xyz: NDArray[Any]) -> Float32Array:
    """Contiguous float32 coordinates; warns where the conversion loses more than 1 mm."""
    if xyz.dtype.itemsize > 4:
        far_m = np.max(np.abs(xyz), where=np.isfinite(xyz), initial=0.0)
        if far_m > FAR_M:
            log.warning(
                "%s: coordinates reach %.0f m, where float32 is coarser than 1 mm; subtract the"
                " sensor's position from the coordinates first.",
                path,
                far_m,
            )
    # Values beyond float32 become infinite, which marks an invalid return. Casting a signalling NaN
    # would warn.
    with np.errstate(over="ignore", invalid="ignore"):
        return np.ascontiguousarray(xyz, dtype=np.float32)
