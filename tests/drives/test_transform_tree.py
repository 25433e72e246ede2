"""The tree of frames: motions that share no number, serialized by rosbags, multiplied by hand."""

from pathlib import Path

import numpy as np
import pytest
from bag_writer import START_NS, Recorder
from scipy.spatial.transform import Rotation

from intervis.drives.transform_tree import Motions, TransformTree, decode_odometry
from intervis.errors import CalibrationError
from intervis.transform import inverse, rigid

NAME = Path("a.bag")
UNTURNED = (0.0, 0.0, 0.0, 1.0)


def motion_of(seed):
    """A motion whose twelve numbers are all different."""
    rng = np.random.default_rng(seed)
    turn = Rotation.from_euler("ZYX", rng.uniform([-170, -70, -170], [170, 70, 170]), degrees=True)
    return rigid(turn.as_matrix(), rng.uniform(-50, 50, 3))


@pytest.fixture(params=["ros1", "mcap"])
def recorder(request, tmp_path):
    """Makes messages in either encoding; nothing is recorded."""
    return Recorder(tmp_path / "drive", request.param)


def encoding_of(recorder):
    return "ros1" if recorder.ros1 else "cdr"


def serialized(recorder, message):
    serialize = recorder.store.serialize_ros1 if recorder.ros1 else recorder.store.serialize_cdr
    return bytes(serialize(message, message.__msgtype__))


def add(tree, recorder, transforms, *, static=False):
    """One message of some transforms (parent, child, motion, time)."""
    stamped = [
        recorder.kinds["geometry_msgs/msg/TransformStamped"](
            header=recorder.header(time_ns, parent),
            child_frame_id=child,
            transform=recorder.pose(motion, "Transform", "translation", "rotation"),
        )
        for parent, child, motion, time_ns in transforms
    ]
    message = recorder.kinds["tf2_msgs/msg/TFMessage"](transforms=stamped)
    tree.add(serialized(recorder, message), encoding_of(recorder), NAME, static=static)


def test_motions_are_multiplied_from_the_root_down(recorder):
    """map -> odom -> base; on the base a mast with two scanners, a camera and a turning wheel."""
    tree = TransformTree()
    odom, mast, left, right, camera = map(motion_of, range(5))
    first, second = motion_of(10), motion_of(11)
    fixed = [("base", "mast", mast, 0), ("mast", "left", left, 0), ("mast", "/right", right, 0)]
    add(tree, recorder, [*fixed, ("base", "camera", camera, 0)], static=True)
    for nth, pose in enumerate((first, second)):
        add(tree, recorder, [("map", "odom", odom, nth), ("odom", "/base", pose, nth)])
        add(tree, recorder, [("base", "wheel", motion_of(20 + nth), nth)])
    chain = tree.chain("left")
    assert [(edge.parent, edge.child) for edge in chain] == [
        ("mast", "left"), ("base", "mast"), ("odom", "base"), ("map", "odom"),
    ]  # fmt: skip
    for nth, pose in enumerate((first, second)):
        motions = [edge.at(START_NS + nth) for edge in chain]
        for found, expected in zip(motions, (left, mast, pose, odom), strict=True):
            assert np.allclose(found, expected, rtol=0, atol=1e-12)
    assert [edge.motion is None for edge in chain] == [False, False, True, False]
    for to_frame, from_frame, expected in (
        ("base", "left", mast @ left),
        ("left", "base", inverse(mast @ left)),
        ("right", "left", inverse(right) @ left),
        ("camera", "right", inverse(camera) @ mast @ right),
        ("left", "left", np.eye(4)),
    ):
        assert np.allclose(tree.fixed(to_frame, from_frame), expected, rtol=0, atol=1e-9)
    assert tree.fixed("left", "odom") is None, "the base moves between the two"
    assert tree.fixed("left", "elsewhere") is None
    assert np.allclose(tree.fixed_above("left"), mast @ left, rtol=0, atol=1e-9)
    assert np.allclose(tree.fixed_above("base"), np.eye(4))
    below = {name: tree.moves_below(name) for name in ("map", "odom", "base", "mast", "wheel")}
    assert below == {"map": True, "odom": True, "base": True, "mast": False, "wheel": False}


def test_poses_between_two_stamps_are_on_the_way(recorder):
    tree, turn = TransformTree(), Rotation.from_euler("ZYX", [40, -25, 10], degrees=True)
    first = motion_of(3)
    last = rigid(first[:3, :3] @ turn.as_matrix(), first[:3, 3] + [4.0, -8.0, 2.0])
    add(tree, recorder, [("map", "base", first, 0), ("map", "base", last, 1000)])
    (edge,) = tree.chain("base")
    quarter = Rotation.from_rotvec(0.25 * turn.as_rotvec()).as_matrix()
    expected = rigid(first[:3, :3] @ quarter, first[:3, 3] + [1.0, -2.0, 0.5])
    assert np.allclose(edge.at(START_NS + 250), expected, rtol=0, atol=1e-9)
    assert edge.at(START_NS - 1) is None
    assert edge.at(START_NS + 1001) is None


