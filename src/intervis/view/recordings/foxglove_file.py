"""A recording for Foxglove, as an MCAP file with Foxglove's messages."""

import contextlib
import os
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, BinaryIO

from intervis.drives import Drive
from intervis.errors import MissingExtraError
from intervis.files import whole_file
from intervis.view.judged_frame import JudgedFrame
from intervis.view.recordings.drive_clock import NS_PER_FRAME, DriveClock
from intervis.view.recordings.foxglove_messages import MEASURES_SCHEMA, TOPICS, frame_messages
from intervis.view.recordings.recording_file import check_recording_file
from intervis.view.view_request import ViewRequest

PROFILE = "intervis-view"
"""Stands in the head of each recording: such files may be replaced."""


def check_foxglove_file(path: Path) -> None:
    """Check before the work that it can be done: see `check_recording_file`, and the extra."""
    check_recording_file(path, "Foxglove", ".mcap", PROFILE)
    try:
        import foxglove  # noqa: F401
    except ImportError:
        raise MissingExtraError("foxglove-sdk", "viewer", "Recording for Foxglove") from None


@contextlib.contextmanager
def foxglove_recording(
    path: Path, drive: Drive, numbers: Sequence[int], request: ViewRequest
) -> Iterator["FoxgloveSink"]:
    """A recording that takes judged frames; arguments and errors as `rerun_recording`.

    Its path ends in .mcap, and it yields a `FoxgloveSink`.
    """
    check_foxglove_file(path)
    import foxglove
    from foxglove.mcap import MCAPCompression, MCAPWriteOptions

    context, clock = foxglove.Context(), DriveClock(drive, numbers)
    options = MCAPWriteOptions(profile=PROFILE, compression=MCAPCompression.Lz4)
    with whole_file(path) as file:
        watched = _WatchedFile(file)
        writer = foxglove.open_mcap(watched, context=context, writer_options=options)
        try:
            yield FoxgloveSink(context, clock, watched)
            writer.write_metadata("intervis", _metadata(drive, request, clock))
        finally:
            writer.close()
        watched.check()


def _metadata(drive: Drive, request: ViewRequest, clock: DriveClock) -> dict[str, str]:
    """What a reader of the file cannot see in the messages."""
    times = "of the drive" if clock.is_measured else f"assumed, {NS_PER_FRAME:,} ns a frame"
    return {
        "drive": drive.name,
        "viewpoint": str(request.viewpoint),
        "risk": str(request.risk),
        "scans_before_and_after": str(request.memory),
        "times": times,
        "state": "1 visible, 0 occluded, -1 unknown",
    }


class _WatchedFile:
    """A file whose first error is kept: the writer of the SDK only logs what it cannot write.

    After the error it takes everything and keeps count of its position, which the SDK compares
    with its own: it would end with a panic where they differ.
    """

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._error: OSError | None = None
        self._at = self._end = 0

    def write(self, content: bytes) -> int:
        """Write, unless a write failed before."""
        self._attempt(lambda: self._file.write(content))
        self._at += len(content)
        self._end = max(self._end, self._at)
        return len(content)

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """As of a file."""
        origin = {os.SEEK_SET: 0, os.SEEK_CUR: self._at, os.SEEK_END: self._end}[whence]
        self._at = origin + offset
        self._attempt(lambda: self._file.seek(self._at))
        return self._at

    def flush(self) -> None:
        """Flush, unless a write failed before."""
        self._attempt(self._file.flush)

    def check(self) -> None:
        """Raise what a write raised."""
        if self._error is not None:
            raise self._error

    def _attempt(self, call: Callable[[], object]) -> None:
        if self._error is None:
            try:
                call()
            except OSError as error:
                self._error = error


class FoxgloveSink:
    """Writes judged frames into a recording; made by `foxglove_recording`."""

    def __init__(self, context: Any, clock: DriveClock, file: _WatchedFile) -> None:
        from foxglove import Channel, channels

        self._clock, self._file = clock, file
        self._channels = {
            topic: getattr(channels, f"{kind}Channel")(topic, context=context)
            for topic, kind in TOPICS.items()
        }
        self._channels["/measures"] = Channel("/measures", schema=MEASURES_SCHEMA, context=context)

    def prepare(self, judged: JudgedFrame) -> tuple[int, list[tuple[str, Any]]]:
        """The time and the messages of a frame, by topic."""
        time_ns = self._clock.time_ns(judged.frame.number)
        return time_ns, list(frame_messages(judged, time_ns))

    def add(self, prepared: tuple[int, list[tuple[str, Any]]]) -> None:
        """Record them."""
        time_ns, messages = prepared
        for topic, message in messages:
            self._channels[topic].log(message, log_time=time_ns)
        self._file.check()
