"""A short drive for the tests of recordings: two frames of the built-in street, with objects."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from intervis.drives import Drive, open_drive
from intervis.drives.boxes import Box
from intervis.lab.worlds import simulate
from intervis.sight import Scene
from intervis.uses.registration import registered_scene
from intervis.view import ViewRequest, judge_frames

AHEAD = (14.0, 0.0, 1.0)
END = (30.0, -6.0, -1.0)
REQUEST = ViewRequest(viewpoint=AHEAD, ends=[END], most_returns=3000, memory=1)
SIZE_M = np.array([4.2, 1.8, 1.5])
QUARTER = np.array([[0.0, -1, 0, 20], [1, 0, 0, 3], [0, 0, 1, -1], [0, 0, 0, 1]])
"""A box that is turned by a quarter: its length lies along y."""


def street_drive(folder: Path) -> Drive:
    """Two frames; only the first has an object."""
    drive = open_drive(simulate(folder, frames=2))
    box = Box(QUARTER, SIZE_M, "Car & van")
    return replace(drive, read_boxes=lambda number: (box,) if number == 0 else ())


def recorded(drive: Drive, path: Path, recording: Callable[..., Any]) -> Path:
    """Record the drive; the file must not be there before it is complete."""
    numbers = drive.frame_numbers
    with recording(path, drive, numbers, REQUEST) as sink:
        judge_frames(drive, numbers, REQUEST, [sink])
        assert not path.exists()
    return path


def scene_of(drive: Drive, number: int) -> Scene:
    """The scene that the answers of a frame must come from: both frames."""
    return registered_scene(drive, drive[number], [1 - number])


def rounded(drive: Drive, number: int, rows: np.ndarray) -> np.ndarray:
    """Coordinates of returns as they are judged: whole centimetres."""
    return np.round(drive[number].points[rows].astype(np.float64) * 100) / 100
