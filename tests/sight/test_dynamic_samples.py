"""The rule for dynamic objects, sample by sample, on its bounds: numbers on paper."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from intervis.sight.kernels.batch import (
    BRACKETED,
    BRACKETING,
    BY_BRACKETING,
    BY_NEAREST,
    DYNAMIC,
    HEIGHT,
    LOG_ODDS,
)
from intervis.sight.kernels.dynamics import apply_dynamic, find_dynamic, was_occupied
from intervis.sight.kernels.packed_scans import FROM_SCENE
from intervis.sight.occupancy_model import MODEL
from intervis.transform import inverse, rigid

NAN = float("nan")
RULE = MODEL.parameters._replace(
    surface_from_m=-0.25,
    surface_to_m=1.25,
    free_depth_m=-0.75,
    dynamic_max_depth_m=3.0,
    dynamic_min_height_m=0.25,
    dynamic_max_height_m=3.0,
    motion_step_m=1.0,
    motion_reach_m=6.0,
)


def found(nearest, bracketing, height, rank):
    """What `find_dynamic` says of one sample, wherever it lies in a batch of two lines."""
    samples = np.full((12, 24), NAN)
    samples[BY_NEAREST, 10], samples[BY_BRACKETING, 10], samples[HEIGHT, 10] = (
        nearest,
        bracketing,
        height,
    )
    lines = np.zeros((2, BRACKETED + 1))
    lines[1, BRACKETING] = rank
    offsets = np.array([[0, 3, 8], [8, 20, 24]])
    find_dynamic(samples, lines, offsets, 2, RULE)
    others = np.delete(samples[DYNAMIC], 10)
    assert (others == 0.0).all(), "nothing was observed there"
    return samples[DYNAMIC, 10]


@pytest.mark.parametrize(
    ("one", "other", "height", "disagree"),
    [
        (1.0, -2.0, 1.0, True),
        (-2.0, 1.0, 1.0, True),
        (1.0, 1.0, 1.0, False),  # both saw something
        (-2.0, -2.0, 1.0, False),  # both saw free space
        (1.0, -0.75, 1.0, False),  # at the bound: not free
        (1.0, -0.7501, 1.0, True),
        (-0.25, -2.0, 1.0, True),  # at the bound: on the surface
        (-0.2501, -2.0, 1.0, False),
        (3.0, -2.0, 1.0, True),  # as deep as is looked
        (3.0001, -2.0, 1.0, False),
        (1.0, -2.0, 0.25, True),
        (1.0, -2.0, 0.2499, False),
        (1.0, -2.0, 3.0, True),
        (1.0, -2.0, 3.0001, False),
        (1.0, -2.0, NAN, False),
        (NAN, -2.0, 1.0, False),
        (1.0, NAN, 1.0, False),
    ],
)
def test_two_scans_disagree_on_a_sample(one, other, height, disagree):
    for rank in (1.0, 2.0, 5.0):
        assert found(one, other, height, rank) == (2.0 if disagree else 0.0)
        assert found(other, one, height, rank) == (2.0 if disagree else 0.0)
    assert found(one, other, height, 0.0) == 0.0, "no scan brackets the query"


@pytest.mark.parametrize(
    ("one", "height", "left"),
    [
        (-2.0, 1.0, True),
        (-0.7501, 1.0, True),
        (-0.75, 1.0, False),
        (1.0, 1.0, False),
        (NAN, 1.0, False),
        (-2.0, 0.2499, False),
        (-2.0, 0.25, True),
        (-2.0, 3.0, True),
        (-2.0, 3.0001, False),
    ],
)
def test_where_the_nearest_scan_alone_decides_what_it_saw_free_had_left(one, height, left):
    for other in (1.0, -2.0, NAN):
        assert found(one, other, height, -1.0) == (-1.0 if left else 0.0)


def test_dynamic_samples_bound_their_log_odds():
    samples = np.zeros((12, 8))
    samples[LOG_ODDS] = [0.5, 2.5, 0.5, 2.5, 0.5, -5.0, 2.5, -5.0]
    samples[DYNAMIC] = [0.0, 0.0, 1.0, 1.0, -1.0, -1.0, -1.0, 1.0]
    apply_dynamic(samples, 7, 1.5, -3.0)
    assert samples[LOG_ODDS].tolist() == [0.5, 2.5, 1.5, 2.5, -3.0, -5.0, -3.0, -5.0], (
        "the last sample is beyond the count"
    )


COLUMNS, ROWS = 2048, 5
"""Narrow columns: at 10 m they are 3 cm wide."""


def scan_at(x_m, objects):
    """Descriptor of a scan at (x, 0, 0), and the pixels of surfaces 10 m to its left.

    `objects` are intervals of x, of the scene, that stand at y = 10 m; behind them is a house at
    y = 30 m. Planar ranges of the walls' points are exact to a millimetre.
    """
    azimuth_unit = (np.arange(COLUMNS) + 0.5) * (8.0 / COLUMNS)
    # invert the polynomial of `projection` on a fine grid
    ratio = np.linspace(0.0, 1.0, 20_001)
    unit = ratio * (1.3147 - ratio * (0.2343 + 0.0804 * ratio))
    image = np.zeros((COLUMNS, ROWS), np.int16)
    left = (azimuth_unit > 1.0) & (azimuth_unit < 3.0)  # within 45 degrees of the y axis
    tangent = np.interp(np.abs(2.0 - azimuth_unit[left]), unit, ratio) * np.sign(
        2.0 - azimuth_unit[left]
    )  # x / y
    for y in (30.0, 10.0):
        x = x_m + y * tangent
        hit = np.full(len(x), y == 30.0)
        for begin, end in objects if y == 10.0 else ():
            hit |= (x >= begin) & (x <= end)
        range_m = y * np.sqrt(1.0 + tangent**2)
        image[left] = np.where(hit[:, None], np.round(range_m * 512.0)[:, None], image[left])
    descriptor = np.zeros(FROM_SCENE + 12)
    descriptor[:FROM_SCENE] = 1.0 / 512.0, 0, COLUMNS, ROWS, -0.5, (ROWS - 1.0) / 1.0
    pose = np.eye(4)
    pose[0, 3] = -x_m
    descriptor[FROM_SCENE:] = pose[:3].ravel()
    return image.ravel(), descriptor


def stood_at(x, first_object, last_object, fraction, length_m=4.0, pose=None):
    """Whether an object stood at (x, 10.2, 0), seen by scans at x = 0 and x = `length_m`.

    `pose` moves all of it: scans, objects, and the point.
    """
    near_pixels, nearest = scan_at(0.0, [first_object])
    far_pixels, bracketing = scan_at(length_m, [last_object])
    bracketing[1] = len(near_pixels)  # offset
    pixels = np.concatenate([near_pixels, far_pixels])
    pose = np.eye(4) if pose is None else pose
    for descriptor in (nearest, bracketing):
        moved = descriptor[FROM_SCENE:].reshape(3, 4) @ inverse(pose)
        descriptor[FROM_SCENE:] = moved.ravel()
    point = pose[:3, :3] @ [x, 10.2, 0.0] + pose[:3, 3]
    direction = np.array([*pose[:2, 0], fraction])
    return bool(was_occupied(pixels, nearest, bracketing, *point, direction, RULE))


@pytest.mark.parametrize("fraction", [0.25, 0.5, 0.75])
@pytest.mark.parametrize(("first_x", "last_x"), [(-1.0, 2.5), (2.5, -1.0)])
def test_an_object_stood_on_its_way_between_two_scans(first_x, last_x, fraction):
    """It is 0.6 m wide, and moved 3.5 m: the search moves by 0.5, 1.5, 2.5 ... m either way."""
    there = first_x + fraction * (last_x - first_x)
    objects = (first_x - 0.3, first_x + 0.3), (last_x - 0.3, last_x + 0.3)
    assert stood_at(there, *objects, fraction)
    for aside in (-1.0, 1.0):
        assert not stood_at(there + aside, *objects, fraction)


@pytest.mark.parametrize(("yaw_deg", "roll_deg"), [(90.0, 0.0), (200.0, 0.0), (200.0, 25.0)])
def test_the_rule_does_not_depend_on_the_axes_of_the_scene(yaw_deg, roll_deg):
    """The roll is about the way of the sensor, which stays level."""
    turn = Rotation.from_euler("ZX", [yaw_deg, roll_deg], degrees=True)
    pose = rigid(turn.as_matrix(), [30.0, -20.0, 5.0])
    objects = (-1.3, -0.7), (2.2, 2.8)
    for x in np.arange(-2.0, 3.5, 0.35):
        for fraction in (0.25, 0.75):
            expected = stood_at(x, *objects, fraction)
            assert stood_at(x, *objects, fraction, pose=pose) == expected
    assert stood_at(-1.0 + 0.25 * 3.5, *objects, 0.25, pose=pose)


def test_objects_farther_apart_than_the_reach_are_two():
    """5.5 m is the last step below 6 m."""
    for apart, same in ((5.5, True), (6.5, False)):
        assert stood_at(1.0 + 0.5 * apart, (0.7, 1.3), (0.7 + apart, 1.3 + apart), 0.5) == same


def test_an_object_that_both_scans_see_in_both_places_did_not_move():
    """A row of parked cars: neither place is free in the other scan."""
    assert not stood_at(1.0, (-3.0, 5.0), (-3.0, 5.0), 0.5)
