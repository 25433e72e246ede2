"""A recording for the viewer of Rerun, as an ``.rrd`` file.

Coordinates are metres in the sensor's frame, below the entity ``world/sensor``, which the poses
move. The world is the drive's, shifted to the place of the first frame by whole metres
(``world_origin_m`` of the recording's properties), because the viewer computes in single precision.
"""

import contextlib
import os
import threading
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from intervis.arrays import Float64Array
from intervis.drives import Drive
from intervis.errors import MissingExtraError, OutputError
from intervis.files import whole_file
from intervis.view.judged_frame import JudgedFrame
from intervis.view.recordings.drive_clock import DriveClock
from intervis.view.recordings.recording_file import check_recording_file
from intervis.view.recordings.rerun_blueprint import blueprint
from intervis.view.recordings.rerun_layers import Layers, static_entities
from intervis.view.view_request import ViewRequest

APPLICATION = "intervis view"
"""Stands in the head of each recording: such files may be replaced."""

FLUSH_S = 60.0


def check_rerun_file(path: Path) -> None:
    """Check before the work that it can be done: see `check_recording_file`, and the extra."""
    check_recording_file(path, "Rerun", ".rrd", APPLICATION)
    try:
        import rerun  # noqa: F401
    except ImportError:
        raise MissingExtraError("rerun-sdk", "viewer", "Recording for Rerun") from None


@contextlib.contextmanager
def rerun_recording(
    path: Path, drive: Drive, numbers: Sequence[int], request: ViewRequest
) -> Iterator["RerunSink"]:
    """A recording that takes judged frames; its file appears when all are in it, or not at all.

    Parameters
    ----------
    path : Path
        Ends in .rrd.
    drive : Drive
    numbers : sequence of int
        The frames that will be recorded.
    request : ViewRequest

    Yields
    ------
    RerunSink
        For `intervis.view.judge_frames`.

    Raises
    ------
    OutputError
        The file cannot be written, or stands there and is no recording of ours.
    MissingExtraError
        rerun-sdk (extra ``viewer``) is not installed.
    """
    check_rerun_file(path)
    import rerun as rr

    with whole_file(path) as file:
        stream = rr.RecordingStream(APPLICATION, send_properties=False)
        if not stream.is_enabled():
            raise OutputError(
                "Rerun is switched off by the environment variable RERUN: unset it to record."
            )
        stream.set_log_time_enabled(False)
        stream.set_log_tick_enabled(False)
        with _saved(stream, file, blueprint(drive, request)) as check:
            yield RerunSink(stream, drive, numbers, check)


@contextlib.contextmanager
def _saved(stream: Any, file: BinaryIO, default_blueprint: Any) -> Iterator[Callable[[], None]]:
    """Let a stream write into a file of ours; yields a function that raises the file's error.

    Rerun waits for ever for its own file where the disk is full. It is given a pipe instead, and
    this process writes what comes out of it.
    """
    if not os.path.isdir("/dev/fd"):  # Windows: a pipe has no name there
        stream.save(file.name, default_blueprint=default_blueprint)
        try:
            yield lambda: None
        finally:
            stream.disconnect()
        return
    source, sink = os.pipe()
    writer = _PipeWriter(source, file)
    writer.start()
    try:
        stream.save(f"/dev/fd/{sink}", default_blueprint=default_blueprint)
    finally:
        os.close(sink)
    try:
        yield writer.check
    finally:
        stream.disconnect()
        writer.join()
    writer.check()


class _PipeWriter(threading.Thread):
    """Copies a pipe into a file until the pipe is closed; after an error it reads on."""

    def __init__(self, source: int, file: BinaryIO) -> None:
        super().__init__(daemon=True)
        self._error: OSError | None = None
        self._source, self._file = source, file

    def run(self) -> None:
        """Copy."""
        with open(self._source, "rb", buffering=0) as pipe:
            while block := pipe.read(1 << 20):
                if self._error is None:
                    try:
                        self._file.write(block)
                    except OSError as error:
                        self._error = error

    def check(self) -> None:
        """Raise what a write raised."""
        if self._error is not None:
            raise self._error


class RerunSink:
    """Writes judged frames into a recording; made by `rerun_recording`."""

    def __init__(
        self, stream: Any, drive: Drive, numbers: Sequence[int], check: Callable[[], None]
    ) -> None:
        self._stream, self._check = stream, check
        self._clock = DriveClock(drive, numbers)
        self._layers = Layers(stream)
        self._origin: Float64Array | None = None
        stream.send_recording_name(drive.name)
        for path, archetype in static_entities():
            stream.log(path, archetype, static=True)

    def prepare(self, judged: JudgedFrame) -> JudgedFrame:
        """Reduce the image while other frames are judged."""
        _ = judged.image
        return judged

    def add(self, prepared: JudgedFrame) -> None:
        """Record a frame."""
        stream, frame = self._stream, prepared.frame
        stream.set_time("frame", sequence=frame.number)
        if self._clock.is_measured:
            time_ns = self._clock.time_ns(frame.number)
            if self._clock.is_epoch:
                stream.set_time("time", timestamp=np.datetime64(time_ns, "ns"))
            else:
                stream.set_time("time", duration=np.timedelta64(time_ns, "ns"))
        self._layers.place(self._world_from_velo(frame.pose))
        self._layers.log(prepared)
        stream.flush(timeout_sec=FLUSH_S)
        self._check()

    def _world_from_velo(self, pose: Float64Array | None) -> Float64Array | None:
        """The pose in the recording's world."""
        if pose is None:
            return None
        if self._origin is None:
            self._origin = np.rint(pose[:3, 3])
            self._stream.send_property("world_origin_m", _origin_property(self._origin))
        shifted = pose.copy()
        shifted[:3, 3] -= self._origin
        return shifted


def _origin_property(origin: Float64Array) -> Any:
    import rerun as rr

    return rr.AnyValues(x=origin[0], y=origin[1], z=origin[2])
