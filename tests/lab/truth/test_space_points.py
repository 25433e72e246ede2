"""Random points in space: against a brute force, and in the yard against its triangles."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from yard import YARD, scan_of

from intervis.lab.truth.held_out import LabelRule
from intervis.lab.truth.space_points import space_points
from intervis.lab.worlds.ray_casting import RayCaster
from intervis.transform import rigid, transform

RULE = LabelRule()


def brute_force(point, beams):
    """True, False or None (left out), every beam against the point."""
    r = math.dist(point, (0, 0, 0))
    lengths = np.linalg.norm(beams, axis=1)
    sines = np.linalg.norm(np.cross(beams, point), axis=1)
    angles = np.degrees(np.arctan2(sines, beams @ point))
    beside = sorted(zip(angles, lengths, strict=True))[:8]
    beside = [(angle, length) for angle, length in beside if angle < 0.25]
    if not beside or beside[0][0] >= 0.15:
        return None
    margin = 0.15 + 0.01 * r
    if all(length > r + margin for _, length in beside):
        return True
    if len(beside) >= 2 and all(length < r - margin for _, length in beside):
        return False
    return None


def patch(rng, count=250):
    """Directions within 1.5 degrees, ranges on two surfaces and between."""
    azimuth, elevation = np.radians(rng.uniform(-1.5, 1.5, (2, count)))
    unit = np.column_stack([np.ones(count), np.tan(azimuth), np.tan(elevation)])
    unit /= np.linalg.norm(unit, axis=1)[:, None]
    return unit * (rng.choice([8.0, 20.0, 38.0], count) * rng.uniform(0.98, 1.02, count))[:, None]


class Recorder:
    """A random generator that keeps what it drew."""

    def __init__(self, source):
        self.source, self.drawn = source, []

    def integers(self, *arguments):
        self.drawn.append(self.source.integers(*arguments))
        return self.drawn[-1]

    def uniform(self, *arguments):
        self.drawn.append(self.source.uniform(*arguments))
        return self.drawn[-1]


def test_labels_equal_brute_force(rng):
    beams, recorder = patch(rng), Recorder(rng)
    found = space_points(beams, RULE, 2000, recorder)
    rows, turns, ranges = recorder.drawn
    assert np.abs(turns).max() <= 0.15
    assert ranges.min() >= 2.7
    assert ranges.max() <= 40
    # all points drawn, also those left out: turned along two axes across the beam's direction
    unit = beams[rows] / np.linalg.norm(beams[rows], axis=1)[:, None]
    first = np.cross(unit, np.eye(3)[np.argmin(np.abs(unit), axis=1)])
    first /= np.linalg.norm(first, axis=1)[:, None]
    shift = np.tan(np.radians(turns))
    turned = unit + shift[0] * first + shift[1] * np.cross(unit, first)
    points = turned / np.linalg.norm(turned, axis=1)[:, None] * ranges[:, None]
    labels = [brute_force(point, beams) for point in points]
    kept = [row for row, label in enumerate(labels) if label is not None]
    assert min(labels.count(True), labels.count(False), labels.count(None)) > 100
    np.testing.assert_allclose(found.points, points[kept], atol=1e-9)
    assert found.visible.tolist() == [labels[row] for row in kept]


@pytest.mark.parametrize("angles", [(0.0, 0.0, 0.0), (20.0, 45.0, 100.0)])
def test_points_agree_with_the_triangles(angles):
    rotation = Rotation.from_euler("xyz", angles, degrees=True).as_matrix()
    pose = rigid(rotation, [0.0, 0.0, 1.7])
    scan = scan_of(YARD, pose, step_deg=0.2)
    rule = LabelRule(neighbour_angle_deg=0.3, min_range_m=1.5)
    found = space_points(scan, rule, 6000, np.random.default_rng(1))
    points = transform(pose, found.points)
    visible = ~RayCaster(YARD).blocked(pose[:3, 3], points)
    assert 0.1 < visible.mean() < 0.9
    assert (visible == found.visible).mean() > 0.999


def test_equal_seeds_give_equal_points():
    beams = patch(np.random.default_rng(0))
    one, same, other = (
        space_points(beams, RULE, 500, np.random.default_rng(seed)).points for seed in (3, 3, 4)
    )
    np.testing.assert_array_equal(one, same)
    assert len(one) != len(other) or not np.array_equal(one, other)


def test_a_scan_without_a_direction_has_no_points(rng):
    for scan in (np.empty((0, 3)), np.zeros((4, 3)), np.full((4, 3), np.nan)):
        assert len(space_points(scan, RULE, 10, rng).points) == 0
