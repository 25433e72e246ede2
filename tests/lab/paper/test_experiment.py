"""The experiment on one frame: what is run, counted and compared."""

from dataclasses import replace

import numpy as np
import pytest
from rough_ground import rough_ground

from intervis import Settings, analyze
from intervis.drives import Frame
from intervis.lab.paper import experiment
from intervis.lab.paper.differences import identity_residuals
from intervis.lab.paper.experiment import (
    TimedRuns,
    agreement,
    border_edges,
    run_frame,
    steps_of_frame,
    usable,
)
from intervis.method.analysis import StageTimes


@pytest.fixture
def short(monkeypatch):
    monkeypatch.setattr(experiment, "SWEEP", (10, 35))
    monkeypatch.setattr(experiment, "SWEEP_RUNS", 2)
    monkeypatch.setattr(experiment.printed_values, "TAUS", (10, 30))
    monkeypatch.setattr(experiment.printed_values, "RUNS", 2)


def test_the_sweep_reaches_from_every_return_to_the_coarsest_granularity_of_table_2():
    assert experiment.SWEEP[0] == 1
    assert experiment.SWEEP[-1] == experiment.printed_values.TAUS[-1] == 100
    assert set(experiment.printed_values.TAUS) <= set(experiment.SWEEP)


def frame(count=500):
    return Frame(0, rough_ground(9, count)[:, :3])


@pytest.mark.parametrize("with_global", [False, True])
def test_progress_is_called_as_often_as_announced(short, with_global):
    notes = []
    run_frame(frame(), with_global=with_global, progress=notes.append)
    assert len(notes) == steps_of_frame(with_global=with_global)
    assert len(set(notes)) == len(notes)


@pytest.mark.parametrize(("asked", "used"), [("auto", 35), (20, 20)])
def test_table_4_has_the_granularity_of_the_settings(short, asked, used):
    found = run_frame(frame(), Settings(tau=asked, view="circle"), with_global=False)
    assert found.settings.tau == found.proposed.settings.tau == used
    assert found.proposed.measures.n == -(-500 // used)
    assert found.finest.measures.n == 50
    assert {tau: point.measures.n for tau, point in found.sweep.items()} == {10: 50, 35: 15}
    assert {tau: len(runs.seconds) for tau, runs in found.timed.items()} == {10: 2, 30: 2}
    assert found.global_lines is None
    assert found.global_s is None


def test_a_sweep_point_counts_the_mesh(result):
    for tau, point in result.sweep.items():
        found = analyze(result.frame.points, settings=result.settings.with_changes(tau=tau))
        assert point.tau == tau
        assert point.intervisible == found.edge_intervisible.sum()
        assert point.measures == found.measures
        assert point.copies == 0
        assert point.hull == 2 * len(found.nodes) - 2 - len(found.triangles)


def test_nodes_at_one_chart_position_are_counted_as_copies():
    points = rough_ground(3, 200)[:, :3]
    doubled = np.vstack([points, points[:7]])
    found = analyze(doubled, settings=Settings(tau=1, view="circle"))
    point = experiment._sweep_point([found], 1)
    assert found.measures.n == 207
    assert point.copies == 207 - len(np.unique(found.chart, axis=0)) > 0
    assert identity_residuals(point) == (0, 0, 0)


def test_a_sweep_point_has_the_least_time_of_each_stage(result):
    first = replace(result.proposed, times=StageTimes(1.0, 5.0, 3.0, 7.0, 2.0, 9.0))
    second = replace(result.proposed, times=StageTimes(2.0, 4.0, 6.0, 1.0, 8.0, 3.0))
    point = experiment._sweep_point([first, second], 35)
    assert point.times == StageTimes(1.0, 4.0, 3.0, 1.0, 2.0, 3.0)


def test_the_time_of_the_paper_is_that_of_three_stages(result):
    times = StageTimes(fov=1.0, sampling=2.0, S1=4.0, S2=8.0, S3=16.0, total=32.0)
    assert experiment.paper_time(times) == 28.0
    runs = TimedRuns(35, ("fov", "S1", "S2", "S3"), np.array([[9.0, 1, 2, 3], [9.0, 2, 4, 6]]))
    assert runs.column("TIME").tolist() == [6.0, 12.0]
    assert runs.column("S2").tolist() == [2.0, 4.0]
    assert runs.std_s == pytest.approx(np.sqrt(18.0))
    assert runs.relative_std == pytest.approx(100 * np.sqrt(18.0) / 9)
    assert result.timed[30].column("S3").shape == (2,)


def test_the_border_of_a_mesh_is_its_convex_hull(rng):
    from scipy.spatial import ConvexHull, Delaunay

    points = rng.random((60, 2))
    border = border_edges(Delaunay(points).simplices.astype(np.int64))
    hull = np.sort(ConvexHull(points).simplices, axis=1)
    assert sorted(map(tuple, border.tolist())) == sorted(map(tuple, hull.tolist()))


def test_agreement_compares_the_nodes_that_both_methods_have(result):
    def method(nodes, intervisible):
        return replace(
            result.proposed, nodes=np.array(nodes), node_intervisible=np.array(intervisible)
        )

    reference = method([1, 2, 3, 4, 5, 9], [True, True, False, False, True, False])
    same = agreement(method([5, 3, 4, 7], [True, False, False, False]), reference)
    assert (same.nodes, same.share, same.correlation) == (3, 100.0, 1.0)
    opposite = agreement(method([1, 3], [False, True]), reference)
    assert (opposite.nodes, opposite.share, opposite.correlation) == (2, 0.0, -1.0)
    half = agreement(method([1, 2, 3, 4], [True, False, True, False]), reference)
    assert (half.nodes, half.share, half.correlation) == (4, 50.0, 0.0)
    none = agreement(method([6, 7], [True, True]), reference)
    assert none.nodes == 0
    assert np.isnan(none.share)
    assert np.isnan(none.correlation)


def test_agreement_with_itself_is_complete(result):
    same = agreement(result.interpolation, result.interpolation)
    assert same.share == 100.0
    assert same.correlation == pytest.approx(1.0)
    assert agreement(result.proposed, result.global_lines).nodes == result.proposed.measures.n


def test_without_a_camera_only_its_own_view_is_replaced():
    _, used, notes = usable(frame(), Settings())
    assert used.view == "front"
    assert "90 degrees ahead" in notes[0]
    _, used, notes = usable(frame(), Settings(view="circle"))
    assert used.view == "circle"
    assert notes == ["This source has no camera: Figure 3 (a) is left out."]


@pytest.mark.parametrize(("count", "noted"), [(99, True), (100, False)])
def test_few_returns_in_view_are_noted(short, count, noted):
    few = "Returns in view: 99 only. From granularity 50 on"
    notes = run_frame(frame(count), Settings(view="circle"), with_global=False).notes
    assert any(note.startswith(few) for note in notes) == noted
    assert len(notes) == 1 + noted
