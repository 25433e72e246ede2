"""Values of options: viewpoints, frame ranges, settings, output files."""

import math
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from intervis.errors import OutputError, PointsError, SettingsError
from intervis.files import check_replaceable

if TYPE_CHECKING:
    from intervis.drives import Drive
    from intervis.settings import Settings

WIDEST_TOLERANCE = 50.0
"""Of TPI, points: with it `tau="auto"` may sample as coarsely as a budget demands."""

FARTHEST_M = 1e7
"""Coordinates are no larger, so that squares of distances are exact enough."""

NAMED_VIEWPOINTS = ("camera", "sensor", "start")


def coordinates(text: str, option: str) -> tuple[float, float, float]:
    """Three numbers in metres from ``X,Y,Z``.

    Raises
    ------
    PointsError
        The text is not three finite numbers, or a place beyond 10,000 km.

    Examples
    --------
    >>> coordinates("-1,0,2.5", "--from")
    (-1.0, 0.0, 2.5)
    """
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError:
        raise PointsError(f"{option} must be X,Y,Z in metres, got {text!r}.") from None
    if not all(abs(value) <= FARTHEST_M for value in (x, y, z)):  # nor is NaN
        raise PointsError(
            f"{option} must be three finite numbers in metres, up to {FARTHEST_M:g}, got {text!r}."
        )
    return x, y, z


def place(text: str, option: str) -> str | tuple[float, float, float]:
    """A name, ``camera`` or ``sensor``, unchanged, or coordinates.

    Raises
    ------
    PointsError
        The text is neither.
    """
    return text if text in ("camera", "sensor") else coordinates(text, option)


def heights(text: str | None, option: str) -> tuple[float, ...] | None:
    """Heights in metres from ``M`` or ``M,M``; None stays None.

    Raises
    ------
    SettingsError
        The text is not one or more finite numbers.

    Examples
    --------
    >>> heights("1.05,2", "--eye")
    (1.05, 2.0)
    """
    return None if text is None else numbers(text, option, "heights in metres, as 1.08 or 1.05,2")


def numbers(text: str, option: str, what: str) -> tuple[float, ...]:
    """One or more numbers from ``N`` or ``N,N``; ``what`` says in the error what they are.

    Raises
    ------
    SettingsError
        The text is not one or more finite numbers.

    Examples
    --------
    >>> numbers("-6.5,5", "--offset", "metres to the left")
    (-6.5, 5.0)
    """
    try:
        values = tuple(float(part) for part in text.split(","))
    except ValueError:
        values = (math.nan,)
    if not all(map(math.isfinite, values)):
        raise SettingsError(f"{option} must be {what}, got {text!r}.")
    return values


def viewpoint(text: str) -> Any:
    """A named viewpoint, unchanged, or coordinates.

    Raises
    ------
    PointsError
        The text is neither.
    """
    if text in NAMED_VIEWPOINTS:
        return text
    if "," in text:
        return coordinates(text, "--viewpoint")
    names = ", ".join(NAMED_VIEWPOINTS)
    raise PointsError(f"--viewpoint must be one of {names}, or X,Y,Z in metres, got {text!r}.")


def frame_range(text: str | None, option: str = "--frames") -> tuple[int | None, int | None] | None:
    """First frame number and the one after the last from ``A:B``, ``A:``, ``:B`` or ``A``.

    Raises
    ------
    SettingsError
        The text is not a frame range, or the range is empty.

    Examples
    --------
    >>> frame_range("3:10"), frame_range(":5"), frame_range("7")
    ((3, 10), (None, 5), (7, 8))
    """
    if text is None:
        return None
    first_text, colon, stop_text = text.partition(":")
    try:
        first = int(first_text) if first_text or not colon else None
        stop = int(stop_text) if stop_text else None
    except ValueError:
        raise SettingsError(
            f"{option} must be A:B (frame numbers, B not included), A:, :B or one number,"
            f" got {text!r}."
        ) from None
    if not colon and first is not None:
        return first, first + 1
    if first is not None and stop is not None and stop <= first:
        raise SettingsError(f"{option} {text} holds no frame: the end is not included.")
    return first, stop


def shard(text: str | None) -> tuple[int, int] | None:
    """Number of a shard, from 1, and how many there are, from ``I/N``.

    Raises
    ------
    SettingsError
        The text is not I/N with I from 1 to N.

    Examples
    --------
    >>> shard("2/8")
    (2, 8)
    """
    if text is None:
        return None
    number, _, count = text.partition("/")
    if number.isdecimal() and count.isdecimal() and 1 <= int(number) <= int(count):
        return int(number), int(count)
    raise SettingsError(f"--shard must be I/N, with I from 1 to N, got {text!r}.")


