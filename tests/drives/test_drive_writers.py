"""What the writers of layouts write: tables, messages and files, taken apart by other programs."""

import io
import json
import struct
import sys
import zlib
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from intervis.camera import Camera
from intervis.drives import open_drive
from intervis.drives.argoverse_writer import ArgoverseWriter, check_rig
from intervis.drives.drive_writer import (
    BoxRecord,
    FrameRecord,
    ImageRecord,
    Rig,
    RigCamera,
    RigScanner,
    ScanRecord,
    jpeg_of,
    quaternions,
    returns_inside,
)
from intervis.drives.mcap_writer import McapWriter
from intervis.drives.nuscenes_table_writer import TABLES, VERSION, NuScenesTables
from intervis.drives.nuscenes_writer import NuScenesWriter, blank_png, sweep_bytes
from intervis.drives.pcd_writer import PcdWriter
from intervis.drives.pose_track import PoseTrack
from intervis.errors import CalibrationError, MissingExtraError, SettingsError
from intervis.transform import inverse, rigid, transform

START_NS = 1_700_000_000_000_000_000
STEP_NS = 100_000_000


def turn(yaw_deg: float, pitch_deg: float = 0.0, roll_deg: float = 0.0) -> np.ndarray:
    angles_deg = [yaw_deg, pitch_deg, roll_deg]
    return Rotation.from_euler("ZYX", angles_deg, degrees=True).as_matrix()


# No two numbers of a motion are the same: places that are exchanged do not go unnoticed.
PLACES = {
    "roof": rigid(turn(4, 1, -2), [0.9, -0.2, 1.8]),
    "rear": rigid(turn(170, 3, 5), [-1.0, 0.1, 0.7]),
}
CAMERA = RigCamera(
    "front",
    Camera(np.array([[300.0, 0, 31.5, 0], [0, 301, 17.5, 0], [0, 0, 1, 0]]), 64, 36),
    rigid(turn(6, -3, 2) @ [[0, 0, 1], [-1, 0, 0], [0, -1, 0]], [1.7, -0.3, 1.5]),
)


def rig(*names: str, cameras: tuple[RigCamera, ...] = ()) -> Rig:
    return Rig(tuple(RigScanner(name, "made", PLACES[name], 32) for name in names), cameras)


def pose(number: float) -> np.ndarray:
    return rigid(turn(30 + 2 * number, 2, -1.5), [100 + number, 200 - 2 * number, 3])


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


def motion_in(record: dict) -> np.ndarray:
    """The motion of a record: translation, and a quaternion w, x, y, z."""
    w, x, y, z = record["rotation"]
    return rigid(Rotation.from_quat([x, y, z, w]).as_matrix(), record["translation"])


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
            folder, ending = ("samples" if number % 5 == 0 else "sweeps"), "pcd.bin"
            assert record["fileformat"] == ("jpg" if channel == "CAM_FRONT" else "pcd")
            if channel == "CAM_FRONT":
                ending = "jpg"
            time_us = (START_NS + number * STEP_NS) // 1000 + 20_000 * (channel == "CAM_FRONT")
            name = f"scene-0001__{channel}__{time_us}.{ending}"
            assert record["filename"] == f"{folder}/{channel}/{name}"
            assert record["timestamp"] == time_us
            time_us = tables["sample"][record["sample_token"]]["timestamp"]
            assert time_us * 1000 == START_NS + number // 5 * 5 * STEP_NS
            ego = tables["ego_pose"][record["ego_pose_token"]]
            assert ego["timestamp"] == record["timestamp"]
            share = 0.2 if channel == "CAM_FRONT" else 0
            assert np.allclose(motion_in(ego), pose(number + share), rtol=0, atol=1e-9)
            assert (record["width"], record["height"]) == (
                (64, 36) if channel == "CAM_FRONT" else (0, 0)
            )


