"""Mounts: where a scanner stands above the ground, or on a vehicle."""

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


@dataclass(frozen=True)
class VehicleMount:
    """Place on a vehicle, in its frame: x forward, y left, z up, from below the rear axle.

    Attributes
    ----------
    name : str
    place_m : three floats
    roll_pitch_yaw_deg : three floats
        About the fixed axes x, y, z, in this order; a positive pitch looks down.
    """

    name: str
    place_m: tuple[float, float, float]
    roll_pitch_yaw_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def ego_from_scanner(self) -> Float64Array:
        """(4, 4).

        Examples
        --------
        >>> VEHICLE_MOUNTS["left"].ego_from_scanner[:3, :3].round(2).tolist()[0]  # x across
        [0.0, -1.0, 0.0]
        """
        turn = Rotation.from_euler("xyz", self.roll_pitch_yaw_deg, degrees=True)
        return rigid(turn.as_matrix(), self.place_m)


VEHICLE_MOUNTS: dict[str, VehicleMount] = {
    mount.name: mount
    for mount in (
        VehicleMount("roof", (0.94, 0.0, 1.84)),
        VehicleMount("under", (0.94, 0.0, 1.73), (180.0, 0.0, 0.0)),
        VehicleMount("left", (0.9, 0.7, 1.6), (0.0, 40.0, 90.0)),
        VehicleMount("right", (0.9, -0.7, 1.6), (0.0, 40.0, -90.0)),
        VehicleMount("front", (3.75, 0.0, 0.6)),
        VehicleMount("rear", (-1.05, 0.0, 0.7), (0.0, 0.0, 180.0)),
    )
}
"""The mounts of a vehicle by name: on the roof, upside down below that one, tilted to the sides, at
the bumpers."""

GROUND_MOUNTS = ("mast", "tripod")
"""The mounts that stand on the ground, beside the street."""

BODY_M = (
    ((-1.0, -0.9, 0.25), (3.7, 0.9, 0.95)),
    ((-0.9, -0.75, 0.95), (1.9, 0.75, 1.5)),
)
"""Lower and upper corners of the own vehicle's body and cabin, in its frame."""
