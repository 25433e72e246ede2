"""A turning multi-beam LiDAR: where its beams point, what comes back, what is lost."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from intervis.arrays import BoolArray, Float32Array, Float64Array, IntArray
from intervis.errors import SettingsError
from intervis.lab.worlds.triangles import LABELS
from intervis.lab.worlds.world import Moment, World

Attributes = dict[str, NDArray[Any]]


def _fan(first_deg: float, last_deg: float, beams: int) -> tuple[float, ...]:
    return tuple(np.linspace(first_deg, last_deg, beams).round(6).tolist())


@dataclass(frozen=True)
class Scanner:
    """A LiDAR whose beams turn about z.

    Attributes
    ----------
    name : str
        What it resembles.
    elevations_deg : tuple of float
        One for each beam, from above to below. As a default the two blocks of Velodyne's HDL-64E:
        32 beams 1/3 degree apart, 32 about 1/2 degree apart.
    columns : int
        Firings of each beam in a turn.
    nearest_m, farthest_m : float
        Range of what it reports.
    noise_m : float
        Standard deviation of a range.
    flicker : float
        Standard deviation of an intensity, as a share of it.
    lost : float
        Share of returns that go missing without a cause.
    least_signal : float
        Where half of the returns drown: reflectance x cosine of incidence / range^2, 1/m^2.
    roof : five floats, or None
        What of the own vehicle stands in the way, as a level rectangle: x from, x to, y from, y
        to, z, metres from the sensor; beams that meet it do not report.
    period_s : float
        Time of a turn; it matters to `sweep` alone.

    Raises
    ------
    SettingsError
        No beams, no columns, or numbers that make no sense.

    Examples
    --------
    >>> Scanner().directions().shape
    (133312, 3)
    """

    name: str = "HDL-64E"
    elevations_deg: tuple[float, ...] = _fan(2.0, -25 / 3, 32) + _fan(-53 / 6, -24.8, 32)
    columns: int = 2083
    nearest_m: float = 1.5
    farthest_m: float = 120.0
    noise_m: float = 0.02
    flicker: float = 0.18
    lost: float = 0.02
    least_signal: float = 2.5e-6
    roof: tuple[float, float, float, float, float] | None = (-2.75, 2.25, -0.72, 0.72, -0.9)
    period_s: float = 0.1

    def __post_init__(self) -> None:
        if not self.elevations_deg or self.columns < 1:
            raise SettingsError("a scanner needs at least one beam and one column.")
        if max(map(abs, self.elevations_deg)) >= 90:
            raise SettingsError("a scanner's beams must lie between -90 and 90 degrees.")
        if not 0 <= self.nearest_m < self.farthest_m:
            raise SettingsError("a scanner needs 0 <= nearest_m < farthest_m.")
        if min(self.noise_m, self.flicker, self.least_signal) < 0 or not 0 <= self.lost <= 1:
            raise SettingsError(
                "a scanner's noise_m, flicker and least_signal must be 0 or more, lost 0 to 1."
            )

    def directions(self) -> Float64Array:
        """(beams * columns, 3) unit directions in the sensor's frame, beam by beam.

        Each beam begins straight ahead and turns to the left, as KITTI's files do.
        """
        azimuth_rad = np.arange(self.columns) * (2 * np.pi / self.columns)
        elevation_rad = np.radians(self.elevations_deg)[:, None]
        ways = np.empty((len(self.elevations_deg), self.columns, 3))
        ways[..., 0] = np.cos(elevation_rad) * np.cos(azimuth_rad)
        ways[..., 1] = np.cos(elevation_rad) * np.sin(azimuth_rad)
        ways[..., 2] = np.sin(elevation_rad)
        return ways.reshape(-1, 3)

    def scan(
        self, moment: Moment, pose: Float64Array, rng: np.random.Generator
    ) -> tuple[Float32Array, Attributes]:
        """One turn, all of it at one moment.

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
            ``object`` int64 and ``triangle`` int64 (what was hit), ``range`` float64 (metres,
            without noise), ``time`` float32 (seconds from the middle of the turn; 0 here).
        """
        ways_velo = self.directions()
        ways_world = ways_velo @ pose[:3, :3].T
        ranges, hits = moment.caster.closest(pose[:3, 3], ways_world, self.farthest_m)
        cosines = _incidence(moment, hits, ways_world)
        times_s = np.zeros(len(ranges))
        return self._returns(moment, ways_velo, ranges, hits, cosines, times_s, rng)

    def sweep(
        self, world: World, time_s: float, rng: np.random.Generator, sectors: int = 36
    ) -> tuple[Float32Array, Attributes]:
        """One turn in its time: the vehicle and everybody else move on while it lasts.

        The turn begins and ends behind; straight ahead is looked at `time_s`. Each column is fired
        from the vehicle's place at its own time; the movers stand still for a sector. Points are in
        the sensor's frame of their own firing, as a sensor without correction reports them.

        Parameters
        ----------
        world : World
            With its vehicle.
        time_s : float
            Middle of the turn.
        rng, sectors
            Source of noise; in how many steps the movers move.

        Returns
        -------
        points, attributes
            As `scan` returns them.
        """
        shape = (len(self.elevations_deg), self.columns)
        turn = np.arange(self.columns) / self.columns
        column_times_s = np.where(turn < 0.5, turn, turn - 1) * self.period_s
        poses = np.stack([world.vehicle_pose_at(time_s + dt) for dt in column_times_s])
        ways_velo = self.directions().reshape(*shape, 3)
        ways_world = np.einsum("cij,bcj->bci", poses[:, :3, :3], ways_velo)
        origins = np.broadcast_to(poses[:, :3, 3], (*shape, 3))
        ranges, hits, cosines = np.empty(shape), np.empty(shape, np.int64), np.empty(shape)
        for columns in np.array_split(np.argsort(column_times_s), sectors):
            if not len(columns):
                continue
            moment = world.at(time_s + float(column_times_s[columns].mean()))
            ways = ways_world[:, columns].reshape(-1, 3)
            found = moment.caster.closest(origins[:, columns].reshape(-1, 3), ways, self.farthest_m)
            ranges[:, columns] = found[0].reshape(shape[0], -1)
            hits[:, columns] = found[1].reshape(shape[0], -1)
            cosines[:, columns] = _incidence(moment, found[1], ways).reshape(shape[0], -1)
        return self._returns(
            moment,
            ways_velo.reshape(-1, 3),
            ranges.ravel(),
            hits.ravel(),
            cosines.ravel(),
            np.broadcast_to(column_times_s, shape).ravel(),
            rng,
        )

    def _returns(
        self,
        moment: Moment,
        ways_velo: Float64Array,
        ranges: Float64Array,
        hits: IntArray,
        cosines: Float64Array,
        times_s: Float64Array,
        rng: np.random.Generator,
    ) -> tuple[Float32Array, Attributes]:
        """What the sensor makes of its hits: noise, loss, intensity."""
        # Every beam draws its numbers, whether it hits or not: one loss must not shift the rest.
        noise_m = rng.standard_normal(len(ranges)) * self.noise_m
        luck = rng.random(len(ranges))
        flicker = 1 + self.flicker * rng.standard_normal(len(ranges))
        rows = np.flatnonzero(
            (hits >= 0) & (ranges >= self.nearest_m) & ~self._own_vehicle(ways_velo)
        )
        gone = self._loss(moment, ranges[rows], hits[rows], cosines[rows])
        rows = rows[luck[rows] >= gone]
        hit = hits[rows]
        points = ways_velo[rows] * (ranges[rows] + noise_m[rows])[:, None]
        strength = moment.reflectances[hit] * (0.45 + 0.55 * cosines[rows]) * flicker[rows]
        percent = (np.clip(strength, 0, 0.99) * 100).round().astype(np.float32)
        return points.astype(np.float32), {
            "intensity": percent / np.float32(100),
            "ring": (rows // self.columns).astype(np.int16),
            "label": moment.labels[hit],
            "object": moment.objects[hit],
            "triangle": hit,
            "range": ranges[rows],
            "time": times_s[rows].astype(np.float32),
        }

    def _own_vehicle(self, ways_velo: Float64Array) -> BoolArray:
        if self.roof is None:
            return np.zeros(len(ways_velo), np.bool_)
        x_from, x_to, y_from, y_to, z = self.roof
        down = np.minimum(ways_velo[:, 2], -1e-9)
        x, y = ways_velo[:, 0] * (z / down), ways_velo[:, 1] * (z / down)
        return np.asarray((x_from <= x) & (x <= x_to) & (y_from <= y) & (y <= y_to))

    def _loss(
        self, moment: Moment, ranges: Float64Array, hits: IntArray, cosines: Float64Array
    ) -> Float64Array:
        """Probability that a return goes missing: by chance, too weak, mirrored away by glass."""
        signal = moment.reflectances[hits] * cosines / np.maximum(ranges, 1e-3) ** 2
        heard = signal**3 / np.maximum(signal**3 + self.least_signal**3, 1e-300)
        glassy = np.isin(moment.labels[hits], (LABELS["window"], LABELS["glass"]))
        thrown_back = np.where(glassy, 1 - 0.75 * (1 - cosines**8), 1.0)
        return np.asarray(1 - (1 - self.lost) * heard * thrown_back)


def _incidence(moment: Moment, hits: IntArray, ways_world: Float64Array) -> Float64Array:
    """Cosine between each beam and the normal of what it hits; 0 where it hits nothing."""
    cosines = np.zeros(len(hits))
    hit = np.flatnonzero(hits >= 0)
    cosines[hit] = np.abs(np.einsum("ij,ij->i", moment.normals[hits[hit]], ways_world[hit]))
    return cosines


SCANNERS: dict[str, Scanner] = {
    "hdl-64e": Scanner(),
    "hdl-32e": Scanner("HDL-32E", _fan(10.67, -30.67, 32), 2160, 1.0, 100.0, roof=None),
    "vlp-16": Scanner("VLP-16", _fan(15.0, -15.0, 16), 1800, 0.5, 100.0, 0.03, roof=None),
    "os1-128": Scanner("OS1-128", _fan(22.5, -22.5, 128), 1024, 0.5, 120.0, roof=None),
}
"""Sensors by name: beams, columns and ranges as their makers state them, at ten turns a second."""
