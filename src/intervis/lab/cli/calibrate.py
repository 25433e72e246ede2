"""``intervis calibrate``: fit the numbers of the package again."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from intervis.cli.terminal import progress, show
from intervis.errors import OutputError, SettingsError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from intervis.lab.calibrate.outcome import Outcome
    from intervis.lab.calibrate.plan import Plan

PARTS = ("model", "granularity")
NAMES = ("occupancy_model.toml", "granularity.toml")


def calibrate(
    data: Annotated[Path, typer.Option("--data", help="Folder of the drives that the plan names.")],
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the numbers.")],
    plan: Annotated[
        Path | None,
        typer.Option("--plan", metavar="FILE.toml", help="Inputs; the package's own without it."),
    ] = None,
    only: Annotated[
        str | None,
        typer.Option(metavar="model|granularity", help="One part; both without it."),
    ] = None,
    leave_out: Annotated[
        str | None,
        typer.Option(
            "--leave-out",
            metavar="NAMES|each",
            help="Fit without one scanner, mount, world or drive at a time and judge the numbers on"
            " it: names, comma-separated, or each. Writes left_out.md only (a minute a name).",
        ),
    ] = None,
) -> None:
    """Fit the numbers of the model again (minutes).

    Fits the occupancy model and tau="auto"; writes them with their provenance, in the format of the
    files that the package reads, and prints the shipped numbers beside the fitted ones.
    """
    if only is not None and only not in PARTS:
        raise SettingsError(f"--only must be one of {', '.join(PARTS)}, got {only!r}.")

    from intervis.lab.calibrate.fit import calibrate_model, check_inputs, model_steps
    from intervis.lab.calibrate.granularity import (
        calibrate_granularity,
        check_granularity,
        granularity_steps,
    )
    from intervis.lab.calibrate.plan import DEFAULT_PLAN, load_plan
    from intervis.method import granularity
    from intervis.sight import occupancy_model

    chosen = load_plan(plan or DEFAULT_PLAN)
    if leave_out is not None:
        if only is not None:
            raise SettingsError("--leave-out judges the model: leave out --only.")
        _leave_out(chosen, data, out, leave_out)
        return
    fits_granularity = only == "granularity" or (only is None and chosen.granularity is not None)
    if only != "granularity":
        check_inputs(chosen, data)
    if fits_granularity:
        check_granularity(chosen, data)
    _check_output(out)
    if only != "granularity":
        with progress("occupancy model", model_steps(chosen)) as advance:
            outcome = calibrate_model(chosen, data, progress=advance)
        _write(
            out / "occupancy_model.toml", outcome, occupancy_model.FITTED, "sight.occupancy_model"
        )
        for name in ("loss_shipped", "loss_curves", "loss_probability"):
            show(f"{name}: {outcome.provenance[name]:.4f}")
    if fits_granularity:
        with progress("granularity", granularity_steps(chosen)) as advance:
            outcome = calibrate_granularity(chosen, data, progress=advance)
        _write(out / "granularity.toml", outcome, granularity.FITTED, "method.granularity")


def _leave_out(plan: "Plan", data: Path, out: Path, text: str) -> None:
    from intervis.files import make_folder, write_text
    from intervis.lab.calibrate.left_out import (
        checked_sources,
        leave_each_out,
        left_out_steps,
        left_out_table,
    )

    named = () if text == "each" else tuple(name.strip() for name in text.split(","))
    names = checked_sources(plan, named)
    make_folder(out)
    with progress("left out", left_out_steps(plan, names)) as advance:
        results = list(leave_each_out(plan, data, names, progress=advance))
    table = left_out_table(results)
    show(table.as_text())
    write_text(out / "left_out.md", table.as_markdown() + "\n")


def _check_output(out: Path) -> None:
    """Make the folder, and raise where a file of other origin stands in it under our names."""
    from intervis.files import check_replaceable, make_folder
    from intervis.lab.calibrate.outcome import MARK

    make_folder(out)
    for name in NAMES:
        path = check_replaceable(out / name)
        if path.exists() and MARK not in path.read_text(errors="replace").partition("\n")[0]:
            raise OutputError(
                f"{path} was not written by `intervis calibrate` and was not changed: choose"
                " another folder."
            )


def _write(path: Path, outcome: "Outcome", shipped: "Mapping[str, Any]", module: str) -> None:
    from intervis.files import write_bytes
    from intervis.lab.calibrate.outcome import compared
    from intervis.plots.tables import Table

    write_bytes(path, outcome.to_toml(f"The fitted numbers of intervis.{module}.").encode())
    rows = compared(shipped, outcome.numbers)
    show(Table(f"intervis.{module}", ("number", "shipped", "fitted"), rows).as_text())
    show(f"Numbers: {path}")
