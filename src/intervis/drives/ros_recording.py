"""Recordings of ROS: which files they are of, their topics, and their messages with stamps."""

import contextlib
import logging
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, cast

from intervis.drives.mcap_file import McapFile
from intervis.drives.message_file import MessageFile
from intervis.drives.ros_encoding import LONGEST_NAME, Cursor, Encoding, decoding
from intervis.drives.rosbag1_file import Rosbag1File
from intervis.drives.rosbag2_database import Rosbag2Database
from intervis.drives.transform_tree import bare
from intervis.errors import DriveError, ScanError

log = logging.getLogger(__name__)

READERS: dict[str, Callable[[Path], MessageFile]] = {
    ".bag": Rosbag1File,
    ".mcap": McapFile,
    ".db3": Rosbag2Database,
}
"""Readers of files by the ending of their names."""

METADATA = "metadata.yaml"
ENCODINGS = ("cdr", "ros1")
HEADER_BYTES = 32 + LONGEST_NAME
"""So many bytes hold a message's header."""


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


class Stamped(NamedTuple):
    """A recorded message: the number of its file, its place there, its stamp, its frame."""

    file: int
    entry: Any
    time_ns: int
    frame_id: str


@dataclass(frozen=True, eq=False)
class Recording:
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

    def stamped(self, topic: str) -> list[Stamped]:
        """Messages of a topic in the order of their stamps; without a stamp, as recorded."""
        found = []
        for number, file in enumerate(self.files):
            entries = file.entries(topic)
            starts = file.read_many(entries, HEADER_BYTES)
            for entry, start in zip(entries, starts, strict=True):
                time_ns, frame_id = 0, ""  # where it is damaged its own frame fails when it is read
                with contextlib.suppress(ScanError), decoding(self.root, "Header", ScanError):
                    time_ns, frame_id = Cursor(start or b"", self.encoding(number, topic)).header()
                recorded_ns = int(entry["time_ns"])
                found.append(Stamped(number, entry, time_ns or recorded_ns, bare(frame_id)))
        return sorted(found, key=lambda one: one.time_ns)

    def read(self, topic: str, one: Stamped) -> tuple[bytes, Encoding]:
        """The content of a message.

        Raises
        ------
        ScanError
            It is damaged.
        """
        return self.files[one.file].read(one.entry), self.encoding(one.file, topic)

    def has_messages(self, topic: str) -> bool:
        """Whether a topic has any."""
        return any(len(file.entries(topic)) for file in self.files)


def opened(path: Path) -> Recording:
    """The recording at a path, indexed."""
    paths = [path] if path.is_file() else _files(path)
    files = [READERS[one.suffix.lower()](one) for one in paths]
    for file in files:
        if file.damage:
            log.warning("%s is damaged: %s; what comes before is read.", file.path, file.damage)
    return Recording(path, files)
