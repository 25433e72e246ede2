"""Mounts: height and orientation of a scanner above the ground."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from intervis.arrays import Float64Array
from intervis.transform import rigid


@dataclass(frozen=True)
class Mount:
    """Height above the ground, metres, and roll about the scanner's x axis, degrees."""

    name: str
    height_m: float
    roll_deg: float = 0.0

    def pose(self, foot: ArrayLike, yaw_rad: float = 0.0) -> Float64Array:
        """scene_from_scanner (4, 4) above a point of the ground; the scene's z is up.

        Examples
        --------
        >>> MOUNTS["upside-down"].pose([1.0, 2.0, 0.5])[:3, 2:].round(3)
        array([[ 0. ,  1. ],
               [-0. ,  2. ],
               [-1. ,  2.2]])
        """
        turn = Rotation.from_euler("ZX", [yaw_rad, np.radians(self.roll_deg)])
        return rigid(turn.as_matrix(), np.add(foot, [0.0, 0.0, self.height_m]))


MOUNTS: dict[str, Mount] = {
    mount.name: mount
    for mount in (
        Mount("upright", 1.7),
        Mount("tilted", 1.7, 45.0),
        Mount("upside-down", 1.7, 180.0),
        Mount("mast", 6.0),
        Mount("tripod", 1.8),
    )
}
"""The mounts by name."""
