"""``intervis view``: an interactive page of what a viewpoint sees, as a file or served."""

import contextlib
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from intervis.cli import options
from intervis.cli.recordings import (
    check_recordings,
    note_recording_size,
    recordings,
    show_recordings,
)
from intervis.cli.run import CameraName, Source
from intervis.cli.sight import FROM
from intervis.cli.survey import Frames, Risk
from intervis.cli.terminal import progress, show, tell

if TYPE_CHECKING:
    from intervis.drives import Drive
    from intervis.view import ViewRequest
    from intervis.view.server import ViewServer

DEFAULT_PORT = 8765
LARGE_MB = 30
"""Larger pages are announced."""

MOST_LISTED = 8


def view(
    source: Source,
    page: Annotated[
        Path | None, typer.Option("--html", metavar="FILE.html", help="Write the page.")
    ] = None,
    rerun: Annotated[
        Path | None,
        typer.Option("--rerun", metavar="FILE.rrd", help="Write a recording for Rerun."),
    ] = None,
    foxglove: Annotated[
        Path | None,
        typer.Option("--foxglove", metavar="FILE.mcap", help="Write a recording for Foxglove."),
    ] = None,
    serve: Annotated[
        bool,
        typer.Option(
            "--serve",
            help="Serve the page on this machine: the engine then answers any line, and judges the"
            " scan again when the viewpoint is dragged.",
        ),
    ] = False,
    port: Annotated[int, typer.Option(metavar="N", help="Port of --serve.")] = DEFAULT_PORT,
    frames: Frames = None,
    most: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            help="Frames at most; more are thinned evenly. Default: 24 of a page, all of a"
            " recording alone.",
        ),
    ] = None,
    returns: Annotated[
        int, typer.Option(metavar="N", help="Returns of a frame at most, thinned evenly.")
    ] = 50_000,
    start: Annotated[str | None, FROM] = None,
    fixed: Annotated[
        bool,
        typer.Option(
            "--fixed", help="Keep the viewpoint of the first frame in its place, by the poses."
        ),
    ] = False,
    ends: Annotated[
        list[str] | None,
        typer.Option(
            "--to",
            metavar="X,Y,Z|camera|sensor",
            help="Also explain the line to this place in every frame; may be repeated.",
        ),
    ] = None,
    memory: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            help="Scans before and after each frame that are used, by the poses; default: 2.",
        ),
    ] = None,
    blind_spots: Annotated[
        bool, typer.Option("--blind-spots/--no-blind-spots", help="Judge the ground as well.")
    ] = True,
    risk: Risk = None,
    camera: CameraName = None,
    run_drive: Annotated[
        Path | None,
        typer.Option("--drive", metavar="DRIVE", help="Of a run: its drive, where that was moved."),
    ] = None,
) -> int:
    """Show what a place sees, or a run: a page or a recording.

    The page is one file that loads nothing. Every return is judged from the viewpoint (the camera;
    the sensor, if there is none), and can be clicked for its explanation. A recording holds the
    same for the viewer of Rerun or for Foxglove. Of a folder that `intervis run` wrote, the results
    are shown.
    """
    from intervis.errors import SettingsError

    has_page = page is not None or serve
    recorded = {"--rerun": rerun, "--foxglove": foxglove}
    if not has_page and not any(recorded.values()):
        raise SettingsError(
            "give --html FILE to write a page, --serve to look at once, or --rerun FILE or"
            " --foxglove FILE to record."
        )
    frame_range = options.frame_range(frames)
    place = None if start is None else options.place(start, "--from")
    given_ends = [options.place(end, "--to") for end in ends or ()]
    options.check_output_files({"--html": page, **recorded}, [source])

    from intervis.cli.view_run import RunView, view_run
    from intervis.run.stored_run import is_run
    from intervis.run.stream import selected_frames
    from intervis.sight.occupancy_model import DEFAULT_RISK
    from intervis.view import ViewRequest, judge_frames, page_html, save_page
    from intervis.view.page_file import check_page
    from intervis.view.server import ViewServer
    from intervis.view.view_request import thinned_frames

    if page is not None:
        check_page(page)
    check_recordings(rerun, foxglove)
    if is_run(source):
        refused = {"--serve": serve, "--from": start, "--fixed": fixed, "--camera": camera}
        view = RunView(
            source, run_drive, page, rerun, foxglove, frame_range, most, returns, memory, risk
        )
        return view_run(view, given_ends, refused, has_blind_spots=blind_spots)
    if run_drive is not None:
        raise SettingsError("--drive says where the drive of a run is: give the folder of a run.")
    drive = _opened(source, camera)
    request = ViewRequest(
        viewpoint=place or ("sensor" if drive.camera_name is None else "camera"),
        is_fixed=fixed,
        ends=given_ends,
        risk=DEFAULT_RISK if risk is None else risk,
        memory=ViewRequest.memory if memory is None else memory,
        most_frames=ViewRequest.most_frames if most is None else most,
        most_returns=returns,
        has_blind_spots=blind_spots,
    )
    chosen = selected_frames(drive.frame_numbers, frame_range)
    thinned = has_page or most is not None
    numbers = thinned_frames(chosen, request.most_frames) if thinned else list(chosen)
    if has_page:
        _note_size(drive, len(chosen), len(numbers), request)
    note_recording_size(sum(path is not None for path in recorded.values()), numbers, request)
    # The port is taken before the work, so that a taken one is told at once.
    server = ViewServer(drive, numbers, request, port) if serve else None
    with (
        recordings(rerun, foxglove, drive, numbers, request) as sinks,
        progress("frames", len(numbers)) as advance,
    ):
        if has_page:
            content = page_html(
                drive, numbers, request, is_served=serve, also=sinks, progress=advance
            )
        else:
            judge_frames(drive, numbers, request, sinks, progress=advance)
    show_recordings(recorded.values())
    if page is not None:
        save_page(page, content)
        show(f"Page: {page} ({len(content) / 1e6:.1f} MB)")
    if server is not None:
        _serve(server, content)
    return 0


