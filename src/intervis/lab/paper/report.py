"""The report of the experiments: tables and figures as CSV, Markdown, PNG and one HTML page."""

import html
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from intervis.errors import MissingExtraError, OutputError
from intervis.files import make_folder, write_text
from intervis.lab.paper import interpretation_tables, tables
from intervis.lab.paper.curve import CurvePoint
from intervis.lab.paper.drive_experiment import DriveExperiment
from intervis.lab.paper.figures import CAPTIONS, PLOTS, save_curve, save_paper_figures
from intervis.lab.paper.interpretations import Interpretation, InterpretationScore
from intervis.plots.page import Page, Picture, Remark
from intervis.plots.tables import Table
from intervis.run.summary import describe, summarize

if TYPE_CHECKING:
    from intervis.drives import Drive

PAPER = (
    'L. Bai, Y. Li, M. Cen, "Dynamic Intervisibility Analysis of 3D Point Clouds", ISPRS Int. J.'
    " Geo-Inf. 10 (2021)"
)

TITLE = "The paper's experiments, reproduced"


@dataclass(frozen=True)
class PaperReport:
    """Files of a report, and one sentence on what is missing (None: nothing)."""

    paths: tuple[Path, ...]
    missing: str | None


def write_paper_report(drive: "Drive", experiment: DriveExperiment, out: Path) -> PaperReport:
    """Write ``report.html``, ``report.md``, ``settings.toml``, ``tables/*`` and ``figures/*``.

    Raises
    ------
    OutputError
        A file cannot be written.
    """
    make_folders(out)
    pictures, missing = _pictures(experiment, out / "figures")
    named = _tables(experiment)
    page = _page(drive, experiment, pictures, list(named.values()), missing)
    texts = {
        out / "report.html": page.as_html(),
        out / "report.md": _markdown(page, out),
        out / "settings.toml": experiment.frame.settings.to_toml(),
        **{out / "tables" / f"{name}.csv": table.as_csv() for name, table in named.items()},
        **{out / "tables" / f"{name}.md": table.as_markdown() for name, table in named.items()},
    }
    for path, text in texts.items():
        write_text(path, text)
    plots = [out / "figures" / f"{name}.svg" for name in PLOTS] if pictures else []
    return PaperReport((*texts, *(picture.path for picture in pictures), *plots), missing)


def check_folder(out: Path) -> None:
    """Raise before the work where the report would replace files that no report has written.

    Raises
    ------
    OutputError
        There are such files.
    """
    page = out / "report.html"
    if page.is_file() and f"<title>{html.escape(TITLE)}</title>" in page.read_text(
        errors="replace"
    ):
        return
    for path in (page, out / "report.md", out / "settings.toml"):
        if path.exists() or path.is_symlink():
            raise OutputError(
                f"{path} was not written by an earlier `intervis reproduce` and was not changed:"
                " choose another folder."
            )


def make_folders(out: Path, names: Sequence[str] = ("figures", "tables")) -> None:
    """Make the folders of a report, before the minutes of computation.

    Raises
    ------
    OutputError
        A folder cannot be made.
    """
    for folder in (out, *(out / name for name in names)):
        make_folder(folder)


def _pictures(experiment: DriveExperiment, folder: Path) -> tuple[list[Picture], str | None]:
    try:
        paths = save_paper_figures(experiment.frame, folder)
    except MissingExtraError as error:
        return [], f"the figures are left out. {error}"
    return [Picture(path, *CAPTIONS[path.stem]) for path in paths], None


def _tables(experiment: DriveExperiment) -> dict[str, Table]:
    frame = experiment.frame
    found = {
        "table-2": tables.table_2(frame),
        "table-2-identities": tables.identities(frame),
        "table-3-one-run": tables.table_3_one_run(frame),
        "table-3-ten-runs": tables.table_3_ten_runs(frame),
        "table-4": tables.table_4(frame),
        "table-4-additions": tables.table_4_additions(frame),
    }
    if experiment.consistency:
        found["temporal-consistency"] = tables.consistency_table(experiment.consistency)
    found["claims"] = tables.claims_table(experiment.claims)
    return found