def returns_in(box: BoxRecord, number: int) -> int:
    """Returns of both scanners in a box, one by one."""
    count = 0
    for nth, name in enumerate(("roof", "rear")):
        for point in scan(number, nth).points.astype(np.float64):
            in_world = pose(number) @ PLACES[name] @ [*point, 1.0]
            own = box.world_from_box[:3, :3].T @ (in_world[:3] - box.world_from_box[:3, 3])
            count += bool((abs(own) <= box.size_m / 2).all())
    return count


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
            time_us = tables["sample"][record["sample_token"]]["timestamp"]
            number = (1000 * time_us - START_NS) // STEP_NS
            (box,) = (
                one for one in frame(number, rig()).boxes if (one.category == "car") == (
                    category == "vehicle.car"
                )
            )  # fmt: skip
            assert np.allclose(motion_in(record), box.world_from_box, rtol=0, atol=1e-9)
            assert record["num_lidar_pts"] == returns_in(box, number) > 0
    assert counts == {"vehicle.car": 2, "human.pedestrian.adult": 3}
    assert len(tables["sample_annotation"]) == 5


def test_scanners_have_x_right_and_y_forward(tables) -> None:
    x_right = [[0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]  # sensor_from_velo
    expected = {
        "LIDAR_TOP": PLACES["roof"] @ np.transpose(x_right),
        "LIDAR_BACK": PLACES["rear"] @ np.transpose(x_right),
        "CAM_FRONT": CAMERA.ego_from_cam,
    }
    for one in tables["calibrated_sensor"].values():
        sensor = tables["sensor"][one["sensor_token"]]
        channel = sensor["channel"]
        assert sensor["modality"] == ("camera" if channel == "CAM_FRONT" else "lidar")
        assert np.allclose(motion_in(one), expected.pop(channel), rtol=0, atol=1e-12)
        matrix = [[300, 0, 31.5], [0, 301, 17.5], [0, 0, 1]]
        assert one["camera_intrinsic"] == (matrix if channel == "CAM_FRONT" else [])
    assert not expected
    one = ScanRecord(np.array([[5, -2, 1]], np.float32), np.array([0.5], np.float32), np.array([7]))
    assert struct.unpack("<5f", sweep_bytes(one)) == (2, 5, 1, 128, 7)


def test_records_that_all_drives_have(tables) -> None:
    """As in nuScenes: visibilities are counted from 1, other tokens have 32 hexadecimal digits."""
    levels = {token: one["level"] for token, one in tables["visibility"].items()}
    assert levels == {"1": "v0-40", "2": "v40-60", "3": "v60-80", "4": "v80-100"}
    assert tables["visibility"]["2"]["description"] == "visibility between 40 and 60 %"
    for name in set(TABLES) - {"visibility"}:
        for token in tables[name]:
            assert len(bytes.fromhex(token)) == 16
    (log,) = tables["log"].values()
    assert (log["logfile"], log["date_captured"]) == ("scene-0001", "2023-11-14")
    (scene,) = tables["scene"].values()
    assert (scene["log_token"], scene["name"]) == (log["token"], "scene-0001")
    assert scene["description"] == "simulated street, made, made"
    (mask,) = tables["map"].values()
    assert (tables["root"] / mask["filename"]).read_bytes() == blank_png(16)
    assert mask["log_tokens"] == [log["token"]]


def test_a_scene_comes_back_as_it_was_written(tables) -> None:
    drive = open_drive(tables["root"])
    assert drive.frame_numbers == tuple(range(12))
    for number in (0, 3, 5, 10):
        found, written = drive[number], frame(number, rig("roof", "rear"))
        assert found.timestamp_ns == written.time_ns
        assert np.array_equal(found.points, scan(number, 0).points)
        assert np.array_equal(found.attributes["ring"], scan(number, 0).ring)
        of_255 = np.round(255 * scan(number, 0).intensity)
        assert np.array_equal(found.attributes["intensity"], of_255)
        assert np.allclose(found.pose, pose(number) @ PLACES["roof"], rtol=0, atol=1e-9)
        cam_from_velo = inverse(pose(number + 0.2) @ CAMERA.ego_from_cam) @ found.pose
        assert np.allclose(found.cam_from_velo, cam_from_velo, rtol=0, atol=1e-9)
        assert np.array_equal(found.camera.projection, CAMERA.camera.projection)
        _, rear = found.scans
        in_world = transform(pose(number) @ PLACES["rear"], scan(number, 1).points)
        assert np.allclose(transform(rear.pose, rear.points), in_world, rtol=0, atol=1e-5)
        boxes = {box.category: box for box in found.boxes}
        names = {"car": "vehicle.car", "person": "human.pedestrian.adult"}
        assert set(boxes) == {names[box.category] for box in written.boxes if number % 5 == 0}
        for box in written.boxes if boxes else ():
            read = boxes[names[box.category]]
            velo_from_box = inverse(found.pose) @ box.world_from_box
            assert np.allclose(read.velo_from_box, velo_from_box, rtol=0, atol=1e-9)
            assert read.size_m.tolist() == [4, 2, 1.5]


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
    for records in loaded.values():
        tokens = [record["token"] for record in records]
        assert len(set(tokens)) == len(tokens)
    # Car and person in two samples of the first scene, the person in two of the second.
    assert [one["nbr_annotations"] for one in loaded["instance"]] == [2, 2, 2]


def test_tables_that_were_interrupted_are_valid_json(tmp_path: Path) -> None:
    writer = NuScenesWriter(tmp_path, rig("roof"))
    for number in range(2):
        writer.add(frame(number, rig("roof")))
    writer.release()
    loaded = {
        name: json.loads((tmp_path / VERSION / f"{name}.json").read_text()) for name in TABLES
    }
    assert len(loaded["ego_pose"]) == 2
    assert loaded["scene"] == []  # it is not complete


def test_the_blank_mask_is_a_picture(tmp_path: Path) -> None:
    image = pytest.importorskip("PIL.Image", reason="Pillow (extra plots) is not installed")
    (tmp_path / "blank.png").write_bytes(blank_png(16))
    with image.open(tmp_path / "blank.png") as picture:
        assert (picture.size, picture.mode, picture.getextrema()) == ((16, 16), "L", (0, 0))


def test_the_blank_mask_byte_by_byte() -> None:
    """By the specification of PNG; decoders leave out to check some of it."""
    content, chunks, place = blank_png(3), [], 8
    assert content[:8] == bytes([0x89, *b"PNG", 0x0D, 0x0A, 0x1A, 0x0A])
    while place < len(content):
        (size,) = struct.unpack_from(">I", content, place)
        kind, body = content[place + 4 : place + 8], content[place + 8 : place + 8 + size]
        assert struct.unpack_from(">I", content, place + 8 + size) == (zlib.crc32(kind + body),)
        chunks.append((kind, body))
        place += 12 + size
    assert [kind for kind, _ in chunks] == [b"IHDR", b"IDAT", b"IEND"]
    # Width, height, 8 bits, grey, deflate, no filter of another kind, no interlacing.
    assert chunks[0][1] == bytes([0, 0, 0, 3, 0, 0, 0, 3, 8, 0, 0, 0, 0])
    assert zlib.decompress(chunks[1][1]) == bytes(3 * (1 + 3))  # a row begins with its filter
    assert chunks[2][1] == b""


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


def records(content: bytes, place: int, end: int):
    """Place, kind and content of each record between two places."""
    while place < end:
        kind, size = struct.unpack_from("<BQ", content, place)
        yield place, kind, content[place + 9 : place + 9 + size]
        place += 9 + size
    assert place == end


def octets_of(content: bytes, place: int) -> tuple[bytes, int]:
    """Bytes behind their number, and the place behind them."""
    (size,) = struct.unpack_from("<I", content, place)
    assert place + 4 + size <= len(content)
    return content[place + 4 : place + 4 + size], place + 4 + size


@pytest.mark.parametrize("names", [["roof"], ["rear", "roof"]])
def test_the_records_of_a_recording_agree_with_each_other(names: list[str], tmp_path: Path) -> None:
    """The whole file walked by the specification: what it says of itself in two places is one."""
    drive_rig = rig(*names)
    path = tmp_path / write(McapWriter(tmp_path, drive_rig), drive_rig, 3).parts[0]
    content = path.read_bytes()
    found = list(records(content, 8, len(content) - 8))
    kinds = [kind for _, kind, _ in found]
    assert kinds[0] == 0x01
    profile, place = octets_of(found[0][2], 0)
    library, place = octets_of(found[0][2], place)
    assert (profile, library[:9], place) == (b"ros2", b"intervis ", len(found[0][2]))
    end_of_data = kinds.index(0x0F)
    assert found[end_of_data][2] == bytes(4)
    data, summary = found[1:end_of_data], found[end_of_data + 1 :]
    for kind in (0x03, 0x04):  # the summary repeats the definitions
        of_data, of_summary = ([r for _, k, r in part if k == kind] for part in (data, summary))
        assert of_data == of_summary
    schemas, topics = {}, {}
    for _, kind, record in data:
        if kind == 0x03:
            name, place = octets_of(record, 2)
            encoding, place = octets_of(record, place)
            definition, place = octets_of(record, place)
            assert (encoding, place) == (b"ros2msg", len(record))
            assert definition.startswith((b"std_msgs/Header header", b"geometry_msgs/Transform"))
            schemas[struct.unpack_from("<H", record)[0]] = name.decode()
        elif kind == 0x04:
            number, schema = struct.unpack_from("<HH", record)
            topic, place = octets_of(record, 4)
            encoding, place = octets_of(record, place)
            assert (encoding, record[place:]) == (b"cdr", bytes(4))
            topics[number] = (topic.decode(), schemas[schema])
    assert 0 not in schemas  # reserved
    assert len(schemas) == 2
    cloud, transforms = "sensor_msgs/msg/PointCloud2", "tf2_msgs/msg/TFMessage"
    assert sorted(topics.values()) == [
        *((f"/lidar/{name}", cloud) for name in names),
        *(("/tf", transforms), ("/tf_static", transforms)),
    ]

    counts, times_ns, chunks = dict.fromkeys(topics, 0), [], []
    for nth, (start, kind, record) in enumerate(data):
        if kind != 0x06:
            continue
        first_ns, last_ns, size, checksum = struct.unpack_from("<QQQI", record)
        compression, place = octets_of(record, 28)
        inside = record[place + 8 :]
        assert struct.unpack_from("<Q", record, place) == (size,) == (len(inside),)
        assert (compression, zlib.crc32(inside)) == (b"", checksum)
        messages, of_chunk = {}, []
        for offset, message_kind, message in records(inside, 0, size):
            assert message_kind == 0x05
            number, sequence, logged_ns, published_ns = struct.unpack_from("<HIQQ", message)
            assert sequence == counts[number]
            assert logged_ns == published_ns
            counts[number] += 1
            messages.setdefault(number, []).append((logged_ns, offset))
            of_chunk.append(logged_ns)
        assert of_chunk == sorted(of_chunk)
        assert (first_ns, last_ns) == (of_chunk[0], of_chunk[-1])
        times_ns += of_chunk
        indexes = {}
        for place, _, index in data[nth + 1 : nth + 1 + len(messages)]:
            number, entries = struct.unpack_from("<H", index)[0], octets_of(index, 2)[0]
            assert list(struct.iter_unpack("<QQ", entries)) == messages[number]
            indexes[number] = place
        assert indexes.keys() == messages.keys()
        behind = data[nth + 1 + len(messages)][0] if nth + 1 + len(messages) < len(data) else None
        chunks.append((first_ns, last_ns, start, 9 + len(record), indexes, behind, size))
    assert [kind for _, kind, _ in data].count(0x07) == sum(len(chunk[4]) for chunk in chunks)
    assert len(chunks) == 3

    of_summary = [record for _, kind, record in summary if kind == 0x08]
    for record, (first_ns, last_ns, start, length, indexes, behind, size) in zip(
        of_summary, chunks, strict=True
    ):
        assert struct.unpack_from("<QQQQ", record) == (first_ns, last_ns, start, length)
        places, at = octets_of(record, 32)
        assert dict(struct.iter_unpack("<HQ", places)) == indexes
        (index_bytes,) = struct.unpack_from("<Q", record, at)
        behind = found[end_of_data][0] if behind is None else behind
        assert start + length + index_bytes == behind
        compression, at = octets_of(record, at + 8)
        assert (compression, record[at:]) == (b"", struct.pack("<QQ", size, size))
    ((statistics),) = [record for _, kind, record in summary if kind == 0x0B]
    by_channel, place = octets_of(statistics, 42)
    assert place == len(statistics)
    assert dict(struct.iter_unpack("<HQ", by_channel)) == counts
    assert struct.unpack_from("<Q", statistics) == (sum(counts.values()),)
    assert struct.unpack_from("<QQ", statistics, 26) == (min(times_ns), max(times_ns))


def test_a_recording_without_a_summary_is_read_too(tmp_path: Path) -> None:
    drive_rig = rig("roof")
    path = tmp_path / write(McapWriter(tmp_path, drive_rig), drive_rig, 2)
    whole = open_drive(path)
    start = struct.unpack("<Q", path.read_bytes()[-28:-20])[0]
    path.write_bytes(path.read_bytes()[: start - 13])  # the recorder was killed
    cut = open_drive(path)
    assert np.array_equal(cut[1].points, whole[1].points)
    assert np.array_equal(cut[1].pose, whole[1].pose)


def test_what_was_written_before_an_interruption_can_be_read(tmp_path: Path) -> None:
    drive_rig = rig("roof")
    writer = McapWriter(tmp_path, drive_rig)
    for number in range(2):
        writer.add(frame(number, drive_rig))
    writer.release()
    content = (tmp_path / "drive.mcap").read_bytes()
    assert [kind for _, kind, _ in records(content, 8, len(content))][-1] == 0x07  # an index
    drive = open_drive(tmp_path / "drive.mcap")
    assert drive.frame_numbers == (0, 1)
    assert np.array_equal(drive[1].points, scan(1, 0).points)
    assert np.allclose(drive[1].pose, pose(1) @ PLACES["roof"], rtol=0, atol=1e-9)


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


# --- Argoverse 2 ---


@pytest.fixture(scope="module")
def log(tmp_path_factory) -> Path:
    """A log of nine frames with a camera; the last two have no car."""
    pytest.importorskip("pyarrow", reason="pyarrow (extra argoverse) is not installed")
    pytest.importorskip("PIL", reason="Pillow (extra plots) is not installed")
    root = tmp_path_factory.mktemp("argoverse")
    drive_rig = rig("roof", "rear", cameras=(CAMERA,))
    assert write(ArgoverseWriter(root, drive_rig), drive_rig, 9) == Path("log-0001")
    return root / "log-0001"


def feather_rows(path: Path) -> list[dict]:
    """The rows of a Feather file, as pyarrow reads them."""
    from pyarrow import feather

    return feather.read_table(path).to_pylist()


def motion_of_row(row: dict) -> np.ndarray:
    turned = Rotation.from_quat([row[name] for name in ("qx", "qy", "qz", "qw")])
    return rigid(turned.as_matrix(), [row[name] for name in ("tx_m", "ty_m", "tz_m")])


def test_places_of_scanners_and_camera_in_a_log(log: Path) -> None:
    rows = feather_rows(log / "calibration" / "egovehicle_SE3_sensor.feather")
    places = {row["sensor_name"]: motion_of_row(row) for row in rows}
    assert list(places) == ["up_lidar", "down_lidar", "ring_front_center"]
    expected = (PLACES["roof"], PLACES["rear"], CAMERA.ego_from_cam)
    assert np.allclose(list(places.values()), expected, rtol=0, atol=1e-12)
    assert feather_rows(log / "calibration" / "intrinsics.feather") == [
        {
            "sensor_name": "ring_front_center",
            **{"fx_px": 300.0, "fy_px": 301.0, "cx_px": 31.5, "cy_px": 17.5},
            **{"k1": 0.0, "k2": 0.0, "k3": 0.0, "height_px": 36, "width_px": 64},
        }
    ]


def test_sweeps_of_a_log_hold_both_scanners_in_the_vehicles_frame(log: Path) -> None:
    """Each return is moved from its own time to that of the sweep; 16 bits round by 8 mm."""
    files = sorted((log / "sensors" / "lidar").iterdir())
    times_ns = [START_NS + number * STEP_NS for number in range(9)]
    assert [file.name for file in files] == [f"{time_ns}.feather" for time_ns in times_ns]
    for number in (0, 5):
        rows = feather_rows(files[number])
        expected = []
        for nth, name in enumerate(("roof", "rear")):
            own = scan(number, nth)
            parts = zip(own.points, own.intensity, own.ring, own.offset_ns, strict=True)
            for point, intensity, ring, offset_ns in parts:
                at_time = PLACES[name] @ [*point.astype(float), 1.0]
                moved = pose(number + offset_ns / STEP_NS) @ at_time
                at_sweep = np.linalg.solve(pose(number), moved)
                laser = ring + (0, 32)[nth]
                expected.append([*at_sweep[:3], 255 * intensity, laser, offset_ns])
        names = ["x", "y", "z", "intensity", "laser_number", "offset_ns"]
        assert list(rows[0]) == names
        found = np.array([[row[name] for name in names] for row in rows], float)
        assert found.shape == (2 * 504, 6)
        assert np.allclose(found[:, :3], np.array(expected)[:, :3], rtol=0, atol=0.009)
        assert (abs(found[:, 3] - np.array(expected)[:, 3]) <= 0.5).all()
        assert np.array_equal(found[:, 4:], np.array(expected)[:, 4:])


def test_images_of_a_log_and_poses_at_all_times(log: Path) -> None:
    from PIL import Image

    images = sorted((log / "sensors" / "cameras" / "ring_front_center").iterdir())
    assert [int(file.stem) - START_NS for file in images] == [
        number * STEP_NS + 20_000_000 for number in range(9)
    ]
    for number, file in enumerate(images):
        assert abs(np.asarray(Image.open(file)).astype(int) - number).max() <= 2
    rows = feather_rows(log / "city_SE3_egovehicle.feather")
    # The images are taken at times that the track has too: every tenth of a frame.
    assert [row["timestamp_ns"] - START_NS for row in rows] == [
        nth * STEP_NS // 10 for nth in range(91)
    ]
    for nth, row in enumerate(rows):
        assert np.allclose(motion_of_row(row), pose(nth / 10), rtol=0, atol=1e-9)


def test_annotations_of_a_log_stand_in_the_vehicles_frame(log: Path) -> None:
    rows = feather_rows(log / "annotations.feather")
    assert [(row["timestamp_ns"] - START_NS) // STEP_NS for row in rows] == [
        *(number for number in range(7) for _ in "ab"),
        *(7, 8),
    ]
    categories = {"a": "REGULAR_VEHICLE", "b": "PEDESTRIAN"}
    for row in rows:
        assert row["category"] == categories[row["track_uuid"]]
        assert [row[name] for name in ("length_m", "width_m", "height_m")] == [4, 2, 1.5]
        ego_from_box = motion_of_row(row)
        assert np.allclose(ego_from_box, rigid(turn(5), [6.0, 2, 1]), rtol=0, atol=1e-9)
        count = 0
        for point in feather_rows(log / "sensors" / "lidar" / f"{row['timestamp_ns']}.feather"):
            place = np.array([point["x"], point["y"], point["z"]], float) - ego_from_box[:3, 3]
            count += bool((abs(ego_from_box[:3, :3].T @ place) <= [2, 1, 0.75]).all())
        assert row["num_interior_pts"] == count
    assert len({row["num_interior_pts"] for row in rows}) > 2


def test_a_log_without_motion_cameras_and_boxes(tmp_path: Path) -> None:
    pytest.importorskip("pyarrow", reason="pyarrow (extra argoverse) is not installed")
    writer = ArgoverseWriter(tmp_path, rig("rear", "roof"), "drive")
    whole = frame(3, rig("rear", "roof"), motion=False)
    writer.add(FrameRecord(whole.time_ns, whole.track, whole.scans))
    assert writer.close() == Path("drive")
    writer.release()
    files = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*.*")}
    sweep = f"drive/sensors/lidar/{START_NS + 3 * STEP_NS}.feather"
    places = "drive/calibration/egovehicle_SE3_sensor.feather"
    assert files == {sweep, places, "drive/city_SE3_egovehicle.feather"}
    rows = feather_rows(tmp_path / sweep)
    assert {row["offset_ns"] for row in rows} == {0}
    first = PLACES["rear"] @ [*scan(3, 0).points[0].astype(float), 1.0]
    assert np.allclose([rows[0][name] for name in "xyz"], first[:3], atol=0.009)


def test_a_rear_camera_of_a_log_and_a_bicycle(tmp_path: Path) -> None:
    pytest.importorskip("pyarrow", reason="pyarrow (extra argoverse) is not installed")
    pytest.importorskip("PIL", reason="Pillow (extra plots) is not installed")
    rear = RigCamera("rear", CAMERA.camera, CAMERA.ego_from_cam)
    drive_rig = rig("roof", "rear", cameras=(CAMERA, rear))
    made = frame(0, drive_rig)
    box = BoxRecord("c", "bicycle", made.boxes[0].world_from_box, np.array([1.8, 0.6, 1.7]))
    writer = ArgoverseWriter(tmp_path, drive_rig)
    writer.add(FrameRecord(made.time_ns, made.track, made.scans, made.images[:1], (box,)))
    (row,) = feather_rows(tmp_path / writer.close() / "annotations.feather")
    assert (row["category"], row["length_m"], row["height_m"]) == ("BICYCLIST", 1.8, 1.7)
    cameras = tmp_path / "log-0001" / "sensors" / "cameras"
    count = {folder.name: len(list(folder.iterdir())) for folder in cameras.iterdir()}
    assert count == {"ring_front_center": 1, "ring_rear_left": 0}  # a frame may lack an image


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ((1, 32), None),
        ((32, 1), None),
        ((0, 32), r"scanners of 1 to 32 rows; made has 0\."),
        ((32, 33), r"scanners of 1 to 32 rows; made has 33\."),
        ((32,), r"takes two scanners .*, not 1\."),
        ((32, 32, 32), r"takes two scanners .*, not 3\."),
    ],
)
def test_a_log_takes_two_scanners_of_up_to_32_rows(rows, message) -> None:
    made = Rig(tuple(RigScanner("roof", "made", PLACES["roof"], count) for count in rows))
    if message is None:
        check_rig(made)
    else:
        with pytest.raises(SettingsError, match=message):
            check_rig(made)


