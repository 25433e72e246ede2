"""The page of a run: what it stored, and one sentence for everything that is missing."""

from collections.abc import Sequence

import intervis
from intervis.drives import Drive
from intervis.errors import SettingsError
from intervis.progress import Progress
from intervis.run.stored_run import StoredRun
from intervis.view.frame_data import FrameData
from intervis.view.frame_stream import FrameSink, stream_frames
from intervis.view.page_file import PageFrames, axes_sentence, page_of_frames, shown
from intervis.view.run_judge import RunJudge
from intervis.view.view_request import Place, ViewRequest

MOST_LISTED = 8
"""Frame numbers in a sentence at most."""

PLACES = {
    "camera": "the camera",
    "sensor": "the sensor",
    "start": "the camera of the drive's first frame",
}


def request_of_run(
    run: StoredRun,
    *,
    ends: Sequence[Place] = (),
    risk: float | None = None,
    memory: int | None = None,
    most_frames: int | None = None,
    most_returns: int = ViewRequest.most_returns,
    has_blind_spots: bool = True,
) -> ViewRequest:
    """What a page judges besides what a run stored; None are the defaults.

    Where the run has sight lines, all is judged as they were: by the scan of each frame alone, at
    the risk of the run.

    Raises
    ------
    SettingsError
        A number is out of range; or risk or memory are given, and the run has its own.
    """
    if run.sight is not None and (risk is not None or memory is not None):
        raise SettingsError(
            f"{'--memory' if risk is None else '--risk'} is about lines that are judged now: this"
            " run has stored its sight lines, so leave it out."
        )
    if run.sight is not None:
        risk, memory = run.sight.risk, 0
    return ViewRequest(
        viewpoint=place_text(run),
        ends=ends,
        risk=ViewRequest.risk if risk is None else risk,
        memory=ViewRequest.memory if memory is None else memory,
        most_frames=ViewRequest.most_frames if most_frames is None else most_frames,
        most_returns=most_returns,
        has_blind_spots=has_blind_spots,
    )


def run_page(
    run: StoredRun,
    drive: Drive | None,
    missing: str,
    numbers: Sequence[int],
    request: ViewRequest,
    *,
    also: Sequence[FrameSink] = (),
    progress: Progress | None = None,
) -> tuple[bytes, list[int]]:
    """Put frames of a run into a page.

    Parameters
    ----------
    run : StoredRun
    drive : Drive or None
    missing : str
        Why there is no drive; empty where there is.
    numbers : sequence of int
        Frame numbers, one or more.
    request : ViewRequest
        For what the run has not stored; see `request_of_run`.
    also : sequence of FrameSink
        What else takes the frames: recordings.
    progress : callable, optional
        Called after each frame.

    Returns
    -------
    page : bytes
        UTF-8.
    left_out : list of int
        Frames whose files are damaged.

    Raises
    ------
    OutputError
        The files of all frames are damaged.
    """
    page, missing = PageFrames(), shown(missing)
    judge = RunJudge(run, drive, missing, request)
    left_out = stream_frames(judge.judged, numbers, [page, *also], progress)
    lead = " ".join(_sentences(run, drive, missing, page.frames, request, left_out))
    content = page_of_frames(
        run.name,
        lead,
        page.frames,
        request,
        has_command=drive is not None,
        run={"has_states": run.sight is not None or drive is not None, "has_drive": bool(drive)},
    )
    return content, left_out


def _sentences(
    run: StoredRun,
    drive: Drive | None,
    missing: str,
    frames: Sequence[FrameData],
    request: ViewRequest,
    left_out: Sequence[int],
) -> list[str]:
    """What the page shows, where it comes from, and what is missing."""
    with_states = "" if run.sight is None else ", states and probabilities of the returns"
    count, of = len(frames), len(run.numbers)
    some = f"{count} of {of:,}" if count < of else f"{of:,}"
    said = [
        f"What a run stored: the paper's region and measures{with_states};"
        f" {some} frame{'s' if of > 1 else ''}."
    ]
    if not run.is_complete:
        said.append(
            f"The run was cut short, or still runs: of the {run.input['frames']:,} frames of its"
            f" drive it has written {of:,}."
        )
    said.append(_source(run, drive, missing, frames))
    most = max(frame.header["stored"] for frame in frames)
    returns = int(max(frame.header["run"]["measures"]["n_raw"] for frame in frames))
    if drive is not None and most < returns:
        said.append(f"Up to {most:,} returns a frame are shown, evenly chosen of {returns:,}.")
    if run.failures:
        said.append(f"Without a result in the run: {_listed(sorted(run.failures))}.")
    if left_out:
        said.append(f"Left out, because their files are damaged: {_listed(left_out)}.")
    if drive is not None and run.version != intervis.__version__:
        said.append(f"The run was made by intervis {run.version}, the rest by this version.")
    said.append(axes_sentence(frames))
    return said


def _source(run: StoredRun, drive: Drive | None, missing: str, frames: Sequence[FrameData]) -> str:
    """Where states, blockers and images come from, or why they are missing."""
    place = place_text(run)
    if drive is None:
        what = "states, blockers" if run.sight is None else "blockers"
        stored = "" if run.sight is None else f" with what the run stored of the lines from {place}"
        return (
            f"Only the nodes of the mesh are shown{stored}, without {what}, blind spots and images,"
            f" because the drive is missing: {missing}."
        )
    if run.sight is None:
        scans = max(len(frame.header["memory"]) for frame in frames) + 1
        used = "one scan" if scans == 1 else f"up to {scans} scans"
        return (
            f"The run stored no sight lines: the states of the returns, seen from {place}, are"
            f" judged from the drive now, by {used}."
        )
    return (
        f"The sight lines start at {place} and are answered by the scan of their frame alone; what"
        " blocks or clears them, blind spots and images come from the drive."
    )


def place_text(run: StoredRun) -> str:
    """Where the sight lines of a run start, or those that are judged for it."""
    if run.sight is not None and run.sight.place == "next":
        return "the scanner's place in the next frame"
    if isinstance(run.viewpoint, str):
        return PLACES.get(run.viewpoint, run.viewpoint)
    return "({:g}, {:g}, {:g})".format(*run.viewpoint)


def _listed(numbers: Sequence[int]) -> str:
    """Frame numbers as text, the first of many."""
    first = ", ".join(map(str, numbers[:MOST_LISTED]))
    more = len(numbers) - MOST_LISTED
    rest = f" and {more} more" if more > 0 else ""
    return f"frame{'s' if len(numbers) > 1 else ''} {first}{rest}"
