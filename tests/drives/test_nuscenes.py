"""nuScenes and data sets in its schema, from tables written by hand."""

import json
import pickle

import numpy as np
import pytest
from nuscenes_writer import CAMERA, POINTS, X_RIGHT, Tables, sweep_bytes, write_scene
from scipy.spatial.transform import Rotation

from intervis.drives import nuscenes_tables, open_drive
from intervis.errors import CalibrationError, DriveError, ScanError
from intervis.transform import rigid


@pytest.mark.parametrize("place", ["", "v1.0-mini", "scene-0061", "v1.0-mini/scene-0061"])
def test_a_scene_holds_what_its_tables_hold(tmp_path, place):
    write_scene(tmp_path)
    drive = open_drive(tmp_path / place)
    assert (drive.layout, drive.name, drive.frame_numbers) == ("nuscenes", "scene-0061", (0, 1, 2))
    assert drive.camera_names == ("CAM_BACK", "CAM_FRONT")
    frame = drive[1]
    # x right, y ahead in the file; x ahead, y left in the frame. Sweep 1 has its points 1 m ahead.
    assert frame.points.tolist() == [[6, -2, 1], [1.5, 1, -1.5], [31, 0, 0.25]]
    assert frame.attributes["ring"].tolist() == [0, 1, 2]
    assert frame.timestamp_ns == 1_532_402_927_747_951_000
    # The vehicle at (100, 201, 0) looks along y; the scanner is 1 m ahead of it and 1.8 m above.
    assert np.allclose(
        frame.pose, [[0, -1, 0, 100], [1, 0, 0, 202], [0, 0, 1, 1.8], [0, 0, 0, 1]], atol=1e-9
    )


def test_the_vehicle_moves_between_sweep_and_image(tmp_path):
    """The image is 50 ms older than the sweep: the vehicle was 0.5 m farther back."""
    write_scene(tmp_path)
    frame = open_drive(tmp_path)[2]
    assert frame.image_path.name == "scene-0061-2.jpg"
    assert (frame.camera.name, frame.camera.width_px, frame.camera.height_px) == (
        "CAM_FRONT",
        1600,
        900,
    )
    assert frame.camera.projection.tolist() == [
        [1266, 0, 816, 0],
        [0, 1266, 491, 0],
        [0, 0, 1, 0],
    ]
    # The camera stands 0.7 m ahead of the scanner and 0.3 m below, less 0.5 m: 0.2 m ahead.
    assert np.allclose(frame.cam_from_velo @ [10, 2, 1, 1], [-2, -1.3, 9.8, 1])


def test_images_belong_to_the_nearest_sweeps_within_a_tenth_of_a_second(tmp_path):
    write_scene(tmp_path)
    drive = open_drive(tmp_path)
    # Sweep 1 stands at 0.1 s, the images at -0.05 and 0.15 s.
    assert [drive[n].image_path.name for n in (0, 1, 2)] == [
        "scene-0061-0.jpg",
        "scene-0061-2.jpg",
        "scene-0061-2.jpg",
    ]
    (tmp_path / "samples/CAM_FRONT/scene-0061-2.jpg").unlink()
    drive = open_drive(tmp_path)
    assert drive[2].image_path is None
    assert drive[2].camera.name == "CAM_FRONT"


def test_cameras_are_chosen_by_their_channels(tmp_path):
    write_scene(tmp_path)
    frame = open_drive(tmp_path, camera="CAM_BACK")[0]
    assert frame.camera.name == "CAM_BACK"
    assert (frame.cam_from_velo @ [-10, 0, 0, 1])[2] > 8  # what lies behind is in front of it
    with pytest.raises(DriveError, match="no camera '2'; available cameras: CAM_BACK, CAM_FRONT"):
        open_drive(tmp_path, camera="2")


def test_of_several_scenes_one_must_be_named(tmp_path):
    write_scene(tmp_path, scenes=("scene-0061", "scene-0103"))
    with pytest.raises(
        DriveError, match=r"holds 2 drives; .*: v1\.0-mini/scene-0061, v1\.0-mini/scene-0103\."
    ):
        open_drive(tmp_path)
    assert open_drive(tmp_path / "scene-0103").name == "scene-0103"
    assert open_drive(tmp_path / "v1.0-mini/scene-0061")[0].scan_path.name.startswith("scene-0061")
    with pytest.raises(DriveError, match="there is nothing at"):
        open_drive(tmp_path / "scene-9999")
    write_scene(tmp_path, version="v1.0-trainval", scenes=("scene-0061",))
    with pytest.raises(DriveError, match=r"scene-0061 twice: v1\.0-mini/.*, v1\.0-trainval/"):
        open_drive(tmp_path / "scene-0061")
    assert len(open_drive(tmp_path / "v1.0-trainval/scene-0061")) == 3


