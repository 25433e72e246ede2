"""The ray caster against the method of Moeller and Trumbore in float64, and its invariants."""

import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from intervis.errors import MissingExtraError, PointsError
from intervis.lab.worlds import shapes
from intervis.lab.worlds.analytic import box
from intervis.lab.worlds.ray_casting import RayCaster

Array = NDArray[np.float64]
ROUNDING = 2.0**-20
"""Rounding of a few float32 operations, as a fraction of the largest coordinate."""
WALL = [[[5.0, -9, -9], [5, 9, -9], [5, 0, 9]]]


def moeller_trumbore(
    triangles: Array, origins: Array, directions: Array
) -> tuple[Array, Array, Array]:
    """Every ray (R,) of unit direction against every triangle (T,), in float64.

    Returns (R, T) arrays: the range in metres (NaN for a ray in the plane of the triangle), the
    depth inside the triangle in metres (distance to its nearest edge, negative outside) and the
    sine of the angle between ray and plane.
    """
    corner, one, two = triangles[:, 0], *(triangles[:, [k]] - triangles[:, [0]] for k in (1, 2))
    one, two = one[:, 0], two[:, 0]
    normal = np.cross(one, two)
    area = np.linalg.norm(normal, axis=1)
    third = np.linalg.norm(two - one, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        p = np.cross(directions[:, None], two[None])
        determinant = np.einsum("rti,ti->rt", p, one)
        start = origins[:, None] - corner[None]
        u = np.einsum("rti,rti->rt", start, p) / determinant
        q = np.cross(start, one[None])
        v = np.einsum("rti,ri->rt", q, directions) / determinant
        ranges = np.einsum("rti,ti->rt", q, two) / determinant
        heights = area / np.stack([np.linalg.norm(two, axis=1), np.linalg.norm(one, axis=1), third])
        depth = np.min(np.stack([u, v, 1 - u - v]) * heights[:, None], axis=0)
        sine = np.abs(determinant) / area
    ranges[~np.isfinite(ranges)] = np.nan
    return ranges, np.where(np.isfinite(depth), depth, -np.inf), np.nan_to_num(sine)


def assert_closest(triangles: Array, origins: Array, directions: Array) -> Array:
    """Check `closest` against `moeller_trumbore`, and return the ranges.

    Float32 moves the crossing of a ray and a plane by `blur`. Rays that pass an edge or start on a
    surface within `blur` may be decided either way; all others must agree.
    """
    ranges, hits = RayCaster(triangles).closest(origins, directions)
    every, depth, sine = moeller_trumbore(triangles, origins, directions)
    middle = (triangles.min(axis=(0, 1)) + triangles.max(axis=(0, 1))) / 2
    size = np.abs(triangles - middle).max() + np.abs(origins - middle).max()
    with np.errstate(divide="ignore"):
        blur = ROUNDING * size / np.maximum(sine, 1e-300)
    assert ((hits >= 0) == np.isfinite(ranges)).all()
    # No certain hit lies in front of the one that was found.
    sure = (depth > blur) & (every > blur)
    bound = np.where(sure, every + blur, np.inf).min(axis=1)
    hit = np.flatnonzero(hits >= 0)
    own = hit, hits[hit]
    own_blur = np.zeros(len(ranges))
    own_blur[hit] = blur[own]
    assert (ranges <= bound + own_blur).all()
    # The triangle found is hit, and the range is exactly that of its plane. (Not checked for a ray
    # in the plane of its triangle, which may hit anywhere in it.)
    hit = hit[sine[own] > 1e-6]
    own = hit, hits[hit]
    assert (depth[own] >= -blur[own]).all()
    assert (every[own] >= -blur[own]).all()
    inside = depth[own] > 0
    np.testing.assert_allclose(
        ranges[hit][inside], np.maximum(every[own][inside], 0), rtol=1e-9, atol=1e-9 * size
    )
    return ranges


def unit(directions: Array) -> Array:
    return directions / np.linalg.norm(directions, axis=1, keepdims=True)


@given(
    seed=st.integers(0, 2**32 - 1),
    number=st.integers(1, 40),
    flat=st.booleans(),
    start=st.sampled_from(["anywhere", "on a surface", "on a corner"]),
    towards=st.sampled_from(["anywhere", "grazing", "an axis", "a corner", "an edge"]),
    far=st.sampled_from([0.0, 300.0, 1e5]),
    scale=st.sampled_from([1e-3, 1.0, 1e4]),
)
@settings(max_examples=150)
def test_closest_hit_is_moeller_trumbores(
    seed: int, number: int, flat: bool, start: str, towards: str, far: float, scale: float
) -> None:
    rng = np.random.default_rng(seed)
    triangles = rng.normal(size=(number, 1, 3)) * 4 + rng.normal(size=(number, 3, 3)) * 2
    if flat:  # upright and level pieces with shared coordinates, as houses have them; some empty
        triangles = triangles.round()
    triangles += far
    rays = 40
    some = triangles[rng.integers(number, size=rays)]
    origins = rng.normal(size=(rays, 3)) * 3 + far
    if start == "on a surface":
        origins = np.einsum("rc,rci->ri", rng.dirichlet([1, 1, 1], rays), some)
    elif start == "on a corner":
        origins = some[:, 0]
    directions = rng.normal(size=(rays, 3))
    if towards == "an axis":
        directions = np.eye(3)[rng.integers(3, size=rays)] * rng.choice([-1, 1], (rays, 1))
    elif towards == "grazing":
        directions = some[:, 1] - some[:, 0] + 1e-5 * rng.normal(size=(rays, 3))
    elif towards == "a corner":
        directions = some[:, 2] - origins
    elif towards == "an edge":
        directions = (some[:, 1] + some[:, 2]) / 2 - origins
    directions[np.linalg.norm(directions, axis=1) < 1e-6] = [1.0, 0.0, 0.0]
    assert_closest(triangles * scale, origins * scale, unit(directions))


def test_many_rays_in_the_street(street_snapshot, street, rng) -> None:
    """Every hit lies on its triangle; some rays are checked against many triangles."""
    origins = rng.uniform([-5, -3, -1], [60, 3, 3], (50_000, 3))
    directions = unit(rng.normal(size=(50_000, 3)) * [1, 1, 0.2])
    ranges, hits = street_snapshot.caster.closest(origins, directions)
    hit = np.flatnonzero(hits >= 0)
    assert len(hit) > 30_000
    a, b, c = street_snapshot.triangles[hits[hit]].transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    places = origins[hit] + ranges[hit, None] * directions[hit]
    off = np.einsum("ij,ij->i", places - a, normal) / np.linalg.norm(normal, axis=1)
    assert np.abs(off).max() < 1e-9
    near = np.linalg.norm(street_snapshot.triangles[:, 0], axis=1) < 60
    few = street_snapshot.triangles[near][::29]
    assert np.isfinite(assert_closest(few, origins[:60], directions[:60])).sum() > 5


def test_parallel_rays_pass_or_hit_a_plane_seen_edge_on() -> None:
    level = shapes.quad([-5, -5, 0], [5, -5, 0], [5, 5, 0], [-5, 5, 0])
    caster = RayCaster(level)
    above, _ = caster.closest([[-9.0, 0.3, 1e-3], [-9, 0.3, -1e-3]], [1.0, 0, 0])
    assert np.isinf(above).all()
    ranges, _ = caster.closest([-9.0, 0.3, 0.0], [1.0, 0, 0])  # in the plane: hit or miss
    assert np.isinf(ranges[0]) or 4 - 1e-6 <= ranges[0] <= 14 + 1e-6
    # At 0.01 degrees the range is still exact.
    ranges, _ = caster.closest([-9.0, 0.3, 9 * np.tan(np.radians(0.01))], [
        np.cos(np.radians(0.01)), 0, -np.sin(np.radians(0.01))])  # fmt: skip
    assert abs(ranges[0] - 9 / np.cos(np.radians(0.01))) < 1e-9


def test_a_ray_that_starts_on_a_surface_hits_it_at_zero_or_passes() -> None:
    body = shapes.box([-1, -1, -1], [1, 1, 1])
    ranges, _ = RayCaster(body).closest([-1.0, 0.2, 0.1], [[1.0, 0, 0], [-1.0, 0, 0]])
    assert ranges[0] in (0.0, 2.0)
    assert ranges[1] in (0.0, np.inf)


@pytest.mark.parametrize("far", [0.0, 5000.0, 1e6])
def test_worlds_far_from_the_origin_lose_nothing(far: float, rng) -> None:
    body = shapes.ellipsoid([3.0, 1.0, 2.0], 7, 11)
    origins = rng.normal(size=(300, 3)) * 5
    directions = unit(rng.normal(size=(300, 3)) - origins)
    here, _ = RayCaster(body).closest(origins, directions)
    there, _ = RayCaster(body + far).closest(origins + far, directions)
    assert (np.isfinite(here) == np.isfinite(there)).mean() > 0.99
    both = np.isfinite(here) & np.isfinite(there)
    assert both.sum() > 100
    np.testing.assert_allclose(here[both], there[both], atol=1e-6)


def test_degenerate_triangles_are_never_hit() -> None:
    point, line = np.full((3, 3), 2.0), np.array([[2.0, -1, 0], [2, 0, 0], [2, 1, 0]])
    for directions in (np.eye(3), unit(np.array([[1.0, 1, 1], [2, 0, 0], [2, 0.5, 0]]))):
        _, hits = RayCaster([point, line]).closest([0.0, 0, 0], directions)
        assert (hits == -1).all()


@pytest.mark.parametrize(
    "body",
    [
        shapes.box([-1, -2, -3], [2, 1, 0.5]),
        shapes.ellipsoid([3.0, 1.0, 2.0], 7, 11),
        shapes.tube([1.0, 1.4, 0.6], [-2.0, 0.0, 1.5], 9),
        shapes.extruded([[1, 0, 1], [-1, 0, 1], [-1, 0, -1], [1, 0, -1]], [0, -3, 0], [0, 3, 0]),
    ],
    ids=["box", "ellipsoid", "tube", "extruded"],
)
def test_no_ray_leaves_a_closed_body(body: Array, rng) -> None:
    caster = RayCaster(body)
    inside = np.array([0.1, -0.05, -0.1])
    corners = body.reshape(-1, 3)
    middles = (body + np.roll(body, 1, axis=1)).reshape(-1, 3) / 2
    towards = np.concatenate([corners, middles]) - inside
    directions = np.concatenate([unit(rng.normal(size=(20_000, 3))), unit(towards)])
    _, hits = caster.closest(inside, directions)
    assert (hits >= 0).all()


def test_normals_of_closed_bodies_point_outwards() -> None:
    for body in (
        shapes.box([-1, -1, -1], [1, 1, 1]),
        shapes.ellipsoid([1.0, 2.0, 3.0]),
        shapes.tube([1.0, 0.5], [-1.0, 1.0], 8),
        shapes.extruded([[1, 0, 1], [-1, 0, 1], [-1, 0, -1], [1, 0, -1]], [0, -3, 0], [0, 3, 0]),
    ):
        normal = np.cross(body[:, 1] - body[:, 0], body[:, 2] - body[:, 0])
        assert (np.einsum("tj,tj->t", normal, body.mean(axis=1)) > 0).all()
        # Divergence theorem: the enclosed volume is positive.
        volume = np.einsum("tj,tj->t", body[:, 0], np.cross(body[:, 1], body[:, 2])).sum() / 6
        assert volume > 0
    assert np.isclose(
        np.einsum("tj,tj->t", body[:, 0], np.cross(body[:, 1], body[:, 2])).sum() / 6, 24
    )


def test_blocked_is_closest_within_the_segment(street_snapshot, rng) -> None:
    first = rng.uniform([-20, -6, -1], [90, 6, 4], (3000, 3))
    second = rng.uniform([-20, -6, -1], [90, 6, 4], (3000, 3))
    way = second - first
    ranges, _ = street_snapshot.caster.closest(first, way, 1.0)
    blocked = street_snapshot.caster.blocked(first, second)
    np.testing.assert_array_equal(blocked, ranges < 1.0)
    assert 0.2 < blocked.mean() < 0.9
    np.testing.assert_array_equal(blocked, street_snapshot.caster.blocked(second, first))


def test_blocked_leaves_slack_before_the_end() -> None:
    caster = RayCaster(WALL)
    assert caster.blocked([0.0, 0, 0], [5.5, 0, 0], slack_m=0.4).tolist() == [True]
    assert caster.blocked([0.0, 0, 0], [5.5, 0, 0], slack_m=0.6).tolist() == [False]
    both = caster.blocked([0.0, 0, 0], [[5.5, 0, 0], [5.5, 0, 0]], slack_m=np.array([0.6, 0.4]))
    assert both.tolist() == [False, True]
    assert caster.blocked([0.0, 0, 0], [3.0, 0, 0], slack_m=5.0).tolist() == [False]


def test_segments_without_length_hit_nothing() -> None:
    caster = RayCaster(WALL)
    assert caster.blocked([5.0, 1, 1], [5.0, 1, 1]).tolist() == [False]
    assert caster.first_hit([1.0, 1, 1], [1.0, 1, 1]).tolist() == [np.inf]
    assert caster.closest([5.0, 0, 0], [0.0, 0, 0])[1].tolist() == [-1]


def test_first_hit_is_in_metres_and_ends_with_the_segment() -> None:
    hits = RayCaster(WALL).first_hit([1.0, 0, 0], [[7.0, 0, 0], [5.1, 0, 0], [4.9, 0, 0]])
    assert hits.tolist() == [4.0, 4.0, np.inf]
    assert RayCaster(WALL).first_hit(np.zeros(3), np.empty((0, 3))).shape == (0,)


def test_all_octants_are_alike(rng) -> None:
    body = box().triangles - [10.0, 0.0, 0.75]
    directions = unit(rng.normal(size=(500, 3)))
    ranges, _ = RayCaster(body).closest([0.0, 0, 0.0], directions)
    for signs in np.stack(np.meshgrid([1, -1], [1, -1], [1, -1]), -1).reshape(-1, 3):
        turned, _ = RayCaster(body * signs).closest([0.0, 0, 0.0], directions * signs)
        np.testing.assert_allclose(turned, ranges, rtol=1e-12)


def test_joined_casters_answer_as_one(street_snapshot, rng) -> None:
    triangles = street_snapshot.triangles[:4000]
    whole = RayCaster(triangles)
    parts = RayCaster.joined([RayCaster(triangles[:1500]), RayCaster(triangles[1500:])])
    origins = rng.uniform([-60, -8, -1], [60, 8, 5], (2000, 3))
    directions = unit(rng.normal(size=(2000, 3)))
    one, two = whole.closest(origins, directions), parts.closest(origins, directions)
    np.testing.assert_array_equal(one[0], two[0])
    assert (one[1] == two[1]).mean() > 0.995  # at a common edge either triangle is right
    np.testing.assert_array_equal(
        whole.blocked(origins, origins + 3 * directions),
        parts.blocked(origins, origins + 3 * directions),
    )


def test_nothing_to_hit_nothing_hit() -> None:
    caster = RayCaster(np.empty((0, 3, 3)))
    ranges, hits = caster.closest([0.0, 0, 0], [[1.0, 0, 0]])
    assert ranges.tolist() == [np.inf]
    assert hits.tolist() == [-1]
    assert not caster.blocked([0.0, 0, 0], [1.0, 0, 0]).any()


def test_farthest_cuts_off() -> None:
    caster = RayCaster(WALL)
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


def test_a_caster_without_embreex_names_the_extra(monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "embreex", None)
    with pytest.raises(MissingExtraError, match=r"'embreex'.* pip install 'intervis\[lab\]'"):
        RayCaster(np.empty((0, 3, 3)))


def test_later_changes_of_the_callers_array_do_not_reach_the_caster():
    wall = np.array([[[5.0, -9, -9], [5, 9, -9], [5, 0, 9]]])
    caster = RayCaster(wall)
    wall += 100.0
    ranges, _ = caster.closest([0.0, 0, 0], [[1.0, 0, 0]])
    assert ranges.tolist() == [5.0]
