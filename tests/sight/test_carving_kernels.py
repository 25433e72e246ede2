"""Kernels that carve a grid, on axes that share no number with those of the sensor."""

import numpy as np
import pytest
from made_scans import street_scan
from scipy.spatial.transform import Rotation

from intervis.sight import Scene
from intervis.sight.kernels.carving import carve_planes, mark_returns
from intervis.sight.kernels.packed_scans import depth_at, descriptors_of
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
