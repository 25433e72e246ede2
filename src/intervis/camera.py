"""A pinhole camera as KITTI rectifies it: a 3x4 projection matrix and an image size."""

from dataclasses import dataclass, field

import numpy as np

from intervis.arrays import Float64Array
from intervis.errors import CameraError
from intervis.transform import inverse, transform


@dataclass(frozen=True, eq=False)
class Camera:
    """A rectified camera.

    Attributes
    ----------
    projection : (3, 4) float64 array
        Pixels from rectified camera coordinates (x right, y down, z forward, metres): the paper's
        M (Eq. 2), KITTI's P_rect_0k. Its fourth column carries the baseline term -F B.
    width_px, height_px : int
        Image size in pixels.
    name : str
        For example ``image_02``.

    Raises
    ------
    CameraError
        The matrix is not 3x4, not finite or not of full rank, or the image has no pixels.

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
        try:
            matrix = np.array(self.projection, dtype=np.float64)
        except (TypeError, ValueError):
            raise CameraError("a camera's projection must be a 3x4 matrix of numbers.") from None
        if matrix.shape != (3, 4) or not np.isfinite(matrix).all():
            raise CameraError(
                f"a camera's projection must be a finite (3, 4) matrix, got shape {matrix.shape}."
            )
        if np.linalg.matrix_rank(matrix[:, :3]) < 3:
            raise CameraError("a camera's projection must have rank three: its focal length is 0?")
        if self.width_px < 1 or self.height_px < 1:
            raise CameraError(
                f"a camera's image must have pixels, got {self.width_px} x {self.height_px}."
            )
        matrix.setflags(write=False)
        object.__setattr__(self, "projection", matrix)

    @property
    def fx_px(self) -> float:
        """Focal length along the image's rows, pixels."""
        return float(self.projection[0, 0])

    @property
    def fy_px(self) -> float:
        """Focal length along the image's columns, pixels."""
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
        """(3,) the camera's own centre in rectified coordinates: where the projection is 0."""
        solved = np.linalg.solve(self.projection[:, :3], self.projection[:, 3])
        return np.asarray(-solved, dtype=np.float64)

    def centre_velo(self, cam_from_velo: Float64Array) -> Float64Array:
        """(3,) the camera's centre in the sensor's frame, metres.

        Parameters
        ----------
        cam_from_velo : (4, 4) float64 array
            The camera's extrinsics: sensor to rectified camera frame.

        Examples
        --------
        >>> camera = Camera(np.array([[9.0, 0, 5, 0], [0, 9, 5, 0], [0, 0, 1, 0]]), 10, 10)
        >>> cam_from_velo = np.array([[0.0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, -2], [0, 0, 0, 1]])
        >>> (camera.centre_velo(cam_from_velo) + 0.0).tolist()
        [2.0, 0.0, 0.0]
        """
        return transform(inverse(cam_from_velo), self.centre_cam)
