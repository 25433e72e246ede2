"""Rigid motions as 4x4 matrices with names `destination_from_origin`: adjacent names cancel.

``points_cam = transform(cam_from_velo, points_velo)``, and
``image_from_velo = image_from_cam @ cam_from_velo``.
"""

import numpy as np
from numpy.typing import ArrayLike

from intervis.arrays import LARGEST_M, Float64Array, FloatArray, numbers_of
from intervis.errors import PointsError, PoseError

ROTATION_TOLERANCE = 1e-3
"""Largest allowed entry of ``R R^T - I``: KITTI prints rotations with seven digits."""


def checked_pose(pose: ArrayLike, name: str = "pose") -> Float64Array:
    """A rigid motion as a (4, 4) float64 array.

    Parameters
    ----------
    pose : (4, 4) or (3, 4) array
        Rotation and translation, metres.

    Raises
    ------
    PoseError
        The shape is wrong, an entry is not finite, the upper left 3x3 block is not a rotation (a
        reflection, a scale, a shear), the last row is not 0 0 0 1, or it moves by more than 1e9 m.

    Examples
    --------
    >>> checked_pose(np.eye(4)[:3]).shape
    (4, 4)
    """
    try:
        matrix = numbers_of(pose, name)
    except PointsError:
        raise PoseError(f"{name} must be a 4x4 matrix of numbers.") from None
    if matrix.shape == (3, 4):
        matrix = np.vstack([matrix, [0.0, 0.0, 0.0, 1.0]])
    if matrix.shape != (4, 4):
        raise PoseError(f"{name} must have the shape (4, 4) or (3, 4), got {matrix.shape}.")
    if not np.isfinite(matrix).all():
        raise PoseError(f"{name} holds NaN or infinite entries.")
    rotation = np.clip(matrix[:3, :3], -1e9, 1e9)  # whatever is not near 1 is no rotation
    if (
        np.abs(rotation @ rotation.T - np.eye(3)).max() > ROTATION_TOLERANCE
        or np.linalg.det(rotation) < 0
    ):
        raise PoseError(
            f"{name} is not a rigid motion: its upper left 3x3 block must be a rotation"
            " (orthonormal, determinant +1)."
        )
    if np.abs(matrix[3] - [0.0, 0.0, 0.0, 1.0]).max() > ROTATION_TOLERANCE:
        raise PoseError(f"{name} is not a rigid motion: its last row must be 0 0 0 1.")
    if np.abs(matrix[:3, 3]).max() > LARGEST_M:
        raise PoseError(f"{name} moves by more than {LARGEST_M:g} m: its unit must be metres.")
    return matrix


def rigid(rotation: ArrayLike, translation_m: ArrayLike) -> Float64Array:
    """The 4x4 matrix of a rotation (3, 3) and a translation (3,) in metres."""
    matrix = np.eye(4)
    matrix[:3, :3] = rotation
    matrix[:3, 3] = np.asarray(translation_m, dtype=np.float64).reshape(3)
    return matrix


def inverse(pose: Float64Array) -> Float64Array:
    """The inverse of a rigid motion: ``inverse(a_from_b)`` is ``b_from_a``.

    Examples
    --------
    >>> a_from_b = rigid([[0, -1, 0], [1, 0, 0], [0, 0, 1]], [1.0, 2.0, 3.0])
    >>> np.allclose(inverse(a_from_b) @ a_from_b, np.eye(4))
    True
    """
    # Printed rotations are orthonormal to a few digits only: a transpose would not be the inverse.
    return np.asarray(np.linalg.inv(pose), dtype=np.float64)


def transform(pose: Float64Array, points: FloatArray) -> Float64Array:
    """Points (..., 3) after a rigid motion (4, 4), in float64.

    Examples
    --------
    >>> transform(rigid(np.eye(3), [1.0, 0.0, 0.0]), np.zeros((2, 3)))
    array([[1., 0., 0.],
           [1., 0., 0.]])
    """
    return np.asarray(points, dtype=np.float64) @ pose[:3, :3].T + pose[:3, 3]
