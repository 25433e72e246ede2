"""Turning a scanner's axes into x forward, y left, z up of its vehicle, by whole right angles."""

import itertools

import numpy as np

from intervis.arrays import Float64Array
from intervis.transform import rigid

X_RIGHT = np.array([[0.0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
"""sensor_from_velo of nuScenes' scanner: ahead is the sensor's y, left its -x."""


def sensor_from_velo(ego_from_sensor: Float64Array) -> Float64Array:
    """(4, 4) rotation by right angles after which a sensor's axes come nearest the vehicle's.

    It only exchanges coordinates and their signs: points lose no bit, and a tilt stays a tilt.

    Examples
    --------
    >>> x_right = rigid([[0, 1, 0], [-1, 0, 0], [0, 0, 1]], np.zeros(3))  # ego_from_sensor
    >>> (sensor_from_velo(x_right).T @ [2, 5, 1, 1]).tolist()  # 2 m right, 5 m ahead
    [5.0, -2.0, 1.0, 1.0]
    """
    nearest = max(_RIGHT_ANGLES, key=lambda axes: np.trace(ego_from_sensor[:3, :3] @ axes))
    return rigid(nearest, np.zeros(3))


_RIGHT_ANGLES = [
    rotation
    for order in itertools.permutations(range(3))
    for signs in itertools.product((1.0, -1.0), repeat=3)
    if np.linalg.det(rotation := np.eye(3)[list(order)] * signs) > 0
]
"""The 24 rotations by right angles."""
