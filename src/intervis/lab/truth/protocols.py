"""Protocols: which scans of a drive a method gets before it answers queries from pose j.

Scan j, the reference scan, is hidden in every protocol.
"""

from collections.abc import Mapping
from typing import Literal, get_args

import numpy as np

from intervis.arrays import Float64Array
from intervis.errors import DriveError
from intervis.lab.truth.choices import checked_choice

Protocol = Literal["single", "past", "map"]
PROTOCOLS: tuple[Protocol, ...] = get_args(Protocol)
TOGETHER = "together"
"""Name of the protocol of `intervis.lab.truth.together`: scanners of one moment, not frames of a
drive."""

MAP_DISTANCE_M = 2.0
"""Protocol ``map`` uses the scans taken at this distance from pose j, or farther."""


def checked_protocol(name: str) -> Protocol:
    """The protocol of that name.

    Raises
    ------
    SettingsError
        There is no such protocol.

    Examples
    --------
    >>> checked_protocol("map")
    'map'
    """
    return checked_choice(name, PROTOCOLS, "there is no protocol")


def input_frames(
    protocol: Protocol, poses: Mapping[int, Float64Array], i: int, j: int
) -> tuple[int, ...]:
    """Numbers of the frames whose scans a method gets, ascending.

    - ``single``: scan i alone;
    - ``past``: all scans up to and including i, without the reference scan;
    - ``map``: all scans whose pose lies 2 m or farther from pose j; scan i only if it does.

    Parameters
    ----------
    protocol : {"single", "past", "map"}
    poses : mapping of int to (4, 4) float64 array
        world_from_velo by frame number; frames without a pose are not used.
    i, j : int
        Numbers of the frame whose points are the targets, and of the reference frame.

    Raises
    ------
    DriveError
        i and j are the same frame, or one of them has no pose.

    Examples
    --------
    >>> poses = {n: np.eye(4) for n in range(4)}
    >>> for n in poses: poses[n][0, 3] = 1.5 * n
    >>> input_frames("past", poses, 2, 3), input_frames("map", poses, 2, 3)
    ((0, 1, 2), (0, 1))
    """
    if i == j:
        raise DriveError(
            f"frame {i} cannot be its own reference: name two frames, as in {i}:{i + 5}."
        )
    for number in (i, j):
        if number not in poses:
            raise DriveError(f"frame {number} has no pose: choose frames with poses.")
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