def _page(
    drive: "Drive",
    experiment: DriveExperiment,
    pictures: Sequence[Picture],
    shown: Sequence[Table],
    missing: str | None,
) -> Page:
    content = summarize(describe(drive, experiment.frame.settings, "camera"), [], [])
    *numbers, _ = shown  # the claims are at the head of the page, with their remarks
    notes = [*experiment.notes, *([f"Note: {missing}"] if missing else [])]
    m = experiment.frame.proposed.measures
    lead = (
        f"Frame {experiment.number} of {drive.name} ({drive.layout}): {m.n_raw:,} returns,"
        f" {m.n_fov:,} in view. The paper's values are printed beside those measured here. They"
        f" come from another frame, which is not published. Paper: {PAPER}."
    )
    parts: list[Picture | Table | Remark | str] = []
    if notes:
        parts += ["What is missing or different", *(Remark("–", note) for note in notes)]
    parts += ["Claims", tables.results_table(experiment.claims)]
    parts += [
        Remark(
            f"{claim.claim[0].upper()}{claim.claim[1:]}: {claim.result}.",
            f"Paper: {claim.printed}. Here: {claim.measured}. Criterion: {claim.criterion}."
            f" {claim.remark}",
        )
        for claim in experiment.claims
    ]
    parts += ["Tables", *numbers]
    if pictures:
        parts += ["Figures", *pictures]
    return Page(
        title=TITLE,
        lead=lead,
        parts=parts,
        small_print=_small_print(content),
    )


def _small_print(content: dict[str, Any]) -> list[str]:
    source, machine = content["input"], content["machine"]
    return [
        "Source: " + ", ".join(f"{name} {value}" for name, value in source.items()) + ".",
        "Settings: "
        + ", ".join(f"{name} = {value}" for name, value in content["settings"].items())
        + ".",
        "Versions: "
        + ", ".join(f"{name} {version}" for name, version in content["versions"].items())
        + ".",
        f"Machine: {machine['processor']}, {machine['cpus']} cores, {machine['system']}.",
    ]


def _markdown(page: Page, out: Path) -> str:
    """The page as Markdown; pictures are linked, not embedded."""
    blocks = [f"# {page.title}", page.lead]
    for part in page.parts:
        if isinstance(part, str):
            blocks.append(f"## {part}")
        elif isinstance(part, Table):
            blocks.append(part.as_markdown().rstrip())
        elif isinstance(part, Remark):
            blocks.append(
                f"- {part.text}" if part.opening == "–" else f"**{part.opening}** {part.text}"
            )
        else:
            link = part.path.relative_to(out).as_posix()
            blocks.append(f"![{part.heading}]({link})\n\n*{part.heading}.* {part.caption}")
    blocks += [f"<sub>{text}</sub>" for text in page.small_print]
    return "\n\n".join(blocks) + "\n"


def write_interpretations(
    scores: Sequence[InterpretationScore],
    curve: Sequence[CurvePoint],
    default: Interpretation,
    sources: Sequence[str],
    out: Path,
) -> list[Path]:
    """Write ``interpretations.md`` and ``.csv`` (all of them), ``granularity.csv`` and its plot.

    Parameters
    ----------
    scores : sequence of InterpretationScore
    curve : sequence of CurvePoint
    default : Interpretation
        That of the default settings.
    sources : sequence of str
        Names and frame numbers of the drives used.
    out : Path
        Folder.

    Raises
    ------
    OutputError
        A file cannot be written.
    """
    blocks = [
        "# Interpretations of the paper against its Table 2",
        "Frames: " + "; ".join(sources) + ".",
        interpretation_tables.choices_table(scores, default).as_markdown(),
        interpretation_tables.nearest_table(scores).as_markdown(),
        tables.curve_table(curve).as_markdown(),
    ]
    texts = {
        out / "interpretations.md": "\n\n".join(block.rstrip() for block in blocks) + "\n",
        out / "interpretations.csv": interpretation_tables.interpretations_table(scores).as_csv(),
        out / "granularity.csv": tables.curve_table(curve).as_csv(),
    }
    for path, text in texts.items():
        write_text(path, text)
    try:
        picture = save_curve(curve, out)
    except MissingExtraError:
        return list(texts)
    return [*texts, picture]
