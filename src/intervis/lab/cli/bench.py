"""``intervis bench``: our times beside those of other tools, in one run."""

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from intervis.cli.terminal import progress, show
from intervis.errors import SettingsError

if TYPE_CHECKING:
    from intervis.drives import Drive
    from intervis.lab.speed.timing import Work


def bench(
    source: Annotated[
        Path | None,
        typer.Argument(
            help="A drive or one scan file; default: a drive through the built-in world."
        ),
    ] = None,
    frame: Annotated[
        int | None, typer.Option("--frame", metavar="N", help="Frame number; default: the first.")
    ] = None,
    rounds: Annotated[int, typer.Option(metavar="N", help="Rounds, 3 or more.")] = 9,
    only: Annotated[
        str | None, typer.Option(metavar="TEXT", help="Only works whose name holds this text.")
    ] = None,
    json: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Write all times as JSON.")
    ] = None,
    compare: Annotated[
        Path | None,
        typer.Option("--compare", metavar="FILE", help="Show the change since an earlier --json."),
    ] = None,
    growth: Annotated[
        bool,
        typer.Option(
            "--growth",
            help="Instead: how time and memory grow with the number of points, from 10,000 to a"
            " million, over scans of the built-in street.",
        ),
    ] = False,
    picture: Annotated[
        Path | None,
        typer.Option("--picture", metavar="FILE.png|FILE.svg", help="Draw the chart of --growth."),
    ] = None,
) -> None:
    """Time the package beside other tools.

    Calls are interleaved; medians are shown. Tools that are installed take part: scipy, Embree, and
    Open3D and pythoncdt if they are there.
    """
    from intervis.cli.options import check_drive_kept, check_output_file
    from intervis.files import write_text
    from intervis.lab.speed.comparison import as_json, changes_table, read_earlier, timings_table
    from intervis.lab.speed.timing import LEAST_ROUNDS, interleaved
    from intervis.lab.speed.works import question_of, works_of
    from intervis.run.summary import machine, version_numbers

    if rounds < LEAST_ROUNDS:
        raise SettingsError(f"--rounds must be {LEAST_ROUNDS} or more, got {rounds}.")
    if growth:
        if any(one is not None for one in (source, frame, only, compare)):
            raise SettingsError(
                "--growth scans the built-in street: leave out SOURCE, --frame, --only and"
                " --compare."
            )
        _growth(rounds, json, picture)
        return
    if picture is not None:
        raise SettingsError(
            "--picture draws the chart of --growth: give --growth, or leave it out."
        )
    check_output_file(json, [source, compare])
    earlier = None if compare is None else read_earlier(compare)
    with tempfile.TemporaryDirectory() as folder:
        drive = _drive(source, Path(folder))
        check_drive_kept(drive, [json])
        number = drive.frame_numbers[0] if frame is None else frame
        works = _works_with(only, list(works_of(question_of(drive, number))))
        with progress("timing", len(works) * (rounds + 1)) as advance:
            timings = interleaved(works, rounds, progress=advance)
    on, versions = machine(), version_numbers()
    notes = (f"{drive.name}, frame {number}.", _machine_note(on, versions))
    show(timings_table(timings, notes).as_text())
    if earlier is not None:
        show("\n" + changes_table(timings, earlier).as_text())
    if json is not None:
        head = {"drive": drive.name, "frame": number, "machine": on, "versions": versions}
        write_text(json, as_json(timings, head))


def _growth(rounds: int, json: Path | None, picture: Path | None) -> None:
    """Measure, show and write how time and memory grow."""
    from json import dumps

    from intervis.cli.options import check_output_files, check_picture_file
    from intervis.files import write_text
    from intervis.lab.speed import growth as curves
    from intervis.run.summary import machine, version_numbers

    check_output_files({"--json": json, "--picture": picture})
    check_picture_file(picture)
    sizes = curves.SIZES
    with progress("growth", curves.growth_steps(sizes, rounds)) as advance:
        found = curves.growth(sizes, rounds, progress=advance)
    on, versions = machine(), version_numbers()
    show(curves.growth_table(found, [_machine_note(on, versions)]).as_text())
    if json is not None:
        head = {"machine": on, "versions": versions, "growth": curves.growth_dict(found)}
        write_text(json, dumps(head, indent=1) + "\n")
    if picture is not None:
        from intervis.lab.speed.growth_figure import growth_figure
        from intervis.plots.style import save_figure

        save_figure(growth_figure(found), picture, picture.suffix[1:].lower())
        show(f"Picture: {picture}")


def _machine_note(on: Mapping[str, Any], versions: Mapping[str, Any]) -> str:
    """Processor, cores and versions, in a sentence or two."""
    named = ", ".join(f"{name} {text}" for name, text in versions.items())
    return f"{on['processor']}, {on['cpus']} cores in use. {named}."


def _works_with(text: str | None, works: "list[Work]") -> "list[Work]":
    """The works whose group or tool holds a text; all of them without one."""
    found = [work for work in works if text is None or text in f"{work.group}, {work.by}"]
    if not found:
        groups = "; ".join(dict.fromkeys(work.group for work in works))
        raise SettingsError(f"no work has a name with {text!r}; the groups are: {groups}.")
    return found


def _drive(source: Path | None, folder: Path) -> "Drive":
    from intervis.drives import open_drive

    if source is not None:
        return open_drive(source)
    from intervis.lab.worlds import simulate

    with progress("simulation", 14) as advance:
        return open_drive(simulate(folder / "drive", frames=14, images=False, progress=advance))
