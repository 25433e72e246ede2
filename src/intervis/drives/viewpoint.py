"""Where the scanner stood, for points whose file states a pose but not the frame of the points.

A PCD file's VIEWPOINT is used in two ways: with points in the scanner's own frame (its pose in the
world is stated beside them), and with points already moved into the world (the scanner then stood
at the pose). The data tells which: from the scanner's true place, successive returns lie at regular
angles, and no return hides another.
"""

import logging
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from intervis.arrays import Float64Array, FloatArray
from intervis.drives.pcd_file import read_table, read_viewpoint
from intervis.drives.remote_path import for_each
from intervis.drives.scan import Scan, coordinates
from intervis.drives.scan_file import read_scan, scan_ending
from intervis.errors import DriveError
from intervis.transform import inverse

log = logging.getLogger(__name__)

CELL_DEG = 0.5
"""Width of the directions in which returns are compared."""

HIDDEN_M = 1.0
"""A return is hidden by one in its direction that is nearer by this and 2 % of the range."""

REGULAR = 0.6
"""Spread of the logarithm of angular steps up to which a scan is in the order of its beams."""

MOST_HIDDEN = 0.5
"""Share of hidden points beyond which a warning says that they are no scan from their place."""

WITNESSES = 3
"""Scans of a folder that are read to find the frame of the points."""


def step_spread(points: FloatArray, place: FloatArray) -> float:
    """How irregular the angles between successive points are, seen from a place.

    The interquartile range of the natural logarithm of the angles. A spinning scanner turns by the
    same angle from one return to the next, near or far: around 0.1 from its true place, 1 and more
    from a wrong one, and for points that are not in the order of its beams.

    Examples
    --------
    >>> angle = np.radians(np.arange(0.0, 360.0, 0.5))
    >>> wall = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    >>> wall *= (10 + 5 * np.sin(3 * angle))[:, None]
    >>> step_spread(wall, np.zeros(3)) < 0.01 < 0.5 < step_spread(wall, np.array([5.0, 0, 0]))
    True
    """
    _, direction = _directions(points, place)
    step = np.linalg.norm(np.diff(direction, axis=0), axis=1)
    step = step[step > 0]
    if len(step) < 8:
        return np.inf
    low, high = np.quantile(np.log(step), [0.25, 0.75])
    return float(high - low)


def hidden_share(points: FloatArray, place: FloatArray) -> float:
    """Share of the points that lie behind another point of the same direction, seen from a place.

    Examples
    --------
    >>> wall = np.array([[10.0, y, 0.0] for y in range(-4, 5)])
    >>> hidden_share(wall, np.zeros(3))
    0.0
    >>> round(hidden_share(wall, np.array([10.0, -9.0, 0.0])), 2)  # seven of nine
    0.78
    """
    range_m, direction = _directions(points, place)
    if len(range_m) == 0:
        return 0.0
    azimuth_deg = np.degrees(np.arctan2(direction[:, 1], direction[:, 0])) + 180
    elevation_deg = np.degrees(np.arcsin(np.clip(direction[:, 2], -1, 1))) + 90
    cells = (azimuth_deg // CELL_DEG).astype(np.int64) * 1000 + (elevation_deg // CELL_DEG).astype(
        np.int64
    )
    order = np.lexsort((range_m, cells))
    cells, range_m = cells[order], range_m[order]
    first = np.append(True, cells[1:] != cells[:-1])
    nearest_m = range_m[first][np.cumsum(first) - 1]
    return float(np.mean(range_m > nearest_m * 1.02 + HIDDEN_M))


def _directions(points: FloatArray, place: FloatArray) -> tuple[Float64Array, Float64Array]:
    """Ranges and unit directions from a place, without invalid points and those at the place."""
    with np.errstate(over="ignore", invalid="ignore"):  # files hold any numbers
        points = np.asarray(points, dtype=np.float64)
        from_place = points - place
        range_m = np.linalg.norm(from_place, axis=1)
    kept = np.isfinite(range_m) & (range_m > 1e-6) & np.any(points, axis=1)
    return range_m[kept], from_place[kept] / range_m[kept, None]


def stands_at_pose(points: FloatArray, position: FloatArray) -> bool | None:
    """Whether the scanner stood at the stated position (True) or at the points' origin (False).

    Parameters
    ----------
    points : (N, 3) array
        As they stand in the file, in its order.
    position : (3,) array
        The stated position.

    Returns
    -------
    bool or None
        None where the data does not tell.
    """
    origin = np.zeros(3)
    for figure, limit, clear in _FIGURES:
        at_pose, at_origin = figure(points, position), figure(points, origin)
        low, high = min(at_pose, at_origin), max(at_pose, at_origin)
        if low < limit and low < clear * high:
            return at_pose < at_origin
    return None


