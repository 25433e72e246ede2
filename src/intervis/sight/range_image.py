"""The range image of a scan: one surface range for each direction around the sensor.

It covers the whole sphere, as a cube map does (`kernels.projection`). Columns are azimuth, one beam
step wide; rows are pseudo-elevation: z / rho on the sides, with the horizontal range rho, and its
continuation on the caps above and below 45 degrees. The planar range is rho on the sides and |z| on
the caps. Within a column, 1 / planar range of a plane is linear in the pseudo-elevation:
interpolation between two beams is exact on walls and on the ground. A pixel (`kernels.pixel`)
holds the planar range of

    a surface            its neighbours agree with it
    a volumetric return  its neighbours disagree (leaves, wires, edges, lone returns, ground at
                         grazing incidence where one beam ends much farther than the next)
    a dropout            no return, but returns of one surface below and above (dark or shining
                         bodies, glass, gaps of foliage): where that surface would lie
    nothing              no beam, or a beam without a return. Never "free"

Between two beams of a column the surface is interpolated where their ranges lie on one surface.
Where they jump, each return extends over half of the gap. A return at the border of a larger gap
extends over 0.6 beam spacings. A column that a beam missed, between two columns that it hit, takes
the nearer range of the two.

A gap of up to `MAX_DROPOUT` between two beams of a column whose ranges lie on one surface is a
dropout in the rows that beams scan: those with at least `SCANNED_SHARE` of the pixels of the row
that has most.
"""

from dataclasses import dataclass

import numpy as np

from intervis.arrays import (
    Float32Array,
    Float64Array,
    FloatArray,
    Int16Array,
    IntArray,
    UInt32Array,
)
from intervis.kernels import in_parts
from intervis.sight.ground_map import ground_map_of
from intervis.sight.kernels.rasterize import (
    MAX_DROPOUT,
    beam_spacings,
    bridge_dropouts,
    count_observed,
    quantize,
    rasterize,
    sort_into_columns,
)
from intervis.sight.projected_scan import ProjectedScan, project_scan
from intervis.sight.sensor import Sensor

STEPS_PER_COLUMN = 1.0
"""Azimuth steps in a column."""
ROWS_PER_BEAM = 3.0
"""Rows per spacing of the densest beams."""
_MAX_UNITS = 32767.0
_BANDS = 40
_SORT_BINS = 16384
_MAX_ROWS = 1024
SCANNED_SHARE = 0.05
"""A row with a smaller share of the observed pixels of the fullest row lies between the beams."""
COLUMNS_PER_PART = 256
"""Fewer columns are not worth a thread."""
STRAY_FACTOR, STRAY_QUANTILE = 4.0, 0.999
"""Returns farther than so many times this quantile of the planar ranges are strays. One of them
would coarsen the unit of all pixels."""


@dataclass(frozen=True, eq=False)
class RangeImage:
    """Surface range over azimuth and pseudo-elevation.

    Attributes
    ----------
    pixels : (C, R) int16 array
        Planar range in units, see the module's text. Column by column, because a sight
        line mostly moves along a column.
    unit_m : float
        Metres per unit: the largest planar range divided by 32767, millimetres.
    elevation_from, elevation_step : float
        Row r lies at the pseudo-elevation elevation_from + r elevation_step.
    ground_m : (G, G) float32 array
        Ground map around the sensor in the scene's axes, see `intervis.sight.ground_map`.
    returns : int
        Number of returns used.
    """

    pixels: Int16Array
    unit_m: float
    elevation_from: float
    elevation_step: float
    ground_m: Float32Array
    returns: int


def range_image_of(
    points_velo: FloatArray, sensor: Sensor, scene_from_sensor: Float64Array | None = None
) -> RangeImage:
    """The range image of one scan.

    Parameters
    ----------
    points_velo : (N, 3) float array
        Finite points in the sensor's frame, metres. Returns outside the sensor's range limits are
        left out, and so are strays: returns more than `STRAY_FACTOR` times farther than nearly all
        others.
    sensor : Sensor
    scene_from_sensor : (4, 4) float64 array or None
        Pose in a scene whose z axis points up. None: the sensor stands upright.

    Returns
    -------
    RangeImage
        With `returns == 0` and an empty image if no point is left.

    Examples
    --------
    >>> from intervis.sight.sensor import GENERIC
    >>> azimuth = np.radians(np.arange(0, 360, 0.2))
    >>> ring = np.c_[10 * np.cos(azimuth), 10 * np.sin(azimuth), np.zeros(len(azimuth))]
    >>> image = range_image_of(ring, GENERIC)
    >>> round(float(image.unit_m * np.abs(image.pixels).max()), 2)
    10.0
    """
    level_from_sensor = None if scene_from_sensor is None else scene_from_sensor[:3, :3]
    return range_image_of_projected(project_scan(points_velo, level_from_sensor), sensor)


