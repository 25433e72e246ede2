"""Readings of the paper against the method itself."""

import numpy as np
import pytest

from intervis import Settings, analyze
from intervis.drives import Frame
from intervis.reproduction import paper
from intervis.reproduction.readings import compare_readings, radius_nodes


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
            assert score.TPI[row, paper.TAUS.index(50)] == pytest.approx(measured)
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
