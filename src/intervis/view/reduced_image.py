"""The camera's image of a frame, small enough for a page, and the camera that fits it."""

import io
import logging
from dataclasses import dataclass

import numpy as np

from intervis.camera import Camera
from intervis.drives import Frame
from intervis.errors import DriveError, MissingExtraError

log = logging.getLogger(__name__)

IMAGE_WIDTH_PX = 828
JPEG_QUALITY = 70


@dataclass(frozen=True, eq=False)
class ReducedImage:
    """An image of at most `IMAGE_WIDTH_PX` columns.

    Attributes
    ----------
    jpeg : bytes
    width_px, height_px : int
    """

    jpeg: bytes
    width_px: int
    height_px: int


def reduced_image(frame: Frame) -> ReducedImage | None:
    """The image of a frame as JPEG; None, with a warning, where it cannot be read."""
    if not frame.has_image or frame.camera is None:
        return None
    try:
        image = frame.image
    except (DriveError, MissingExtraError) as error:
        log.warning("frame %d is shown without its image: %s", frame.number, error)
        return None
    assert image is not None
    from PIL import Image

    picture = Image.fromarray(image)
    scale = min(1.0, IMAGE_WIDTH_PX / picture.width)
    if scale < 1.0:
        size_px = (IMAGE_WIDTH_PX, max(1, round(picture.height * scale)))
        picture = picture.resize(size_px, Image.Resampling.BILINEAR, reducing_gap=2.0)
    buffer = io.BytesIO()
    picture.save(buffer, "JPEG", quality=JPEG_QUALITY)
    return ReducedImage(buffer.getvalue(), picture.width, picture.height)


def reduced_camera(camera: Camera, image: ReducedImage | None) -> Camera:
    """The camera whose pixels are those of the reduced image; without one the camera itself.

    Examples
    --------
    >>> camera = Camera(np.array([[700.0, 0, 600, 70], [0, 700, 180, 0], [0, 0, 1, 0]]), 1656, 375)
    >>> small = reduced_camera(camera, ReducedImage(b"", 828, 188))
    >>> small.fx_px, small.width_px, small.height_px
    (350.0, 828, 188)
    """
    if image is None:
        return camera
    scale = np.diag([image.width_px / camera.width_px, image.height_px / camera.height_px, 1.0])
    return Camera(scale @ camera.projection, image.width_px, image.height_px, camera.name)
