"""Tables of Argoverse 2: Feather files of calibration, poses, points and annotations."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from intervis.arrays import Float64Array
from intervis.drives.pcd_file import rotation_of_quaternion
from intervis.drives.pose_track import PoseTrack
from intervis.drives.regular_file import open_regular
from intervis.errors import CalibrationError, DriveError, MissingExtraError
from intervis.transform import rigid

FARTHEST_M = 1e9


def read_feather(path: Path, kind: type[DriveError]) -> NDArray[Any]:
    """The columns of a Feather file as a structured array; texts are objects."""
    try:
        from pyarrow import feather
    except ImportError:
        raise MissingExtraError("pyarrow", "argoverse", "Reading Argoverse 2") from None
    try:
        with open_regular(path) as file:
            # In this thread, where an exception can be caught; and checked, as damaged offsets of
            # texts would otherwise be followed out of the file.
            table = feather.read_table(file, memory_map=False, use_threads=False)
        table.validate(full=True)
        columns = {name: np.asarray(table[name].combine_chunks()) for name in table.column_names}
    except FileNotFoundError:
        raise kind(f"the file {path} is missing.") from None
    except Exception as error:  # pyarrow raises various types on damaged files
        reason = (str(error) or type(error).__name__).splitlines()[0][:200].rstrip(".")
        raise kind(f"{path} is not a readable Feather file: {reason}.") from None
    if len(table.column_names) != len(columns) or not columns or "" in columns:
        raise kind(f"{path} is not a table of Argoverse 2: its columns need different names.")
    rows = np.empty(table.num_rows, [(name, column.dtype) for name, column in columns.items()])
    for name, column in columns.items():
        rows[name] = column
    return rows


def numbers_of(path: Path, rows: NDArray[Any], *names: str) -> Float64Array:
    """(N, len(names)) finite numbers of a table of calibration or poses."""
    missing = [name for name in names if name not in (rows.dtype.names or ())]
    if missing:
        raise CalibrationError(f"{path} has no column {' '.join(missing)}.")
    try:
        values = np.column_stack([np.asarray(rows[name], np.float64) for name in names])
    except (TypeError, ValueError):
        values = np.full((1, 1), np.nan)
    if not np.all(np.abs(values) < FARTHEST_M):
        raise CalibrationError(f"{path} needs finite numbers in the columns {' '.join(names)}.")
    return values


def sensor_names(path: Path, rows: NDArray[Any]) -> list[str]:
    """Names of the sensors that the rows of a table of calibration belong to."""
    if "sensor_name" not in (rows.dtype.names or ()):
        raise CalibrationError(f"{path} has no column sensor_name.")
    names = [str(name) for name in rows["sensor_name"]]
    if not all(name.isprintable() and len(name) < 100 and "/" not in name for name in names):
        raise CalibrationError(f"{path} has a sensor_name that is not a plain name.")
    return names


def motions_of(path: Path, rows: NDArray[Any]) -> list[Float64Array]:
    """Rigid motions of the rows: quaternion and translation."""
    values = numbers_of(path, rows, "qw", "qx", "qy", "qz", "tx_m", "ty_m", "tz_m")
    lengths = np.linalg.norm(values[:, :4], axis=1)
    if not np.all((lengths > 1e-3) & (lengths < 1e3)):
        raise CalibrationError(f"{path} has a row whose qw, qx, qy, qz are not a quaternion.")
    return [rigid(rotation_of_quaternion(row[:4]), row[4:]) for row in values]


def read_extrinsics(path: Path) -> dict[str, Float64Array]:
    """ego_from_sensor by the sensor's name."""
    rows = read_feather(path, CalibrationError)
    return dict(zip(sensor_names(path, rows), motions_of(path, rows), strict=True))


def read_trajectory(path: Path) -> PoseTrack:
    """Read ``city_SE3_egovehicle.feather``: world_from_ego."""
    rows = read_feather(path, CalibrationError)
    if "timestamp_ns" not in (rows.dtype.names or ()) or rows["timestamp_ns"].dtype.kind != "i":
        raise CalibrationError(f"{path} has no times in whole nanoseconds.")
    times_ns = rows["timestamp_ns"].astype(np.int64)
    order = np.argsort(times_ns, kind="stable")
    motions = motions_of(path, rows)
    return PoseTrack(times_ns[order], tuple(motions[place] for place in order))
