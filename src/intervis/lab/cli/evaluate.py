"""``intervis evaluate``: the accuracy of sight lines against ground truth."""

import json
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from intervis.cli import options
from intervis.cli.survey import Hz
from intervis.cli.terminal import progress, show, tell
from intervis.errors import DriveError, SettingsError

if TYPE_CHECKING:
    from intervis.drives import Drive
    from intervis.lab.truth.labelled_targets import HeldOutSettings
    from intervis.lab.truth.pairs import Pairs
    from intervis.lab.truth.paper_graph import GraphScore
    from intervis.lab.truth.protocols import Protocol
    from intervis.lab.truth.results import EvaluationResult
    from intervis.lab.truth.scanner_set import ScannerSet
    from intervis.lab.worlds.recording import RecordedWorld
    from intervis.plots.tables import Table

STREET, STREET_FRAMES = "street", 24
"""Name of the built-in world as a source, and the number of frames that are simulated."""


def evaluate(
    source: Annotated[
        str,
        typer.Argument(
            help="A drive with poses, or 'street': the built-in world. With --protocol together:"
            " a TOML file that lists scanners and their poses, or a folder of scans with poses."
        ),
    ],
    pairs: Annotated[
        str | None,
        typer.Option(
            metavar="I:J,...",
            help="Frame numbers: the points of scan I are the targets, the pose of J is the"
            " viewpoint, scan J is the reference. Default: pairs 4 to 16 m apart. With --protocol"
            " together: names KNOWN:REFERENCE; default: those of the file, or all.",
        ),
    ] = None,
    protocol: Annotated[
        str,
        typer.Option(
            metavar="single|past|map|together",
            help="The scans that a method gets: scan I; all scans up to I; all scans taken 2 m"
            " or farther from J; the scan of one of several scanners of one moment.",
        ),
    ] = "single",
    frame: Annotated[
        str,
        typer.Option(
            metavar="scene|scanner",
            help="With --protocol together: the frame of the queries. The scene's: the scan is"
            " given with its pose. The known scanner's: it is given without one.",
        ),
    ] = "scene",
    targets: Annotated[
        str,
        typer.Option(
            metavar="returns|space",
            help="What a reference scan judges: points of scan I, or random points in its field of"
            " view.",
        ),
    ] = "returns",
    hz: Hz = None,
    rate: Annotated[float | None, typer.Option("--rate", hidden=True)] = None,  # its old name
    count_silhouettes: Annotated[
        bool,
        typer.Option(
            "--count-silhouettes",
            help="Label points at silhouettes visible, as earlier results did.",
        ),
    ] = False,
    any_occluder: Annotated[
        bool,
        typer.Option(
            "--any-occluder",
            help="With --protocol together: label points occluded where all nearby returns are"
            " nearer, even if they do not surround the point. Most such labels of coarse beams"
            " are wrong.",
        ),
    ] = False,
    baselines: Annotated[
        bool,
        typer.Option(
            "--baselines", "--rivals", help="Evaluate the baselines too, at several settings."
        ),
    ] = False,
    graph: Annotated[
        bool, typer.Option("--graph", help="Evaluate the graph of the paper's method too.")
    ] = False,
    every_setting: Annotated[
        bool,
        typer.Option("--every-setting", help="Show all settings of a method, not the best only."),
    ] = False,
    json_file: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Write all results as JSON.")
    ] = None,
    markdown: Annotated[
        Path | None, typer.Option(metavar="FILE.md", help="Write the tables as Markdown.")
    ] = None,
    plot: Annotated[
        Path | None, typer.Option(metavar="FILE.png", help="Draw the reliability diagram.")
    ] = None,
) -> None:
    """Measure the accuracy of sight lines.

    The returns of a held-out scan show which points are visible from its pose. For a simulated
    drive, rays cast at its known triangles give the ground truth as well. With --protocol together
    the held-out scan is that of a second scanner at the same moment.
    """
    from intervis.lab.truth.held_out import DRIVE_RULE, SILHOUETTES_VISIBLE
    from intervis.lab.truth.labelled_targets import HeldOutSettings
    from intervis.lab.truth.protocols import TOGETHER

    outputs = {"--json": json_file, "--markdown": markdown, "--plot": plot}
    options.check_output_files(outputs, [Path(source)] if Path(source).exists() else [])
    options.check_picture_file(plot)
    if protocol == TOGETHER:
        if graph:
            raise SettingsError("--graph needs a drive; leave it out with --protocol together.")
        evaluations, identity = _together(
            source, pairs, frame, targets, not any_occluder, baselines
        )
        graphs: dict[str, list[GraphScore]] = {}
    else:
        rule = SILHOUETTES_VISIBLE if count_silhouettes else DRIVE_RULE
        settings = HeldOutSettings(targets, rule, rate if hz is None else hz)
        evaluations, graphs, identity = _drive(source, pairs, protocol, baselines, graph, settings)
    tables = _tables(evaluations, graphs, every_setting)
    for table in tables:
        show(table.as_text() + "\n")
    if markdown is not None:
        from intervis.files import write_text

        write_text(markdown, "\n\n".join(table.as_markdown() for table in tables) + "\n")
        show(f"Tables: {markdown}")
    if json_file is not None:
        _write_json(json_file, identity, evaluations, graphs)
        show(f"Results: {json_file}")
    if plot is not None:
        from intervis.lab.truth.reliability_plot import save_reliability

        save_reliability(evaluations, plot)
        show(f"Reliability diagram: {plot}")


