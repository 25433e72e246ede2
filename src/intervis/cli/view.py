"""``intervis view``: an interactive page of what a viewpoint sees, as a file or served."""

import contextlib
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from intervis.cli import options
from intervis.cli.run import CameraName, Source
from intervis.cli.sight import FROM
from intervis.cli.survey import Frames, Risk
from intervis.cli.terminal import progress, show, tell

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from intervis.drives import Drive
    from intervis.view import ViewRequest
    from intervis.view.frame_stream import FrameSink
    from intervis.view.server import ViewServer

DEFAULT_PORT = 8765
LARGE_MB, LARGE_RECORDING_MB = 30, 500
"""Larger pages and recordings are announced."""


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
        int,
        typer.Option(
            metavar="N", help="Scans before and after each frame that are used, by the poses."
        ),
    ] = 2,
    blind_spots: Annotated[
        bool, typer.Option("--blind-spots/--no-blind-spots", help="Judge the ground as well.")
    ] = True,
    risk: Risk = None,
    camera: CameraName = None,
) -> None:
    """Make a page or a recording of what a place sees.

    The page is one file that loads nothing. Every return is judged from the viewpoint (the camera;
    the sensor, if there is none), and can be clicked for its explanation. A recording holds the
    same for the viewer of Rerun or for Foxglove.
    """
    from intervis.errors import SettingsError

    has_page = page is not None or serve
    recordings = {"--rerun": rerun, "--foxglove": foxglove}
    if not has_page and not any(recordings.values()):
        raise SettingsError(
            "give --html FILE to write a page, --serve to look at once, or --rerun FILE or"
            " --foxglove FILE to record."
        )
    frame_range = options.frame_range(frames)
    place = None if start is None else options.place(start, "--from")
    given_ends = [options.place(end, "--to") for end in ends or ()]
    options.check_output_files({"--html": page, **recordings}, [source])

    from intervis.drives import open_drive
    from intervis.run.stream import selected_frames
    from intervis.sight.occupancy_model import DEFAULT_RISK
    from intervis.view import ViewRequest, judge_frames, page_html, save_page
    from intervis.view.page_file import check_page
    from intervis.view.server import ViewServer
    from intervis.view.view_request import thinned_frames

    if page is not None:
        check_page(page)
    _check_recordings(rerun, foxglove)
    _check_no_run(source)
    drive = open_drive(source, camera=camera)
    request = ViewRequest(
        viewpoint=place or ("sensor" if drive.camera_name is None else "camera"),
        is_fixed=fixed,
        ends=given_ends,
        risk=DEFAULT_RISK if risk is None else risk,
        memory=memory,
        most_frames=ViewRequest.most_frames if most is None else most,
        most_returns=returns,
        has_blind_spots=blind_spots,
    )
    chosen = selected_frames(drive.frame_numbers, frame_range)
    thinned = has_page or most is not None
    numbers = thinned_frames(chosen, request.most_frames) if thinned else list(chosen)
    if has_page:
        _note_size(drive, len(chosen), len(numbers), request)
    _note_recording_size(sum(path is not None for path in recordings.values()), numbers, request)
    # The port is taken before the work, so that a taken one is told at once.
    server = ViewServer(drive, numbers, request, port) if serve else None
    with (
        _recordings(rerun, foxglove, drive, numbers, request) as sinks,
        progress("frames", len(numbers)) as advance,
    ):
        if has_page:
            content = page_html(
                drive, numbers, request, is_served=serve, also=sinks, progress=advance
            )
        else:
            judge_frames(drive, numbers, request, sinks, progress=advance)
    for path in recordings.values():
        if path is not None:
            show(f"Recording: {path} ({path.stat().st_size / 1e6:.1f} MB)")
    if page is not None:
        save_page(page, content)
        show(f"Page: {page} ({len(content) / 1e6:.1f} MB)")
    if server is not None:
        _serve(server, content)


def _check_recordings(rerun: Path | None, foxglove: Path | None) -> None:
    """Check before the work that the recordings can be written, and that their extra is there."""
    from intervis.view.recordings.foxglove_file import check_foxglove_file
    from intervis.view.recordings.rerun_file import check_rerun_file

    if rerun is not None:
        check_rerun_file(rerun)
    if foxglove is not None:
        check_foxglove_file(foxglove)


@contextlib.contextmanager
def _recordings(
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


def _check_no_run(source: Path) -> None:
    """Raise where the source is the output folder of a run: it does not say where its drive is."""
    from intervis.errors import DriveError

    if (source / "summary.json").is_file() and (source / "frames").is_dir():
        raise DriveError(
            f"{source} holds the results of a run, without its scans and images: give the drive"
            " that was run."
        )


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


def _note_recording_size(recordings: int, numbers: "Sequence[int]", request: "ViewRequest") -> None:
    """Say how large recordings get, before they are made."""
    from intervis.view.recordings.recording_file import estimated_bytes

    size_mb = recordings * estimated_bytes(len(numbers), request.most_returns) / 1e6
    if size_mb > LARGE_RECORDING_MB:
        tell(
            f"note: recordings of {len(numbers):,} frames will take up to {size_mb:,.0f} MB;"
            " --frames, --most and --returns reduce it."
        )


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
