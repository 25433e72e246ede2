"""Held-out labels against hand-made cases and a brute-force implementation."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from intervis.errors import PointsError, PoseError
from intervis.lab.truth.held_out import (
    DRIVE_RULE,
    SILHOUETTES_VISIBLE,
    HeldOutLabels,
    LabelRule,
    beam_spacing_deg,
    held_out_labels,
    rule_for_scanner,
)
from intervis.transform import rigid, transform

HERE = np.eye(4)


def at(azimuth_deg, range_m, elevation_deg=0.0):
    azimuth, elevation = np.radians(azimuth_deg), np.radians(elevation_deg)
    return range_m * np.array(
        [
            np.cos(elevation) * np.cos(azimuth),
            np.cos(elevation) * np.sin(azimuth),
            np.sin(elevation),
        ]
    )


def label(point, beams, rule=DRIVE_RULE):
    """True, False or None (no label) for one point, both scans at the same pose."""
    labels = held_out_labels(np.array([point]), HERE, np.array(beams), HERE, rule)
    return None if len(labels.index) == 0 else bool(labels.visible[0])


def brute_force(points_i, pose_i, points_j, pose_j, silhouettes):
    """The same rule in plain Python, every point against every beam; {row: visible}."""
    to_j = np.linalg.inv(pose_j) @ pose_i
    labels = {}
    for row, point in enumerate(points_i):
        q = to_j[:3, :3] @ point + to_j[:3, 3]
        r = math.dist(q, (0, 0, 0))
        if not 2.7 <= r <= 75:
            continue
        lengths = np.linalg.norm(points_j, axis=1)
        sines = np.linalg.norm(np.cross(points_j, q), axis=1)
        angles = np.degrees(np.arctan2(sines, points_j @ q))
        pairs = sorted(zip(angles, lengths, strict=True))
        beside = [pair for pair in pairs if pair[0] < 0.25][:8]
        if not beside or beside[0][0] >= 0.15:
            continue
        if any(abs(length - r) < 0.15 + 0.01 * r for _, length in beside):
            if silhouettes or not any(length < r - 1 for _, length in beside):
                labels[row] = True
        elif len(beside) >= 2 and all(length < r - (1 + 0.02 * r) for _, length in beside):
            labels[row] = False
    return labels


@pytest.mark.parametrize(
    ("range_m", "beam_ranges", "expected"),
    [
        (20.0, [20.0], True),
        (20.0, [20.34], True),  # 0.15 + 0.2 m allowed
        (20.0, [20.36], None),
        (20.0, [19.66], True),
        (20.0, [19.64], None),
        (20.0, [18.59, 18.59], False),  # 1.0 + 0.4 m before it
        (20.0, [18.59], None),  # a single one may be noise
        (20.0, [18.61, 18.61], None),
        (20.0, [18.59, 18.61], None),
        (20.0, [5.0, 5.0, 20.1], None),  # one beam reaches it, at a silhouette
        (20.0, [20.1, 35.0], True),
        (20.0, [5.0, 5.0, 30.0], None),  # one passes it
        (20.0, [30.0, 30.0], None),
        (20.0, [], None),
        (2.69, [2.69], None),
        (2.71, [2.71], True),
        (75.1, [75.1], None),
        (74.9, [74.9], True),
    ],
)
def test_one_direction(range_m, beam_ranges, expected):
    beams = [at(30.0, r) for r in beam_ranges] + [at(200.0, 9.0)]
    assert label(at(30.0, range_m), beams) is expected


@pytest.mark.parametrize(
    ("angles", "expected"),
    [
        ([0.149], True),
        ([0.151], None),  # the nearest is too far away in angle
        ([0.151, 0.01], True),
        ([0.249, 0.01], True),
    ],
)
def test_angles(angles, expected):
    # all beams end on the point's range; the angle alone decides
    assert label(at(0, 10.0), [at(angle, 10.0) for angle in angles]) is expected


def test_far_beam_counts_only_within_a_quarter_degree():
    # the nearest beam goes far beyond; one on the point decides while it is within 0.25 degrees
    assert label(at(0, 10.0), [at(0.05, 50.0), at(0, 10.0, 0.249)]) is True
    assert label(at(0, 10.0), [at(0.05, 50.0), at(0, 10.0, 0.251)]) is None


def test_only_the_eight_nearest_beams_count():
    eight = [at(0, 4.0, 0.01 * k) for k in range(8)]
    assert label(at(0, 10.0), [*eight, at(0.2, 10.0)], SILHOUETTES_VISIBLE) is False
    assert label(at(0, 10.0), [*eight[:7], at(0.2, 10.0)], SILHOUETTES_VISIBLE) is True
    assert label(at(0, 10.0), [*eight[:7], at(0.2, 10.0)]) is None


def test_viewpoint_and_range_are_in_frame_i():
    pose_i = rigid([[0, -1, 0], [1, 0, 0], [0, 0, 1]], [100.0, 50.0, 1.0])  # faces +y
    pose_j = rigid(np.eye(3), [100.0, 56.0, 1.0])
    target_world = np.array([[110.0, 56.0, 1.0]])
    points_i = transform(np.linalg.inv(pose_i), target_world)
    labels = held_out_labels(points_i, pose_i, np.array([[10.0, 0.0, 0.0]]), pose_j)
    np.testing.assert_allclose(labels.viewpoint_i, [6.0, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(labels.range_m, [10.0])
    assert labels.visible.tolist() == [True]


def test_rows_without_a_direction_are_ignored():
    points = np.array([[np.nan, 0, 0], [np.inf, 0, 0], [0, 0, 0], [10.0, 0, 0]])
    labels = held_out_labels(points, HERE, points, HERE)
    assert labels.index.tolist() == [3]


@pytest.mark.parametrize("empty", ["i", "j"])
def test_empty_scans_give_no_labels(empty):
    one, none = np.array([[10.0, 0, 0]]), np.empty((0, 3))
    labels = held_out_labels(
        none if empty == "i" else one, HERE, none if empty == "j" else one, HERE
    )
    assert isinstance(labels, HeldOutLabels)
    assert labels.index.shape == labels.visible.shape == labels.range_m.shape == (0,)
    assert labels.visible.dtype == bool


def test_bad_input_is_refused():
    good = np.zeros((2, 3))
    with pytest.raises(PointsError, match="points_j"):
        held_out_labels(good, HERE, np.zeros((2, 2)), HERE)
    with pytest.raises(PoseError, match="pose_i"):
        held_out_labels(good, 2 * HERE, good, HERE)


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=30, deadline=None)
def test_labels_equal_brute_force(seed):
    rng = np.random.default_rng(seed)
    # a dense patch of directions, so that every rule applies; ranges on two surfaces and between
    azimuth, elevation = rng.uniform(-1.5, 1.5, (2, 150))
    ranges = rng.choice([6.0, 20.0, 20.3, 40.0], 150) * rng.uniform(0.98, 1.02, 150)
    points = np.array([at(*a) for a in zip(azimuth, ranges, elevation, strict=True)])
    pose_i = rigid(np.eye(3), rng.normal(0, 5, 3))
    pose_j = rigid([[0, -1, 0], [1, 0, 0], [0, 0, 1]], rng.normal(0, 5, 3))
    # scan i: points that lie near the beams of scan j, seen from elsewhere
    world = transform(pose_j, points * rng.choice([1.0, 1.002, 0.8, 1.3], (150, 1)))
    points_i = transform(np.linalg.inv(pose_i), world + rng.normal(0, 0.01, (150, 3)))
    points_j = points[rng.random(150) < 0.7]
    for rule in (DRIVE_RULE, SILHOUETTES_VISIBLE):
        labels = held_out_labels(points_i, pose_i, points_j, pose_j, rule)
        expected = brute_force(points_i, pose_i, points_j, pose_j, rule.label_silhouettes)
        assert dict(zip(labels.index.tolist(), labels.visible.tolist(), strict=True)) == expected


def test_the_random_cases_give_every_label():
    rng = np.random.default_rng(0)
    counts = {True: 0, False: 0, None: 0}
    for _ in range(200):
        beams = [at(*rng.uniform(-0.3, 0.3, 1), rng.choice([6.0, 20.0])) for _ in range(3)]
        counts[label(at(0, 20.0), beams)] += 1
    assert min(counts.values()) > 10


def test_inputs_are_not_changed():
    points = np.array([[10.0, 0, 0], [0, 10.0, 0]])
    before = points.copy()
    held_out_labels(points, HERE, points, HERE)
    np.testing.assert_array_equal(points, before)


def grid_scan(azimuth_step_deg, elevation_step_deg, range_m=9.0):
    azimuth, elevation = np.mgrid[-15:16, -15:16].reshape(2, -1)
    rows = zip(azimuth * azimuth_step_deg, elevation * elevation_step_deg, strict=True)
    return np.array([at(a, range_m, e) for a, e in rows])


@pytest.mark.parametrize(
    ("azimuth_step", "elevation_step", "fourth"),
    [
        (0.5, 0.5, 0.5),
        (0.2, 1.0, 0.4),  # 0.2, 0.2, 0.4, 0.4 within the ring
        (0.2, 0.3, 0.3),  # 0.2, 0.2, 0.3, 0.3: the neighbours in the ring, and above and below
    ],
)
def test_beam_spacing_is_the_fourth_nearest_angle(azimuth_step, elevation_step, fourth, rng):
    scan = grid_scan(azimuth_step, elevation_step) * rng.uniform(0.2, 5.0, (961, 1))
    with_others = np.vstack([scan, np.zeros((50, 3)), np.full((2, 3), np.nan)])
    assert beam_spacing_deg(with_others) == pytest.approx(fourth, rel=0.02)


def test_beam_spacing_by_all_angles(rng):
    unit = np.array([at(a, 1.0, e) for a, e in rng.uniform(-4, 4, (61, 2))])
    angles = np.degrees(np.arccos(np.clip(unit @ unit.T, -1, 1)))
    np.fill_diagonal(angles, np.inf)
    fourth = np.sort(angles, axis=1)[:, 3]
    assert beam_spacing_deg(unit) == pytest.approx(np.median(fourth))


def test_spacing_of_few_returns_is_undefined():
    assert np.isnan(beam_spacing_deg(np.empty((0, 3))))
    assert np.isnan(beam_spacing_deg(np.array([at(0, 5.0), at(1, 5.0)])))


def test_the_rule_of_a_scanner_scales_with_its_spacing():
    coarse, fine = rule_for_scanner(grid_scan(1.0, 1.0)), rule_for_scanner(grid_scan(0.1, 0.1))
    assert coarse.nearest_angle_deg == pytest.approx(0.8, rel=0.01)
    assert coarse.neighbour_angle_deg == pytest.approx(1.3, rel=0.01)
    assert (fine.nearest_angle_deg, fine.neighbour_angle_deg) == (0.15, 0.25)
    assert (coarse.min_range_m, coarse.max_range_m) == (1.5, 75.0)
    assert not coarse.label_silhouettes


@pytest.mark.parametrize(
    ("beam_ranges", "labelled", "unlabelled"),
    [
        ([20.0, 19.01], True, True),  # less than 1 m nearer
        ([20.0, 18.99], True, None),  # a silhouette
        ([20.0, 35.0], True, True),  # a beam beyond does not make one
        ([10.0, 10.0], False, False),
    ],
)
def test_silhouettes(beam_ranges, labelled, unlabelled):
    point, beams = at(0, 20.0), [at(0, r) for r in beam_ranges]
    assert label(point, beams, SILHOUETTES_VISIBLE) is labelled
    assert label(point, beams) is unlabelled


@pytest.mark.parametrize(
    ("beams", "expected"),
    [
        # Directions of returns around the point at (0, 0), degrees, and their ranges; the point is
        # 20 m away, so that all of them are nearer by more than 1.4 m.
        ([(-0.1, -0.1, 10.0), (0.1, -0.1, 10.0), (0.0, 0.1, 10.0)], False),
        ([(-0.1, -0.1, 10.0), (0.1, -0.1, 10.0), (0.0, -0.05, 10.0)], None),  # all below it
        ([(-0.1, 0.02, 10.0), (0.1, 0.02, 10.0), (0.0, 0.1, 10.0)], None),  # all above it
        ([(-0.1, -0.1, 10.0), (0.1, 0.1, 10.0)], None),  # on a line through it, but none beside
        ([(-0.1, -0.1, 10.0), (0.1, -0.1, 10.9), (0.0, 0.1, 10.0)], False),
        ([(-0.1, -0.1, 10.0), (0.1, -0.1, 11.1), (0.0, 0.1, 10.0)], None),  # two objects
        ([(-0.1, -0.1, 10.0), (0.1, -0.1, 10.0), (0.0, 0.1, 20.0)], None),  # one is not nearer
    ],
)
def test_occluding_returns_surround_the_point(beams, expected):
    scan = np.array([at(0.0, 20.0)])
    reference = np.array([at(azimuth, r, elevation) for azimuth, elevation, r in beams])
    rule = LabelRule(surrounded=True, label_silhouettes=False)
    labels = held_out_labels(scan, np.eye(4), reference, np.eye(4), rule)
    found = bool(labels.visible[0]) if len(labels.index) else None
    assert found is expected


def test_surrounding_does_not_hang_on_the_direction(rng):
    """Turned about any axis, the same returns give the same labels."""
    around = [(-0.1, -0.1, 10.0), (0.1, -0.1, 10.0), (0.0, 0.1, 10.0)]
    aside = [(-0.1, 0.02, 10.0), (0.1, 0.02, 10.0), (0.0, 0.1, 10.0)]
    for beams, count in ((around, 1), (aside, 0)):
        reference = np.array([at(azimuth, r, elevation) for azimuth, elevation, r in beams])
        for turn in Rotation.random(50, rng).as_matrix():
            scan = np.array([at(0.0, 20.0)]) @ turn.T
            labels = held_out_labels(
                scan, np.eye(4), reference @ turn.T, np.eye(4), LabelRule(surrounded=True)
            )
            assert len(labels.index) == count


def test_ground_beyond_the_last_beam_is_not_occluded():
    """The ground between two rows, and beyond the last row with returns, is visible."""
    height_m, rows_deg = 1.5, np.arange(2.0, 40.0, 1.4)
    azimuth = np.arange(-20.0, 20.0, 0.6)
    reference = np.array(
        [at(a, height_m / np.sin(np.radians(e)), -e) for e in rows_deg for a in azimuth]
    )
    ground = np.array([[x, 0.3, -height_m] for x in np.arange(5.0, 60.0, 0.1)])
    by_any = held_out_labels(
        ground, np.eye(4), reference, np.eye(4), rule_for_scanner(reference, surrounded=False)
    )
    by_surrounding = held_out_labels(
        ground, np.eye(4), reference, np.eye(4), rule_for_scanner(reference)
    )
    assert (~by_any.visible).sum() > 50
    assert len(by_surrounding.index) > 20
    assert by_surrounding.visible.all()
