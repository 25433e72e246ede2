"""The plan of a calibration: which inputs are used for which stage."""

import tempfile
import tomllib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal, get_args

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from intervis.drives import Drive, open_drive
from intervis.errors import SettingsError
from intervis.lab.truth.labelled_targets import TargetKind
from intervis.lab.truth.pairs import Pairs, parsed_pairs
from intervis.lab.truth.protocols import Protocol
from intervis.lab.worlds import simulate
from intervis.lab.worlds.ray_casting import require_embreex

DEFAULT_PLAN = Path(__file__).with_name("plan.toml")
STREET, STREET_FRAMES = "street:", 24

Stage = Literal["curves", "thresholds"]
STAGES: tuple[Stage, ...] = get_args(Stage)


class Input(BaseModel):
    """One drive and what it is used for.

    `rate` is in frames a second, for a drive without timestamps.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    drive: str
    pairs: str
    protocols: tuple[Protocol, ...] = Field(min_length=1)
    targets: tuple[TargetKind, ...] = Field(default=("returns",), min_length=1)
    rate: float | None = Field(default=None, gt=0)
    stages: tuple[Stage, ...]

    @property
    def frame_pairs(self) -> Pairs:
        """The pairs (i, j) of frame numbers."""
        return parsed_pairs(self.pairs)


class MatrixInput(BaseModel):
    """Cells of scanners, mounts and worlds (`intervis.lab.truth.cells`), by seeds of each stage.

    `lines` are drawn from a cell, a quarter of each kind, for the curves; `threshold_lines` for the
    thresholds. Cells with one of the names in `leave_out` (a scanner, a mount or a world) take no
    part.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    curves: tuple[int, ...] = ()
    thresholds: tuple[int, ...] = ()
    lines: int = Field(default=48, ge=4)
    threshold_lines: int = Field(default=240, ge=4)
    leave_out: tuple[str, ...] = ()


class GranularityInput(BaseModel):
    """Frames on which the cost of coarser sampling is measured."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    drives: tuple[str, ...] = Field(min_length=1)
    frames_per_drive: int = Field(default=4, ge=1)


class Plan(BaseModel):
    """All inputs of a calibration.

    Attributes
    ----------
    lines_per_pair : int
        Sight lines drawn from each pair and protocol.
    seed : int
        Of the draw.
    threshold_lines_per_pair : int
        The same for the stage `thresholds`.
    inputs : tuple of Input
    matrix : MatrixInput
    granularity : GranularityInput or None
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    lines_per_pair: int = Field(default=800, ge=1)
    threshold_lines_per_pair: int = Field(default=1000, ge=1)
    seed: int = Field(default=0, ge=0)
    inputs: tuple[Input, ...] = ()
    matrix: MatrixInput = MatrixInput()
    granularity: GranularityInput | None = None


def load_plan(path: Path) -> Plan:
    """Read a plan.

    Raises
    ------
    SettingsError
        The file cannot be read, is no TOML, or holds an unknown or impossible entry.
    """
    try:
        content: dict[str, Any] = tomllib.loads(path.read_text(encoding="utf-8"))
        plan = Plan.model_validate(content)
    except OSError as error:
        raise SettingsError(f"cannot read the plan {path}: {error.strerror}.") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise SettingsError(f"{path} is no valid TOML: {error}.") from None
    except RecursionError:
        raise SettingsError(f"{path} is nested too deeply to be a plan.") from None
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"])
        raise SettingsError(f"{path}: {place}: {first['msg'].lower()}.") from None
    for given in plan.inputs:
        _ = given.frame_pairs  # raises for a list of pairs that does not parse
    return plan


def fingerprints(names: Iterable[str], data: Path) -> str:
    """The digests of the drives among some inputs; a built-in street is identified by its seed."""
    drives = sorted({name for name in names if not name.startswith(STREET)})
    digests = {name: open_drive(data / name).fingerprint()["digest"] for name in drives}
    return "; ".join(f"{name} {digest}" for name, digest in digests.items())


def check_drive(name: str, data: Path) -> Drive | None:
    """The drive of an input; None for a built-in street, which is simulated later.

    Raises
    ------
    SettingsError
        A built-in street without a seed.
    MissingExtraError
        A built-in street, and embreex is not installed.
    DriveError
        The drive cannot be opened.
    """
    if not name.startswith(STREET):
        return open_drive(data / name)
    street_seed(name)
    require_embreex()  # before minutes of work, not after them
    return None


def street_seed(name: str) -> int:
    """The seed of a built-in street ``street:SEED``."""
    seed = name.removeprefix(STREET)
    if not (seed.isascii() and seed.isdecimal()):
        raise SettingsError(f"a built-in street is street:SEED, SEED 0 or more, got {name!r}.")
    return int(seed)


@contextmanager
def opened(name: str, data: Path) -> Iterator[Drive]:
    """The drive of an input: a folder below `data`, or a built-in street that is simulated."""
    if not name.startswith(STREET):
        yield open_drive(data / name)
        return
    with tempfile.TemporaryDirectory() as folder:
        seed = street_seed(name)
        yield open_drive(simulate(folder, frames=STREET_FRAMES, seed=seed, images=False))
