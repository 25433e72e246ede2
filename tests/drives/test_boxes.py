"""Boxes of objects, from the labels of KITTI, nuScenes and Argoverse 2, worked out by hand."""

import json

import numpy as np
import pytest
from argoverse_writer import TIMES_NS, motions, write_log, write_table
from drive_layouts import (
    OBJECT_CALIBRATION,
    TR,
    write_kitti_object,
    write_scan,
    write_text,
)
from nuscenes_writer import quaternion, write_scene
from scipy.spatial.transform import Rotation

from intervis.drives import nuscenes, open_drive
from intervis.errors import CalibrationError
from intervis.transform import transform

# Height 1.5, width 1.6, length 4; the bottom's middle 2 m to the right, 1.7 m down, 10 m ahead.
ALONG = "Car 0.00 0 1.85 387 181 423 203 1.5 1.6 4 2 1.7 10 {angle}"
STRAIGHT = OBJECT_CALIBRATION.replace("R0_rect: 0 1 0 -1 0 0 0 0 1", "R0_rect: 1 0 0 0 1 0 0 0 1")


@pytest.mark.parametrize(
    ("angle", "forward"), [(0, [0, -1, 0]), (np.pi / 2, [-1, 0, 0]), (-np.pi / 2, [1, 0, 0])]
)
def test_a_label_of_kitti(tmp_path, angle, forward):
    """The camera stands 0.27 m ahead of the scanner and 0.08 m below it, and looks along x."""
    root = write_kitti_object(tmp_path, scans=(0, 3))
    write_text(root / "calib/000003.txt", STRAIGHT)
    text = (
        f"{ALONG.format(angle=angle)}\nDontCare -1 -1 -10 5 5 9 9 -1 -1 -1 -1000 -1000 -1000 -10\n"
    )
    write_text(root / "label_2/000003.txt", text)
    drive = open_drive(root)
    (box,) = drive[3].boxes
    assert (box.category, box.track, box.returns) == ("Car", "", None)
    assert box.size_m.tolist() == [4, 1.6, 1.5]
    # The centre lies 0.75 m above the bottom: 0.95 m below the camera.
    assert np.allclose(box.velo_from_box[:3, 3], [10.27, -2, -0.95 - 0.08])
    # At angle 0 the length lies along the camera's x, to the right; a positive angle turns it here.
    assert np.allclose(box.velo_from_box[:3, 0], forward, atol=1e-12)
    assert np.allclose(box.velo_from_box[:3, 2], [0, 0, 1])
    assert np.isclose(np.linalg.det(box.velo_from_box), 1)
    assert drive[0].boxes == ()


def test_labels_of_kitti_tracking_belong_to_frames_and_tracks(tmp_path):
    base = tmp_path / "training"
    for number in (0, 2):
        write_scan(base / f"velodyne/0000/{number:06d}.bin", number)
    calibration = f"P2: 7 0 6 0 0 7 2 0 0 0 1 0\nR_rect 1 0 0 0 1 0 0 0 1\nTr_velo_cam {TR}\n"
    write_text(base / "calib/0000.txt", calibration)
    lines = [
        f"{frame} {track} {ALONG.format(angle=0)}" for frame, track in ((0, 5), (1, 5), (2, 7))
    ]
    write_text(base / "label_02/0000.txt", "\n".join([*lines, "2 -1 DontCare -1 -1 -10 1 1 2 2"]))
    drive = open_drive(base)
    assert [box.track for box in drive[0].boxes] == ["5"]
    assert [box.track for box in drive[2].boxes] == ["7"]


@pytest.mark.parametrize(
    "line", ["Car 1 2", "Car" + " 1" * 13, "Car" + " x" * 14, "Car" + " 1e9" * 14]
)
def test_a_label_that_is_none_is_told(tmp_path, line):
    root = write_kitti_object(tmp_path)
    write_text(root / "label_2/000000.txt", f"\n{line}\n")
    with pytest.raises(CalibrationError, match=r"000000\.txt, line 2: "):
        _ = open_drive(root)[0].boxes


