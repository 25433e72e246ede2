"""What is parked: boxes that stand still, by the data set's word or by their track over time."""

from collections.abc import Mapping

import numpy as np

from intervis.arrays import Float64Array
from intervis.drives import Box, Drive
from intervis.transform import transform

STATES = {"parked": True, "moving": False, "stopped": False}
"""Last words of the attributes of nuScenes and Lyft that say whether something is parked."""

PARKED_WITHIN_M, PARKED_BELOW_M_PER_S = 1.0, 0.3
"""A parked box stays within the first length of its first place, and moves more slowly than this
from there: annotations of standing cars scatter by some centimetres."""


def parked_tracks(drive: Drive) -> dict[str, bool]:
    """Whether the box of each track stands still in all frames that have it.

    Tracks with fewer than two frames with pose and time are left out: nothing is known of them.
    What waits at a traffic light for the whole drive counts as parked.

    Raises
    ------
    CalibrationError
        The boxes cannot be read.
    """
    places: dict[str, list[tuple[int, Float64Array]]] = {}
    poses, read_boxes = drive.poses or {}, drive.read_boxes
    for number in drive.frame_numbers if read_boxes else ():
        if read_boxes is None or number not in poses or number not in drive.timestamps_ns:
            continue
        for box in read_boxes(number):
            if box.track:
                centre = transform(poses[number], box.velo_from_box[:3, 3])
                places.setdefault(box.track, []).append((drive.timestamps_ns[number], centre))
    return {track: _stands(seen) for track, seen in places.items() if len(seen) > 1}


def _stands(seen: list[tuple[int, Float64Array]]) -> bool:
    """Whether places (3,) with times in nanoseconds, world frame, are one place."""
    span_s = 1e-9 * (seen[-1][0] - seen[0][0])
    moved_m = max(float(np.linalg.norm(place - seen[0][1])) for _, place in seen)
    return moved_m <= min(PARKED_WITHIN_M, PARKED_BELOW_M_PER_S * span_s)


def is_parked(box: Box, tracks: Mapping[str, bool]) -> bool | None:
    """Whether a box is parked: by its attributes, otherwise by its track; None where unknown.

    Examples
    --------
    >>> box = Box(np.eye(4), np.array([4.0, 2, 1.5]), "car", attributes=("vehicle.parked",))
    >>> is_parked(box, {}), is_parked(Box(np.eye(4), box.size_m, "car", "7"), {"7": False})
    (True, False)
    """
    for attribute in box.attributes:
        state = STATES.get(attribute.replace("_", ".").rpartition(".")[2])
        if state is not None:
            return state
    return tracks.get(box.track)
