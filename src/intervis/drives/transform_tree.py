"""The tree of coordinate frames that ROS messages of transforms describe.

Each frame has one parent. A transform of ``/tf_static`` holds at all times; those of ``/tf`` hold
at their stamps and are interpolated between. A transform of ``/tf`` that never changes is taken
for static, as ROS 1 publishes static transforms there.
"""

import logging
import math
from array import array
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from intervis.arrays import Float64Array
from intervis.drives.pcd_file import rotation_of_quaternion
from intervis.drives.pose_track import PoseTrack
from intervis.drives.ros_encoding import Cursor, Encoding, decoding
from intervis.errors import CalibrationError
from intervis.transform import inverse, rigid

log = logging.getLogger(__name__)

FARTHEST_M = 1e9
MOST_TRANSFORMS = 100_000
UNCHANGED = 1e-9
"""A transform whose numbers differ by less does not change."""


@dataclass
class Motions:
    """Stamped motions between two frames, each three metres and a quaternion x, y, z, w."""

    times_ns: "array[int]" = field(default_factory=lambda: array("q"))
    values: "array[float]" = field(default_factory=lambda: array("d"))

    def add(self, time_ns: int, values: tuple[float, ...]) -> bool:
        """Add a motion of seven numbers, unless it is none; whether it was added."""
        *place, x, y, z, w = values
        length = math.hypot(x, y, z, w)
        if not (1e-3 < length < 1e3 and all(abs(one) < FARTHEST_M for one in place)):
            return False
        self.times_ns.append(time_ns)
        self.values.extend(values)
        return True

    def __bool__(self) -> bool:
        return bool(self.times_ns)

    def _ordered(self) -> tuple[np.ndarray, Float64Array]:
        times_ns = np.array(self.times_ns, np.int64)
        values = np.array(self.values).reshape(-1, 7)
        # Recordings repeat a stamp; of several the last counts.
        times_ns, last = np.unique(times_ns[::-1], return_index=True)
        return times_ns, values[::-1][last]

    @property
    def changes(self) -> bool:
        """Whether the motions differ."""
        values = np.array(self.values).reshape(-1, 7)
        return bool((np.ptp(values, axis=0) > UNCHANGED).any())

    def track(self) -> PoseTrack:
        """The motions as poses over time."""
        times_ns, values = self._ordered()
        return PoseTrack.over_gaps(times_ns, _Poses(values))

    def last(self) -> Float64Array:
        """The motion with the latest stamp."""
        return motion(self._ordered()[1][-1])


@dataclass(frozen=True, eq=False)
class _Poses(Sequence[Float64Array]):
    """Motions that are made when they are asked for: recordings hold a hundred a second."""

    values: Float64Array

    def __len__(self) -> int:
        return len(self.values)

    def __getitem__(self, place: Any) -> Any:
        return motion(self.values[place])


def motion(values: Float64Array) -> Float64Array:
    """(4, 4) motion of three metres and a quaternion x, y, z, w."""
    x, y, z, w = values[3:]
    return rigid(rotation_of_quaternion(np.array([w, x, y, z])), values[:3])


class TransformTree:
    """Frames by the names of their parents, filled by `add`."""

    def __init__(self) -> None:
        self._motions: dict[tuple[str, str], Motions] = defaultdict(Motions)
        self._static: set[tuple[str, str]] = set()
        self.refused = 0
        """Number of transforms that were no motions."""

    def add(self, content: bytes, encoding: Encoding, name: Path, *, static: bool) -> None:
        """Add the transforms of a message ``tf2_msgs/TFMessage``.

        Raises
        ------
        CalibrationError
            The bytes are no such message.
        """
        with decoding(name, "TFMessage", CalibrationError):
            cursor = Cursor(content, encoding)
            for _ in range(cursor.count(MOST_TRANSFORMS)):
                time_ns, parent = cursor.header()
                edge = (bare(parent), bare(cursor.text()))
                values = cursor.numbers("ddd") + cursor.numbers("dddd")
                if not self._motions[edge].add(time_ns, values):
                    self.refused += 1
                elif static:
                    self._static.add(edge)

    def __bool__(self) -> bool:
        return any(self._motions.values())

    def chain(self, frame: str) -> "list[Edge]":
        """The transforms from a frame up to the root, nearest first.

        Raises
        ------
        CalibrationError
            The frames form a circle.
        """
        edges: list[Edge] = []
        names = [frame]
        while parent := self._parent(names[-1]):
            if parent in names:
                circle = " -> ".join([*names[names.index(parent) :], parent])
                raise CalibrationError(f"the transforms form a circle: {circle:.300}")
            key = (parent, names[-1])
            motions = self._motions[key]
            if key in self._static or not motions.changes:
                edges.append(Edge(parent, names[-1], motions.last(), None))
            else:
                edges.append(Edge(parent, names[-1], None, motions.track()))
            names.append(parent)
        return edges

    def _parent(self, frame: str) -> str | None:
        """The parent of a frame; of several the one with most transforms."""
        counts = {
            parent: len(motions.times_ns)
            for (parent, child), motions in self._motions.items()
            if child == frame and motions
        }
        if len(counts) > 1:
            log.warning(
                "the frame %s has the parents %s; the one with most transforms is taken.",
                *(frame, ", ".join(sorted(counts))),
            )
        return max(counts, key=lambda parent: (counts[parent], parent), default=None)

    def fixed(self, to_frame: str, from_frame: str) -> Float64Array | None:
        """to_from: the motion between two frames that does not change; None where it is unknown."""
        above = [self._fixed(frame) for frame in (to_frame, from_frame)]
        for common, common_from_to in above[0].items():
            if common in above[1]:
                return inverse(common_from_to) @ above[1][common]
        return None

    def fixed_above(self, frame: str) -> Float64Array:
        """ego_from_frame: the motion into the highest frame that moves with this one."""
        return list(self._fixed(frame).values())[-1]

    def moves_below(self, frame: str) -> bool:
        """Whether a frame below this one moves against it."""
        edges = [edge for edge, motions in self._motions.items() if motions and motions.changes]
        return any(
            frame in (parent, *(edge.parent for edge in self.chain(parent))) for parent, _ in edges
        )

    def _fixed(self, frame: str) -> dict[str, Float64Array]:
        """Motions from a frame to itself and to the frames above it, as far as none changes."""
        found = {frame: np.eye(4)}
        for edge in self.chain(frame):
            if edge.motion is None:
                break
            found[edge.parent] = edge.motion @ found[edge.child]
        return found


@dataclass(frozen=True, eq=False)
class Edge:
    """parent_from_child: either one motion for all times, or a track."""

    parent: str
    child: str
    motion: Float64Array | None
    track: PoseTrack | None

    def at(self, time_ns: int) -> Float64Array | None:
        """The motion at a time; None where the track does not cover it."""
        return self.track.at(time_ns) if self.track else self.motion


def bare(name: str) -> str:
    """The name of a frame without the slash that ROS 1 may put before it."""
    return name.lstrip("/")


def decode_odometry(
    content: bytes, encoding: Encoding, name: Path
) -> tuple[int, str, tuple[float, ...]]:
    """Stamp, name of the vehicle's frame, and motion of a message ``nav_msgs/Odometry``.

    Raises
    ------
    CalibrationError
        The bytes are no such message.
    """
    with decoding(name, "Odometry", CalibrationError):
        cursor = Cursor(content, encoding)
        time_ns, _ = cursor.header()
        return time_ns, bare(cursor.text()), cursor.numbers("ddd") + cursor.numbers("dddd")
