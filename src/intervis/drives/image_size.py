"""The size of a camera's images: from an image, or what is likely without one."""

import logging
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from intervis.arrays import Float64Array
from intervis.camera import Camera
from intervis.drives.image_file import first_image_size_px
from intervis.errors import DriveError

log = logging.getLogger(__name__)

KITTI_SIZE_PX = (1242, 375)
"""Default image width and height, where neither the calibration nor an image gives them."""

KITTI_CENTRE_PX = (609.0, 178.0)
KITTI_CENTRE_TOLERANCE_PX = (25.0, 15.0)
"""Principal points of KITTI's rectified cameras lie around this one, within this distance."""


def image_size_px(
    images: Mapping[int, Path], projection: Float64Array, name: str
) -> tuple[int, int]:
    """Width and height of the first readable image; where there is none, what is likely.

    Without images the principal point tells: near that of KITTI's cameras the size is KITTI's
    usual one, otherwise the point is taken for the middle of the image, with a warning.

    Parameters
    ----------
    images : mapping of int to Path
    projection : (3, 4) array
        Of the camera.
    name : str
        The camera's name, for the messages.

    Raises
    ------
    DriveError
        There are images, and none of them can be read.

    Examples
    --------
    >>> image_size_px({}, np.array([[700.0, 0, 640, 0], [0, 700, 360, 0], [0, 0, 1, 0]]), "a")
    (1280, 720)
    """
    if images:
        return first_image_size_px(images)
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        centre_px = np.clip(np.nan_to_num(projection[:2, 2] / projection[2, 2]), -1e6, 1e6)
    if (np.abs(centre_px - KITTI_CENTRE_PX) < KITTI_CENTRE_TOLERANCE_PX).all():
        log.info("no images: KITTI's image size of %d x %d pixels is used.", *KITTI_SIZE_PX)
        return KITTI_SIZE_PX
    width_px, height_px = (round(2 * float(middle)) for middle in centre_px)
    log.warning(
        "there are no images of %s: their size is taken as %d x %d pixels, with the principal point"
        " in the middle.",
        *(name, width_px, height_px),
    )
    return width_px, height_px


def warn_of_other_size(camera: Camera, images: Mapping[int, Path]) -> None:
    """Log a warning where the images do not have the size in the calibration."""
    if not images:
        return
    try:
        width_px, height_px = first_image_size_px(images)
    except DriveError as error:
        log.warning("%s", error)
        return
    if (width_px, height_px) != (camera.width_px, camera.height_px):
        log.warning(
            "the images of %s are %d x %d pixels, but its calibration gives %d x %d: the size in"
            " the calibration is used.",
            camera.name,
            width_px,
            height_px,
            camera.width_px,
            camera.height_px,
        )
