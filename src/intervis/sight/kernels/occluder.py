"""Where an occluded line intersects the surface, and how far it would have to shift to clear it."""

import numpy as np

from intervis.arrays import Float64Array, Int16Array
from intervis.kernels import kernel
from intervis.sight.kernels.packed_scans import (
    COLUMNS,
    ELEVATION_FROM,
    OFFSET,
    ROWS,
    ROWS_PER_UNIT,
    UNIT_M,
    depth_at,
    to_sensor_frame,
)
from intervis.sight.kernels.pixel import is_observed
from intervis.sight.kernels.projection import FULL_CIRCLE, pseudo_azimuth, pseudo_elevation

SEARCH_M = 1.5
"""The intersection is searched this far along the line, on both sides of the occluding sample."""
SEARCH_STEP_M = 0.1
MAX_SHIFT_M = 10.0
"""Larger shifts are reported as this."""


@kernel
def _intersection(
    pixels: Int16Array,
    descriptor: Float64Array,
    line: Float64Array,
    length: float,
    occluder_m: float,
) -> float:
    """Distance along the line to its intersection with the surface nearest to `occluder_m`.

    `occluder_m` itself if there is none within `SEARCH_M`.
    """
    x, y, z = line[0, 0], line[0, 1], line[0, 2]
    dx, dy, dz = line[1, 0], line[1, 1], line[1, 2]
    crossing, n = np.nan, 1
    at = occluder_m
    before = depth_at(pixels, descriptor, x + at * dx, y + at * dy, z + at * dz)
    after = before  # towards the second end; `before`: towards the first one
    while np.isnan(crossing) and n <= int(SEARCH_M / SEARCH_STEP_M):
        low, high = occluder_m - n * SEARCH_STEP_M, occluder_m + n * SEARCH_STEP_M
        if low >= 0.0:
            depth = depth_at(pixels, descriptor, x + low * dx, y + low * dy, z + low * dz)
            if before * depth <= 0.0:
                fraction = depth / (depth - before) if depth != before else 0.0
                crossing = low + SEARCH_STEP_M * fraction
            before = depth
        if high <= length and np.isnan(crossing):
            depth = depth_at(pixels, descriptor, x + high * dx, y + high * dy, z + high * dz)
            if after * depth <= 0.0:
                fraction = depth / (depth - after) if depth != after else 0.0
                crossing = high - SEARCH_STEP_M * fraction
            after = depth
        n += 1
    return occluder_m if np.isnan(crossing) else crossing


@kernel
def _shift(pixels: Int16Array, descriptor: Float64Array, line: Float64Array, at_m: float) -> float:
    """Shortest shift out of the space behind the surface: up, down, left or right."""
    u = line[0, 0] + at_m * line[1, 0]
    v = line[0, 1] + at_m * line[1, 1]
    w = line[0, 2] + at_m * line[1, 2]
    rho = np.sqrt(u * u + v * v)
    rows, columns = int(descriptor[ROWS]), int(descriptor[COLUMNS])
    at = int(descriptor[OFFSET])
    planar_range = max(rho, abs(w))
    place = (pseudo_elevation(rho, w) - descriptor[ELEVATION_FROM]) * descriptor[ROWS_PER_UNIT]
    columns_per_unit = descriptor[COLUMNS] / FULL_CIRCLE
    c = int(min(pseudo_azimuth(u, v) * columns_per_unit, descriptor[COLUMNS] - 1.0))
    if not (0.0 <= place + 0.5 < rows):
        return 0.0
    r = int(place + 0.5)
    least = MAX_SHIFT_M
    units = planar_range / descriptor[UNIT_M]
    for way in range(4):
        step = planar_range / descriptor[ROWS_PER_UNIT] if way < 2 else 2.0 * np.pi * rho / columns
        if step == 0.0:
            continue
        n = 1
        while n * step < least:
            row = r + n if way == 0 else (r - n if way == 1 else r)
            column = c + n if way == 2 else (c - n if way == 3 else c)
            if not 0 <= row < rows:
                break
            if not 0 <= column < columns:  # most columns need no division
                column %= columns
            here = pixels[at + column * rows + row]
            if not is_observed(here) or abs(float(here)) > units:
                least = n * step
                break
            n += 1
    return least


@kernel
def locate_occluder(
    pixels: Int16Array,
    descriptor: Float64Array,
    a: Float64Array,
    b: Float64Array,
    length: float,
    occluder_m: float,
    line: Float64Array,
    blocker: Float64Array,
) -> float:
    """Write where an occluded line intersects a scan's surface; return the shift that clears it.

    The shift is measured at the sample with the highest occupancy, `occluder_m` from `a`, across
    the beam of the scan that observed the surface: the smallest shift after which that scan saw
    farther, or saw nothing. `descriptor` is that scan's. `line` (2, 3) is scratch: the line's first
    end and its direction in the sensor frame.
    """
    to_sensor_frame(descriptor, a, b, line[0], line[1])
    for axis in range(3):
        line[1, axis] /= length
    position = _intersection(pixels, descriptor, line, length, occluder_m) / length
    for axis in range(3):
        blocker[axis] = a[axis] + position * (b[axis] - a[axis])
    return float(_shift(pixels, descriptor, line, occluder_m))