@pytest.mark.parametrize("place", ["missing", "empty", "truncated"])
def test_sweeps_that_are_missing_shift_no_number(tmp_path, caplog, place):
    write_scene(tmp_path)
    path = tmp_path / "sweeps/LIDAR_TOP/scene-0061-1.pcd.bin"
    if place == "missing":
        path.unlink()
        drive = open_drive(tmp_path)
        assert drive.frame_numbers == (0, 2)
        assert "1 of the 3 sweeps of scene-0061 do not exist" in caplog.text
        assert drive[2].pose[1, 3] == 203
        return
    path.write_bytes(path.read_bytes()[:-1] if place == "truncated" else b"")
    drive = open_drive(tmp_path)
    with pytest.raises(ScanError, match=r"scene-0061-1\.pcd\.bin (is truncated|holds no points)"):
        drive[1]
    assert len(drive[2].points) == 3


def test_a_scene_without_any_of_its_files(tmp_path):
    tables = write_scene(tmp_path)
    for path in tmp_path.rglob("*.bin"):
        path.unlink()
    with pytest.raises(DriveError, match=r"none of the scans of .*scene-0061 exists, for example"):
        open_drive(tmp_path)
    tables.tables["sample_data"] = []
    tables.write()
    with pytest.raises(DriveError, match="lists no sweep of a lidar in its tables"):
        open_drive(tmp_path)


# --- the dialect of Lyft: other axes, several scanners, times with fractions ---


def write_lyft(root):
    """One sample: a scanner on the roof that looks back, one at the front mounted upside down."""
    tables = Tables(root, "data")
    back = Rotation.from_euler("z", 180, degrees=True)
    upside_down = Rotation.from_euler("x", 180, degrees=True)
    roof = tables.sensor("LIDAR_TOP", "lidar", back, (1.2, 0, 1.8))
    front = tables.sensor("LIDAR_FRONT_LEFT", "lidar", upside_down, (3.5, 0.9, 0.5))
    tables.sensor("CAM_FRONT", "camera", CAMERA, (1, 0, 1.5), [[1, 0, 2], [0, 1, 2], [0, 0, 1]])
    scene = tables.add("scene", name="host-a101", description="", nbr_samples=1, log_token="log0")
    sample = tables.add("sample", scene_token=scene, timestamp=0)
    for name, sensor in (("lidar0", roof), ("lidar1", front)):
        time_us = 1556675185903083.25
        file = (f"lidar/{name}.bin", sample, sensor, time_us, 0, (10, 20, 30), sweep_bytes(POINTS))
        tables.file(*file)
    tables.write()
    return tables


def test_every_scanner_is_turned_to_the_vehicles_axes(tmp_path):
    write_lyft(tmp_path)
    drive = open_drive(tmp_path / "host-a101")
    frame = drive[0]
    assert drive.scanner == "LIDAR_TOP"
    assert frame.points[0].tolist() == [-2, -5, 1]  # turned by 180 degrees about z
    assert np.allclose(frame.pose, [[1, 0, 0, 11.2], [0, 1, 0, 20], [0, 0, 1, 31.8], [0, 0, 0, 1]])
    assert frame.timestamp_ns == 1_556_675_185_903_083_250
    main, other = frame.scans
    assert (main.name, other.name) == ("LIDAR_TOP", "LIDAR_FRONT_LEFT")
    assert main.points is frame.points
    assert other.points[0].tolist() == [2, -5, -1]  # about x: y and z change their signs
    assert np.allclose(other.pose[:3, 3], [13.5, 20.9, 30.5])
    assert np.allclose(other.pose[:3, :3], np.eye(3))
    assert other.timestamp_ns == frame.timestamp_ns
    assert drive.camera is None


def test_a_scanner_without_its_file_is_left_out_of_the_scans(tmp_path):
    write_lyft(tmp_path)
    (tmp_path / "lidar/lidar1.bin").unlink()
    assert [scan.name for scan in open_drive(tmp_path)[0].scans] == ["LIDAR_TOP"]
    (tmp_path / "lidar/lidar1.bin").write_bytes(b"12345")
    with pytest.raises(ScanError, match=r"lidar1\.bin is truncated"):
        _ = open_drive(tmp_path)[0].scans


def test_a_drive_of_one_scanner_has_one_scan(tmp_path):
    write_scene(tmp_path)
    frame = open_drive(tmp_path)[0]
    (scan,) = frame.scans
    assert (scan.name, scan.timestamp_ns) == ("LIDAR_TOP", frame.timestamp_ns)


