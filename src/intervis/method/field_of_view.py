"""Field of view: which returns project into the camera's image (paper Sec. 2.1, Eq. 1 and 2)."""

from dataclasses import dataclass

import numpy as np

from intervis.arrays import LARGEST_M, Float64Array, FloatArray, IntArray
from intervis.camera import Camera
from intervis.kernels import kernel

AZIMUTH_FOV_DEG = {"circle": 360.0, "wide": 180.0, "front": 90.0}
"""Azimuth fields of view by name, centred on the sensor's x axis, for scans without a camera."""


@dataclass(frozen=True, eq=False)
class FieldOfView:
    """The returns in view.

    Attributes
    ----------
    index : (n_fov,) int64 array
        Rows of the raw scan that are in view, ascending.
    n_raw : int
        Returns of the raw scan.
    n_dropped : int
        Rows that are no return and are left out: a coordinate is NaN, infinite or beyond
        1e9 m, or all three are 0, which some files store for a beam without return.
    """

    index: IntArray
    n_raw: int
    n_dropped: int


def image_from_velo(camera: Camera, cam_from_velo: Float64Array) -> Float64Array:
    """(3, 4) matrix M R0 [R|t] of Eq. 1: homogeneous pixels from sensor coordinates."""
    return camera.projection @ cam_from_velo


def in_camera(points_velo: FloatArray, camera: Camera, cam_from_velo: Float64Array) -> FieldOfView:
    """Returns that project into the camera's image (Eq. 1 and 2).

    A return is in view when its depth is positive and its pixel (u, v) has 0 <= u < width and
    0 <= v < height, with the calibrated principal point.

    Parameters
    ----------
    points_velo : (N, 3) float array
        Raw scan, sensor frame, metres; non-finite rows are left out and counted.
    camera : Camera
    cam_from_velo : (4, 4) float64 array
        Sensor to rectified camera frame: R0 [R|t].

    Examples
    --------
    >>> camera = Camera(np.array([[100.0, 0, 50, 0], [0, 100, 50, 0], [0, 0, 1, 0]]), 100, 100)
    >>> cam_from_velo = np.array([[0.0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]])
    >>> in_camera(np.array([[5.0, 0, 0], [-5, 0, 0], [5, 9, 0]]), camera, cam_from_velo).index
    array([0])
    """
    index = np.empty(len(points_velo), np.int64)
    n_fov, n_dropped = _in_image(
        points_velo,
        image_from_velo(camera, cam_from_velo),
        float(camera.width_px),
        float(camera.height_px),
        index,
    )
    return FieldOfView(index[:n_fov].copy(), len(points_velo) - n_dropped, n_dropped)


def in_azimuth(points_velo: FloatArray, fov_deg: float) -> FieldOfView:
    """Returns within an azimuth field of view centred on the x axis.

    Examples
    --------
    >>> in_azimuth(np.array([[5.0, 1, 0], [1, 5, 0], [-5, 0, 0]]), 90.0).index
    array([0])
    """
    index = np.empty(len(points_velo), np.int64)
    n_fov, n_dropped = _in_azimuth(points_velo, np.deg2rad(fov_deg) / 2, index)
    return FieldOfView(index[:n_fov].copy(), len(points_velo) - n_dropped, n_dropped)


def taken(points: FloatArray, index: IntArray) -> Float64Array:
    """(n, 3) float64 copy of some points, as ``points[index]`` but faster.

    Examples
    --------
    >>> taken(np.array([[5.0, 1, 0], [1, 5, 0]], np.float32), np.array([1])).tolist()
    [[1.0, 5.0, 0.0]]
    """
    chosen = np.empty((len(index), 3))
    _take(points, index, chosen)
    return chosen


@kernel
def _take(points: FloatArray, index: IntArray, chosen: Float64Array) -> None:
    for k in range(len(index)):
        i = np.uint64(index[k])  # an unsigned index needs no test for negative ones
        for axis in range(3):
            chosen[k, axis] = points[i, axis]


@kernel
def _is_return(x: float, y: float, z: float) -> bool:
    # The sum is NaN or large exactly when a term is. (0, 0, 0) marks a beam without return.
    return bool(0.0 < abs(x) + abs(y) + abs(z) <= LARGEST_M)


@kernel
def _in_image(
    points: FloatArray, matrix: Float64Array, width_px: float, height_px: float, index: IntArray
) -> tuple[int, int]:
    """Write the indices of the points in the image; how many, and how many rows are no return."""
    n_fov = 0
    n_dropped = 0
    for i in range(points.shape[0]):
        x = np.float64(points[i, 0])
        y = np.float64(points[i, 1])
        z = np.float64(points[i, 2])
        if not _is_return(x, y, z):
            n_dropped += 1
            continue
        depth = matrix[2, 0] * x + matrix[2, 1] * y + matrix[2, 2] * z + matrix[2, 3]
        if not depth > 0.0:
            continue
        u = matrix[0, 0] * x + matrix[0, 1] * y + matrix[0, 2] * z + matrix[0, 3]
        v = matrix[1, 0] * x + matrix[1, 1] * y + matrix[1, 2] * z + matrix[1, 3]
        # u and v are not divided by the depth: for depth > 0, u / depth < width is
        # u < width * depth.
        if 0.0 <= u < width_px * depth and 0.0 <= v < height_px * depth:
            index[n_fov] = i
            n_fov += 1
    return n_fov, n_dropped


@kernel
def _in_azimuth(points: FloatArray, half_rad: float, index: IntArray) -> tuple[int, int]:
    """As `_in_image`, for azimuths from -half_rad to half_rad."""
    n_fov = 0
    n_dropped = 0
    for i in range(points.shape[0]):
        x = np.float64(points[i, 0])
        y = np.float64(points[i, 1])
        if not _is_return(x, y, np.float64(points[i, 2])):
            n_dropped += 1
        elif half_rad >= np.pi or abs(np.arctan2(y, x)) <= half_rad:
            index[n_fov] = i
            n_fov += 1
    return n_fov, n_dropped
