"""The fast engine against the slow reference, on made scenes and on a real drive."""

import numpy as np
import pytest
from made_scans import street_scan, turned

from intervis.drives import open_drive
from intervis.sight import Scene
from intervis.sight import occupancy_model as model
from intervis.sight.answers import sum_lines
from intervis.sight.kernels.packed_scans import depth_at, descriptors_of
from intervis.sight.reference import (
    _chosen_scans,
    _depth_behind_surface,
    attenuation_per_m,
    reference_result,
    reference_samples,
)
from intervis.transform import transform


@pytest.fixture(scope="module")
def scene() -> Scene:
    scene = Scene(sensor="HDL-64E")
    for number in range(8):
        pose = turned(0.05 * number, 1.3 * number, 0.1 * number)
        pose[2, 3] = 0.15 * (number % 3)  # the road is not flat
        scene.add(street_scan(pose, seed=number), pose, 0.1 * number)
    return scene


def random_lines(rng: np.random.Generator, count: int):
    """Lines of every kind: all octants, grazing the ground, radial, far away, of no length."""
    a = rng.normal(0.0, 1.0, (count, 3)) * [12.0, 12.0, 1.5]
    b = rng.normal(0.0, 1.0, (count, 3)) * [25.0, 25.0, 2.5]
    kind = rng.integers(0, 9, count)
    a[kind == 0] = 0.0  # from the first sensor
    a[kind == 1, 2] = b[kind == 1, 2] = -1.72  # along the ground
    b[kind == 2] = a[kind == 2] * 3.0  # radial
    b[kind == 3, 2] += 40.0  # up into the sky
    b[kind == 4] *= 30.0  # beyond every range
    b[kind == 5] = a[kind == 5]  # the target is the viewpoint
    # Both ends equally far from the first sensor. Mirrored in a diagonal: on the x axis, where
    # range images begin and end, rounding decides between the first and the last column.
    b[kind == 8] = a[kind == 8][:, [1, 0, 2]]
    b[kind == 6] = a[kind == 6] + rng.normal(0, 0.3, (int((kind == 6).sum()), 3))
    return a, b


def compare(scene: Scene, a, b, moment_s=None) -> None:
    scans = scene.packed_scans(moment_s)
    sums = sum_lines(scans, a, b)
    results = [reference_result(scans, p, q) for p, q in zip(a, b, strict=True)]
    depths = ("free", "unobserved", "surface", "movable")
    lengths = ("unobserved_m", "occluded_space_m", "end_occluded_m")
    for name in (*depths, *lengths, "time_gap_s", "bracketed"):
        expected = np.array([getattr(result, name) for result in results])
        np.testing.assert_allclose(getattr(sums, name), expected, rtol=1e-9, atol=1e-9)


def test_engine_agrees_with_reference_in_all_octants(scene, rng):
    compare(scene, *random_lines(rng, 3000))


@pytest.mark.parametrize("moment_s", [-1.0, 0.0, 0.13, 0.4, 0.68, 3.0])
def test_engine_agrees_with_reference_at_any_moment(scene, rng, moment_s):
    a, b = random_lines(rng, 500)
    compare(scene, a, b, moment_s)
    one, back = (scene.sight_lines(*ends, moment_s=moment_s) for ends in ((a, b), (b, a)))
    for there, here in zip(vars(one).values(), vars(back).values(), strict=True):
        assert np.array_equal(there, here, equal_nan=True)


def test_states_are_the_references(scene, rng):
    a, b = random_lines(rng, 400)
    for moment_s in (None, 0.55):
        sight = scene.sight_lines(a, b, moment_s=moment_s)
        scans = scene.packed_scans(moment_s)
        results = [reference_result(scans, p, q) for p, q in zip(a, b, strict=True)]
        states = [result.state for result in results]
        assert sight.state.tolist() == states
        assert set(states) == {-1, 0, 1}, "the lines must exercise all three answers"
        observed = [result.observed for result in results]
        np.testing.assert_allclose(sight.observed, observed, rtol=0, atol=1e-9)
        probability = [result.probability for result in results]
        np.testing.assert_allclose(sight.probability, probability, rtol=0, atol=1e-12)


def test_one_scans_answers_are_the_references(rng):
    alone = Scene.from_scan(street_scan(turned(0.0, 0.0, 0.0), seed=3))
    a, b = random_lines(rng, 300)
    results = [reference_result(alone.packed_scans(), p, q) for p, q in zip(a, b, strict=True)]
    sight = alone.sight_lines(a, b)
    assert sight.state.tolist() == [result.state for result in results]
    probability = [result.probability for result in results]
    np.testing.assert_allclose(sight.probability, probability, rtol=0, atol=1e-12)


