"""Sensor model: field of view, beams, range limits and beam divergence."""

from dataclasses import dataclass, fields
from math import isfinite
from numbers import Integral, Real

import numpy as np

from intervis.arguments import object_of, shown
from intervis.arrays import Float64Array, FloatArray, IntArray, checked_points, finite_rows
from intervis.errors import SettingsError
from intervis.sight.kernels.beam_pattern import list_by_cell, neighbour_angles
from intervis.sight.projected_scan import ProjectedScan, project_scan

NO_RETURN_M = 0.1
"""Nearer rows are beams without a return: (0, 0, 0), or an offset of the calibration."""
MIN_RETURNS = 100
SPACING_SAMPLES = 600
IRREGULAR = 2.6
"""In a grid of beams, the spacings beside and above a beam multiply to its solid angle. Where the
ratio of the two scatters more than this (upper to lower quartile) the returns lie along curves (a
rosette): the spacing grows by the ratio, so that the gaps between the curves close."""
SEARCH_CELLS_DEG = (1.0, 4.0)
"""Neighbours are searched in cells of this size, first in the smaller ones."""


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
        object_of(self.name, str, "a sensor's name")
        for field in fields(self)[1:]:
            value: object = getattr(self, field.name)
            if isinstance(value, bool) or not isinstance(value, Real) or not _is_finite(value):
                raise SettingsError(
                    f"a sensor's {field.name} must be a number, got {shown(value)}."
                )
            if field.name == "beams" and not isinstance(value, Integral):
                raise SettingsError(f"a sensor's beams must be a whole number, got {shown(value)}.")
            # Numbers of other types overflow where they are compared.
            number = int(value) if isinstance(value, Integral) else float(value)
            object.__setattr__(self, field.name, number)
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


def _is_finite(value: Real) -> bool:
    try:
        return isfinite(value)
    except OverflowError:  # a whole number that no float holds
        return False


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
    object_of(name, str, "the name of a sensor")
    for known, sensor in SENSORS.items():
        if known.lower() == name.lower():
            return sensor
    raise SettingsError(f"there is no sensor {shown(name)}; choose one of {', '.join(SENSORS)}.")


def sensor_of_scan(points_velo: FloatArray) -> Sensor:
    """The sensor of a scan, estimated from angles and ranges of its returns.

    The spacing of the beams is the median angle between neighbouring returns, beside and above
    each other. Missing, doubled or reordered returns do not change it.

    Parameters
    ----------
    points_velo : (N, 3) float array
        In the sensor's frame, metres; rows that are not finite are left out.

    Returns
    -------
    Sensor
        Named "derived". `GENERIC` for fewer than 100 returns, or where returns have no neighbours.

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
    points = checked_points(points_velo, "points_velo")
    return sensor_of_projected(project_scan(points[finite_rows(points)]))


def sensor_of_projected(scan: ProjectedScan) -> Sensor:
    """The sensor of a projected scan; see `sensor_of_scan`."""
    hits = np.flatnonzero(scan.range_m > NO_RETURN_M)
    if len(hits) < MIN_RETURNS:
        return GENERIC
    beside_deg, above_deg = _spacings_deg(scan, hits)
    if not beside_deg > 0.0 and not above_deg > 0.0:
        return GENERIC
    # Beams do not leave one point: near returns are seen at other elevations than far ones.
    range_m = scan.range_m[hits]
    far = np.flatnonzero(range_m >= _quantile(range_m, 0.2))[:: max(1, len(hits) // 20_000)]
    sine = scan.xyz[2, hits[far]] / range_m[far]
    elevation_deg = np.degrees(np.arcsin(np.clip(sine, -1.0, 1.0)))
    lowest, highest = _quantile(elevation_deg, 0.001), _quantile(elevation_deg, 0.999)
    beside_deg = beside_deg if beside_deg > 0.0 else above_deg
    if not above_deg > 0.0 or highest - lowest < 0.5 * above_deg:
        # One ring: it observes nothing above and below itself but the width of a beam.
        middle, half = float(np.clip(0.5 * (lowest + highest), -89.0, 89.0)), 0.5 * beside_deg
        lowest, highest, beams = middle - half, middle + half, 1
    else:
        beams = _beam_count(elevation_deg, lowest, highest, above_deg)
    return Sensor(
        "derived",
        beams,
        max(lowest, -90.0),
        min(highest, 90.0),
        float(np.clip(beside_deg, 0.02, 5.0)),
        min(0.5, float(range_m.min())),
        max(GENERIC.max_range_m, float(range_m.max())),
        GENERIC.divergence_deg,
    )


def _spacings_deg(scan: ProjectedScan, hits: IntArray) -> tuple[float, float]:
    """Median angles to the nearest neighbours beside and above; NaN where few have one."""
    azimuth, elevation = scan.azimuth, scan.elevation
    picked = hits[np.linspace(0, len(hits) - 1, min(len(hits), SPACING_SAMPLES)).astype(np.int64)]
    found = [np.nan, np.nan]
    for cell_deg in SEARCH_CELLS_DEG:
        columns, rows = round(360.0 / cell_deg), round(229.0 / cell_deg)
        lists = list_by_cell(azimuth, elevation, hits, picked, columns, rows)
        angles = np.empty((3, len(picked)))
        neighbour_angles(azimuth, elevation, *lists, columns, rows, picked, *angles)
        for n, angle in enumerate(np.degrees(angles[:2])):
            known = angle[np.isfinite(angle)]
            if np.isnan(found[n]) and len(known) >= 0.5 * len(picked):
                found[n] = float(np.median(known))
        if np.isfinite(found).all():
            break
    beside, above = found
    known = np.isfinite(angles).all(axis=0)
    if known.any():
        scatter = angles[2, known] / (angles[0] * angles[1])[known]
        low, high = _quantile(scatter, 0.25), _quantile(scatter, 0.75)
        if high > IRREGULAR * low:
            return beside * max(high, 1.0), above * max(high, 1.0)
    return beside, above


def _beam_count(elevation_deg: FloatArray, lowest: float, highest: float, spacing: float) -> int:
    """Beams of a spinning sensor, as peaks in the histogram of elevations.

    Without clear peaks (beams with different origins, as in a calibrated HDL-64E) the beams have
    the spacing between neighbouring returns.
    """
    bins = max(1, int((highest - lowest) / 0.05))
    count, _ = np.histogram(elevation_deg, bins=bins, range=(lowest - 0.025, highest + 0.025))
    full = count > 0.5 * count.mean()
    starts = int((full[1:] & ~full[:-1]).sum() + full[0])
    clear = 1.0 - full.mean()
    if clear > 0.5 and starts >= 4:
        return starts
    return max(2, round((highest - lowest) / spacing) + 1)


def _quantile(values: Float64Array, fraction: float) -> float:
    """`np.quantile` of finite values, to the bit, in a third of the time."""
    at = (len(values) - 1) * fraction
    lower = int(at)
    upper = min(lower + 1, len(values) - 1)
    low, high = np.partition(values, (lower, upper))[[lower, upper]]
    share = at - lower
    return float(low + (high - low) * share if share < 0.5 else high - (high - low) * (1.0 - share))
