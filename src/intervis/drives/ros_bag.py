"""ROS 1 bags, ROS 2 bags and MCAP files: the clouds of one topic are the frames.

A drive is a file (``.bag``, ``.mcap``, ``.db3``) or the folder of a ROS 2 bag. Where it holds
clouds on several topics, the topic is given below its path (``drive.bag/lidar/points``), although
no file has this name. Frames are numbered from 0 in the order of their stamps.

Poses come from the tree of transforms, if one above the cloud's frame changes, otherwise from
odometry. Points are turned by whole right angles into x forward, y left, z up of the vehicle.
"""

import contextlib
import logging
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np

from intervis.arrays import Float64Array
from intervis.drives.drive import Drive
from intervis.drives.frame import ScannerScan
from intervis.drives.mcap_file import McapFile
from intervis.drives.message_file import MessageFile
from intervis.drives.point_cloud2 import decode_point_cloud2, scan_of_cloud
from intervis.drives.pose_track import PoseTrack, nearest_time
from intervis.drives.ros_encoding import LONGEST_NAME, Cursor, Encoding, decoding
from intervis.drives.rosbag1_file import Rosbag1File
from intervis.drives.rosbag2_database import Rosbag2Database
from intervis.drives.scan import Scan
from intervis.drives.transform_tree import (
    Edge,
    Motions,
    TransformTree,
    bare,
    decode_odometry,
)
from intervis.drives.vehicle_axes import sensor_from_velo
from intervis.errors import CalibrationError, DriveError, ScanError

log = logging.getLogger(__name__)

EXPECTED_FILES = "*.bag, *.mcap, *.db3 (recordings of ROS)"
READERS: dict[str, Callable[[Path], MessageFile]] = {
    ".bag": Rosbag1File,
    ".mcap": McapFile,
    ".db3": Rosbag2Database,
}
"""Readers of files by the ending of their names."""

CLOUD, ODOMETRY = "sensor_msgs/PointCloud2", "nav_msgs/Odometry"
TRANSFORMS = ("tf2_msgs/TFMessage", "tf/tfMessage")
METADATA = "metadata.yaml"
ENCODINGS = ("cdr", "ros1")
HEADER_BYTES = 32 + LONGEST_NAME
"""So many bytes hold a message's header."""

WORLD_FRAMES = ("map", "odom", "world", "earth")
"""Frames that stand still (ROS REP 105): below one of them what never moves stands still, too."""

WITHIN_NS = 100_000_000
"""A cloud of another scanner belongs to a frame within this time of it."""


# --- finding recordings ---


def find_roots(path: Path) -> list[Path]:
    """`path`, if it is the folder of a ROS 2 bag, otherwise the recordings in it."""
    files = _files(path)
    packed = sorted(path.glob("*.zstd"))
    if packed and not files and (path / METADATA).is_file():
        raise DriveError(f"{packed[0]} is compressed as a whole: unpack it with zstd -d first.")
    return [path] if files and (path / METADATA).is_file() else files


def find_topic(path: Path) -> Path | None:
    """`path`, if it names a topic below a recording; None otherwise."""
    for above in path.parents:
        if above.exists():
            return path if _is_recording(above) else None
    return None


def _files(folder: Path) -> list[Path]:
    return sorted(
        file
        for file in folder.iterdir()
        if file.suffix.lower() in READERS and file.is_file() and not file.name.startswith(".")
    )


def _is_recording(path: Path) -> bool:
    if path.is_dir():
        return find_roots(path) == [path]
    return path.suffix.lower() in READERS


# --- reading one ---


class _Cloud(NamedTuple):
    """A recorded cloud: the number of its file, its place there, its stamp, its frame."""

    file: int
    entry: Any
    time_ns: int
    frame_id: str


