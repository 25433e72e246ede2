"""Protocols: which scans of a drive a method may see before it is asked about pose j.

In every protocol scan j, the judge, stays hidden.
"""

from collections.abc import Mapping
from typing import Literal, get_args

import numpy as np

from intervis.arrays import Float64Array
from intervis.errors import DriveError, SettingsError

Protocol = Literal["single", "past", "map"]
PROTOCOLS: tuple[str, ...] = get_args(Protocol)

MAP_DISTANCE_M = 2.0
"""In protocol ``map`` only scans taken this far from pose j, or farther, may be seen."""


def checked_protocol(name: str) -> Protocol:
    """The protocol of that name.

    Raises
    ------
    SettingsError
        There is none.

    Examples
    --------
    >>> checked_protocol("map")
    'map'
    """
    for protocol in get_args(Protocol):
        if name == protocol:
            return protocol  # type: ignore[no-any-return]
    raise SettingsError(f"there is no protocol {name!r}; choose one of {', '.join(PROTOCOLS)}.")


def frames_to_see(
    protocol: Protocol, poses: Mapping[int, Float64Array], i: int, j: int
) -> tuple[int, ...]:
    """Numbers of the frames whose scans may be seen, in ascending order.

    - ``single``: scan i alone;
    - ``past``: all scans up to and including i, the judge left out where it is one of them;
    - ``map``: all scans whose pose lies 2 m or farther from pose j; scan i only if it does.

    Parameters
    ----------
    protocol : {"single", "past", "map"}
    poses : mapping of int to (4, 4) float64 array
        world_from_velo by frame number; frames that are not in it may not be seen.
    i, j : int
        Numbers of the frame whose points are asked about, and of the judge.

    Raises
    ------
    DriveError
        i and j are the same frame, or one of them has no pose.

    Examples
    --------
    >>> poses = {n: np.eye(4) for n in range(4)}
    >>> for n in poses: poses[n][0, 3] = 1.5 * n
    >>> frames_to_see("past", poses, 2, 3), frames_to_see("map", poses, 2, 3)
    ((0, 1, 2), (0, 1))
    """
    if i == j:
        raise DriveError(f"frame {i} cannot judge itself: name two frames, as in {i}:{i + 5}.")
    for number in (i, j):
        if number not in poses:
            raise DriveError(f"frame {number} has no pose, so nothing can be judged from it.")
    if protocol == "single":
        return (i,)
    if protocol == "past":
        return tuple(number for number in sorted(poses) if number <= i and number != j)
    return tuple(
        number
        for number in sorted(poses)
        if number != j and distance_m(poses[number], poses[j]) >= MAP_DISTANCE_M
    )


def distance_m(pose_a: Float64Array, pose_b: Float64Array) -> float:
    """Distance of two poses' origins, metres.

    Examples
    --------
    >>> distance_m(np.eye(4), np.eye(4))
    0.0
    """
    return float(np.linalg.norm(pose_a[:3, 3] - pose_b[:3, 3]))