def annotate(tables, **changes):
    """A car 5 m ahead of the vehicle's first place, which looks along y as the vehicle does."""
    (sample, *_) = [record["token"] for record in tables.tables["sample"]]
    values = {
        "sample_token": sample,
        "instance_token": "instance0",
        "translation": [100, 205, 1],
        "rotation": quaternion(Rotation.from_euler("z", 90, degrees=True)),
        "size": [1.8, 4.5, 1.5],
        "num_lidar_pts": 17,
        **changes,
    }
    tables.tables["sample_annotation"] = [{"token": "annotation0", **values}]
    tables.tables["instance"] = [{"token": "instance0", "category_token": "category0"}]
    tables.tables["category"] = [{"token": "category0", "name": "vehicle.car"}]
    tables.write()
    nuscenes._annotations.cache_clear()


def test_boxes_of_nuscenes_stand_at_key_frames(tmp_path):
    annotate(write_scene(tmp_path))
    drive = open_drive(tmp_path)
    (box,) = drive[0].boxes
    assert (box.category, box.track, box.returns) == ("vehicle.car", "instance0", 17)
    assert box.size_m.tolist() == [4.5, 1.8, 1.5]  # width, length, height in the table
    # The scanner stands 1 m ahead of the vehicle and 1.8 m above it.
    assert np.allclose(box.velo_from_box[:3, 3], [4, 0, -0.8])
    assert np.allclose(box.velo_from_box[:3, :3], np.eye(3))
    assert drive[1].boxes == ()  # no key frame
    assert drive[2].boxes == ()  # another sample


def test_attributes_of_nuscenes_have_their_names(tmp_path):
    tables = write_scene(tmp_path)
    tables.tables["attribute"] = [
        {"token": "a", "name": "vehicle.moving"},
        {"token": "b", "name": "vehicle.parked"},
    ]
    annotate(tables, attribute_tokens=["b", "not in the table"])
    assert open_drive(tmp_path)[0].boxes[0].attributes == ("vehicle.parked",)
    (tmp_path / "v1.0-mini" / "attribute.json").unlink()
    nuscenes._annotations.cache_clear()
    assert open_drive(tmp_path)[0].boxes[0].attributes == ()


def test_lyft_states_no_number_of_returns(tmp_path):
    annotate(write_scene(tmp_path), num_lidar_pts=-1)
    assert open_drive(tmp_path)[0].boxes[0].returns is None


def test_a_scene_without_annotations_has_no_boxes(tmp_path):
    write_scene(tmp_path)
    assert open_drive(tmp_path)[0].boxes == ()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"size": [1, 2]}, "has no 3 numbers under 'size'"),
        ({"instance_token": "gone"}, r"instance\.json has no record 'gone'"),
        ({"rotation": [0, 0, 0, 0]}, "has no quaternion"),
    ],
)
def test_annotations_that_break_their_schema_are_told(tmp_path, changes, message):
    annotate(write_scene(tmp_path), **changes)
    frame = open_drive(tmp_path)[0]
    with pytest.raises(CalibrationError, match=message):
        _ = frame.boxes


@pytest.fixture
def annotated_log(tmp_path):
    pytest.importorskip("pyarrow", reason="pyarrow (extra argoverse) is not installed")
    write_log(tmp_path)
    left = Rotation.from_euler("z", 90, degrees=True)
    write_table(
        tmp_path / "annotations.feather",
        timestamp_ns=np.array([TIMES_NS[0], TIMES_NS[1]]),
        track_uuid=["a", "b"],
        category=["BICYCLE", "DOG"],
        length_m=[1.6, 0.8],
        width_m=[0.5, 0.3],
        height_m=[1.25, 0.6],
        num_interior_pts=[24, 0],
        **motions((left, [6.0, 2, 0.5]), (left, [3.0, 0, 0])),
    )
    return tmp_path


