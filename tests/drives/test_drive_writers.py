"""What the writers of layouts write: tables, messages and files, taken apart by other programs."""

import json
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from intervis.camera import Camera
from intervis.drives import open_drive
from intervis.drives.drive_writer import (
    BoxRecord,
    FrameRecord,
    ImageRecord,
    Rig,
    RigCamera,
    RigScanner,
    ScanRecord,
    quaternions,
    returns_inside,
)
from intervis.drives.mcap_writer import McapWriter
from intervis.drives.nuscenes_table_writer import TABLES, VERSION, NuScenesTables
from intervis.drives.nuscenes_writer import NuScenesWriter, blank_png, sweep_bytes
from intervis.drives.pcd_writer import PcdWriter
from intervis.drives.pose_track import PoseTrack
from intervis.errors import CalibrationError
from intervis.transform import rigid

START_NS = 1_700_000_000_000_000_000
STEP_NS = 100_000_000


def turn(yaw_deg: float, pitch_deg: float = 0.0) -> np.ndarray:
    return Rotation.from_euler("zy", [yaw_deg, pitch_deg], degrees=True).as_matrix()


PLACES = {
    "roof": rigid(turn(0, 1), [0.9, 0, 1.8]),
    "rear": rigid(turn(170, 3), [-1.0, 0.1, 0.7]),
}
CAMERA = RigCamera(
    "front",
    Camera(np.array([[300.0, 0, 31.5, 0], [0, 301, 17.5, 0], [0, 0, 1, 0]]), 64, 36),
    rigid([[0, 0, 1], [-1, 0, 0], [0, -1, 0]], [1.7, 0, 1.5]),
)


def rig(*names: str, cameras: tuple[RigCamera, ...] = ()) -> Rig:
    return Rig(tuple(RigScanner(name, "made", PLACES[name], 32) for name in names), cameras)


def pose(number: float) -> np.ndarray:
    return rigid(turn(30 + 2 * number), [100 + number, 200, 3])


def scan(number: int, scanner: int, motion: bool = True) -> ScanRecord:
    rng = np.random.default_rng([number, scanner])
    azimuth = np.repeat(np.arange(0, 2 * np.pi, 0.05), 4)
    range_m = rng.uniform(3, 20, len(azimuth))
    points = np.column_stack(
        [range_m * np.cos(azimuth), range_m * np.sin(azimuth), np.tile([1.0, 0, -1, -2], 126)]
    )
    offset_ns = np.sort(rng.integers(0, STEP_NS, len(points))) if motion else None
    ring = np.tile(np.arange(4), 126)
    return ScanRecord(
        points.astype(np.float32), rng.random(len(points), np.float32), ring, offset_ns
    )


