"""What a scanner on a mast reaches: field of view, range, and returns to expect on an object."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from intervis.arrays import BoolArray, Float64Array
from intervis.errors import SettingsError
from intervis.sight import Sensor
from intervis.sight.query_checks import finite_number, positive_length

OBJECTS = {
    "car": (4.5, 1.8, 1.5),
    "bicycle": (1.8, 0.6, 1.7),
    "pedestrian": (0.6, 0.5, 1.75),
}
"""Length, width and height of objects, metres."""
LARGEST_M = 100.0
LEAST_SPACING_DEG = 1e-6
"""Of beams: far below that of any scanner or camera, and so wide that returns can be counted."""


def object_size(text: str) -> tuple[float, float, float]:
    """Length, width and height of an object from its name or from ``L,W,H``, metres.

    Raises
    ------
    SettingsError
        It is neither.

    Examples
    --------
    >>> object_size("car"), object_size("12,2.5,3.2")
    ((4.5, 1.8, 1.5), (12.0, 2.5, 3.2))
    """
    if text in OBJECTS:
        return OBJECTS[text]
    try:
        length, width, height = (float(part) for part in text.split(","))
    except ValueError:
        length = width = height = np.nan
    if not all(0.0 < edge <= LARGEST_M for edge in (length, width, height)):  # nor is NaN
        raise SettingsError(
            f"an object is {', '.join(OBJECTS)}, or L,W,H in metres up to {LARGEST_M:g}, got"
            f" {text!r}."
        )
    return length, width, height


def scanner_with(
    spacing_deg: tuple[float, float], field_deg: tuple[float, float], range_m: float
) -> Sensor:
    """A level scanner, or a camera with its pixels as beams.

    Parameters
    ----------
    spacing_deg : (float, float)
        Between beams beside and above each other, degrees.
    field_deg : (float, float)
        Elevation of the lowest and the highest beam, degrees.
    range_m : float

    Raises
    ------
    SettingsError
        A value is out of range.

    Examples
    --------
    >>> scanner_with((0.2, 2.0), (-15.0, 15.0), 80.0).beams
    16
    """
    beside, above = (finite_number("beam spacing", one, "degrees") for one in spacing_deg)
    low, high = (finite_number("field of view", one, "degrees") for one in field_deg)
    if not (0.0 < above <= 10.0 and low < high):
        raise SettingsError(
            "the spacing of beams must be above 0 and up to 10 degrees, and the field of view LOW"
            f" less than HIGH, got {above:g} and {low:g}, {high:g}."
        )
    if not (LEAST_SPACING_DEG <= beside and LEAST_SPACING_DEG <= above):
        raise SettingsError(
            f"the spacing of beams must be {LEAST_SPACING_DEG:g} degrees or more, got {beside:g},"
            f" {above:g}."
        )
    beams = max(round((high - low) / above), 1) + 1
    far_m = positive_length("the range", range_m)
    return Sensor("given", beams, low, high, beside, 0.0, far_m, 0.0)


@dataclass(frozen=True)
class Reach:
    """Where a level scanner has enough returns on an object.

    Parameters
    ----------
    sensor : Sensor
        Its beams, field of view and range.
    size_m : (float, float, float)
        Length, width and height of the object, metres.
    least_returns : float
        A target is within reach where the object, free in sight, has so many returns or more.

    Raises
    ------
    SettingsError
        The number of returns is negative or not finite, or an edge is not positive.
    """

    sensor: Sensor
    size_m: tuple[float, float, float] = OBJECTS["car"]
    least_returns: float = 10.0

    def __post_init__(self) -> None:
        least = finite_number("least_returns", self.least_returns, "returns")
        if least < 0.0:
            raise SettingsError(f"least_returns must be 0 or more, got {least:g}.")
        for edge in self.size_m:
            positive_length("size_m", edge)

    def returns(self, place: ArrayLike, targets: Float64Array) -> Float64Array:
        """Returns (T,) of one sweep to expect on the object in free sight around each target.

        The solid angle that the object covers, in the mean over its headings, by that of a beam:
        with azimuth and elevation steps a and b, elevation e, distance r and edges l, w, h it is
        (2 / pi (l + w) h cos e + l w abs(sin e)) / (r^2 a b cos e). 0 beyond range and field of
        view. It holds for objects that are small against the distance; a part of the object that
        is outside of the field of view is not taken off.

        Examples
        --------
        >>> scanner = scanner_with((0.2, 0.5), (-20.0, 20.0), 100.0)
        >>> Reach(scanner, (2.0, 2.0, 2.0)).returns([0, 0, 0], np.array([[50.0, 0, 0]])).round(1)
        array([66.9])
        """
        sensor = self.sensor
        away = targets - np.asarray(place, np.float64)
        level_m = np.hypot(away[:, 0], away[:, 1])
        range_m = np.hypot(level_m, away[:, 2])
        inside = (range_m >= max(sensor.min_range_m, 1e-3)) & (range_m <= sensor.max_range_m)
        elevation_deg = np.degrees(np.arctan2(away[:, 2], level_m))
        inside &= (elevation_deg >= sensor.lowest_deg) & (elevation_deg <= sensor.highest_deg)
        length, width, height = self.size_m
        safe_m, flat_m = np.where(inside, range_m, 1.0), np.where(inside, level_m, 1.0)
        cosine = np.maximum(flat_m / safe_m, 1e-3)
        side_m2 = 2.0 / np.pi * (length + width) * height * cosine
        area_m2 = side_m2 + length * width * np.sqrt(np.maximum(1.0 - cosine**2, 0.0))
        beam_sr = np.radians(sensor.azimuth_step_deg) * np.radians(sensor.beam_spacing_deg) * cosine
        return np.where(inside, area_m2 / (safe_m**2 * beam_sr), 0.0)

    def within(self, returns: Float64Array) -> BoolArray:
        """Which targets are within reach, by their returns in free sight."""
        return np.asarray((returns > 0.0) & (returns >= self.least_returns))


def faces(place: ArrayLike, yaw_deg: float, fov_deg: float, targets: Float64Array) -> BoolArray:
    """Which targets (T,) lie in the horizontal field of view of a place that looks along yaw.

    Examples
    --------
    >>> faces([0, 0, 5], 90.0, 60.0, np.array([[0.0, 9, 0], [9, 0, 0], [0, -9, 0]]))
    array([ True, False, False])
    """
    if fov_deg >= 360.0:
        return np.ones(len(targets), np.bool_)
    away = targets - np.asarray(place, np.float64)
    bearing_deg = np.degrees(np.arctan2(away[:, 1], away[:, 0])) - yaw_deg
    off_deg = np.abs((bearing_deg + 180.0) % 360.0 - 180.0)
    return np.asarray(off_deg <= 0.5 * fov_deg)
