"""Analytic worlds: the formulas against cast rays and against answers worked out on paper."""

import numpy as np
import pytest

from intervis.lab.worlds import analytic
from intervis.lab.worlds.analytic import ANALYTIC_WORLDS, AnalyticWorld
from intervis.lab.worlds.scanner import Scanner

NAMES = sorted(ANALYTIC_WORLDS)


def pairs(world: AnalyticWorld, rng, number: int):
    """Pairs of free points, most of them near the ground and the obstacle."""
    low = np.maximum(world.lower, [-6, -7, world.lower[2]])
    high = np.minimum(world.upper, [40, 7, world.lower[2] + 5])
    points = rng.uniform(low, high, (4 * number, 3))
    points = points[world.free(points)][: 2 * number]
    half = len(points) // 2
    return points[:half], points[half : 2 * half]


@pytest.mark.parametrize("name", NAMES)
def test_formula_is_the_ray_casters_answer(name: str, rng) -> None:
    world = ANALYTIC_WORLDS[name]()
    first, second = pairs(world, rng, 20_000)
    assert len(first) > 5000
    expected = world.visible(first, second)
    got = ~world.world().at(0.0).caster.blocked(first, second)
    # Lines that touch a surface are decided by rounding: left out if a shift of 1 mm matters.
    sure = np.ones(len(first), np.bool_)
    for shift in np.concatenate([np.eye(3), -np.eye(3)]) * 1e-3:
        sure &= world.visible(first + shift, second + shift) == expected
    if name == "sphere":
        inner = analytic.sphere(2.0 - analytic.sagitta_m() - 1e-6)
        sure &= inner.visible(first, second) == expected
    assert sure.mean() > 0.99
    np.testing.assert_array_equal(got[sure], expected[sure])
    if name != "plane":
        assert 0.02 < (~expected).mean() < 0.9


@pytest.mark.parametrize("name", NAMES)
def test_formula_is_reciprocal(name: str, rng) -> None:
    world = ANALYTIC_WORLDS[name]()
    first, second = pairs(world, rng, 5000)
    np.testing.assert_array_equal(world.visible(first, second), world.visible(second, first))


def test_answers_worked_out_on_paper() -> None:
    # Step of 2.5 m at x = 8, viewpoint at 1.73 m: over its edge the line rises 0.77 m on 8 m, so at
    # x = 24 it is 1.73 + 24 * 0.09625 = 4.04 m up.
    step = analytic.step()
    seen = step.visible(
        [0.0, 0, 1.73], [[24.0, 3, 4.03], [24, 3, 4.05], [7.9, 0, 0], [8.1, 0, 2.5]]
    )
    assert seen.tolist() == [False, True, True, False]
    # Wall of 3 m at x = 10, 6 m to either side; viewpoint at 1 m: at x = 20 the shadow is 5 m high.
    wall = analytic.wall()
    seen = wall.visible([0.0, 0, 1], [[20.0, 0, 4.9], [20, 0, 5.1], [20, 12.1, 1], [20, 11.9, 1]])
    assert seen.tolist() == [False, True, True, False]
    # Sphere of 2 m at 10 m: tangents from the viewpoint leave at asin(2 / 10) = 11.537 degrees.
    sphere = analytic.sphere()
    at = np.radians([11.5, 11.6])
    targets = np.stack([20 * np.cos(at), 20 * np.sin(at), [2.5, 2.5]], axis=1)
    assert sphere.visible([0.0, 0, 2.5], targets).tolist() == [False, True]
    # Valley 3 m deep from x = 6 to 14: from 1.73 m the far bottom at x = 14 is at slope -0.338,
    # the shoulder at x = 6 is at -0.288: occluded; the ridge (34, 1) is visible, (42, -1) behind it
    # is not.
    valley = analytic.valley()
    seen = valley.visible([0.0, 0, 1.73], [[14.0, 0, -3], [34, 0, 1], [42, 0, -1], [26, 0, -3]])
    assert seen.tolist() == [False, True, False, True]
    # Box 1.5 m high from x = 8 to 12, viewpoint at 1.73: the far edge's line meets the ground at
    # 12 * 1.73 / 0.23 = 90 m; half as far, behind the box, it is occluded.
    box = analytic.box()
    seen = box.visible([0.0, 0, 1.73], [[45.0, 0, 0], [45, 0, 1.6], [7.9, 0, 0], [45, 12, 0]])
    assert seen.tolist() == [False, True, True, True]
    assert analytic.plane().visible([0.0, 0, 1], [50.0, 3, 0.0]).tolist() == [True]


def test_free_excludes_ground_bodies_and_beyond() -> None:
    inside = analytic.box().free([[10.0, 0, 1], [10, 0, 2], [10, 0, -1], [1000, 0, 1]])
    assert inside.tolist() == [False, True, False, False]
    assert analytic.valley().free([[20.0, 0, -1], [0, 0, -1]]).tolist() == [True, False]


@pytest.mark.parametrize("name", NAMES)
def test_scans_of_analytic_worlds_lie_on_them(name: str, rng) -> None:
    world = ANALYTIC_WORLDS[name]()
    scanner = Scanner(columns=400, noise_m=0.0, dropout=0.0, least_signal=0.0, roof=None)
    snapshot = world.world().at(0.0)
    points, attributes = scanner.scan(snapshot, world.world().vehicle_pose_at(0.0), rng)
    assert len(points) > 8000
    positions = points.astype(np.float64) + world.sensor
    corner, *_ = world.triangles[attributes["triangle"]].transpose(1, 0, 2)
    off = np.einsum("ij,ij->i", positions - corner, snapshot.normals[attributes["triangle"]])
    assert np.abs(off).max() < 1e-4
    # A point slightly in front of a return is visible from the sensor.
    in_front = positions - 0.03 * (positions - world.sensor) / np.linalg.norm(
        positions - world.sensor, axis=1, keepdims=True
    )
    inside = world.free(in_front)
    assert world.visible(world.sensor, in_front[inside]).all()
