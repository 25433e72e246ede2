"""Range images of many scans, packed for kernels: look-up of depths and selection of scans."""

from typing import NamedTuple

import numpy as np

from intervis.arrays import Float32Array, Float64Array, Int16Array, IntArray
from intervis.kernels import kernel
from intervis.sight.kernels.pixel import is_observed
from intervis.sight.kernels.projection import FULL_CIRCLE, pseudo_azimuth, pseudo_elevation

DISTANCE_STEP_M = 0.5
"""Distances from a scan to a line's ends are compared in steps of this; ties: newest first."""
MAX_INTERPOLATED_JUMP = 0.1
"""Between two rows whose planar ranges differ by less than this fraction, it is interpolated."""

# Columns of a scan descriptor: geometry of the range image, then the three rows of
# sensor_from_scene, then those of level_from_scene.
UNIT_M, OFFSET, COLUMNS, ROWS, ELEVATION_FROM, ROWS_PER_UNIT, FROM_SCENE = range(7)
LEVEL = FROM_SCENE + 12


class PackedScans(NamedTuple):
    """Range images of S scans, oldest first, as kernels read them.

    `pixels` holds the range images one after another, column by column; that of scan k starts at
    `offset[k]`. `sensor_from_scene` is (S, 3, 4), `position` (S, 3) the sensors' positions in the
    scene, `ground` (S, G, G) the ground maps, in axes of which the third is up: `level_from_scene`
    (3, 3) turns the scene's axes into them. `age_cost_m` is added to a scan's distance for its time
    offset; `time_offset_s` is scan time minus query time. Without a query time they are 0 and NaN.
    """

    pixels: Int16Array
    unit_m: Float64Array
    offset: IntArray
    columns: IntArray
    rows: IntArray
    elevation_from: Float64Array
    rows_per_unit: Float64Array
    sensor_from_scene: Float64Array
    position: Float64Array
    ground: Float32Array
    level_from_scene: Float64Array
    age_cost_m: Float64Array
    time_offset_s: Float64Array


@kernel
def descriptors_of(scans: PackedScans) -> Float64Array:
    """Scan descriptors (S, 28), see the column names above.

    Kernels that run per line or per sample receive one row of it instead of a `PackedScans`, whose
    arrays would be unpacked and reference-counted at each call.
    """
    descriptors = np.empty((len(scans.offset), LEVEL + 9))
    for k in range(len(descriptors)):
        descriptors[k, UNIT_M], descriptors[k, OFFSET] = scans.unit_m[k], scans.offset[k]
        descriptors[k, COLUMNS], descriptors[k, ROWS] = scans.columns[k], scans.rows[k]
        descriptors[k, ELEVATION_FROM] = scans.elevation_from[k]
        descriptors[k, ROWS_PER_UNIT] = scans.rows_per_unit[k]
        for axis in range(3):
            for n in range(4):
                descriptors[k, FROM_SCENE + 4 * axis + n] = scans.sensor_from_scene[k, axis, n]
            for n in range(3):
                descriptors[k, LEVEL + 3 * axis + n] = scans.level_from_scene[axis, n]
    return descriptors


@kernel
def choose_scans(
    position: Float64Array,
    age_cost_m: Float64Array,
    first: Float64Array,
    second: Float64Array,
    chosen: IntArray,
    distance: Float64Array,
    chosen_distance: Float64Array,
) -> None:
    """The scans that contribute to each line: nearest first, newest first among equals.

    Lines from one viewpoint mostly have the same distances as the line before; they copy its
    choice. `distance` (S,) and `chosen_distance` (K,) are scratch arrays.
    """
    distance[:] = np.nan
    for i in range(len(first)):
        a0, a1, a2 = first[i, 0], first[i, 1], first[i, 2]
        b0, b1, b2 = second[i, 0], second[i, 1], second[i, 2]
        changes = 0
        for k in range(len(distance)):
            x, y, z = position[k, 0], position[k, 1], position[k, 2]
            to_a = (a0 - x) ** 2 + (a1 - y) ** 2 + (a2 - z) ** 2
            to_b = (b0 - x) ** 2 + (b1 - y) ** 2 + (b2 - z) ** 2
            steps = np.floor((np.sqrt(min(to_a, to_b)) + age_cost_m[k]) / DISTANCE_STEP_M)
            changes += 1 if steps != distance[k] else 0
            distance[k] = steps
        if changes == 0:
            for n in range(chosen.shape[1]):
                chosen[i, n] = chosen[i - 1, n]
            continue
        count = 0
        for k in range(len(distance) - 1, -1, -1):
            if count < chosen.shape[1]:
                count += 1
            elif not distance[k] < chosen_distance[count - 1]:
                continue
            at = count - 1
            while at > 0 and chosen_distance[at - 1] > distance[k]:
                chosen_distance[at] = chosen_distance[at - 1]
                chosen[i, at] = chosen[i, at - 1]
                at -= 1
            chosen_distance[at] = distance[k]
            chosen[i, at] = k


@kernel
def to_sensor_frame(
    descriptor: Float64Array,
    a: Float64Array,
    b: Float64Array,
    start: Float64Array,
    along: Float64Array,
) -> None:
    """Write a line's first end and the vector to its second end in a scan's sensor frame."""
    x, y, z = a[0], a[1], a[2]
    dx, dy, dz = b[0] - x, b[1] - y, b[2] - z
    for axis in range(3):
        g = descriptor[FROM_SCENE + 4 * axis : FROM_SCENE + 4 * axis + 4]
        start[axis] = g[0] * x + g[1] * y + g[2] * z + g[3]
        along[axis] = g[0] * dx + g[1] * dy + g[2] * dz


@kernel
def depth_at(pixels: Int16Array, descriptor: Float64Array, x: float, y: float, z: float) -> float:
    """Depth of a point of the sensor frame behind the scan's surface; NaN if none was observed.

    `pixels` are those of all scans, `descriptor` is the scan's row.
    """
    rho = np.sqrt(x * x + y * y)
    f = (pseudo_elevation(rho, z) - descriptor[ELEVATION_FROM]) * descriptor[ROWS_PER_UNIT]
    rows = descriptor[ROWS]
    if not (0.0 <= f < rows - 1.0):
        return np.nan
    row = int(f)
    f -= row
    columns = descriptor[COLUMNS]
    column = int(min(pseudo_azimuth(x, y) * (columns / FULL_CIRCLE), columns - 1.0))
    at = int(descriptor[OFFSET]) + column * int(rows) + row
    if not is_observed(pixels[at + 1] if f >= 0.5 else pixels[at]):
        return np.nan
    low, high = abs(float(pixels[at])), abs(float(pixels[at + 1]))
    surface = high if f >= 0.5 else low
    if abs(low - high) < MAX_INTERPOLATED_JUMP * min(low, high):
        surface = low + (high - low) * f
    return float(max(rho, abs(z)) - surface * descriptor[UNIT_M])
