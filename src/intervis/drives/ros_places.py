"""Where the sensors of a recording stood: by transforms, or by odometry and fixed transforms."""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from intervis.arrays import Float64Array
from intervis.drives.pose_track import PoseTrack
from intervis.drives.ros_recording import Recording
from intervis.drives.transform_tree import Edge, Motions, TransformTree, decode_odometry
from intervis.drives.vehicle_axes import sensor_from_velo
from intervis.errors import CalibrationError

log = logging.getLogger(__name__)

ODOMETRY = "nav_msgs/Odometry"
TRANSFORMS = ("tf2_msgs/TFMessage", "tf/tfMessage")

WORLD_FRAMES = ("map", "odom", "world", "earth")
"""Frames that stand still (ROS REP 105): below one of them what never moves stands still, too."""


class Places:
    """The transforms and the odometry of a recording."""

    def __init__(self, recording: Recording) -> None:
        self._path = recording.root
        self._tree = TransformTree()
        for topic in recording.topics(*TRANSFORMS):
            for content, encoding in recording.messages(topic):
                static = topic.endswith("tf_static")
                with _damage_told(recording.root):
                    self._tree.add(content, encoding, recording.root, static=static)
        self._odometry = _odometry(recording)
        refused = self._tree.refused + self._odometry.refused
        if refused:
            log.warning("%s holds %d poses that are no rigid motion.", recording.root, refused)

    def ways(self, frame_id: str) -> Way:
        """How poses of a scanner are found, by the frame of its clouds."""
        try:
            edges = self._tree.chain(frame_id)
            moving = any(edge.track for edge in edges)
            ego_from_cloud = self._tree.fixed_above(frame_id)
            if moving:
                return Way(edges, None, ego_from_cloud, "")
            for child, motions in self._odometry.of_child.items():
                child_from_cloud = self._tree.fixed(child, frame_id)
                if child_from_cloud is not None:
                    return Way([], motions.track(), child_from_cloud, "")
            top = edges[-1].parent if edges else ""
            if top in WORLD_FRAMES and not self._tree.moves_below(frame_id):
                return Way(edges, None, ego_from_cloud, "", stands_below=top)
            return Way([], None, ego_from_cloud, self._lack(frame_id))
        except CalibrationError as error:
            return Way([], None, np.eye(4), str(error))

    def fixed(self, to_frame: str, from_frame: str) -> Float64Array | None:
        """to_from (4, 4): the motion between two frames that does not change; None: unknown.

        Raises
        ------
        CalibrationError
            The frames form a circle.
        """
        return self._tree.fixed(to_frame, from_frame)

    def _lack(self, frame_id: str) -> str:
        """Why there are no poses."""
        if self._tree.moves_below(frame_id):
            return f"its clouds are in the frame {frame_id!r:.80}, which does not move"
        children = ", ".join(self._odometry.of_child)
        if children:
            return f"no fixed transform leads from {children:.200} (odometry) to {frame_id!r:.80}"
        if self._tree:
            return (
                f"no transform above the frame {frame_id!r:.80} changes, and there is no odometry"
            )
        return "it holds neither transforms (tf) nor odometry"


@dataclass(frozen=True, eq=False)
class Way:
    """From the frame of the clouds to that of the world.

    Attributes
    ----------
    edges : sequence of Edge
        Transforms upwards, where they give the poses.
    odometry : PoseTrack or None
        world_from_vehicle, where odometry gives the poses.
    ego_from_cloud : (4, 4) array
    lack : str
        Why there are no poses; empty where there are.
    stands_below : str
        The frame of the world below which no transform changes; empty where the scanner moves.
    """

    edges: Sequence[Edge]
    odometry: PoseTrack | None
    ego_from_cloud: Float64Array
    lack: str
    stands_below: str = ""

    @property
    def cloud_from_velo(self) -> Float64Array:
        """A turn by right angles."""
        return sensor_from_velo(self.ego_from_cloud)

    def pose(self, time_ns: int) -> Float64Array | None:
        """world_from_velo at a time; None where it is not known."""
        if self.lack:
            return None
        if self.odometry is not None:
            world_from_ego = self.odometry.at(time_ns)
            if world_from_ego is None:
                return None
            return world_from_ego @ self.ego_from_cloud @ self.cloud_from_velo
        pose = self.cloud_from_velo
        for edge in self.edges:
            step = edge.at(time_ns)
            if step is None:
                return None
            pose = step @ pose
        return pose


class _Odometry(NamedTuple):
    """Motions of vehicles by the names of their frames, and the number that were none."""

    of_child: Mapping[str, Motions]
    refused: int


def _odometry(recording: Recording) -> _Odometry:
    found: dict[str, Motions] = {}
    refused = 0
    for topic in recording.topics(ODOMETRY):
        own: dict[str, Motions] = {}
        for content, encoding in recording.messages(topic):
            with _damage_told(recording.root):
                time_ns, child, values = decode_odometry(content, encoding, recording.root)
                refused += not own.setdefault(child, Motions()).add(time_ns, values)
        for child, motions in own.items():
            if child in found:
                log.warning(
                    "%s holds odometry of %s on several topics; %s is not used.",
                    *(recording.root, child, topic),
                )
            elif motions:
                found[child] = motions
    return _Odometry(found, refused)


@contextlib.contextmanager
def _damage_told(path: Path) -> Iterator[None]:
    try:
        yield
    except CalibrationError as error:
        log.warning("%s", error)
