"""Writing an MCAP file of ROS 2 messages: clouds of scanners, images of cameras, transforms.

``/lidar/NAME`` holds the sweeps as they were measured, with the time of each point (``t``,
nanoseconds after the stamp) where the scanner moved; ``/tf`` the pose of ``base_link`` (the
vehicle) in ``map``, ``/tf_static`` the sensors' places in ``base_link``. ``/camera/NAME`` holds
JPEG images with their calibration. The messages of a frame
form a chunk without compression. Source: mcap.dev/spec.
"""

import struct
import zlib
from collections import Counter, defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import intervis
from intervis.drives import mcap_file
from intervis.drives.drive_writer import FrameRecord, ImageRecord, Rig, RigCamera, jpeg_of
from intervis.drives.pcd_writer import point_table
from intervis.drives.ros_messages import (
    CLOUD_TYPE,
    DEFINITIONS,
    IMAGE_TYPE,
    INFO_TYPE,
    TRANSFORMS_TYPE,
    camera_info_message,
    cloud_message,
    compressed_image_message,
    transforms_message,
)

FILE_NAME = "drive.mcap"
WORLD, EGO = "map", "base_link"
HEADER, CHUNK_INDEX, STATISTICS, SUMMARY_OFFSET = 0x01, 0x08, 0x0B, 0x0E


class McapWriter:
    """Writes ``drive.mcap``; see `drive_writer.DriveWriter`."""

    def __init__(self, root: Path, rig: Rig) -> None:
        self._rig = rig
        self._poses_until_ns = -1
        topics = {"/tf": TRANSFORMS_TYPE, "/tf_static": TRANSFORMS_TYPE}
        topics |= {f"/lidar/{scanner.name}": CLOUD_TYPE for scanner in rig.scanners}
        for camera in rig.cameras:
            info, image = _camera_topics(camera)
            topics |= {info: INFO_TYPE, image: IMAGE_TYPE}
        self._file = _Container(root / FILE_NAME, topics)

    def add(self, frame: FrameRecord) -> None:
        """See `drive_writer.DriveWriter`."""
        messages = []
        if self._poses_until_ns < 0:
            static = [
                (frame.time_ns, EGO, scanner.name, scanner.ego_from_velo)
                for scanner in self._rig.scanners
            ] + [
                (frame.time_ns, EGO, _optical_frame(camera), camera.ego_from_cam)
                for camera in self._rig.cameras
            ]
            messages.append(_Message("/tf_static", frame.time_ns, transforms_message(static)))
        for time_ns, pose in zip(frame.track.times_ns.tolist(), frame.track.poses, strict=True):
            if time_ns > self._poses_until_ns:
                content = transforms_message([(time_ns, WORLD, EGO, pose)])
                messages.append(_Message("/tf", time_ns, content))
                self._poses_until_ns = time_ns
        for scanner, scan in zip(self._rig.scanners, frame.scans, strict=True):
            cloud = cloud_message(point_table(scan), frame.time_ns, scanner.name)
            messages.append(_Message(f"/lidar/{scanner.name}", frame.time_ns, cloud))
        for camera, image in zip(self._rig.cameras, frame.images, strict=False):
            messages += _camera_messages(camera, image)
        self._file.write_chunk(sorted(messages, key=lambda message: message.time_ns))

    def close(self) -> Path:
        """See `drive_writer.DriveWriter`."""
        self._file.close()
        first = self._rig.scanners[0].name
        return Path(FILE_NAME) if len(self._rig.scanners) == 1 else Path(FILE_NAME, "lidar", first)

    def release(self) -> None:
        """See `drive_writer.DriveWriter`."""
        self._file.release()


class _Message(NamedTuple):
    topic: str
    time_ns: int
    content: bytes


def _camera_topics(camera: RigCamera) -> tuple[str, str]:
    """Topics of the calibration and of the images of a camera."""
    return f"/camera/{camera.name}/camera_info", f"/camera/{camera.name}/image_rect/compressed"


def _optical_frame(camera: RigCamera) -> str:
    return f"camera_{camera.name}"


def _camera_messages(camera: RigCamera, image: ImageRecord) -> list[_Message]:
    """The calibration of a camera with an image, both at the time of the image."""
    info, pixels = _camera_topics(camera)
    frame_id = _optical_frame(camera)
    calibration = camera_info_message(camera.camera, image.time_ns, frame_id)
    content = compressed_image_message(jpeg_of(image), image.time_ns, frame_id)
    return [_Message(info, image.time_ns, calibration), _Message(pixels, image.time_ns, content)]


