"""Both casters against the textbook, and against each other."""

import numpy as np
import pytest

from intervis.errors import MissingExtraError
from intervis.lab.truth import rays
from intervis.lab.truth.rays import BuiltInCaster, EmbreeCaster, caster_of


def moller_trumbore(triangles, origin, end):
    """Distance of the first hit on a segment, the textbook way; inf for none."""
    best, way = np.inf, end - origin
    for a, b, c in triangles:
        matrix = np.column_stack([b - a, c - a, -way])
        if abs(np.linalg.det(matrix)) < 1e-9:
            continue
        u, v, t = np.linalg.solve(matrix, origin - a)
        if u >= 0 and v >= 0 and u + v <= 1 and 0 <= t <= 1:
            best = min(best, t * np.linalg.norm(way))
    return best


both = pytest.mark.parametrize("caster_of", [EmbreeCaster, BuiltInCaster])


@both
def test_rays_against_the_textbook(caster_of):
    rng = np.random.default_rng(4)
    centre = np.array([4000.0, -2000.0, 100.0])  # far from the origin: float32 must not show
    triangles = centre + rng.uniform(-10, 10, (30, 1, 3)) + rng.normal(0, 3, (30, 3, 3))
    origins, ends = centre + rng.uniform(-12, 12, (2, 300, 3))
    caster = caster_of(triangles)
    expected = [moller_trumbore(triangles, *pair) for pair in zip(origins, ends, strict=True)]
    found = caster.first_hit(origins, ends)
    np.testing.assert_allclose(found, expected, atol=1e-3)
    np.testing.assert_array_equal(caster.blocked(origins, ends), np.isfinite(expected))
    assert 50 < np.isfinite(expected).sum() < 250
    slack = 3.0
    length = np.linalg.norm(ends - origins, axis=1)
    np.testing.assert_array_equal(
        caster.blocked(origins, ends, slack_m=slack), np.array(expected) < length - slack
    )


@both
def test_rays_without_triangles_or_length(caster_of):
    nothing = caster_of(np.empty((0, 3, 3)))
    assert not nothing.blocked(np.zeros(3), np.ones((2, 3))).any()
    assert np.isinf(nothing.first_hit(np.zeros(3), np.ones((2, 3)))).all()
    assert nothing.first_hit(np.zeros(3), np.empty((0, 3))).shape == (0,)
    caster = caster_of(np.array([[[2.0, -9, -9], [2, 9, -9], [2, 0, 9]]]))
    assert np.isinf(caster.first_hit(np.zeros(3), np.zeros((1, 3)))).all()
    assert not caster.blocked(np.zeros(3), np.array([[3.0, 0, 0]]), slack_m=5.0)[0]


def test_both_casters_agree_on_many_segments():
    rng = np.random.default_rng(5)
    triangles = rng.uniform(-20, 20, (3000, 1, 3)) + rng.normal(0, 1, (3000, 3, 3))
    origins, ends = rng.uniform(-25, 25, (2, 50_000, 3))
    embree, own = EmbreeCaster(triangles), BuiltInCaster(triangles)
    hit, other = embree.first_hit(origins, ends), own.first_hit(origins, ends)
    # float32 against float64: segments that graze an edge may differ
    assert np.mean(np.isclose(hit, other, rtol=0, atol=1e-3)) > 0.9995
    assert 0.2 < np.mean(np.isfinite(hit)) < 0.9
    blocked = embree.blocked(origins, ends, slack_m=2.0)
    assert np.mean(blocked == own.blocked(origins, ends, slack_m=2.0)) > 0.9995


def test_without_embree_the_built_in_caster_casts(monkeypatch):
    assert caster_of(np.empty((0, 3, 3))).name == "Embree"
    monkeypatch.setattr(rays, "find_spec", lambda name: None)
    assert caster_of(np.empty((0, 3, 3))).name == "built-in"


def test_asking_for_embree_without_it_names_the_extra(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "embreex.mesh_construction", None)
    with pytest.raises(MissingExtraError, match=r"intervis\[dev\]"):
        EmbreeCaster(np.empty((0, 3, 3)))
