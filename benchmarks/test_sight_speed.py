"""How long sight lines take, beside a triangulated scan and Embree: `make bench`.

Medians; kernels are compiled before the clock starts. The targets are the returns of the first
scan, the viewpoint is where the sensor stood about 5 m farther on.
"""

from typing import NamedTuple

import numpy as np
import pytest

from intervis.lab.worlds.ray_casting import RayCaster
from intervis.sight import Scene
from intervis.transform import inverse, transform

AWAY_M = 5.0
MAX_SCANS = 7


class Question(NamedTuple):
    """Scans (N, 3) in their sensors' frames with poses; viewpoint and targets, world frame."""

    scans: list
    poses: list
    viewpoint: np.ndarray
    targets: np.ndarray


@pytest.fixture(scope="session")
def question(frames):
    first = frames[0]
    away_m = [np.linalg.norm(frame.pose[:3, 3] - first.pose[:3, 3]) for frame in frames]
    viewpoint = frames[int(np.argmin(np.abs(np.array(away_m) - AWAY_M)))].pose[:3, 3]
    kept = frames[::2][:MAX_SCANS]
    return Question(
        [frame.points for frame in kept],
        [frame.pose for frame in kept],
        viewpoint,
        transform(first.pose, np.asarray(first.points[:, :3], np.float64)),
    )


def note(benchmark, question, **more):
    benchmark.extra_info["lines"] = len(question.targets)
    benchmark.extra_info.update(more)


@pytest.mark.benchmark(group="a scan made ready")
def test_scan_to_scene(benchmark, question):
    """To reach: 20 ms."""
    Scene.from_scan(question.scans[0], question.poses[0])
    scene = benchmark(Scene.from_scan, question.scans[0], question.poses[0])
    note(benchmark, question, bytes=scene.bytes)


@pytest.mark.benchmark(group="a scan made ready")
def test_rival_scan_to_tree(benchmark, question):
    """Delaunay triangles over the scan's directions, and Embree's tree over them."""
    triangulated = rival()

    def run():
        return RayCaster(triangulated.surface(question.scans[0], 0.2))

    caster = benchmark.pedantic(run, rounds=3)
    note(benchmark, question, caster=type(caster).__name__)


@pytest.mark.benchmark(group="all sight lines of a viewpoint")
@pytest.mark.parametrize("scans", [1, MAX_SCANS])
def test_sight_lines(benchmark, question, scans):
    """To reach, with one scan: 40 ms on two cores."""
    scene = Scene()
    for scan, pose in zip(question.scans[:scans], question.poses[:scans], strict=True):
        scene.add(scan, pose)
    scene.sight(question.viewpoint, question.targets)
    sight = benchmark(scene.sight, question.viewpoint, question.targets)
    note(benchmark, question, visible=float((sight.state == 1).mean()))


@pytest.mark.benchmark(group="all sight lines of a viewpoint")
@pytest.mark.parametrize("scans", [1, MAX_SCANS])
def test_rival_casts(benchmark, question, scans):
    """Whether each line is blocked, no more: one surface, or the votes of seven."""
    triangulated = rival()
    casters = [RayCaster(triangulated.surface(scan, 0.2)) for scan in question.scans[:scans]]
    viewpoint, targets = question.viewpoint, question.targets
    slack_m = 0.3 + 0.02 * np.linalg.norm(targets - viewpoint, axis=1)

    def run():
        votes = np.zeros(len(targets))
        for caster, pose in zip(casters, question.poses, strict=False):
            back = inverse(pose)
            votes += caster.blocked(
                transform(back, viewpoint), transform(back, targets), slack_m=slack_m
            )
        return votes

    run()
    blocked = benchmark(run)
    note(benchmark, question, blocked=float((blocked > 0).mean()), caster=type(casters[0]).__name__)


def rival():
    from intervis.lab.truth.baselines import triangulated

    return triangulated
