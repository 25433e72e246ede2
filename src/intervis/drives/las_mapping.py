"""Mobile mapping and airborne scans in LAS and LAZ (COPC), with the trajectory of the scanner.

The points of a file are in the world. A text file beside it says where the scanner was when:
``NAME.txt`` or ``trajectory.txt`` (``.csv``), with lines ``time x y z`` or ``time x y z roll pitch
heading``, times on the clock of the points, metres, degrees (roll to the right, pitch upwards,
heading clockwise from y). A first line of names is passed over. The points are cut into scans of
0.1 s, each moved into the frame of the scanner at the middle of its time. Without angles the
scanner is level and looks the way it moves. Read with laspy and lazrs (extra ``las``).
"""

import contextlib
import logging
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from intervis.arrays import Float64Array
from intervis.drives.calibration import COMMENT, parse_numbers, read_lines
from intervis.drives.drive import Drive
from intervis.drives.las_header import check_las_times, read_las_header
from intervis.drives.laz_chunks import check_chunks
from intervis.drives.pose_track import PoseTrack
from intervis.drives.regular_file import files_with_ending, open_regular
from intervis.drives.scan import Scan, scan_of_rows
from intervis.errors import (
    CalibrationError,
    DriveError,
    IntervisError,
    MissingExtraError,
    ScanError,
)
from intervis.transform import inverse, rigid

log = logging.getLogger(__name__)

ENDINGS = (".las", ".laz")
EXPECTED_FILES = "*.las, *.laz beside a trajectory (mobile mapping)"
SCAN_NS = 100_000_000
"""Time of a scan: the points that a scanner measured meanwhile are seen from one place."""

FARTHEST_M, LONGEST_S = 1e9, 1e7
PART_BYTES = 2**25
"""So many bytes of points are read at a time."""

UNMOVED_M = 1e-3
"""A scanner that moved less between two lines of its trajectory keeps its heading."""

ATTRIBUTES = (
    *("intensity", "classification", "return_number", "number_of_returns", "point_source_id"),
    *("user_data", "scanner_channel", "scan_angle", "scan_angle_rank", "red", "green", "blue"),
)


class Trajectory(NamedTuple):
    """Where the scanner was: world_from_velo over nanoseconds after `start_s`."""

    start_s: float
    track: PoseTrack

    @property
    def end_s(self) -> float:
        """Time of its last place."""
        return self.start_s + 1e-9 * int(self.track.times_ns[-1])


class _Span(NamedTuple):
    """First and last point of a scan in the file, and their number."""

    first: int
    last: int
    points: int


# --- finding files ---


def find_roots(path: Path) -> list[Path]:
    """Files with a trajectory in a folder.

    Raises
    ------
    DriveError
        There are LAS files, and none has a trajectory.
    """
    files = [file for ending in ENDINGS for file in files_with_ending(path, ending)]
    found = [file for file in files if _trajectory_path(file)]
    if files and not found:
        raise DriveError(_lack(files[0]))
    return found


def _trajectory_path(path: Path) -> Path | None:
    names = (path.name.split(".")[0], path.stem, "trajectory")
    for name in names:
        for ending in (".txt", ".csv"):
            found = path.with_name(name + ending)
            if found.is_file():
                return found
    return None


def _lack(path: Path) -> str:
    return (
        f"{path} has no trajectory: a file {path.name.split('.')[0]}.txt or trajectory.txt beside"
        " it, with lines 'time x y z' or 'time x y z roll pitch heading', must say where the"
        " scanner was."
    )


# --- reading a file ---


