"""Routes that are timed: targets along a route, and sight distance along a road."""

from collections.abc import Iterator, Sequence

import numpy as np

from intervis.arrays import Float64Array
from intervis.lab.speed.timing import Work
from intervis.sight import Scene
from intervis.uses import AASHTO, Route, sight_distances
from intervis.uses.routes.route_sight import route_sight

PLACES, TARGETS = 100, 10_000
BEYOND_M = 50.0
"""The way of the scanner goes on straight by this length, so that there is a road ahead."""

HEIGHT_M = 1.73
"""Of KITTI's scanner above the road."""


def route_works(scene: Scene, poses: Sequence[Float64Array]) -> Iterator[Work]:
    """Routes through a scene along the places of its scans."""
    route = Route.through([pose[:3, 3] for pose in poses]).extended(BEYOND_M)
    eyes = route.at(np.linspace(0.0, route.length_m - BEYOND_M, PLACES))
    low = eyes.min(axis=0) - np.array([20.0, 25.0, 1.5])
    high = eyes.max(axis=0) + np.array([50.0, 25.0, 2.0])
    targets = np.random.default_rng(0).uniform(low, high, (TARGETS, 3))
    group = f"a route: {PLACES} places, {TARGETS:,} targets"
    yield Work(group, "intervis", lambda: route_sight(scene, eyes, targets), PLACES * TARGETS)
    road = route.with_heights(route.points[:, 2] - HEIGHT_M)
    yield Work(
        "sight distance, a station a metre",
        "intervis",
        lambda: sight_distances(scene, road, AASHTO, speed_mps=8.0, step_m=1.0, target_step_m=0.5),
        int(route.length_m - BEYOND_M),
    )