def test_writing_a_log_without_pyarrow_names_the_extra(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'intervis\[argoverse\]'"):
        ArgoverseWriter(tmp_path, rig("roof", "rear"))
    assert not list(tmp_path.iterdir())


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


@pytest.mark.parametrize("writer", [PcdWriter, ArgoverseWriter])
def test_writers_refuse_a_rig_that_their_layout_cannot_hold(writer, tmp_path: Path) -> None:
    names = ("roof", "rear") if writer is PcdWriter else ("roof",)
    with pytest.raises(SettingsError, match=f"not {len(names)}"):
        writer(tmp_path, rig(*names))
    assert not list(tmp_path.iterdir())


def test_pictures_are_written_as_jpeg_of_quality_90() -> None:
    """The first table of quantization at quality 90 starts with a fifth of 16, rounded."""
    image = pytest.importorskip("PIL.Image", reason="Pillow (extra plots) is not installed")
    pixels = np.full((36, 64, 3), (200, 90, 30), np.uint8)
    content = jpeg_of(ImageRecord(pixels, 0, np.eye(4)))
    read = image.open(io.BytesIO(content))
    assert (read.format, read.size) == ("JPEG", (64, 36))
    assert abs(np.asarray(read).astype(int) - pixels).max() < 4
    assert read.quantization[0][0] == 3


@pytest.mark.parametrize("writer", [ArgoverseWriter, NuScenesWriter, McapWriter])
def test_a_frame_without_one_of_its_scans_is_refused(writer, tmp_path: Path) -> None:
    if writer is ArgoverseWriter:
        pytest.importorskip("pyarrow", reason="pyarrow (extra argoverse) is not installed")
    open_writer = writer(tmp_path, rig("roof", "rear"))
    with pytest.raises(ValueError, match="is shorter than"):
        open_writer.add(frame(0, rig("roof")))
    open_writer.release()


@pytest.mark.parametrize("writer", [ArgoverseWriter, McapWriter])
def test_a_track_with_more_times_than_poses_is_refused(writer, tmp_path: Path) -> None:
    if writer is ArgoverseWriter:
        pytest.importorskip("pyarrow", reason="pyarrow (extra argoverse) is not installed")
    open_writer, whole = writer(tmp_path, rig("roof", "rear")), frame(0, rig("roof", "rear"))
    track = PoseTrack(whole.track.times_ns, whole.track.poses[:-1])
    scans = tuple(ScanRecord(one.points, one.intensity, one.ring) for one in whole.scans)
    with pytest.raises(ValueError, match="is shorter than"):
        open_writer.add(FrameRecord(whole.time_ns, track, scans))
    open_writer.release()


def test_tables_take_a_scan_of_each_scanner_and_a_count_for_each_box(tmp_path: Path) -> None:
    whole = frame(0, rig("roof", "rear"))
    for made, returns in ((whole, [1]), (frame(0, rig("roof")), [1, 2])):
        tables = NuScenesTables(tmp_path, rig("roof", "rear"), "maps/blank.png")
        tables.begin_scene("scene-0001", "made", START_NS)
        with pytest.raises(ValueError, match="is shorter than"):
            tables.add(made, returns)
        tables.release()
