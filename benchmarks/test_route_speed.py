"""How long a route takes: `make bench`. Kernels are compiled before the clock starts."""

import time

import numpy as np
import pytest

from intervis.sight import Scene
from intervis.uses import AASHTO, Route, sight_distances
from intervis.uses.route_sight import route_sight

PLACES, TARGETS = 100, 10_000


@pytest.fixture(scope="session")
def survey(frames):
    """A scene of 14 scans, and the way of their scanner with a straight end of 50 m."""
    scene = Scene()
    for frame in frames:
        scene.add(frame.points, frame.pose)
    return scene, Route.through([frame.pose[:3, 3] for frame in frames]).extended(50.0)


@pytest.mark.benchmark(group="a route")
def test_targets_along_a_route(benchmark, survey):
    """To reach on two quiet cores: 3 s for 100 places x 10,000 targets."""
    scene, route = survey
    eyes = route.at(np.linspace(0.0, route.length_m - 50.0, PLACES))
    low = eyes.min(axis=0) - np.array([20.0, 25.0, 1.5])
    high = eyes.max(axis=0) + np.array([50.0, 25.0, 2.0])
    targets = np.random.default_rng(0).uniform(low, high, (TARGETS, 3))
    route_sight(scene, eyes[:1], targets[:10])
    begin_s = time.process_time()
    found = benchmark.pedantic(route_sight, args=(scene, eyes, targets), rounds=3)
    benchmark.extra_info["lines"] = found.state.size
    benchmark.extra_info["processor_s_per_round"] = (time.process_time() - begin_s) / 3


@pytest.mark.benchmark(group="a route")
def test_sight_distance(benchmark, survey):
    """Stations 1 m apart, objects 0.5 m apart."""
    scene, route = survey
    road = route.with_heights(route.points[:, 2] - 1.73)
    steps = {"speed_mps": 8.0, "step_m": 1.0, "target_step_m": 0.5}
    sight_distances(scene, road, AASHTO, **(steps | {"step_m": 10.0}))
    found = benchmark(lambda: sight_distances(scene, road, AASHTO, **steps))
    benchmark.extra_info["lines"] = int((found.state != -2).sum())