class _Container:
    """The records of an MCAP file: definitions, chunks with indexes, a summary."""

    def __init__(self, path: Path, topics: dict[str, str]) -> None:
        self._file = path.open("wb")
        self._channels = {topic: number for number, topic in enumerate(topics, start=1)}
        self._counts: Counter[int] = Counter()
        self._span_ns: list[int] = []
        self._chunk_indexes: list[bytes] = []
        schemas = {kind: number for number, kind in enumerate(dict.fromkeys(topics.values()), 1)}
        self._schemas = [
            _record(
                mcap_file.SCHEMA,
                struct.pack("<H", number)
                + _text(kind)
                + _text("ros2msg")
                + _octets(DEFINITIONS[kind].encode()),
            )
            for kind, number in schemas.items()
        ]
        self._definitions = [
            _record(
                mcap_file.CHANNEL,
                struct.pack("<HH", number, schemas[topics[topic]])
                + _text(topic)
                + _text("cdr")
                + _octets(b""),
            )
            for topic, number in self._channels.items()
        ]
        library = f"intervis {intervis.__version__}"
        self._file.write(mcap_file.MAGIC + _record(HEADER, _text("ros2") + _text(library)))
        self._file.write(b"".join(self._schemas + self._definitions))

    def write_chunk(self, messages: Sequence[_Message]) -> None:
        """Write messages in the order of their times, and their indexes."""
        records, steps = bytearray(), defaultdict(list)
        for topic, time_ns, content in messages:
            channel = self._channels[topic]
            steps[channel].append((time_ns, len(records)))
            head = mcap_file.MESSAGE_HEAD.pack(channel, self._counts[channel], time_ns, time_ns)
            records += _record(mcap_file.MESSAGE, head + content)
            self._counts[channel] += 1
        first_ns, last_ns = messages[0].time_ns, messages[-1].time_ns
        self._span_ns += [first_ns, last_ns]
        head = mcap_file.CHUNK_HEAD.pack(first_ns, last_ns, len(records), zlib.crc32(records))
        size = struct.pack("<Q", len(records))
        start = self._file.tell()
        self._file.write(_record(mcap_file.CHUNK, head + _text("") + size + bytes(records)))
        after = self._file.tell()
        places = {}
        for channel, entries in steps.items():
            places[channel] = self._file.tell()
            index = b"".join(struct.pack("<QQ", *entry) for entry in entries)
            content = struct.pack("<H", channel) + _octets(index)
            self._file.write(_record(mcap_file.INDEX, content))
        self._chunk_indexes.append(
            _record(
                CHUNK_INDEX,
                struct.pack("<QQQQ", first_ns, last_ns, start, after - start)
                + _octets(b"".join(struct.pack("<HQ", *place) for place in places.items()))
                + struct.pack("<Q", self._file.tell() - after)
                + _text("")
                + struct.pack("<QQ", len(records), len(records)),
            )
        )

    def close(self) -> None:
        """Write the summary, which lets readers find a message without walking the file."""
        self._file.write(_record(mcap_file.DATA_END, struct.pack("<I", 0)))  # 0: no checksum
        start = self._file.tell()
        groups = {
            mcap_file.SCHEMA: b"".join(self._schemas),
            mcap_file.CHANNEL: b"".join(self._definitions),
            STATISTICS: self._statistics(),
            CHUNK_INDEX: b"".join(self._chunk_indexes),
        }
        summary, offsets = b"", b""
        for kind, content in groups.items():
            if content:
                place = struct.pack("<BQQ", kind, start + len(summary), len(content))
                offsets += _record(SUMMARY_OFFSET, place)
                summary += content
        offsets_start = start + len(summary)
        head = struct.pack("<BQQQ", mcap_file.FOOTER, 20, start, offsets_start)
        checksum = struct.pack("<I", zlib.crc32(summary + offsets + head))
        self._file.write(summary + offsets + head + checksum + mcap_file.MAGIC)
        self.release()

    def release(self) -> None:
        """Close the file, complete or not."""
        self._file.close()

    def _statistics(self) -> bytes:
        span_ns = self._span_ns or [0]
        counts = b"".join(struct.pack("<HQ", *count) for count in sorted(self._counts.items()))
        chunks, channels = len(self._chunk_indexes), len(self._channels)
        head = struct.pack(
            "<QHIIII", self._counts.total(), len(self._schemas), channels, 0, 0, chunks
        )
        content = head + struct.pack("<QQ", min(span_ns), max(span_ns)) + _octets(counts)
        return _record(STATISTICS, content)


def _record(kind: int, content: bytes) -> bytes:
    return struct.pack("<BQ", kind, len(content)) + content


def _octets(content: bytes) -> bytes:
    return struct.pack("<I", len(content)) + content


def _text(text: str) -> bytes:
    return _octets(text.encode())
