"""Recordings for viewers: the options that ask for them, and what is said of their size."""

import contextlib
from pathlib import Path
from typing import TYPE_CHECKING

from intervis.cli.terminal import show, tell

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from intervis.drives import Drive
    from intervis.view import ViewRequest
    from intervis.view.frame_stream import FrameSink

LARGE_RECORDING_MB = 500
"""Larger recordings are announced."""


def check_recordings(rerun: Path | None, foxglove: Path | None) -> None:
    """Check before the work that the recordings can be written, and that their extra is there."""
    from intervis.view.recordings.foxglove_file import check_foxglove_file
    from intervis.view.recordings.rerun_file import check_rerun_file

    if rerun is not None:
        check_rerun_file(rerun)
    if foxglove is not None:
        check_foxglove_file(foxglove)


@contextlib.contextmanager
def recordings(
    rerun: Path | None,
    foxglove: Path | None,
    drive: "Drive",
    numbers: "Sequence[int]",
    request: "ViewRequest",
) -> "Iterator[list[FrameSink]]":
    """The recordings that were asked for; their files appear when all frames are in them."""
    from intervis.view.recordings import foxglove_recording, rerun_recording

    with contextlib.ExitStack() as stack:
        sinks: list[FrameSink] = []
        if rerun is not None:
            sinks.append(stack.enter_context(rerun_recording(rerun, drive, numbers, request)))
        if foxglove is not None:
            sinks.append(stack.enter_context(foxglove_recording(foxglove, drive, numbers, request)))
        yield sinks


def note_recording_size(recordings: int, numbers: "Sequence[int]", request: "ViewRequest") -> None:
    """Say how large recordings get, before they are made."""
    from intervis.view.recordings.recording_file import estimated_bytes

    size_mb = recordings * estimated_bytes(len(numbers), request.most_returns) / 1e6
    if size_mb > LARGE_RECORDING_MB:
        tell(
            f"note: recordings of {len(numbers):,} frames will take up to {size_mb:,.0f} MB;"
            " --frames, --most and --returns reduce it."
        )


def show_recordings(paths: "Iterable[Path | None]") -> None:
    """Print where recordings were written."""
    for path in paths:
        if path is not None:
            show(f"Recording: {path} ({path.stat().st_size / 1e6:.1f} MB)")
