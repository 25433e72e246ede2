"""Our Delaunay triangulation beside scipy's (Qhull): `make bench`.

Both run in turn in one test, so that a busy machine slows both down. Reported are medians: ours as
the time of the test, scipy's and the ratio beside it. To reach: 10, 65 and 600 ms for 20,000,
127,000 and 1,000,000 positions, a tenth of scipy's time.
"""

from statistics import median
from time import perf_counter

import numpy as np
import pytest
from scipy.spatial import Delaunay

from intervis.delaunay import triangulate

ROUNDS = {20_000: 15, 127_000: 7, 1_000_000: 3}


def beside_scipy(benchmark, positions, rounds):
    theirs = []

    def scipy_first():
        start = perf_counter()
        Delaunay(positions)
        theirs.append(perf_counter() - start)

    triangulate(positions)
    found = benchmark.pedantic(triangulate, (positions,), setup=scipy_first, rounds=rounds)
    benchmark.extra_info |= {"positions": len(positions), "triangles": len(found.triangles)}
    if benchmark.stats is not None:  # benchmarks are enabled
        benchmark.extra_info["scipy ms"] = 1e3 * median(theirs)
        share = benchmark.stats.stats.median / median(theirs)
        benchmark.extra_info["share of scipy's time"] = share


@pytest.mark.benchmark(group="triangulation")
@pytest.mark.parametrize("count", ROUNDS)
def test_random_positions(benchmark, count):
    beside_scipy(benchmark, np.random.default_rng(0).random((count, 2)), ROUNDS[count])


@pytest.mark.benchmark(group="triangulation")
@pytest.mark.parametrize("projection", ["ground", "angles"])
def test_all_returns_of_a_scan(benchmark, frame, projection):
    xyz = np.asarray(frame.points[:, :3], np.float64)
    positions = xyz[:, :2]
    if projection == "angles":
        azimuth = np.arctan2(xyz[:, 1], xyz[:, 0])
        positions = np.column_stack([azimuth, np.arctan2(xyz[:, 2], np.hypot(*positions.T))])
    beside_scipy(benchmark, np.ascontiguousarray(positions), ROUNDS[127_000])
