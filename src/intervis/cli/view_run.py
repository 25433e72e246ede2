"""``intervis view RUN``: the page of what a run stored."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from intervis.cli import options
from intervis.cli.recordings import note_recording_size, recordings, show_recordings
from intervis.cli.terminal import progress, show, tell
from intervis.errors import DriveError, SettingsError

if TYPE_CHECKING:
    from intervis.drives import Drive
    from intervis.run.stored_run import StoredRun
    from intervis.run.stream import FrameRange
    from intervis.view.view_request import Place


@dataclass(frozen=True)
class RunView:
    """What is asked of the page of a run, as `intervis view` takes it."""

    folder: Path
    drive: Path | None
    page: Path | None
    rerun: Path | None
    foxglove: Path | None
    frames: "FrameRange | None"
    most: int | None
    returns: int
    memory: int | None
    risk: float | None


def view_run(
    asked: RunView,
    ends: "Sequence[Place]",
    refused: Mapping[str, object],
    *,
    has_blind_spots: bool,
) -> int:
    """Write the page of a run, and recordings; 1 if the files of some frames are damaged.

    `refused` are the options that only a drive knows, by their names.
    """
    from intervis.run.stored_run import read_run
    from intervis.run.stream import selected_frames
    from intervis.view import save_page
    from intervis.view.frame_stream import stream_frames
    from intervis.view.run_judge import RunJudge
    from intervis.view.run_page import request_of_run, run_page
    from intervis.view.view_request import thinned_frames

    for option, value in refused.items():
        if value:
            raise SettingsError(
                f"{option} is about a drive: a run has its own viewpoint and camera, and its page"
                " asks no engine."
            )
    run = read_run(asked.folder)
    request = request_of_run(
        run,
        ends=ends,
        risk=asked.risk,
        memory=asked.memory,
        most_frames=asked.most,
        most_returns=asked.returns,
        has_blind_spots=has_blind_spots,
    )
    chosen = selected_frames(run.numbers, asked.frames)
    thinned = asked.page is not None or asked.most is not None
    numbers = thinned_frames(chosen, request.most_frames) if thinned else list(chosen)
    drive, missing = _drive(run, asked, has_ends=bool(ends))
    if len(numbers) < len(chosen):
        tell(
            f"note: {len(numbers)} of {len(chosen):,} frames are shown, evenly chosen; --frames and"
            " --most choose others."
        )
    if drive is None:
        with progress("frames", len(numbers)) as advance:
            content, left_out = run_page(run, None, missing, numbers, request, progress=advance)
    else:
        files = [path for path in (asked.rerun, asked.foxglove) if path is not None]
        note_recording_size(len(files), numbers, request)
        with (
            recordings(asked.rerun, asked.foxglove, drive, numbers, request) as sinks,
            progress("frames", len(numbers)) as advance,
        ):
            if asked.page is None:
                judge = RunJudge(run, drive, missing, request)
                left_out = stream_frames(judge.judged, numbers, sinks, advance)
            else:
                content, left_out = run_page(
                    run, drive, missing, numbers, request, also=sinks, progress=advance
                )
        show_recordings(files)
    if asked.page is not None:
        save_page(asked.page, content)
        show(f"Page: {asked.page} ({len(content) / 1e6:.1f} MB)")
    return 1 if left_out else 0


def _drive(run: "StoredRun", asked: RunView, *, has_ends: bool) -> "tuple[Drive | None, str]":
    """The drive of a run; else None and the reason.

    Raises
    ------
    DriveError
        There is none, and something that is asked for needs it, or the user has said where it is.
    """
    try:
        drive = run.drive(asked.drive)
    except DriveError as error:
        needs = {
            "--drive": asked.drive is not None,
            "--to": has_ends,
            "--rerun": asked.rerun is not None,
            "--foxglove": asked.foxglove is not None,
        }
        option = next((option for option, is_asked in needs.items() if is_asked), None)
        if option == "--drive":
            raise DriveError(f"{error}.") from None
        if option is not None:
            raise DriveError(
                f"{option} needs the drive of the run, which is missing: {error}; --drive says"
                " where it is."
            ) from None
        tell(
            f"note: the drive of the run is missing, so that the page shows no scans: {error};"
            " --drive says where it is."
        )
        return None, str(error)
    paths = [path for path in (asked.page, asked.rerun, asked.foxglove) if path is not None]
    for path in paths:
        options.check_no_input(path, [drive.root])
    return drive, ""
