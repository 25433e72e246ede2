"""Eq. 9 to 12: properties of the matrices, and cuts by hand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from intervis.method.graph import (
    adjacency,
    cut,
    degrees,
    fiedler_side,
    laplacian,
    normalized_laplacian,
)
from intervis.method.mesh import build_mesh


def random_graph(seed, n=40):
    rng = np.random.default_rng(seed)
    mesh = build_mesh(rng.normal(size=(n, 2)))
    return mesh.edges, rng.uniform(0.1, 5.0, len(mesh.edges)), rng


@given(st.integers(0, 2**32 - 1))
def test_the_laplacian_is_symmetric_semi_definite_with_zero_row_sums(seed):
    edges, weights, _ = random_graph(seed)
    matrix = laplacian(adjacency(edges, weights, 40)).toarray()
    assert np.allclose(matrix, matrix.T)
    assert np.allclose(matrix.sum(axis=1), 0)
    assert np.linalg.eigvalsh(matrix).min() > -1e-9


@given(st.integers(0, 2**32 - 1))
def test_equation_11_as_an_identity(seed):
    edges, weights, rng = random_graph(seed)
    f = rng.normal(size=40)
    left = f @ laplacian(adjacency(edges, weights, 40)) @ f
    dense = adjacency(edges, weights, 40).toarray()
    right = 0.5 * (dense * (f[:, None] - f[None, :]) ** 2).sum()
    assert left == pytest.approx(right)


def test_equation_9_on_paper():
    # A triangle with weights 1, 2, 3 on its sides.
    matrix = laplacian(adjacency(np.array([[0, 1], [0, 2], [1, 2]]), np.array([1.0, 2, 3]), 3))
    assert matrix.toarray().tolist() == [[3, -1, -2], [-1, 4, -3], [-2, -3, 5]]


@given(st.integers(0, 2**32 - 1))
def test_equation_10_and_its_spectrum(seed):
    edges, weights, _ = random_graph(seed)
    matrix = adjacency(edges, weights, 42)  # two isolated nodes at the end
    normal = normalized_laplacian(matrix).toarray()
    degree = degrees(matrix)
    root = np.diag([1 / np.sqrt(d) if d > 0 else 0.0 for d in degree])
    identity = np.diag((degree > 0).astype(float))
    assert np.allclose(normal, identity - root @ matrix.toarray() @ root)
    values = np.linalg.eigvalsh(normal)
    assert values.min() > -1e-9
    assert values.max() < 2 + 1e-9
    assert np.allclose(normal[40:], 0)  # D^-1/2 is zero where the degree is
    assert np.allclose(normal @ np.sqrt(degree), 0)  # the first eigenvector is known


@given(st.integers(0, 2**32 - 1))
def test_equation_12_is_the_quadratic_form_of_an_indicator(seed):
    """For an indicator f, f^T L f is the weight across: an independent way to the cut."""
    edges, weights, rng = random_graph(seed)
    chosen = rng.random(40) < 0.4
    f = chosen.astype(float)
    across = f @ laplacian(adjacency(edges, weights, 40)) @ f
    assert cut(edges, weights, chosen) == pytest.approx(across / 2)
    assert cut(edges, weights, ~chosen) == pytest.approx(across / 2)


def dumbbell(n):
    """Two complete graphs of n nodes joined by one edge: the minimum cut is known."""
    one = [(a, b) for a in range(n) for b in range(a + 1, n)]
    edges = np.array(one + [(a + n, b + n) for a, b in one] + [(n - 1, n)])
    return edges, np.ones(len(edges))


@pytest.mark.parametrize("n", [3, 5, 40, 250])
def test_the_fiedler_cut_finds_the_bottleneck(n):
    edges, weights = dumbbell(n)
    side = fiedler_side(adjacency(edges, weights, 2 * n))
    assert side.tolist() == [False] * n + [True] * n
    assert cut(edges, weights, side) == 0.5


def test_the_fiedler_cut_looks_at_the_largest_part_only():
    edges, weights = dumbbell(4)
    edges, weights = np.vstack([edges + 1, [[9, 10]]]), np.append(weights, 1.0)
    side = fiedler_side(adjacency(edges, weights, 11))  # node 0 alone, 9 and 10 a pair
    assert side.tolist() == [False] * 5 + [True] * 4 + [False] * 2
    assert not fiedler_side(adjacency(np.empty((0, 2), int), np.empty(0), 3)).any()


def test_the_fiedler_cut_of_two_nodes_separates_them():
    side = fiedler_side(adjacency(np.array([[0, 1]]), np.ones(1), 2))
    assert side.tolist() == [False, True]


def test_the_fiedler_cut_of_a_ring_is_one_diameter_each_time():
    """A ring has no bottleneck: its second eigenvalue is double, and every diameter is a cut."""
    nodes = np.arange(500)
    edges, weights = np.column_stack([nodes, np.roll(nodes, -1)]), np.ones(500)
    matrix = adjacency(edges, weights, 500)
    side = fiedler_side(matrix)
    assert cut(edges, weights, side) == 1.0  # half of two edges
    assert abs(side.sum() - 250) <= 1
    for _ in range(5):
        assert np.array_equal(fiedler_side(matrix), side)