def read_drive(root: Path, camera: str | None) -> Drive:
    """Read a file; its scans are numbered by time, from the start of the trajectory."""
    if camera is not None:
        raise DriveError(f"{root} has no camera {camera!r:.60}: LAS files hold points alone.")
    check_las_times(root, read_las_header(root))
    trajectory_path = _trajectory_path(root)
    if trajectory_path is None:
        raise DriveError(_lack(root))
    trajectory = read_trajectory(trajectory_path)
    spans = _spans(root, trajectory, trajectory_path)
    middles_ns = {number: number * SCAN_NS + SCAN_NS // 2 for number in spans}
    last_ns = int(trajectory.track.times_ns[-1])
    found = {
        number: trajectory.track.at(min(time_ns, last_ns)) for number, time_ns in middles_ns.items()
    }
    poses = {number: pose for number, pose in found.items() if pose is not None}
    if len(poses) < len(spans):
        log.warning(
            "the trajectory %s has gaps: %d of %d scans are left out.",
            *(trajectory_path, len(spans) - len(poses), len(spans)),
        )
    if not poses:
        raise DriveError(f"the trajectory {trajectory_path} has a gap where {root} has points.")
    start_ns = round(1e9 * trajectory.start_s)
    return Drive(
        root=root,
        name=root.name,
        layout="las_mapping",
        scan_paths=dict.fromkeys(poses, root),
        poses=poses,
        timestamps_ns={number: start_ns + middles_ns[number] for number in poses},
        metadata_files=(trajectory_path,),
        read=_Scans(root, spans, poses, trajectory),
        is_deskewed=True,  # the points are those of a map
    )


def _spans(path: Path, trajectory: Trajectory, trajectory_path: Path) -> dict[int, _Span]:
    """Where the points of each scan lie in a file; one pass over the times."""
    spans: dict[int, _Span] = {}
    lowest_s, highest_s = np.inf, -np.inf
    place = outside = 0
    for points in _parts(path):
        times_s = np.asarray(points.gps_time, np.float64)
        numbers = _numbers(times_s, trajectory)
        inside = np.flatnonzero(numbers >= 0)
        outside += len(numbers) - len(inside)
        known = times_s[np.isfinite(times_s)]
        lowest_s, highest_s = (
            min(lowest_s, known.min(initial=np.inf)),
            max(highest_s, known.max(initial=-np.inf)),
        )
        present, first, counts = np.unique(numbers[inside], return_index=True, return_counts=True)
        last = len(inside) - 1 - np.unique(numbers[inside][::-1], return_index=True)[1]
        for number, a, b, count in zip(
            present.tolist(),
            (place + inside[first]).tolist(),
            (place + inside[last]).tolist(),
            counts.tolist(),
            strict=True,
        ):
            old = spans.get(number, _Span(a, b, 0))
            spans[number] = _Span(min(a, old.first), max(b, old.last), count + old.points)
        place += len(numbers)
    if not spans:
        raise DriveError(
            f"the trajectory {trajectory_path} covers the times {trajectory.start_s:.3f} to"
            f" {trajectory.end_s:.3f} s, the points of {path} have {lowest_s:.3f} to"
            f" {highest_s:.3f} s: both must be on one clock."
        )
    if outside:
        log.warning(
            "%d of %d points of %s are outside the time of its trajectory: they are left out.",
            *(outside, place, path),
        )
    return dict(sorted(spans.items()))


def _numbers(times_s: Float64Array, trajectory: Trajectory) -> NDArray[np.int64]:
    """(N,) numbers of the scans of points; -1 outside the trajectory."""
    inside = (times_s >= trajectory.start_s) & (times_s <= trajectory.end_s)
    after_s = np.where(inside, times_s, trajectory.start_s) - trajectory.start_s
    return np.where(inside, np.floor(after_s * (1e9 / SCAN_NS)).astype(np.int64), -1)


@dataclass(frozen=True, eq=False)
class _Scans:
    """Reads the points of a scan into the frame of the scanner at the middle of its time."""

    path: Path
    spans: Mapping[int, _Span]
    poses: Mapping[int, Float64Array]
    trajectory: Trajectory

    def __call__(self, number: int) -> Scan:
        span = self.spans[number]
        middle_s = self.trajectory.start_s + 1e-9 * (number * SCAN_NS + SCAN_NS // 2)
        xyz, columns = [], []
        for points in _parts(self.path, span.first, span.last + 1):
            own = _numbers(np.asarray(points.gps_time, np.float64), self.trajectory) == number
            axes = (points.x, points.y, points.z)
            xyz.append(np.column_stack([np.asarray(axis)[own] for axis in axes]))
            columns.append(_attributes(points, own, middle_s))
        if sum(map(len, xyz)) != span.points:
            raise ScanError(f"{self.path} has changed since it was opened.")
        scan = scan_of_rows(self.path, np.concatenate(xyz), (), inverse(self.poses[number]))
        attributes = {name: np.concatenate([part[name] for part in columns]) for name in columns[0]}
        return Scan(scan.points, attributes)


def _attributes(points: Any, own: NDArray[np.bool_], middle_s: float) -> dict[str, NDArray[Any]]:
    """Values of some points; ``time_s`` are seconds after the middle of the scan."""
    names = [
        *(name for name in ATTRIBUTES if name in points.point_format.dimension_names),
        *points.point_format.extra_dimension_names,
    ]
    values = {name: np.array(points[name])[own] for name in names}
    return {"time_s": np.asarray(points.gps_time, np.float64)[own] - middle_s, **values}


def _parts(path: Path, first: int = 0, end: int | None = None) -> Iterator[Any]:
    """The points of a file in parts, read by laspy after its header was checked."""
    header = read_las_header(path)
    most = max(1, PART_BYTES // header.point_bytes)
    with _damage_told(path):
        if header.compression:
            stat = path.stat()
            check_chunks(path, header, stat.st_size, stat.st_mtime_ns)
    with _damage_told(path), _laspy_reader(path) as reader:
        end = header.points if end is None else end
        if first:
            reader.seek(first)
        while first < end:
            points = reader.read_points(min(most, end - first))
            if len(points) == 0:
                raise ScanError(f"{path} ends before its last point.")
            first += len(points)
            yield points


def _laspy_reader(path: Path) -> Any:
    try:
        import laspy

        # In this thread, where a failure can be caught; records behind the points are not needed.
        backend = laspy.LazBackend.Lazrs
        if path.suffix.lower() == ".laz" and not backend.is_available():
            raise ImportError
    except ImportError:
        raise MissingExtraError("laspy", "las", "Reading a LAS or LAZ file") from None
    return laspy.open(open_regular(path), laz_backend=backend, read_evlrs=False)


@contextlib.contextmanager
def _damage_told(path: Path) -> Iterator[None]:
    try:
        yield
    except (IntervisError, KeyboardInterrupt, SystemExit, GeneratorExit):
        raise
    except BaseException as error:  # also what lazrs raises when it panics
        words = " ".join(str(error).split())[:120].rstrip(".") or type(error).__name__
        raise ScanError(f"{path} is not a readable LAS file ({words}).") from None


# --- the trajectory ---


def read_trajectory(path: Path) -> Trajectory:
    """Read where a scanner was.

    Raises
    ------
    CalibrationError
        A line does not parse, or there are less than two; or it spans more than 100 days.
    """
    rows: list[tuple[float, ...]] = []
    for line_number, line in enumerate(read_lines(path), start=1):
        text = line.replace(",", " ").replace(";", " ")
        if not text.strip() or text.lstrip().startswith(COMMENT):
            continue
        if not rows and text.split()[0][0].isalpha():  # names of columns
            continue
        values = parse_numbers(text, path, line_number)
        if len(values) not in (4, 7) or (rows and len(values) != len(rows[0])):
            raise CalibrationError(
                f"{path}, line {line_number}: expected time x y z, or also roll pitch heading, in"
                f" all lines; this one has {len(values)} numbers."
            )
        rows.append(values)
    if len(rows) < 2:
        raise CalibrationError(f"{path} holds no trajectory: it has {len(rows)} lines of numbers.")
    table = np.array(rows)
    _, order = np.unique(table[:, 0], return_index=True)
    table = table[order]
    times_s, start_s = table[:, 0], float(table[0, 0])
    if np.abs(table).max() > FARTHEST_M or times_s[-1] - start_s > LONGEST_S or len(table) < 2:
        raise CalibrationError(f"{path} holds times or places that are none of a trajectory.")
    times_ns = np.round(1e9 * (times_s - start_s)).astype(np.int64)
    rotations = _rotations(table)
    poses = [rigid(*pair) for pair in zip(rotations, table[:, 1:4], strict=True)]
    return Trajectory(start_s, PoseTrack.over_gaps(times_ns, poses))


def _rotations(table: Float64Array) -> Float64Array:
    """(K, 3, 3) rotations from x forward, y left, z up into x east, y north, z up."""
    from scipy.spatial.transform import Rotation  # 0.4 s to import: only where it is needed

    if table.shape[1] == 7:
        roll, pitch, heading = table[:, 4:].T
        angles = np.column_stack([90 - heading, -pitch, roll])
        return np.asarray(Rotation.from_euler("ZYX", angles, degrees=True).as_matrix())
    steps = np.gradient(table[:, 1:3], axis=0)
    moves = np.hypot(*steps.T) > UNMOVED_M
    # Where it stands, the heading before counts; before the first movement that of the first.
    nearest = np.maximum.accumulate(np.where(moves, np.arange(len(table)), -1))
    nearest[nearest < 0] = int(moves.argmax())
    yaw = np.arctan2(steps[nearest, 1], steps[nearest, 0])
    return np.asarray(Rotation.from_euler("Z", yaw[:, None]).as_matrix())
