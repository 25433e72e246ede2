"""What moves between two scans: where it stood when the sensor passed the line's end."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_scans import GROUND_M, clear, street_scan, turned

from intervis.sight import Scene
from intervis.sight.answers import sum_lines
from intervis.sight.occupancy_model import MODEL
from intervis.sight.reference import reference_result

STATIC = MODEL._replace(parameters=MODEL.parameters._replace(dynamic_min_height_m=99.0))
"""The model without its rule for dynamic objects."""


def transmittance(sums):
    return np.exp(-(sums.free + sums.surface + sums.unobserved))


HOUSE = [-40.0, 12.0, GROUND_M, 60.0, 14.0, 6.0]
TARGET_Y, HEIGHT_M = 11.8, -0.9
FIRST_X, LAST_X = 0.0, 6.0
"""Where the sensor was at the two scans; the car drives on a straight road."""


def car(from_x):
    return [from_x, 3.0, GROUND_M, from_x + 4.0, 4.8, -0.2]


def scene_of(first_car_x, last_car_x):
    """Two scans of a house behind a road, a second apart, the car at one place and at another."""
    scene = Scene(sensor="HDL-64E")
    for second, (x, car_x) in enumerate(((FIRST_X, first_car_x), (LAST_X, last_car_x))):
        pose = turned(0.0, x, 0.0)
        scene.add(street_scan(pose, boxes=np.array([HOUSE, car(car_x)])), pose, float(second))
    return scene


def lines_through(viewpoint_x, crossing_x):
    """Lines from the sensor's way to the house that cross the road's middle at those places."""
    viewpoint = np.array([viewpoint_x, 0.0, HEIGHT_M + 0.4])
    reach = TARGET_Y / 3.9
    x = viewpoint_x + (np.asarray(crossing_x) - viewpoint_x) * reach
    return viewpoint, np.stack([x, np.full(len(x), TARGET_Y), np.full(len(x), HEIGHT_M)], axis=1)


@pytest.mark.parametrize(("first_x", "last_x"), [(5.0, -1.0), (-1.0, 5.0), (4.0, 0.0)])
def test_a_car_that_drives_past_stands_between_its_places(first_x, last_x):
    """Half way between the scans it stood half way between its places."""
    scene = scene_of(first_x, last_x)
    middle = 0.5 * (first_x + last_x)
    viewpoint, targets = lines_through(3.0, np.linspace(middle - 5.0, middle + 9.0, 57))
    truth = clear(np.broadcast_to(viewpoint, targets.shape), targets, np.array([car(middle)]))
    sight = scene.sight(viewpoint, targets)
    assert ((sight.probability >= 0.5) == truth).mean() > 0.8
    ends = np.broadcast_to(viewpoint, targets.shape), targets
    still = sum_lines(scene.packed_scans(), *ends, STATIC)
    wrong = (sight.probability >= 0.5) != truth
    assert wrong.sum() < 0.5 * ((transmittance(still) >= 0.5) != truth).sum()


@pytest.mark.parametrize("moment_s", [0.0, 0.25, 0.5, 0.75, 1.0])
def test_a_moment_says_how_far_the_car_had_come(moment_s):
    """The viewpoint is where it is: the moment alone says where the car stood."""
    scene = scene_of(5.0, -1.0)
    there = 5.0 - 6.0 * moment_s
    viewpoint, targets = lines_through(3.0, np.linspace(there - 6.0, there + 10.0, 65))
    truth = clear(np.broadcast_to(viewpoint, targets.shape), targets, np.array([car(there)]))
    sight = scene.sight(viewpoint, targets, moment_s=moment_s)
    timeless = scene.sight(viewpoint, targets)
    right = ((sight.probability >= 0.5) == truth).mean()
    assert right > 0.8
    assert right >= ((timeless.probability >= 0.5) == truth).mean() - 0.05


def test_the_gap_between_parked_cars_stays_as_open_as_each_scan_left_it():
    """Nothing moved: a car on either side must not be taken for one that drove through the gap."""
    scene = Scene(sensor="HDL-64E")
    for x in (FIRST_X, LAST_X):
        pose = turned(0.0, x, 0.0)
        boxes = np.array([HOUSE, car(-3.0), car(4.0)])
        scene.add(street_scan(pose, boxes=boxes), pose)
    viewpoint, targets = lines_through(3.0, np.linspace(-2.0, 8.0, 101))
    ends = np.broadcast_to(viewpoint, targets.shape), targets
    followed = sum_lines(scene.packed_scans(), *ends)
    still = sum_lines(scene.packed_scans(), *ends, STATIC)
    assert (transmittance(followed) > transmittance(still) - 0.1).all()


@settings(max_examples=15)
@given(first_x=st.floats(-6.0, 10.0), last_x=st.floats(-6.0, 10.0), seed=st.integers(0, 2**32 - 1))
def test_engine_is_the_reference_where_something_moved(first_x, last_x, seed):
    scene = scene_of(round(first_x), round(last_x))
    rng = np.random.default_rng(seed)
    a = rng.uniform([-4, -2, -1.2], [10, 2, 0.5], (30, 3))
    b = rng.uniform([-12, 6, -1.4], [18, 11.9, 0.5], (30, 3))
    scans = scene.packed_scans()
    sums = sum_lines(scans, a, b)
    back = sum_lines(scans, b, a)
    for i in range(len(a)):
        result = reference_result(scans, a[i], b[i])
        assert sums.surface[i] == pytest.approx(result.surface, abs=1e-9)
        assert sums.free[i] == pytest.approx(result.free, abs=1e-9)
    for there, here in zip(sums[:4], back[:4], strict=True):
        assert np.array_equal(there, here)