def test_a_drive_of_tables_can_be_pickled(tmp_path):
    write_lyft(tmp_path)
    drive = pickle.loads(pickle.dumps(open_drive(tmp_path)))
    assert len(pickle.loads(pickle.dumps(drive[0])).scans) == 2


def test_a_tilted_scanner_keeps_its_tilt(tmp_path):
    """Whole right angles only: 30 degrees of pitch stay in the pose."""
    tables = Tables(tmp_path)
    tilt = Rotation.from_euler("y", 30, degrees=True)
    lidar = tables.sensor("LIDAR_TOP", "lidar", tilt * X_RIGHT, (0, 0, 2))
    scene = tables.add("scene", name="s", description="", nbr_samples=1, log_token="log0")
    sample = tables.add("sample", scene_token=scene, timestamp=0)
    tables.file("a.pcd.bin", sample, lidar, 5, 0, (0, 0, 0), sweep_bytes(POINTS))
    tables.write()
    frame = open_drive(tmp_path)[0]
    assert frame.points[0].tolist() == [5, -2, 1]
    assert np.allclose(frame.pose[:3, :3], tilt.as_matrix())
    mounted = open_drive(tmp_path).ego_from_velo
    assert np.allclose(mounted, rigid(tilt.as_matrix(), [0, 0, 2]))


# --- tables that break their schema ---


@pytest.mark.parametrize(("size", "block"), [(10**9, 1), (0, 10**6), (0, 300), (0, 7)])
def test_large_tables_are_searched_and_small_ones_parsed_alike(tmp_path, monkeypatch, size, block):
    """Blocks that end anywhere in a record change nothing."""
    write_scene(tmp_path, scenes=("scene-0061", "scene-0103"))
    monkeypatch.setattr(nuscenes_tables, "WHOLE_BYTES", size)
    monkeypatch.setattr(nuscenes_tables, "BLOCK_BYTES", block)
    drive = open_drive(tmp_path / "scene-0103")
    assert len(drive) == 3
    assert all(frame.scan_path.name.startswith("scene-0103") for frame in drive)
    assert drive[2].pose[1, 3] == 203


def test_a_large_table_that_breaks_off_or_nests_is_told(tmp_path, monkeypatch):
    monkeypatch.setattr(nuscenes_tables, "WHOLE_BYTES", 0)
    tables = write_scene(tmp_path)
    change(tables, "sample_data", 0, filename={"in": "a record"})
    with pytest.raises(CalibrationError, match=r"sample_data\.json is not valid JSON"):
        open_drive(tmp_path)
    write_scene(tmp_path)
    path = tmp_path / "v1.0-mini/ego_pose.json"
    path.write_bytes(path.read_bytes()[:-300])
    with pytest.raises(CalibrationError, match=r"ego_pose\.json has no record"):
        open_drive(tmp_path)


def change(tables, table, nth, **values):
    record = tables.tables[table][nth]
    for key, value in values.items():
        if value is ...:
            del record[key]
        else:
            record[key] = value
    tables.write()


