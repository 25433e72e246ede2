"""Agents from files and drives: rows of a CSV, labelled boxes, and the scanner itself."""

import math
from collections.abc import Collection, Sequence
from pathlib import Path

import numpy as np

from intervis.arrays import Float64Array
from intervis.drives import Drive
from intervis.errors import CalibrationError, DriveError, PointsError
from intervis.sight import Scene
from intervis.transform import rigid
from intervis.uses.agents.mutual_sight import Agent
from intervis.uses.routes.survey import distance_to_scans, poses_in_scene
from intervis.uses.routes.target_file import FARTHEST_M, cell_number, read_rows

COLUMNS = (
    *("name", "x", "y", "z", "height", "yaw_deg", "fov_deg", "range_m", "frame"),
    *("length", "width", "tall"),
)
EYE_SHARE = 0.9
"""Eyes of labelled objects are at this share of their height."""
DEFAULT_HEIGHT_M = 1.5
DEFAULTS = {"yaw_deg": 0.0, "fov_deg": 360.0, "range_m": 150.0}


def read_agents(path: Path, scene: Scene) -> list[Agent]:
    """Agents of a CSV file.

    Columns: ``name``, ``x``, ``y``, and any of ``z`` (of the eye) or ``height`` (of the eye above
    the ground, 1.5 m if neither is given), ``yaw_deg``, ``fov_deg``, ``range_m``, ``frame``, and
    ``length``, ``width``, ``tall`` of a body that stands on the ground around the eye. Rows with a
    frame number are the places of one moving agent; without one an agent stands still.

    Raises
    ------
    DriveError
        There is no such file.
    CalibrationError
        The heading or a value is wrong.
    PointsError
        As `Agent`; or an agent has rows with and without a frame, or two for one, or stands more
        than 150 m from every scan.
    """
    if not path.exists():
        raise DriveError(f"there are no agents at {path}: check the path.")
    rows = read_rows(path)
    heads = set(rows[0]) if rows else set()
    if not {"name", "x", "y"} <= heads or not heads <= set(COLUMNS):
        raise CalibrationError(
            f"{path}: agents need a heading with name, x, y, and may have"
            f" {', '.join(COLUMNS[3:])}; and rows below it."
        )
    by_name: dict[str, list[dict[str, float | None]]] = {}
    for nth, row in enumerate(rows, start=1):
        values = {key: cell_number(path, f"agent {nth}", key, row[key]) for key in heads - {"name"}}
        by_name.setdefault((row["name"] or "").strip(), []).append(values)
    return [_agent(name, values, scene) for name, values in by_name.items()]


def _agent(name: str, rows: Sequence[dict[str, float | None]], scene: Scene) -> Agent:
    frames = [row.get("frame") for row in rows]
    poses = [_pose(name, row, scene) for row in rows]
    away_m = distance_to_scans(scene, np.array([pose[:3, 3] for pose in poses]))
    if (away_m > FARTHEST_M).any():
        raise PointsError(
            f"agent {name!r} stands {away_m.max():,.0f} m from every scan: give its place in the"
            " frame of the drive's poses."
        )
    first = {key: value for key, value in rows[0].items() if value is not None}
    look = {key: first.get(key, DEFAULTS[key]) for key in ("fov_deg", "range_m")}
    body = _body(first, poses[0][2, 3] - _ground(name, rows[0], scene))
    if frames == [None]:
        return Agent(name, poses[0], body=body, **look)
    numbers = [int(frame) for frame in frames if frame is not None and frame.is_integer()]
    if len(set(numbers)) < len(rows):
        raise PointsError(
            f"agent {name!r} has {len(rows)} row{'s' if len(rows) > 1 else ''}: each needs a frame"
            " number of its own, or one row has none."
        )
    return Agent(name, dict(zip(numbers, poses, strict=True)), body=body, **look)


def _ground(name: str, row: dict[str, float | None], scene: Scene) -> float:
    ground_m = float(scene.ground_height([_place(name, row)])[0])
    if math.isnan(ground_m):
        raise PointsError(f"the scene shows no ground below agent {name!r}: give its z.")
    return ground_m


def _pose(name: str, row: dict[str, float | None], scene: Scene) -> Float64Array:
    z_m = row.get("z")
    if z_m is None:
        height_m = row.get("height")
        z_m = _ground(name, row, scene) + (DEFAULT_HEIGHT_M if height_m is None else height_m)
    from scipy.spatial.transform import Rotation  # 0.4 s to import

    turn = Rotation.from_euler("z", row.get("yaw_deg") or 0.0, degrees=True)
    return rigid(turn.as_matrix(), [*_place(name, row), z_m])


def _place(name: str, row: dict[str, float | None]) -> tuple[float, float]:
    x, y = row["x"], row["y"]
    if x is None or y is None:
        raise PointsError(f"agent {name!r} has no place: give x and y.")
    return x, y


def _body(row: dict[str, float], eye_m: float) -> Float64Array | None:
    """(2, 3) body around an eye at a height above the ground; None without a size."""
    if not {"length", "width", "tall"} <= set(row):
        return None
    half = np.array([row["length"], row["width"]]) / 2.0
    return np.array([[*-half, -eye_m], [*half, row["tall"] - eye_m]])


def scanner_agent(drive: Drive, frames: Sequence[int], name: str = "scanner") -> Agent:
    """The drive's own scanner, looking around.

    Raises
    ------
    DriveError
        A frame has no pose.
    """
    return Agent(name, poses_in_scene(drive, frames))


def labelled_agents(
    drive: Drive,
    frames: Sequence[int],
    *,
    range_m: float = 150.0,
    categories: Collection[str] = (),
) -> list[Agent]:
    """The labelled objects of frames, one for each track: eyes near the top of their boxes.

    Objects without a track are agents of one frame each.

    Parameters
    ----------
    drive : Drive
    frames : sequence of int
    range_m : float
        How far they see.
    categories : collection of str
        Objects to take, in upper or lower case; none: all.

    Raises
    ------
    DriveError, CalibrationError
        A frame has no pose, or its labels cannot be read.
    """
    places: dict[str, dict[int, Float64Array]] = {}
    bodies: dict[str, Float64Array] = {}
    wanted = {category.lower() for category in categories}
    for number, pose in poses_in_scene(drive, frames).items():
        for nth, box in enumerate(drive[number].boxes):
            if wanted and box.category.lower() not in wanted:
                continue
            track = f"{box.track}"[:8] if box.track else f"{number}.{nth}"
            name = f"{box.category} {track}"
            eye_m = (EYE_SHARE - 0.5) * box.size_m[2]
            eye = rigid(np.eye(3), [0.0, 0.0, eye_m])
            places.setdefault(name, {})[number] = pose @ box.velo_from_box @ eye
            half = 0.5 * np.asarray(box.size_m)
            bodies[name] = np.array([[*-half[:2], -half[2] - eye_m], [*half[:2], half[2] - eye_m]])
    return [
        Agent(name, poses, range_m=range_m, body=bodies[name]) for name, poses in places.items()
    ]
