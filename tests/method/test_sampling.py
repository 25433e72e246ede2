"""Kernels of tau points: their number, size, shape and invariances."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from intervis.method.sampling import _partition, sample_kernels, sample_radius, sample_stride

ORIGIN = np.zeros(3)


def kernels_of(points, tau, viewpoint=ORIGIN):
    """Members of each kernel."""
    order = np.arange(len(points))
    starts = _partition(points, order, tau, viewpoint)
    return [order[a:b] for a, b in pairwise(starts)]


@given(st.integers(1, 400), st.integers(1, 60), st.integers(0, 2**32 - 1))
def test_exactly_ceil_n_over_tau_kernels_all_full_but_the_last(n, tau, seed):
    points = np.random.default_rng(seed).normal(size=(n, 3))
    nodes = sample_kernels(points, tau, ORIGIN)
    assert len(nodes) == -(-n // tau)
    assert len(np.unique(nodes)) == len(nodes)
    members = kernels_of(points, tau)
    assert [len(m) for m in members[:-1]] == [tau] * (len(members) - 1)
    assert np.sort(np.concatenate(members)).tolist() == list(range(n))


@pytest.mark.parametrize("tau", range(10, 101, 10))
def test_node_counts_of_table_2(tau, rng):
    # SP = N + n - 1 gives the paper's own n for each tau.
    n_elements = {10: 3982, 20: 1984, 30: 1320, 40: 987, 50: 786}
    n_edges = {10: 5982, 20: 2984, 30: 1986, 40: 1487, 50: 1186}
    n_elements |= {60: 653, 70: 557, 80: 488, 90: 432, 100: 388}
    n_edges |= {60: 986, 70: 842, 80: 738, 90: 654, 100: 588}
    nodes = sample_kernels(rng.normal(size=(20_008, 3)), tau, ORIGIN)
    assert len(nodes) == n_edges[tau] - n_elements[tau] + 1


def test_the_node_is_the_member_nearest_to_the_mean(rng):
    points = rng.normal(size=(300, 3))
    nodes = set(sample_kernels(points, 20, ORIGIN).tolist())
    for members in kernels_of(points, 20):
        mean = points[members].mean(axis=0)
        nearest = members[np.argmin(np.linalg.norm(points[members] - mean, axis=1))]
        assert nearest in nodes


def test_a_line_is_cut_into_runs_from_the_near_end():
    points = np.array([[float(x), 0, 0] for x in (9, 1, 5, 3, 7, 11, 13)])
    runs = [sorted(points[m, 0].tolist()) for m in kernels_of(points, 3)]
    assert runs == [[1, 3, 5], [7, 9, 11], [13]]


def test_kernels_are_compact(rng):
    """A grid of 32 x 32 points in kernels of 16: squares of 4 x 4 are optimal."""
    grid = np.stack(np.meshgrid(np.arange(32.0), np.arange(32.0)), axis=-1).reshape(-1, 2)
    points = np.column_stack([grid, np.zeros(len(grid))])
    spread = [points[m].var(axis=0).sum() for m in kernels_of(points, 16)]
    square = np.stack(np.meshgrid(np.arange(4), np.arange(4)), -1).reshape(-1, 2).var(axis=0).sum()
    assert square <= np.mean(spread) <= 1.5 * square
    shuffled = rng.permutation(1024).reshape(64, 16)
    assert np.mean(spread) < 0.05 * np.mean([points[m].var(axis=0).sum() for m in shuffled])


@given(st.integers(0, 2**32 - 1))
def test_the_order_of_the_points_does_not_matter(seed):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(257, 3))
    shuffle = rng.permutation(257)
    nodes = sample_kernels(points, 12, ORIGIN)
    again = shuffle[sample_kernels(points[shuffle], 12, ORIGIN)]
    assert sorted(again.tolist()) == nodes.tolist()


@given(st.integers(0, 2**32 - 1))
def test_a_rigid_motion_does_not_matter(seed):
    rng = np.random.default_rng(seed)
    points, viewpoint = rng.normal(size=(257, 3)) * [9, 3, 1], rng.normal(size=3)
    turn, shift = Rotation.random(rng=rng).as_matrix(), rng.normal(size=3) * 10
    nodes = sample_kernels(points, 12, viewpoint)
    again = sample_kernels(points @ turn.T + shift, 12, turn @ viewpoint + shift)
    assert again.tolist() == nodes.tolist()


def test_copies_and_tiny_clouds():
    same = np.ones((10, 3))
    assert len(sample_kernels(same, 4, ORIGIN)) == 3
    assert sample_kernels(same[:1], 35, ORIGIN).tolist() == [0]
    assert len(sample_kernels(np.empty((0, 3)), 35, ORIGIN)) == 0
    assert sample_kernels(same, 1, ORIGIN).tolist() == list(range(10))


@given(st.integers(1, 500), st.integers(1, 50))
def test_stride_takes_every_tau_th(n, tau):
    assert sample_stride(n, tau).tolist() == [k for k in range(n) if k % tau == 0]
    assert len(sample_stride(n, tau)) == -(-n // tau)


@given(st.integers(1, 200), st.floats(0.05, 3.0), st.integers(0, 2**32 - 1))
def test_balls_equal_a_greedy_loop(n, radius_m, seed):
    points = np.random.default_rng(seed).uniform(-3, 3, (n, 3))
    free, expected = np.ones(n, bool), []
    for start in range(n):
        if not free[start]:
            continue
        inside = np.linalg.norm(points - points[start], axis=1) <= radius_m
        members = np.flatnonzero(free & inside)
        free &= ~inside
        to_mean = np.linalg.norm(points[members] - points[members].mean(axis=0), axis=1)
        nearest = members[to_mean <= to_mean.min() * (1 + 1e-6)]
        expected.append(nearest[np.argmin(np.linalg.norm(points[nearest], axis=1))])
    assert sample_radius(points, radius_m, ORIGIN).tolist() == sorted(expected)
