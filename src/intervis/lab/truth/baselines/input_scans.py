"""What a rival is given: the scans it may see, where they were taken, and which is which."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from intervis.arrays import Float64Array, FloatArray, finite_rows
from intervis.transform import transform


@dataclass(frozen=True, eq=False)
class Seen:
    """The scans that a method may see, in the order they were taken.

    Attributes
    ----------
    numbers : tuple of int
        Frame numbers, ascending.
    scans : tuple of (N, 3) float arrays
        Each in its own sensor's frame, metres.
    poses : tuple of (4, 4) float64 arrays
        world_from_velo of each.
    asked : int
        Number of the frame whose points are asked about.
    viewpoint_number : int
        Number of the (hidden) frame at the viewpoint.
    timestamps_s : tuple of float or None
        When each was taken, seconds after the moment that is asked about (before it: negative);
        None where the drive does not say.
    """

    numbers: tuple[int, ...]
    scans: tuple[FloatArray, ...]
    poses: tuple[Float64Array, ...]
    asked: int
    viewpoint_number: int
    timestamps_s: tuple[float, ...] | None = None

    @cached_property
    def points_world(self) -> Float64Array:
        """(N, 3) the finite points of all scans together, in the world's frame."""
        if not self.scans:
            return np.empty((0, 3))
        return np.concatenate(
            [
                transform(pose, scan[finite_rows(scan), :3])
                for scan, pose in zip(self.scans, self.poses, strict=True)
            ]
        )

    def nearest(self, each_side: int) -> "Seen":
        """The asked scan and the nearest ones before and after the viewpoint's number.

        Examples
        --------
        >>> scan, pose = np.zeros((1, 3)), np.eye(4)
        >>> seen = Seen((0, 1, 2, 6, 7, 9), (scan,) * 6, (pose,) * 6, 0, 4)
        >>> seen.nearest(1).numbers
        (0, 2, 6)
        """
        before = [n for n in self.numbers if n < self.viewpoint_number]
        after = [n for n in self.numbers if n > self.viewpoint_number]
        chosen = {*before[len(before) - min(each_side, len(before)) :], *after[:each_side]}
        if self.asked in self.numbers:
            chosen.add(self.asked)
        kept = [k for k, number in enumerate(self.numbers) if number in chosen]
        return Seen(
            tuple(self.numbers[k] for k in kept),
            tuple(self.scans[k] for k in kept),
            tuple(self.poses[k] for k in kept),
            self.asked,
            self.viewpoint_number,
            self.timestamps_s and tuple(self.timestamps_s[k] for k in kept),
        )
