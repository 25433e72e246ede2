"""Readings of the paper against the method itself."""

import csv
import io

import numpy as np
import pytest

from intervis import Settings, analyze, open_drive
from intervis.drives import Frame
from intervis.lab.paper import printed_values
from intervis.lab.paper.curve import tpi_curve
from intervis.lab.paper.interpretations import (
    chosen_reading,
    compare_readings,
    consecutive_frames,
    radius_nodes,
    spread_frames,
)
from intervis.lab.paper.report import write_readings
from intervis.lab.paper.tables import choices_table


def frame(seed, number=0):
    rng = np.random.default_rng(seed)
    points = np.column_stack(
        [rng.uniform(5, 50, 3000), rng.uniform(-20, 20, 3000), rng.normal(-1.7, 0.2, 3000)]
    )
    pose = np.eye(4)
    pose[0, 3] = 0.5 * number
    return Frame(number=number, points=points.astype(np.float32), pose=pose)


def test_a_reading_scores_what_the_method_measures():
    frames = [frame(1), frame(2)]
    scores = compare_readings(
        frames,
        [frame(3, 0), frame(3, 1)],
        metrics=["ground"],
        charts=["polar"],
        samplings=["kernel"],
    )
    assert [score.away for score in scores] == sorted(score.away for score in scores)
    assert len({score.reading for score in scores}) == len(scores)
    for score in scores:
        if score.reading.criterion == "not judged":
            continue
        for row, one in enumerate(frames):
            settings = Settings(tau=50, view="front", **score.reading._asdict())
            measured = analyze(one.points, settings=settings).measures.TPI
            assert score.TPI[row, printed_values.TAUS.index(50)] == pytest.approx(measured)
        assert score.TPI_std >= 0
        assert np.isnan(score.iou) or 0 <= score.iou <= 1


def test_the_gate_alone_is_never_less_than_the_gate_with_judgement():
    scores = {
        score.reading: score
        for score in compare_readings(
            [frame(5)], metrics=["ground"], charts=["ground"], samplings=["stride"]
        )
    }
    for reading, score in scores.items():
        alone = scores[reading._replace(criterion="not judged", concave_boundary="every")]
        assert (score.TPI <= alone.TPI + 1e-9).all()


def test_a_radius_is_found_that_gives_as_many_nodes_as_a_granularity():
    points = frame(7).points.astype(np.float64)
    for tau in (10, 40, 100):
        found = len(radius_nodes(points, tau, np.zeros(3)))
        assert found == pytest.approx(3000 / tau, rel=0.15)


def test_tables_of_readings_change_one_choice_at_a_time(tmp_path):
    scores = compare_readings(
        [frame(5)], metrics=["ground", "euclidean"], charts=["ground"], samplings=["kernel"]
    )
    reading = chosen_reading(Settings())
    table = choices_table(scores, reading)
    assert table.rows[0][1] == ", ".join(reading)
    assert ("metric", "euclidean") in {row[:2] for row in table.rows}
    for choice, name, *_ in table.rows[1:]:
        assert getattr(reading, choice) != name
    paths = write_readings(scores, tpi_curve([frame(5)]), reading, ["made"], tmp_path)
    rows = list(csv.DictReader(io.StringIO(paths[1].read_text())))
    assert len(rows) == len(scores)
    assert float(rows[0]["away"]) <= float(rows[-1]["away"])
    assert "# Readings" in paths[0].read_text()


def test_frames_are_spread_from_the_first_to_the_last(tmp_path):
    for number in range(9):
        np.column_stack([frame(number).points, np.ones(3000, np.float32)]).tofile(
            tmp_path / f"{number:06d}.bin"
        )
    drive = open_drive(tmp_path)
    assert [one.number for one in spread_frames(drive, 3)] == [0, 4, 8]
    assert len(spread_frames(drive, 40)) == 9
    assert consecutive_frames([drive]) == []
