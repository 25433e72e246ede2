"""What a page stores of one frame: the judged frame, its camera and its image."""

import io
import logging
from dataclasses import dataclass
from typing import Any

import numpy as np

from intervis.arrays import Float64Array
from intervis.drives import Drive, Frame
from intervis.errors import DriveError, MissingExtraError
from intervis.method.field_of_view import image_from_velo
from intervis.view.frame_judge import FrameJudge
from intervis.view.view_request import ViewRequest, viewpoint_in_frame

log = logging.getLogger(__name__)

IMAGE_WIDTH_PX = 828
JPEG_QUALITY = 70

FRUSTUM_M = 6.0
"""Length of the camera's frustum as drawn."""


@dataclass(frozen=True, eq=False)
class FrameData:
    """One frame as it stands in a page.

    Attributes
    ----------
    header : dict
        Plain JSON: see `FrameJudge.content`; and the camera.
    block : bytes
        Columns.
    jpeg : bytes or None
        The reduced image.
    """

    header: dict[str, Any]
    block: bytes
    jpeg: bytes | None


def frame_data(
    drive: Drive, number: int, request: ViewRequest, fixed_world: Float64Array | None = None
) -> FrameData:
    """Everything that a page stores of one frame.

    Parameters
    ----------
    drive : Drive
    number : int
    request : ViewRequest
    fixed_world : (3,) float64 array or None
        A viewpoint in world coordinates instead of that of the request.

    Raises
    ------
    DriveError
        The frame cannot be read, has no camera or no pose where the request needs one.
    """
    judge = FrameJudge(drive, number, request)
    frame = judge.frame
    header, block = judge.content(viewpoint_in_frame(frame, request.viewpoint, fixed_world))
    jpeg, size_px = _reduced_image(frame)
    return FrameData({**header, "camera": _camera(frame, size_px)}, block, jpeg)


def _reduced_image(frame: Frame) -> tuple[bytes | None, tuple[int, int] | None]:
    """The image as JPEG of at most `IMAGE_WIDTH_PX`, and its size; None without an image."""
    if not frame.has_image or frame.camera is None:
        return None, None
    try:
        image = frame.image
    except (DriveError, MissingExtraError) as error:
        log.warning("frame %d is shown without its image: %s", frame.number, error)
        return None, None
    assert image is not None
    from PIL import Image

    picture = Image.fromarray(image)
    scale = min(1.0, IMAGE_WIDTH_PX / picture.width)
    if scale < 1.0:
        size_px = (IMAGE_WIDTH_PX, max(1, round(picture.height * scale)))
        picture = picture.resize(size_px, Image.Resampling.BILINEAR, reducing_gap=2.0)
    buffer = io.BytesIO()
    picture.save(buffer, "JPEG", quality=JPEG_QUALITY)
    return buffer.getvalue(), picture.size


def _camera(frame: Frame, size_px: tuple[int, int] | None) -> dict[str, Any] | None:
    """Projection into the reduced image, and the frustum; None without a camera."""
    camera, cam_from_velo = frame.camera, frame.cam_from_velo
    if camera is None or cam_from_velo is None:
        return None
    width_px, height_px = size_px or (camera.width_px, camera.height_px)
    matrix = image_from_velo(camera, cam_from_velo)
    scaled = np.diag([width_px / camera.width_px, height_px / camera.height_px, 1.0]) @ matrix
    w, h = float(camera.width_px), float(camera.height_px)
    pixels = np.array([[0.0, 0.0, 1.0], [w, 0.0, 1.0], [w, h, 1.0], [0.0, h, 1.0]])
    rays = np.linalg.solve(matrix[:, :3], FRUSTUM_M * pixels.T - matrix[:, 3:]).T
    return {
        "name": camera.name,
        "width_px": width_px,
        "height_px": height_px,
        "has_image": size_px is not None,
        "image_from_velo": scaled.tolist(),
        "centre": frame.viewpoint_velo.round(3).tolist(),
        "frustum": rays.round(3).tolist(),
    }
