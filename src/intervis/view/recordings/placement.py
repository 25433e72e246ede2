"""A rigid motion as viewers take it, and the places of the things that a frame shows."""

from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from intervis.arrays import Float64Array
from intervis.camera import Camera
from intervis.transform import inverse


class Placement(NamedTuple):
    """Translation (3,), metres, and rotation as a quaternion (4,), x, y, z, w."""

    translation: Float64Array
    quaternion: Float64Array


def placement(pose: Float64Array) -> Placement:
    """The placement of a frame in its parent, from the (4, 4) matrix parent_from_frame.

    Examples
    --------
    >>> quarter = np.array([[0.0, -1, 0, 5], [1, 0, 0, 6], [0, 0, 1, 7], [0, 0, 0, 1]])
    >>> placement(quarter).quaternion.round(3).tolist()
    [0.0, 0.0, 0.707, 0.707]
    """
    return Placement(pose[:3, 3].copy(), Rotation.from_matrix(pose[:3, :3]).as_quat())


def velo_from_pinhole(camera: Camera, cam_from_velo: Float64Array) -> Float64Array:
    """The (4, 4) sensor frame from that of a pinhole: origin at the camera's centre.

    Viewers know pinholes of a 3 x 3 matrix only. The fourth column of a projection (KITTI's
    baseline) is a shift of the centre: P [x; 1] = K (x - centre).

    Examples
    --------
    >>> camera = Camera(np.array([[700.0, 0, 600, 350], [0, 700, 180, 0], [0, 0, 1, 0]]), 1242, 375)
    >>> velo_from_pinhole(camera, np.eye(4))[:3, 3].tolist()
    [-0.5, 0.0, 0.0]
    """
    cam_from_pinhole = np.eye(4)
    cam_from_pinhole[:3, 3] = camera.centre_cam + 0.0
    return inverse(cam_from_velo) @ cam_from_pinhole