def frame(number: int, drive_rig: Rig, motion: bool = True) -> FrameRecord:
    time_ns = START_NS + number * STEP_NS
    times_ns = time_ns + np.arange(0, STEP_NS + 1, STEP_NS // 10)
    track = PoseTrack(times_ns, [pose(number + share) for share in np.linspace(0, 1, 11)])
    objects = {"a": "car", "b": "person"} if number < 7 else {"b": "person"}  # the car leaves
    boxes = tuple(
        BoxRecord(name, category, pose(number) @ rigid(turn(5), [6.0, 2, 1]), np.array([4, 2, 1.5]))
        for name, category in objects.items()
    )
    pixels = np.full((36, 64, 3), number, np.uint8)
    images = tuple(
        ImageRecord(pixels, time_ns + 20_000_000, pose(number + 0.2)) for _ in drive_rig.cameras
    )
    scans = tuple(scan(number, nth, motion) for nth in range(len(drive_rig.scanners)))
    return FrameRecord(time_ns, track, scans, images, boxes)


def write(writer, drive_rig: Rig, frames: int) -> Path:
    for number in range(frames):
        writer.add(frame(number, drive_rig))
    return writer.close()


# --- nuScenes ---


@pytest.fixture(scope="module")
def tables(tmp_path_factory) -> dict[str, dict[str, dict]]:
    """Tables of twelve frames: three samples; the last has no car."""
    pytest.importorskip("PIL", reason="Pillow (extra plots) is not installed")
    root = tmp_path_factory.mktemp("nuscenes")
    drive_rig = rig("roof", "rear", cameras=(CAMERA,))
    assert write(NuScenesWriter(root, drive_rig), drive_rig, 12) == Path(VERSION, "scene-0001")
    found = {"root": root}
    for name in TABLES:
        records = json.loads((root / VERSION / f"{name}.json").read_text())
        found[name] = {record["token"]: record for record in records}
        assert len(found[name]) == len(records), "tokens are unique"
    return found


def chain(records: dict[str, dict], first: str) -> list[dict]:
    """Records from the first to the last by `next`, checked against `prev`."""
    found, before = [], ""
    while first:
        assert records[first]["prev"] == before
        found.append(records[first])
        before, first = first, records[first]["next"]
    return found


def test_samples_follow_each_other_every_half_second(tables) -> None:
    (scene,) = tables["scene"].values()
    samples = chain(tables["sample"], scene["first_sample_token"])
    assert [one["timestamp"] * 1000 - START_NS for one in samples] == [0, 5 * STEP_NS, 10 * STEP_NS]
    assert scene["nbr_samples"] == len(samples) == len(tables["sample"])
    assert scene["last_sample_token"] == samples[-1]["token"]
    assert all(one["scene_token"] == scene["token"] for one in samples)


def test_every_sensor_has_a_chain_of_files_that_exist(tables) -> None:
    starts = [record for record in tables["sample_data"].values() if not record["prev"]]
    channels = {}
    for start in starts:
        records = chain(tables["sample_data"], start["token"])
        sensor = tables["calibrated_sensor"][start["calibrated_sensor_token"]]["sensor_token"]
        channels[tables["sensor"][sensor]["channel"]] = records
    assert set(channels) == {"LIDAR_TOP", "LIDAR_BACK", "CAM_FRONT"}
    for channel, records in channels.items():
        assert len(records) == 12
        assert [record["is_key_frame"] for record in records] == [n % 5 == 0 for n in range(12)]
        for number, record in enumerate(records):
            path = tables["root"] / record["filename"]
            assert path.is_file()
            assert record["filename"].startswith("samples" if number % 5 == 0 else "sweeps")
            assert record["sample_token"] in tables["sample"]
            ego = tables["ego_pose"][record["ego_pose_token"]]
            assert ego["timestamp"] == record["timestamp"]
            share = 0.2 if channel == "CAM_FRONT" else 0
            assert np.allclose(ego["translation"], pose(number + share)[:3, 3], atol=1e-12)
            assert (record["width"], record["height"]) == (
                (64, 36) if channel == "CAM_FRONT" else (0, 0)
            )


def test_objects_are_annotated_in_key_frames(tables) -> None:
    counts = {}
    for instance in tables["instance"].values():
        records = chain(tables["sample_annotation"], instance["first_annotation_token"])
        assert records[-1]["token"] == instance["last_annotation_token"]
        assert instance["nbr_annotations"] == len(records)
        category = tables["category"][instance["category_token"]]["name"]
        counts[category] = counts.get(category, 0) + len(records)
        for record in records:
            assert record["instance_token"] == instance["token"]
            assert record["size"] == [2, 4, 1.5]  # width, length, height
    assert counts == {"vehicle.car": 2, "human.pedestrian.adult": 3}
    assert len(tables["sample_annotation"]) == 5


def test_the_sensor_has_x_right_and_y_forward(tables) -> None:
    sensors = {one["token"]: one["channel"] for one in tables["sensor"].values()}
    (top,) = (
        one for one in tables["calibrated_sensor"].values()
        if sensors[one["sensor_token"]] == "LIDAR_TOP"
    )  # fmt: skip
    w, x, y, z = top["rotation"]
    ego_from_sensor = Rotation.from_quat([x, y, z, w]).as_matrix()
    assert np.allclose(ego_from_sensor @ [0, 1, 0], PLACES["roof"][:3, 0], atol=1e-12)  # forward
    assert np.allclose(ego_from_sensor @ [1, 0, 0], -PLACES["roof"][:3, 1], atol=1e-12)  # right
    assert np.allclose(top["translation"], [0.9, 0, 1.8])
    one = ScanRecord(np.array([[5, -2, 1]], np.float32), np.array([0.5], np.float32), np.array([7]))
    assert struct.unpack("<5f", sweep_bytes(one)) == (2, 5, 1, 128, 7)


def test_several_scenes_stand_in_the_same_tables(tmp_path: Path) -> None:
    tables = NuScenesTables(tmp_path, rig("roof"), "maps/blank.png", 2)
    for name, start in (("one", 0), ("two", 50)):
        tables.begin_scene(name, "", START_NS)
        for number in range(4):
            record = frame(start + number, rig("roof"))
            tables.add(record, [0] * len(record.boxes))
    tables.close()
    loaded = {name: json.loads((tmp_path / f"{name}.json").read_text()) for name in TABLES}
    assert [scene["name"] for scene in loaded["scene"]] == ["one", "two"]
    assert [scene["nbr_samples"] for scene in loaded["scene"]] == [2, 2]
    assert len(loaded["sample_data"]) == len(loaded["ego_pose"]) == 8
    assert len(loaded["calibrated_sensor"]) == 2
    assert sum(not record["next"] for record in loaded["sample_data"]) == 2
    assert set(loaded["map"][0]["log_tokens"]) == {log["token"] for log in loaded["log"]}
    assert loaded["attribute"] == []


def test_the_blank_mask_is_a_picture(tmp_path: Path) -> None:
    image = pytest.importorskip("PIL.Image", reason="Pillow (extra plots) is not installed")
    (tmp_path / "blank.png").write_bytes(blank_png(16))
    with image.open(tmp_path / "blank.png") as picture:
        assert (picture.size, picture.mode, picture.getextrema()) == ((16, 16), "L", (0, 0))


# --- MCAP ---


def test_rosbags_reads_clouds_and_transforms(tmp_path: Path) -> None:
    pytest.importorskip("rosbags", reason="rosbags, which reads the recording, is not installed")
    from rosbags.highlevel import AnyReader

    drive_rig = rig("roof", "rear")
    path = tmp_path / write(McapWriter(tmp_path, drive_rig), drive_rig, 3).parts[0]
    with AnyReader([path]) as reader:
        assert {one.topic: one.msgtype for one in reader.connections} == {
            "/tf": "tf2_msgs/msg/TFMessage",
            "/tf_static": "tf2_msgs/msg/TFMessage",
            "/lidar/roof": "sensor_msgs/msg/PointCloud2",
            "/lidar/rear": "sensor_msgs/msg/PointCloud2",
        }
        transforms, clouds, times_ns = {}, {}, []
        for connection, time_ns, content in reader.messages():
            message = reader.deserialize(content, connection.msgtype)
            times_ns.append(time_ns)
            for one in getattr(message, "transforms", ()):
                q, t = one.transform.rotation, one.transform.translation
                motion = rigid(Rotation.from_quat([q.x, q.y, q.z, q.w]).as_matrix(),
                               [t.x, t.y, t.z])  # fmt: skip
                stamp = one.header.stamp.sec * 10**9 + one.header.stamp.nanosec
                key = one.child_frame_id if connection.topic == "/tf_static" else stamp
                assert one.header.frame_id == ("map" if isinstance(key, int) else "base_link")
                transforms[key] = motion
            if connection.topic.startswith("/lidar"):
                clouds[connection.topic, time_ns] = message
    assert times_ns == sorted(times_ns)
    assert len(clouds) == 6
    for (topic, time_ns), cloud in clouds.items():
        number, name = (time_ns - START_NS) // STEP_NS, topic.removeprefix("/lidar/")
        expected = scan(number, ("roof", "rear").index(name))
        row = np.dtype([*((one, "<f4") for one in ("x", "y", "z", "intensity")),
                        ("ring", "<u2"), ("t", "<u4")])  # fmt: skip
        assert [(f.name, f.offset, f.datatype, f.count) for f in cloud.fields] == [
            ("x", 0, 7, 1), ("y", 4, 7, 1), ("z", 8, 7, 1), ("intensity", 12, 7, 1),
            ("ring", 16, 4, 1), ("t", 18, 6, 1),
        ]  # fmt: skip
        assert (cloud.height, cloud.width, cloud.point_step) == (1, len(expected.points), 22)
        assert cloud.row_step == 22 * cloud.width
        assert not cloud.is_bigendian
        assert cloud.header.frame_id == name
        table = np.frombuffer(cloud.data.tobytes(), row)
        assert np.array_equal(
            np.column_stack([table["x"], table["y"], table["z"]]), expected.points
        )
        assert np.array_equal(table["intensity"], expected.intensity)
        assert np.array_equal(table["ring"], expected.ring)
        assert np.array_equal(table["t"], expected.offset_ns)
        assert np.allclose(transforms[time_ns], pose(number), atol=1e-12)
        assert np.allclose(transforms[name], PLACES[name], atol=1e-12)
    # Every 10 ms, to the end of the last sweep.
    assert max(key for key in transforms if isinstance(key, int)) == START_NS + 3 * STEP_NS


def test_checksums_and_summary_of_a_recording(tmp_path: Path) -> None:
    """The file taken apart by the specification: offsets point at records, checksums hold."""
    drive_rig = rig("roof")
    content = (tmp_path / write(McapWriter(tmp_path, drive_rig), drive_rig, 2)).read_bytes()
    assert content[:8] == content[-8:] == b"\x89MCAP0\r\n"
    start, offsets_start, checksum = struct.unpack("<QQI", content[-28:-8])
    assert zlib.crc32(content[start:-12]) == checksum
    kinds, place = {}, offsets_start
    while content[place] == 0x0E:
        kind, group, size = struct.unpack_from("<BQQ", content, place + 9)
        kinds[kind] = (group, size)
        assert content[group] == kind
        place += 9 + struct.unpack_from("<Q", content, place + 1)[0]
    assert set(kinds) == {0x03, 0x04, 0x08, 0x0B}
    messages, schemas, channels, attachments, metadata, chunks = struct.unpack_from(
        "<QHIIII", content, kinds[0x0B][0] + 9
    )
    assert (schemas, channels, attachments, metadata, chunks) == (2, 3, 0, 0, 2)
    assert messages == 2 + 1 + 21  # clouds, static transforms, poses
    place, end = kinds[0x08][0], sum(kinds[0x08])
    for _ in range(chunks):
        size = struct.unpack_from("<Q", content, place + 1)[0]
        _, _, chunk, length = struct.unpack_from("<QQQQ", content, place + 9)
        assert content[chunk] == 0x06
        assert struct.unpack_from("<Q", content, chunk + 1)[0] == length - 9
        whole, crc = struct.unpack_from("<QI", content, chunk + 9 + 16)
        records = content[chunk + length - whole : chunk + length]
        assert zlib.crc32(records) == crc
        place += 9 + size
    assert place == end


def test_a_recording_without_a_summary_is_read_too(tmp_path: Path) -> None:
    drive_rig = rig("roof")
    path = tmp_path / write(McapWriter(tmp_path, drive_rig), drive_rig, 2)
    whole = open_drive(path)
    start = struct.unpack("<Q", path.read_bytes()[-28:-20])[0]
    path.write_bytes(path.read_bytes()[: start - 13])  # the recorder was killed
    cut = open_drive(path)
    assert np.array_equal(cut[1].points, whole[1].points)
    assert np.array_equal(cut[1].pose, whole[1].pose)


# --- PCD ---


@pytest.mark.parametrize("motion", [False, True])
def test_pypcd4_reads_the_files(motion: bool, tmp_path: Path) -> None:
    pypcd4 = pytest.importorskip("pypcd4", reason="pypcd4 is not installed")
    writer = PcdWriter(tmp_path, rig("roof"))
    writer.add(frame(0, rig("roof"), motion))
    assert tmp_path / writer.close() == tmp_path
    cloud, expected = pypcd4.PointCloud.from_path(tmp_path / "000000.pcd"), scan(0, 0, motion)
    assert cloud.fields == ("x", "y", "z", "intensity", "ring") + (("t",) if motion else ())
    assert np.array_equal(cloud.numpy(("x", "y", "z")), expected.points)
    assert np.array_equal(cloud.pc_data["ring"], expected.ring)
    assert np.array_equal(cloud.pc_data["intensity"], expected.intensity)
    if motion:
        assert np.array_equal(cloud.pc_data["t"], expected.offset_ns)


def test_times_beside_scans_are_read(tmp_path: Path) -> None:
    write(PcdWriter(tmp_path, rig("roof")), rig("roof"), 3)
    drive = open_drive(tmp_path)
    assert [drive[number].timestamp_ns - START_NS for number in (0, 1, 2)] == [0, 10**8, 2 * 10**8]
    assert tmp_path / "times.txt" in drive.metadata_files
    (tmp_path / "times.txt").write_text("0.0\n0.1\n")
    with pytest.raises(CalibrationError, match=r"times.txt has 2 lines; expected 3"):
        open_drive(tmp_path)


# --- what they share ---


def test_quaternions_are_those_of_the_rotations() -> None:
    motions = [rigid(turn(yaw, 20), [1, 2, 3]) for yaw in (-170, -20, 0, 90, 180)]
    for motion, (w, x, y, z) in zip(motions, quaternions(motions), strict=True):
        assert w >= 0
        assert np.allclose(Rotation.from_quat([x, y, z, w]).as_matrix(), motion[:3, :3], atol=1e-12)


def test_returns_inside_a_turned_box_are_counted_one_by_one() -> None:
    rng = np.random.default_rng(0)
    box = BoxRecord("a", "car", rigid(turn(37, 8), [3, -2, 1]), np.array([4.0, 2.0, 1.5]))
    points = rng.uniform(-4, 8, (4000, 3))
    count = 0
    for point in points:
        own = box.world_from_box[:3, :3].T @ (point - box.world_from_box[:3, 3])
        count += all(abs(own) <= box.size_m / 2)
    assert returns_inside(box, points) == count > 20
