"""Shortest paths against a relaxation in plain Python, ties included, and scipy's Dijkstra."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from intervis import Settings, analyze
from intervis.drives import open_drive
from intervis.method.shortest_paths import edge_rows, neighbour_rows, shortest_paths


def between(position, i, j):
    """Distance, with the operations of the kernel."""
    x, y, z = position[i] - position[j]
    return np.sqrt(x**2 + y**2 + z**2)


def relaxed(position, pairs, roots):
    """Distances by Bellman and Ford; the point before each by the rule for ties, from these."""
    count = len(position)
    direct = [np.sqrt(x**2 + y**2 + z**2) for x, y, z in position]
    distance = [direct[i] if i in roots else np.inf for i in range(count)]
    for _ in range(count):
        for i, j in pairs:
            distance[j] = min(distance[j], distance[i] + between(position, i, j))
    before = []
    for j in range(count):
        ways = [
            (distance[i], i)
            for i, other in pairs
            if other == j and distance[i] + between(position, i, j) == distance[j] < np.inf
        ]
        direct_way = j in roots and direct[j] == distance[j]
        before.append(min(ways)[1] if ways and not direct_way else -1)
    return distance, before


@given(st.integers(0, 2**32 - 1), st.integers(1, 30), st.integers(0, 60), st.booleans())
def test_paths_along_edges_are_the_shortest(seed, count, wanted, grid):
    rng = np.random.default_rng(seed)
    position = rng.normal(size=(count, 3)) * 5
    if grid:  # many paths of one length; no copies, between which an edge has no length
        cells = rng.choice(1000, count, replace=False)
        position = np.column_stack([cells % 10, cells // 10 % 10, cells // 100]).astype(float)
    ends = rng.integers(0, count, (wanted, 2))
    edges = np.unique(np.sort(ends[ends[:, 0] != ends[:, 1]], axis=1), axis=0)
    chosen, roots = rng.random(len(edges)) < 0.8, np.flatnonzero(rng.random(count) < 0.2)
    starts, columns = edge_rows(edges, chosen, count)
    pairs = {(int(i), int(j)) for i, j in edges[chosen]}
    pairs |= {(j, i) for i, j in pairs}
    rows = np.repeat(np.arange(count), np.diff(starts))
    assert sorted(zip(rows.tolist(), columns.tolist(), strict=True)) == sorted(pairs)

    distance, before = shortest_paths(position, starts, columns, roots, False)
    expected, expected_before = relaxed(position, pairs, roots.tolist())
    assert distance.tolist() == expected
    assert before.tolist() == expected_before


def test_rows_of_neighbours_on_paper():
    starts, columns = neighbour_rows(np.array([[1], [2], [1], [0]]))
    assert [columns[a:b].tolist() for a, b in pairwise(starts)] == [
        [1, 3],
        [2, 0, 2],
        [1, 1],
        [0],
    ]


def test_islands_are_joined_at_their_nearest_point():
    # 0 - 1 from the root, 2 - 3 and 4 apart: 3 and 4 are as far from P0, 3 has the lower number.
    position = np.array([[1.0, 0, 0], [2, 0, 0], [0, 5, 0], [0, 4, 0], [0, 0, 4]])
    starts, columns = edge_rows(np.array([[0, 1], [2, 3]]), np.ones(2, bool), 5)
    root = np.array([0])
    distance, before = shortest_paths(position, starts, columns, root, True)
    assert distance.tolist() == [1, 2, 5, 4, 4]
    assert before.tolist() == [-1, 0, 3, -1, -1]
    distance, before = shortest_paths(position, starts, columns, root, False)
    assert distance.tolist() == [1, 2, np.inf, np.inf, np.inf]
    assert before.tolist() == [-1, 0, -1, -1, -1]


@pytest.mark.parametrize("join", [True, False])
def test_no_points_and_no_roots(join):
    none = np.empty(0, int)
    starts, columns = edge_rows(np.empty((0, 2), int), none.astype(bool), 0)
    assert len(shortest_paths(np.empty((0, 3)), starts, columns, none, join)[0]) == 0
    starts, columns = edge_rows(np.empty((0, 2), int), none.astype(bool), 2)
    position = np.array([[3.0, 4, 0], [1e200, 0, 0]])  # its square overflows
    distance, before = shortest_paths(position, starts, columns, none, join)
    assert distance.tolist() == ([5, np.inf] if join else [np.inf, np.inf])
    assert before.tolist() == [-1, -1]


@pytest.mark.realdata
@pytest.mark.parametrize(("number", "tau"), [(0, 35), (1, 10), (2, 1)])
def test_the_tree_of_a_real_scan_is_as_long_as_scipys(shared_data, number, tau):
    frame = open_drive(shared_data / "kitti_object")[number]
    result = analyze(
        frame.points,
        camera=frame.camera,
        cam_from_velo=frame.cam_from_velo,
        settings=Settings(tau=tau, metric="euclidean"),
    )
    position, tree, count = (
        result.node_points - result.viewpoint,
        result.tree_parent,
        len(result.nodes),
    )
    length = np.linalg.norm(position, axis=1)
    edges, lengths = (
        result.edges[result.edge_intervisible],
        result.edge_length[result.edge_intervisible],
    )
    roots = np.flatnonzero(tree == -1)
    row = np.append(edges[:, 0], np.full(len(roots), count))
    column = np.append(edges[:, 1], roots)
    graph = csr_array((np.append(lengths, length[roots]), (row, column)), (count + 1, count + 1))
    expected = dijkstra(graph, directed=False, indices=count)[:count]

    found = np.where(tree == -1, length, np.inf)
    for i in np.argsort(expected):
        if tree[i] >= 0:
            found[i] = found[tree[i]] + np.linalg.norm(position[i] - position[tree[i]])
    assert (np.isfinite(expected) == (tree > -2)).all()
    assert np.allclose(found, expected, rtol=1e-12)
    assert (tree >= 0).sum() > 20
