"""Exact worlds: answers on paper, and a yard whose walls, roof and gaps are known."""

import numpy as np
import pytest
from yard import GROUND, SENSOR, YARD, box, scan_of

from intervis.lab.truth.baselines import Seen
from intervis.lab.truth.exact import Sampling, in_the_open, questions, truth
from intervis.lab.worlds.ray_casting import RayCaster
from intervis.transform import transform

SMALL = Sampling(viewpoints=3, returns=200, free_points=200, anywhere=300, seed=1)


def seen_of(scan):
    return Seen((4,), (scan,), (SENSOR,), 4, 4)


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
def test_truth_at_a_wall(x, is_return, expected):
    wall = RayCaster(np.array([[[10.0, -999, -999], [10, 999, -999], [10, 0, 999]]]))
    visible, occluded = truth(wall, np.zeros(3), np.array([[x, 0.0, 0]]), np.array([is_return]))
    assert (bool(visible[0]), bool(occluded[0])) == (expected == "visible", expected == "occluded")


def test_returns_are_visible_from_their_sensor():
    scan = scan_of(YARD, SENSOR, noise_m=0.02)
    targets = transform(SENSOR, scan)
    every = np.ones(len(targets), bool)
    visible, occluded = truth(RayCaster(YARD), SENSOR[:3, 3], targets, every)
    assert not occluded.any()
    near = np.linalg.norm(scan, axis=1) < 75
    assert visible[near].all()


def test_inside_is_not_in_the_open():
    caster = RayCaster(YARD)
    points = np.array([[0.0, 0, 1], [12, 0, 1], [12, 0, 6], [7.9, 0, 0.1], [0, 0, -1]])
    assert in_the_open(caster, points).tolist() == [True, False, True, True, False]


def test_what_is_asked_lies_where_it_should():
    scan = scan_of(YARD, SENSOR, noise_m=0.02)
    asked = list(questions(seen_of(scan), RayCaster(YARD), SMALL))
    assert len(asked) == 3
    for question in asked:
        x, y, z = question.viewpoint
        assert np.hypot(x, y) <= 12
        assert 0.5 <= z <= 3
        assert x < 8 - 0.25 or abs(y) > 6 + 0.25  # not in the house, nor beside its wall
        free = question.targets[question.parts["anywhere"]]
        inside = (free > [8, -6, 0]).all(axis=1) & (free < [16, 6, 5]).all(axis=1)
        assert not inside.any()
        assert (np.hypot(free[:, 0], free[:, 1]) <= 40).all()
        assert free[:, 2].min() >= 0.2
        assert free[:, 2].max() <= 4.0
        assert free[:, 2].max() > 3.5
        returns = question.targets[question.parts["returns"]]
        scan_world = transform(SENSOR, scan)
        nearest = np.abs(returns[:, None] - scan_world).sum(axis=2).min(axis=1)
        assert nearest.max() < 1e-9
        on_beams = question.targets[question.parts["free points"]] - SENSOR[:3, 3]
        ways = on_beams / np.linalg.norm(on_beams, axis=1)[:, None]
        cosine = ways @ (scan / np.linalg.norm(scan, axis=1)[:, None]).T
        np.testing.assert_allclose(cosine.max(axis=1), 1.0, atol=1e-9)
        kinds = [question.parts[name] for name in ("returns", "free points", "anywhere")]
        assert (np.sum(kinds, axis=0) == 1).all()
        assert (question.counted == ~question.parts["anywhere"]).all()


def test_the_truth_is_that_of_slabs():
    # a segment against an axis-aligned box, worked out slab by slab, in another language
    for question in questions(seen_of(scan_of(YARD, SENSOR)), RayCaster(YARD), SMALL):
        free = ~question.parts["returns"]
        for target, said in zip(question.targets[free], question.visible[free], strict=True):
            way = target - question.viewpoint
            enter, leave = 0.0, 1.0
            for axis, (low, high) in enumerate([(8, 16), (-6, 6), (0, 5)]):
                one, other = sorted(
                    (bound - question.viewpoint[axis]) / way[axis] for bound in (low, high)
                )
                enter, leave = max(enter, one), min(leave, other)
            assert said == (enter > leave)


def test_viewpoints_over_the_fan_are_told_apart():
    scan = scan_of(YARD, SENSOR)
    highest = np.degrees(np.arctan2(scan[:, 2], np.hypot(scan[:, 0], scan[:, 1]))).max()
    told = set()
    many = Sampling(viewpoints=40, returns=5, free_points=5, anywhere=5)
    for question in questions(seen_of(scan), RayCaster(YARD), many):
        x, y, z = question.viewpoint - SENSOR[:3, 3]
        elevation = np.degrees(np.arctan2(z, np.hypot(x, y)))
        if x > 8:
            continue  # the house may hide it
        expected = -25.01 < elevation <= highest
        scanned = question.parts["from scanned space"]
        assert (scanned == (question.counted & expected)).all()
        told.add(expected)
    assert told == {True, False}


def test_both_answers_occur_and_both_kinds_are_asked():
    for question in questions(seen_of(scan_of(YARD, SENSOR)), RayCaster(YARD), SMALL):
        for name in ("returns", "free points", "anywhere"):
            assert question.parts[name].sum() > 50
        assert question.visible.any()
        assert not question.visible.all()


def test_the_same_seed_asks_the_same():
    scan = scan_of(YARD, SENSOR)
    first, again = (list(questions(seen_of(scan), RayCaster(YARD), SMALL)) for _ in range(2))
    for one, other in zip(first, again, strict=True):
        np.testing.assert_array_equal(one.targets, other.targets)
        np.testing.assert_array_equal(one.viewpoint, other.viewpoint)
    (another, *_) = questions(seen_of(scan), RayCaster(YARD), Sampling(1, 10, 10, 10, seed=2))
    assert not np.array_equal(another.viewpoint, first[0].viewpoint)


def test_a_sensor_shut_in_asks_nothing():
    cell = np.concatenate([GROUND, box([-30, -30, -0.5], [30, 30, 9])])
    assert list(questions(seen_of(scan_of(cell, SENSOR)), RayCaster(cell), SMALL)) == []
