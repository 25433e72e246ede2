"""A stream: any thread pushes, any thread asks, every answer is that of a state it had."""

import pickle
import sys
import threading
from pathlib import Path
from types import SimpleNamespace as Message

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent / "sight"))
from made_scans import BOXES, GROUND_M, street_scan

import intervis
from intervis import Scene, Stream
from intervis.errors import PointsError, PoseError, ScanError, SceneError

COARSE = {"beams": 32, "step_deg": 0.8}
CAR = np.array([[4.0, -3.0, GROUND_M, 6.0, -1.2, 0.4]])
SCANS = [
    street_scan(boxes=np.vstack([BOXES, CAR]) if n % 3 == 0 else BOXES, seed=n, **COARSE)
    for n in range(12)
]
EYE = np.array([2.0, -2.1, -0.6])
TARGETS = np.random.default_rng(5).uniform([-5, -5, -1.5], [15, 5, 1.0], (300, 3))


def poses():
    """Poses 0.4 m apart, so that scans are evicted by distance and age."""
    for nth in range(len(SCANS)):
        pose = np.eye(4)
        pose[0, 3] = 0.4 * nth
        yield pose


def answers_of_states(max_scans):
    """The probabilities of all targets after each scan, one thread alone."""
    scene, states = Scene(max_scans=max_scans), []
    for nth, (scan, pose) in enumerate(zip(SCANS, poses(), strict=True)):
        scene.add(scan, pose, 0.1 * nth)
        states.append(scene.sight(EYE, TARGETS, moment_s=0.1 * nth).probability)
    return states


@pytest.mark.parametrize("max_scans", [1, 3, 64])
def test_each_answer_of_eight_readers_is_that_of_a_state_the_stream_had(max_scans):
    states = answers_of_states(max_scans)
    stream = Stream(max_scans=max_scans)
    stream.push(SCANS[0], np.eye(4), 0.0)
    done = threading.Event()
    found, wrong = [], []

    def read():
        while True:
            last = done.is_set()  # one more question after the last push
            probability = stream.sight(EYE, TARGETS).probability
            known = [n for n, state in enumerate(states) if np.array_equal(probability, state)]
            (found if known else wrong).append(known[:1] or probability)
            if last:
                return

    readers = [threading.Thread(target=read) for _ in range(8)]
    for reader in readers:
        reader.start()
    for nth, (scan, pose) in enumerate(zip(SCANS, poses(), strict=True)):
        if nth:
            stream.push(scan, pose, 0.1 * nth)
    done.set()
    for reader in readers:
        reader.join()
    assert not wrong
    assert [len(SCANS) - 1] in found
    assert len(stream) == min(max_scans, len(SCANS))


def test_a_snapshot_stays_and_is_a_scene_of_its_own():
    states = answers_of_states(3)
    stream, snapshots = Stream(max_scans=3), []
    for nth, (scan, pose) in enumerate(zip(SCANS, poses(), strict=True)):
        stream.push(scan, pose, 0.1 * nth)
        snapshots.append(stream.snapshot())

    def answer(nth):
        return snapshots[nth].sight(EYE, TARGETS, moment_s=0.1 * nth).probability

    for nth, state in enumerate(states):
        assert np.array_equal(answer(nth), state)
    for nth in range(5, len(SCANS) - 1):
        other = snapshots[nth].snapshot()
        time_s = 0.1 * (nth + 1)
        other.add(SCANS[nth + 1], list(poses())[nth + 1], time_s)
        answered = other.sight(EYE, TARGETS, moment_s=time_s).probability
        assert np.array_equal(answered, states[nth + 1])
    for nth, state in enumerate(states):
        assert np.array_equal(answer(nth), state)
    assert np.array_equal(stream.sight(EYE, TARGETS).probability, states[-1])


def test_adding_to_a_snapshot_leaves_its_scene_alone():
    scene = Scene(max_scans=3)
    for nth in range(5):
        scene.add(SCANS[nth], None, 0.1 * nth)
    before = scene.sight(EYE, TARGETS, moment_s=0.4).probability
    copy = scene.snapshot()
    copy.add(SCANS[6], None, 0.6)
    assert not np.array_equal(copy.sight(EYE, TARGETS, moment_s=0.6).probability, before)
    assert np.array_equal(scene.sight(EYE, TARGETS, moment_s=0.4).probability, before)


