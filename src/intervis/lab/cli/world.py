"""``intervis simulate`` and ``intervis demo``: drives through the built-in street."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from intervis.cli.run import show_report, show_run
from intervis.cli.terminal import progress, show

if TYPE_CHECKING:
    from intervis.drives import Drive

AHEAD_M = 8.0
"""Distance of the interactive page's viewpoint, ahead of the sensor."""

Frames = Annotated[int, typer.Option("--frames", metavar="N", help="Number of frames.")]
Seed = Annotated[
    int, typer.Option("--seed", metavar="S", help="The same seed gives the same drive.")
]


def simulate(
    out: Annotated[Path, typer.Option("--out", help="Folder for the drive.")],
    frames: Frames = 10,
    seed: Seed = 0,
    layout: Annotated[
        str,
        typer.Option("--layout", metavar="NAME", help="kitti, nuscenes, argoverse2, pcd or mcap."),
    ] = "kitti",
    scanner: Annotated[
        list[str] | None,
        typer.Option(
            "--scanner",
            metavar="PRESET[@MOUNT]",
            help="Can be repeated. Presets: at128, hdl-32e, hdl-64e, livox, os1-128, pandar64,"
            " qt64, ring, terrestrial, vlp-16. Mounts: roof, under, left, right, front, rear, mast,"
            " tripod.",
        ),
    ] = None,
    images: Annotated[
        bool, typer.Option("--images/--no-images", help="Images of the cameras.")
    ] = True,
    motion_distortion: Annotated[
        bool,
        typer.Option("--motion-distortion", help="Vehicle and traffic move during a sweep."),
    ] = False,
    labels: Annotated[
        bool,
        typer.Option("--labels", help="Classes of the points, as SemanticKITTI's; KITTI's layout."),
    ] = False,
) -> None:
    """Write a simulated drive through the built-in street.

    It has scans, poses, images and boxes. KITTI's layout includes the triangles of its world; an
    interrupted drive goes on. Other layouts are written whole or not at all. docs/simulate.md lists
    the presets and what each layout holds.
    """
    from intervis.lab.worlds import simulate_drive

    with progress("simulation", frames) as advance:
        drive = simulate_drive(
            out,
            layout,
            scanner or (),
            frames=frames,
            seed=seed,
            images=images,
            motion_distortion=motion_distortion,
            labels=labels,
            progress=advance,
        )
    show(f"Drive: {drive}")


def demo(
    out: Annotated[Path, typer.Option("--out", help="Folder for all output.")] = Path(
        "intervis-demo"
    ),
    frames: Frames = 10,
    seed: Seed = 0,
) -> int:
    """Simulate a drive, analyse it and show the results.

    Writes the drive, the results, tables, pictures, and two pages to open in a browser: a report,
    and an interactive page. An earlier demo in the same folder is replaced; files of other origin
    are refused.
    """
    from intervis.compilation import compiling
    from intervis.drives import open_drive
    from intervis.run import run_drive

    _refuse_foreign(out)
    with compiling("sight lines"):  # beside the simulation and the analysis
        drive = open_drive(_simulate(out / "drive", frames, seed))
        with progress("analysis", len(drive.frame_numbers)) as advance:
            summary = run_drive(drive, out / "run", progress=advance, overwrite=True)
        show_run(summary)
        show(f"Drive: {drive.root}")
    note = f"A simulated drive through the built-in street, seed {seed}."
    show_report(drive, summary, out, source_note=note)
    _show_view(drive, out / "view.html")
    return 1 if summary.failures else 0


def _show_view(drive: "Drive", page: Path) -> None:
    """Write the interactive page, and print its path."""
    from intervis.view import ViewRequest, page_html, save_page
    from intervis.view.view_request import thinned_frames

    request = ViewRequest(viewpoint=(AHEAD_M, 0.0, 0.5))
    numbers = thinned_frames(drive.frame_numbers, request.most_frames)
    with progress("interactive page", len(numbers)) as advance:
        save_page(page, page_html(drive, numbers, request, progress=advance))
    show(f"Interactive page: {page}")


def _refuse_foreign(out: Path) -> None:
    """Raise where the demo would replace files, unless an earlier demo stands in the folder."""
    from intervis.drives.kitti_writer import Layout
    from intervis.errors import OutputError
    from intervis.lab.worlds.simulation import METADATA_NAME
    from intervis.run.report import check_report
    from intervis.run.summary import read_summary
    from intervis.view.page_file import check_page

    check_page(out / "view.html")
    drive = Layout(out / "drive").drive
    summary = read_summary(out / "run" / "summary.json")
    earlier = summary.get("input") if summary else None
    if (
        isinstance(earlier, dict)
        and earlier.get("name") == drive.name
        and (drive / METADATA_NAME).is_file()
    ):
        return
    check_report(out, out / "run")
    written = [
        *(out / "run" / name for name in ("summary.json", "settings.toml")),
        *sorted((out / "run" / "frames").glob("*.npz")),
    ]
    for path in written:
        if path.exists() or path.is_symlink():
            raise OutputError(
                f"{path} was not written by an earlier `intervis demo` and was not changed;"
                " choose another output folder."
            )


def _simulate(out: Path, frames: int, seed: int) -> Path:
    from intervis.lab.worlds import simulate as simulate_drive

    with progress("simulation", frames) as advance:
        return simulate_drive(out, frames=frames, seed=seed, progress=advance)