def _opened(source: Path, camera: str | None) -> "Drive":
    """The drive at a path; a folder of several runs is no drive, and is told apart."""
    from intervis.drives import open_drive
    from intervis.errors import DriveError
    from intervis.run.stored_run import runs_below

    try:
        return open_drive(source, camera=camera)
    except DriveError:
        if runs := runs_below(source):
            raise DriveError(
                f"{source} holds the runs of several drives: give the path of one of them:"
                f" {', '.join(runs[:MOST_LISTED])}{', ...' if len(runs) > MOST_LISTED else ''}."
            ) from None
        raise


def _note_size(drive: "Drive", chosen: int, shown: int, request: "ViewRequest") -> None:
    """Say how large a page gets, before it is made, and what is left out."""
    from intervis.view.view_request import estimated_bytes

    if shown < chosen:
        whole_mb = estimated_bytes(chosen, request.most_returns) / 1e6
        tell(
            f"note: a page of {chosen:,} frames would take up to {whole_mb:,.0f} MB: {shown} of"
            " them are shown, evenly chosen; --frames and --most choose others."
        )
    size_mb = estimated_bytes(shown, request.most_returns) / 1e6
    if size_mb > LARGE_MB:
        tell(f"note: the page will take up to {size_mb:,.0f} MB; --returns and --most reduce it.")
    if (drive.image_paths or drive.image_readers) and not _has_pillow():
        tell("note: the page has no images: they need pip install 'intervis[plots]'.")


def _has_pillow() -> bool:
    try:
        import PIL  # noqa: F401
    except ImportError:
        return False
    return True


def _serve(server: "ViewServer", content: bytes) -> None:
    """Serve the page until Ctrl-C, which is no error here."""
    with server, contextlib.suppress(KeyboardInterrupt):
        server.page = content
        show(f"Open {server.url} in a browser; Ctrl-C ends.")
        server.serve_forever()