def settings(
    file: Path | None, tau: str | None, changes: list[str], budget_ms: float | None = None
) -> "Settings":
    """Settings from a TOML file, then ``--tau``, ``--budget``, then each ``--set name=value``.

    Raises
    ------
    SettingsError
        A name is unknown, a value is invalid, or the budget meets a fixed tau.
    """
    from intervis.settings import Settings

    values: dict[str, Any] = {}
    if tau is not None:
        values["tau"] = _tau(tau)
    values |= _within(budget_ms, values.get("tau", "auto"))
    for change in changes:
        name, equals, text = change.partition("=")
        if not equals or not name.strip():
            raise SettingsError(f"--set must be name=value, got {change!r}.")
        values[name.strip()] = _value(text.strip())
    base = Settings.from_toml(file) if file is not None else Settings()
    chosen = base.with_changes(**values) if values else base
    if budget_ms is not None and (chosen.tau != "auto" or chosen.sampling == "radius"):
        raise SettingsError(
            "--budget chooses tau for each frame: leave out a tau, and sampling by a radius, which"
            " has none."
        )
    return chosen


def _within(budget_ms: float | None, tau: int | str) -> dict[str, Any]:
    """The settings by which tau keeps a budget; ``--set tpi_tolerance`` may demand more nodes."""
    if budget_ms is None:
        return {}
    if not (math.isfinite(budget_ms) and budget_ms > 0):
        raise SettingsError(f"--budget must be a positive number of milliseconds, got {budget_ms}.")
    return {"tau": tau, "time_budget_ms": budget_ms, "tpi_tolerance": WIDEST_TOLERANCE}


def _tau(text: str) -> int | str:
    if text == "auto":
        return text
    try:
        return int(text)
    except ValueError:
        raise SettingsError(f"--tau must be a whole number or 'auto', got {text!r}.") from None


def _value(text: str) -> Any:
    if text.lower() == "none":
        return None
    if text.lower() in ("true", "false"):
        return text.lower() == "true"
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


PICTURE_KINDS = (".png", ".svg")


def check_picture_file(path: Path | None) -> None:
    """Check before the work that a picture can be drawn and written.

    Raises
    ------
    OutputError
        The name does not end in .png or .svg; or as `check_output_file`.
    MissingExtraError
        matplotlib is not installed.
    """
    if path is None:
        return
    if path.suffix.lower() not in PICTURE_KINDS:
        raise OutputError(f"a picture must be named .png or .svg at its end, got {path}.")
    check_output_file(path)
    from intervis.plots.style import require_matplotlib

    require_matplotlib()


def check_output_file(path: Path | None, inputs: Iterable[Path | None] = ()) -> None:
    """Check before the work that an output file can be written.

    Parameters
    ----------
    path : Path or None
    inputs : iterable of Path or None
        Files and folders that the command reads.

    Raises
    ------
    OutputError
        The path is an input or lies in one, is no regular file (a folder, a device, a pipe), or
        its folder does not exist or cannot be written to.
    """
    if path is None:
        return
    target = check_replaceable(path)
    check_no_input(path, inputs)
    if not target.parent.is_dir():
        raise OutputError(f"cannot write {path}: there is no folder {target.parent}.")
    if not os.access(target.parent, os.W_OK):
        raise OutputError(f"cannot write {path}: permission denied.")


def check_no_input(path: Path, inputs: Iterable[Path | None]) -> None:
    """Refuse an output that is an input, or that lies in a folder of inputs.

    Raises
    ------
    OutputError
        It is, or it does.
    """
    target = Path(os.path.realpath(path))
    for given in inputs:
        if not isinstance(given, Path):  # none, or remote
            continue
        source = Path(os.path.realpath(given))
        if target == source or source in target.parents:
            raise OutputError(
                f"{path} is or lies in {given}, which this command reads and never changes: choose"
                " another place."
            )


def check_drive_kept(drive: "Drive", paths: Iterable[Path | None]) -> None:
    """Refuse outputs that are files of a drive, wherever they stand and whatever they are called.

    Calibration and poses of some layouts stand beside the drive's folder, not in it.

    Raises
    ------
    OutputError
        A path is the file of a scan, an image, labels, calibration, poses or times.
    """
    for path in paths:
        if path is None or not path.exists():
            continue
        own = path.stat()
        for file in (
            *drive.metadata_files,
            *(*drive.scan_paths.values(), *drive.image_paths.values()),
            *drive.label_paths.values(),
        ):
            if isinstance(file, Path) and file.exists() and os.path.samestat(file.stat(), own):
                raise OutputError(
                    f"{path} is a file of {drive.name}, which this command reads and never changes:"
                    " choose another place."
                )


def check_output_files(
    paths: Mapping[str, Path | None], inputs: Iterable[Path | None] = ()
) -> None:
    """Check before the work that several output files can be written, each to its own path.

    Parameters
    ----------
    paths : mapping of str to Path or None
        By the names of the options that give them.
    inputs : iterable of Path or None
        Files and folders that the command reads.

    Raises
    ------
    OutputError
        Two options name one file; or as `check_output_file`.
    """
    options: dict[Path, str] = {}
    for option, path in paths.items():
        check_output_file(path, inputs)
        if path is None:
            continue
        other = options.setdefault(path.resolve(), option)
        if other != option:
            raise OutputError(f"{other} and {option} both name {path}: give each its own file.")
