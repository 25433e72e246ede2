"""The ray caster against brute force, against Embree, and against what must always hold."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from intervis.errors import PointsError
from intervis.lab.worlds import bvh, shapes
from intervis.lab.worlds.analytic import box
from intervis.lab.worlds.ray_casting import RayCaster
from intervis.lab.worlds.scanner import Scanner

Array = NDArray[np.float64]


def brute_force(triangles: Array, origins: Array, ways: Array, slack: float) -> Array:
    """Nearest ranges (2, R) by plane and barycentric areas: another way than Moeller-Trumbore.

    The first row has every triangle a little too large, by `slack` in barycentric units, the
    second a little too small: between the two lies the truth.
    """
    a, b, c = triangles.transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    square = np.einsum("tj,tj->t", normal, normal)
    ranges = np.full((2, len(ways)), np.inf)
    for ray, (origin, way) in enumerate(zip(origins, ways, strict=True)):
        with np.errstate(divide="ignore", invalid="ignore"):
            t = np.einsum("tj,tj->t", a - origin, normal) / (normal @ way)
            place = origin + t[:, None] * way
            shares = [
                np.einsum("tj,tj->t", np.cross(v - u, place - u), normal) / square
                for u, v in ((a, b), (b, c), (c, a))
            ]
            least = np.where((t >= 0) & np.isfinite(t), np.min(shares, axis=0), -np.inf)
        ranges[0, ray] = t[least >= -slack].min(initial=np.inf)
        ranges[1, ray] = t[least >= slack].min(initial=np.inf)
    return ranges


def unit(ways: Array) -> Array:
    return ways / np.linalg.norm(ways, axis=1, keepdims=True)


@given(seed=st.integers(0, 2**32 - 1), number=st.integers(1, 60), flat=st.booleans())
@settings(max_examples=60, deadline=None)
def test_closest_hit_is_brute_forces_on_random_soups(seed: int, number: int, flat: bool) -> None:
    rng = np.random.default_rng(seed)
    triangles = rng.normal(size=(number, 1, 3)) * 4 + rng.normal(size=(number, 3, 3)) * 2
    if flat:  # upright and level pieces with shared coordinates, as houses have them
        triangles = triangles.round()
    origins = rng.normal(size=(40, 3)) * 3
    ways = unit(rng.normal(size=(40, 3)))
    ranges, hits = RayCaster(triangles).closest(origins, ways)
    nearest, farthest = brute_force(triangles, origins, ways, 1e-9)
    assert (ranges >= nearest - 1e-8).all()
    assert (ranges <= farthest + 1e-8).all()
    assert ((hits >= 0) == np.isfinite(ranges)).all()
    found = np.flatnonzero(hits >= 0)
    own = [
        brute_force(triangles[[hits[ray]]], origins[[ray]], ways[[ray]], 1e-8)[0, 0]
        for ray in found
    ]
    np.testing.assert_allclose(ranges[found], own, rtol=1e-7, atol=1e-7)


@given(
    triangles=arrays(
        np.float64, st.tuples(st.integers(1, 12), st.just(3), st.just(3)),
        elements=st.sampled_from([-2.0, -1.0, 0.0, 0.5, 1.0, 1e-9, 1e6]),
    ),
    way=st.sampled_from([(1.0, 0, 0), (0, -1.0, 0), (0, 0, 1.0), (1.0, 1.0, 0), (-1.0, 0.5, 2.0)]),
)  # fmt: skip
@settings(max_examples=80, deadline=None)
def test_degenerate_and_axis_aligned_soups_do_no_harm(
    triangles: Array, way: tuple[float, float, float]
) -> None:
    origins = np.array([[0.25, 0.3, 0.2], [0.0, 0.0, 0.0], [-3.0, 0.1, 0.05]])
    ways = unit(np.tile(way, (3, 1)))
    ranges, hits = RayCaster(triangles).closest(origins, ways)
    assert not np.isnan(ranges).any()
    assert ((hits >= 0) == np.isfinite(ranges)).all()
    # At corners and in a triangle's own plane either answer is right; strictly inside it must hit.
    scale = np.abs(triangles).max() + 1
    assert (ranges <= brute_force(triangles, origins, ways, 1e-6)[1] + 1e-7 * scale).all()


def test_closest_hit_is_brute_forces_in_the_street(street_moment, rng) -> None:
    ways = unit(rng.normal(size=(15, 3)) * [1, 1, 0.2])
    origins = rng.uniform([-5, -3, -1], [60, 3, 3], (15, 3))
    ranges, _ = street_moment.caster.closest(origins, ways)
    wide, narrow = brute_force(street_moment.triangles, origins, ways, 1e-9)
    assert np.isfinite(ranges).sum() > 8
    assert (ranges >= wide - 1e-7)[np.isfinite(wide)].all()
    assert (ranges <= narrow + 1e-7)[np.isfinite(narrow)].all()


def test_closest_hit_is_embrees_in_the_street(street_moment, street, embree) -> None:
    ways = Scanner(columns=500).directions()
    origin = street.vehicle_pose_at(0.7)[:3, 3]
    ranges, hits = street_moment.caster.closest(origin, ways)
    theirs, their_hits = embree(street_moment.triangles)(origin, ways)
    assert (hits == their_hits).mean() > 0.998
    both = (hits >= 0) & (their_hits >= 0)
    assert both.mean() > 0.85
    # Float32 rounds a coordinate of 100 m to 4 um, and a grazing ray multiplies that.
    assert (np.abs(ranges[both] - theirs[both]) < 2e-3).mean() > 0.999
    assert ((hits >= 0) == (their_hits >= 0)).mean() > 0.9995


@pytest.mark.parametrize(
    "body",
    [
        shapes.box([-1, -2, -3], [2, 1, 0.5]),
        shapes.ellipsoid([3.0, 1.0, 2.0], 7, 11),
        shapes.tube([1.0, 1.4, 0.6], [-2.0, 0.0, 1.5], 9),
        shapes.swept([[1, 0, 1], [-1, 0, 1], [-1, 0, -1], [1, 0, -1]], [0, -3, 0], [0, 3, 0]),
    ],
    ids=["box", "ellipsoid", "tube", "swept"],
)
def test_no_ray_leaves_a_closed_body(body: Array, rng) -> None:
    caster = RayCaster(body)
    inside = np.array([0.1, -0.05, -0.1])
    corners = body.reshape(-1, 3)
    middles = (body + np.roll(body, 1, axis=1)).reshape(-1, 3) / 2
    towards = np.concatenate([corners, middles]) - inside
    ways = np.concatenate([unit(rng.normal(size=(20_000, 3))), unit(towards)])
    _, hits = caster.closest(inside, ways)
    assert (hits >= 0).all()


def test_normals_of_closed_bodies_point_outwards() -> None:
    for body in (
        shapes.box([-1, -1, -1], [1, 1, 1]),
        shapes.ellipsoid([1.0, 2.0, 3.0]),
        shapes.tube([1.0, 0.5], [-1.0, 1.0], 8),
        shapes.swept([[1, 0, 1], [-1, 0, 1], [-1, 0, -1], [1, 0, -1]], [0, -3, 0], [0, 3, 0]),
    ):
        normal = np.cross(body[:, 1] - body[:, 0], body[:, 2] - body[:, 0])
        assert (np.einsum("tj,tj->t", normal, body.mean(axis=1)) > 0).all()
        # The divergence theorem: the enclosed volume, and it is positive.
        volume = np.einsum("tj,tj->t", body[:, 0], np.cross(body[:, 1], body[:, 2])).sum() / 6
        assert volume > 0
    assert np.isclose(
        np.einsum("tj,tj->t", body[:, 0], np.cross(body[:, 1], body[:, 2])).sum() / 6, 24
    )


@given(seed=st.integers(0, 2**32 - 1), number=st.integers(1, 300), clumped=st.booleans())
@settings(max_examples=40, deadline=None)
def test_tree_holds_every_triangle_once_inside_its_boxes(
    seed: int, number: int, clumped: bool
) -> None:
    rng = np.random.default_rng(seed)
    triangles = rng.normal(size=(number, 3, 3))
    if clumped:  # many alike: nothing tells them apart
        triangles = triangles[rng.integers(0, max(1, number // 8), number)]
    boxes, links, corners, order = bvh.built(triangles)
    assert sorted(order) == list(range(number))
    np.testing.assert_array_equal(corners[:, :3], triangles[order, 0])
    seen, deepest, waiting = [], 0, [(0, 0)]
    while waiting:
        node, depth = waiting.pop()
        deepest = max(deepest, depth)
        first, count = links[node]
        if count > 0:
            held = triangles[order[first : first + count]].reshape(-1, 3)
            assert (held >= boxes[node, :3]).all()
            assert (held <= boxes[node, 3:]).all()
            seen += list(range(first, first + count))
        else:
            for child in (first, first + 1):
                assert (boxes[child, :3] >= boxes[node, :3]).all()
                assert (boxes[child, 3:] <= boxes[node, 3:]).all()
                waiting.append((child, depth + 1))
    assert sorted(seen) == list(range(number))
    assert deepest < bvh.STACK - 1


def test_sizes_that_double_do_not_make_the_tree_too_deep() -> None:
    scale = 2.0 ** np.arange(-60, 60)
    triangles = scale[:, None, None] * np.array([[[1.0, 0, 0], [1, 1, 0], [1, 0, 1]]])
    ranges, hits = RayCaster(triangles).closest([0.0, 0, 0], [1.0, 0.25, 0.25])
    assert hits[0] == 0
    assert ranges[0] == scale[0]


def test_blocked_is_closest_within_the_segment(street_moment, rng) -> None:
    first = rng.uniform([-20, -6, -1], [90, 6, 4], (3000, 3))
    second = rng.uniform([-20, -6, -1], [90, 6, 4], (3000, 3))
    way = second - first
    ranges, _ = street_moment.caster.closest(first, way, 1.0)
    blocked = street_moment.caster.blocked(first, second)
    np.testing.assert_array_equal(blocked, ranges < 1.0)
    assert 0.2 < blocked.mean() < 0.9
    np.testing.assert_array_equal(blocked, street_moment.caster.blocked(second, first))


def test_blocked_leaves_a_margin_at_both_ends() -> None:
    caster = RayCaster([[[5.0, -9, -9], [5, 9, -9], [5, 0, 9]]])
    assert caster.blocked([0.0, 0, 0], [5.5, 0, 0], margin_m=0.4).tolist() == [True]
    assert caster.blocked([0.0, 0, 0], [5.5, 0, 0], margin_m=0.6).tolist() == [False]
    assert caster.blocked([5.5, 0, 0], [0.0, 0, 0], margin_m=0.6).tolist() == [False]
    assert caster.blocked([1.0, 1, 1], [1.0, 1, 1]).tolist() == [False]


def test_all_octants_are_alike(rng) -> None:
    body = box().soup.triangles - [10.0, 0.0, 0.75]
    ways = unit(rng.normal(size=(500, 3)))
    ranges, _ = RayCaster(body).closest([0.0, 0, 0.0], ways)
    for signs in np.stack(np.meshgrid([1, -1], [1, -1], [1, -1]), -1).reshape(-1, 3):
        turned, _ = RayCaster(body * signs).closest([0.0, 0, 0.0], ways * signs)
        np.testing.assert_allclose(turned, ranges, rtol=1e-12)


def test_joined_casters_answer_as_one(street_moment, rng) -> None:
    triangles = street_moment.triangles[:4000]
    whole = RayCaster(triangles)
    parts = RayCaster.joined([RayCaster(triangles[:1500]), RayCaster(triangles[1500:])])
    origins = rng.uniform([-60, -8, -1], [60, 8, 5], (2000, 3))
    ways = unit(rng.normal(size=(2000, 3)))
    one, two = whole.closest(origins, ways), parts.closest(origins, ways)
    np.testing.assert_array_equal(one[0], two[0])
    assert (one[1] == two[1]).mean() > 0.995  # at a common edge either triangle may win
    np.testing.assert_array_equal(
        whole.blocked(origins, origins + 3 * ways), parts.blocked(origins, origins + 3 * ways)
    )


def test_threads_do_not_change_the_answer(street_moment, monkeypatch) -> None:
    ways = Scanner(columns=300).directions()
    monkeypatch.setenv("INTERVIS_THREADS", "1")
    alone = street_moment.caster.closest([0.0, 0, 0], ways)
    monkeypatch.setenv("INTERVIS_THREADS", "3")
    together = street_moment.caster.closest([0.0, 0, 0], ways)
    np.testing.assert_array_equal(alone[0], together[0])
    np.testing.assert_array_equal(alone[1], together[1])


def test_nothing_to_hit_nothing_hit() -> None:
    caster = RayCaster(np.empty((0, 3, 3)))
    ranges, hits = caster.closest([0.0, 0, 0], [[1.0, 0, 0]])
    assert ranges.tolist() == [np.inf]
    assert hits.tolist() == [-1]
    assert not caster.blocked([0.0, 0, 0], [1.0, 0, 0]).any()


def test_farthest_cuts_off() -> None:
    caster = RayCaster([[[5.0, -9, -9], [5, 9, -9], [5, 0, 9]]])
    assert caster.closest([0.0, 0, 0], [1.0, 0, 0], 4.9)[1].tolist() == [-1]
    assert caster.closest([0.0, 0, 0], [1.0, 0, 0], 5.1)[1].tolist() == [0]
    assert caster.closest([0.0, 0, 0], [-1.0, 0, 0])[1].tolist() == [-1]


@pytest.mark.parametrize(
    "triangles", [np.zeros((3, 3)), np.zeros((2, 3, 2)), np.full((1, 3, 3), np.nan)]
)
def test_bad_triangles_are_refused(triangles: Array) -> None:
    with pytest.raises(PointsError, match="triangles must have"):
        RayCaster(triangles)


def test_bad_rays_are_refused() -> None:
    caster = RayCaster(shapes.box([0, 0, 0], [1, 1, 1]))
    with pytest.raises(PointsError, match="origins must have the shape"):
        caster.closest([0.0, 0.0], [[1.0, 0, 0]])
    with pytest.raises(PointsError, match="cannot be paired"):
        caster.closest(np.zeros((2, 3)), np.ones((3, 3)))
