"""Sensor model: field of view, beams, range limits and beam divergence."""

from dataclasses import dataclass, fields
from math import isfinite
from numbers import Integral, Real

import numpy as np

from intervis.arrays import FloatArray
from intervis.errors import SettingsError


@dataclass(frozen=True)
class Sensor:
    """A spinning LiDAR, in metres and degrees.

    Attributes
    ----------
    name : str
    beams : int
        Number of laser beams.
    lowest_deg, highest_deg : float
        Elevation of the lowest and the highest beam, degrees above the sensor's xy plane.
    azimuth_step_deg : float
        Azimuth between two firings of one beam at the usual rotation rate.
    min_range_m, max_range_m : float
        Range limits of returns.
    divergence_deg : float
        Full opening angle of one beam.

    Raises
    ------
    SettingsError
        A value is out of range.

    Examples
    --------
    >>> HDL_64E.beams, round(HDL_64E.beam_spacing_deg, 2)
    (64, 0.43)
    """

    name: str
    beams: int
    lowest_deg: float
    highest_deg: float
    azimuth_step_deg: float
    min_range_m: float
    max_range_m: float
    divergence_deg: float

    def __post_init__(self) -> None:
        for field in fields(self)[1:]:
            value: object = getattr(self, field.name)
            if isinstance(value, bool) or not isinstance(value, Real) or not isfinite(value):
                raise SettingsError(f"a sensor's {field.name} must be a number, got {value!r}.")
            if field.name == "beams" and not isinstance(value, Integral):
                raise SettingsError(f"a sensor's beams must be a whole number, got {value!r}.")
        if self.beams < 1:
            raise SettingsError(f"a sensor needs one beam at least, got {self.beams}.")
        if not -90.0 <= self.lowest_deg < self.highest_deg <= 90.0:
            raise SettingsError(
                "a sensor's field of view must be -90 <= lowest_deg < highest_deg <= 90, got"
                f" {self.lowest_deg} and {self.highest_deg}."
            )
        if not 0.0 < self.azimuth_step_deg <= 10.0:
            raise SettingsError(
                f"azimuth_step_deg must be between 0 and 10, got {self.azimuth_step_deg}."
            )
        if not 0.0 <= self.min_range_m < self.max_range_m:
            raise SettingsError(
                "a sensor's ranges must be 0 <= min_range_m < max_range_m, got"
                f" {self.min_range_m} and {self.max_range_m}."
            )
        if not 0.0 <= self.divergence_deg <= 5.0:
            raise SettingsError(
                f"divergence_deg must be between 0 and 5, got {self.divergence_deg}."
            )

    @property
    def beam_spacing_deg(self) -> float:
        """Mean angle between neighbouring beams."""
        return (self.highest_deg - self.lowest_deg) / max(self.beams - 1, 1)


# From the manufacturers' data sheets: field of view, range on a reflective target, rate at 10 Hz.
HDL_64E = Sensor("HDL-64E", 64, -24.8, 2.0, 0.173, 0.9, 120.0, 0.11)
HDL_32E = Sensor("HDL-32E", 32, -30.67, 10.67, 0.166, 0.9, 100.0, 0.16)
VLP_16 = Sensor("VLP-16", 16, -15.0, 15.0, 0.2, 0.5, 100.0, 0.17)
OS1_128 = Sensor("OS1-128", 128, -22.5, 22.5, 0.352, 0.5, 120.0, 0.35)
GENERIC = Sensor("generic", 64, -30.0, 30.0, 0.2, 0.5, 120.0, 0.2)

SENSORS: dict[str, Sensor] = {
    sensor.name: sensor for sensor in (HDL_64E, HDL_32E, VLP_16, OS1_128, GENERIC)
}
"""The presets by name."""


def sensor_named(name: str) -> Sensor:
    """The preset of that name, upper or lower case.

    Raises
    ------
    SettingsError
        There is none.

    Examples
    --------
    >>> sensor_named("vlp-16").beams
    16
    """
    for known, sensor in SENSORS.items():
        if known.lower() == name.lower():
            return sensor
    raise SettingsError(f"there is no sensor {name!r}; choose one of {', '.join(SENSORS)}.")


def sensor_of_scan(points_velo: FloatArray) -> Sensor:
    """The sensor of a scan, estimated from field of view, spacing and range of its returns.

    Parameters
    ----------
    points_velo : (N, 3) float array
        Finite points in the sensor's frame, metres.

    Returns
    -------
    Sensor
        Named "derived". Beams are counted as peaks of the elevation histogram; the azimuth step
        spreads the returns evenly over the beams. `GENERIC` for fewer than 500 returns.

    Examples
    --------
    >>> azimuth, elevation = np.meshgrid(np.radians(np.arange(0, 360, 0.4)),
    ...                                  np.radians(np.linspace(-15, 15, 16)))
    >>> rays = np.stack([np.cos(azimuth) * np.cos(elevation),
    ...                  np.sin(azimuth) * np.cos(elevation), np.sin(elevation)], axis=-1)
    >>> sensor = sensor_of_scan(20 * rays.reshape(-1, 3))
    >>> sensor.beams, round(sensor.highest_deg), round(sensor.azimuth_step_deg, 1)
    (16, 15, 0.4)
    """
    sample = points_velo[:: max(1, len(points_velo) // 20_000)].astype(np.float64)
    range_m = np.sqrt(np.einsum("ij,ij->i", sample, sample))
    sample, range_m = sample[range_m > 0.1], range_m[range_m > 0.1]
    if len(sample) < 500:
        return GENERIC
    elevation_deg = np.degrees(np.arcsin(np.clip(sample[:, 2] / range_m, -1.0, 1.0)))
    lowest, highest = np.quantile(elevation_deg, [0.001, 0.999])
    if highest - lowest < 0.5:
        return GENERIC
    beams = _beam_count(elevation_deg, lowest, highest)
    # Beams into the sky have no return: the true step is somewhat smaller than this estimate.
    step = 360.0 * beams / len(points_velo)
    return Sensor(
        "derived",
        beams,
        float(lowest),
        float(highest),
        float(np.clip(step, 0.05, 2.0)),
        min(0.5, float(range_m.min())),
        max(GENERIC.max_range_m, float(range_m.max())),
        GENERIC.divergence_deg,
    )


def _beam_count(elevation_deg: FloatArray, lowest: float, highest: float) -> int:
    """Beams of a spinning sensor, as peaks in the histogram of elevations.

    Without clear peaks (beams with different origins, as in a calibrated HDL-64E) one beam per 0.42
    degrees is assumed.
    """
    bins = max(8, int((highest - lowest) / 0.05))
    count, _ = np.histogram(elevation_deg, bins=bins, range=(lowest - 0.025, highest + 0.025))
    full = count > 0.5 * count.mean()
    starts = int((full[1:] & ~full[:-1]).sum() + full[0])
    clear = 1.0 - full.mean()
    if clear > 0.5 and starts >= 4:
        return starts
    return max(4, round((highest - lowest) / 0.42))