def _drive(
    source: str,
    pairs: str | None,
    protocol: str,
    baselines: bool,
    graph: bool,
    settings: "HeldOutSettings",
) -> "tuple[list[EvaluationResult], dict[str, list[GraphScore]], dict[str, Any]]":
    """The evaluations of a drive, the scores of the paper's graph, and the drive's fingerprint."""
    from intervis.lab.truth.pairs import parsed_pairs
    from intervis.lab.truth.protocols import checked_protocol

    checked = checked_protocol(protocol)
    requested = parsed_pairs(pairs) if pairs is not None else None
    with _opened(source) as drive:
        world = _world_of(drive)
        chosen = _pairs(drive, requested, world)
        evaluations = _evaluations(drive, chosen, world, checked, baselines, settings)
        graphs = _graphs(drive, chosen, world) if graph else {}
        return evaluations, graphs, drive.fingerprint()


def _together(
    source: str, pairs: str | None, frame: str, targets: str, surrounded: bool, baselines: bool
) -> "tuple[list[EvaluationResult], dict[str, Any]]":
    """The evaluation of several scanners of one moment, and their fingerprint."""
    from intervis.lab.truth.evaluation import methods_for
    from intervis.lab.truth.labelled_targets import checked_targets
    from intervis.lab.truth.together import checked_frame, evaluate_together

    checked, kind = checked_frame(frame), checked_targets(targets)
    scanners = _scanners(source, pairs)
    methods = methods_for("single", baselines=baselines)
    with progress("answers", len(scanners.pairs) * len(methods)) as advance:
        result = evaluate_together(
            scanners,
            frame=checked,
            targets=kind,
            surrounded=surrounded,
            methods=methods,
            progress=advance,
        )
    return [result], scanners.fingerprint()


def _scanners(source: str, pairs: str | None) -> "ScannerSet":
    """The scanners of a TOML file or of a folder with poses."""
    from dataclasses import replace

    from intervis.drives import open_drive
    from intervis.lab.truth.pairs import parsed_pairs
    from intervis.lab.truth.scanner_set import (
        checked_pairs,
        parsed_scanner_pairs,
        read_scanners,
        scanners_of_drive,
    )

    path = Path(source).expanduser()
    if path.suffix.lower() != ".toml":
        requested = None if pairs is None else parsed_pairs(pairs)
        return scanners_of_drive(open_drive(path), requested)
    listed = read_scanners(path)
    if pairs is None:
        return listed
    return checked_pairs(replace(listed, pairs=parsed_scanner_pairs(pairs)))


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


