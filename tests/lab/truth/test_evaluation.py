"""Evaluations in the yard: methods that cast rays at it, invert them, or answer unknown."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from yard import YARD, scan_of, write_drive

from intervis import open_drive
from intervis.errors import DriveError, SettingsError
from intervis.lab.truth.baselines import InputScans
from intervis.lab.truth.evaluation import (
    _seconds_since,
    evaluate_held_out,
    evaluate_world,
)
from intervis.lab.truth.exact_world import Sampling
from intervis.lab.truth.held_out import held_out_labels, rule_for_scanner
from intervis.lab.truth.labelled_targets import HeldOutSettings
from intervis.lab.truth.methods import Method, Predictions, baseline_methods
from intervis.lab.truth.query_set import QuerySet
from intervis.lab.truth.results import EvaluationResult, MethodResult
from intervis.lab.truth.scanner_set import Scanner, ScannerSet
from intervis.lab.truth.tables import viewpoint_table
from intervis.lab.truth.together import evaluate_together, together_query_sets
from intervis.lab.worlds.ray_casting import RayCaster
from intervis.transform import rigid, transform

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


def method(name, probability_of, state_of=None):
    def predict(inputs, viewpoint, targets):
        probability = probability_of(inputs, viewpoint, targets)
        return Predictions(
            probability, None if state_of is None else state_of(probability), 0.25, 0.5
        )

    return Method(name, "default", predict)


def ray_caster(inputs, viewpoint, targets):
    """Casts rays at the triangles of the yard."""
    distance = np.linalg.norm(targets - viewpoint, axis=1)
    slack = 0.15 + 0.01 * distance
    return 1.0 - RayCaster(YARD).blocked(viewpoint, targets, slack_m=slack)


def test_a_ray_caster_scores_well_and_its_inverse_badly(drive):
    evaluation = evaluate_held_out(
        drive,
        pairs=((0, 14), (8, 16), (16, 6)),
        methods=[
            method("ray caster", ray_caster),
            method("inverted", lambda *query: 1 - ray_caster(*query)),
        ],
    )
    good, bad = (row.mean for row in evaluation.best_settings())
    assert good.mcc > 0.95
    assert good.auc > 0.97
    assert good.brier < 0.02
    assert bad.mcc == pytest.approx(-good.mcc)
    assert bad.brier == pytest.approx(1 - good.brier)
    assert evaluation.target_count == good.count > 1000
    assert evaluation.query_sets == ("0:14", "8:16", "16:6")


def test_a_ray_caster_is_right_in_the_exact_world(drive):
    evaluation = evaluate_world(
        drive, lambda number: YARD, sampling=FEW, methods=[method("ray caster", ray_caster)]
    )
    row = evaluation.result_of("ray caster")
    assert row.mean.mcc > 0.99
    kinds = ["returns", "free points", "anywhere"]
    assert list(row.subsets) == [*kinds, "from scanned space", "answerable"]
    assert len(evaluation.query_sets) == 3 * 2
    counts = [row.mean_of(part).count for part in row.subsets]
    assert sum(counts[:2]) == evaluation.target_count == row.mean.count
    assert 0 < counts[-1] < row.mean.count
    assert evaluation.ground_truth == "exact world, rays by Embree"


def test_unknown_states_have_no_coverage(drive):
    silent = method("unknown", lambda s, v, t: np.full(len(t), 0.5), lambda p: np.full(len(p), -1))
    evaluation = evaluate_held_out(drive, pairs=((0, 14),), methods=[silent])
    mean = evaluation.result_of("unknown").mean
    assert mean.coverage == 0.0
    assert mean.mcc == 0.0
    assert np.isnan(mean.mcc_answered)
    content = json.loads(json.dumps(evaluation.to_json(), allow_nan=False))
    assert content["results"][0]["mean"]["mcc_answered"] is None


@pytest.mark.parametrize(
    ("protocol", "input_numbers"),
    [("single", (8,)), ("past", (0, 1, 2, 3, 4, 6, 7, 8)), ("map", (0, 1, 2, 3, *range(7, 17)))],
)
def test_methods_get_the_scans_of_the_protocol(drive, protocol, input_numbers):
    given = []

    def record(inputs, viewpoint, targets):
        given.append(inputs.numbers)
        np.testing.assert_allclose(viewpoint, [-7.0, 0, 1.7])
        assert inputs.target_number == 8
        for scan, number in zip(inputs.scans, inputs.numbers, strict=True):
            assert len(scan) == len(drive[number].points)
        return np.ones(len(targets))

    evaluate_held_out(drive, pairs=((8, 5),), protocol=protocol, methods=[method("record", record)])
    assert given == [input_numbers]


@pytest.mark.parametrize(
    ("protocol", "input_numbers"), [("single", (2,)), ("past", (0, 1, 2)), ("map", (0, 1, 2, 3, 4))]
)
def test_exact_worlds_hide_no_scan(small_drive, protocol, input_numbers):
    given = []

    def record(inputs, viewpoint, targets):
        given.append(inputs.numbers)
        return np.ones(len(targets))

    evaluate_world(
        small_drive,
        lambda number: YARD,
        frames=[2],
        protocol=protocol,
        sampling=Sampling(1, 50, 50, 50),
        methods=[method("record", record)],
    )
    assert given == [input_numbers]


def test_only_the_nearest_scans_are_given(drive, monkeypatch):
    monkeypatch.setattr("intervis.lab.truth.evaluation.MAX_SCANS", 4)
    given = []

    def record(inputs, viewpoint, targets):
        given.append(inputs.numbers)
        return np.ones(len(targets))

    evaluate_held_out(drive, pairs=((0, 9),), protocol="map", methods=[method("record", record)])
    assert given == [(0, 6, 7, 11)]  # 7 and 11 at 2 m, then 6 and 12 at 3 m; scan 0 in any case


def test_times_of_the_inputs_are_seconds_after_the_reference():
    timestamps_ns = {3: 7_000_000_000, 4: 7_500_000_000, 5: 9_000_000_000}
    assert _seconds_since(timestamps_ns, (3, 5), 4) == (-0.5, 1.5)
    assert _seconds_since(timestamps_ns, (3, 6), 4) is None
    assert _seconds_since(timestamps_ns, (3, 5), 6) is None


def test_times_follow_from_the_rate(drive):
    given = []

    def record(inputs, viewpoint, targets):
        given.append(inputs.timestamps_s)
        return np.ones(len(targets))

    for rate_hz in (None, 4.0):
        settings = HeldOutSettings(rate_hz=rate_hz)
        evaluate_held_out(
            drive, pairs=((8, 12),), methods=[method("record", record)], settings=settings
        )
    assert given == [None, (-1.0,)]
    for rate_hz in (0.0, -10.0, np.inf, np.nan):
        with pytest.raises(SettingsError, match="rate"):
            HeldOutSettings(rate_hz=rate_hz)


def test_random_points_in_space(drive):
    methods = [method("ray caster", ray_caster_in_space)]
    settings = HeldOutSettings(targets="space")
    evaluation = evaluate_held_out(drive, pairs=((0, 14),), methods=methods, settings=settings)
    assert evaluation.ground_truth == "held-out returns, random points in space"
    assert evaluation.results[0].mean.mcc > 0.98
    assert evaluation.target_count > 1000
    together = evaluate_together(two_scanners(), methods=methods, targets="space")
    assert together.ground_truth.endswith(", random points in space")
    assert [scores.mcc > 0.98 for scores in together.results[0].scores] == [True, True]
    with pytest.raises(SettingsError, match="returns, space"):
        HeldOutSettings(targets="anywhere")
    with pytest.raises(SettingsError, match="returns, space"):
        evaluate_together(two_scanners(), methods=methods, targets="anywhere")


def ray_caster_in_space(inputs, viewpoint, targets):
    return 1.0 - RayCaster(YARD).blocked(viewpoint, targets)


def test_near_returns_are_kept_for_the_methods(drive):
    given = []

    def record(inputs, viewpoint, targets):
        given.append(inputs.scans[0])
        distance = np.linalg.norm(targets - viewpoint, axis=1)
        assert distance.min() >= 2.7
        return np.ones(len(targets))

    evaluate_held_out(drive, pairs=((16, 12),), methods=[method("record", record)])
    np.testing.assert_array_equal(given[0], drive[16].points)


def test_the_best_setting_is_the_one_with_the_highest_mcc(drive):
    some = baseline_methods(several_scans=False)[5:9]  # of one baseline
    evaluation = evaluate_held_out(drive, pairs=((0, 14),), methods=some)
    (best,) = evaluation.best_settings()
    assert best.mean.mcc == max(row.mean.mcc for row in evaluation.results)
    content = evaluation.to_json()
    assert [row["setting"] for row in content["results"] if row["best_setting"]] == [best.setting]


def test_json_holds_every_query_set_and_bin(drive):
    evaluation = evaluate_held_out(
        drive, pairs=((0, 14), (8, 16)), methods=[method("ray caster", ray_caster)]
    )
    (row,) = json.loads(json.dumps(evaluation.to_json(), allow_nan=False))["results"]
    assert set(row["query_sets"]) == {"0:14", "8:16"}
    assert len(row["mean"]["reliability"]["weight"]) == 10
    assert (row["prepare_s"], row["answer_s"]) == (0.25, 0.5)


def test_progress_is_reported_after_every_answer(drive):
    notes = []
    evaluate_held_out(
        drive,
        pairs=((0, 14), (8, 16)),
        methods=[method("a", ray_caster), method("b", ray_caster)],
        progress=notes.append,
    )
    assert len(notes) == 4
    assert notes[0].startswith("0:14, a")


@pytest.mark.parametrize("order", [("undefined", "inverted"), ("inverted", "undefined")])
def test_a_setting_without_an_mcc_is_never_the_best(order):
    visible = {"undefined": [True, True], "inverted": [True, False]}
    results = []
    for setting in order:
        inputs = InputScans((), (), (), 0, 1)
        labels = np.array(visible[setting])
        query_set = QuerySet("0:1", inputs, np.zeros(3), np.ones((2, 3)), labels)
        result = MethodResult("method", setting)
        result.add(query_set, Predictions(np.array([0.0, 1.0]), None, 0.0, 0.0))
        results.append(result)
    evaluation = EvaluationResult("drive", "truth", "single", ("0:1",), 2, tuple(results))
    (best,) = evaluation.best_settings()
    assert (best.setting, best.mean.mcc) == ("inverted", -1.0)


def test_times_are_medians():
    result = MethodResult("method", "default", seconds=[(1.0, 10.0), (5.0, 40.0), (2.0, 20.0)])
    assert (result.prepare_s, result.answer_s) == (2.0, 20.0)
    result.seconds.append((4.0, 30.0))
    assert (result.prepare_s, result.answer_s) == (3.0, 25.0)
    assert np.isnan(MethodResult("method", "default").prepare_s)


def test_wrong_requests_are_refused(drive, small_drive, tmp_path):
    options = {"methods": [method("ray caster", ray_caster)]}
    with pytest.raises(SettingsError, match="single, past, map"):
        evaluate_held_out(drive, protocol="both", **options)
    with pytest.raises(DriveError, match="no frame 99"):
        evaluate_held_out(drive, pairs=((0, 99),), **options)
    with pytest.raises(DriveError, match="cannot be its own reference"):
        evaluate_held_out(drive, pairs=((3, 3),), **options)
    with pytest.raises(DriveError, match="no frame 99"):
        evaluate_world(drive, lambda number: YARD, frames=[99], **options)
    write_drive(tmp_path, YARD, [0.0, 0.1])
    with pytest.raises(DriveError, match="moves too little"):
        evaluate_held_out(open_drive(tmp_path), **options)
    (tmp_path / "poses.txt").unlink()
    with pytest.raises(DriveError, match=r"poses\.txt"):
        evaluate_held_out(open_drive(tmp_path), **options)
    with pytest.raises(DriveError, match=r"poses\.txt"):
        evaluate_world(open_drive(tmp_path), lambda number: YARD, **options)


def test_scans_without_common_space_give_no_labels(tmp_path):
    write_drive(tmp_path, YARD, [0.0, 0.1, 170.0])
    with pytest.raises(DriveError, match="scan 2 gives no label for any point of scan 0"):
        evaluate_held_out(
            open_drive(tmp_path), pairs=((0, 2),), methods=[method("ray caster", ray_caster)]
        )


def two_scanners(pairs=(("upright", "tilted"), ("tilted", "upright"))):
    """Two scanners 8 m apart in the yard, one tilted by 45 degrees and turned."""
    tilt = Rotation.from_euler("xyz", [5.0, 45.0, 80.0], degrees=True).as_matrix()
    poses = {"upright": rigid(np.eye(3), [0, 0, 1.7]), "tilted": rigid(tilt, [3.0, 7.5, 1.2])}
    return ScannerSet(
        "two",
        tuple(
            Scanner(name, scan_of(YARD, pose, noise_m=0.01, step_deg=0.5).astype(np.float32), pose)
            for name, pose in poses.items()
        ),
        pairs,
    )


def test_two_scanners_of_one_moment():
    evaluation = evaluate_together(
        two_scanners(),
        methods=[
            method("ray caster", ray_caster),
            method("inverted", lambda *query: 1 - ray_caster(*query)),
        ],
    )
    good, bad = evaluation.results
    assert evaluation.query_sets == ("upright:tilted", "tilted:upright")
    assert evaluation.protocol == "together"
    assert evaluation.target_count > 2000
    assert [scores.mcc > 0.95 for scores in good.scores] == [True, True]
    assert bad.mean.mcc == pytest.approx(-good.mean.mcc)


def test_the_known_scanner_may_be_the_frame_of_the_queries():
    scanners = two_scanners((("tilted", "upright"),))
    scene_from_scanner = scanners.scanner("tilted").pose
    (in_scene,) = together_query_sets(scanners, "scene")
    (in_scanner,) = together_query_sets(scanners, "scanner")
    np.testing.assert_array_equal(in_scene.inputs.poses[0], scene_from_scanner)
    np.testing.assert_array_equal(in_scanner.inputs.poses[0], np.eye(4))
    np.testing.assert_allclose(in_scene.viewpoint, [0, 0, 1.7], atol=1e-9)
    for name in ("viewpoint", "targets"):
        moved = transform(scene_from_scanner, getattr(in_scanner, name))
        np.testing.assert_allclose(moved, getattr(in_scene, name), atol=1e-9)
    np.testing.assert_array_equal(in_scene.visible, in_scanner.visible)
    assert in_scene.inputs.scans[0] is scanners.scanner("tilted").points


def test_labels_follow_the_spacing_of_the_reference_scanner():
    scanners = two_scanners((("upright", "tilted"),))
    upright, tilted = scanners.scanners
    coarse = replace(tilted, points=tilted.points[::4])
    (query_set,) = together_query_sets(replace(scanners, scanners=(upright, coarse)))
    rule = rule_for_scanner(coarse.points)
    assert rule.nearest_angle_deg > 1.2 * rule_for_scanner(upright.points).nearest_angle_deg
    labels = held_out_labels(upright.points, upright.pose, coarse.points, coarse.pose, rule)
    assert len(query_set.visible) == len(labels.index) > 500
    np.testing.assert_array_equal(query_set.visible, labels.visible)


def test_wrong_requests_of_scanners():
    with pytest.raises(SettingsError, match="scene, scanner"):
        evaluate_together(two_scanners(), frame="world", methods=[method("x", ray_caster)])
    scanners = two_scanners((("upright", "tilted"),))
    far = replace(scanners.scanner("tilted"), points=np.full((9, 3), 1e3, np.float32))
    blind = replace(scanners, scanners=(scanners.scanner("upright"), far))
    with pytest.raises(DriveError, match="check the poses"):
        evaluate_together(blind, methods=[method("x", ray_caster)])


def test_the_best_setting_of_one_query_set():
    results = [MethodResult("engine", "default")]
    for setting, scored in (("default", [0.9, 0.9]), ("a", [0.9, 0.1]), ("b", [0.1, 0.8])):
        result = results[0] if setting == "default" else MethodResult("method", setting)
        for number, probability in enumerate(scored):
            labels = np.array([True, False])
            inputs = InputScans((), (), (), 0, 1)
            query_set = QuerySet(f"{number}", inputs, np.zeros(3), np.ones((2, 3)), labels)
            answer = np.array([probability, 0.2])
            result.add(query_set, Predictions(answer, None, 0.0, 0.0))
        results += [] if result is results[0] else [result]
    evaluation = EvaluationResult("drive", "truth", "single", ("0", "1"), 4, tuple(results))
    assert [result.setting for result in evaluation.best_settings("0")] == ["default", "a"]
    assert [result.setting for result in evaluation.best_settings("1")] == ["default", "b"]
    shown = [row[0] for row in viewpoint_table(evaluation, every_method=True).rows]
    assert shown == ["0", "0, method (a)", "1", "1, method (b)"]
    assert [row[0] for row in viewpoint_table(evaluation).rows] == ["0", "1"]
