"""Whole evaluations of a yard: methods that know the truth, lie, or say nothing."""

import json

import numpy as np
import pytest
from yard import YARD, write_drive

from intervis import open_drive
from intervis.errors import DriveError, SettingsError
from intervis.lab.truth import evaluate as evaluating
from intervis.lab.truth.evaluate import evaluate_held_out, evaluate_world
from intervis.lab.truth.exact import Sampling
from intervis.lab.truth.methods import Answers, Method, theirs
from intervis.lab.truth.scoring import Evaluation, Row
from intervis.lab.worlds.ray_casting import RayCaster

FEW = Sampling(viewpoints=2, returns=300, free_points=300, anywhere=300)


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    folder = tmp_path_factory.mktemp("yard")
    write_drive(folder, YARD, np.arange(-12.0, 5.0, 1.0), step_deg=0.4)
    return open_drive(folder)


@pytest.fixture(scope="module")
def small_drive(tmp_path_factory):
    folder = tmp_path_factory.mktemp("small")
    write_drive(folder, YARD, np.arange(0.0, 5.0, 1.0))
    return open_drive(folder)


def method(name, say, state=None):
    def ask(seen, viewpoint, targets):
        probability = say(seen, viewpoint, targets)
        return Answers(probability, None if state is None else state(probability), 0.25, 0.5)

    return Method(name, "default", ask)


def knows(seen, viewpoint, targets):
    """Casts rays at the yard itself."""
    distance = np.linalg.norm(targets - viewpoint, axis=1)
    slack = 0.15 + 0.01 * distance
    return 1.0 - RayCaster(YARD).blocked(viewpoint, targets, slack_m=slack)


def test_who_knows_the_yard_scores_well_and_who_lies_badly(drive):
    evaluation = evaluate_held_out(
        drive,
        pairs=((0, 14), (8, 16), (16, 6)),
        methods=[method("knows", knows), method("lies", lambda *ask: 1 - knows(*ask))],
    )
    good, bad = (row.mean for row in evaluation.best_rows())
    assert good.mcc > 0.95
    assert good.auc > 0.97
    assert good.brier < 0.02
    assert bad.mcc == pytest.approx(-good.mcc)
    assert bad.brier == pytest.approx(1 - good.brier)
    assert evaluation.points == good.count > 1000
    assert evaluation.questions == ("0:14", "8:16", "16:6")


def test_in_the_exact_world_who_knows_is_always_right(drive):
    evaluation = evaluate_world(
        drive, lambda number: YARD, sampling=FEW, methods=[method("knows", knows)]
    )
    row = evaluation.row_of("knows")
    assert row.mean.mcc > 0.99
    kinds = ["returns", "free points", "anywhere"]
    assert list(row.parts) == [*kinds, "from scanned space", "answerable"]
    assert len(evaluation.questions) == 3 * 2
    counts = [row.mean_of(part).count for part in row.parts]
    assert sum(counts[:2]) == evaluation.points == row.mean.count
    assert 0 < counts[-1] < row.mean.count
    assert evaluation.truth == "exact world, rays by Embree"


def test_saying_unknown_is_scored_as_such(drive):
    silent = method("silent", lambda s, v, t: np.full(len(t), 0.5), lambda p: np.full(len(p), -1))
    evaluation = evaluate_held_out(drive, pairs=((0, 14),), methods=[silent])
    mean = evaluation.row_of("silent").mean
    assert mean.coverage == 0.0
    assert mean.mcc == 0.0
    assert np.isnan(mean.mcc_answered)
    said = json.loads(json.dumps(evaluation.to_json(), allow_nan=False))
    assert said["rows"][0]["mean"]["mcc_answered"] is None


@pytest.mark.parametrize(
    ("protocol", "seen_numbers"),
    [("single", (8,)), ("past", (0, 1, 2, 3, 4, 6, 7, 8)), ("map", (0, 1, 2, 3, *range(7, 17)))],
)
def test_methods_see_what_the_protocol_allows(drive, protocol, seen_numbers):
    met = []

    def note(seen, viewpoint, targets):
        met.append(seen.numbers)
        np.testing.assert_allclose(viewpoint, [-7.0, 0, 1.7])
        assert seen.asked == 8
        for scan, number in zip(seen.scans, seen.numbers, strict=True):
            assert len(scan) == len(drive[number].points)
        return np.ones(len(targets))

    evaluate_held_out(drive, pairs=((8, 5),), protocol=protocol, methods=[method("note", note)])
    assert met == [seen_numbers]


