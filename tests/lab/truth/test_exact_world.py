"""Exact worlds: labels with known answers, and query sets in a yard of known geometry."""

import numpy as np
import pytest
from yard import GROUND, SENSOR, YARD, box, scan_of

from intervis.lab.truth.baselines import InputScans
from intervis.lab.truth.exact_world import (
    Sampling,
    _sphere_directions,
    exact_labels,
    exact_query_sets,
    in_the_open,
)
from intervis.lab.worlds.ray_casting import RayCaster
from intervis.transform import transform

SMALL = Sampling(viewpoints=3, returns=200, free_points=200, anywhere=300, seed=1)


def inputs_of(scan):
    return InputScans((4,), (scan,), (SENSOR,), 4, 4)


@pytest.mark.parametrize(
    ("x", "is_return", "expected"),
    [
        # a wall at 10 m; s = 0.15 + 0.01 x
        (9.9, False, "visible"),
        (10.05, False, None),
        (10.24, False, None),
        (10.27, False, "occluded"),
        (9.9, True, "visible"),
        (10.24, True, "visible"),
        (10.27, True, None),
        (10.50, True, None),
        (10.52, True, "occluded"),
        (0.9, False, None),
        (76.0, True, None),
        (74.0, True, "occluded"),
    ],
)
def test_labels_at_a_wall(x, is_return, expected):
    wall = RayCaster(np.array([[[10.0, -999, -999], [10, 999, -999], [10, 0, 999]]]))
    visible, occluded = exact_labels(
        wall, np.zeros(3), np.array([[x, 0.0, 0]]), np.array([is_return])
    )
    assert (bool(visible[0]), bool(occluded[0])) == (expected == "visible", expected == "occluded")


def test_returns_are_visible_from_their_sensor():
    scan = scan_of(YARD, SENSOR, noise_m=0.02)
    targets = transform(SENSOR, scan)
    every = np.ones(len(targets), bool)
    visible, occluded = exact_labels(RayCaster(YARD), SENSOR[:3, 3], targets, every)
    assert not occluded.any()
    near = np.linalg.norm(scan, axis=1) < 75
    assert visible[near].all()


def test_inside_is_not_in_the_open():
    caster = RayCaster(YARD)
    points = np.array([[0.0, 0, 1], [12, 0, 1], [12, 0, 6], [7.9, 0, 0.1], [0, 0, -1]])
    assert in_the_open(caster, points).tolist() == [True, False, True, True, False]
    for point, expected in zip(points, [True, False, True, True, False], strict=True):
        assert in_the_open(caster, point[None]).tolist() == [expected]


def test_directions_are_spread_evenly_over_the_sphere():
    directions = _sphere_directions(400)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0)
    assert (np.diff(directions[:, 2]) < 0).all()  # from the top
    apart = np.linalg.norm(directions[:, None] - directions, axis=2) + 9 * np.eye(400)
    # each direction has 4 pi / 400 of the sphere: a spacing of about 0.18
    assert 0.12 < apart.min()
    assert apart.min(axis=1).max() < 0.2


