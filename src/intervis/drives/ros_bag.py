"""ROS 1 bags, ROS 2 bags and MCAP files: the clouds of one topic are the frames.

A drive is a file (``.bag``, ``.mcap``, ``.db3``) or the folder of a ROS 2 bag. Where it holds
clouds on several topics, the topic is given below its path (``drive.bag/lidar/points``), although
no file has this name. Frames are numbered from 0 in the order of their stamps.

Poses come from the tree of transforms, if one above the cloud's frame changes, otherwise from
odometry. Points are turned by whole right angles into x forward, y left, z up of the vehicle.
Cameras are those with a ``CameraInfo`` (`ros_cameras`).
"""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from intervis.arrays import Float64Array
from intervis.drives.drive import Drive
from intervis.drives.frame import ScannerScan
from intervis.drives.point_cloud2 import decode_point_cloud2, scan_of_cloud
from intervis.drives.pose_track import nearest_time
from intervis.drives.ros_cameras import chosen_camera
from intervis.drives.ros_places import Places, Way
from intervis.drives.ros_recording import (
    READERS,
    Recording,
    Stamped,
    find_roots,
    find_topic,
    opened,
)
from intervis.drives.scan import Scan
from intervis.errors import DriveError

__all__ = ["EXPECTED_FILES", "READERS", "find_roots", "find_topic", "read_drive"]

log = logging.getLogger(__name__)

EXPECTED_FILES = "*.bag, *.mcap, *.db3 (recordings of ROS)"
CLOUD = "sensor_msgs/PointCloud2"

WITHIN_NS = 100_000_000
"""A cloud of another scanner belongs to a frame within this time of it."""


def read_drive(root: Path, camera: str | None) -> Drive:
    """Read a recording; `root` is its path, or a topic's name below it."""
    path = next(above for above in (root, *root.parents) if above.exists())
    recording = opened(path)
    asked = "" if root == path else f"/{root.relative_to(path).as_posix()}"
    topic = _chosen(recording, asked)
    places = Places(recording)
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
    names, seen = chosen_camera(recording, camera, main.clouds, main.ways, places)
    return Drive(
        root=root,
        name=root.name,
        layout="ros_bag",
        scan_paths={number: recording.files[main.clouds[number].file].path for number in numbers},
        poses=poses or None,
        timestamps_ns=dict(enumerate(times_ns)),
        read=main,
        camera_names=names,
        camera_name=seen.name if seen else None,
        calibration=seen.calibration if seen else None,
        image_readers=seen.image_readers if seen else {},
        scanner=topic,
        read_other_scans=_OtherScans(times_ns, others) if others else None,
    )


def _channel(recording: Recording, topic: str, places: Places) -> "_Channel":
    clouds = recording.stamped(topic)
    ways = {frame_id: places.ways(frame_id) for frame_id in {one.frame_id for one in clouds}}
    return _Channel(recording, topic, clouds, ways)


def _chosen(recording: Recording, asked: str) -> str:
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


@dataclass(frozen=True, eq=False)
class _Channel:
    """The clouds of a topic, and how they are moved into the scanner's frame."""

    recording: Recording
    topic: str
    clouds: Sequence[Stamped]
    ways: Mapping[str, Way]

    def pose(self, number: int) -> Float64Array | None:
        """world_from_velo of a cloud."""
        cloud = self.clouds[number]
        return self.ways[cloud.frame_id].pose(cloud.time_ns)

    def __call__(self, number: int) -> Scan:
        cloud = self.clouds[number]
        name = self.recording.root / self.topic.strip("/")
        message = decode_point_cloud2(*self.recording.read(self.topic, cloud), name)
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
