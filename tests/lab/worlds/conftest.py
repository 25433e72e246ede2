"""The built-in street, built once; brute force and Embree as doubles of the ray caster."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from intervis.lab.worlds.street.layout import build_street
from intervis.lab.worlds.world import Moment, World

Rays = Callable[..., tuple[NDArray[np.float64], NDArray[np.int64]]]


@pytest.fixture(scope="session")
def street() -> World:
    return build_street(0)


@pytest.fixture(scope="session")
def street_moment(street: World) -> Moment:
    return street.at(0.7)


@pytest.fixture(scope="session")
def embree() -> Callable[[NDArray[np.float64]], Rays]:
    """A maker of casters: triangles -> (origins, directions) -> (ranges, hits), in float32."""
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene

    def built(triangles: NDArray[np.float64]) -> Rays:
        scene = EmbreeScene(robust=True)
        TriangleMesh(scene, np.ascontiguousarray(triangles, np.float32))

        def cast(
            origins: NDArray[np.float64], directions: NDArray[np.float64], farthest: float = 1e30
        ) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
            ways = np.ascontiguousarray(directions, np.float32)
            starts = np.ascontiguousarray(np.broadcast_to(origins, ways.shape), np.float32)
            reach = np.full(len(ways), farthest, np.float32)
            ranges = scene.run(starts, ways, dists=reach, query="DISTANCE").astype(np.float64)
            hits = scene.run(starts, ways, dists=reach, query="INTERSECT").astype(np.int64)
            ranges[hits < 0] = np.inf
            return ranges, hits

        return cast

    return built
