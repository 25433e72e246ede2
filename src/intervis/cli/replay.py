"""``intervis replay``: a drive in real time, and the latency of scans and sight lines."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from intervis.cli import options
from intervis.cli.run import Source
from intervis.cli.survey import Frames, Hz
from intervis.cli.terminal import complain, progress, show

if TYPE_CHECKING:
    from intervis.drives import Drive
    from intervis.live.replay import Replay


def replay(
    source: Source,
    rate: Annotated[
        float, typer.Option(metavar="R", help="How many times faster than it was recorded.")
    ] = 1.0,
    hz: Hz = None,
    sights: Annotated[
        int, typer.Option(metavar="N", help="Sight lines that are asked after each scan.")
    ] = 5000,
    scans: Annotated[
        int, typer.Option(metavar="N", help="Number of scans that are kept at most.")
    ] = 20,
    frames: Frames = None,
    json_file: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Write the figures as JSON.")
    ] = None,
) -> int:
    """Replay a drive in real time, and measure latency.

    The scans are pushed into a stream at the times at which they were recorded. After each of them
    sight lines are asked from the sensor to points around its returns.
    """
    frame_range = options.frame_range(frames)
    options.check_output_files({"--json": json_file}, [source])

    from intervis.drives import open_drive
    from intervis.files import write_text
    from intervis.live.replay import replay as replay_drive
    from intervis.live.stream import Stream
    from intervis.run.stream import selected_frames

    drive = open_drive(source)
    options.check_drive_kept(drive, [json_file])
    numbers = selected_frames(drive.frame_numbers, frame_range)
    stream = Stream(max_scans=scans)
    with progress("frames", len(numbers)) as advance:
        done = replay_drive(
            drive,
            numbers,
            rate=rate,
            scans_per_s=hz,
            sights=sights,
            stream=stream,
            progress=advance,
        )
    _show(drive, done)
    if json_file is not None:
        content = {"drive": drive.name, "rate": rate, "kept_scans": scans, **done.as_dict()}
        write_text(json_file, json.dumps(content, indent=2) + "\n")
        show(f"Figures: {json_file}")
    for number, reason in done.skipped.items():
        complain(f"frame {number} was left out: {reason}")
    return 1 if done.skipped else 0


def _show(drive: "Drive", done: "Replay") -> None:
    from intervis.live.replay import QUANTITIES

    content = done.as_dict()
    show(
        f"{drive.name}: {len(done.numbers)} frames, {done.scans_per_s:.1f} a second,"
        f" {done.sights:,} sight lines after each, {content['threads']} threads."
    )
    show(f"{'milliseconds':40s}{'p50':>9s}{'p99':>9s}{'max':>9s}")
    for name, words in QUANTITIES.items():
        figures = content[name]
        show(f"{words:40s}{figures['p50']:9.1f}{figures['p99']:9.1f}{figures['max']:9.1f}")
    if done.late:
        show(f"{done.late} scans came later than they were due.")
