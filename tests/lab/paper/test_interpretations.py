"""Interpretations of the paper against the method itself."""

import csv
import io

import numpy as np
import pytest

from intervis import Settings, analyze, open_drive
from intervis.drives import Frame
from intervis.lab.paper import printed_values
from intervis.lab.paper.curve import tpi_curve
from intervis.lab.paper.interpretation_tables import choices_table
from intervis.lab.paper.interpretations import (
    GATE_ONLY,
    InterpretationScore,
    compare_interpretations,
    consecutive_frames,
    count_geometries,
    interpretation_of,
    radius_nodes,
    spread_frames,
)
from intervis.lab.paper.report import write_interpretations


def frame(seed, number=0):
    rng = np.random.default_rng(seed)
    points = np.column_stack(
        [rng.uniform(5, 50, 3000), rng.uniform(-20, 20, 3000), rng.normal(-1.7, 0.2, 3000)]
    )
    pose = np.eye(4)
    pose[0, 3] = 0.5 * number
    return Frame(number=number, points=points.astype(np.float32), pose=pose)


def test_an_interpretation_scores_what_the_method_measures():
    frames = [frame(1), frame(2)]
    scores = compare_interpretations(
        frames,
        [frame(3, 0), frame(3, 1)],
        metrics=["ground"],
        charts=["polar"],
        samplings=["kernel", "stride"],
    )
    assert [score.difference for score in scores] == sorted(score.difference for score in scores)
    assert len({score.interpretation for score in scores}) == len(scores)
    for score in scores:
        if score.interpretation.criterion == GATE_ONLY:
            continue
        for row, one in enumerate(frames):
            settings = Settings(tau=50, view="front", **score.interpretation._asdict())
            measured = analyze(one.points, settings=settings).measures.TPI
            assert score.TPI[row, printed_values.TAUS.index(50)] == pytest.approx(measured)
        assert score.TPI_std >= 0
        assert np.isnan(score.iou) or 0 <= score.iou <= 1


def test_differences_to_table_2_are_those_of_frames_and_of_their_mean():
    table = np.array([row.TPI for row in printed_values.TABLE_2.values()])
    offset = np.zeros(10)
    offset[0] = -7.0
    frames = np.stack([table + 3.0, table - 1.0 + offset])
    score = InterpretationScore(interpretation_of(Settings()), frames, 0.0, 0.0)
    assert score.difference == pytest.approx((10 * 3.0 + 9 * 1.0 + 8.0) / 20)
    assert score.difference_of_mean == pytest.approx((9 * 1.0 + 2.5) / 10)
    assert score.greatest_of_mean == pytest.approx(2.5)


def test_progress_of_a_comparison_is_called_once_for_each_geometry():
    notes = []
    compare_interpretations(
        [frame(1)],
        metrics=["ground"],
        charts=["ground", "polar"],
        samplings=["stride"],
        progress=notes.append,
    )
    assert notes == ["stride, ground, ground", "stride, ground, polar"]
    assert count_geometries() == 36


def test_the_gate_alone_passes_at_least_what_the_whole_algorithm_passes():
    scores = {
        score.interpretation: score
        for score in compare_interpretations(
            [frame(5)], metrics=["ground"], charts=["ground"], samplings=["stride"]
        )
    }
    for one, score in scores.items():
        alone = scores[one._replace(criterion=GATE_ONLY, concave_boundary="every")]
        assert (score.TPI <= alone.TPI + 1e-9).all()


def test_a_radius_is_found_that_gives_as_many_nodes_as_a_granularity():
    points = frame(7).points.astype(np.float64)
    for tau in (10, 40, 100):
        found = len(radius_nodes(points, tau, np.zeros(3)))
        assert found == pytest.approx(3000 / tau, rel=0.15)


def test_tables_of_interpretations_change_one_choice_at_a_time(tmp_path):
    scores = compare_interpretations(
        [frame(5)], metrics=["ground", "euclidean"], charts=["ground"], samplings=["kernel"]
    )
    default = interpretation_of(Settings())
    table = choices_table(scores, default)
    assert table.rows[0][1] == ", ".join(default)
    assert ("metric", "euclidean") in {row[:2] for row in table.rows}
    for choice, name, *_ in table.rows[1:]:
        assert getattr(default, choice) != name
    paths = write_interpretations(scores, tpi_curve([frame(5)]), default, ["made"], tmp_path)
    rows = list(csv.DictReader(io.StringIO(paths[1].read_text())))
    assert len(rows) == len(scores)
    assert float(rows[0]["difference"]) <= float(rows[-1]["difference"])
    assert "# Interpretations" in paths[0].read_text()


def test_frames_are_spread_from_the_first_to_the_last(tmp_path):
    for number in range(9):
        np.column_stack([frame(number).points, np.ones(3000, np.float32)]).tofile(
            tmp_path / f"{number:06d}.bin"
        )
    drive = open_drive(tmp_path)
    assert [one.number for one in spread_frames(drive, 3)] == [0, 4, 8]
    assert len(spread_frames(drive, 40)) == 9
    assert consecutive_frames([drive]) == []
    posed = tmp_path / "posed"
    posed.mkdir()
    for number in range(2):
        (tmp_path / f"{number:06d}.bin").rename(posed / f"{number:06d}.bin")
    (posed / "poses.txt").write_text(2 * "1 0 0 0 0 1 0 0 0 0 1 0\n")
    drives = [drive, open_drive(posed)]
    assert [one.number for one in consecutive_frames(drives, 1)] == [0]
    assert [one.number for one in consecutive_frames(drives)] == [0, 1]
