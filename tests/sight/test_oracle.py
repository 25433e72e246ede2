"""The fast engine against the slow oracle, on made scenes and on a real drive."""

import numpy as np
import pytest
from made_scans import street_scan, turned

from intervis.sight import Scene
from intervis.sight.engine import judge_lines
from intervis.sight.oracle import judge_line
from intervis.sight.scene import _ordered


@pytest.fixture(scope="module")
def scene() -> Scene:
    scene = Scene(sensor="HDL-64E")
    for number in range(8):
        pose = turned(0.05 * number, 1.3 * number, 0.1 * number)
        scene.add(street_scan(pose, seed=number), pose, 0.1 * number)
    return scene


def random_lines(rng: np.random.Generator, count: int):
    """Lines of every kind: all octants, grazing the ground, radial, far away, of no length."""
    a = rng.normal(0.0, 1.0, (count, 3)) * [12.0, 12.0, 1.5]
    b = rng.normal(0.0, 1.0, (count, 3)) * [25.0, 25.0, 2.5]
    kind = rng.integers(0, 8, count)
    a[kind == 0] = 0.0  # from the first sensor
    a[kind == 1, 2] = b[kind == 1, 2] = -1.72  # along the ground
    b[kind == 2] = a[kind == 2] * 3.0  # radial
    b[kind == 3, 2] += 40.0  # up into the sky
    b[kind == 4] *= 30.0  # beyond every range
    b[kind == 5] = a[kind == 5]  # the target is the viewpoint
    b[kind == 6] = a[kind == 6] + rng.normal(0, 0.3, (int((kind == 6).sum()), 3))
    return a, b


def compare(scene: Scene, a, b, moment_s=None) -> None:
    memory = scene._packed(moment_s)
    found = judge_lines(memory, *_ordered(a, b))
    for i in range(len(a)):
        verdict = judge_line(memory, a[i], b[i])
        assert found.open[i] == pytest.approx(verdict.open, abs=1e-9), (a[i], b[i])
        assert found.hidden[i] == pytest.approx(verdict.hidden, abs=1e-9), (a[i], b[i])
        assert found.seen[i] == pytest.approx(verdict.seen, abs=1e-9), (a[i], b[i])
        assert found.unknown_m[i] == pytest.approx(verdict.unknown_m, abs=1e-9), (a[i], b[i])
        assert found.shadow_m[i] == pytest.approx(verdict.shadow_m, abs=1e-9), (a[i], b[i])
        assert found.apart_s[i] == pytest.approx(verdict.apart_s, abs=1e-12), (a[i], b[i])


def test_engine_agrees_with_oracle_in_all_octants(scene, rng):
    compare(scene, *random_lines(rng, 3000))


@pytest.mark.parametrize("moment_s", [-1.0, 0.0, 0.13, 0.4, 0.68, 3.0])
def test_engine_agrees_with_oracle_at_any_moment(scene, rng, moment_s):
    compare(scene, *random_lines(rng, 500), moment_s)


def test_states_are_the_oracles(scene, rng):
    a, b = random_lines(rng, 400)
    for moment_s in (None, 0.55):
        sight = scene.sight_lines(a, b, moment_s=moment_s)
        memory = scene._packed(moment_s)
        verdicts = [judge_line(memory, p, q) for p, q in zip(a, b, strict=True)]
        states = [verdict.state for verdict in verdicts]
        assert sight.state.tolist() == states
        assert set(states) == {-1, 0, 1}, "the lines must exercise all three answers"
        probability = [verdict.probability for verdict in verdicts]
        np.testing.assert_allclose(sight.probability, probability, rtol=0, atol=1e-12)


def test_one_scans_answers_are_the_oracles(rng):
    alone = Scene.from_scan(street_scan(turned(0.0, 0.0, 0.0), seed=3))
    a, b = random_lines(rng, 300)
    verdicts = [judge_line(alone._packed(), p, q) for p, q in zip(a, b, strict=True)]
    sight = alone.sight_lines(a, b)
    assert sight.state.tolist() == [verdict.state for verdict in verdicts]
    probability = [verdict.probability for verdict in verdicts]
    np.testing.assert_allclose(sight.probability, probability, rtol=0, atol=1e-12)


def test_engine_agrees_between_returns(scene, rng):
    """Ends on surfaces, through gaps, behind things: lines between returns of two scans."""
    first = street_scan(turned(0.0, 0.0, 0.0), seed=0)
    a = first[rng.integers(0, len(first), 1500)].astype(np.float64)
    b = first[rng.integers(0, len(first), 1500)].astype(np.float64)
    compare(scene, a, b)


@pytest.mark.slow
def test_engine_agrees_on_many_lines(scene, rng):
    """A fifth of a million; raise the count for an idle machine, 15 minutes a million."""
    for part in range(10):
        compare(scene, *random_lines(rng, 20_000), None if part % 2 else 0.08 * part)