def _median_range_m(points: FloatArray, place: FloatArray) -> float:
    range_m, _ = _directions(points, place)
    return float(np.median(range_m)) if len(range_m) else np.inf


_FIGURES = (
    (_median_range_m, np.inf, 0.1),  # a scanner stands amid its returns
    (step_spread, REGULAR, 0.8),
    (hidden_share, 1.0, 0.4),  # little is hidden from high above, where no scanner stood
)
"""Figures that are low at the true place: up to which value, and by which share of the other."""


@dataclass(frozen=True)
class PosedScans:
    """Reads scans whose files state the scanner's pose; points come in the scanner's frame.

    Attributes
    ----------
    paths : mapping of int to Path
        Scan files by frame number.
    in_world : bool
        Whether the files hold points in the world instead of the scanner's frame.
    """

    paths: Mapping[int, Path]
    in_world: bool

    def __call__(self, number: int) -> Scan:
        """Read the scan of a frame."""
        path = self.paths[number]
        viewpoint = read_viewpoint(path) if self.in_world else None
        return read_scan(path, None if viewpoint is None else inverse(viewpoint))


def stated_poses(
    paths: Mapping[int, Path],
) -> tuple[dict[int, Float64Array] | None, Callable[[int], Scan] | None]:
    """Poses that scan files state for their scanner, and the reader that honours them.

    Parameters
    ----------
    paths : mapping of int to Path
        Scan files by frame number.

    Returns
    -------
    poses : dict of int to (4, 4) float64 array, or None
        world_from_velo by frame number. None where no file states a pose, and where several files
        state the same: that is how the scanner is mounted, or that it stood still.
    read : function of a frame number to Scan, or None
        None where files are read as they stand.
    """
    files = {number: path for number, path in paths.items() if scan_ending(path) == ".pcd"}
    stated = zip(files, for_each(_stated_pose, files.values()), strict=True)
    poses = {number: pose for number, pose in stated if pose is not None}
    if all(np.array_equal(pose, np.eye(4)) for pose in poses.values()):
        return None, None
    in_world = _in_world(paths, poses)
    read = PosedScans(paths, in_world)
    first = next(iter(poses.values()))
    if len(poses) > 1 and all(np.allclose(pose, first, atol=1e-9) for pose in poses.values()):
        log.warning(
            "the %d scans in %s share one VIEWPOINT: it is taken for the extrinsics of the"
            " scanner, not for the pose of each scan.",
            *(len(poses), _folder(paths)),
        )
        return None, read
    return poses, read


def _stated_pose(path: Path) -> Float64Array | None:
    """The pose in a file; None where it cannot be read, which is told when its frame is."""
    try:
        viewpoint = read_viewpoint(path)
    except (DriveError, OSError):
        return None
    return np.eye(4) if viewpoint is None else viewpoint


def _in_world(paths: Mapping[int, Path], poses: Mapping[int, Float64Array]) -> bool:
    """Whether points are in the world, by the scans with the most telling poses; logs it."""
    by_distance = sorted(poses, key=lambda number: -np.linalg.norm(poses[number][:3, 3]))
    seen = list(_witnesses(paths, poses, by_distance))
    votes = [at_pose for at_pose, _ in seen if at_pose is not None]
    in_world = sum(votes) * 2 > len(votes)
    if not votes:
        log.warning(
            "the points in %s do not show whether they are in the scanner's frame or in that of"
            " their VIEWPOINT: the scanner's frame is assumed.",
            _folder(paths),
        )
    else:
        log.info(
            "the points in %s are in the frame %s, as a visibility test shows.",
            _folder(paths),
            "of their VIEWPOINT: they are moved into the scanner's"
            if in_world
            else "of the scanner",
        )
    hidden = max((shares[in_world] for _, shares in seen), default=0.0)
    if hidden > MOST_HIDDEN:
        log.warning(
            "%.0f %% of the points in %s are occluded by others from the stated position of the"
            " scanner: they are a map or several scans, not one scan from there.",
            *(100 * hidden, _folder(paths)),
        )
    return in_world


def _witnesses(
    paths: Mapping[int, Path], poses: Mapping[int, Float64Array], numbers: Iterable[int]
) -> Iterator[tuple[bool | None, tuple[float, float]]]:
    """Of a few scans: whether the scanner stood at its pose; shares hidden from origin and pose."""
    given = 0
    for number in numbers:
        position = poses[number][:3, 3]
        if given == WITNESSES or not position.any():
            return
        try:
            _, points = coordinates(paths[number], read_table(paths[number]))
        except (DriveError, OSError):
            continue
        given += 1
        shares = (hidden_share(points, np.zeros(3)), hidden_share(points, position))
        yield stands_at_pose(points, position), shares


def _folder(paths: Mapping[int, Path]) -> Path:
    path = next(iter(paths.values()))
    return path if len(paths) == 1 else path.parent
