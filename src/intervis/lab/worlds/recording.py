"""The triangles of a simulated drive, stored beside it as ``world.npz``."""

import io
from dataclasses import dataclass, field
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from intervis.arrays import Float64Array, IntArray
from intervis.errors import DriveError
from intervis.lab.worlds.triangles import LABELS, Triangles
from intervis.lab.worlds.world import Actor, Snapshot, World

FILE_NAME = "world.npz"
PERIOD_S = 0.1
"""Time between frames."""

LARGEST = 1e9
"""Numbers in a file are smaller."""


@dataclass(frozen=True, eq=False)
class RecordedWorld:
    """A world at the times of a drive's frames, in the frame of the drive's ``poses.txt``.

    Attributes
    ----------
    static : Triangles
    actors : tuple of (str, Triangles)
        Name of each actor, and its triangles in its own frame.
    actor_poses : (F, A, 4, 4) float64 array
        world_from_actor of each actor in each frame.
    vehicle_poses : (F, 4, 4) float64 array
        world_from_velo of each frame.
    """

    static: Triangles = field(repr=False)
    actors: tuple[tuple[str, Triangles], ...] = field(repr=False)
    actor_poses: Float64Array = field(repr=False)
    vehicle_poses: Float64Array = field(repr=False)

    @property
    def frame_count(self) -> int:
        """Number of recorded frames."""
        return len(self.vehicle_poses)

    def triangles_at_frame(self, number: int) -> tuple[Float64Array, NDArray[np.int8], IntArray]:
        """Triangles (T, 3, 3), labels (T,) and objects (T,) of a frame.

        Objects are 0 for static triangles, 1 and up for the actors.

        Raises
        ------
        DriveError
            The drive has no such frame.
        """
        return self._world.triangles_at(self._time_s(number))

    def at_frame(self, number: int) -> Snapshot:
        """The world at a frame, with a ray caster."""
        return self._world.at(self._time_s(number))

    def _time_s(self, number: int) -> float:
        if not 0 <= number < self.frame_count:
            raise DriveError(
                f"the recorded world has the frames 0 to {self.frame_count - 1}, not {number}."
            )
        return number * PERIOD_S

    @cached_property
    def _world(self) -> World:
        actors = tuple(
            Actor(name, triangles, partial(_pose_at, self.actor_poses[:, index]))
            for index, (name, triangles) in enumerate(self.actors)
        )
        return World(self.static, actors, partial(_pose_at, self.vehicle_poses))


def _pose_at(poses: Float64Array, time_s: float) -> Float64Array:
    return np.asarray(poses[round(time_s / PERIOD_S)])


def world_bytes(world: World, frames: int) -> bytes:
    """The bytes of ``world.npz`` for the first `frames` frames of a world.

    Its arrays: ``static_triangles`` (T, 3, 3) float32 in the world frame;
    ``moving_triangles`` (S, 3, 3) float32 of all actors in turn, each in its own frame;
    for both ``_labels`` int8 (`intervis.lab.worlds.triangles.LABELS`), ``_colours`` and
    ``_reflectances`` float16;
    ``actor_names`` (A,), ``actor_sizes`` (A,) the number of triangles of each actor,
    ``actor_poses`` (F, A, 4, 4) world_from_actor, ``vehicle_poses`` (F, 4, 4) world_from_velo.
    Triangles that are `Triangles.rounded` are stored exactly.
    """
    times_s = np.arange(frames) * PERIOD_S
    moving = Triangles.joined(actor.triangles for actor in world.actors)
    arrays: dict[str, NDArray[Any]] = {
        **_columns("static", world.static),
        **_columns("moving", moving),
        "actor_names": np.array([actor.name for actor in world.actors], dtype=np.str_),
        "actor_sizes": np.array([len(actor.triangles) for actor in world.actors], dtype=np.int64),
        "actor_poses": np.array(
            [[actor.pose_at(time_s) for actor in world.actors] for time_s in times_s]
        ).reshape(frames, len(world.actors), 4, 4),
        "vehicle_poses": np.array([world.vehicle_pose_at(time_s) for time_s in times_s]),
    }
    buffer = io.BytesIO()
    np.savez(buffer, allow_pickle=False, **arrays)
    return buffer.getvalue()


