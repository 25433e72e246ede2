"""ROS 1 bags, ROS 2 bags and MCAP files that rosbags writes: points to the bit, chosen poses."""

import contextlib
import logging
import pickle
import sqlite3
import tracemalloc

import numpy as np
import pytest
from bag_writer import FORMATS, START_NS, Recorder, recording_path
from scanned_room import scanned_room
from scipy.spatial.transform import Rotation

from intervis.drives import open_drive
from intervis.drives.mcap_file import McapFile
from intervis.drives.point_cloud2 import point_cloud2_of, scan_of_cloud
from intervis.drives.rosbag1_file import Rosbag1File
from intervis.errors import DriveError, MissingExtraError, ScanError
from intervis.transform import inverse, rigid

STEP_NS = 100_000_000


def room(nth=0, count=500):
    return (scanned_room(beams=4, step_deg=2.0)[:count] + nth).astype(np.float32)


def moved(east_m, yaw_deg, height_m=0.0):
    return rigid(
        Rotation.from_euler("zy", [yaw_deg, yaw_deg / 10], degrees=True).as_matrix(),
        [east_m, 4e5, height_m],
    )


MOUNT = rigid(Rotation.from_euler("zyx", [20, 3, -4], degrees=True).as_matrix(), [1.2, 0.1, 1.8])


