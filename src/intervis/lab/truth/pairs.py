"""Pairs of frames (i, j): scan i is asked about, pose j is the viewpoint, scan j the judge."""

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np

from intervis.arrays import Float64Array
from intervis.errors import DriveError, SettingsError
from intervis.lab.truth.protocols import distance_m

Pairs = tuple[tuple[int, int], ...]

STRETCH_M = 16.0
"""Pairs are chosen inside stretches of road of about this length."""
MOST_STRETCHES = 4
WISHES: tuple[tuple[float, float], ...] = (
    (0.0, 4.0),
    (0.0, 8.0),
    (0.0, 16.0),
    (8.0, -6.0),
    (4.0, 13.0),
    (16.0, -12.0),
)
"""Metres into the stretch at which scan i was taken, and metres from there to pose j,
ahead or back: viewpoints 4 to 16 m away, both ways."""
TOLERANCE = 0.25
"""A wish is met by a distance within this share of it."""


def default_pairs(poses: Mapping[int, Float64Array]) -> Pairs:
    """Pairs of a drive whose viewpoints lie 4 to 16 m apart, the same every time.

    Parameters
    ----------
    poses : mapping of int to (4, 4) float64 array
        world_from_velo by frame number.

    Returns
    -------
    tuple of (i, j)
        Six for each of up to four stretches of the drive, spread evenly; fewer where a wish
        cannot be met within 25 %, none where the vehicle hardly moves.

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
    stretches = int(np.clip(travelled[-1] // STRETCH_M, 1, MOST_STRETCHES))
    begins = np.linspace(0.0, max(0.0, travelled[-1] - STRETCH_M), stretches)
    chosen: dict[tuple[int, int], None] = {}  # ordered, each pair once
    for begin in begins:
        for into, ahead in WISHES:
            place = int(np.argmin(np.abs(travelled - begin - into)))
            found = _partner(numbers, poses, place, ahead)
            if found is not None:
                chosen[numbers[place], found] = None
    return tuple(chosen)


def _partner(
    numbers: Sequence[int], poses: Mapping[int, Float64Array], place: int, ahead_m: float
) -> int | None:
    """The later (or earlier) frame whose distance is nearest to the one wished for."""
    others = numbers[place + 1 :] if ahead_m > 0 else numbers[:place]
    if not others:
        return None
    wished = abs(ahead_m)
    best = min(others, key=lambda n: abs(distance_m(poses[n], poses[numbers[place]]) - wished))
    missed = abs(distance_m(poses[best], poses[numbers[place]]) - wished)
    return best if missed <= TOLERANCE * wished else None


def parsed_pairs(text: str) -> Pairs:
    """Pairs from ``0:5,0:10``.

    Raises
    ------
    SettingsError
        It is anything else.

    Examples
    --------
    >>> parsed_pairs("0:5, 10:2")
    ((0, 5), (10, 2))
    """
    pairs = []
    for part in text.split(","):
        i, colon, j = part.partition(":")
        if not (colon and i.strip().isdecimal() and j.strip().isdecimal()):
            raise SettingsError(
                "pairs must be frame numbers I:J with commas between, as in 0:5,0:10,"
                f" got {text!r}."
            )
        pairs.append((int(i), int(j)))
    return tuple(pairs)


def posed(
    poses: Mapping[int, Float64Array] | None, name: str, least: int = 2
) -> Mapping[int, Float64Array]:
    """The poses of a drive, or an error that says what to do without them.

    Raises
    ------
    DriveError
        There are fewer than the least number.
    """
    if poses is None or len(poses) < least:
        raise DriveError(
            f"{name} has {'no poses' if not poses else 'one pose'}, so no scan can judge another:"
            " put a poses.txt beside the scans (KITTI odometry's format, twelve numbers a line)."
        )
    return poses
