"""Kernels that carve a grid, on axes that share no number with those of the sensor."""

import numpy as np
import pytest
from made_scans import street_scan
from scipy.spatial.transform import Rotation

from intervis.sight import Scene
from intervis.sight.kernels.carving import carve_planes, mark_returns
from intervis.sight.kernels.packed_scans import (
    ELEVATION_FROM,
    ROWS,
    ROWS_PER_UNIT,
    UNIT_M,
    depth_at,
    descriptors_of,
)
from intervis.transform import inverse, rigid, transform

SCENE_FROM_SENSOR = rigid(
    Rotation.from_euler("ZYX", [37, 8, -11], degrees=True).as_matrix(), [3.0, -2.0, 0.7]
)
CORNER = np.array([1.3, -4.1, -2.4])
SHAPE = (9, 13, 11)
CELL_M = 0.6


def lift(rng):
    """Each column of corners is raised by another height, in cells."""
    return rng.uniform(-1.5, 1.5, (SHAPE[0] + 1, SHAPE[1] + 1))


def raised(lifts, i, j):
    """By how much a column of voxels is raised: the mean of its corners."""
    return (lifts[i, j] + lifts[i + 1, j] + lifts[i, j + 1] + lifts[i + 1, j + 1]) / 4


def test_the_depth_of_a_voxel_is_that_of_its_centre(rng):
    """Against the depth of single points, which are moved into the sensor's frame one by one."""
    points = street_scan(beams=32, step_deg=0.6)
    packed = Scene.from_scan(points).packed_scans()
    descriptor = descriptors_of(packed)[0]
    sensor_from_scene, lifts = inverse(SCENE_FROM_SENSOR), lift(rng)
    start = transform(sensor_from_scene, CORNER[None])[0]
    frame = np.vstack([start, CELL_M * sensor_from_scene[:3, :3].T])
    begin, planes = 2, 6
    place = np.empty((planes, *SHAPE[1:]), np.uint8)
    depth = np.empty((planes, *SHAPE[1:]), np.float32)
    carve_planes(packed.pixels, descriptor, frame, lifts, CELL_M, begin, place, depth)
    expected = np.empty(depth.shape)
    for n, j, k in np.ndindex(*depth.shape):
        i = begin + n
        cells = np.array([i + 0.5, j + 0.5, k + 0.5 + raised(lifts, i, j)])
        in_sensor = transform(sensor_from_scene, (CORNER + CELL_M * cells)[None])[0]
        expected[n, j, k] = depth_at(packed.pixels, descriptor, *in_sensor)
    assert 100 < np.isfinite(expected).sum() < expected.size - 100
    # A centre on the border of two pixels may fall either way.
    same = np.isclose(depth, expected, rtol=1e-5, atol=1e-4, equal_nan=True)
    assert same.mean() > 0.995


@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_returns_are_counted_in_the_voxel_that_holds_them(rng, kind):
    inside = transform(inverse(SCENE_FROM_SENSOR), CORNER + CELL_M * rng.uniform(-2, 15, (4000, 3)))
    points, lifts = inside.astype(kind), lift(rng)
    points[:300] = points[0]  # more than a voxel counts
    returns = np.zeros(SHAPE, np.uint8)
    mark_returns(points, SCENE_FROM_SENSOR, CORNER, CELL_M, lifts, returns)
    expected = np.zeros(SHAPE, int)
    for point in points.astype(np.float64):
        at = (SCENE_FROM_SENSOR[:3, :3] @ point + SCENE_FROM_SENSOR[:3, 3] - CORNER) / CELL_M
        i, j = int(np.floor(at[0])), int(np.floor(at[1]))
        if 0 <= i < SHAPE[0] and 0 <= j < SHAPE[1]:
            k = int(np.floor(at[2] - raised(lifts, i, j)))
            if 0 <= k < SHAPE[2]:
                expected[i, j, k] += 1
    assert expected.max() >= 300
    assert np.array_equal(returns, np.minimum(expected, 255))