@pytest.mark.parametrize("kind", FORMATS)
def test_points_and_poses_of_a_recording(tmp_path, kind):
    path = recording_path(tmp_path, kind)
    with Recorder(path, kind) as recorder:
        recorder.write_transform("base_link", "velodyne", MOUNT, 0, "/tf_static")
        for nth in range(5):  # at 0.05 s, 0.15 s ...: the clouds lie half way between
            recorder.write_transform("odom", "base_link", moved(3 * nth, 8 * nth), nth * STEP_NS)
        for nth in range(4):
            recorder.write_cloud(room(nth), nth * STEP_NS + STEP_NS // 2)
    drive = open_drive(path)
    assert (drive.layout, drive.frame_numbers) == ("ros_bag", (0, 1, 2, 3))
    for nth, frame in enumerate(drive):
        assert np.array_equal(frame.points, room(nth))
        assert frame.timestamp_ns == START_NS + nth * STEP_NS + STEP_NS // 2
        half_way = rigid(
            Rotation.from_matrix(moved(0, 8 * nth)[:3, :3]).as_matrix()
            @ Rotation.from_rotvec(
                Rotation.from_matrix(
                    moved(0, 8 * nth)[:3, :3].T @ moved(0, 8 * nth + 8)[:3, :3]
                ).as_rotvec()
                / 2
            ).as_matrix(),
            [3 * nth + 1.5, 4e5, 0],
        )
        assert np.allclose(frame.pose, half_way @ MOUNT, rtol=0, atol=1e-6)
        assert frame.scanner == "/points"


@pytest.mark.parametrize("kind", FORMATS)
def test_poses_of_odometry(tmp_path, kind):
    path = recording_path(tmp_path, kind)
    with Recorder(path, kind) as recorder:
        recorder.write_transform("base_link", "velodyne", MOUNT, 0, "/tf_static")
        for nth in range(3):
            recorder.write_odometry(moved(nth, nth), nth * STEP_NS)
            recorder.write_cloud(room(nth), nth * STEP_NS)
    drive = open_drive(path)
    for nth in range(3):
        assert np.allclose(drive[nth].pose, moved(nth, nth) @ MOUNT, rtol=0, atol=1e-6)


@pytest.mark.parametrize(
    ("kind", "compression"),
    [
        ("ros1", "lz4"),
        ("ros1", "bz2"),
        ("sqlite3", "message"),
        ("mcap", "storage"),
    ],
)
def test_compressed_recordings(tmp_path, kind, compression):
    if compression != "bz2":
        pytest.importorskip("lz4.frame", reason="lz4 (extra ros) is not installed")
    path = recording_path(tmp_path, kind)
    with Recorder(path, kind, compression) as recorder:
        for nth in range(3):
            recorder.write_odometry(moved(nth, nth), nth * STEP_NS, child="velodyne")
            recorder.write_cloud(room(nth), nth * STEP_NS)
    drive = open_drive(path)
    for nth in range(3):
        assert np.array_equal(drive[nth].points, room(nth))
        assert np.allclose(drive[nth].pose, moved(nth, nth), rtol=0, atol=1e-6)


def test_a_recording_compressed_as_a_whole_is_told(tmp_path):
    with Recorder(tmp_path / "drive", "sqlite3", "file") as recorder:
        recorder.write_cloud(room(), 0)
    with pytest.raises(DriveError, match="zstd -d"):
        open_drive(tmp_path / "drive")


def test_points_are_turned_into_the_axes_of_the_vehicle(tmp_path):
    """A scanner with x to the right, tilted: whole right angles are taken out, the tilt stays."""
    tilt = Rotation.from_euler("y", 10, degrees=True)
    right = Rotation.from_matrix([[0, 1, 0], [-1, 0, 0], [0, 0, 1]])
    ego_from_sensor = rigid((tilt * right).as_matrix(), [0, 0, 2])
    with Recorder(tmp_path / "drive", "mcap") as recorder:
        recorder.write_transform("base_link", "velodyne", ego_from_sensor, 0, "/tf_static")
        for nth in range(2):
            recorder.write_transform("map", "base_link", moved(nth, 0), nth * STEP_NS)
            recorder.write_cloud(room(), nth * STEP_NS)
    frame = open_drive(tmp_path / "drive")[1]
    x, y, z = room().T
    assert np.array_equal(frame.points, np.stack([y, -x, z], axis=1))
    expected = moved(1, 0) @ rigid(tilt.as_matrix(), [0, 0, 2])
    assert np.allclose(frame.pose, expected, rtol=0, atol=1e-6)


def test_a_longer_tree_with_static_parts_on_tf(tmp_path):
    """map -> odom -> base -> mount -> velodyne; the two last never change, on /tf as in ROS 1."""
    path = tmp_path / "drive.bag"
    drift, part = moved(1, 1, 2), rigid(np.eye(3), [0, 0, 1])
    with Recorder(path, "ros1") as recorder:
        for nth in range(3):
            time_ns = nth * STEP_NS
            recorder.write_transform("/map", "/odom", drift, time_ns)
            recorder.write_transform("/odom", "/base", moved(nth, 0), time_ns)
            recorder.write_transform("/base", "/mount", part, time_ns)
            recorder.write_transform("/mount", "/velodyne", part, time_ns)
            recorder.write_cloud(room(), time_ns, frame_id="/velodyne")
    drive = open_drive(path)
    expected = drift @ moved(2, 0) @ part @ part
    assert np.allclose(drive[2].pose, expected, rtol=0, atol=1e-6)


def test_several_topics_are_named_and_one_is_chosen_below_the_path(tmp_path):
    path = tmp_path / "drive"
    side = rigid(np.eye(3), [0, 1, 0])
    with Recorder(path, "mcap") as recorder:
        recorder.write_transform("base_link", "roof", MOUNT, 0, "/tf_static")
        recorder.write_transform("base_link", "left", side, 0, "/tf_static")
        for nth in range(3):
            recorder.write_transform("odom", "base_link", moved(nth, 0), nth * STEP_NS)
            recorder.write_cloud(room(nth), nth * STEP_NS, "/roof/points", "roof")
            recorder.write_cloud(room(nth)[::2], nth * STEP_NS, "/roof/points_few", "roof")
            recorder.write_cloud(room(nth) + 0.5, nth * STEP_NS + 9_000_000, "/left", "left")
    with pytest.raises(DriveError, match=r"3 topics.*: drive/left, drive/roof/points, drive/roof"):
        open_drive(path)
    for chosen in (path / "roof/points", path / "drive.mcap" / "roof/points"):
        drive = open_drive(chosen)
        assert np.array_equal(drive[1].points, room(1))
        main, left = drive[1].scans  # points of the roof's own frame come once
        assert (main.name, left.name) == ("/roof/points", "/left")
        assert np.array_equal(left.points, room(1) + np.float32(0.5))
        assert left.timestamp_ns == START_NS + STEP_NS + 9_000_000
        assert np.allclose(left.pose, moved(1.09, 0) @ side, rtol=0, atol=1e-6)
    with pytest.raises(DriveError, match=r"no clouds on /nothing; topics with clouds: /left"):
        open_drive(path / "nothing")


@pytest.mark.parametrize("kind", ["sqlite3", "mcap"])
def test_the_parts_of_a_split_recording_are_one_drive(tmp_path, kind):
    """Frames alternate between two files; the transforms of both give the poses."""
    for part in (0, 1):
        with Recorder(tmp_path / f"part{part}", kind) as recorder:
            for nth in range(part, 6, 2):
                recorder.write_odometry(moved(nth, 0), nth * STEP_NS, child="velodyne")
                recorder.write_cloud(room(nth), nth * STEP_NS)
    stored = only_file(tmp_path / "part1")
    stored.rename(tmp_path / "part0" / stored.name)
    drive = open_drive(tmp_path / "part0")
    for nth in range(6):
        assert np.array_equal(drive[nth].points, room(nth))
        assert np.allclose(drive[nth].pose, moved(nth, 0), rtol=0, atol=1e-6)
    assert len(set(drive.scan_paths.values())) == 2


def test_a_folder_of_recordings(tmp_path):
    for name in ("a", "b"):
        with Recorder(tmp_path / f"{name}.bag", "ros1") as recorder:
            recorder.write_cloud(room(), 0)
    with pytest.raises(DriveError, match=r"2 drives; give the path of one of them: a\.bag, b\.bag"):
        open_drive(tmp_path)
    (tmp_path / "b.bag").unlink()
    assert len(open_drive(tmp_path)) == 1


def test_frames_follow_their_stamps_not_their_recording(tmp_path):
    with Recorder(tmp_path / "a.bag", "ros1") as recorder:
        recorder.write_cloud(room(1), STEP_NS, later_ns=0)
        recorder.write_cloud(room(0), 0, later_ns=5 * STEP_NS)
    drive = open_drive(tmp_path / "a.bag")
    assert [drive.timestamps_ns[nth] for nth in (0, 1)] == [START_NS, START_NS + STEP_NS]
    assert np.array_equal(drive[0].points, room(0))


def test_a_cloud_without_stamp_has_the_time_of_its_recording(tmp_path):
    with Recorder(tmp_path / "a.bag", "ros1") as recorder:
        recorder.write("/points", recorder.cloud(room(), None), 700)
    assert open_drive(tmp_path / "a.bag")[0].timestamp_ns == START_NS + 700


@pytest.mark.parametrize("kind", FORMATS)
def test_a_message_that_is_no_cloud_fails_its_own_frame(tmp_path, caplog, kind):
    path = recording_path(tmp_path, kind)
    with Recorder(path, kind) as recorder:
        for nth in range(4):
            recorder.write_odometry(moved(nth, 0), nth * STEP_NS, child="velodyne")
            recorder.write_cloud(room(nth), nth * STEP_NS)
        connection = recorder.connections["/points"]
        recorder.writer.write(connection, START_NS + STEP_NS + 7, b"no cloud at all")
    drive, said = warnings_of(caplog, path)
    assert drive.frame_numbers == (0, 1, 2, 3, 4)
    assert drive.timestamps_ns[2] == START_NS + STEP_NS + 7  # when it was recorded
    with pytest.raises(ScanError, match="holds a message that is no PointCloud2"):
        drive[2]
    assert np.array_equal(drive[3].points, room(2))
    assert np.allclose(drive[3].pose, moved(2, 0), rtol=0, atol=1e-6)
    assert len(said) == 1
    assert "do not cover the times of 1 of its 5 clouds" in said[0]


def warnings_of(caplog, path):
    caplog.clear()
    with caplog.at_level(logging.WARNING):
        drive = open_drive(path)
    return drive, [record.getMessage() for record in caplog.records]


def write_clouds(recorder):
    for nth in range(3):
        recorder.write_cloud(room(nth), nth * STEP_NS)


@pytest.mark.parametrize(
    ("edges", "reason"),
    [
        ([], "neither transforms (tf) nor odometry"),
        ([("odom", "base_link", True)], "no transform above the frame 'velodyne' changes"),
        ([("base_link", "velodyne", False)], "no transform above the frame 'velodyne' changes"),
        (
            [("a", "velodyne", True), ("b", "a", True), ("a", "b", True)],
            "the transforms form a circle: a -> b -> a",
        ),
        ([("velodyne", "base_link", True)], "in the frame 'velodyne', which does not move"),
    ],
)
def test_what_the_transforms_lack_is_said_in_one_sentence(tmp_path, caplog, edges, reason):
    with Recorder(tmp_path / "a.bag", "ros1") as recorder:
        write_clouds(recorder)
        for parent, child, moves in edges:
            for nth in range(3):
                recorder.write_transform(parent, child, moved(nth * moves, 0), nth * STEP_NS)
    drive, said = warnings_of(caplog, tmp_path / "a.bag")
    assert drive.poses is None
    assert drive[0].pose is None
    assert len(said) == 1
    assert "has no poses: " in said[0]
    assert reason in said[0]


@pytest.mark.parametrize("topic", ["/tf", "/tf_static"])
def test_a_scanner_that_stands_in_the_world_has_one_pose_and_says_so(tmp_path, caplog, topic):
    with Recorder(tmp_path / "a.bag", "ros1") as recorder:
        write_clouds(recorder)
        for nth in range(3):
            recorder.write_transform("map", "mast", moved(30.0, 0), nth * STEP_NS, topic)
            recorder.write_transform("mast", "velodyne", rigid(np.eye(3), [0, 0, 6.0]), 0)
    drive, said = warnings_of(caplog, tmp_path / "a.bag")
    assert said == [f"{tmp_path / 'a.bag'} stands still: no transform below map changes."]
    for frame in drive:
        assert frame.pose[:3, 3].tolist() == [30.0, 4e5, 6.0]
        assert frame.points.tolist() == room(frame.number).tolist()


def test_clouds_in_the_world_itself_do_not_stand(tmp_path, caplog):
    """Registered clouds, in a frame below which the vehicle moves, are no scans from one place."""
    with Recorder(tmp_path / "a.bag", "ros1") as recorder:
        write_clouds(recorder)
        recorder.write_transform("map", "velodyne", moved(0, 0), 0)
        for nth in range(3):
            recorder.write_transform("velodyne", "base_link", moved(nth, 0), nth * STEP_NS)
    drive, said = warnings_of(caplog, tmp_path / "a.bag")
    assert drive.poses is None
    assert "in the frame 'velodyne', which does not move" in said[0]


def test_odometry_of_a_frame_that_leads_nowhere(tmp_path, caplog):
    with Recorder(tmp_path / "a.bag", "ros1") as recorder:
        write_clouds(recorder)
        recorder.write_odometry(moved(0, 0), 0)
    drive, said = warnings_of(caplog, tmp_path / "a.bag")
    assert drive.poses is None
    assert said == [
        f"{tmp_path / 'a.bag'} has no poses: no fixed transform leads from base_link (odometry) to"
        " 'velodyne'."
    ]


def test_poses_are_not_extrapolated_nor_bridged(tmp_path, caplog):
    """Odometry from 0.1 to 0.2 s and from 5 s on; clouds at 0, 0.1, 0.15, 2 and 5 s."""
    times_ns = [nth * STEP_NS for nth in (0, 1, 1.5, 20, 50)]
    with Recorder(tmp_path / "a.bag", "ros1") as recorder:
        for nth in (1, 2, 50, 51):
            recorder.write_odometry(moved(nth, 0), nth * STEP_NS, child="velodyne")
        for time_ns in times_ns:
            recorder.write_cloud(room(), int(time_ns))
    drive, said = warnings_of(caplog, tmp_path / "a.bag")
    assert sorted(drive.poses) == [1, 2, 4]
    assert np.allclose(drive[2].pose, moved(1.5, 0), rtol=0, atol=1e-6)
    assert said == [
        f"the poses of {tmp_path / 'a.bag'} do not cover the times of 2 of its 5 clouds."
    ]


def test_motions_that_are_none_are_left_out(tmp_path, caplog):
    with Recorder(tmp_path / "a.bag", "ros1") as recorder:
        write_clouds(recorder)
        for nth in range(3):
            recorder.write_odometry(moved(nth, 0), nth * STEP_NS, child="velodyne")
        recorder.write_odometry(rigid(np.eye(3), [np.nan, 0, 0]), STEP_NS // 2, child="velodyne")
    drive, said = warnings_of(caplog, tmp_path / "a.bag")
    assert len(drive.poses) == 3
    assert said == [f"{tmp_path / 'a.bag'} holds 1 poses that are no rigid motion."]


@pytest.mark.parametrize("kind", FORMATS)
def test_recordings_without_clouds_are_told(tmp_path, kind):
    path = recording_path(tmp_path, kind)
    with Recorder(path, kind) as recorder:
        recorder.write_odometry(moved(0, 0), 0)
    with pytest.raises(DriveError, match=r"holds no clouds.*/odom \(nav_msgs/Odometry\)"):
        open_drive(path)


@pytest.mark.parametrize("kind", FORMATS)
def test_names_with_line_feeds_stay_on_one_line(tmp_path, kind):
    path = recording_path(tmp_path, kind)
    with Recorder(path, kind) as recorder:
        recorder.write_odometry(moved(0, 0), 0, topic="/od\nom", child="a\nb")
    with pytest.raises(DriveError, match=r"/od\?om") as caught:
        open_drive(path)
    assert "\n" not in str(caught.value)


def only_file(path):
    return (
        path if path.is_file() else next(f for f in path.iterdir() if f.suffix in (".mcap", ".db3"))
    )


@pytest.mark.parametrize("kind", ["ros1", "mcap"])
@pytest.mark.parametrize("compression", ["", "compressed"])
def test_a_cut_recording_gives_what_comes_before(tmp_path, caplog, kind, compression):
    """The recorder was killed: no index at the end, and the last chunk is not whole."""
    pytest.importorskip("lz4.frame", reason="lz4 (extra ros) is not installed")
    path = recording_path(tmp_path, kind)
    count = 40  # of 60 kB: the writers make a chunk of each megabyte
    packed = {"ros1": "lz4", "mcap": "storage"}[kind] if compression else ""
    rng = np.random.default_rng(1)
    clouds = [rng.normal(size=(5000, 3)).astype(np.float32) for _ in range(count)]
    with Recorder(path, kind, packed) as recorder:
        for nth, points in enumerate(clouds):
            recorder.write_odometry(moved(nth, 0), nth * STEP_NS, child="velodyne")
            recorder.write_cloud(points, nth * STEP_NS)
    file = only_file(path)
    content = file.read_bytes()
    whole, _ = warnings_of(caplog, path)
    assert len(whole) == count
    for share in (0.5, 0.8):
        file.write_bytes(content[: int(share * len(content))])
        drive, said = warnings_of(caplog, file)
        assert share * count - 18 < len(drive) < share * count + 1
        for number in (0, len(drive) // 2, len(drive) - 1):
            assert np.array_equal(drive[number].points, clouds[number])
            assert np.allclose(drive[number].pose, moved(number, 0), rtol=0, atol=1e-6)
        assert len(said) == 1
        assert f"{file} is damaged: it ends within a record at " in said[0]


def test_a_chunk_that_was_never_closed_is_read(tmp_path, caplog):
    """rosbag writes the size of a chunk when it is full; until then it is 0."""
    path = tmp_path / "a.bag"
    with Recorder(path, "ros1") as recorder:
        for nth in range(3):
            recorder.write_odometry(moved(nth, 0), nth * STEP_NS, child="velodyne")
            recorder.write_cloud(room(nth), nth * STEP_NS)
    content = path.read_bytes()
    size_at = content.index(b"size=") + 5
    size = content[size_at : size_at + 4]
    data_at = content.index(size, size_at + 4)  # the same number before the data
    end = data_at + 4 + int.from_bytes(size, "little")
    nothing = bytes(4)
    opened = content[:size_at] + nothing + content[size_at + 4 : data_at] + nothing
    path.write_bytes(opened + content[data_at + 4 : end - 1000])  # within the last cloud
    drive, said = warnings_of(caplog, path)
    assert drive.frame_numbers == (0, 1)
    for nth in range(2):
        assert np.array_equal(drive[nth].points, room(nth))
        assert np.allclose(drive[nth].pose, moved(nth, 0), rtol=0, atol=1e-6)
    assert "it ends within a record" in said[0]


def test_messages_without_chunks_and_chunks_without_index(tmp_path):
    """MCAP allows both: taken apart by hand from a file with chunks and indexes."""
    with Recorder(tmp_path / "drive", "mcap") as recorder:
        for nth in range(3):
            recorder.write_odometry(moved(nth, 0), nth * STEP_NS, child="velodyne")
            recorder.write_cloud(room(nth), nth * STEP_NS)
    content = only_file(tmp_path / "drive").read_bytes()
    bare, unindexed, place = content[:8], content[:8], 8
    while place < len(content) - 8:
        kind, size = content[place], int.from_bytes(content[place + 1 : place + 9], "little")
        record = content[place : place + 9 + size]
        place += len(record)
        if kind == 6:  # a chunk: times, size, checksum, no compression, and its records
            bare += record[9 + 28 + 4 + 8 :]
        elif kind != 7:
            bare += record
        unindexed += record if kind in (1, 6, 15) else b""
    for name, written in (("bare", bare), ("unindexed", unindexed)):
        path = tmp_path / f"{name}.mcap"
        path.write_bytes(written)
        drive = open_drive(path)
        assert drive.frame_numbers == (0, 1, 2)
        for nth in range(3):
            assert np.array_equal(drive[nth].points, room(nth))
            assert np.allclose(drive[nth].pose, moved(nth, 0), rtol=0, atol=1e-6)


@pytest.mark.parametrize(("kind", "reader"), [("ros1", Rosbag1File), ("mcap", McapFile)])
def test_a_file_that_was_cut_since_lacks_its_last_message(tmp_path, kind, reader):
    """Not even the start of a message that lacks one byte is given."""
    path = recording_path(tmp_path, kind)
    with Recorder(path, kind) as recorder:
        write_clouds(recorder)
    path = only_file(path)
    file = reader(path)
    entries = file.entries("/points")
    whole = list(file.read_many(entries))
    assert [file.read(entry) for entry in entries] == whole
    content = path.read_bytes()
    path.write_bytes(content[: content.rindex(whole[-1]) + len(whole[-1]) - 1])
    assert list(file.read_many(entries, most=20)) == [whole[0][:20], whole[1][:20], None]
    with pytest.raises(ScanError, match="has a damaged message"):
        file.read(entries[-1], most=20)


def test_a_cut_database_is_told(tmp_path):
    with Recorder(tmp_path / "drive", "sqlite3") as recorder:
        write_clouds(recorder)
    file = only_file(tmp_path / "drive")
    file.write_bytes(file.read_bytes()[:6000])
    with pytest.raises(ScanError, match="is no readable ROS 2 bag") as caught:
        open_drive(file)
    assert "\n" not in str(caught.value)


def test_a_name_that_is_no_text_in_a_database_does_no_harm(tmp_path):
    with Recorder(tmp_path / "drive", "sqlite3") as recorder:
        write_clouds(recorder)
    file = only_file(tmp_path / "drive")
    with contextlib.closing(sqlite3.connect(file)) as database, database:
        columns = [row[1] for row in database.execute("PRAGMA table_info(topics)")]
        row = dict(zip(columns, database.execute("SELECT * FROM topics").fetchone(), strict=True))
        row |= {"id": 999, "name": b"/\xff"}
        database.execute(
            f"INSERT INTO topics ({', '.join(row)}) VALUES"
            f" ({', '.join('CAST(? AS TEXT)' if n == 'name' else '?' for n in row)})",
            list(row.values()),
        )
    assert len(open_drive(file)) > 0


@pytest.mark.parametrize("ending", ["bag", "mcap", "db3"])
@pytest.mark.parametrize("content", [b"", b"no recording of any kind\n" * 10])
def test_files_that_are_none_are_told(tmp_path, ending, content):
    path = tmp_path / f"a.{ending}"
    path.write_bytes(content)
    with pytest.raises(ScanError, match="is no ") as caught:
        open_drive(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("reader", [McapFile, Rosbag1File])
def test_a_file_that_is_gone_is_told(tmp_path, reader):
    with pytest.raises(ScanError, match=r"cannot read .*gone: No such file"):
        reader(tmp_path / "gone")


@pytest.mark.parametrize("kind", FORMATS)
def test_opening_does_not_read_the_clouds(tmp_path, kind):
    """A recording of 48 MB is opened, and one cloud read, with a few MB of memory."""
    path = recording_path(tmp_path, kind)
    points = np.random.default_rng(1).normal(size=(100_000, 3)).astype(np.float32)
    with Recorder(path, kind) as recorder:
        for nth in range(40):
            recorder.write_cloud(points, nth * STEP_NS)
    open_drive(path)[0]  # modules are loaded
    tracemalloc.start()
    try:
        drive = open_drive(path)
        assert tracemalloc.get_traced_memory()[1] < 2e6
        drive[20]
        assert tracemalloc.get_traced_memory()[1] < 12e6
    finally:
        tracemalloc.stop()


def test_a_bomb_is_refused_before_its_memory_is_taken(tmp_path):
    """A chunk that declares little, and holds much; and one that declares more than is allowed."""
    lz4 = pytest.importorskip("lz4.frame", reason="lz4 (extra ros) is not installed")
    with Recorder(tmp_path / "a.bag", "ros1", "lz4") as recorder:
        recorder.write_cloud(room(), 0)
    content = (tmp_path / "a.bag").read_bytes()
    at = content.index(b"compression=lz4")
    size_at = content.index(b"size=", at - 60) + 5
    data_at = content.index(b"\x04\x22\x4d\x18")
    declared = int.from_bytes(content[size_at : size_at + 4], "little")
    bomb = lz4.compress(bytes(2**29))
    forged = content[: data_at - 4] + len(bomb).to_bytes(4, "little") + bomb
    (tmp_path / "b.bag").write_bytes(forged)
    huge = (2**31).to_bytes(4, "little")
    (tmp_path / "c.bag").write_bytes(forged[:size_at] + huge + forged[size_at + 4 :])
    for name in ("b.bag", "c.bag"):
        tracemalloc.start()
        try:
            with pytest.raises(DriveError, match="holds no clouds"):
                open_drive(tmp_path / name)
            assert tracemalloc.get_traced_memory()[1] < 10e6 + 4 * declared
        finally:
            tracemalloc.stop()


def test_without_the_extra_it_is_named(tmp_path, monkeypatch):
    pytest.importorskip("lz4.frame", reason="lz4 (extra ros) is not installed")
    with Recorder(tmp_path / "a.bag", "ros1", "lz4") as recorder:
        recorder.write_cloud(room(), 0)
    monkeypatch.setitem(__import__("sys").modules, "lz4.frame", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'intervis\[ros\]'"):
        open_drive(tmp_path / "a.bag")


@pytest.mark.parametrize("kind", FORMATS)
def test_a_drive_travels_between_processes(tmp_path, kind):
    path = recording_path(tmp_path, kind)
    with Recorder(path, kind) as recorder:
        for nth in range(3):
            recorder.write_odometry(moved(nth, 0), nth * STEP_NS, child="velodyne")
            recorder.write_cloud(room(nth), nth * STEP_NS)
    drive = pickle.loads(pickle.dumps(open_drive(path)))
    assert np.array_equal(drive[2].points, room(2))
    assert np.allclose(inverse(drive[1].pose) @ drive[2].pose, rigid(np.eye(3), [1, 0, 0]))
    assert len(drive.fingerprint()["digest"]) == 64


@pytest.mark.realdata
@pytest.mark.parametrize("kind", ["sqlite3", "mcap"])
def test_a_real_message_in_a_recording(shared_data, tmp_path, kind):
    """Bytes of a ROS 2 driver, recorded as they are; rosbags takes them apart as the judge."""
    content = (shared_data / "pointcloud2/dds_message.bin").read_bytes()
    with Recorder(tmp_path / "drive", kind) as recorder:
        connection = recorder.writer.add_connection(
            "/points", "sensor_msgs/msg/PointCloud2", typestore=recorder.store
        )
        recorder.writer.write(connection, START_NS, content)
        judged = recorder.store.deserialize_cdr(content, "sensor_msgs/msg/PointCloud2")
    frame = open_drive(tmp_path / "drive")[0]
    stamp = judged.header.stamp
    assert frame.timestamp_ns == stamp.sec * 10**9 + stamp.nanosec
    by_object = scan_of_cloud(point_cloud2_of(judged), tmp_path)
    assert np.array_equal(frame.points, by_object.points, equal_nan=True)
    assert frame.attributes.keys() == {"intensity", "ring", "timestamp"}
    for name, values in frame.attributes.items():
        assert np.array_equal(values, by_object.attributes[name])
    assert np.isfinite(frame.points).all(axis=1).sum() == 64_000 - 4578