def test_viewpoints_and_targets_lie_in_their_regions():
    scan = scan_of(YARD, SENSOR, noise_m=0.02)
    query_sets = list(exact_query_sets(inputs_of(scan), RayCaster(YARD), SMALL))
    assert len(query_sets) == 3
    for query_set in query_sets:
        x, y, z = query_set.viewpoint
        assert np.hypot(x, y) <= 12
        assert 0.5 <= z <= 3
        assert x < 8 - 0.25 or abs(y) > 6 + 0.25  # not inside the house, nor near its walls
        free = query_set.targets[query_set.subsets["anywhere"]]
        inside = (free > [8, -6, 0]).all(axis=1) & (free < [16, 6, 5]).all(axis=1)
        assert not inside.any()
        assert (np.hypot(free[:, 0], free[:, 1]) <= 40).all()
        assert free[:, 2].min() >= 0.2
        assert free[:, 2].max() <= 4.0
        assert free[:, 2].max() > 3.5
        returns = query_set.targets[query_set.subsets["returns"]]
        scan_world = transform(SENSOR, scan)
        nearest = np.abs(returns[:, None] - scan_world).sum(axis=2).min(axis=1)
        assert nearest.max() < 1e-9
        on_beams = query_set.targets[query_set.subsets["free points"]] - SENSOR[:3, 3]
        directions = on_beams / np.linalg.norm(on_beams, axis=1)[:, None]
        cosine = directions @ (scan / np.linalg.norm(scan, axis=1)[:, None]).T
        np.testing.assert_allclose(cosine.max(axis=1), 1.0, atol=1e-9)
        kinds = [query_set.subsets[name] for name in ("returns", "free points", "anywhere")]
        assert (np.sum(kinds, axis=0) == 1).all()
        assert (query_set.overall == ~query_set.subsets["anywhere"]).all()


def test_labels_agree_with_a_slab_test():
    # a segment against an axis-aligned box, by the slab method
    for query_set in exact_query_sets(inputs_of(scan_of(YARD, SENSOR)), RayCaster(YARD), SMALL):
        free = ~query_set.subsets["returns"]
        for target, visible in zip(query_set.targets[free], query_set.visible[free], strict=True):
            offset = target - query_set.viewpoint
            enter, leave = 0.0, 1.0
            for axis, (low, high) in enumerate([(8, 16), (-6, 6), (0, 5)]):
                one, other = sorted(
                    (bound - query_set.viewpoint[axis]) / offset[axis] for bound in (low, high)
                )
                enter, leave = max(enter, one), min(leave, other)
            assert visible == (enter > leave)


def test_viewpoints_outside_the_elevation_range_are_not_in_scanned_space():
    scan = scan_of(YARD, SENSOR)
    highest = np.degrees(np.arctan2(scan[:, 2], np.hypot(scan[:, 0], scan[:, 1]))).max()
    found = set()
    many = Sampling(viewpoints=40, returns=5, free_points=5, anywhere=5)
    for query_set in exact_query_sets(inputs_of(scan), RayCaster(YARD), many):
        x, y, z = query_set.viewpoint - SENSOR[:3, 3]
        elevation = np.degrees(np.arctan2(z, np.hypot(x, y)))
        if x > 8:
            continue  # the house may occlude it
        expected = -25.01 < elevation <= highest
        scanned = query_set.subsets["from scanned space"]
        assert (scanned == (query_set.overall & expected)).all()
        found.add(expected)
    assert found == {True, False}


def test_both_labels_and_all_kinds_occur():
    for query_set in exact_query_sets(inputs_of(scan_of(YARD, SENSOR)), RayCaster(YARD), SMALL):
        for name in ("returns", "free points", "anywhere"):
            assert query_set.subsets[name].sum() > 50
        assert query_set.visible.any()
        assert not query_set.visible.all()


def test_equal_seeds_give_equal_query_sets():
    scan = scan_of(YARD, SENSOR)
    first, again = (
        list(exact_query_sets(inputs_of(scan), RayCaster(YARD), SMALL)) for _ in range(2)
    )
    for one, other in zip(first, again, strict=True):
        np.testing.assert_array_equal(one.targets, other.targets)
        np.testing.assert_array_equal(one.viewpoint, other.viewpoint)
    (another, *_) = exact_query_sets(
        inputs_of(scan), RayCaster(YARD), Sampling(1, 10, 10, 10, seed=2)
    )
    assert not np.array_equal(another.viewpoint, first[0].viewpoint)


def test_an_enclosed_sensor_gives_no_query_set():
    cell = np.concatenate([GROUND, box([-30, -30, -0.5], [30, 30, 9])])
    assert list(exact_query_sets(inputs_of(scan_of(cell, SENSOR)), RayCaster(cell), SMALL)) == []
