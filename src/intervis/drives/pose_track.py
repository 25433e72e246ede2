"""A track of poses over time, and the pose between two of them."""

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from intervis.arrays import Float64Array
from intervis.transform import rigid

WITHIN_NS = 1_000_000_000
"""Poses farther apart in time are not interpolated."""


SPACINGS = 3
"""So many times their median spacing poses may be apart, where that is more."""


@dataclass(frozen=True, eq=False)
class PoseTrack:
    """Poses at rising times.

    Attributes
    ----------
    times_ns : (K,) int64 array
    poses : sequence of K (4, 4) arrays
    within_ns : int
        Poses farther apart in time are not interpolated.
    """

    times_ns: NDArray[np.int64]
    poses: Sequence[Float64Array]
    within_ns: int = WITHIN_NS

    @classmethod
    def over_gaps(cls, times_ns: NDArray[np.int64], poses: Sequence[Float64Array]) -> Self:
        """A track that is interpolated over gaps of a second, or of three times its spacing.

        Examples
        --------
        >>> times_ns = np.array([0, 10**9, 3 * 10**9, 5 * 10**9])
        >>> PoseTrack.over_gaps(times_ns, [np.eye(4)] * 4).within_ns
        6000000000
        """
        spacing_ns = int(np.median(np.diff(times_ns))) if len(times_ns) > 1 else 0
        return cls(times_ns, poses, max(WITHIN_NS, SPACINGS * spacing_ns))

    def at(self, time_ns: int) -> Float64Array | None:
        """The pose at a time, interpolated; None where no poses lie around it.

        Examples
        --------
        >>> ahead = rigid(np.eye(3), [4.0, 0, 0])
        >>> track = PoseTrack(np.array([0, 1000]), (np.eye(4), ahead))
        >>> track.at(250)[:3, 3].tolist(), track.at(1001)
        ([1.0, 0.0, 0.0], None)
        """
        place = int(np.searchsorted(self.times_ns, time_ns))
        if place < len(self.times_ns) and self.times_ns[place] == time_ns:
            return self.poses[place]
        if place in (0, len(self.times_ns)):
            return None
        return self._between(place, time_ns)

    def near(self, time_ns: int) -> Float64Array | None:
        """As `at`; the motion goes on as it was for one spacing before and after the poses.

        Examples
        --------
        >>> ahead = rigid(np.eye(3), [4.0, 0, 0])
        >>> track = PoseTrack(np.array([0, 1000]), (np.eye(4), ahead))
        >>> track.near(1500)[:3, 3].tolist(), track.near(2001)
        ([6.0, 0.0, 0.0], None)
        """
        found = self.at(time_ns)
        last = len(self.times_ns) - 1
        if found is not None or last < 1 or self.times_ns[0] < time_ns < self.times_ns[-1]:
            return found
        place, edge = (1, 0) if time_ns < self.times_ns[0] else (last, last)
        edge_ns = int(self.times_ns[edge])
        spacing_ns = int(self.times_ns[place] - self.times_ns[place - 1])
        return self._between(place, time_ns) if abs(time_ns - edge_ns) <= spacing_ns else None

    def _between(self, place: int, time_ns: int) -> Float64Array | None:
        """The pose by the motion between the poses `place` - 1 and `place`."""
        before_ns, after_ns = (int(self.times_ns[nth]) for nth in (place - 1, place))
        if after_ns - before_ns > self.within_ns:
            return None
        share = (time_ns - before_ns) / (after_ns - before_ns)
        return interpolated(self.poses[place - 1], self.poses[place], share)


def interpolated(first: Float64Array, last: Float64Array, share: float) -> Float64Array:
    """The pose at a share of the way between two: positions on a line, rotations at even speed.

    Examples
    --------
    >>> turned = rigid([[0, -1, 0], [1, 0, 0], [0, 0, 1]], [2.0, 0, 0])  # 90 degrees about z
    >>> interpolated(np.eye(4), turned, 1 / 3).round(3)[:2].tolist()  # 30 degrees
    [[0.866, -0.5, 0.0, 0.667], [0.5, 0.866, 0.0, 0.0]]
    """
    from scipy.spatial.transform import Rotation  # 0.4 s to import: only where it is needed

    turn = Rotation.from_matrix(first[:3, :3].T @ last[:3, :3]).as_rotvec()
    rotation = first[:3, :3] @ Rotation.from_rotvec(share * turn).as_matrix()
    return rigid(rotation, (1 - share) * first[:3, 3] + share * last[:3, 3])


def nearest_time(times_ns: Sequence[int], time_ns: int, within_ns: int) -> int | None:
    """Place of the time nearest to another, in rising times; None where none is within a span.

    Examples
    --------
    >>> nearest_time([0, 100, 200], 120, 50), nearest_time([0, 100, 200], 300, 50)
    (1, None)
    """
    place = bisect_left(times_ns, time_ns)
    around = range(max(0, place - 1), min(place + 1, len(times_ns)))
    best = min(around, key=lambda nth: abs(times_ns[nth] - time_ns), default=None)
    return best if best is not None and abs(times_ns[best] - time_ns) <= within_ns else None
