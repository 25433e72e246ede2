"""Scores of the paper's graph in worlds whose labels are known without ray casting."""

from types import SimpleNamespace

import numpy as np
import pytest

from intervis.drives import Frame
from intervis.errors import DriveError
from intervis.lab.truth.paper_graph import (
    GraphScore,
    _averaged,
    _edges_free,
    graphs_by_exact_world,
    graphs_by_held_out_returns,
)
from intervis.lab.truth.tables import graph_table
from intervis.lab.worlds.ray_casting import RayCaster

WALL = np.array(
    [[[10.0, -6, -9], [10, 6, -9], [10, 6, 9]], [[10.0, -6, -9], [10, 6, 9], [10, -6, 9]]]
)


def facing(x_m, count, rng):
    """Returns on the plane at x, within 5 m to either side."""
    return np.column_stack(
        [np.full(count, x_m), rng.uniform(-5, 5, count), rng.uniform(-1, 1, count)]
    ).astype(np.float32)


def drive_of(scans, poses):
    """A stub with the attributes of a drive that the scores use."""

    class Stand(SimpleNamespace):
        def __getitem__(self, number):
            return Frame(number, scans[number], pose=poses.get(number))

    return Stand(name="made", poses=poses)


def at(x_m):
    pose = np.eye(4)
    pose[0, 3] = x_m
    return pose


def test_a_wall_occludes_every_node_behind_it(rng):
    # No scanner returns points behind a wall; hand-made ones show that rays decide the labels.
    drive = drive_of({0: facing(20.0, 300, rng), 1: facing(9.0, 300, rng)}, {0: at(0), 1: at(0)})
    behind, before = (
        graphs_by_exact_world(drive, lambda number: WALL, [n], later=(), taus=(5,))[0]
        for n in (0, 1)
    )
    assert (behind.viewpoint, behind.nodes, behind.nodes_visible) == ("sensor", 60, 0.0)
    assert (before.nodes, before.nodes_visible) == (60, 1.0)
    assert behind.edges_visible == before.edges_visible == 1.0  # neighbours on one side of it


def test_nodes_on_two_sides_of_a_wall_do_not_see_each_other(rng):
    scan = np.vstack([facing(9.0, 100, rng), facing(11.0, 100, rng)])
    score = graphs_by_exact_world(
        drive_of({0: scan}, {0: at(0)}), lambda number: WALL, [0], later=(), taus=(1,)
    )[0]
    assert 0 < score.edges_visible < 1
    assert score.nodes_visible == 0.5


@pytest.mark.parametrize(
    ("start_x", "stop_x", "expected"),
    [
        (9.9, 5.0, True),
        # ends behind the wall's surface at x = 10, within 0.15 m + 1 % of the start's range, or not
        (10.24, 5.0, True),
        (10.26, 5.0, False),
        (5.0, 10.19, True),
        (5.0, 10.21, False),
        # of a short edge no more than a third is ignored at each end
        (9.80, 10.25, False),
        (9.86, 10.25, False),
        (9.88, 10.25, True),
        (10.14, 9.75, False),
        (10.12, 9.75, True),
    ],
)
def test_edges_end_on_surfaces_within_range_noise(start_x, stop_x, expected):
    ends = np.array([[[start_x, 0, 0], [stop_x, 0, 0]]])
    assert _edges_free(ends, np.zeros(3), RayCaster(WALL)).tolist() == [expected]


def test_the_tolerance_of_edges_depends_on_the_range_from_the_viewpoint():
    ends = np.array([[[10.5, 0.0, 0], [5, 0, 0]]])
    near, far = np.zeros(3), np.array([10.5, 40.0, 0])
    assert _edges_free(ends, near, RayCaster(WALL)).tolist() == [False]
    assert _edges_free(ends, far, RayCaster(WALL)).tolist() == [True]  # 0.15 + 0.40 m


def test_an_edge_without_length_is_free():
    ends = np.full((1, 2, 3), 5.0)
    assert _edges_free(ends, np.zeros(3), RayCaster(WALL)).tolist() == [True]


def test_later_poses_are_viewpoints(rng):
    drive = drive_of({0: facing(9.0, 100, rng)}, {0: at(0), 5: at(4.0)})
    scores = graphs_by_exact_world(drive, lambda number: WALL, [0], later=(5, 7), taus=(5,))
    assert {s.viewpoint for s in scores} == {"sensor", "5 frames later"}


def test_held_out_returns_label_the_nodes(rng):
    """Scan 1 is taken from the same pose: it holds the wall again, and nothing behind it."""
    wall, behind = facing(10.0, 4000, rng), facing(20.0, 400, rng)
    drive = drive_of({0: np.vstack([wall, behind]), 1: wall}, {0: at(0), 1: at(0)})
    score = graphs_by_held_out_returns(drive, [(0, 1)], taus=(1,), criteria=("sight_line",))[0]
    assert 0.5 < score.nodes_visible < 1.0
    assert score.nodes_precision == 1.0  # nothing behind the wall is called intervisible
    assert score.nodes_mcc > 0
    assert np.isnan(score.edges_visible)


def test_poses_are_required(rng):
    drive = drive_of({0: facing(9.0, 10, rng), 1: facing(9.0, 10, rng)}, {})
    with pytest.raises(DriveError, match="need poses"):
        graphs_by_held_out_returns(drive, [(0, 1)])
    with pytest.raises(DriveError, match="needs a pose"):
        graphs_by_exact_world(drive, lambda number: WALL, [0])


def test_means_leave_nan_out():
    one = GraphScore("sensor", "elevation", 35, 10, 1.0, 0.5, 1.0, np.nan)
    two = GraphScore("sensor", "elevation", 35, 20, 0.8, 0.7, 0.9, 0.2, 5, 0.6, 0.5, 0.7)
    mean = _averaged([one, two])[0]
    assert (mean.nodes, mean.nodes_visible, mean.nodes_mcc) == (15, 0.9, 0.2)
    assert (mean.edges, mean.edges_precision) == (5, 0.7)


def test_nan_is_null_in_json_and_a_dash_in_the_table():
    score = GraphScore("pose j", "elevation", 35, 10, 0.7, 0.5, 0.8, np.nan)
    assert score.to_json()["nodes_precision"] == 0.8
    assert score.to_json()["nodes_mcc"] is score.to_json()["edges"] is None
    text = graph_table("held-out returns", [score]).as_text()
    assert "80.0%" in text
    assert "nan" not in text
