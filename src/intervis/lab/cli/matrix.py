"""``intervis matrix``: exact truth over scanners, mounts and worlds."""

import json
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from intervis.cli.terminal import progress, show
from intervis.errors import SettingsError

if TYPE_CHECKING:
    from intervis.lab.truth.cells import Cell


def matrix(
    out: Annotated[
        Path | None, typer.Option("--out", help="Folder for matrix.json and .md.")
    ] = None,
    scanners: Annotated[str | None, typer.Option(help="Names, comma-separated.")] = None,
    mounts: Annotated[str | None, typer.Option(help="Names, comma-separated.")] = None,
    worlds: Annotated[str | None, typer.Option(help="Names, comma-separated.")] = None,
    lines: Annotated[int, typer.Option(metavar="N", help="Sight lines of each cell.")] = 1500,
    seed: Annotated[int, typer.Option(metavar="S", help="Seed of worlds, sites and lines.")] = 0,
    labels: Annotated[
        bool,
        typer.Option(
            "--labels",
            help="Check the labels of --protocol together in these worlds instead of the engine.",
        ),
    ] = False,
    baselines: Annotated[
        bool,
        typer.Option(
            "--baselines",
            help="The baselines beside the engine, on returns seen from two viewpoints of a cell"
            " (20 to 40 s a cell).",
        ),
    ] = False,
) -> None:
    """Score the engine for each scanner, mount and world."""
    from intervis.files import make_folder, write_bytes
    from intervis.lab.truth.cells import KINDS, cells
    from intervis.lab.truth.matrix import evaluate_cells, matrix_table, worst_cell
    from intervis.lab.worlds.beam_pattern import PATTERNS
    from intervis.lab.worlds.mounts import MOUNTS
    from intervis.lab.worlds.places import PLACES

    if lines < len(KINDS) or seed < 0:
        raise SettingsError(
            f"--lines must be {len(KINDS)} or more and --seed 0 or more, got {lines}, {seed}."
        )
    if labels and baselines:
        raise SettingsError(
            "--labels checks labels, --baselines scores methods: choose one of them."
        )
    if out is not None:
        make_folder(out)  # before minutes of work, not after them
    if labels:
        if scanners or mounts or worlds:
            raise SettingsError("--labels takes all worlds and two scanners: leave out the names.")
        _check_labels(seed, out)
        return
    chosen = cells(
        _names("--scanners", scanners, PATTERNS),
        _names("--mounts", mounts, MOUNTS),
        _names("--worlds", worlds, PLACES),
    )
    if not chosen:
        raise SettingsError(
            "these scanners, mounts and worlds cannot be combined: the terrestrial scanner stands"
            " on its tripod only, the others never do, and the hall has no mast."
        )
    if baselines:
        _score_baselines(chosen, seed, out)
        return
    with progress("matrix", len(chosen)) as advance:
        results = list(evaluate_cells(chosen, lines=lines, seed=seed, progress=advance))
    table = matrix_table(results)
    show(table.as_text())
    worst, name, value = worst_cell(results)
    show(f"Worst cell: {worst.scanner}, {worst.mount}, {worst.world}: {name} {value:.3f}.")
    if out is not None:
        body = {"lines": lines, "seed": seed, "cells": [result.to_json() for result in results]}
        write_bytes(out / "matrix.json", (json.dumps(body, indent=1) + "\n").encode())
        write_bytes(out / "matrix.md", table.as_markdown().encode())


def _score_baselines(chosen: "list[Cell]", seed: int, out: Path | None) -> None:
    from intervis.files import write_text
    from intervis.lab.truth.evaluation import methods_for
    from intervis.lab.truth.matrix_baselines import VIEWPOINTS, evaluate_baselines
    from intervis.lab.truth.tables import accuracy_table, risk_table

    methods = methods_for("single", baselines=True)
    with progress("answers", len(chosen) * VIEWPOINTS * len(methods)) as advance:
        result = evaluate_baselines(chosen, seed=seed, methods=methods, progress=advance)
    tables = [accuracy_table(result), risk_table(result)]
    for table in tables:
        show(table.as_text() + "\n")
    if out is not None:
        write_text(
            out / "baselines.md", "\n\n".join(table.as_markdown() for table in tables) + "\n"
        )


def _check_labels(seed: int, out: Path | None) -> None:
    from intervis.files import write_bytes
    from intervis.lab.truth.label_check import check_labels, label_table
    from intervis.lab.worlds.places import PLACES

    checks = []
    with progress("labels", 4 * len(PLACES)) as advance:
        for check in check_labels(seed=seed):
            checks.append(check)
            advance(check.world)
    table = label_table(checks)
    show(table.as_text())
    if out is not None:
        write_bytes(out / "labels.md", table.as_markdown().encode())


def _names(option: str, text: str | None, known: Iterable[str]) -> list[str] | None:
    if text is None:
        return None
    names = [name.strip() for name in text.split(",")]
    for name in names:
        if name not in known:
            raise SettingsError(f"{option}: {name!r} is not one of {', '.join(known)}.")
    return names
