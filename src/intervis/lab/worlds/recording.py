"""The triangles behind a simulated drive, kept beside it as ``world.npz``."""

import io
import zipfile
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from intervis.arrays import Float64Array, IntArray
from intervis.errors import DriveError
from intervis.lab.worlds.triangles import Soup
from intervis.lab.worlds.world import Moment, Mover, World

FILE_NAME = "world.npz"
PERIOD_S = 0.1
"""Time between frames."""


@dataclass(frozen=True, eq=False)
class RecordedWorld:
    """A world at the times of a drive's frames, in the frame of the drive's ``poses.txt``.

    Attributes
    ----------
    static : Soup
        What stands.
    movers : tuple of (str, Soup)
        Name and triangles, in its own frame, of what moves.
    mover_poses : (F, M, 4, 4) float64 array
        world_from_mover of each mover in each frame.
    vehicle_poses : (F, 4, 4) float64 array
        world_from_velo of each frame.
    """

    static: Soup = field(repr=False)
    movers: tuple[tuple[str, Soup], ...] = field(repr=False)
    mover_poses: Float64Array = field(repr=False)
    vehicle_poses: Float64Array = field(repr=False)

    @property
    def frame_count(self) -> int:
        """Number of frames that it knows."""
        return len(self.vehicle_poses)

    def triangles_at_frame(self, number: int) -> tuple[Float64Array, NDArray[np.int8], IntArray]:
        """Triangles (T, 3, 3), labels (T,) and objects (T,) of a frame.

        Objects are 0 for what stands, 1 and up for the movers.

        Raises
        ------
        DriveError
            The drive has no such frame.
        """
        return self._world.triangles_at(self._time_s(number))

    def at_frame(self, number: int) -> Moment:
        """The world as it was in a frame, ready to be scanned, looked at and asked."""
        return self._world.at(self._time_s(number))

    def _time_s(self, number: int) -> float:
        if not 0 <= number < self.frame_count:
            raise DriveError(
                f"the world knows the frames 0 to {self.frame_count - 1}, not {number}."
            )
        return number * PERIOD_S

    @property
    def _world(self) -> World:
        world: World | None = self.__dict__.get("_cached")
        if world is None:
            movers = tuple(
                Mover(name, soup, partial(_pose_at, self.mover_poses[:, index]))
                for index, (name, soup) in enumerate(self.movers)
            )
            world = World(self.static, movers, partial(_pose_at, self.vehicle_poses))
            object.__setattr__(self, "_cached", world)
        return world


def _pose_at(poses: Float64Array, time_s: float) -> Float64Array:
    return np.asarray(poses[round(time_s / PERIOD_S)])


def world_bytes(world: World, frames: int) -> bytes:
    """The bytes of ``world.npz`` for the first `frames` frames of a world.

    Its arrays: ``static_triangles`` (T, 3, 3) float32 in the world's frame and
    ``moving_triangles`` (S, 3, 3), mover after mover, each in its own frame; beside either
    ``_labels`` int8 (`intervis.lab.worlds.triangles.LABELS`), ``_colours`` and
    ``_reflectances`` float16;
    ``mover_names`` (M,), ``mover_sizes`` (M,) triangles of each, ``mover_poses`` (F, M, 4, 4)
    world_from_mover, ``vehicle_poses`` (F, 4, 4) world_from_velo. No number is rounded on its way
    into the file: the scanned triangles are float32 numbers already.
    """
    times_s = np.arange(frames) * PERIOD_S
    moving = Soup.joined(mover.soup for mover in world.movers)
    arrays: dict[str, NDArray[Any]] = {
        **_columns("static", world.static),
        **_columns("moving", moving),
        "mover_names": np.array([mover.name for mover in world.movers], dtype=np.str_),
        "mover_sizes": np.array([len(mover.soup) for mover in world.movers], dtype=np.int64),
        "mover_poses": np.array(
            [[mover.pose_at(time_s) for mover in world.movers] for time_s in times_s]
        ).reshape(frames, len(world.movers), 4, 4),
        "vehicle_poses": np.array([world.vehicle_pose_at(time_s) for time_s in times_s]),
    }
    buffer = io.BytesIO()
    np.savez(buffer, allow_pickle=False, **arrays)
    return buffer.getvalue()


def _columns(name: str, soup: Soup) -> dict[str, NDArray[Any]]:
    """A soup as the arrays of a file: exact, for a `Soup.stored` one."""
    return {
        f"{name}_triangles": soup.triangles.astype(np.float32),
        f"{name}_labels": soup.labels,
        f"{name}_colours": soup.colours.astype(np.float16),
        f"{name}_reflectances": soup.reflectances.astype(np.float16),
    }


def _soup(arrays: dict[str, NDArray[Any]], name: str) -> Soup:
    return Soup(
        arrays[f"{name}_triangles"].astype(np.float64).reshape(-1, 3, 3),
        arrays[f"{name}_labels"].astype(np.int8),
        arrays[f"{name}_colours"].astype(np.float32).reshape(-1, 3),
        arrays[f"{name}_reflectances"].astype(np.float32),
    )


def load_world(drive_folder: Path | str) -> RecordedWorld:
    """The world behind a simulated drive.

    Parameters
    ----------
    drive_folder : path
        The folder that `simulate` returned.

    Raises
    ------
    DriveError
        The folder holds no ``world.npz``, or one that does not read.
    """
    path = Path(drive_folder) / FILE_NAME
    if not path.is_file():
        raise DriveError(
            f"{path} is not there: only drives that `intervis simulate` wrote have a known world."
        )
    try:
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
        static, moving = _soup(arrays, "static"), _soup(arrays, "moving")
        bounds = np.concatenate([[0], np.cumsum(arrays["mover_sizes"])])
        movers = tuple(
            (str(name), moving.part(int(first), int(last)))
            for name, first, last in zip(
                arrays["mover_names"], bounds[:-1], bounds[1:], strict=True
            )
        )
        return RecordedWorld(static, movers, arrays["mover_poses"], arrays["vehicle_poses"])
    except (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile) as error:
        raise DriveError(f"cannot read {path}: {error}; simulate the drive again.") from None