@pytest.mark.parametrize(
    ("protocol", "seen_numbers"), [("single", (2,)), ("past", (0, 1, 2)), ("map", (0, 1, 2, 3, 4))]
)
def test_a_world_hides_no_scan(small_drive, protocol, seen_numbers):
    met = []

    def note(seen, viewpoint, targets):
        met.append(seen.numbers)
        return np.ones(len(targets))

    evaluate_world(
        small_drive,
        lambda number: YARD,
        frames=[2],
        protocol=protocol,
        sampling=Sampling(1, 50, 50, 50),
        methods=[method("note", note)],
    )
    assert met == [seen_numbers]


def test_only_the_nearest_scans_are_given(drive, monkeypatch):
    monkeypatch.setattr(evaluating, "MOST_SCANS", 4)
    met = []

    def note(seen, viewpoint, targets):
        met.append(seen.numbers)
        return np.ones(len(targets))

    evaluate_held_out(drive, pairs=((0, 9),), protocol="map", methods=[method("note", note)])
    assert met == [(0, 6, 7, 11)]  # 7 and 11 at 2 m, then 6 and 12 at 3 m; scan 0 in any case


def test_the_best_setting_is_the_one_with_the_highest_mcc(drive):
    some = theirs(several_scans=False)[5:9]  # of one rival
    evaluation = evaluate_held_out(drive, pairs=((0, 14),), methods=some)
    (best,) = evaluation.best_rows()
    assert best.mean.mcc == max(row.mean.mcc for row in evaluation.rows)
    said = evaluation.to_json()
    assert [row["setting"] for row in said["rows"] if row["best_setting"]] == [best.setting]


def test_json_names_every_question_and_bin(drive):
    evaluation = evaluate_held_out(
        drive, pairs=((0, 14), (8, 16)), methods=[method("knows", knows)]
    )
    (row,) = json.loads(json.dumps(evaluation.to_json(), allow_nan=False))["rows"]
    assert set(row["questions"]) == {"0:14", "8:16"}
    assert len(row["mean"]["reliability"]["weight"]) == 10
    assert (row["prepare_s"], row["answer_s"]) == (0.25, 0.5)


def test_progress_is_told_after_every_answer(drive):
    notes = []
    evaluate_held_out(
        drive,
        pairs=((0, 14), (8, 16)),
        methods=[method("a", knows), method("b", knows)],
        progress=notes.append,
    )
    assert len(notes) == 4
    assert notes[0].startswith("0:14, a")


def test_a_row_without_a_score_is_never_the_best():
    rows = (Row("m", "none"), Row("m", "other"))
    assert Evaluation("s", "t", "single", (), 0, rows).best_rows()[0].setting == "none"


def test_wrong_requests_are_one_sentence(drive, small_drive, tmp_path):
    ask = {"methods": [method("knows", knows)]}
    with pytest.raises(SettingsError, match="single, past, map"):
        evaluate_held_out(drive, protocol="both", **ask)
    with pytest.raises(DriveError, match="no frame 99"):
        evaluate_held_out(drive, pairs=((0, 99),), **ask)
    with pytest.raises(DriveError, match="cannot judge itself"):
        evaluate_held_out(drive, pairs=((3, 3),), **ask)
    with pytest.raises(DriveError, match="no frame 99"):
        evaluate_world(drive, lambda number: YARD, frames=[99], **ask)
    write_drive(tmp_path, YARD, [0.0, 0.1])
    with pytest.raises(DriveError, match="moves too little"):
        evaluate_held_out(open_drive(tmp_path), **ask)
    (tmp_path / "poses.txt").unlink()
    with pytest.raises(DriveError, match=r"poses\.txt"):
        evaluate_held_out(open_drive(tmp_path), **ask)
    with pytest.raises(DriveError, match=r"poses\.txt"):
        evaluate_world(open_drive(tmp_path), lambda number: YARD, **ask)


def test_scans_that_see_nothing_in_common_cannot_judge(tmp_path):
    write_drive(tmp_path, YARD, [0.0, 0.1, 170.0])
    with pytest.raises(DriveError, match="scan 2 can judge no point of scan 0"):
        evaluate_held_out(open_drive(tmp_path), pairs=((0, 2),), methods=[method("knows", knows)])