def expected_occluder(scans, a, b):
    """Sample at a surface with the highest attenuation, and the rank of the scan that shows it."""
    line = reference_samples(scans, a, b)
    attenuation = np.where(line.at_surface, attenuation_per_m(line), 0.0)
    if not len(attenuation) or attenuation.max() == 0.0:
        return None
    m = int(np.argmax(attenuation))  # the first one from the lexicographically smaller end
    depth = line.depth[:, m]
    with np.errstate(invalid="ignore"):
        near = np.where(line.known[:, m] & (depth >= model.SURFACE_FROM_M), np.abs(depth), np.inf)
    return m, near, bool(line.occupied[m]), float(attenuation.max())


@pytest.mark.parametrize("moment_s", [None, 0.33])
def test_the_occluding_sample_and_its_scan_are_the_references(scene, rng, moment_s):
    scans = scene.packed_scans(moment_s)
    a, b = random_lines(rng, 2000)
    sums = sum_lines(scans, a, b)
    checked = dynamic = 0
    for i in range(len(a)):
        expected = expected_occluder(scans, a[i], b[i])
        if expected is None:
            assert sums.occluder_scan[i] == -1
            continue
        m, near, occupied, _ = expected
        line = reference_samples(scans, a[i], b[i])
        length = np.linalg.norm(b[i] - a[i])
        first = min(int(np.floor(0.4 / line.step + 0.5)), (round(length / line.step) + 1) // 2)
        assert sums.occluder_m[i] == pytest.approx((m + first + 0.5) * line.step, abs=1e-6)
        chosen = _chosen_scans(scans, *sorted((a[i], b[i]), key=tuple))
        rank = int(np.argmin(near))
        if occupied and near[rank] > model.SURFACE_TO_M:
            dynamic += 1  # the object of the rule: one of the two bracketing scans shows it
            continue
        assert sums.occluder_scan[i] == chosen[rank]
        checked += 1
    assert checked > 200, "most lines must meet something"


def test_depths_agree_at_the_seam_of_the_range_image(rng):
    """Azimuth 0 and a full turn meet on the x axis: -1e-18 rounds to a full turn."""
    scans = Scene.from_scan(street_scan(turned(0.0, 0.0, 0.0), seed=3)).packed_scans()
    x, z = rng.uniform(1.0, 40.0, 400), rng.uniform(-2.0, 0.3, 400)
    points = np.stack([x, rng.choice([-1e-18, 0.0, -1e-300, 1e-18], 400), z], axis=1)
    expected, _, known, _ = _depth_behind_surface(scans, 0, points)
    descriptor = descriptors_of(scans)[0]
    found = [depth_at(scans.pixels, descriptor, *point) for point in points]
    assert known.sum() > 100
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_engine_agrees_between_returns(scene, rng):
    """Ends on surfaces, through gaps, behind things: lines between returns of two scans."""
    first = street_scan(turned(0.0, 0.0, 0.0), seed=0)
    a = first[rng.integers(0, len(first), 1500)].astype(np.float64)
    b = first[rng.integers(0, len(first), 1500)].astype(np.float64)
    compare(scene, a, b)


@pytest.mark.slow
@pytest.mark.parametrize("part", range(20))
def test_engine_agrees_on_two_million_lines(scene, part):
    """All kinds of lines, half of them at a moment; two minutes for each twentieth."""
    rng = np.random.default_rng([7, part])
    for number in range(10):
        moment_s = rng.uniform(-0.5, 1.5) if number % 2 else None
        compare(scene, *random_lines(rng, 10_000), moment_s)


@pytest.mark.slow
@pytest.mark.realdata
@pytest.mark.parametrize("scans", [1, 12])
def test_engine_agrees_on_real_scans(shared_data, rng, scans):
    drive = open_drive(shared_data / "pcd_drive")
    scene, points = Scene(), []
    for number in drive.frame_numbers[:scans]:
        frame = drive[number]
        scene.add(frame.points, frame.pose, 0.1 * number)
        points.append(transform(frame.pose, frame.points[:, :3].astype(np.float64)))
    returns = np.vstack(points)
    for moment_s in (None, 0.35, 2.0):
        a = returns[rng.integers(0, len(returns), 20_000)]
        b = returns[rng.integers(0, len(returns), 20_000)]
        a[::2] = scene.poses[0, :3, 3] + rng.normal(0.0, 4.0, (10_000, 3)) * [1.0, 1.0, 0.1]
        compare(scene, a, b, moment_s)
