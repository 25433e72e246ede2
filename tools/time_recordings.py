"""Time what a recording of a drive takes: judging its frames, and writing them.

``python tools/time_recordings.py DRIVE`` prints frames a second by the clock, and processor time a
frame, from a place 12 m ahead; with the defaults of ``intervis view``, and with
``--memory 0 --no-blind-spots``. Both are timed alone, and together, as the command does: other
threads judge the next frames while one is written. Kernels are compiled before.
"""

import argparse
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from functools import partial
from pathlib import Path

from intervis.drives import Drive, open_drive
from intervis.view import ViewRequest, judge_frames
from intervis.view.frame_stream import FrameSink
from intervis.view.judged_frame import JudgedFrame
from intervis.view.recordings import foxglove_recording, rerun_recording

PLACE = (12.0, 0.0, 1.0)
REQUESTS = {
    "defaults": ViewRequest(viewpoint=PLACE),
    "--memory 0 --no-blind-spots": ViewRequest(viewpoint=PLACE, memory=0, has_blind_spots=False),
}
Recording = Callable[..., AbstractContextManager[FrameSink]]
RECORDINGS: dict[str, tuple[Recording, str]] = {
    "Rerun": (rerun_recording, "r.rrd"),
    "Foxglove": (foxglove_recording, "f.mcap"),
}


class Kept:
    """Keeps the judged frames, with what they compute when they are first asked."""

    def __init__(self) -> None:
        self.frames: list[JudgedFrame] = []

    def prepare(self, judged: JudgedFrame) -> JudgedFrame:
        """Reduce the image, and outline the blind spots."""
        _ = judged.image, judged.spots
        return judged

    def add(self, prepared: JudgedFrame) -> None:
        """Keep a frame."""
        self.frames.append(prepared)


def timed(name: str, frames: int, work: Callable[[], object]) -> None:
    """Do some work on so many frames, and print what it took."""
    clock_s, processor_s = time.perf_counter(), time.process_time()
    work()
    clock_s, processor_s = time.perf_counter() - clock_s, time.process_time() - processor_s
    each_ms = 1000 * processor_s / frames
    print(
        f"  {name:18s} {frames / clock_s:6.1f} frames/s, {each_ms:5.0f} ms of processor time each"
    )


def time_request(drive: Drive, request: ViewRequest, folder: Path) -> None:
    """Judge all frames, and write them with each recording."""
    numbers, kept = drive.frame_numbers, Kept()
    timed("judge", len(numbers), lambda: judge_frames(drive, numbers, request, [kept]))
    for viewer, (recording, name) in RECORDINGS.items():
        path = folder / name
        write = partial(write_frames, kept.frames, recording(path, drive, numbers, request))
        timed(f"write for {viewer}", len(numbers), write)
        print(f"  {'':18s} {path.stat().st_size / 1e6 / len(numbers):6.2f} MB a frame")
        path.unlink()
        both = partial(judge_and_write, drive, request, recording(path, drive, numbers, request))
        timed("judge and write", len(numbers), both)
        path.unlink()


def write_frames(
    frames: Sequence[JudgedFrame], recording: AbstractContextManager[FrameSink]
) -> None:
    """Write judged frames."""
    with recording as sink:
        for frame in frames:
            sink.add(sink.prepare(frame))


def judge_and_write(
    drive: Drive, request: ViewRequest, recording: AbstractContextManager[FrameSink]
) -> None:
    """Judge all frames while those before are written, as ``intervis view`` does."""
    with recording as sink:
        judge_frames(drive, drive.frame_numbers, request, [sink])


def main() -> None:
    """Time both requests."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("drive", type=Path)
    drive = open_drive(parser.parse_args().drive)
    judge_frames(drive, drive.frame_numbers[:1], REQUESTS["defaults"], [Kept()])  # compiles
    with tempfile.TemporaryDirectory() as folder:
        for name, request in REQUESTS.items():
            print(name)
            time_request(drive, request, Path(folder))


if __name__ == "__main__":
    main()
