"""Kernels of tau points: their number, size, shape and invariances."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from intervis.drives import open_drive
from intervis.method.field_of_view import in_camera
from intervis.method.sampling import (
    _first_axis,
    _partition,
    _project,
    sample_kernels,
    sample_radius,
    sample_stride,
)

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


def halves(points, members, kernels, tau, viewpoint):
    """The kernels of some points, split one after the other as the paper's text says."""
    if kernels == 1:
        return [sorted(members)]
    own = points[members]
    axis = np.linalg.eigh(np.cov(own.T))[1][:, -1]
    if axis @ (own.mean(axis=0) - viewpoint) < 0:
        axis = -axis
    ordered = [members[k] for k in np.argsort(own @ axis)]
    near = kernels // 2
    cut = near * tau
    return halves(points, ordered[:cut], near, tau, viewpoint) + halves(
        points, ordered[cut:], kernels - near, tau, viewpoint
    )


@given(st.integers(2, 200), st.integers(2, 40), st.integers(0, 2**32 - 1))
def test_kernels_are_halves_across_the_first_principal_axis(n, tau, seed):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(n, 3)) @ rng.normal(size=(3, 3)) + rng.normal(size=3) * 3
    viewpoint = rng.normal(size=3) * 5
    expected = halves(points, list(range(n)), -(-n // tau), tau, viewpoint)
    assert [sorted(m.tolist()) for m in kernels_of(points, tau, viewpoint)] == expected
    nodes = []
    for members in expected:
        to_mean = np.linalg.norm(points[members] - points[members].mean(axis=0), axis=1)
        ties = [m for m, d in zip(members, to_mean, strict=True) if d <= to_mean.min() * (1 + 1e-7)]
        nodes.append(min(ties, key=lambda m: np.linalg.norm(points[m] - viewpoint)))
    assert sample_kernels(points, tau, viewpoint).tolist() == sorted(nodes)


@pytest.mark.realdata
@pytest.mark.parametrize("tau", [35, 10, 3])
def test_kernels_of_a_real_scan_are_halves_too(shared_data, tau):
    frame = open_drive(shared_data / "kitti_object")[1]
    view = in_camera(frame.points, frame.camera, frame.cam_from_velo)
    points = frame.points[view.index, :3].astype(np.float64)
    expected = halves(points, list(range(len(points))), -(-len(points) // tau), tau, ORIGIN)
    assert [sorted(m.tolist()) for m in kernels_of(points, tau)] == expected


@pytest.mark.parametrize("far_m", [0.0, 1e6])
def test_kernels_are_halves_far_from_the_origin_too(rng, far_m):
    """The moments are taken in one pass: relative to a point, or they would cancel out."""
    points = rng.normal(size=(3000, 3)) * [1.0, 0.9, 0.8] + far_m
    viewpoint = np.full(3, far_m - 20.0)
    found = [sorted(m.tolist()) for m in kernels_of(points, 20, viewpoint)]
    assert found == halves(points, list(range(3000)), 150, 20, viewpoint)


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_of_two_members_the_one_nearer_to_the_viewpoint_is_the_node(axis, side):
    points, viewpoint = np.full((2, 3), 0.5), np.full(3, 0.25)
    points[1, axis] += 2.0
    viewpoint[axis] += side * 4.0
    assert sample_kernels(points, 2, viewpoint).tolist() == [1 if side > 0 else 0]
    assert sample_radius(points, 3.0, viewpoint).tolist() == [1 if side > 0 else 0]


def test_no_points_have_no_node_by_radius():
    assert sample_radius(np.empty((0, 3)), 1.0, ORIGIN).tolist() == []


def test_of_copies_the_first_is_the_node():
    points = np.array([[5.0, 0, 0]] * 4 + [[5.0, 2, 0]] * 4 + [[5.0, 1, 0]] * 3)
    assert sample_kernels(points, 11, ORIGIN).tolist() == [8], "the copies at the mean"
    assert sample_kernels(points[::-1], 11, ORIGIN).tolist() == [0]
    # two pairs of copies at one distance from the mean and from P0
    pairs = np.array([[5.0, 1, 0], [5, -1, 0], [5, 1, 0], [5, -1, 0]])
    assert sample_kernels(pairs, 4, ORIGIN).tolist() == [0]
    assert sample_kernels(pairs[::-1], 4, ORIGIN).tolist() == [0]


@given(
    st.integers(0, 2**32 - 1),
    st.sampled_from(["any", "flat", "line", "diagonal", "round"]),
    st.sampled_from([1e-6, 1.0, 1e6]),
)
def test_the_first_axis_is_an_eigenvector_of_the_largest_eigenvalue(seed, kind, size):
    rng = np.random.default_rng(seed)
    spread = size * rng.uniform(0.1, 5.0, 3)
    if kind in ("flat", "line"):
        spread[: 1 if kind == "flat" else 2] = 0.0
    points = rng.normal(size=(20, 3)) * rng.permutation(spread)
    if kind != "diagonal":
        points = points @ Rotation.random(rng=rng).as_matrix()
    matrix = points.T @ points
    if kind == "diagonal":
        matrix = np.diag(np.diag(matrix))
    if kind == "round":
        matrix = np.eye(3)
    axis = np.array(_first_axis(*matrix[[0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]]))
    largest = np.linalg.eigvalsh(matrix)[-1]
    assert np.linalg.norm(axis) == pytest.approx(1.0)
    assert np.allclose(matrix @ axis, largest * axis, atol=1e-9 * largest)


@given(
    st.integers(0, 2**32 - 1),
    st.floats(1e-8, 0.9),
    st.floats(0.0, 1.0),
    st.sampled_from([1e-9, 1.0, 1e18]),
)
def test_the_first_axis_of_nearly_round_matrices(seed, gap, third, size):
    """The second eigenvalue is less than the first by a share, the third is any smaller one."""
    basis = Rotation.random(rng=np.random.default_rng(seed)).as_matrix()
    eigenvalues = np.array([1.0, 1.0 - gap, third * (1.0 - gap)])
    matrix = size * (basis * eigenvalues) @ basis.T
    axis = _first_axis(*matrix[[0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]])
    assert np.linalg.norm(np.cross(axis, basis[:, 0])) < 1e-14 / gap


def test_no_matrix_is_too_small_for_an_axis():
    for nothing in (0.0, 5e-324):
        assert _first_axis(nothing, 0.0, 0.0, nothing, 0.0, 0.0) == (1.0, 0.0, 0.0)


@given(st.integers(0, 10**6), st.integers(3, 40))
def test_points_are_projected_on_their_first_principal_axis(seed, count):
    """Mean and standard deviation against numpy's, of a body that lies askew to all axes."""
    rng = np.random.default_rng(seed)
    turn = Rotation.random(random_state=seed).as_matrix()
    points = (rng.normal(size=(count, 3)) * [5.0, 2.0, 1.0]) @ turn.T + [30.0, -20.0, 10.0]
    scratch = np.empty((4, count))
    viewpoint = np.array([1.0, 2.0, 0.5])
    mean, spread = _project(points, np.arange(count), viewpoint, *scratch)
    near = points - points[0]
    axis = np.linalg.svd(near - near.mean(axis=0))[2][0]
    axis *= np.sign(axis @ (points.mean(axis=0) - viewpoint))
    # Two axes of nearly the same spread are told apart by rounding alone.
    np.testing.assert_allclose(scratch[3].std(), (near @ axis).std(), rtol=1e-6)
    np.testing.assert_allclose(spread, scratch[3].std(), rtol=1e-9)
    np.testing.assert_allclose(mean, scratch[3].mean(), rtol=1e-9, atol=1e-9)