def patches(count, unit_m, rng):
    """An image of patches at 1 to 7 m: smooth, uneven, volumetric (negative), or nothing (0)."""
    length = 6
    patch_m = rng.uniform(1, 7, count // length + 1)
    flat_m = np.where(rng.random(len(patch_m)) < 0.6, 3.0 + patch_m / 9, patch_m)
    sign = rng.choice([1, 1, 1, 1, -1, 0], len(patch_m))
    uneven_m = rng.uniform(0, 1, len(patch_m)) ** 3
    pixels_m = (
        flat_m.repeat(length)[:count] + rng.uniform(0, 1, count) * uneven_m.repeat(length)[:count]
    )
    return (sign.repeat(length)[:count] * pixels_m / unit_m).astype(np.int16)


def road(count, unit_m, descriptor, rng):
    """An image of uneven ground 1.5 to 1.9 m below the sensor; mostly volumetric (negative)."""
    column, row = np.divmod(np.arange(count), int(descriptor[ROWS]))
    elevation = descriptor[ELEVATION_FROM] + row / descriptor[ROWS_PER_UNIT]
    below_m = rng.uniform(1.5, 1.9, column.max() // 20 + 1)[column // 20]
    range_m = below_m / np.clip(np.abs(elevation), 1e-9, 1.0)  # the depth itself below 45 degrees
    range_m[(elevation >= 0) | (range_m > 40.0)] = 0.0
    range_m[(column // 7) % 5 != 0] *= -1.0
    return (range_m / unit_m).astype(np.int16)


def elevation_of(x, y, z):
    """The pseudo-elevation: z over the level range, beyond 45 degrees 2 minus its inverse."""
    level, height = np.hypot(x, y), abs(z)
    value = height / level if height <= level else 2.0 - level / height
    return value if z >= 0 else -value


def is_across_by_definition(corners, cell_m):
    """Whether one surface passes between corners: depth, signed surface range, point, each."""
    ranges = [abs(surface) for _, surface, _ in corners]
    heights = [abs(surface) * elevation_of(*point) for _, surface, point in corners]
    behind = [depth for depth, _, _ in corners if depth >= 0]
    jump, rise = max(ranges) - min(ranges), max(heights) - min(heights)
    if jump < 1.5 * cell_m:
        return True
    if all(surface > 0 for _, surface, _ in corners) and min(behind, default=np.inf) < cell_m:
        return True
    return jump < 0.3 * min(ranges) and rise < 0.25 * cell_m


ROAD_CORNER = transform(SCENE_FROM_SENSOR, np.array([[2.5, -2.0, -3.0]]))[0]


@pytest.mark.parametrize(
    ("corner", "cell_m"), [(CORNER, 0.6), (CORNER + 0.3, 0.6), (ROAD_CORNER, 0.25)]
)
def test_the_place_of_a_voxel_follows_from_its_corners_and_its_centre(rng, corner, cell_m):
    """Corner by corner, with the depth of single points; against the words of the kernel."""
    packed = Scene.from_scan(street_scan(beams=32, step_deg=0.6)).packed_scans()
    descriptor = descriptors_of(packed)[0].copy()
    descriptor[ELEVATION_FROM] = -1.7  # nearly all around
    descriptor[ROWS_PER_UNIT] = descriptor[ROWS] / 3.4
    descriptor[UNIT_M] = 0.002
    is_road = corner is ROAD_CORNER
    pixels = (
        road(len(packed.pixels), 0.002, descriptor, rng)
        if is_road
        else patches(len(packed.pixels), 0.002, rng)
    )
    surfaces = np.where(pixels > 0, pixels, 0).astype(np.int16)
    sensor_from_scene, lifts = inverse(SCENE_FROM_SENSOR), lift(rng)
    lifts[:5] *= 0.1
    start = transform(sensor_from_scene, corner[None])[0]
    frame = np.vstack([start, cell_m * sensor_from_scene[:3, :3].T])
    begin, planes = 1, 7
    place = np.empty((planes, *SHAPE[1:]), np.uint8)
    centre_depth = np.empty((planes, *SHAPE[1:]), np.float32)
    carve_planes(pixels, descriptor, frame, lifts, cell_m, begin, place, centre_depth)

    def point(i, j, k):
        return transform(sensor_from_scene, (corner + cell_m * np.array([i, j, k]))[None])[0]

    def looked_up(i, j, k):
        """Depth, and the range of the surface, negative for volumetric returns."""
        x, y, z = point(i, j, k)
        depth = depth_at(pixels, descriptor, x, y, z)
        range_m = max(np.hypot(x, y), abs(z)) - depth
        return depth, -range_m if np.isnan(depth_at(surfaces, descriptor, x, y, z)) else range_m

    corners = {
        (i, j, k): looked_up(i, j, k + lifts[i, j])
        for i in range(begin, begin + planes + 1)
        for j in range(SHAPE[1] + 1)
        for k in range(SHAPE[2] + 1)
    }
    differing, words = 0, np.zeros(4, int)
    for n, j, k in np.ndindex(*place.shape):
        i = begin + n
        up = raised(lifts, i, j)
        depth, surface = looked_up(i + 0.5, j + 0.5, k + 0.5 + up)
        around = [
            (*corners[i + a, j + b, k + c], point(i + a, j + b, k + c + up))
            for a, b, c in np.ndindex(2, 2, 2)
        ]
        known = [one for one in around if not np.isnan(one[0])]
        seen, free = len(known), sum(one[0] < 0 for one in known)
        word = 0
        if seen >= 4:
            ahead = 2 * free > seen
            if not np.isnan(depth):
                ahead = free == seen or (free > 0 and depth < 0)
            word = 1 if ahead else 3
            if 0 < free < seen and is_across_by_definition(known, cell_m):
                word = 2
        words[word] += 1
        differing += place[n, j, k] % 4 != word
        if not np.isnan(depth):
            differing += (place[n, j, k] >= 4) != (surface < 0)
    assert words[0 if not is_road else 1 :].min() > 10
    assert differing <= 3, "a point on the border of two pixels may fall either way"
