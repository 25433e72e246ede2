"""Input scans: what a method gets to answer one query set."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from intervis.arrays import Float64Array, FloatArray, finite_rows
from intervis.sight import Scene
from intervis.transform import transform


@dataclass(frozen=True, eq=False)
class InputScans:
    """The scans that a method gets, in ascending order of their frame numbers.

    Attributes
    ----------
    numbers : tuple of int
        Frame numbers, ascending.
    scans : tuple of (N, 3) float arrays
        Each in its own sensor's frame, metres.
    poses : tuple of (4, 4) float64 arrays
        world_from_velo of each.
    target_number : int
        Number of the frame whose returns are the targets.
    viewpoint_number : int
        Number of the frame at the viewpoint; its scan may be the hidden reference scan.
    timestamps_s : tuple of float or None
        Time of each scan, seconds after the time of the query (negative before it); None where
        the drive has no timestamps.
    posed : bool
        Whether the poses are told. False: the one scan stands where it stands, in its own frame,
        and the engine finds by itself where up is.
    """

    numbers: tuple[int, ...]
    scans: tuple[FloatArray, ...]
    poses: tuple[Float64Array, ...]
    target_number: int
    viewpoint_number: int
    timestamps_s: tuple[float, ...] | None = None
    posed: bool = True

    @property
    def moment_s(self) -> float | None:
        """Query time on the clock of `timestamps_s`; None where there are no timestamps."""
        return None if self.timestamps_s is None else 0.0

    @cached_property
    def points_world(self) -> Float64Array:
        """(N, 3) finite points of all scans together, world frame."""
        if not self.scans:
            return np.empty((0, 3))
        return np.concatenate(
            [
                transform(pose, scan[finite_rows(scan), :3])
                for scan, pose in zip(self.scans, self.poses, strict=True)
            ]
        )

    def nearest(self, each_side: int) -> "InputScans":
        """The target frame, and the nearest `each_side` frames before and after the viewpoint.

        Nearest by frame number.

        Examples
        --------
        >>> scan, pose = np.zeros((1, 3)), np.eye(4)
        >>> inputs = InputScans((0, 1, 2, 6, 7, 9), (scan,) * 6, (pose,) * 6, 0, 4)
        >>> inputs.nearest(1).numbers
        (0, 2, 6)
        """
        before = [n for n in self.numbers if n < self.viewpoint_number]
        after = [n for n in self.numbers if n > self.viewpoint_number]
        chosen = {
            self.target_number,
            *before[max(0, len(before) - each_side) :],
            *after[:each_side],
        }
        kept = [k for k, number in enumerate(self.numbers) if number in chosen]
        return InputScans(
            tuple(self.numbers[k] for k in kept),
            tuple(self.scans[k] for k in kept),
            tuple(self.poses[k] for k in kept),
            self.target_number,
            self.viewpoint_number,
            self.timestamps_s and tuple(self.timestamps_s[k] for k in kept),
        )


def scene_of(inputs: InputScans) -> Scene:
    """A scene of all input scans, in the world frame, with default settings."""
    scene = Scene()
    timestamps_s = inputs.timestamps_s or (None,) * len(inputs.scans)
    for scan, pose, timestamp_s in zip(inputs.scans, inputs.poses, timestamps_s, strict=True):
        scene.add(scan, pose if inputs.posed else None, timestamp_s)
    return scene
