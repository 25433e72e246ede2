"""Rays through voxels against the boxes that a segment meets, one by one."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from intervis.uses.voxels.kernels.ray_walk import CROSSED, ENDED, mark_beams, mark_pixels, walk

SHAPE = (6, 5, 4)


def met(origin: np.ndarray, end: np.ndarray, slack: float) -> set[int]:
    """Voxels that a segment meets for at least `slack` of its length (negative: touches nearly)."""
    along, found = end - origin, set()
    for flat, voxel in enumerate(np.ndindex(SHAPE)):
        t0, t1 = 0.0, 1.0
        for axis in range(3):
            low, high = voxel[axis] - origin[axis], voxel[axis] + 1 - origin[axis]
            if along[axis] == 0.0:
                if not low < 0.0 < high:
                    t0, t1 = 1.0, 0.0
                continue
            a, b = sorted((low / along[axis], high / along[axis]))
            t0, t1 = max(t0, a), min(t1, b)
        if t1 - t0 > slack:
            found.add(flat)
    return found


def path_of(origin: np.ndarray, end: np.ndarray) -> list[int]:
    path = np.empty(sum(SHAPE), np.int32)
    return path[: walk(origin, end, *SHAPE, path)].tolist()


@given(st.integers(0, 2**32 - 1), st.sampled_from([2.0, 8.0]), st.booleans())
@settings(max_examples=300)
def test_a_walk_meets_the_voxels_of_its_segment_in_order(seed, spread, level) -> None:
    rng = np.random.default_rng(seed)
    origin, end = rng.uniform(-spread, spread, (2, 3)) + np.array(SHAPE) / 2
    if level:
        axis = rng.integers(0, 3)
        end[axis] = origin[axis]
    path = path_of(origin, end)
    assert met(origin, end, 1e-9) <= set(path) <= met(origin, end, -1e-9)
    assert len(path) == len(set(path))
    voxels = np.column_stack(np.unravel_index(np.array(path, np.int64), SHAPE))
    assert (np.abs(np.diff(voxels, axis=0)).sum(axis=1) == 1).all()
    along = voxels @ np.sign(end - origin)
    assert (np.diff(along) == 1).all()  # every step leads towards the end


def test_a_walk_along_an_axis() -> None:
    assert path_of(np.array([-3.0, 0.5, 0.5]), np.array([2.5, 0.5, 0.5])) == [0, 20, 40]
    assert path_of(np.array([2.5, 0.5, 0.5]), np.array([-3.0, 0.5, 0.5])) == [40, 20, 0]
    assert path_of(np.array([2.5, 0.5, 0.5]), np.array([2.5, 0.5, 0.5])) == [40]
    assert path_of(np.array([-2.0, 9.0, 0.5]), np.array([9.0, 9.0, 0.5])) == []


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=50)
def test_beams_mark_what_they_cross_and_where_they_end(seed) -> None:
    rng = np.random.default_rng(seed)
    origin, ends = rng.uniform(0, 4, 3), rng.uniform(-2, 7, (7, 3))
    marks = np.zeros(SHAPE, np.uint8)
    mark_beams(origin, ends, marks)
    crossed, ended = set(), set()
    for end in ends:
        last = tuple(np.floor(end).astype(int))
        inside = all(0 <= last[a] < SHAPE[a] for a in range(3))
        last_flat = int(np.ravel_multi_index(last, SHAPE)) if inside else -1
        crossed |= set(path_of(origin, end)) - {last_flat}
        ended |= {last_flat} - {-1}
    assert set(np.flatnonzero(marks & CROSSED).tolist()) == crossed
    assert set(np.flatnonzero(marks & ENDED).tolist()) == ended


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=50)
def test_pixels_see_up_to_the_first_occupied_voxel(seed) -> None:
    rng = np.random.default_rng(seed)
    origin, ends = rng.uniform(-1, 4, 3), rng.uniform(-9, 14, (12, 3))
    state = rng.choice(np.array([0, 0, 0, 1, 2, 3], np.uint8), SHAPE)
    seen = np.zeros(SHAPE, np.uint8)
    mark_pixels(origin, ends, state, seen, 0, len(ends))
    expected = set()
    for end in ends:
        for voxel in path_of(origin, end):
            kind = state.ravel()[voxel]
            expected |= {voxel} if kind in (0, 1) else set()
            if kind == 1:
                break
    assert set(np.flatnonzero(seen).tolist()) == expected
