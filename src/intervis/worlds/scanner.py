"""A turning multi-beam LiDAR: where its beams point, what comes back, what is lost."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from intervis.arrays import BoolArray, Float32Array, Float64Array, IntArray
from intervis.errors import SettingsError
from intervis.worlds.soup import LABELS
from intervis.worlds.world import Moment

HDL64_ELEVATIONS_DEG = (
    *np.linspace(2.0, -8.333333, 32).round(6).tolist(),
    *np.linspace(-8.833333, -24.8, 32).round(6).tolist(),
)
"""Two blocks of 32 beams, 1/3 and about 1/2 degree apart, as in Velodyne's HDL-64E."""


@dataclass(frozen=True)
class Scanner:
    """A LiDAR whose beams turn about z.

    Attributes
    ----------
    elevations_deg : tuple of float
        One for each beam, from above to below.
    columns : int
        Firings of each beam in a turn.
    nearest_m, farthest_m : float
        Range of what it reports.
    noise_m : float
        Standard deviation of a range.
    lost : float
        Share of returns that go missing without a cause.
    least_signal : float
        Where half of the returns drown: reflectance x cosine of incidence / range^2, 1/m^2.
    height_m : float
        Of the sensor above the road.
    roof : five floats, or None
        What of the own vehicle stands in the way, as a level rectangle: x from, x to, y from, y
        to, z, metres from the sensor; beams that meet it do not report.

    Examples
    --------
    >>> Scanner().directions().shape
    (133312, 3)
    """

    elevations_deg: tuple[float, ...] = HDL64_ELEVATIONS_DEG
    columns: int = 2083
    nearest_m: float = 1.5
    farthest_m: float = 120.0
    noise_m: float = 0.02
    lost: float = 0.02
    least_signal: float = 2.5e-6
    height_m: float = 1.73
    roof: tuple[float, float, float, float, float] | None = (-2.75, 2.25, -0.72, 0.72, -0.9)
    name: str = field(default="64 beams")

    def __post_init__(self) -> None:
        if not self.elevations_deg or self.columns < 1:
            raise SettingsError("a scanner needs at least one beam and one column.")
        if not 0 <= self.nearest_m < self.farthest_m or self.noise_m < 0:
            raise SettingsError(
                "a scanner needs 0 <= nearest_m < farthest_m and a noise_m of 0 or more."
            )

    def directions(self) -> Float64Array:
        """(beams * columns, 3) unit directions in the sensor's frame, beam by beam.

        Each beam begins straight ahead and turns to the left, as KITTI's files do.
        """
        azimuth = np.arange(self.columns) * (2 * np.pi / self.columns)
        elevation = np.radians(self.elevations_deg)[:, None]
        ways = np.stack(
            [
                np.cos(elevation) * np.cos(azimuth),
                np.cos(elevation) * np.sin(azimuth),
                np.broadcast_to(np.sin(elevation), (len(self.elevations_deg), self.columns)),
            ],
            axis=-1,
        )
        return ways.reshape(-1, 3)

    def scan(
        self, moment: Moment, pose: Float64Array, rng: np.random.Generator
    ) -> tuple[Float32Array, dict[str, NDArray[Any]]]:
        """One turn, all at one moment.

        Parameters
        ----------
        moment : Moment
            The world at the time of the scan.
        pose : (4, 4) float64 array
            world_from_velo.
        rng : numpy Generator
            Source of noise and loss; the same state gives the same scan.

        Returns
        -------
        points : (N, 3) float32 array
            Returns in the sensor's frame, metres, beam by beam.
        attributes : dict of (N,) arrays
            ``intensity`` float32 (0 to 0.99), ``ring`` int16 (0 the highest beam), ``label`` int8,
            ``object`` int64 and ``triangle`` int64 (what was hit), ``range`` float64 (without
            noise, metres).
        """
        ways_velo = self.directions()
        ways_world = ways_velo @ pose[:3, :3].T
        ranges, hits = moment.caster.closest(pose[:3, 3], ways_world, self.farthest_m)
        # Every beam draws its numbers, whether it hits or not: one loss must not shift the rest.
        noise = rng.standard_normal(len(ranges)) * self.noise_m
        luck = rng.random(len(ranges))
        cosine = np.abs(np.einsum("ij,ij->i", moment.normals[hits], ways_world))
        kept = (hits >= 0) & (ranges >= self.nearest_m) & ~self._own_vehicle(ways_velo)
        kept &= luck >= self._loss(moment, ranges, hits, cosine)
        rows = np.flatnonzero(kept)
        measured = ranges[rows] + noise[rows]
        points = (ways_velo[rows] * measured[:, None]).astype(np.float32)
        hit = hits[rows]
        strength = moment.reflectances[hit] * (0.45 + 0.55 * cosine[rows])
        return points, {
            "intensity": (np.clip(strength, 0, 0.99) * 100).round().astype(np.float32)
            / np.float32(100),
            "ring": (rows // self.columns).astype(np.int16),
            "label": moment.labels[hit],
            "object": moment.objects[hit],
            "triangle": hit,
            "range": ranges[rows],
        }

    def _own_vehicle(self, ways_velo: Float64Array) -> BoolArray:
        if self.roof is None:
            return np.zeros(len(ways_velo), np.bool_)
        x_from, x_to, y_from, y_to, z = self.roof
        down = ways_velo[:, 2] < 0
        scale = np.divide(z, ways_velo[:, 2], out=np.full(len(ways_velo), np.inf), where=down)
        x = np.where(down, ways_velo[:, 0] * np.where(down, scale, 0), np.inf)
        y = np.where(down, ways_velo[:, 1] * np.where(down, scale, 0), np.inf)
        inside: BoolArray = (x_from <= x) & (x <= x_to) & (y_from <= y) & (y <= y_to)
        return inside

    def _loss(
        self, moment: Moment, ranges: Float64Array, hits: IntArray, cosine: Float64Array
    ) -> Float64Array:
        """Probability that a return goes missing: chance, a weak signal, a mirror."""
        reach = np.where(hits >= 0, ranges, 1.0)
        signal = moment.reflectances[hits] * cosine / reach**2
        drowned = 1.0 / (1.0 + (np.maximum(signal, 1e-30) / self.least_signal) ** 3)
        mirror = np.isin(moment.labels[hits], (LABELS["window"], LABELS["glass"]))
        passed = np.where(mirror, 0.75 * (1 - cosine**8), 0.0)
        kept: Float64Array = (1 - self.lost) * (1 - drowned) * (1 - passed)
        return 1 - kept