def test_of_a_stamp_that_repeats_the_last_message_counts(recorder):
    tree, poses = TransformTree(), [motion_of(nth) for nth in range(4)]
    for nth, time_ns in ((0, 20), (1, 10), (2, 20), (3, 30)):
        add(tree, recorder, [("map", "base", poses[nth], time_ns)])
    (edge,) = tree.chain("base")
    for time_ns, nth in ((10, 1), (20, 2), (30, 3)):
        assert np.allclose(edge.at(START_NS + time_ns), poses[nth], rtol=0, atol=1e-12)


def test_a_static_frame_is_where_the_last_stamp_says(recorder):
    tree = TransformTree()
    for nth, time_ns in ((0, 20), (1, 30), (2, 10)):
        add(tree, recorder, [("base", "velodyne", motion_of(nth), time_ns)], static=True)
    (edge,) = tree.chain("velodyne")
    assert edge.track is None
    assert np.allclose(edge.motion, motion_of(1), rtol=0, atol=1e-12)


def test_of_two_parents_the_one_with_most_transforms_counts(recorder, caplog):
    tree = TransformTree()
    for time_ns in range(3):
        add(tree, recorder, [("odom", "base", motion_of(time_ns), time_ns)])
    add(tree, recorder, [("zenith", "base", motion_of(7), 0), ("utm", "base", motion_of(8), 1)])
    assert [edge.parent for edge in tree.chain("base")] == ["odom"]
    assert "the frame base has the parents odom, utm, zenith" in caplog.text


@pytest.mark.parametrize("axis", range(7))
def test_a_motion_changes_by_any_of_its_numbers(axis):
    motions, values = Motions(), np.array([5.0, 6, 7, 0.1, 0.2, 0.3, 0.9])
    motions.add(0, tuple(values))
    motions.add(1, tuple(values))
    assert not motions.changes
    values[axis] += 1e-6
    motions.add(2, tuple(values))
    assert motions.changes


@pytest.mark.parametrize(
    ("values", "is_one"),
    [
        ((9e8, -9e8, 9e8, *UNTURNED), True),
        ((1e9, 0, 0, *UNTURNED), False),
        ((0, -1.1e9, 0, *UNTURNED), False),
        ((0, 0, 1.1e9, *UNTURNED), False),
        ((0, np.nan, 0, *UNTURNED), False),
        ((0, 0, np.inf, *UNTURNED), False),
        ((0, 0, 0, 0, 0, 0, 0), False),
        ((0, 0, 0, 1e-3, 0, 0, 0), False),
        ((0, 0, 0, 0, 1.1e-3, 0, 0), True),
        ((0, 0, 0, 0, 0, 900, 0), True),
        ((0, 0, 0, 0, 0, 0, 1000), False),
        ((0, 0, 0, np.nan, 0, 0, 1), False),
    ],
)
def test_places_beyond_a_million_kilometres_and_no_rotations_are_refused(values, is_one):
    motions = Motions()
    assert not motions
    assert motions.add(5, values) == is_one
    assert bool(motions) == is_one


def test_transforms_that_are_none_are_counted(recorder):
    tree = TransformTree()
    nowhere = rigid(np.eye(3), [0, np.nan, 0])
    add(tree, recorder, [("map", "a", nowhere, 0), ("map", "b", np.eye(4), 0)], static=True)
    add(tree, recorder, [("map", "c", nowhere, 0)])
    assert tree.refused == 2
    assert tree
    assert tree.chain("a") == []
    assert [edge.parent for edge in tree.chain("b")] == ["map"]


def test_odometry_is_stamp_frame_and_motion(recorder):
    pose = motion_of(9)
    parts = []
    recorder.write = lambda topic, message, time_ns: parts.append(message)
    recorder.write_odometry(pose, 123_456_789, child="/base")
    content = serialized(recorder, parts[0])
    time_ns, child, values = decode_odometry(content, encoding_of(recorder), NAME)
    assert (time_ns, child) == (START_NS + 123_456_789, "base")
    assert values[:3] == tuple(pose[:3, 3])
    assert np.allclose(Rotation.from_quat(values[3:]).as_matrix(), pose[:3, :3], atol=1e-12)
    with pytest.raises(CalibrationError, match=r"a\.bag holds a message that is no Odometry"):
        decode_odometry(content[:60], encoding_of(recorder), NAME)
