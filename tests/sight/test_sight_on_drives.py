"""Real drives: what the engine says about scan i from pose j, judged by scan j."""

import numpy as np
import pytest
from scipy.stats import rankdata

from intervis.drives import open_drive
from intervis.lab.truth.held_out import held_out_labels
from intervis.sight import OCCLUDED, VISIBLE, Scene
from intervis.transform import transform

pytestmark = pytest.mark.realdata


def asked(drive, i, j, every=10):
    """Targets in the world's frame, viewpoint, and what scan j says about them."""
    one, other = drive[i], drive[j]
    said = held_out_labels(one.points, one.pose, other.points, other.pose)
    index, visible = said.index[::every], said.visible[::every]
    return transform(one.pose, one.points[index]), other.pose[:3, 3], visible


def mcc(truth, answer):
    return np.corrcoef(truth, answer)[0, 1]


def area(truth, probability):
    rank, ones = rankdata(probability), truth.sum()
    return (rank[truth].sum() - ones * (ones + 1) / 2) / (ones * (len(truth) - ones))


def test_one_scan_answers_better_than_chance_and_says_unknown(shared_data):
    drive = open_drive(shared_data / "pcd_drive")
    targets, viewpoint, truth = asked(drive, 0, 5)
    sight = Scene.from_scan(drive[0].points, drive[0].pose).sight(viewpoint, targets)
    assert mcc(truth, sight.probability >= 0.5) > 0.6
    assert truth[sight.state == VISIBLE].mean() > 0.93
    assert (~truth[sight.state == OCCLUDED]).mean() > 0.75
    assert 0.6 < (sight.state >= 0).mean() < 1.0


def test_a_memory_of_scans_answers_far_better(shared_data):
    drive = open_drive(shared_data / "pcd_drive")
    i, j = 5, 21
    targets, viewpoint, truth = asked(drive, i, j)
    scores = {}
    for name, numbers in {"single": [i], "map": list(drive.frame_numbers)}.items():
        scene = Scene()
        for number in numbers:
            away = np.linalg.norm(drive[number].pose[:3, 3] - viewpoint)
            if number != j and away >= 2.0:
                scene.add(drive[number].points, drive[number].pose)
        sight = scene.sight(viewpoint, targets)
        scores[name] = area(truth, sight.probability)
    assert scores["map"] > 0.95
    assert scores["map"] > scores["single"] + 0.1


def test_answers_on_real_scans_are_reciprocal(shared_data, rng):
    drive = open_drive(shared_data / "kitti_raw" / "2011_09_26")
    frame = drive[drive.frame_numbers[0]]
    scene = Scene.from_scan(frame.points)
    a, b = rng.normal(0, 15, (2, 2000, 3)) * [1, 1, 0.1]
    one, other = scene.sight_lines(a, b), scene.sight_lines(b, a)
    assert np.array_equal(one.probability, other.probability)
    assert np.array_equal(one.state, other.state)