@dataclass(frozen=True, eq=False)
class _Recording:
    """The files of a recording, each indexed."""

    root: Path
    files: Sequence[MessageFile]

    def topics(self, *kinds: str) -> dict[str, str]:
        """Kinds of the topics that hold messages of some kinds, by name."""
        found = {}
        for file in self.files:
            for name, topic in sorted(file.topics.items()):
                if topic.kind in kinds and topic.encoding in ENCODINGS:
                    found[name] = topic.kind
        return found

    def encoding(self, number: int, topic: str) -> Encoding:
        """How the messages of a topic are encoded in a file."""
        return cast(Encoding, self.files[number].topics[topic].encoding)

    def messages(self, topic: str) -> Iterator[tuple[bytes, Encoding]]:
        """The messages of a topic; damaged ones are left out, with a warning."""
        damaged = 0
        for number, file in enumerate(self.files):
            for content in file.read_many(file.entries(topic)):
                if content is None:
                    damaged += 1
                else:
                    yield content, self.encoding(number, topic)
        if damaged:
            log.warning("%d messages of %s in %s are damaged.", damaged, topic, self.root)

    def clouds(self, topic: str) -> list[_Cloud]:
        """The clouds of a topic in the order of their stamps; without a stamp, as recorded."""
        found = []
        for number, file in enumerate(self.files):
            entries = file.entries(topic)
            starts = file.read_many(entries, HEADER_BYTES)
            for entry, start in zip(entries, starts, strict=True):
                time_ns, frame_id = 0, ""  # where it is damaged its own frame fails when it is read
                with contextlib.suppress(ScanError), decoding(self.root, CLOUD, ScanError):
                    time_ns, frame_id = Cursor(start or b"", self.encoding(number, topic)).header()
                recorded_ns = int(entry["time_ns"])
                found.append(_Cloud(number, entry, time_ns or recorded_ns, bare(frame_id)))
        return sorted(found, key=lambda cloud: cloud.time_ns)

    def has_messages(self, topic: str) -> bool:
        """Whether a topic has any."""
        return any(len(file.entries(topic)) for file in self.files)


def read_drive(root: Path, camera: str | None) -> Drive:
    """Read a recording; `root` is its path, or a topic's name below it."""
    path = next(above for above in (root, *root.parents) if above.exists())
    if camera is not None:
        raise DriveError(f"{path} has no camera {camera!r:.60}: images are not read from it.")
    recording = _opened(path)
    asked = "" if root == path else f"/{root.relative_to(path).as_posix()}"
    topic = _chosen(recording, asked)
    places = _Places(recording)
    main = _channel(recording, topic, places)
    numbers = range(len(main.clouds))
    found = {number: main.pose(number) for number in numbers}
    poses = {number: pose for number, pose in found.items() if pose is not None}
    lack = next((way.lack for way in main.ways.values() if way.lack), "")
    stands_below = next((way.stands_below for way in main.ways.values() if way.stands_below), "")
    if stands_below:
        log.warning("%s stands still: no transform below %s changes.", path, stands_below)
    if lack and not poses:
        log.warning("%s has no poses: %s.", path, lack)
    elif len(poses) < len(found):
        log.warning(
            "the poses of %s do not cover the times of %d of its %d clouds.",
            *(path, len(found) - len(poses), len(found)),
        )
    others = [
        _channel(recording, other, places)
        for other in recording.topics(CLOUD)
        if other != topic and recording.has_messages(other)
    ]
    # A topic in the same frame holds the same scanner's points once more, filtered or collected.
    others = [other for other in others if not other.ways.keys() & main.ways.keys()]
    times_ns = [cloud.time_ns for cloud in main.clouds]
    return Drive(
        root=root,
        name=root.name,
        layout="ros_bag",
        scan_paths={number: recording.files[main.clouds[number].file].path for number in numbers},
        poses=poses or None,
        timestamps_ns=dict(enumerate(times_ns)),
        read=main,
        scanner=topic,
        read_other_scans=_OtherScans(times_ns, others) if others else None,
    )


def _channel(recording: _Recording, topic: str, places: "_Places") -> "_Channel":
    clouds = recording.clouds(topic)
    ways = {frame_id: places.ways(frame_id) for frame_id in {one.frame_id for one in clouds}}
    return _Channel(recording, topic, clouds, ways)


