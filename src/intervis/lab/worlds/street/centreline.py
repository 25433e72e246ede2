"""The centreline of a street: coordinates along and across it as places in space."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from intervis.arrays import Float64Array
from intervis.lab.worlds import shapes
from intervis.transform import rigid

STEP_M = 0.1


@dataclass(frozen=True, eq=False)
class Centreline:
    """A smooth curve with bends and undulations.

    Coordinates in metres: `s` along it, `d` across it (positive to the left), `h` above it.

    Parameters
    ----------
    first_m, last_m : float
        Start and end; at 0 the line passes through the origin with heading x.
    bends : tuple of (radians, metres) pairs
        Amplitude of the heading and wavelength.
    waves : tuple of (metres, metres) pairs
        Height of an undulation and wavelength.
    hill : (metres, metres, metres)
        Height, start and length of the hill at the end.

    Examples
    --------
    >>> straight = Centreline(-10.0, 50.0, bends=(), waves=(), hill=(0.0, 0.0, 1.0))
    >>> straight.points(20.0, 2.0, 1.0).round(6) + 0.0
    array([20.,  2.,  1.])
    """

    first_m: float
    last_m: float
    bends: tuple[tuple[float, float], ...] = ((0.10, 260.0), (0.03, 97.0))
    waves: tuple[tuple[float, float], ...] = ((0.16, 75.0), (0.25, 190.0))
    hill: tuple[float, float, float] = (6.0, 260.0, 110.0)
    _table: Float64Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        # The position is the integral of the heading, by the midpoint rule on a fixed grid.
        lowest = int(np.floor(self.first_m / STEP_M)) - 1
        highest = int(np.ceil(self.last_m / STEP_M)) + 1
        grid = np.arange(lowest, highest + 1) * STEP_M
        heading = self.heading(grid[:-1] + STEP_M / 2)
        x = np.concatenate([[0.0], np.cumsum(np.cos(heading))]) * STEP_M
        y = np.concatenate([[0.0], np.cumsum(np.sin(heading))]) * STEP_M
        table = np.stack([grid, x - x[-lowest], y - y[-lowest]])
        object.__setattr__(self, "_table", table)

    def heading(self, s: ArrayLike) -> Float64Array:
        """Heading at `s`, radians from x towards y."""
        along = np.asarray(s, dtype=np.float64)
        total = np.zeros_like(along)
        for swing, length in self.bends:
            total = total + swing * np.sin(2 * np.pi * along / length)
        return total

    def height(self, s: ArrayLike) -> Float64Array:
        """Height of the line at `s`, metres; 0 with slope 0 at the origin."""
        along = np.asarray(s, dtype=np.float64)
        total = np.zeros_like(along)
        for rise, length in self.waves:
            total = total + rise * (1 - np.cos(2 * np.pi * along / length)) / 2
        rise, start, length = self.hill
        climb = np.clip((along - start) / length, 0, 1)
        return total + rise * climb**2 * (3 - 2 * climb)

    def slope(self, s: ArrayLike) -> Float64Array:
        """Slope of the line at `s`, metres per metre."""
        along = np.asarray(s, dtype=np.float64)
        return (self.height(along + 0.05) - self.height(along - 0.05)) / 0.1

    def points(self, s: ArrayLike, d: ArrayLike = 0.0, h: ArrayLike = 0.0) -> Float64Array:
        """(..., 3) points at `s` along, `d` across (to the left) and `h` above the line.

        Beyond its ends the line is straight.
        """
        along, across, above = np.broadcast_arrays(*(np.asarray(part, float) for part in (s, d, h)))
        grid, x, y = self._table
        within = np.clip(along, grid[0], grid[-1])
        heading, beyond = self.heading(within), along - within
        cos, sin = np.cos(heading), np.sin(heading)
        return np.stack(
            [
                np.interp(within, grid, x) + beyond * cos - across * sin,
                np.interp(within, grid, y) + beyond * sin + across * cos,
                self.height(along) + above,
            ],
            axis=-1,
        )

    def pose(self, s: float, d: float = 0.0, h: float = 0.0, yaw_rad: float = 0.0) -> Float64Array:
        """(4, 4) frame at a point: x along the line and its slope, yawed by `yaw_rad`, y level."""
        heading_rad = float(self.heading(s)) + yaw_rad
        pitch_rad = np.arctan(float(self.slope(s))) * np.cos(yaw_rad)
        rotation = Rotation.from_euler("ZY", [heading_rad, -pitch_rad])
        return rigid(rotation.as_matrix(), self.points(s, d, h))

    def upright(
        self, s: float, d: float = 0.0, h: float = 0.0, yaw_rad: float = 0.0
    ) -> Float64Array:
        """(4, 4) frame at a point like `pose`, but z vertical: for houses, trees and people."""
        return shapes.upright_rotation(float(self.heading(s)) + yaw_rad, self.points(s, d, h))
