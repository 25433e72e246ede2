"""Pairs of frames (i, j): scan i gives the targets, pose j the viewpoint, scan j the labels."""

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise

import numpy as np

from intervis.arrays import Float64Array
from intervis.errors import DriveError, SettingsError
from intervis.lab.truth.protocols import distance_m

Pairs = tuple[tuple[int, int], ...]
NamedPairs = tuple[tuple[str, str], ...]

SECTION_M = 16.0
"""Pairs are chosen within sections of the drive of about this length."""
MAX_SECTIONS = 4
TEMPLATES: tuple[tuple[float, float], ...] = (
    (0.0, 4.0),
    (0.0, 8.0),
    (0.0, 16.0),
    (8.0, -6.0),
    (4.0, 13.0),
    (16.0, -12.0),
)
"""Wanted pairs of a section, metres: position of scan i from the start of the section, and
distance from there to pose j, ahead (positive) or back (negative)."""
TOLERANCE = 0.25
"""Largest deviation of a pair's distance from the template, as a fraction of it."""


def default_pairs(poses: Mapping[int, Float64Array]) -> Pairs:
    """Pairs of a drive whose viewpoints lie 4 to 16 m apart; a function of the poses alone.

    Parameters
    ----------
    poses : mapping of int to (4, 4) float64 array
        world_from_velo by frame number.

    Returns
    -------
    tuple of (i, j)
        Six for each of up to four sections of the drive, spread evenly. Templates that no pair
        fits within 25 % are left out; there are no pairs where the vehicle hardly moves.

    Examples
    --------
    >>> poses = {n: np.eye(4) for n in range(22)}
    >>> for n in poses: poses[n][0, 3] = 0.8 * n
    >>> default_pairs(poses)
    ((0, 5), (0, 10), (0, 20), (10, 2), (5, 21), (20, 5))
    """
    numbers = sorted(poses)
    if len(numbers) < 2:
        return ()
    steps = [distance_m(poses[a], poses[b]) for a, b in pairwise(numbers)]
    travelled = np.concatenate([[0.0], np.cumsum(steps)])
    sections = int(np.clip(travelled[-1] // SECTION_M, 1, MAX_SECTIONS))
    starts = np.linspace(0.0, max(0.0, travelled[-1] - SECTION_M), sections)
    chosen: dict[tuple[int, int], None] = {}  # ordered, without duplicates
    for start in starts:
        for position, ahead in TEMPLATES:
            index = int(np.argmin(np.abs(travelled - start - position)))
            partner = _partner(numbers, poses, index, ahead)
            if partner is not None:
                chosen[numbers[index], partner] = None
    return tuple(chosen)


def _partner(
    numbers: Sequence[int], poses: Mapping[int, Float64Array], index: int, ahead_m: float
) -> int | None:
    """The later (or earlier) frame whose distance fits best; None where none is within 25 %."""
    others = numbers[index + 1 :] if ahead_m > 0 else numbers[:index]
    if not others:
        return None
    wanted_m = abs(ahead_m)

    def deviation_m(number: int) -> float:
        return abs(distance_m(poses[number], poses[numbers[index]]) - wanted_m)

    best = min(others, key=deviation_m)
    return best if deviation_m(best) <= TOLERANCE * wanted_m else None


def parsed_pairs(text: str) -> Pairs:
    """Pairs from ``0:5,0:10``.

    Raises
    ------
    SettingsError
        The text has another form.

    Examples
    --------
    >>> parsed_pairs("0:5, 10:2")
    ((0, 5), (10, 2))
    """
    form = "pairs must be frame numbers I:J with commas between, as in 0:5,0:10"
    return tuple((int(i), int(j)) for i, j in split_pairs(text, form, str.isdecimal))


def split_pairs(text: str, form: str, valid: Callable[[str], bool] = bool) -> NamedPairs:
    """Both names of each pair of ``A:B,C:D``, without the spaces around them.

    Parameters
    ----------
    text : str
    form : str
        Start of the error message: what pairs must be.
    valid : callable
        Whether a name can be one. Default: all but the empty name.

    Raises
    ------
    SettingsError
        The text has another form, or a name is not valid.
    """
    pairs = []
    for part in text.split(","):
        names = [name.strip() for name in part.split(":")]
        if len(names) != 2 or not all(map(valid, names)):
            raise SettingsError(f"{form}, got {text!r}.")
        pairs.append((names[0], names[1]))
    return tuple(pairs)


def checked_poses(
    poses: Mapping[int, Float64Array] | None, name: str, least: int = 2
) -> Mapping[int, Float64Array]:
    """The poses of a drive, at least so many.

    Raises
    ------
    DriveError
        There are fewer.
    """
    if poses is None or len(poses) < least:
        raise DriveError(
            f"{name} has {'no poses' if not poses else 'one pose'}, so no scan can be compared"
            " with another: put a poses.txt beside the scans (KITTI odometry's format, twelve"
            " numbers a line)."
        )
    return poses