def _opened(path: Path) -> _Recording:
    paths = [path] if path.is_file() else _files(path)
    files = [READERS[one.suffix.lower()](one) for one in paths]
    for file in files:
        if file.damage:
            log.warning("%s is damaged: %s; what comes before is read.", file.path, file.damage)
    return _Recording(path, files)


def _chosen(recording: _Recording, asked: str) -> str:
    """The topic of the clouds: the one that is asked for, otherwise the only one."""
    root = recording.root
    filled = [topic for topic in sorted(recording.topics(CLOUD)) if recording.has_messages(topic)]
    if asked and asked not in filled:
        there = ", ".join(filled) or "none"
        raise DriveError(f"{root} has no clouds on {asked:.80}; topics with clouds: {there:.500}.")
    if asked:
        return asked
    if len(filled) > 1:
        paths = ", ".join(f"{root.name}{topic}" for topic in filled)
        raise DriveError(
            f"{root} holds clouds on {len(filled)} topics; give the path of one of them:"
            f" {paths:.500}."
        )
    if not filled:
        every = {
            name: topic.kind for file in recording.files for name, topic in file.topics.items()
        }
        shown = ", ".join(f"{name} ({kind})" for name, kind in sorted(every.items())[:8])
        raise DriveError(
            f"{root} holds no clouds (PointCloud2); its topics: {shown or 'none':.500}."
        )
    return filled[0]


# --- poses ---


class _Places:
    """Where scanners stood: from transforms, or from odometry and fixed transforms."""

    def __init__(self, recording: _Recording) -> None:
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

    def ways(self, frame_id: str) -> "_Way":
        """How poses of a scanner are found, by the frame of its clouds."""
        try:
            edges = self._tree.chain(frame_id)
            moving = any(edge.track for edge in edges)
            ego_from_cloud = self._tree.fixed_above(frame_id)
            if moving:
                return _Way(edges, None, ego_from_cloud, "")
            for child, motions in self._odometry.of_child.items():
                child_from_cloud = self._tree.fixed(child, frame_id)
                if child_from_cloud is not None:
                    return _Way([], motions.track(), child_from_cloud, "")
            top = edges[-1].parent if edges else ""
            if top in WORLD_FRAMES and not self._tree.moves_below(frame_id):
                return _Way(edges, None, ego_from_cloud, "", stands_below=top)
            return _Way([], None, ego_from_cloud, self._lack(frame_id))
        except CalibrationError as error:
            return _Way([], None, np.eye(4), str(error))

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
class _Way:
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


def _odometry(recording: _Recording) -> _Odometry:
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


# --- scans ---


@dataclass(frozen=True, eq=False)
class _Channel:
    """The clouds of a topic, and how they are moved into the scanner's frame."""

    recording: _Recording
    topic: str
    clouds: Sequence[_Cloud]
    ways: Mapping[str, _Way]

    def pose(self, number: int) -> Float64Array | None:
        """world_from_velo of a cloud."""
        cloud = self.clouds[number]
        return self.ways[cloud.frame_id].pose(cloud.time_ns)

    def __call__(self, number: int) -> Scan:
        cloud = self.clouds[number]
        name = self.recording.root / self.topic.strip("/")
        content = self.recording.files[cloud.file].read(cloud.entry)
        encoding = self.recording.encoding(cloud.file, self.topic)
        message = decode_point_cloud2(content, encoding, name)
        velo_from_cloud = self.ways[cloud.frame_id].cloud_from_velo.T
        return scan_of_cloud(message, name, velo_from_cloud)


@dataclass(frozen=True, eq=False)
class _OtherScans:
    """Reads the clouds of other scanners that are nearest in time to a frame."""

    times_ns: Sequence[int]
    channels: Sequence[_Channel]

    def __call__(self, number: int) -> tuple[ScannerScan, ...]:
        scans = []
        for channel in self.channels:
            times_ns = [cloud.time_ns for cloud in channel.clouds]
            nearest = nearest_time(times_ns, self.times_ns[number], WITHIN_NS)
            if nearest is None:
                continue
            scan, pose = channel(nearest), channel.pose(nearest)
            scans.append(
                ScannerScan(channel.topic, scan.points, scan.attributes, pose, times_ns[nearest])
            )
        return tuple(scans)