def _columns(name: str, triangles: Triangles) -> dict[str, NDArray[Any]]:
    """Triangles as the arrays of a file."""
    return {
        f"{name}_triangles": triangles.corners.astype(np.float32),
        f"{name}_labels": triangles.labels,
        f"{name}_colours": triangles.colours.astype(np.float16),
        f"{name}_reflectances": triangles.reflectances.astype(np.float16),
    }


def load_world(drive_folder: Path | str) -> RecordedWorld:
    """The world of a simulated drive.

    Parameters
    ----------
    drive_folder : path
        The folder that `simulate` returned.

    Raises
    ------
    DriveError
        The folder holds no ``world.npz``, or one that cannot be read.
    """
    folder = Path(drive_folder) if isinstance(drive_folder, str) else drive_folder  # or remote
    path = folder / FILE_NAME
    if not path.is_file():
        raise DriveError(
            f"{path} does not exist: only drives written by `intervis simulate` have a known world."
        )
    try:
        return _world_of(_arrays(path))
    except _WorldError as error:
        raise DriveError(f"cannot read {path}: {error}; simulate the drive again.") from None


class _WorldError(Exception):
    """What is wrong with a file, as a part of a sentence."""


def _arrays(path: Path) -> dict[str, NDArray[Any]]:
    try:
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as file:
            return {name: file[name] for name in file.files}
    except Exception as error:  # numpy and zipfile raise various types on damaged files
        raise _WorldError(f"it is no archive of arrays ({type(error).__name__})") from None


def _world_of(arrays: dict[str, NDArray[Any]]) -> RecordedWorld:
    static, moving = _triangles(arrays, "static"), _triangles(arrays, "moving")
    names = arrays.get("actor_names", np.empty(0))
    sizes = _numbers(arrays, "actor_sizes", None)
    if names.dtype.kind != "U" or names.shape != sizes.shape:
        raise _WorldError("its actor_names are not one text for each of its actor_sizes")
    if (sizes < 0).any() or (sizes != np.rint(sizes)).any() or sizes.sum() != len(moving):
        raise _WorldError("its actor_sizes do not add up to the number of its moving triangles")
    bounds = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
    actors = tuple(
        (str(name), moving.part(int(first), int(last)))
        for name, first, last in zip(names, bounds[:-1], bounds[1:], strict=True)
    )
    vehicle_poses = _numbers(arrays, "vehicle_poses", None, 4, 4)
    actor_poses = _numbers(arrays, "actor_poses", len(vehicle_poses), len(actors), 4, 4)
    return RecordedWorld(static, actors, actor_poses, vehicle_poses)


def _triangles(arrays: dict[str, NDArray[Any]], name: str) -> Triangles:
    corners = _numbers(arrays, f"{name}_triangles", None, 3, 3)
    labels = _numbers(arrays, f"{name}_labels", len(corners))
    if not np.isin(labels, list(LABELS.values())).all():
        raise _WorldError(f"its {name}_labels hold an unknown class")
    return Triangles(
        corners,
        labels.astype(np.int8),
        _numbers(arrays, f"{name}_colours", len(corners), 3).astype(np.float32),
        _numbers(arrays, f"{name}_reflectances", len(corners)).astype(np.float32),
    )


def _numbers(arrays: dict[str, NDArray[Any]], name: str, *shape: int | None) -> Float64Array:
    """An array of finite numbers of a shape; None: any length."""
    if name not in arrays:
        raise _WorldError(f"it has no array {name}")
    array = arrays[name]
    wanted = " x ".join("any" if size is None else str(size) for size in shape)
    problem = _WorldError(f"its {name} is not an array of {wanted} finite numbers")
    sizes = zip(shape, array.shape, strict=False)
    if array.ndim != len(shape) or any(size not in (None, own) for size, own in sizes):
        raise problem
    if array.dtype.kind not in "fiu":
        raise problem
    with np.errstate(over="ignore", invalid="ignore"):
        values = array.astype(np.float64)
    if not (np.abs(values) < LARGEST).all():
        raise problem
    return values
