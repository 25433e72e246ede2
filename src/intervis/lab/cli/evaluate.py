"""``intervis evaluate``: how often the sight lines are right."""

import json
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from intervis.cli import options
from intervis.cli.terminal import progress, show, tell
from intervis.errors import DriveError

if TYPE_CHECKING:
    from intervis.drives import Drive
    from intervis.lab.truth.pairs import Pairs
    from intervis.lab.truth.paper_graph import GraphScore
    from intervis.lab.truth.protocols import Protocol
    from intervis.lab.truth.scoring import Evaluation
    from intervis.plots.tables import Table

STREET, STREET_FRAMES = "street", 24
"""Name of the built-in world as a source, and how many frames of it are made."""


def evaluate(
    source: Annotated[
        str, typer.Argument(help="A drive with poses, or 'street': the built-in world.")
    ],
    pairs: Annotated[
        str | None,
        typer.Option(
            metavar="I:J,...",
            help="Frame numbers: scan I is asked about from the pose of J, and scan J judges."
            " Without it: pairs 4 to 16 m apart.",
        ),
    ] = None,
    protocol: Annotated[
        str,
        typer.Option(
            metavar="single|past|map",
            help="What may be seen: scan I; all scans up to I; all taken 2 m or more from J.",
        ),
    ] = "single",
    rivals: Annotated[
        bool, typer.Option("--rivals", help="Ask today's tools as well, at several settings.")
    ] = False,
    graph: Annotated[
        bool, typer.Option("--graph", help="Judge the graph of the paper's method as well.")
    ] = False,
    every_setting: Annotated[
        bool, typer.Option("--every-setting", help="Show every setting, not the best ones alone.")
    ] = False,
    json_file: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Write everything measured.")
    ] = None,
    markdown: Annotated[
        Path | None, typer.Option(metavar="FILE.md", help="Write the tables as Markdown.")
    ] = None,
    plot: Annotated[
        Path | None, typer.Option(metavar="FILE.png", help="Draw the reliability plot.")
    ] = None,
) -> None:
    """Measure how often sight lines are right, against held-out returns and exact worlds.

    A scan that the method never sees says what was visible from where it was taken. Where SOURCE
    is a simulated drive, rays cast at its known triangles say so, too.
    """
    from intervis.lab.truth.pairs import parsed_pairs
    from intervis.lab.truth.protocols import checked_protocol

    known, asked = checked_protocol(protocol), parsed_pairs(pairs) if pairs is not None else None
    for path in (json_file, markdown, plot):
        options.check_output_file(path)
    with _opened(source) as drive:
        evaluations = _evaluations(drive, asked, known, rivals)
        graphs = _graphs(drive, asked) if graph else {}
        identity = drive.identity()
    tables = _tables(evaluations, graphs, every_setting)
    for table in tables:
        show(table.as_text() + "\n")
    if markdown is not None:
        from intervis.files import write_text

        write_text(markdown, "\n\n".join(table.as_markdown() for table in tables) + "\n")
        show(f"Tables: {markdown}")
    if json_file is not None:
        _write_json(json_file, identity, evaluations, graphs)
        show(f"Measured: {json_file}")
    if plot is not None:
        from intervis.lab.truth.reliability_plot import save_reliability

        save_reliability(evaluations, plot)
        show(f"Picture: {plot}")


@contextmanager
def _opened(source: str) -> "Iterator[Drive]":
    from intervis.drives import open_drive

    if source != STREET or Path(source).exists():
        yield open_drive(source)
        return
    from intervis.lab.worlds import simulate

    with tempfile.TemporaryDirectory() as folder:
        with progress("simulation", STREET_FRAMES) as advance:
            drive = simulate(
                folder,
                frames=STREET_FRAMES,
                images=False,
                progress=advance,
            )
        yield open_drive(drive)


def _evaluations(
    drive: "Drive", pairs: "Pairs | None", protocol: "Protocol", rivals: bool
) -> "list[Evaluation]":
    from intervis.lab.truth.evaluate import (
        chosen_pairs,
        evaluate_held_out,
        evaluate_world,
        methods_for,
        world_frames,
    )
    from intervis.lab.truth.exact import Sampling
    from intervis.lab.worlds import load_world

    methods, sampling = methods_for(protocol, rivals=rivals), Sampling()
    world = load_world(drive.root) if (drive.root / "world.npz").is_file() else None
    try:
        chosen = chosen_pairs(drive, pairs)
    except DriveError as error:
        if world is None or pairs is not None:
            raise
        chosen = ()
        tell(f"note: held-out returns are left out: {error}")
    viewpoints = len(chosen)
    if world is not None:
        viewpoints += len(world_frames(drive, None)) * sampling.viewpoints
    with progress("answers", viewpoints * len(methods)) as advance:
        found = []
        if chosen:
            found.append(
                evaluate_held_out(
                    drive, pairs=chosen, protocol=protocol, methods=methods, progress=advance
                )
            )
        if world is not None:
            found.append(
                evaluate_world(
                    drive,
                    lambda number: world.triangles_at_frame(number)[0],
                    protocol=protocol,
                    sampling=sampling,
                    methods=methods,
                    progress=advance,
                )
            )
    return found


def _graphs(drive: "Drive", pairs: "Pairs | None") -> "dict[str, list[GraphScore]]":
    """The paper's graph under each truth that the drive has."""
    from intervis.lab.truth.evaluate import chosen_pairs, world_frames
    from intervis.lab.truth.paper_graph import graphs_by_exact_world, graphs_by_held_out_returns
    from intervis.lab.worlds import load_world

    found = {}
    world = load_world(drive.root) if (drive.root / "world.npz").is_file() else None
    with progress("graphs", 1 + (world is not None)) as advance:
        try:
            chosen = chosen_pairs(drive, pairs)
            found["held-out returns"] = graphs_by_held_out_returns(drive, chosen)
            advance("held-out returns")
        except DriveError as error:
            if world is None or pairs is not None:
                raise
            tell(f"note: held-out returns are left out: {error}")
        if world is not None:
            found["exact world"] = graphs_by_exact_world(
                drive, lambda number: world.triangles_at_frame(number)[0], world_frames(drive, None)
            )
            advance("exact world")
    return found


def _tables(
    evaluations: "list[Evaluation]", graphs: "dict[str, list[GraphScore]]", every_setting: bool
) -> "list[Table]":
    from intervis.lab.truth.tables import accuracy_table, graph_table, questions_table

    tables = []
    for evaluation in evaluations:
        tables += [
            accuracy_table(evaluation, every_setting=every_setting),
            questions_table(evaluation),
        ]
    return tables + [graph_table(truth, scores) for truth, scores in graphs.items()]


def _write_json(
    path: Path,
    identity: dict[str, Any],
    evaluations: "list[Evaluation]",
    graphs: "dict[str, list[GraphScore]]",
) -> None:
    import intervis
    from intervis.files import write_text

    content = {
        "schema": 1,
        "intervis": intervis.__version__,
        "drive": identity,
        "evaluations": [evaluation.to_json() for evaluation in evaluations],
        "graphs": {truth: [score.to_json() for score in of] for truth, of in graphs.items()},
    }
    write_text(path, json.dumps(content, indent=1, allow_nan=False) + "\n")
