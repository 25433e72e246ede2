"""Report of a run: pictures of its middle frame, tables, and one HTML page."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from intervis.arrays import finite_rows
from intervis.errors import MissingExtraError, OutputError
from intervis.files import write_text
from intervis.plots.page import Page, Picture, Remark
from intervis.plots.tables import Table
from intervis.progress import Progress, reporter
from intervis.run.frame_file import frame_path, load_analysis
from intervis.run.tables import measures_table, pace_table, times_table

if TYPE_CHECKING:
    from intervis.drives import Drive, Frame
    from intervis.run.stream import RunSummary

PICTURES = {
    "sight": (
        "Sight lines from a viewpoint ahead",
        "Sight lines from the viewpoint (star) to every return of the same scan. Visible: the"
        " line is free with a high enough probability. Occluded: an observed surface lies between."
        " Unknown: the space between was not observed, or the evidence is not decisive.",
    ),
    "overview": (
        "Overview",
        "Camera image, scan and result of the method. Orange: the intervisible region for the"
        " viewpoint (star), that is, the triangles with three intervisibility points as corners and"
        " at least two intervisible edges.",
    ),
    "camera": (
        "Field of view",
        "Returns that project into the camera image (Eq. 1 and 2), coloured by range.",
    ),
    "scan": (
        "Scan from above",
        "The whole scan. Returns in view are coloured by elevation, the others are grey.",
    ),
    "surface": (
        "Manifold auxiliary surface",
        "Cohesion and repulsion (Eq. 3 to 8) displace the nodes. Left: the nodes before (grey) and"
        " after the displacement. Right: the displacement of each node.",
    ),
    "intervisibility": (
        "Intervisibility",
        "The finite elements from above, with the intervisibility points, edges and region of"
        " Algorithm 1. Right: the near part, enlarged.",
    ),
}
"""Heading and caption of each picture, by file name."""

PAPER_REMARK = Remark(
    "Intervisible points, edges and region.",
    "The region is the paper's. It is not what the viewpoint sees: its nodes are visible hardly"
    " more often than others. Sight lines, above, answer what is visible.",
)

AHEAD_M = 8.0
"""Distance of the viewpoint of the sight lines shown, ahead of the sensor."""


@dataclass(frozen=True)
class RunReport:
    """Files of a report, and a sentence on what is missing from it (None: nothing)."""

    paths: tuple[Path, ...]
    missing: str | None


def report_run(
    drive: "Drive",
    summary: "RunSummary",
    out: Path,
    *,
    source_note: str = "",
    progress: Progress | None = None,
) -> RunReport:
    """Draw the middle frame of a run, and write tables and page.

    Parameters
    ----------
    drive : Drive
        The drive of the run.
    summary : RunSummary
        From `intervis.run.run_drive`.
    out : Path
        Folder for ``index.html``, ``measures.md``, ``measures.csv``, ``pictures/*.png``.
    source_note : str
        A sentence about the drive for the head of the page.
    progress : callable, optional
        Called `report_steps` times, after each picture and after the page.

    Raises
    ------
    OutputError
        A file cannot be written, or the run has no frame with a result.
    """
    progress = reporter(progress)
    if not summary.frames:
        raise OutputError(f"the run in {summary.out} has no frame with a result.")
    number = summary.frames[len(summary.frames) // 2].number
    pictures, missing = _pictures(drive, summary, number, out / "pictures", progress)
    every_frame = measures_table(summary.frames, few=None)
    times = [times_table(summary.content["times_s"], len(summary.frames))]
    times += filter(None, [pace_table(summary.content)])
    lead = _lead(summary, number, source_note, missing)
    page = _page(summary, lead, pictures, [measures_table(summary.frames), *times])
    texts = {
        out / "index.html": page.as_html(),
        out / "measures.md": "\n".join(table.as_markdown() for table in (every_frame, *times)),
        out / "measures.csv": every_frame.as_csv(),
    }
    for path, text in texts.items():
        write_text(path, text)
    progress("page")
    return RunReport((*texts, *(picture.path for picture in pictures)), missing)


def check_report(out: Path, run: Path) -> None:
    """Raise before the work where a report would replace files and the folder `run` holds no run.

    Raises
    ------
    OutputError
        The first of these files was not written by a report.
    """
    if (run / "summary.json").exists():
        return
    names = ["index.html", "measures.md", "measures.csv", *(f"pictures/{n}.png" for n in PICTURES)]
    for path in (out / name for name in names):
        if path.exists() or path.is_symlink():
            raise OutputError(
                f"{path} was not written by an earlier report and was not changed: choose another"
                " output folder."
            )


def report_steps(drive: "Drive") -> int:
    """Number of steps that `report_run` reports: the pictures, and the page."""
    return len(PICTURES) - (drive.camera is None) + 1


def _pictures(
    drive: "Drive",
    summary: "RunSummary",
    number: int,
    folder: Path,
    progress: Progress,
) -> tuple[list[Picture], str | None]:
    from intervis.plots.figures import save_pictures

    analysis = load_analysis(frame_path(summary.out, number))
    try:
        frame = drive[number]
        sight = _save_sight(frame, folder)
        progress("sight")
        paths = [sight, *save_pictures(frame, analysis, folder, progress=progress)]
    except MissingExtraError as error:
        return [], f"the report has no pictures. {error}"
    return [Picture(path, *PICTURES[path.stem]) for path in paths], None


def _save_sight(frame: "Frame", folder: Path) -> Path:
    """Draw which returns of a scan are visible from a viewpoint ahead of its sensor."""
    from intervis.files import make_folder
    from intervis.plots.sight_figure import sight_picture
    from intervis.plots.style import require_matplotlib, save_figure
    from intervis.sight import Scene

    require_matplotlib()  # before a folder is made for nothing
    points = frame.points[finite_rows(frame.points), :3]
    make_folder(folder)
    path = folder / "sight.png"
    scene, ahead = Scene(), np.array([AHEAD_M, 0.0, 0.0])
    scene.add(points, None, 0.0)
    save_figure(sight_picture(frame, scene.sight(ahead, points, moment_s=0.0), ahead), path)
    return path


def _lead(summary: "RunSummary", number: int, source_note: str, missing: str | None) -> str:
    content, count = summary.content, len(summary.frames)
    sentences = [
        source_note,
        f"{count} frame{'s' if count != 1 else ''}, tau = {content['settings']['tau']},"
        f" viewpoint: {content['viewpoint']}.",
        f"The pictures show frame {number}." if missing is None else f"Note: {missing}",
    ]
    return " ".join(filter(None, sentences))


def _page(
    summary: "RunSummary", lead: str, pictures: Sequence[Picture], tables: Sequence[Table]
) -> Page:
    content = summary.content
    source, settings, machine = content["input"], content["settings"], content["machine"]
    chosen = ", ".join(f"{name} = {value}" for name, value in settings.items())
    versions = ", ".join(f"{name} {version}" for name, version in content["versions"].items())
    sights, whole, steps = pictures[:1], pictures[1:2], pictures[2:]
    parts: list[Picture | Table | Remark | str] = []
    if sights:
        parts += ["What a place ahead sees", *sights]
    parts += ["The paper's method", PAPER_REMARK, *whole]
    parts += ["Measures", tables[0], "Times", *tables[1:]]
    if steps:
        parts += ["Steps of the method", *steps]
    return Page(
        title=f"Intervisibility of {source['name']}",
        lead=lead,
        parts=parts,
        small_print=[
            f"Settings: {chosen}.",
            f"Versions: {versions}.",
            f"Machine: {machine['processor']}, {machine['cpus']} cores, {machine['system']}.",
            *(f"Frame {f.number} failed: {f.reason}" for f in summary.failures),
        ],
    )