def test_boxes_of_argoverse_stand_in_the_vehicles_frame(annotated_log):
    first, second = open_drive(annotated_log)
    (box,) = first.boxes
    assert (box.category, box.track, box.returns) == ("BICYCLE", "a", 24)
    assert box.size_m.tolist() == [1.6, 0.5, 1.25]
    # In the city: the vehicle at (100, 200, 3) looks along y, the bicycle to the vehicle's left.
    city_from_box = first.pose @ box.velo_from_box
    assert np.allclose(city_from_box[:3, 3], [98, 206, 3.5])
    assert np.allclose(city_from_box[:3, 0], [-1, 0, 0])
    assert [box.category for box in second.boxes] == ["DOG"]


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ({"timestamp_ns": [1]}, "has no column track_uuid category"),
        ({"timestamp_ns": ["a"], "track_uuid": ["a"], "category": ["b"]}, "no times in whole"),
        ({"timestamp_ns": [1], "track_uuid": ["a"], "category": ["b"]}, "has no column length_m"),
    ],
)
def test_annotations_of_argoverse_without_their_columns_are_told(annotated_log, columns, message):
    write_table(annotated_log / "annotations.feather", **columns)
    frame = open_drive(annotated_log)[0]
    with pytest.raises(CalibrationError, match=message):
        _ = frame.boxes


@pytest.mark.realdata
def test_real_boxes_of_argoverse_hold_the_returns_that_they_state(shared_data):
    """Their number was counted by Argoverse over both scanners: ours agrees, box by box."""
    pytest.importorskip("pyarrow", reason="pyarrow (extra argoverse) is not installed")
    frame = open_drive(shared_data / "av2")[0]
    city_points = np.concatenate([transform(scan.pose, scan.points) for scan in frame.scans])
    city_from_velo = frame.pose
    same = 0
    for box in frame.boxes:
        city_from_box = city_from_velo @ box.velo_from_box
        local = (city_points - city_from_box[:3, 3]) @ city_from_box[:3, :3]
        same += abs(int((np.abs(local) <= box.size_m / 2).all(axis=1).sum()) - box.returns) <= 1
    assert same > 0.95 * len(frame.boxes) > 70


@pytest.mark.realdata
def test_real_boxes_of_kitti_hold_returns(shared_data):
    drive = open_drive(shared_data / "kitti_object")
    for frame in drive:
        for box in frame.boxes:
            local = (frame.points - box.velo_from_box[:3, 3]) @ box.velo_from_box[:3, :3]
            assert (np.abs(local) <= box.size_m / 2).all(axis=1).sum() > 5


@pytest.mark.realdata
def test_real_boxes_of_nuscenes_hold_the_returns_that_they_state(shared_data, tmp_path):
    """frame.json has boxes in the scanner's axes of the file, with their number of returns."""
    from nuscenes_writer import X_RIGHT, Tables

    whole = json.loads((shared_data / "nuscenes_frame/frame.json").read_text())
    instances = whole["data_list"][0]["instances"]
    sweep = next((shared_data / "nuscenes_frame").glob("*.pcd.bin"))
    tables = Tables(tmp_path)
    lidar = tables.sensor("LIDAR_TOP", "lidar", X_RIGHT, (0, 0, 0))
    scene = tables.add("scene", name="s", description="", nbr_samples=1, log_token="log0")
    sample = tables.add("sample", scene_token=scene, timestamp=0)
    tables.file("a.pcd.bin", sample, lidar, 5, 0, (0, 0, 0), sweep.read_bytes())
    names = ("sample_annotation", "instance", "category")
    tables.tables |= {name: [] for name in names}
    category = tables.add("category", name="any")
    for one in instances:
        x, y, z, length, width, height, yaw = one["bbox_3d"]
        world_from_box = X_RIGHT * Rotation.from_euler("z", yaw)
        tables.add(
            "sample_annotation",
            sample_token=sample,
            instance_token=tables.add("instance", category_token=category),
            translation=X_RIGHT.apply([x, y, z]).tolist(),
            rotation=quaternion(world_from_box),
            size=[width, length, height],
            num_lidar_pts=one["num_lidar_pts"],
        )
    tables.write()
    frame = open_drive(tmp_path)[0]
    assert len(frame.boxes) == 69
    counted = []
    for box in frame.boxes:
        local = (frame.points - box.velo_from_box[:3, 3]) @ box.velo_from_box[:3, :3]
        counted.append(int((np.abs(local) <= box.size_m / 2 + 1e-3).all(axis=1).sum()))
    stated = [box.returns for box in frame.boxes]
    assert np.corrcoef(counted, stated)[0, 1] > 0.99
