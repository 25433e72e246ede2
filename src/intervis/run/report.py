"""What a run is shown as: pictures of its middle frame, tables, and one page with all of it."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from intervis.arrays import finite_rows
from intervis.errors import MissingExtraError, OutputError
from intervis.files import write_text
from intervis.plots.page import Page, Picture
from intervis.plots.tables import Table, measures_table, times_table
from intervis.run.frame_file import frame_path, load_analysis

if TYPE_CHECKING:
    from intervis.drives import Drive, Frame
    from intervis.run.stream import RunSummary

PICTURES = {
    "overview": (
        "Overview",
        "What the camera and the scanner see, and what the method makes of it. Orange is the region"
        " that it calls visible from the viewpoint (the star): triangles whose three corners are"
        " intervisibility points and at least two of whose sides are intervisible edges.",
    ),
    "camera": (
        "Field of view",
        "Returns that project into the camera's image (Eq. 1 and 2), coloured by range.",
    ),
    "scan": (
        "Scan from above",
        "The whole scan; what is in view is coloured by elevation, the rest is grey.",
    ),
    "surface": (
        "Manifold auxiliary surface",
        "Cohesion and repulsion (Eq. 3 to 8) thin the crowded near field and gather the sparse"
        " far field. Left: the nodes before (grey) and after. Right: how far each one moved.",
    ),
    "intervisibility": (
        "Intervisibility",
        "The finite elements over the ground, with the intervisibility points and edges of"
        " Algorithm 1 and the region that they enclose; on the right the near part, enlarged.",
    ),
    "sight": (
        "What is seen from ahead",
        "The same scan, asked which of its returns are seen from the star. Visible: beams crossed"
        " the space in between. Occluded: a surface that was seen stands in between. Unknown:"
        " nobody looked there, or it is too close to call.",
    ),
}
"""Heading and caption of each picture, by the name of its file."""

AHEAD_M = 8.0
"""So far ahead of the sensor stands the viewpoint of the sight lines shown."""


@dataclass(frozen=True)
class RunReport:
    """Files of a report, and what is missing from it, in a sentence (None: nothing)."""

    paths: tuple[Path, ...]
    missing: str | None


def report_run(
    drive: "Drive",
    summary: "RunSummary",
    out: Path,
    *,
    source_note: str = "",
    with_sight: bool = False,
) -> RunReport:
    """Draw a run's middle frame and write its tables and page.

    Parameters
    ----------
    drive : Drive
        What the run was made from.
    summary : RunSummary
        What `intervis.run.stream.run` returned.
    out : Path
        Folder: ``index.html``, ``measures.md``, ``measures.csv``, ``pictures/*.png``.
    source_note : str
        A sentence about the drive for the head of the page.
    with_sight : bool
        Whether sight lines are shown as well: what the same scan says is seen from ahead.

    Raises
    ------
    OutputError
        A file cannot be written, or the run has no frame that went well.
    """
    if not summary.frames:
        raise OutputError(f"the run in {summary.out} has no frame to show.")
    number = summary.frames[len(summary.frames) // 2].number
    pictures, missing = _pictures(drive, summary, number, out / "pictures", with_sight)
    every_frame = measures_table(summary.frames, few=None)
    times = times_table(summary.content["times_s"], len(summary.frames))
    lead = _lead(summary, number, source_note, missing)
    page = _page(summary, lead, pictures, [measures_table(summary.frames), times])
    texts = {
        out / "index.html": page.as_html(),
        out / "measures.md": every_frame.as_markdown() + "\n" + times.as_markdown(),
        out / "measures.csv": every_frame.as_csv(),
    }
    for path, text in texts.items():
        write_text(path, text)
    return RunReport((*texts, *(picture.path for picture in pictures)), missing)


def _pictures(
    drive: "Drive", summary: "RunSummary", number: int, folder: Path, with_sight: bool
) -> tuple[list[Picture], str | None]:
    from intervis.plots.figures import save_pictures

    analysis = load_analysis(frame_path(summary.out, number))
    try:
        paths = save_pictures(drive[number], analysis, folder)
        if with_sight:
            paths = [*paths, _save_sight(drive[number], folder / "sight.png")]
    except MissingExtraError as error:
        return [], f"the pictures are left out. {error}"
    return [Picture(path, *PICTURES[path.stem]) for path in paths], None


def _save_sight(frame: "Frame", path: Path) -> Path:
    """Draw what a scan says is seen from a place ahead of its sensor."""
    from intervis.plots.sight_figure import sight_from_above
    from intervis.plots.style import save_figure
    from intervis.sight import Scene

    points = frame.points[finite_rows(frame.points), :3]
    scene, ahead = Scene(), np.array([AHEAD_M, 0.0, 0.0])
    scene.add(points, None, 0.0)
    save_figure(sight_from_above(points, scene.sight(ahead, points, moment_s=0.0), ahead), path)
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
    parts: list[Picture | Table | str] = [*pictures[:1], "Measures", tables[0], "Times", tables[1]]
    sights = [picture for picture in pictures if picture.path.stem == "sight"]
    steps = [picture for picture in pictures[1:] if picture not in sights]
    for heading, shown in (("Step by step", steps), ("Sight lines", sights)):
        if shown:
            parts += [heading, *shown]
    return Page(
        title=f"Intervisibility of {source['name']}",
        lead=lead,
        parts=parts,
        small_print=[
            f"Settings: {chosen}.",
            f"Versions: {versions}.",
            f"Machine: {machine['processor']}, {machine['cpus']} cores, {machine['system']}.",
            *(f"Frame {f.number} failed: {f.sentence}" for f in summary.failures),
        ],
    )
