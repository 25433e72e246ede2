"""Each baseline against a brute-force implementation or a case with a known answer."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from intervis.lab.truth.baselines import (
    InputScans,
    all_baselines,
    depth_buffer,
    hidden_points,
    horizon,
    triangulated,
)
from intervis.lab.truth.baselines.voxels import march
from intervis.lab.worlds.ray_casting import RayCaster
from intervis.transform import inverse, rigid, transform

SENSOR_HEIGHT_M = 1.7


def street_scan():
    """Flat ground and a wall: 8 m ahead, 4 m to either side, up to 2 m above the sensor."""
    azimuth = np.radians(np.arange(-180, 180, 0.7))
    elevation = np.radians(np.arange(-25, 15, 0.5))
    a, e = (grid.ravel() for grid in np.meshgrid(azimuth, elevation))
    direction = np.column_stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    with np.errstate(divide="ignore"):
        ground = np.where(direction[:, 2] < 0, -SENSOR_HEIGHT_M / direction[:, 2], np.inf)
        wall = np.where(direction[:, 0] > 0, 8.0 / direction[:, 0], np.inf)
    on_wall = direction * np.where(np.isfinite(wall), wall, 0)[:, None]
    wall[(np.abs(on_wall[:, 1]) > 4) | (on_wall[:, 2] > 2) | (on_wall[:, 0] == 0)] = np.inf
    reach = np.minimum(ground, wall)
    return direction[reach < 60] * reach[reach < 60, None]


SCAN = street_scan()
ALONE = InputScans((0,), (SCAN,), (np.eye(4),), 0, 1)
VIEWPOINT = np.array([3.0, 1.0, 0.2])
IN_FRONT = SCAN[(SCAN[:, 0] > 7.99) & (SCAN[:, 0] < 8.01) & (np.abs(SCAN[:, 1]) < 3)][::7]
BEHIND = np.array([[x, y, -1.0] for x in (12.0, 15.0) for y in (-1.0, 0.0, 1.0)])


@pytest.mark.parametrize("several", [False, True])
def test_every_baseline_separates_the_wall_from_what_is_behind_it(several):
    targets = np.vstack([IN_FRONT, BEHIND])
    for baseline in all_baselines(several_scans=several):
        best = 0.0
        for predict in baseline.settings.values():
            probability = predict(ALONE, VIEWPOINT, targets)
            assert probability.shape == (len(targets),)
            assert ((probability >= 0) & (probability <= 1)).all()
            visible = probability >= 0.5
            correct = np.append(visible[: len(IN_FRONT)], ~visible[len(IN_FRONT) :])
            best = max(best, correct.mean())
        assert best > 0.95, baseline.name


def test_baselines_do_not_depend_on_the_world_frame():
    elsewhere = rigid([[0, -1, 0], [1, 0, 0], [0, 0, 1]], [300.0, -200.0, 5.0])
    there = InputScans((0,), (SCAN,), (elsewhere,), 0, 1)
    targets = np.vstack([IN_FRONT, BEHIND])
    for baseline in all_baselines(several_scans=False):
        for name, predict in baseline.settings.items():
            here = predict(ALONE, VIEWPOINT, targets) >= 0.5
            far = (
                predict(there, transform(elsewhere, VIEWPOINT), transform(elsewhere, targets))
                >= 0.5
            )
            # the borders of cells and voxels lie elsewhere after the rotation: a few answers change
            assert np.mean(here == far) > 0.9, (baseline.name, name)


def test_hidden_point_removal_on_a_sphere():
    rng = np.random.default_rng(1)
    ball = rng.normal(size=(4000, 3))
    ball /= np.linalg.norm(ball, axis=1)[:, None]
    viewpoint = np.array([0.0, 0.0, 5.0])
    # from 5 away the horizon of a unit ball is at z = 1/5; the finite radius blurs it
    visible = hidden_points.hidden_point_removal(ball, viewpoint, 30.0)
    assert visible[ball[:, 2] > 0.35].all()
    assert not visible[ball[:, 2] < 0.05].any()


def test_hidden_point_removal_of_few_points():
    few = np.array([[1.0, 0, 0], [0, 1, 0]])
    assert hidden_points.hidden_point_removal(few, np.zeros(3), 10.0).all()
    assert hidden_points.hidden_point_removal(few[:0], np.zeros(3), 10.0).shape == (0,)
    assert hidden_points.hidden_point_removal(few, few[0], 10.0)[0]


def test_hidden_point_removal_of_targets_that_are_points_of_the_scan():
    # a target equal to a point of the scan gets that point's answer, not that of a duplicate
    probability = hidden_points.predict(ALONE, VIEWPOINT, SCAN, radius_factor=100.0)
    alone = hidden_points.hidden_point_removal(SCAN, VIEWPOINT, 100.0)
    assert np.mean(probability == alone) > 0.999


def test_depth_buffer_against_every_pair():
    rng = np.random.default_rng(2)
    points, targets = rng.normal(0, 8, (300, 3)), rng.normal(0, 8, (200, 3))
    inputs = InputScans((0,), (points,), (np.eye(4),), 0, 1)
    viewpoint = np.array([0.5, 0.2, 0.1])

    def cell(p):
        x, y, z = p - viewpoint
        azimuth = np.degrees(np.arctan2(y, x)) + 180
        elevation = np.degrees(np.arctan2(z, np.hypot(x, y))) + 90
        return int(azimuth // 10) % 36, int(elevation // 20)

    expected = []
    for target in targets:
        r = np.linalg.norm(target - viewpoint)
        beside = [np.linalg.norm(p - viewpoint) for p in points if cell(p) == cell(target)]
        expected.append(not any(near + 0.3 + 0.02 * r < r for near in beside))
    probability = depth_buffer.predict(
        inputs,
        viewpoint,
        targets,
        azimuth_deg=10,
        elevation_deg=20,
        tolerance_m=0.3,
        tolerance_fraction=0.02,
    )
    assert (probability >= 0.5).tolist() == expected
    assert 20 < sum(expected) < 180


def test_horizon_against_every_pair():
    rng = np.random.default_rng(3)
    points, targets = rng.normal(0, 8, (300, 3)), rng.normal(0, 8, (200, 3))
    inputs = InputScans((0,), (points,), (np.eye(4),), 0, 1)

    def polar(p):
        flat = np.hypot(p[0], p[1])
        return int((np.degrees(np.arctan2(p[1], p[0])) + 180) // 10), flat, np.arctan2(p[2], flat)

    expected = []
    for target in targets:
        sector, flat, slope = polar(target)
        before = [s for a, f, s in map(polar, points) if a == sector and f < flat * 0.98 - 0.3]
        expected.append(not any(s > slope for s in before))
    probability = horizon.predict(
        inputs, np.zeros(3), targets, azimuth_deg=10, tolerance_m=0.3, tolerance_fraction=0.02
    )
    assert (probability >= 0.5).tolist() == expected
    assert 20 < sum(expected) < 180


@given(seed=st.integers(0, 2**32 - 1), density=st.sampled_from([0.005, 0.05]))
@settings(max_examples=30, deadline=None)
def test_march_finds_the_voxels_that_fine_steps_find(seed, density):
    rng = np.random.default_rng(seed)
    occupied = rng.random((20, 24, 16)) < density
    origin = rng.uniform(1, 15, 3)
    ends = rng.uniform(1, 15, (40, 3))
    ends[:3] = origin + np.array([[3, 0, 0], [0, -0.5, 0], [0, 0, 0]])  # along axes, and none
    ends = np.clip(ends, 0.5, 15.4)
    clear = np.empty(len(ends), np.bool_)
    march(occupied, origin, ends, 0.0, clear)
    step = np.linspace(0, 1, 20001)[:, None]
    for end, free in zip(ends, clear, strict=True):
        cell = np.floor(origin + step * (end - origin)).astype(int)
        met = occupied[cell[:, 0], cell[:, 1], cell[:, 2]]
        # stepping can miss a corner cut by less than a step, marching cannot
        if met.any() and np.linalg.norm(end - origin) > 0:
            assert not free
        elif not free:
            grazed = np.abs(
                origin + step * (end - origin) - np.round(origin + step * (end - origin))
            )
            assert grazed.min() < 1e-3


def test_march_ignores_voxels_near_both_ends():
    occupied = np.zeros((20, 1, 1), bool)
    origin, end = np.array([0.5, 0.5, 0.5]), np.array([[15.5, 0.5, 0.5]])
    for occupied_x, tolerance, expected in [
        (8, 2.0, False),
        (15, 2.0, True),
        (15, 0.0, False),
        (13, 2.0, True),  # left at 14 - 0.5 = 13.5 > 15 - 2
        (12, 2.0, False),
        (1, 2.0, True),  # left at 1.5
        (2, 2.0, False),
        (18, 0.0, True),  # beyond the end
    ]:
        occupied[:] = False
        occupied[occupied_x] = True
        clear = np.empty(1, np.bool_)
        march(occupied, origin, end, tolerance, clear)
        assert clear[0] == expected, (occupied_x, tolerance)


def test_surface_closes_behind_the_sensor():
    caster = RayCaster(triangulated.surface(SCAN, 0.6))
    back = np.array([[-9.0, y, -3.0] for y in np.linspace(-0.3, 0.3, 31)])  # under the ground
    assert caster.blocked(np.zeros(3), back).all()


def test_surface_is_cut_where_ranges_jump():
    # triangles bridge the range jump between the wall's side (9 m) and the ground beside it (19 m)
    azimuth, elevation = np.radians(np.linspace(26.0, 27.5, 61)), np.radians(-5.25)
    direction = np.column_stack([np.cos(azimuth), np.sin(azimuth), np.full(61, np.tan(elevation))])
    bridged, cut = (
        RayCaster(triangulated.surface(SCAN, jump)).first_hit(np.zeros(3), 18 * direction)
        for jump in (9.0, 0.2)
    )
    on_bridge = (bridged > 9.3) & (bridged < 17)
    assert on_bridge.sum() > 10
    assert np.isinf(cut[on_bridge]).all()
    assert (cut[~np.isinf(cut)] < 9.3).all()


def test_votes():
    empty = np.array([[-5.0, 0, 0], [-5, 1, 0], [-5, 0, 1], [-5, 1, 1]])
    inputs = InputScans((0, 1, 3), (SCAN, empty, SCAN), (np.eye(4),) * 3, 0, 2)
    options = {"jump_fraction": 0.2, "tolerance_m": 0.5, "tolerance_fraction": 0.02}
    probability = [
        triangulated.predict(inputs, VIEWPOINT, BEHIND, votes=votes, **options)
        for votes in (1, 2, 3)
    ]
    assert (probability[0] < 0.5).all()
    assert (probability[1] < 0.5).all()  # two of three block the line
    assert (probability[2] >= 0.5).all()


def test_surfaces_are_meshed_once_and_charged_each_time():
    surfaces = triangulated.SurfaceCache(size=2)
    first = surfaces.caster(SCAN, 0.2)
    once = surfaces.spent_s
    assert surfaces.caster(SCAN, 0.2) is first
    assert surfaces.spent_s == once > 0
    assert surfaces.cost_s == pytest.approx(2 * once)
    for other in (SCAN[::2], SCAN[::3]):
        surfaces.caster(other, 0.2)
    assert surfaces.caster(SCAN, 0.2) is not first  # evicted


def test_nearest_scans():
    scan, pose = np.zeros((1, 3)), np.eye(4)
    inputs = InputScans(tuple(range(10)), (scan,) * 10, (pose,) * 10, 9, 4)
    assert inputs.nearest(2).numbers == (2, 3, 5, 6, 9)
    assert inputs.nearest(0).numbers == (9,)
    outside = InputScans((0, 1, 6), (scan,) * 3, (pose,) * 3, 9, 4)
    assert outside.nearest(3).numbers == (0, 1, 6)


def test_points_world_applies_the_poses():
    pose = rigid([[0, -1, 0], [1, 0, 0], [0, 0, 1]], [10.0, 20.0, 0.0])
    inputs = InputScans((0,), (transform(inverse(pose), SCAN),), (pose,), 0, 1)
    np.testing.assert_allclose(inputs.points_world, SCAN, atol=1e-9)
