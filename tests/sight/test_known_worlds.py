"""Answers in worlds that are known by formula: the three states are what they claim to be."""

import numpy as np
import pytest
from made_scans import GROUND_M, clear, street_scan, turned

from intervis.sight import OCCLUDED, UNKNOWN, VISIBLE, Scene, explain

NOTHING = np.empty((0, 6))


def rows_of(targets, viewpoint, slack_m=0.2):
    """Whether sight lines, their last bit left out, are clear in the made street."""
    way = viewpoint - targets
    short = targets + way * np.minimum(slack_m / np.linalg.norm(way, axis=1), 1.0)[:, None]
    return clear(np.broadcast_to(viewpoint, short.shape), short)


@pytest.mark.parametrize("scans", [1, 6])
def test_answers_in_a_street_are_right(rng, scans):
    scene = Scene(sensor="HDL-64E")
    for number in range(scans):
        pose = turned(0.02 * number, 1.2 * number, 0.0)
        scene.add(street_scan(pose, seed=number), pose)
    scan = street_scan(seed=0)
    right, share = {VISIBLE: [], OCCLUDED: []}, []
    for _ in range(6):
        viewpoint = np.array([rng.uniform(-8, 12), rng.uniform(-2, 2), rng.uniform(-1, 0.8)])
        returns = scan[rng.integers(0, len(scan), 500)].astype(np.float64)
        free = scan[rng.integers(0, len(scan), 500)] * rng.uniform(0.1, 0.95, (500, 1))
        targets = np.vstack([returns, free])
        targets = targets[np.linalg.norm(targets - viewpoint, axis=1) > 1.0]
        truth = rows_of(targets, viewpoint)
        state = scene.sight(viewpoint, targets).state
        right[VISIBLE].append(truth[state == VISIBLE])
        right[OCCLUDED].append(~truth[state == OCCLUDED])
        share.append((state != UNKNOWN).mean())
    assert np.concatenate(right[VISIBLE]).mean() > 0.97
    assert np.concatenate(right[OCCLUDED]).mean() > 0.9
    assert np.concatenate(right[OCCLUDED]).size > 10
    # Of one scan, viewpoints above its highest beams see through space that no beam crossed.
    assert np.mean(share) > (0.5 if scans == 1 else 0.7)


def test_over_open_ground_nothing_is_occluded(rng):
    scene = Scene.from_scan(street_scan(boxes=NOTHING))
    angle, away = rng.uniform(0, 2 * np.pi, 500), rng.uniform(5, 30, 500)
    targets = np.stack([away * np.cos(angle), away * np.sin(angle), np.full(500, -0.9)], axis=1)
    sight = scene.sight([0.5, 0.0, 0.0], targets)
    assert (sight.state != OCCLUDED).all()
    assert (sight.state == VISIBLE).mean() > 0.9
    ground = targets.copy()
    ground[:, 2] = GROUND_M
    assert (scene.sight([0.5, 0.0, 0.0], ground).state == VISIBLE).mean() > 0.85


def test_below_the_ground_is_not_visible(rng):
    scene = Scene.from_scan(street_scan(boxes=NOTHING))
    targets = rng.uniform([-20, -20, -8], [20, 20, -4], (300, 3))
    assert (scene.sight([0.0, 0.0, 0.0], targets).state != VISIBLE).all()


def test_the_ground_blocks_what_comes_from_below(rng):
    """Straight and slanting lines up through the road, in front of the sensor and under it."""
    scene = Scene.from_scan(street_scan(boxes=NOTHING))
    below = rng.uniform([-20, -20, GROUND_M - 4], [20, 20, GROUND_M - 1.5], (300, 3))
    above = below + rng.uniform([-2, -2, 0], [2, 2, 0], (300, 3))
    above[:, 2] = rng.uniform(GROUND_M + 1.0, 0.5, 300)
    sight = scene.sight_lines(below, above, risk=0.2)
    assert (scene.sight_lines(below, above).state != VISIBLE).all()
    assert np.quantile(sight.probability, 0.9) < 0.3
    near = np.hypot(below[:, 0], below[:, 1]) > 8  # where beams saw the road
    # Steep lines may cross a far surface between two samples: improbable, but no surface is met.
    assert sight.occluded[near].mean() > 0.4
    assert (sight.probability[near] < 0.4).all()
    met = sight.occluded & near
    assert (sight.clearance[met] <= 0).all()
    assert sight.blocker[met, 2] == pytest.approx(GROUND_M, abs=0.6)


def test_behind_a_single_return_nothing_is_called_visible():
    scene = Scene.from_scan(np.array([[10.0, 0.0, 0.0]]))
    beside_and_behind = [[15.0, 0.0, 0.0], [30.0, 0.0, 0.0], [30.0, 8.0, 0.0], [0.0, 20.0, 0.0]]
    assert (scene.sight([0.0, 0.0, 0.0], beside_and_behind).state != VISIBLE).all()


def test_a_wall_blocks_at_its_face(rng):
    wall = np.array([[10.0, -8.0, GROUND_M, 10.4, 8.0, 1.5]])
    scene = Scene.from_scan(street_scan(boxes=wall))
    targets = np.stack(
        [np.full(200, 25.0), rng.uniform(-8, 8, 200), rng.uniform(-1.2, -0.5, 200)], axis=1
    )
    viewpoint = np.array([3.0, 1.0, -0.3])
    sight = scene.sight(viewpoint, targets)
    assert (sight.state == OCCLUDED).mean() > 0.97
    blocked = sight.state == OCCLUDED
    assert sight.blocker[blocked, 0] == pytest.approx(10.0, abs=0.15)
    before = targets.copy()
    before[:, 0] = 9.0
    assert (scene.sight(viewpoint, before).state == VISIBLE).mean() > 0.97


def test_a_low_wall_is_missed_by_what_the_height_says():
    wall = np.array([[10.0, -8.0, GROUND_M, 10.4, 8.0, -0.9]])
    scene = Scene.from_scan(street_scan(boxes=wall))
    viewpoint, target = np.array([6.0, 0.0, -1.3]), np.array([14.0, 0.0, -1.3])
    told = explain(scene, viewpoint, target)
    assert told.state == OCCLUDED
    assert told.blocker_m == pytest.approx(4.0, abs=0.2)
    # the line runs 0.4 m below the wall's top; the beam over the top rises a little on the way
    assert 0.2 < -told.clearance_m < 0.7
    assert str(told).startswith("Occluded: visible with a probability of")
    over = explain(scene, [6.0, 0.0, -0.35], [14.0, 0.0, -0.35])
    assert over.state == VISIBLE
    assert 0.4 < over.clearance_m < 1.5
    assert "clears" in over.text
    assert explain(scene, [6.0, 0.0, 0.0], [6.0, 0.0, 40.0]).state == UNKNOWN


@pytest.mark.slow
def test_a_million_targets_take_bounded_memory(rng):
    import tracemalloc

    scene = Scene.from_scan(street_scan())
    targets = rng.normal(0, 20, (1_000_000, 3)) * [1, 1, 0.1]
    scene.sight([0.0, 0, 0], targets[:10])
    tracemalloc.start()
    sight = scene.sight([1.0, 0, 0], targets)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert sight.state.shape == (1_000_000,)
    answers = sum(
        getattr(sight, n).nbytes for n in ("state", "probability", "blocker", "clearance")
    )
    assert peak < answers + 80e6
