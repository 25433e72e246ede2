"""Frame numbers of files (from their names) and of lines in a file (from their positions).

Scans, images and other files are matched by frame number, never by position in a sorted list: a
missing file must not shift the matches of the others.
"""

import logging
import re
from collections.abc import Iterable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import TypeVar

from intervis.errors import CalibrationError, DriveError

log = logging.getLogger(__name__)

Value = TypeVar("Value")

MOST_DIGITS = 18
"""Digits of a frame number at most: it is kept in 64 bits."""


def numbered_files(folder: Path, *endings: str) -> dict[int, Path]:
    """Files of a KITTI folder that are named NUMBER and one of `endings`, by number, sorted.

    Endings are compared without regard to case. A number with files of several endings has the file
    with the first of them. Other files are ignored. A missing folder has no files.

    Raises
    ------
    DriveError
        Two files have the same number and ending, for example 7.bin and 0007.bin.
    """
    if not folder.is_dir():
        return {}
    files: dict[int, Path] = {}
    ranks: dict[int, int] = {}
    for path in sorted(folder.iterdir()):
        name = path.name.lower()
        rank = next((nth for nth, ending in enumerate(endings) if name.endswith(ending)), None)
        if rank is None:
            continue
        stem = name.removesuffix(endings[rank])
        if not (stem.isascii() and stem.isdigit() and len(stem) <= MOST_DIGITS):
            continue
        number = int(stem)
        if ranks.get(number) == rank:
            raise DriveError(
                f"two files in {folder} have the number {number}:"
                f" {files[number].name} and {path.name}; remove one."
            )
        if number not in ranks or rank < ranks[number]:
            files[number], ranks[number] = path, rank
    return dict(sorted(files.items()))


def numbered_scans(root: Path, folder: str, expected_files: str) -> dict[int, Path]:
    """The ``.bin`` scans in one folder of a KITTI drive, by number.

    Raises
    ------
    DriveError
        There are no scans, or two have the same number.
    """
    scans = numbered_files(root / folder, ".bin")
    if not scans:
        raise DriveError(f"{root} holds no scans; expected files: {expected_files}.")
    return scans


def numbered_by_name(paths: Iterable[Path]) -> dict[int, Path]:
    """Files by the last digits in their names, if these increase in the order of the names.

    Otherwise from 0 in that order. Digits in names are compared as numbers: scan_9 before scan_10.

    Examples
    --------
    >>> list(numbered_by_name([Path("scan_12_top.ply"), Path("scan_9_top.ply")]))
    [9, 12]
    >>> list(numbered_by_name([Path("kerb.ply"), Path("bridge.ply")]))
    [0, 1]
    >>> list(numbered_by_name([Path("16-21-30-068.pcd"), Path("16-21-29-868.pcd")]))
    [0, 1]
    """
    ordered = sorted(paths, key=_by_numbers)
    digits = [re.findall(r"[0-9]+", path.name.split(".")[0]) for path in ordered]
    numbers = [int(found[-1]) for found in digits if found and len(found[-1]) <= MOST_DIGITS]
    if len(numbers) == len(ordered) and all(a < b for a, b in pairwise(numbers)):
        return dict(zip(numbers, ordered, strict=True))
    log.warning(
        "the names of the %d scans in %s contain no frame numbers that increase: the scans are"
        " numbered from 0 in the order of their names.",
        len(ordered),
        ordered[0].parent,
    )
    return dict(enumerate(ordered))


def _by_numbers(path: Path) -> tuple[list[str | int], str]:
    """Sorting key of a name: texts and numbers in turn, then the whole name."""
    parts = re.split(r"([0-9]+)", path.name.split(".")[0])
    return [int(part) if nth % 2 else part for nth, part in enumerate(parts)], path.name


def lines_by_number(
    values: Sequence[Value], numbers: Sequence[int], path: Path, *, may_be_longer: bool = False
) -> dict[int, Value]:
    """Assign the lines of a file to frames.

    If the number of lines is the highest frame number plus one, line k belongs to frame NUMBER k.
    If it is the number of scans, line k belongs to the k-th scan. If it is both, no frame number is
    missing and the two rules agree.

    Parameters
    ----------
    values : sequence
        One value for each line.
    numbers : sequence of int
        The drive's frame numbers, sorted.
    may_be_longer : bool
        Allow lines after the last scan: in this file line k is always frame k.

    Raises
    ------
    CalibrationError
        The number of lines matches neither.

    Examples
    --------
    >>> lines_by_number("abc", [0, 1, 5], Path("poses.txt"))
    {0: 'a', 1: 'b', 5: 'c'}
    >>> lines_by_number("abcdef", [0, 1, 5], Path("poses.txt"))
    {0: 'a', 1: 'b', 5: 'f'}
    """
    whole = numbers[-1] + 1
    if len(values) == whole or (may_be_longer and len(values) > whole):
        return {number: values[number] for number in numbers}
    if len(values) == len(numbers):
        return dict(zip(numbers, values, strict=True))
    raise CalibrationError(
        f"{path} has {len(values)} lines; expected {len(numbers)} (one for each scan)"
        f" or {whole} (one for each frame number up to {numbers[-1]})."
    )
