"""Regions on the ground grid and their overlap, against a point-in-polygon test and by hand."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.path import Path as Outline
from scipy.spatial import Delaunay

from intervis import Settings, analyze
from intervis.lab.paper.printed_values import GLOBAL_POINTS, INTERPOLATION_POINTS, PROPOSED
from intervis.lab.paper.temporal_consistency import (
    CELL_M,
    COVERED,
    EMPTY,
    IN_REGION,
    GroundRegion,
    Overlap,
    TemporalConsistency,
    follow_drive,
    ground_region,
    overlap,
    sample_std,
    temporal_consistency,
)
from intervis.method.comparison import global_points, interpolation_points
from small_drive import MemoryDrive


def pose(yaw_rad, x, y):
    c, s = np.cos(yaw_rad), np.sin(yaw_rad)
    return np.array([[c, -s, 0, x], [s, c, 0, y], [0, 0, 1, 0], [0, 0, 0, 1.0]])


@given(st.integers(0, 2**32 - 1), st.floats(-3.0, 3.0), st.floats(-20.0, 20.0))
@settings(max_examples=20, deadline=None)
def test_cells_are_those_whose_centre_lies_in_a_triangle(seed, yaw_rad, shift_m):
    rng = np.random.default_rng(seed)
    points = np.column_stack([rng.uniform(-8, 8, (12, 2)), rng.normal(size=12)])
    triangles = Delaunay(points[:, :2]).simplices.astype(np.int64)
    region = rng.random(len(triangles)) < 0.5
    world = pose(yaw_rad, shift_m, -shift_m)
    drawn = ground_region(points, triangles, region, world)
    ground = points[:, :2] @ world[:2, :2].T + world[:2, 3]
    column, row = np.indices(drawn.cells.shape)
    centres = (np.stack([column, row], axis=-1) + drawn.corner + 0.5).reshape(-1, 2) * CELL_M
    inside = np.zeros((2, len(centres)), bool)
    for triangle, chosen in zip(triangles, region, strict=True):
        held = Outline(ground[triangle]).contains_points(centres)
        inside[0] |= held
        inside[1] |= held & chosen
    np.testing.assert_array_equal(drawn.cells.ravel() > 0, inside[0])
    np.testing.assert_array_equal(drawn.cells.ravel() == IN_REGION, inside[1])


@pytest.mark.parametrize("along", [0, 1])
def test_a_triangle_without_area_covers_no_cell(along):
    points = np.full((4, 3), CELL_M / 2)
    points[:, along] = [0.0, 2.0, 5.0, 3.0]
    points[3, 1 - along] = 4.0
    flat, full = np.array([[0, 1, 2]]), np.array([[0, 1, 2], [0, 2, 3]])
    nothing = ground_region(points, flat, np.array([True]), np.eye(4))
    assert (nothing.cells == EMPTY).all()
    alone = ground_region(points, full[1:], np.array([True]), np.eye(4))
    both = ground_region(points, full, np.array([True, True]), np.eye(4))
    np.testing.assert_array_equal(both.cells, alone.cells)
    assert (alone.cells == IN_REGION).sum() > 20


def test_no_triangles_cover_no_ground():
    empty = ground_region(
        np.zeros((2, 3)), np.empty((0, 3), np.int64), np.empty(0, bool), np.eye(4)
    )
    assert empty.cells.tolist() == [[EMPTY]]
    assert np.isnan(overlap(empty, empty).iou)


def test_a_region_seen_from_another_pose_overlaps_itself():
    axis = np.linspace(0, 20, 21)
    points = np.array([[x, y, 0.0] for x in axis for y in axis])
    triangles = Delaunay(points[:, :2]).simplices.astype(np.int64)
    region = points[triangles][:, :, 0].mean(axis=1) < 10
    first = ground_region(points, triangles, region, pose(0.0, 0.0, 0.0))
    world = pose(0.3, 5.0, -2.0)
    moved = (points - [5.0, -2.0, 0]) @ world[:3, :3]  # the same ground seen from there
    second = ground_region(moved, triangles, region, world)
    same = overlap(first, second)
    assert same.iou > 0.98
    assert same.chance == pytest.approx(1 / 3, abs=0.02)  # two random halves
    assert same.common_m2 == pytest.approx(400.0, rel=0.03)


def test_overlap_counts_only_ground_that_both_meshes_cover():
    first = GroundRegion(np.array([0, 0]), np.full((4, 4), IN_REGION, np.int8))
    second = GroundRegion(np.array([2, 0]), np.full((4, 4), COVERED, np.int8))
    second.cells[:, :2] = IN_REGION
    shared = overlap(first, second)
    assert (shared.iou, shared.common_m2) == (0.5, 8 * CELL_M**2)
    assert shared.chance == 0.5  # all of the 8 cells are in the first region, half in the second
    second.cells[0, :] = EMPTY  # leaves one column of four cells that both cover
    for one, other in ((first, second), (second, first)):
        holed = overlap(one, other)
        assert (holed.iou, holed.common_m2) == (0.5, 4 * CELL_M**2)
    far = GroundRegion(np.array([90, 90]), first.cells)
    assert np.isnan(overlap(first, far).iou)


def test_measures_along_a_drive():
    region = GroundRegion(np.array([0, 0]), np.full((2, 2), IN_REGION, np.int8))
    found = temporal_consistency(
        "any", (4, 5, 6), [region] * 3, [(30.0, 80.0), (32.0, 82.0), (34.0, 84.0)]
    )
    assert len(found.overlaps) == 2
    assert found.iou == 1.0
    assert found.TPI.std(ddof=1) == 2.0
    assert found.nodes_intervisible.tolist() == [80.0, 82.0, 84.0]
    assert sample_std(found.TPI) == 2.0
    assert np.isnan(sample_std([1.0]))
    assert found.area_m2.tolist() == [1.0, 1.0, 1.0]


def test_the_methods_are_measured_on_the_same_frames():
    drive = MemoryDrive(with_camera=False, poses={k: pose(0.1 * k, 0.3 * k, 0.0) for k in range(3)})
    settings = Settings(tau=5, view="circle")
    notes = []
    both = follow_drive(drive, (0, 2), settings, with_global=False, progress=notes.append)
    assert len(notes) == 2
    results = {
        PROPOSED: lambda points: analyze(points, settings=settings),
        INTERPOLATION_POINTS: lambda points: interpolation_points(points, settings=settings),
        GLOBAL_POINTS: global_points,
    }
    assert [one.method for one in both] == [PROPOSED, INTERPOLATION_POINTS]
    for one in follow_drive(drive, (0, 2), settings):
        expected = [results[one.method](drive[k].points) for k in (0, 2)]
        assert one.numbers == (0, 2)
        assert one.TPI.tolist() == [found.measures.TPI for found in expected]
        share = [np.mean(found.node_intervisible) for found in expected]
        assert one.nodes_intervisible == pytest.approx(100 * np.array(share))
        regions = [
            ground_region(found.node_points, found.triangles, found.region, drive[k].pose)
            for k, found in zip((0, 2), expected, strict=True)
        ]
        assert one.overlaps == (overlap(*regions),)


def test_pairs_without_a_region_do_not_count():
    unknown = Overlap(np.nan, np.nan, 0.0)
    overlaps = (Overlap(0.6, 0.2, 1.0), unknown, Overlap(0.8, 0.4, 1.0))
    found = TemporalConsistency("any", (1, 2, 3, 4), overlaps, *3 * [np.zeros(4)])
    assert found.iou == pytest.approx(0.7)
    assert found.chance == pytest.approx(0.3)
    assert found.beyond_chance == pytest.approx(0.4 / 0.7)
    none = TemporalConsistency("any", (1, 2), (unknown,), *3 * [np.zeros(2)])
    assert np.isnan(none.iou)
    assert np.isnan(none.beyond_chance)