def range_image_of_projected(
    scan: ProjectedScan, sensor: Sensor, *, is_complete: bool = True
) -> RangeImage:
    """The range image of a projected scan; see `range_image_of`.

    Without dropouts where the scan is not complete: its gaps may be returns that were left out.
    """
    columns = int(np.clip(round(360.0 / (STEPS_PER_COLUMN * sensor.azimuth_step_deg)), 8, 4096))
    usual = np.radians(sensor.beam_spacing_deg)
    kept, farthest_m = _kept(scan.planar_m, sensor)
    ground_m = ground_map_of(scan.level, kept)
    if len(kept) == 0:
        return RangeImage(np.zeros((columns, 2), np.int16), 1.0, 0.0, float(usual), ground_m, 0)
    order, start = sort_into_columns(scan.azimuth, scan.elevation, kept, columns, _SORT_BINS)
    spacings = beam_spacings(scan.elevation, order, start, usual, _BANDS)
    elevation = scan.elevation[kept]
    low, high = elevation.min(), elevation.max()
    step = max(spacings.min() / ROWS_PER_BEAM, (high - low) / _MAX_ROWS)
    lowest = low - 2.0 * spacings.max()
    rows = int((high + 2.0 * spacings.max() - lowest) / step) + 2
    pixels = np.empty((columns, rows), np.int16)
    unit_m = farthest_m / _MAX_UNITS
    _draw(scan, order, start, spacings, lowest, step, unit_m, pixels)
    if is_complete:
        _bridge(pixels, int(MAX_DROPOUT / step))
    return RangeImage(pixels, unit_m, float(lowest), float(step), ground_m, len(kept))


def _kept(planar_m: Float64Array, sensor: Sensor) -> tuple[IntArray, float]:
    """Indices of the returns in the sensor's range limits without strays, and the farthest."""
    nearest_m = max(sensor.min_range_m, 1e-3)
    kept = np.flatnonzero((planar_m >= nearest_m) & (planar_m <= sensor.max_range_m))
    if len(kept) == 0:
        return kept, 0.0
    of_kept = planar_m[kept]
    farthest_m = float(of_kept.max())
    # Where enough returns are that far, the quantile is one of them: nothing to leave out.
    far = np.count_nonzero(of_kept > farthest_m / STRAY_FACTOR)
    if far > (1.0 - STRAY_QUANTILE) * len(kept) + 1.0:
        return kept, farthest_m
    near = of_kept <= STRAY_FACTOR * np.quantile(of_kept, STRAY_QUANTILE)
    return kept[near], float(of_kept[near].max())


def _draw(
    scan: ProjectedScan,
    order: UInt32Array,
    start: UInt32Array,
    spacings: Float64Array,
    lowest: float,
    step: float,
    unit_m: float,
    pixels: Int16Array,
) -> None:
    """Draw the pixels from returns sorted into columns, a part of the columns at a time."""
    far = round(ROWS_PER_BEAM)
    rows = pixels.shape[1]

    def draw(begin: int, end: int) -> None:
        image = np.zeros((end - begin + 4, rows + 2 * far), np.float32)
        rasterize(
            scan.planar_m,
            scan.elevation,
            scan.level[2],
            order,
            start,
            spacings,
            lowest,
            step,
            begin - 2,
            image[:, far:-far],
        )
        quantize(image, far, 1.0 / unit_m, pixels[begin:end])

    in_parts(draw, len(pixels), least=COLUMNS_PER_PART)


def _bridge(pixels: Int16Array, most_rows: int) -> None:
    """Mark the dropouts in drawn pixels, a part of the columns at a time."""
    observed = np.zeros(pixels.shape[1], np.int32)
    count_observed(pixels, observed)
    is_scanned = observed >= max(SCANNED_SHARE * observed.max(), 1.0)

    def bridge(begin: int, end: int) -> None:
        bridge_dropouts(pixels[begin:end], is_scanned, most_rows)

    in_parts(bridge, len(pixels), least=COLUMNS_PER_PART)
