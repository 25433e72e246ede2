"""``intervis calibrate``: fit the numbers of the package again."""

from pathlib import Path
from typing import Annotated

import typer

from intervis.cli import options
from intervis.cli.terminal import progress, show


def calibrate(
    data: Annotated[Path, typer.Option("--data", help="Folder of the drives that the plan names.")],
    out: Annotated[Path, typer.Option("--out", metavar="FILE.toml", help="Where to write them.")],
    plan: Annotated[
        Path | None,
        typer.Option("--plan", metavar="FILE.toml", help="Inputs; the package's own without it."),
    ] = None,
) -> None:
    """Fit the numbers of the occupancy model again, from the inputs of a plan (minutes).

    Writes them with their provenance, in the format of the file that the package reads, and
    prints the shipped numbers beside the fitted ones.
    """
    options.check_output_file(out)

    from intervis.files import write_text
    from intervis.lab.calibrate.fit import calibrate_model, steps_of
    from intervis.lab.calibrate.outcome import compared
    from intervis.lab.calibrate.plan import DEFAULT_PLAN, load_plan
    from intervis.plots.tables import Table
    from intervis.sight.occupancy_model import FITTED

    chosen = load_plan(plan or DEFAULT_PLAN)
    with progress("calibration", steps_of(chosen)) as advance:
        outcome = calibrate_model(chosen, data, progress=advance)
    heading = "The fitted numbers of intervis.sight.occupancy_model."
    write_text(out, outcome.to_toml(heading))
    rows = compared(FITTED, outcome.numbers)
    show(Table("Occupancy model", ("number", "shipped", "fitted"), rows).as_text())
    for name in ("loss_curves_shipped", "loss_curves", "loss_probability"):
        show(f"{name}: {outcome.provenance[name]:.4f}")
    show(f"Numbers: {out}")
