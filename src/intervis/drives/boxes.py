"""Boxes of objects at the moment of a frame, and KITTI's files of them."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from intervis.arrays import Float64Array
from intervis.drives.calibration import parse_numbers, read_lines
from intervis.errors import CalibrationError
from intervis.transform import inverse, rigid

NO_OBJECT = "DontCare"
"""KITTI's name of regions of an image without labels."""

FARTHEST_M = 1e6


@dataclass(frozen=True, eq=False)
class Box:
    """A box around an object.

    Attributes
    ----------
    velo_from_box : (4, 4) float64 array
        The frame of the scanner from that of the box: centre at the origin, x forward, y left,
        z up of the object.
    size_m : (3,) float64 array
        Length, width and height, along x, y and z of the box.
    category : str
        What the data set calls the object.
    track : str
        The same for one object in all frames of a drive; empty where it is not known.
    returns : int or None
        Number of returns inside, as the data set states it; None where it does not.
    visibility : str
        What the data set says of it, in its own words: KITTI's ``occlusion 0`` (fully visible) to
        ``occlusion 3`` (unknown), nuScenes' ``v0-40`` to ``v80-100``; empty where it says nothing.
    attributes : tuple of str
        What the data set says of its state, in its own words: nuScenes' ``vehicle.parked``.
    """

    velo_from_box: Float64Array = field(repr=False)
    size_m: Float64Array
    category: str
    track: str = ""
    returns: int | None = None
    visibility: str = ""
    attributes: tuple[str, ...] = ()


FROM_BOX = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
"""Camera axes (x right, y down, z ahead) from those of a box whose length lies along x right."""


def kitti_boxes(path: Path, cam_from_velo: Float64Array, frame: int | None) -> tuple[Box, ...]:
    """The boxes in a label file of KITTI.

    A line holds type, truncation, occlusion, alpha, four edges in the image, height, width and
    length, the middle of the bottom in the rectified camera frame, and the angle about its y. In
    the tracking set the frame and the track stand before these.

    Parameters
    ----------
    path : Path
    cam_from_velo : (4, 4) array
    frame : int or None
        The frame of the tracking set whose lines are read; None for the object set.

    Raises
    ------
    CalibrationError
        A line does not parse; the message names file and line.
    """
    velo_from_cam, boxes = inverse(cam_from_velo), []
    before = 0 if frame is None else 2
    for line_number, line in enumerate(read_lines(path), start=1):
        words = line.split()
        if len(words) <= before or words[before] == NO_OBJECT:
            continue
        numbers = parse_numbers(
            " ".join([*words[:before], *words[before + 1 :]]), path, line_number
        )
        if len(numbers) < before + 14 or max(map(abs, numbers)) > FARTHEST_M:
            raise CalibrationError(
                f"{path}, line {line_number}: expected a label of KITTI: the type and 14 numbers."
            )
        if frame is not None and numbers[0] != frame:
            continue
        height, width, length, x, y, z, angle = numbers[before + 7 : before + 14]
        c, s = np.cos(angle), np.sin(angle)
        about_y = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
        cam_from_box = rigid(about_y @ FROM_BOX, [x, y - height / 2, z])
        boxes.append(
            Box(
                velo_from_cam @ cam_from_box,
                np.array([length, width, height]),
                words[before],
                words[1] if before else "",
                visibility=f"occlusion {numbers[before + 1]:.0f}",
            )
        )
    return tuple(boxes)