def _world_of(drive: "Drive") -> "RecordedWorld | None":
    """The world of a simulated drive."""
    from intervis.lab.worlds import load_world

    return load_world(drive.root) if (drive.root / "world.npz").is_file() else None


def _pairs(drive: "Drive", requested: "Pairs | None", world: "RecordedWorld | None") -> "Pairs":
    """The pairs of frames to evaluate; none where only the world can give ground truth."""
    from intervis.lab.truth.evaluation import chosen_pairs

    try:
        return chosen_pairs(drive, requested)
    except DriveError as error:
        if world is None or requested is not None:
            raise
        tell(f"note: the evaluation against held-out returns is skipped: {error}")
        return ()


def _evaluations(
    drive: "Drive",
    pairs: "Pairs",
    world: "RecordedWorld | None",
    protocol: "Protocol",
    baselines: bool,
    settings: "HeldOutSettings",
) -> "list[EvaluationResult]":
    from intervis.lab.truth.evaluation import (
        evaluate_held_out,
        evaluate_world,
        methods_for,
        world_frames,
    )
    from intervis.lab.truth.exact_world import Sampling

    methods, sampling = methods_for(protocol, baselines=baselines), Sampling()
    viewpoints = len(pairs)
    if world is not None:
        viewpoints += len(world_frames(drive, None)) * sampling.viewpoints
    found = []
    with progress("answers", viewpoints * len(methods)) as advance:
        if pairs:
            found.append(
                evaluate_held_out(
                    drive,
                    pairs=pairs,
                    protocol=protocol,
                    methods=methods,
                    progress=advance,
                    settings=settings,
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


def _graphs(
    drive: "Drive", pairs: "Pairs", world: "RecordedWorld | None"
) -> "dict[str, list[GraphScore]]":
    """Scores of the paper's graph, by the ground truths that the drive has."""
    from intervis.lab.truth.evaluation import world_frames
    from intervis.lab.truth.paper_graph import graphs_by_exact_world, graphs_by_held_out_returns

    found = {}
    with progress("graphs", bool(pairs) + (world is not None)) as advance:
        if pairs:
            found["held-out returns"] = graphs_by_held_out_returns(drive, pairs)
            advance("held-out returns")
        if world is not None:
            found["exact world"] = graphs_by_exact_world(
                drive, lambda number: world.triangles_at_frame(number)[0], world_frames(drive, None)
            )
            advance("exact world")
    return found


def _tables(
    evaluations: "list[EvaluationResult]",
    graphs: "dict[str, list[GraphScore]]",
    every_setting: bool,
) -> "list[Table]":
    from intervis.lab.truth.protocols import TOGETHER
    from intervis.lab.truth.tables import (
        accuracy_table,
        graph_table,
        risk_table,
        viewpoint_table,
    )

    tables = []
    for evaluation in evaluations:
        tables += [
            accuracy_table(evaluation, every_setting=every_setting),
            risk_table(evaluation, every_setting=every_setting),
            viewpoint_table(evaluation, every_method=evaluation.protocol == TOGETHER),
        ]
    return tables + [graph_table(truth, scores) for truth, scores in graphs.items()]


def _write_json(
    path: Path,
    identity: dict[str, Any],
    evaluations: "list[EvaluationResult]",
    graphs: "dict[str, list[GraphScore]]",
) -> None:
    import intervis
    from intervis.files import write_text
    from intervis.lab.truth.results import SCHEMA

    content = {
        "schema": SCHEMA,
        "intervis": intervis.__version__,
        "drive": identity,
        "evaluations": [evaluation.to_json() for evaluation in evaluations],
        "graphs": {
            truth: [score.to_json() for score in scores] for truth, scores in graphs.items()
        },
    }
    write_text(path, json.dumps(content, indent=1, allow_nan=False) + "\n")
