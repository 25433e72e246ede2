"""A spinning multi-beam LiDAR: beam directions, noise, intensity and dropout."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from intervis.arrays import BoolArray, Float32Array, Float64Array, IntArray
from intervis.errors import SettingsError
from intervis.lab.worlds.echoes import intensity, loss_probability
from intervis.lab.worlds.world import Snapshot, World

Attributes = dict[str, NDArray[Any]]


def _fan(first_deg: float, last_deg: float, beams: int) -> tuple[float, ...]:
    return tuple(np.linspace(first_deg, last_deg, beams).round(6).tolist())


@dataclass(frozen=True)
class Scanner:
    """A LiDAR whose beams spin about z.

    Attributes
    ----------
    name : str
        Model that it resembles.
    elevations_deg : tuple of float
        One for each beam, from highest to lowest. The default is the two blocks of Velodyne's
        HDL-64E: 32 beams 1/3 degree apart, 32 about 1/2 degree apart.
    columns : int
        Firings of each beam per revolution.
    nearest_m, farthest_m : float
        Limits of the reported ranges.
    noise_m : float
        Standard deviation of the range noise.
    intensity_noise : float
        Standard deviation of the intensity, as a fraction of it.
    dropout : float
        Fraction of returns that are missing at random.
    least_signal : float
        Signal (reflectance x cosine of incidence / range^2, 1/m^2) at which half of the returns are
        lost.
    roof : five floats, or None
        Roof of the own vehicle as a level rectangle: x from, x to, y from, y to, z, in metres from
        the sensor; beams that hit it give no return.
    period_s : float
        Time of a revolution; used by `sweep` only.

    Raises
    ------
    SettingsError
        No beams, no columns, or a number out of range.

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
    intensity_noise: float = 0.18
    dropout: float = 0.02
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
        if (
            min(self.noise_m, self.intensity_noise, self.least_signal) < 0
            or not 0 <= self.dropout <= 1
        ):
            raise SettingsError(
                "a scanner's noise_m, intensity_noise and least_signal must be 0 or more"
                " and its dropout 0 to 1."
            )

    def directions(self) -> Float64Array:
        """(beams * columns, 3) unit directions in the sensor frame, beam by beam.

        Each beam starts at azimuth 0 (x) and turns towards y, as KITTI's files do.
        """
        azimuth_rad = np.arange(self.columns) * (2 * np.pi / self.columns)
        elevation_rad = np.radians(self.elevations_deg)[:, None]
        directions = np.empty((len(self.elevations_deg), self.columns, 3))
        directions[..., 0] = np.cos(elevation_rad) * np.cos(azimuth_rad)
        directions[..., 1] = np.cos(elevation_rad) * np.sin(azimuth_rad)
        directions[..., 2] = np.sin(elevation_rad)
        return directions.reshape(-1, 3)

    def scan(
        self, snapshot: Snapshot, pose: Float64Array, rng: np.random.Generator
    ) -> tuple[Float32Array, Attributes]:
        """One revolution, all beams at the same time.

        Parameters
        ----------
        snapshot : Snapshot
            The world at the time of the scan.
        pose : (4, 4) float64 array
            world_from_velo.
        rng : numpy Generator
            Source of noise and dropout; the same state gives the same scan.

        Returns
        -------
        points : (N, 3) float32 array
            Returns in the sensor frame, metres, beam by beam.
        attributes : dict of (N,) arrays
            ``intensity`` float32 (0 to 0.99), ``ring`` int16 (0 the highest beam), ``label`` int8,
            ``object`` int64 and ``triangle`` int64 of the surface hit, ``range`` float64 (metres,
            without noise), ``time`` float32 (seconds from the middle of the revolution; 0 here).
        """
        directions_velo = self.directions()
        directions_world = directions_velo @ pose[:3, :3].T
        ranges, hits = snapshot.caster.closest(pose[:3, 3], directions_world, self.farthest_m)
        cosines = _incidence(snapshot, hits, directions_world)
        times_s = np.zeros(len(ranges))
        return self._returns(snapshot, directions_velo, ranges, hits, cosines, times_s, rng)

    def sweep(
        self, world: World, time_s: float, rng: np.random.Generator, sectors: int = 36
    ) -> tuple[Float32Array, Attributes]:
        """One revolution over `period_s`, during which vehicle and actors move.

        The revolution begins and ends at the rear; the beams point ahead at `time_s`. Each column
        is fired from the vehicle's pose at its own time; actors are static within a sector. Points
        are in the sensor frame at their own firing time (no motion compensation).

        Parameters
        ----------
        world : World
            With its vehicle.
        time_s : float
            Middle of the revolution.
        rng : numpy Generator
            Source of noise and dropout.
        sectors : int
            Number of steps in which the actors move.

        Returns
        -------
        points, attributes
            As `scan` returns them.
        """
        shape = (len(self.elevations_deg), self.columns)
        revolution = np.arange(self.columns) / self.columns
        column_times_s = np.where(revolution < 0.5, revolution, revolution - 1) * self.period_s
        poses = np.stack([world.vehicle_pose_at(time_s + dt) for dt in column_times_s])
        directions_velo = self.directions().reshape(*shape, 3)
        directions_world = np.einsum("cij,bcj->bci", poses[:, :3, :3], directions_velo)
        origins = np.broadcast_to(poses[:, :3, 3], (*shape, 3))
        ranges, hits, cosines = np.empty(shape), np.empty(shape, np.int64), np.empty(shape)
        for columns in np.array_split(np.argsort(column_times_s), sectors):
            if not len(columns):
                continue
            snapshot = world.at(time_s + float(column_times_s[columns].mean()))
            directions = directions_world[:, columns].reshape(-1, 3)
            found = snapshot.caster.closest(
                origins[:, columns].reshape(-1, 3), directions, self.farthest_m
            )
            ranges[:, columns] = found[0].reshape(shape[0], -1)
            hits[:, columns] = found[1].reshape(shape[0], -1)
            cosines[:, columns] = _incidence(snapshot, found[1], directions).reshape(shape[0], -1)
        return self._returns(
            snapshot,
            directions_velo.reshape(-1, 3),
            ranges.ravel(),
            hits.ravel(),
            cosines.ravel(),
            np.broadcast_to(column_times_s, shape).ravel(),
            rng,
        )

    def _returns(
        self,
        snapshot: Snapshot,
        directions_velo: Float64Array,
        ranges: Float64Array,
        hits: IntArray,
        cosines: Float64Array,
        times_s: Float64Array,
        rng: np.random.Generator,
    ) -> tuple[Float32Array, Attributes]:
        """Returns of the hits, with noise, dropout and intensity."""
        # Every beam draws random numbers, hit or not, so that one dropout does not change the rest.
        noise_m = rng.standard_normal(len(ranges)) * self.noise_m
        draws = rng.random(len(ranges))
        intensity_factor = 1 + self.intensity_noise * rng.standard_normal(len(ranges))
        rows = np.flatnonzero(
            (hits >= 0) & (ranges >= self.nearest_m) & ~self._hits_own_roof(directions_velo)
        )
        missing = loss_probability(
            snapshot.reflectances[hits[rows]],
            snapshot.labels[hits[rows]],
            ranges[rows],
            cosines[rows],
            dropout=self.dropout,
            least_signal=self.least_signal,
        )
        rows = rows[draws[rows] >= missing]
        hit = hits[rows]
        points = directions_velo[rows] * (ranges[rows] + noise_m[rows])[:, None]
        return points.astype(np.float32), {
            "intensity": intensity(
                snapshot.reflectances[hit], cosines[rows], intensity_factor[rows]
            ),
            "ring": (rows // self.columns).astype(np.int16),
            "label": snapshot.labels[hit],
            "object": snapshot.objects[hit],
            "triangle": hit,
            "range": ranges[rows],
            "time": times_s[rows].astype(np.float32),
        }

    def _hits_own_roof(self, directions_velo: Float64Array) -> BoolArray:
        if self.roof is None:
            return np.zeros(len(directions_velo), np.bool_)
        x_from, x_to, y_from, y_to, z = self.roof
        down = np.minimum(directions_velo[:, 2], -1e-9)
        x, y = directions_velo[:, 0] * (z / down), directions_velo[:, 1] * (z / down)
        return np.asarray((x_from <= x) & (x <= x_to) & (y_from <= y) & (y <= y_to))


def _incidence(snapshot: Snapshot, hits: IntArray, directions_world: Float64Array) -> Float64Array:
    """Cosine between each beam and the normal of its hit; 0 where it hits nothing."""
    cosines = np.zeros(len(hits))
    hit = np.flatnonzero(hits >= 0)
    cosines[hit] = np.abs(np.einsum("ij,ij->i", snapshot.normals[hits[hit]], directions_world[hit]))
    return cosines


SCANNERS: dict[str, Scanner] = {
    "hdl-64e": Scanner(),
    "hdl-32e": Scanner("HDL-32E", _fan(10.67, -30.67, 32), 2160, 1.0, 100.0, roof=None),
    "vlp-16": Scanner("VLP-16", _fan(15.0, -15.0, 16), 1800, 0.5, 100.0, 0.03, roof=None),
    "os1-128": Scanner("OS1-128", _fan(22.5, -22.5, 128), 1024, 0.5, 120.0, roof=None),
}
"""Sensors by name: beams, columns and ranges from the data sheets, at 10 Hz."""
