"""Finite elements: Delaunay's empty circle, Euler's counts, Eq. 14 on paper."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from intervis.delaunay import triangulate
from intervis.method.mesh import build_mesh, edge_lengths, star_centroids


@given(st.integers(3, 60), st.integers(0, 2**32 - 1))
def test_no_circumcircle_holds_another_point(n, seed):
    chart = np.random.default_rng(seed).normal(size=(n, 2))
    mesh = build_mesh(chart)
    for triangle in mesh.triangles:
        a, b, c = chart[triangle]
        centre = np.linalg.solve(2 * np.array([b - a, c - a]), [b @ b - a @ a, c @ c - a @ a])
        radius = np.linalg.norm(a - centre)
        others = np.delete(chart, triangle, axis=0)
        assert (np.linalg.norm(others - centre, axis=1) >= radius * (1 - 1e-9)).all()


@given(st.integers(3, 200), st.integers(0, 2**32 - 1))
def test_counts_of_the_paper(n, seed):
    """N = 2n - 2 - h and SP = N + n - 1, and the triangles tile the convex hull."""
    chart = np.random.default_rng(seed).normal(size=(n, 2))
    mesh, hull = build_mesh(chart), ConvexHull(chart)
    assert len(mesh.triangles) == 2 * n - 2 - len(hull.vertices)
    assert len(mesh.edges) == len(mesh.triangles) + n - 1
    assert mesh.area.sum() == pytest.approx(hull.volume)
    assert (mesh.area > 0).all()
    a, b, c = (chart[mesh.triangles[:, corner]] for corner in range(3))
    turned = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    assert np.allclose(mesh.area, turned / 2, rtol=1e-6, atol=1e-14)


def test_equation_14_area_on_paper():
    mesh = build_mesh(np.array([[0.0, 0], [0, 3], [4, 0]]))
    assert mesh.area.tolist() == [6.0]
    first = mesh.triangles[0].tolist()
    assert first in ([0, 2, 1], [2, 1, 0], [1, 0, 2])  # counter-clockwise
    assert mesh.triangles.dtype == np.int64


def test_equation_14_centroid_on_paper():
    # Node 0 in a star of two triangles: areas 6 and 2, centroids (4/3, 1) and (-1/3... ).
    chart = np.array([[0.0, 0], [4, 0], [0, 3], [-1, 1]])
    mesh = build_mesh(chart)
    stars = {tuple(sorted(t)): a for t, a in zip(mesh.triangles.tolist(), mesh.area, strict=True)}
    assert stars == {(0, 1, 2): pytest.approx(6.0), (0, 2, 3): pytest.approx(1.5)}
    centroid = star_centroids(mesh, chart)
    x = (6 * (0 + 4 + 0) / 3 + 1.5 * (0 + 0 - 1) / 3) / 7.5
    y = (6 * (0 + 0 + 3) / 3 + 1.5 * (0 + 3 + 1) / 3) / 7.5
    assert np.allclose(centroid[0], [x, y])
    assert np.allclose(centroid[1], [4 / 3, 1.0])  # one triangle: its own centroid


@given(st.integers(3, 60), st.integers(0, 2**32 - 1))
def test_centroids_equal_a_loop_over_stars(n, seed):
    rng = np.random.default_rng(seed)
    chart, position = rng.normal(size=(n, 2)), rng.normal(size=(n, 3))
    mesh = build_mesh(chart)
    found = star_centroids(mesh, position)
    for node in range(n):
        star = [k for k, t in enumerate(mesh.triangles) if node in t]
        weight = mesh.area[star]
        centres = np.array([position[mesh.triangles[k]].mean(axis=0) for k in star])
        assert np.allclose(found[node], (weight[:, None] * centres).sum(axis=0) / weight.sum())


@given(st.integers(3, 60), st.integers(0, 2**32 - 1))
def test_edges_are_the_sides_of_the_triangles_each_once(n, seed):
    mesh = build_mesh(np.random.default_rng(seed).normal(size=(n, 2)))
    sides = {tuple(sorted((int(t[k]), int(t[k - 1])))) for t in mesh.triangles for k in range(3)}
    assert [tuple(e) for e in mesh.edges.tolist()] == sorted(sides)
    assert mesh.edges.dtype == np.int64


@given(st.integers(1, 60), st.integers(0, 80), st.integers(0, 2**32 - 1))
def test_lengths_of_edges_are_numpys_to_the_last_bit(n, count, seed):
    rng = np.random.default_rng(seed)
    position = rng.normal(size=(n, 3)) * rng.choice([1e-9, 1.0, 1e9], 3)
    edges = rng.integers(0, n, (count, 2))
    expected = np.linalg.norm(position[edges[:, 0]] - position[edges[:, 1]], axis=1)
    for same in (position, np.asfortranarray(position)):
        assert edge_lengths(edges, same).tolist() == expected.tolist()


def test_copies_of_a_position_do_not_break_the_mesh(rng):
    chart = rng.normal(size=(30, 2))
    twice = np.vstack([chart, chart[:10]])
    mesh = build_mesh(twice)
    assert len(mesh.triangles) == len(build_mesh(chart).triangles)
    assert mesh.area.sum() == pytest.approx(ConvexHull(chart).volume)


@given(st.integers(0, 2**32 - 1))
def test_positions_on_lines_to_the_last_bit_leave_no_hole(seed):
    """Rays from the sensor through noisy ranges: many triples on one line, exactly or nearly."""
    rng = np.random.default_rng(seed)
    azimuth_rad = np.repeat(np.linspace(-0.5, 0.5, 12), 6)
    range_m = rng.uniform(5, 40, 72).astype(np.float32)
    chart = np.column_stack([range_m * np.cos(azimuth_rad), range_m * np.sin(azimuth_rad)])
    chart = chart.astype(np.float32).astype(np.float64)
    mesh = build_mesh(chart)
    assert len(mesh.edges) == len(mesh.triangles) + len(chart) - 1  # Euler, for a disc
    assert mesh.area.sum() == pytest.approx(ConvexHull(chart).volume)


@pytest.mark.parametrize(
    ("chart", "edges"),
    [
        (np.empty((0, 2)), []),
        (np.zeros((1, 2)), []),
        (np.array([[0.0, 0], [1, 0]]), [[0, 1]]),
        (np.zeros((5, 2)), []),
        (np.array([[3.0, 3], [1, 1], [2, 2]]), [[0, 2], [1, 2]]),
        (np.array([[0.0, 2], [0, 1], [0, 3], [0, 1]]), [[0, 1], [0, 2]]),
    ],
)
def test_points_without_a_triangle_give_a_chain(chart, edges):
    mesh = build_mesh(chart)
    assert len(mesh.triangles) == 0
    assert mesh.edges.tolist() == edges
    assert np.isnan(star_centroids(mesh, chart)).all()


def test_positions_that_are_collinear_but_for_rounding_give_a_chain():
    chart = np.array([[0.0, 0], [0.5, 3e-13], [1, 0]])
    assert len(triangulate(chart).triangles) == 1  # it has an area of 1.5e-13
    assert build_mesh(chart).edges.tolist() == [[0, 1], [1, 2]]
    assert len(build_mesh(chart * [1, 1e3]).triangles) == 1


def test_a_scale_of_kilometres_or_millimetres_does_not_matter(rng):
    chart = rng.normal(size=(50, 2))
    for scale in (1e-4, 1e5):
        assert build_mesh(chart * scale).edges.tolist() == build_mesh(chart).edges.tolist()


@pytest.mark.parametrize("scale", [1e-9, 1e-3, 1e6])
@pytest.mark.parametrize("shift", [0.0, 50.0])
def test_neither_scale_nor_place_changes_the_mesh(rng, scale, shift):
    chart = rng.normal(size=(40, 2))
    plain, other = build_mesh(chart), build_mesh(scale * (chart + shift))
    assert other.edges.tolist() == plain.edges.tolist()
    assert np.allclose(np.sort(other.area), np.sort(scale**2 * plain.area), rtol=1e-6, atol=0.0)
    assert np.allclose(other.area.sum(), scale**2 * plain.area.sum())


def test_positions_on_a_line_are_joined_in_its_order():
    """Copies share a node; of equal x the lower y comes first."""
    upright = np.array([[1.0, 5], [1, 1], [1, 3], [1, 1], [1, 4]])
    assert build_mesh(upright).edges.tolist() == [[0, 4], [1, 2], [2, 4]]
    slanting = np.array([[3.0, 3], [1, 1], [2, 2]])
    assert build_mesh(slanting).edges.tolist() == [[0, 2], [1, 2]]
    falling = np.array([[3.0, 1], [1, 3], [2, 2], [5, -1]])
    assert build_mesh(falling).edges.tolist() == [[0, 2], [0, 3], [1, 2]]
    assert build_mesh(np.array([[3.0, 1], [1, 3]])).edges.tolist() == [[0, 1]]
    for few in (0, 1):
        assert build_mesh(np.ones((few, 2))).edges.shape == (0, 2)


@pytest.mark.parametrize("scale", [1e-150, 1e-13, 1e13])
@pytest.mark.parametrize("shift", [(0.0, 0.0), (1e7, 0.0), (0.0, -1e7)])
def test_extreme_scales_and_places_change_no_mesh(rng, scale, shift):
    chart = rng.normal(size=(40, 2))
    moved = chart + shift
    plain, other = build_mesh(chart), build_mesh(scale * moved)
    assert {tuple(sorted(t)) for t in other.triangles.tolist()} == {
        tuple(sorted(t)) for t in plain.triangles.tolist()
    }
    assert other.edges.tolist() == plain.edges.tolist()


def test_slivers_are_no_triangles():
    """Positions on a line, give or take 1e-13 of its length."""
    x = np.linspace(-5.0, 5.0, 12)
    for scale in (1e-6, 1.0, 1e6):
        line = scale * np.column_stack([x, 0.5 * x + 1e-12 * (-1.0) ** np.arange(12)])
        mesh = build_mesh(line)
        assert mesh.triangles.shape == (0, 3)
        assert mesh.area.shape == (0,)
        assert mesh.edges.tolist() == [[k, k + 1] for k in range(11)]
        thick = scale * np.column_stack([x, 0.5 * x + 1e-9 * (-1.0) ** np.arange(12)])
        assert len(build_mesh(thick).triangles) > 0