def test_packed_scans_stay_while_they_are_held():
    scene = Scene(max_scans=2)
    scene.add(SCANS[0], None, 0.0)
    held = []
    for nth in range(1, len(SCANS)):
        packed = scene.packed_scans(0.0)
        held.append((packed, pickle.dumps(packed)))
        scene.add(SCANS[nth], None, 0.1 * nth)
    for packed, before in held:
        for now, then in zip(packed, pickle.loads(before), strict=True):
            if now is packed.pixels:  # free slots may have been filled since
                for start, size in zip(packed.offset, packed.columns * packed.rows, strict=True):
                    assert np.array_equal(now[start : start + size], then[start : start + size])
            else:
                assert np.array_equal(now, then, equal_nan=True)


def test_memory_stays_bounded_while_readers_ask():
    alone = Scene(max_scans=4)
    stream = Stream(max_scans=4)
    for nth, scan in enumerate(SCANS):
        alone.add(scan, None, 0.1 * nth)
        stream.push(scan, None, 0.1 * nth)
        kept = stream.snapshot()  # replaced at the next round, as an answer that is being given
        assert len(kept) == min(nth + 1, 4)
    assert stream.bytes <= alone.bytes * (4 + 4) / 4


def test_a_scene_can_be_pickled():
    scene = Scene(max_scans=3)
    for nth, scan in enumerate(SCANS[:5]):
        scene.add(scan, None, 0.1 * nth)
    copy = pickle.loads(pickle.dumps(scene))
    for one in (scene, copy):
        one.add(SCANS[6], None, 0.9)
    expected = scene.sight(EYE, TARGETS, moment_s=0.9).probability
    assert np.array_equal(copy.sight(EYE, TARGETS, moment_s=0.9).probability, expected)


def message(points, time_ns):
    return Message(
        header=Message(stamp=Message(sec=time_ns // 10**9, nanosec=time_ns % 10**9), frame_id="a"),
        height=1,
        width=len(points),
        fields=[
            Message(name=axis, offset=4 * n, datatype=7, count=1) for n, axis in enumerate("xyz")
        ],
        is_bigendian=False,
        point_step=12,
        row_step=12 * len(points),
        data=points.astype("<f4").tobytes(),
        is_dense=True,
    )


def test_a_message_is_the_scan_with_its_time():
    points = SCANS[0][:, :3].astype(np.float32)
    with_gaps = np.insert(points, 7, 0, axis=0)  # no return
    stream, scene = Stream(), Scene()
    stream.push(message(with_gaps, 1_700_000_000_500_000_000), None)
    scene.add(points, None, 1_700_000_000.5)
    assert stream.newest_s == 1_700_000_000.5
    expected = scene.sight(EYE, TARGETS, moment_s=1_700_000_000.5).probability
    assert np.array_equal(stream.sight(EYE, TARGETS).probability, expected)
    stream.push(message(points, 0), None, time_s=1_700_000_001.0)
    assert stream.newest_s == 1_700_000_001.0


def test_without_times_no_moment_is_asked():
    stream, scene = Stream(), Scene()
    assert stream.newest_s is None
    for one in (stream.push, scene.add):
        one(SCANS[0], None)
    assert stream.newest_s is None
    expected = scene.sight(EYE, TARGETS).probability
    assert np.array_equal(stream.sight(EYE, TARGETS).probability, expected)


def test_what_is_wrong_is_said_and_changes_nothing():
    stream = Stream()
    for ask in (lambda: stream.sight(EYE, TARGETS), stream.snapshot):
        with pytest.raises(SceneError, match="the stream holds no scan"):
            ask()
    stream.push(SCANS[0], None)
    before = stream.sight(EYE, TARGETS).probability
    with pytest.raises(PointsError):
        stream.push("scan", None)
    with pytest.raises(PoseError):
        stream.push(SCANS[1], np.zeros((4, 4)))
    with pytest.raises(ScanError, match="no points"):
        stream.push(message(np.zeros((0, 3)), 0), None)
    assert np.array_equal(stream.sight(EYE, TARGETS).probability, before)
    assert intervis.Stream is Stream
    assert "1 scan" in repr(stream)
