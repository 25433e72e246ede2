"""Frame numbers: of files, from their names; of lines, from their place.

Nothing in a drive is paired by its position in a list of files: a missing scan or image leaves a
gap, and everything else stays where it belongs.
"""

import logging
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TypeVar

from intervis.errors import CalibrationError, DriveError

log = logging.getLogger(__name__)

Value = TypeVar("Value")


def numbered_files(folder: Path, ending: str) -> dict[int, Path]:
    """Files of a KITTI folder whose whole name is a number, by that number, sorted.

    A folder that is not there holds none; files called otherwise are passed over.

    Raises
    ------
    DriveError
        Two files carry the same number, as 7.bin and 0007.bin do.
    """
    if not folder.is_dir():
        return {}
    files: dict[int, Path] = {}
    for path in sorted(folder.iterdir()):
        stem = path.name.removesuffix(ending)
        if stem == path.name or not (stem.isascii() and stem.isdigit()):
            continue
        if int(stem) in files:
            raise DriveError(
                f"two files of {folder} carry the number {int(stem)}:"
                f" {files[int(stem)].name} and {path.name}; remove one."
            )
        files[int(stem)] = path
    return dict(sorted(files.items()))


def numbered_scans(root: Path, folder: str, expected_files: str) -> dict[int, Path]:
    """The ``.bin`` scans in one folder of a KITTI drive, by number.

    Raises
    ------
    DriveError
        There are none, or two carry the same number.
    """
    scans = numbered_files(root / folder, ".bin")
    if not scans:
        raise DriveError(f"{root} holds no scans: looked for {expected_files}.")
    return scans


def numbered_by_name(paths: Iterable[Path]) -> dict[int, Path]:
    """Files by the last run of digits in their names; in sorted order where that is no number.

    Examples
    --------
    >>> list(numbered_by_name([Path("scan_12_top.ply"), Path("scan_9_top.ply")]))
    [9, 12]
    >>> list(numbered_by_name([Path("kerb.ply"), Path("bridge.ply")]))
    [0, 1]
    """
    ordered = sorted(paths)
    digits = [re.findall(r"[0-9]+", path.name.split(".")[0]) for path in ordered]
    numbers = [int(found[-1]) for found in digits if found]
    if len(set(numbers)) == len(ordered):
        return dict(sorted(zip(numbers, ordered, strict=True)))
    log.warning(
        "the names of the %d scans in %s give no frame numbers: they are numbered from 0 in sorted"
        " order.",
        len(ordered),
        ordered[0].parent,
    )
    return dict(enumerate(ordered))


def lines_by_number(
    values: Sequence[Value], numbers: Sequence[int], path: Path, *, may_be_longer: bool = False
) -> dict[int, Value]:
    """Which line of a file belongs to which frame.

    As many lines as the highest frame number plus one: line k belongs to frame NUMBER k. As many
    lines as scans: line k belongs to the k-th scan there is. (Both at once only where no number is
    missing, and then they agree.)

    Parameters
    ----------
    values : sequence
        One for each line.
    numbers : sequence of int
        The drive's frame numbers, sorted.
    may_be_longer : bool
        Whether lines beyond the last scan are fine, because line k is known to be frame k.

    Raises
    ------
    CalibrationError
        The number of lines fits neither.

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
        f"{path} has {len(values)} lines, which fits neither the {len(numbers)} scans"
        f" nor the frame numbers up to {numbers[-1]} ({whole} lines)."
    )
