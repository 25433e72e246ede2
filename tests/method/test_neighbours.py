"""Nearest neighbours against a search of all pairs, ties and copies included."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from intervis.drives import open_drive
from intervis.method.neighbours import BLOCK, nearest_neighbours


def of_all_pairs(points, count):
    """The nearest others by distance, then by row."""
    found = []
    for i, point in enumerate(points):
        offset = points - point
        square = offset[:, 0] ** 2 + offset[:, 1] ** 2 + offset[:, 2] ** 2
        order = np.lexsort((np.arange(len(points)), square))
        found.append(order[order != i][:count])
    return np.array(found).reshape(len(points), min(count, len(points) - 1))


@given(
    st.integers(0, 2**32 - 1),
    st.integers(1, 5 * BLOCK),
    st.integers(1, 9),
    st.sampled_from([1e-12, 1.0, 1e7]),
)
def test_neighbours_are_the_nearest_others(seed, rows, count, scale):
    points = scale * np.random.default_rng(seed).normal(size=(rows, 3))
    assert (nearest_neighbours(points, count) == of_all_pairs(points, count)).all()


@given(st.integers(0, 2**32 - 1), st.integers(2, 6 * BLOCK), st.integers(1, 4))
def test_the_lowest_row_is_nearer_among_equal_distances(seed, rows, size):
    """On a small lattice nearly all distances are equal, and most points are copies."""
    points = np.random.default_rng(seed).integers(0, size, (rows, 3)).astype(float)
    assert (nearest_neighbours(points, 8) == of_all_pairs(points, 8)).all()


@pytest.mark.parametrize("shape", ["line", "plane", "clusters", "copies"])
def test_sets_of_many_blocks(shape, rng):
    points = rng.normal(size=(900, 3))
    if shape == "line":
        points[:, 1:] = 0.0
    elif shape == "plane":
        points[:, 2] = 7.0
    elif shape == "clusters":
        points += 1e6 * rng.integers(0, 3, (900, 1))
    else:
        points[:] = points[0]
    assert (nearest_neighbours(points, 8) == of_all_pairs(points, 8)).all()


def test_the_answer_depends_on_no_thread(rng, monkeypatch):
    points = rng.normal(size=(20_000, 3))
    found = []
    for threads in ("1", "3"):
        monkeypatch.setenv("INTERVIS_THREADS", threads)
        found.append(nearest_neighbours(points, 8))
    assert (found[0] == found[1]).all()
    assert (found[0] == cKDTree(points).query(points, k=9)[1][:, 1:]).all()


def test_numbers_whose_squares_overflow_have_neighbours_too():
    points = np.array([[1e200, 0, 0], [-1e200, 0, 0], [0, 1e200, 0], [0, 0, 1.0]])
    assert nearest_neighbours(points, 3).tolist() == [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]]


def test_few_points_have_few_neighbours():
    assert nearest_neighbours(np.empty((0, 3)), 8).shape == (0, 0)
    assert nearest_neighbours(np.ones((1, 3)), 8).shape == (1, 0)
    assert nearest_neighbours(np.ones((3, 3)), 8).tolist() == [[1, 2], [0, 2], [0, 1]]
    assert nearest_neighbours(np.ones((3, 3)), 0).shape == (3, 0)


@pytest.mark.realdata
@pytest.mark.parametrize("number", [0, 2])
def test_on_a_real_scan_scipy_differs_at_ties_and_copies_alone(shared_data, number):
    frame = open_drive(shared_data / "kitti_object")[number]
    points = frame.points[:20_000, :3].astype(np.float64)
    ours, theirs = nearest_neighbours(points, 8), cKDTree(points).query(points, k=9)[1]
    own = theirs == np.arange(len(points))[:, None]
    own[~own.any(axis=1), -1] = True  # a copy came first, and the point itself not at all
    theirs = theirs[~own].reshape(-1, 8)

    def squares(rows):
        return ((points[rows] - points[:, None]) ** 2).sum(axis=2)

    assert (squares(ours) == np.sort(squares(theirs), axis=1)).all()
