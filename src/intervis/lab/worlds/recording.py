"""The triangles of a simulated drive, stored beside it as ``world.npz``."""

import io
import zipfile
from dataclasses import dataclass, field
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from intervis.arrays import Float64Array, IntArray
from intervis.errors import DriveError
from intervis.lab.worlds.triangles import Triangles
from intervis.lab.worlds.world import Actor, Snapshot, World

FILE_NAME = "world.npz"
PERIOD_S = 0.1
"""Time between frames."""


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


def _triangles(arrays: dict[str, NDArray[Any]], name: str) -> Triangles:
    return Triangles(
        arrays[f"{name}_triangles"].astype(np.float64).reshape(-1, 3, 3),
        arrays[f"{name}_labels"].astype(np.int8),
        arrays[f"{name}_colours"].astype(np.float32).reshape(-1, 3),
        arrays[f"{name}_reflectances"].astype(np.float32),
    )


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
    path = Path(drive_folder) / FILE_NAME
    if not path.is_file():
        raise DriveError(
            f"{path} does not exist: only drives written by `intervis simulate` have a known world."
        )
    try:
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
        static, moving = _triangles(arrays, "static"), _triangles(arrays, "moving")
        bounds = np.concatenate([[0], np.cumsum(arrays["actor_sizes"])])
        actors = tuple(
            (str(name), moving.part(int(first), int(last)))
            for name, first, last in zip(
                arrays["actor_names"], bounds[:-1], bounds[1:], strict=True
            )
        )
        return RecordedWorld(static, actors, arrays["actor_poses"], arrays["vehicle_poses"])
    except (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile) as error:
        raise DriveError(f"cannot read {path}: {error}; simulate the drive again.") from None