@pytest.mark.parametrize(
    ("table", "values", "message"),
    [
        ("sample_data", {"ego_pose_token": "gone"}, r"ego_pose\.json has no record 'gone'"),
        ("sample_data", {"calibrated_sensor_token": "x"}, r"calibrated_sensor\.json has no rec"),
        ("sample_data", {"filename": ...}, "has no text under 'filename'"),
        ("sample_data", {"filename": "../../etc/passwd"}, "names the invalid file"),
        ("sample_data", {"filename": "/etc/passwd"}, "names the invalid file"),
        ("sample_data", {"filename": "[" * 3000}, "names the invalid file"),
        ("sample_data", {"filename": ""}, "names the invalid file"),
        ("sample_data", {"timestamp": "soon"}, "has no time in microseconds"),
        ("sample_data", {"timestamp": 1e300}, "has no time in microseconds"),
        ("sample_data", {"token": 5}, "has a record without a token"),
        ("sample_data", {"sample_token": None}, "has no text under 'sample_token'"),
        ("ego_pose", {"rotation": [0, 0, 0, 0]}, "has no quaternion under 'rotation'"),
        ("ego_pose", {"rotation": [1, 0, 0]}, "has no 4 numbers under 'rotation'"),
        ("ego_pose", {"rotation": "none"}, "has no 4 numbers under 'rotation'"),
        ("ego_pose", {"rotation": [[1], [0, 0], 0, 0]}, "has no 4 numbers under 'rotation'"),
        ("ego_pose", {"translation": [1e300, 0, 0]}, "has no 3 numbers under 'translation'"),
        ("ego_pose", {"translation": [float("nan"), 0, 0]}, "has no 3 numbers under 'tran"),
        ("calibrated_sensor", {"sensor_token": 7}, "has no text under 'sensor_token'"),
        ("sensor", {"channel": "two\nlines"}, "has a channel that is not a plain name"),
        ("sample_data", {"filename": "two\nlines"}, "names the invalid file"),
        ("sensor", {"channel": []}, "has no text under 'channel'"),
        ("scene", {"name": ...}, "has no text under 'name'"),
    ],
)
def test_tables_that_break_their_schema_are_told(tmp_path, table, values, message):
    tables = write_scene(tmp_path)
    change(tables, table, 0, **values)
    with pytest.raises(CalibrationError, match=message) as caught:
        open_drive(tmp_path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("values", [{"width": 0}, {"width": "wide"}, {"height": 1e9}])
def test_an_image_without_a_size_is_told(tmp_path, values):
    tables = write_scene(tmp_path)
    change(tables, "sample_data", 3, **values)
    with pytest.raises(CalibrationError, match="CAM_FRONT: a camera's image must have 1 to"):
        open_drive(tmp_path)


def test_a_camera_without_intrinsics_is_told(tmp_path):
    tables = write_scene(tmp_path)
    change(tables, "calibrated_sensor", 1, camera_intrinsic=[])
    with pytest.raises(CalibrationError, match="has no 3 x 3 numbers under 'camera_intrinsic'"):
        open_drive(tmp_path)


@pytest.mark.parametrize("name", ["sample", "ego_pose", "calibrated_sensor", "sensor"])
@pytest.mark.parametrize("content", [None, b"", b"[", b"{}", b"[1]", b"[" * 99999, b"\xff\xfe[]"])
def test_a_table_that_is_none_is_told(tmp_path, name, content):
    write_scene(tmp_path)
    path = tmp_path / f"v1.0-mini/{name}.json"
    path.unlink()
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(CalibrationError, match=rf"the table .*{name}\.json (is|has)"):
        open_drive(tmp_path)


@pytest.mark.parametrize("name", ["../../outside", "two\nlines", "", "..", "a" * 2000])
def test_a_scene_whose_name_is_none_is_named_by_its_token(tmp_path, name):
    tables = write_scene(tmp_path)
    change(tables, "scene", 0, name=name)
    assert open_drive(tmp_path).name == "scene0"


@pytest.mark.realdata
def test_lyfts_own_tables_are_read_to_the_end(shared_data):
    """Its sweeps are not there: the tables are, and name them."""
    with pytest.raises(DriveError, match=r"none of the scans of .*lidar[0-9]_1240710385903083166"):
        open_drive(shared_data / "nuscenes_frame/lyft_tables")


@pytest.mark.realdata
def test_a_real_sweep_lies_in_the_scanners_frame(shared_data, tmp_path):
    """frame.json holds what the devkit computed: the place of the scanner on the car."""
    frame = json.loads((shared_data / "nuscenes_frame/frame.json").read_text())["data_list"][0]
    lidar2ego = np.array(frame["lidar_points"]["lidar2ego"])
    sweep = next((shared_data / "nuscenes_frame").glob("*.pcd.bin"))
    tables = Tables(tmp_path)
    place = Rotation.from_matrix(lidar2ego[:3, :3])
    lidar = tables.sensor("LIDAR_TOP", "lidar", place, lidar2ego[:3, 3])
    scene = tables.add("scene", name="s", description="", nbr_samples=1, log_token="log0")
    sample = tables.add("sample", scene_token=scene, timestamp=0)
    tables.file("a.pcd.bin", sample, lidar, 5, 0, (0, 0, 0), sweep.read_bytes())
    tables.write()
    read = open_drive(tmp_path)[0]
    raw = np.frombuffer(sweep.read_bytes(), "<f4").reshape(-1, 5)[:, :3]
    assert np.array_equal(read.points, raw[:, [1, 0, 2]] * np.float32([1, -1, 1]))
    in_ego = raw @ lidar2ego[:3, :3].T + lidar2ego[:3, 3]
    assert np.allclose(read.points @ read.pose[:3, :3].T + read.pose[:3, 3], in_ego, atol=1e-4)
    ground = read.points[np.hypot(*read.points[:, :2].T) < 8][:, 2]
    assert -2.1 < np.quantile(ground, 0.2) < -1.6  # the scanner stands 1.84 m above the road
