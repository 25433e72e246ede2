"""Beam patterns: the directions of all beams of one sweep, and the scan that they measure.

Spinning multi-beam scanners, a rosette of two rotating prisms, a single ring and a terrestrial
scanner. The sensor frame has x forward, y left and z up. A beam without echo is absent in the scan.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial import cKDTree

from intervis.arrays import Float32Array, Float64Array, IntArray
from intervis.lab.worlds.ray_casting import RayCaster
from intervis.lab.worlds.scanner import SCANNERS, Scanner


@dataclass(frozen=True, eq=False)
class BeamPattern:
    """All beams of one sweep, in firing order.

    Attributes
    ----------
    name : str
    directions : (B, 3) float64 array
        Unit vectors, sensor frame.
    ring : (B,) int64 array or None
        Row of each beam, 0 the highest; None where the device has no rows.
    time_s : (B,) float64 array
        Since the start of the sweep, not decreasing.
    spacing_rad : (B,) float64 array
        Angle from each beam to its neighbours: the largest of the azimuth step and of the gaps to
        the next rows; for a rosette the distance to the eighth nearest beam.
    nearest_m, farthest_m : float
        Limits of the ranges that have an echo.
    noise_m : float
        Standard deviation of the range noise.
    dropout : float
        Share of the echoes that are lost at random.
    """

    name: str
    directions: Float64Array = field(repr=False)
    ring: IntArray | None = field(repr=False)
    time_s: Float64Array = field(repr=False)
    spacing_rad: Float64Array = field(repr=False)
    nearest_m: float
    farthest_m: float
    noise_m: float
    dropout: float

    def scan(
        self,
        caster: RayCaster,
        pose: Float64Array,
        rng: np.random.Generator,
        lost_share: Float64Array | None = None,
    ) -> "PatternScan":
        """The echoes of one sweep from a static pose, scene_from_scanner (4, 4).

        `lost_share` (T,) is the share of the echoes that each triangle of the caster loses, where
        that is more than the pattern's dropout.
        """
        directions = self.directions @ pose[:3, :3].T
        ranges_m, hits = caster.closest(pose[:3, 3], directions, self.farthest_m)
        dropout: float | Float64Array = self.dropout
        if lost_share is not None:
            dropout = np.maximum(np.where(hits >= 0, lost_share[hits], 0.0), self.dropout)
        lost = rng.random(len(ranges_m)) < dropout
        noise_m = self.noise_m * rng.standard_normal(len(ranges_m))
        ranges_m[(ranges_m < self.nearest_m) | lost] = np.inf
        beams = np.flatnonzero(np.isfinite(ranges_m))
        points = self.directions[beams] * (ranges_m + noise_m)[beams, None]
        return PatternScan(self, pose, points.astype(np.float32), beams, ranges_m)


@dataclass(frozen=True, eq=False)
class PatternScan:
    """One sweep of a `BeamPattern`.

    Attributes
    ----------
    pattern : BeamPattern
    pose : (4, 4) float64 array
        scene_from_scanner.
    points : (N, 3) float32 array
        Echoes with range noise, sensor frame, metres, in firing order.
    beams : (N,) int64 array
        Beam of each echo.
    ranges_m : (B,) float64 array
        Exact range of each beam; infinite without echo.
    """

    pattern: BeamPattern
    pose: Float64Array
    points: Float32Array = field(repr=False)
    beams: IntArray = field(repr=False)
    ranges_m: Float64Array = field(repr=False)


def spinning(scanner: Scanner) -> BeamPattern:
    """The pattern of a scanner that spins about z: column by column, highest beam first.

    Examples
    --------
    >>> from intervis.lab.worlds.scanner import SCANNERS
    >>> pattern = spinning(SCANNERS["vlp-16"])
    >>> len(pattern.directions), int(pattern.ring[17]), pattern.directions[0].round(3)
    (28800, 1, array([0.966, 0.   , 0.259]))
    """
    elevation_rad = np.radians(scanner.elevations_deg)
    order = np.argsort(-elevation_rad)
    rows, columns = len(order), scanner.columns
    by_row = scanner.directions().reshape(rows, columns, 3)[order]
    step_rad = 2 * np.pi / columns
    gaps = -np.diff(elevation_rad[order])
    spacing_rad = np.full(rows, step_rad)
    spacing_rad[1:] = np.maximum(spacing_rad[1:], gaps)
    spacing_rad[:-1] = np.maximum(spacing_rad[:-1], gaps)
    return BeamPattern(
        scanner.name,
        np.ascontiguousarray(by_row.swapaxes(0, 1)).reshape(-1, 3),
        np.tile(np.arange(rows), columns),
        np.repeat(np.arange(columns) * (scanner.period_s / columns), rows),
        np.tile(spacing_rad, columns),
        scanner.nearest_m,
        scanner.farthest_m,
        scanner.noise_m,
        scanner.dropout,
    )


# Hesai, Pandar64 user manual, channel distribution (nominal): 1/6 degree from +2 to -6 degrees.
PANDAR64_DEG = (
    *(15.0, 11.0, 8.0, 5.0, 3.0),
    *(float(2 - k / 6) for k in range(49)),
    *(-7.0, -8.0, -9.0, -10.0, -11.0, -12.0, -13.0, -14.0, -19.0, -25.0),
)
# Hesai, PandarQT user manual, channel distribution: symmetric, 1.45 degrees in the middle.
_QT64_UPPER_DEG = (
    *(52.121, 49.785, 47.577, 45.477, 43.465, 41.528, 39.653, 37.831, 36.055, 34.320, 32.619),
    *(30.950, 29.308, 27.690, 26.094, 24.517, 22.964, 21.420, 19.889, 18.372, 16.865, 15.368),
    *(13.880, 12.399, 10.925, 9.457, 7.994, 6.535, 5.079, 3.626, 2.175, 0.725),
)
QT64_DEG = (*_QT64_UPPER_DEG, *(-angle for angle in reversed(_QT64_UPPER_DEG)))


def _rows(
    name: str,
    elevations_deg: Sequence[float],
    columns: int,
    limits_m: tuple[float, float],
    noise_m: float,
) -> BeamPattern:
    return spinning(
        Scanner(name, tuple(elevations_deg), columns, *limits_m, noise_m, dropout=0.02, roof=None)
    )


def rosette(
    duration_s: float = 0.5,
    rate_hz: float = 100_000.0,
    half_angle_deg: float = 19.2,
    start_s: float = 0.0,
) -> BeamPattern:
    """A rosette about x of two rotating Risley prisms; a longer sweep fills it further.

    It does not repeat itself: a sweep that begins later, at `start_s`, fills other gaps.

    Each prism deflects the beam by half of the field of view's half angle, in a direction that
    turns with the prism. Livox Mid-40 data sheet: circular field of view of 38.4 degrees, 100,000
    points per second, 260 m. Its prisms turn at about 7,294 and -4,664 rpm.
    """
    time_s: Float64Array = np.arange(round(duration_s * rate_hz), dtype=np.float64) / rate_hz
    first, second = (2 * np.pi * rpm / 60 * (start_s + time_s) for rpm in (7294.0, -4664.0))
    part_rad = np.radians(half_angle_deg) / 2
    y_rad = part_rad * (np.cos(first) + np.cos(second))
    z_rad = part_rad * (np.sin(first) + np.sin(second))
    off_rad = np.hypot(y_rad, z_rad)
    factor = np.sinc(off_rad / np.pi)
    directions = np.column_stack([np.cos(off_rad), y_rad * factor, z_rad * factor])
    chord = cKDTree(directions).query(directions, k=9)[0][:, -1]
    spacing_rad: Float64Array = np.asarray(2 * np.arcsin(chord / 2), dtype=np.float64)
    return BeamPattern(
        "Livox Mid-40", directions, None, time_s, spacing_rad, 1.0, 260.0, 0.02, 0.02
    )


def ring_2d() -> BeamPattern:
    """One level ring. Hokuyo UTM-30LX: 270 degrees, 1,081 steps of 0.25 degrees, 0.1 to 30 m."""
    azimuth_rad = np.radians(np.arange(-540, 541) * 0.25)
    directions = np.column_stack([np.cos(azimuth_rad), np.sin(azimuth_rad), 0 * azimuth_rad])
    count = len(directions)
    return BeamPattern(
        "UTM-30LX",
        directions,
        np.zeros(count, np.int64),
        np.arange(count, dtype=np.float64) * (0.025 / 1440),
        np.full(count, np.radians(0.25), np.float64),
        0.1,
        30.0,
        0.03,
        0.01,
    )


def fan_ahead() -> BeamPattern:
    """A level grid ahead, column by column, highest beam first.

    Hesai AT128P user manual: 128 channels 0.2 degrees apart (12.9 to -12.5 degrees), 120 degrees in
    steps of 0.1 degrees at 10 Hz, 1,536,000 points per second, 200 m at 10 % reflectance.
    """
    elevation_rad = np.radians(np.arange(128) * -0.2 + 12.9)
    azimuth_rad = np.radians(np.arange(1200) * 0.1 - 59.95)
    azimuth, elevation = np.meshgrid(azimuth_rad, elevation_rad, indexing="ij")
    directions = np.stack(
        [
            np.cos(elevation) * np.cos(azimuth),
            np.cos(elevation) * np.sin(azimuth),
            np.sin(elevation),
        ],
        axis=-1,
    ).reshape(-1, 3)
    count = len(directions)
    return BeamPattern(
        "AT128",
        directions,
        np.tile(np.arange(128), 1200),
        np.repeat(np.arange(1200) * (0.1 / 1200), 128),
        np.full(count, np.radians(0.2), np.float64),
        1.0,
        200.0,
        0.03,
        0.02,
    )


def terrestrial(step_deg: float = 0.3) -> BeamPattern:
    """A grid over the sphere without the cone below the tripod: a mirror turns, the head pans.

    FARO Focus S data sheet: 360 x 300 degrees, 0.6 to 150 m; the mirror scans -60 to +90 degrees on
    both sides while the head turns by 180 degrees. Rows are elevations, columns azimuths.
    """
    elevation_deg = np.arange(90 - step_deg / 2, -60, -step_deg)
    columns = round(360 / step_deg)
    scanner = Scanner(
        "Focus S",
        tuple(elevation_deg),
        columns,
        0.6,
        150.0,
        0.002,
        dropout=0.005,
        roof=None,
        period_s=120.0,
    )
    return spinning(scanner)


PATTERNS: dict[str, Callable[[], BeamPattern]] = {
    "hdl-64e": lambda: spinning(SCANNERS["hdl-64e"]),
    "hdl-32e": lambda: spinning(SCANNERS["hdl-32e"]),
    "vlp-16": lambda: spinning(SCANNERS["vlp-16"]),
    "os1-128": lambda: spinning(SCANNERS["os1-128"]),
    "pandar64": lambda: _rows("Pandar64", PANDAR64_DEG, 1800, (0.3, 200.0), 0.02),
    "qt64": lambda: _rows("PandarQT", QT64_DEG, 600, (0.1, 60.0), 0.02),
    "livox": rosette,
    "ring": ring_2d,
    "terrestrial": terrestrial,
}
"""Makers of the patterns by name; ranges, rates and noise from the data sheets."""
