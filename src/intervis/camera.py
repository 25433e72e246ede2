"""A rectified pinhole camera: a 3x4 projection matrix and an image size."""

from __future__ import annotations  # help() shows the names of the array types

from dataclasses import dataclass, field
from typing import cast

import numpy as np

from intervis.arguments import is_count, object_of, shown
from intervis.arrays import Float64Array, numbers_of
from intervis.errors import CameraError, PointsError
from intervis.transform import inverse, transform

LONGEST_SIDE_PX = 100_000
"""Pixels of a side of an image at most."""

LARGEST = 1e12
"""Entries of a projection at most: larger ones overflow in what is computed from them."""


@dataclass(frozen=True, eq=False)
class Camera:
    """A rectified camera.

    Attributes
    ----------
    projection : (3, 4) float64 array
        Homogeneous pixels from rectified camera coordinates (x right, y down, z forward, metres):
        the paper's M (Eq. 2), KITTI's P_rect_0k. The fourth column holds the baseline term -F B.
    width_px, height_px : int
        Image size in pixels.
    name : str
        The camera's name, for example ``image_02``.

    Raises
    ------
    CameraError
        The matrix is not 3x4, not finite or not of full rank, or the image has no or too many
        pixels.

    Examples
    --------
    >>> camera = Camera(np.array([[700.0, 0, 600, 350], [0, 700, 180, 0], [0, 0, 1, 0]]), 1242, 375)
    >>> camera.fx_px, camera.cx_px
    (700.0, 600.0)
    >>> (camera.centre_cam + 0.0).tolist()
    [-0.5, 0.0, 0.0]
    """

    projection: Float64Array = field(repr=False)
    width_px: int
    height_px: int
    name: str = "camera"

    def __post_init__(self) -> None:
        object_of(self.name, str, "a camera's name")
        try:
            matrix = numbers_of(self.projection, "projection")
        except PointsError:
            raise CameraError("a camera's projection must be a 3x4 matrix of numbers.") from None
        if matrix.shape != (3, 4) or not np.isfinite(matrix).all():
            raise CameraError(
                f"a camera's projection must be a finite (3, 4) matrix, got shape {matrix.shape}."
            )
        if np.abs(matrix).max() > LARGEST or np.linalg.matrix_rank(matrix[:, :3]) < 3:
            raise CameraError(
                f"a camera's projection must have rank three and entries up to {LARGEST:.0e};"
                " check its focal lengths."
            )
        if not all(_is_side(side) for side in (self.width_px, self.height_px)):
            raise CameraError(
                f"a camera's image must have 1 to {LONGEST_SIDE_PX} pixels a side, got"
                f" {shown(self.width_px)} x {shown(self.height_px)}."
            )
        matrix.setflags(write=False)
        object.__setattr__(self, "projection", matrix)

    @property
    def fx_px(self) -> float:
        """Horizontal focal length, pixels."""
        return float(self.projection[0, 0])

    @property
    def fy_px(self) -> float:
        """Vertical focal length, pixels."""
        return float(self.projection[1, 1])

    @property
    def cx_px(self) -> float:
        """Column of the principal point, pixels."""
        return float(self.projection[0, 2])

    @property
    def cy_px(self) -> float:
        """Row of the principal point, pixels."""
        return float(self.projection[1, 2])

    @property
    def centre_cam(self) -> Float64Array:
        """(3,) centre of projection in rectified coordinates: the point that projects to 0."""
        solved = np.linalg.solve(self.projection[:, :3], self.projection[:, 3])
        return np.asarray(-solved, dtype=np.float64)


def _is_side(side_px: object) -> bool:
    return is_count(side_px) and cast(int, side_px) <= LONGEST_SIDE_PX


def default_viewpoint(camera: Camera | None, cam_from_velo: Float64Array | None) -> Float64Array:
    """(3,) centre of the camera in the sensor frame, metres; the sensor's origin without a camera.

    Examples
    --------
    >>> default_viewpoint(None, None).tolist()
    [0.0, 0.0, 0.0]
    """
    if camera is None or cam_from_velo is None:
        return np.zeros(3)
    return transform(inverse(cam_from_velo), camera.centre_cam)
