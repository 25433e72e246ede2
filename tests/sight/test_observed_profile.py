"""Where along a line nothing was observed: behind a wall, whichever end is the viewpoint."""

import numpy as np
import pytest

from intervis.sight import Scene
from intervis.sight.observed_profile import unobserved_parts
from intervis.sight.occupancy_model import MODEL


def test_unobserved_parts_are_those_behind_a_wall():
    y, z = np.meshgrid(np.arange(-5, 5, 0.04), np.arange(-1.5, 1.5, 0.06))
    wall = np.stack([np.full(y.size, 10.0), y.ravel(), z.ravel()], axis=1)
    scene = Scene.from_scan(wall)
    rng = np.random.default_rng(3)
    starts = rng.uniform([1, -1, -0.5], [8, 1, 0.5], (40, 3))
    ends = rng.uniform([11, -1, -0.5], [30, 1, 0.5], (40, 3))
    there = unobserved_parts(scene.packed_scans(), starts, ends, 16)
    back = unobserved_parts(scene.packed_scans(), ends, starts, 16)
    lengths = [scene.unobserved_length(a, b) for a, b in zip(starts, ends, strict=True)]
    assert there.sum(axis=1) == pytest.approx(lengths)
    # A sample in the middle of a border of parts may fall to either side.
    step_m = MODEL.parameters.step_m
    assert np.abs(np.cumsum(there, axis=1) - np.cumsum(back[:, ::-1], axis=1)).max() <= step_m
    for start, end, parts in zip(starts, ends, there, strict=True):
        middles = start[0] + (np.arange(16) + 0.5) / 16 * (end[0] - start[0])
        size_m = np.linalg.norm(end - start) / 16
        assert (parts[middles + size_m < 10] == 0).all()
        behind = middles - size_m > 11  # a surface is thick
        behind[-2:] = False  # 0.4 m at the end do not count
        assert parts[behind] == pytest.approx(size_m, abs=step_m)
