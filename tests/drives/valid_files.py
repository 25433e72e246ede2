"""Small valid files of all kinds that are read, each in its own drive: seeds of fuzzing."""

import io
import struct
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import numpy as np
from argoverse_writer import TIMES_NS, motions, write_log, write_table
from drive_layouts import (
    pose_line,
    write_kitti_object,
    write_kitti_odometry,
    write_kitti_raw,
    write_png,
    write_scan,
    write_text,
)
from kitti_360_writer import NAME as KITTI_360
from kitti_360_writer import write_drive as write_kitti_360
from nuscenes_writer import write_scene
from scanned_room import scanned_room
from scipy.spatial.transform import Rotation

from intervis.camera import Camera
from intervis.drives import nuscenes as nuscenes_layout
from intervis.drives import open_drive
from intervis.drives.drive_writer import (
    FrameRecord,
    ImageRecord,
    Rig,
    RigCamera,
    RigScanner,
    ScanRecord,
)
from intervis.drives.mcap_writer import McapWriter
from intervis.drives.pose_track import PoseTrack
from intervis.settings import Settings
from intervis.transform import rigid


class Target(NamedTuple):
    """`write` makes a valid drive and returns the file that is to be changed, `read` reads all."""

    write: Callable[[Path], Path]
    read: Callable[[Path], object]


def read_whole_drive(root: Path) -> int:
    """Points, cameras, poses, images, labels and fingerprint of a drive."""
    drive = open_drive(root)
    count = 0
    for frame in drive:
        count += len(frame.points) + len(repr(frame))
        _ = (frame.viewpoint_velo, frame.image, frame.point_classes, frame.timestamp_s)
        count += len(frame.boxes)
        count += sum(len(scan.points) for scan in frame.scans)
    return count + len(drive.fingerprint()["digest"])


def room(count: int = 100) -> np.ndarray:
    return scanned_room(beams=2, step_deg=2.0)[:count]


def scan_file(name: str, content: bytes) -> Target:
    def write(folder: Path) -> Path:
        path = folder / name
        path.write_bytes(content)
        return path

    return Target(write, read_whole_drive)


def pcd(data: str, viewpoint: str = "1 2 0.5 0.9 0.1 0 0.3") -> bytes:
    points = room().astype("<f4")
    ring, normal = np.arange(len(points), dtype="<u2"), points[:, [2, 0]].copy()
    head = (
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z ring _ normal\n"
        "SIZE 4 4 4 2 1 4\nTYPE F F F U U F\nCOUNT 1 1 1 1 2 2\n"
        f"WIDTH {len(points)}\nHEIGHT 1\nVIEWPOINT {viewpoint}\nPOINTS {len(points)}\nDATA {data}\n"
    ).encode()
    if data == "ascii":
        rows = zip(points.tolist(), ring.tolist(), normal.tolist(), strict=True)
        lines = (f"{x} {y} {z} {nth} 0 0 {a} {b}\n" for (x, y, z), nth, (a, b) in rows)
        return head + "".join(lines).encode()
    if data == "binary":
        rows = zip(points, ring, normal, strict=True)
        return head + b"".join(
            point.tobytes() + nth.tobytes() + b"\0\0" + pair.tobytes() for point, nth, pair in rows
        )
    columns = points.T.tobytes() + ring.tobytes() + bytes(2 * len(points)) + normal.tobytes()
    runs = [columns[start : start + 32] for start in range(0, len(columns), 32)]
    packed = b"".join(bytes([len(run) - 1]) + run for run in runs)
    return head + struct.pack("<II", len(packed), len(columns)) + packed


def ply(form: str) -> bytes:
    points = room()
    head = (
        f"ply\nformat {form} 1.0\ncomment made by hand\nelement face 2\n"
        "property list uchar int vertex_indices\n"
        f"element vertex {len(points)}\nproperty float x\nproperty double y\nproperty float z\n"
        "property uchar ring\nproperty list uchar short near\nend_header\n"
    ).encode()
    if form == "ascii":
        lines = (f"{x} {y} {z} {nth % 256} 2 3 4\n" for nth, (x, y, z) in enumerate(points))
        return head + b"3 0 1 2\n4 0 1 2 3\n" + "".join(lines).encode()
    order = ">" if "big" in form else "<"
    faces = struct.pack(order + "B3iB4i", 3, 0, 1, 2, 4, 0, 1, 2, 3)
    return (
        head
        + faces
        + b"".join(
            struct.pack(order + "fdfBB2h", x, y, z, nth % 256, 2, 3, 4)
            for nth, (x, y, z) in enumerate(points)
        )
    )


def floats(width: int) -> bytes:
    points = room()
    ring = np.arange(len(points)) % 32
    columns = [points, *(np.stack([ring / 32, ring])[: width - 3])]
    return np.column_stack(columns).astype("<f4").tobytes()


def npy(kind: str) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, room().astype(kind))
    return buffer.getvalue()


def kitti_raw(name: str, text: str | None = None) -> Target:
    """A drive of KITTI raw, of which one text file is changed."""

    def write(folder: Path) -> Path:
        root = write_kitti_raw(folder, scans=(0, 1))
        path = root / name
        return path if text is None else write_text(path, text)

    return Target(write, lambda folder: read_whole_drive(folder))


def odometry(name: str) -> Target:
    def write(folder: Path) -> Path:
        root = write_kitti_odometry(folder)
        write_text(root / "poses.txt", f"{pose_line(0)}\n{pose_line(0, 0, 3)}\n")
        write_text(root / "times.txt", "0.5\n1700000000.6\n")
        np.arange(5, dtype="<u4").tofile(write_text(root / "labels/000001.label", ""))
        return root / name

    return Target(write, read_whole_drive)


def tracking(name: str, text: str) -> Target:
    def write(folder: Path) -> Path:
        base = folder / "training"
        write_scan(base / "velodyne/0000/000000.bin", 0)
        calibration = (
            "P0: 7 0 6 3 0 7 1 0 0 0 1 0\nP2: 7 0 6 3 0 7 1 0 0 0 1 0\n"
            "R_rect 1 0 0 0 1 0 0 0 1\nTr_velo_cam 0 -1 0 0 0 0 -1 0 1 0 0 0\n"
            "Tr_imu_velo 1 0 0 0 0 1 0 0 0 0 1 0\n"
        )
        write_text(base / "calib/0000.txt", calibration)
        write_text(base / "oxts/0000.txt", "48.1 8.2 100.5 0.1 0.2 0.3\n")
        return write_text(base / name, text or calibration)

    return Target(write, read_whole_drive)


def kitti_object(name: str) -> Target:
    return Target(lambda folder: write_kitti_object(folder, scans=(0, 1)) / name, read_whole_drive)


def stations_3dtk(name: str) -> Target:
    def write(folder: Path) -> Path:
        rows = "".join(f"{x} {y} {z} 0.5\n" for x, y, z in (100 * room(40)).tolist())
        write_text(folder / "scan001.3d", rows)
        write_text(folder / "scan001.pose", "100 -20.5 3e1\n0.1 90 -7\n")
        return folder / name

    return Target(write, read_whole_drive)


def ptx() -> str:
    """Two stations of 5 x 4 points."""
    head = "5\n4\n1 2 3\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n{} 3 1\n"
    rows = "".join(f"{x:.6f} {y:.6f} {z:.6f} 0.5 1 2 3\n" for x, y, z in room(20).tolist())
    return head.format("1 2") + rows + head.format("0 0") + rows


def nuscenes(name: str) -> Target:
    def write(folder: Path) -> Path:
        tables = write_scene(folder)
        sample = tables.tables["sample"][0]["token"]
        tables.tables |= {"sample_annotation": [], "instance": [], "category": []}
        category = tables.add("category", name="vehicle.car")
        tables.add(
            "sample_annotation",
            sample_token=sample,
            instance_token=tables.add("instance", category_token=category),
            translation=[100, 205, 1],
            rotation=[0.9, 0, 0, 0.1],
            size=[1.8, 4.5, 1.5],
            num_lidar_pts=17,
        )
        tables.write()
        for path in folder.rglob("*.jpg"):  # written without content
            path.unlink()
        return tables.folder / f"{name}.json"

    def read(folder: Path) -> int:
        nuscenes_layout._annotations.cache_clear()
        return read_whole_drive(folder / "scene-0061")

    return Target(write, read)


def argoverse(name: str) -> Target:
    def write(folder: Path) -> Path:
        root = write_log(folder)
        for path in root.rglob("*.jpg"):  # written without content
            path.unlink()
        still = (Rotation.identity(), [0, 0, 0])
        write_table(
            root / "annotations.feather",
            timestamp_ns=np.array(TIMES_NS),
            track_uuid=["a", "b"],
            category=["BICYCLE", "DOG"],
            length_m=[1.6, 0.8],
            width_m=[0.5, 0.3],
            height_m=[1.25, 0.6],
            num_interior_pts=[24, 0],
            **motions(still, still),
        )
        return root / name

    return Target(write, read_whole_drive)


def e57_file(folder: Path) -> Path:
    import pye57

    path = folder / "0.e57"
    file = pye57.E57(str(path), mode="w")
    data = {f"cartesian{axis}": room()[:, nth] for nth, axis in enumerate("XYZ")}
    file.write_scan_raw(data, rotation=np.array([1.0, 0, 0, 0]), translation=np.ones(3))
    file.close()
    return path


def cloud_message(folder: Path) -> Path:
    """A PointCloud2 in CDR: rows of x, y, z as float32 and a time."""
    points = room(40)
    head = struct.pack("<iII5s3x", 3, 4, 5, b"roof\0") + struct.pack("<III", 2, 20, 4)
    for nth, (name, kind) in enumerate(zip(b"xyzt", (7, 7, 7, 6), strict=True)):
        head += struct.pack("<I2s2xIB3xI", 2, bytes([name, 0]), 4 * nth, kind, 1)
    rows = np.column_stack([points, np.arange(40)]).astype("<f4").tobytes()
    head += struct.pack("<B3xIII", 0, 16, 16 * 20, len(rows))
    path = folder / "0.cdr"
    path.write_bytes(b"\0\1\0\0" + head + rows + b"\0")
    return path


def camera_message(folder: Path) -> Path:
    """A recording in MCAP of two clouds with an image and its calibration, not compressed."""
    looks = rigid(np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]]), np.array([1.0, 0, 1]))
    camera = Camera(np.array([[9.0, 0, 8, 0], [0, 9, 5, 0], [0, 0, 1, 0]]), 16, 10)
    rig = Rig((RigScanner("roof", "made", np.eye(4), 0),), (RigCamera("front", camera, looks),))
    writer = McapWriter(folder, rig)
    for nth in range(2):
        track = PoseTrack(np.array([0, 10**8]) + nth * 10**8, [np.eye(4)] * 2)
        scan = ScanRecord(room(40).astype(np.float32), np.ones(40, np.float32))
        image = ImageRecord(np.full((10, 16, 3), 90, np.uint8), nth * 10**8, np.eye(4))
        writer.add(FrameRecord(nth * 10**8, track, (scan,), (image,)))
    return folder / writer.close()


def ros_bag(kind: str, compression: str = "") -> Target:
    """A recording of two clouds with a tree of transforms and odometry."""

    def write(folder: Path) -> Path:
        from bag_writer import Recorder, recording_path

        path = recording_path(folder, kind)
        with Recorder(path, kind, compression) as recorder:
            recorder.write_transform("base_link", "velodyne", np.eye(4), 0, "/tf_static")
            for nth in range(2):
                moved = rigid(np.eye(3), [nth, 0, 0])
                recorder.write_transform("odom", "base_link", moved, nth * 10**8)
                recorder.write_odometry(moved, nth * 10**8)
                recorder.write_cloud(room(40), nth * 10**8)
        if kind == "ros1":
            return path
        (stored,) = (file for file in path.iterdir() if file.suffix in (".mcap", ".db3"))
        return stored

    return Target(
        write,
        lambda folder: read_whole_drive(folder / ("drive.bag" if kind == "ros1" else "drive")),
    )


def kitti_360(name: str) -> Target:
    def write(folder: Path) -> Path:
        write_kitti_360(folder)
        return folder / name

    return Target(write, read_whole_drive)


def las(name: str) -> Target:
    """Points of half a second, and where the scanner was."""

    def write(folder: Path) -> Path:
        import laspy

        points = room(80)
        file = laspy.LasData(laspy.LasHeader(point_format=6, version="1.4"))
        file.x, file.y, file.z = points.T
        file.gps_time = 5 + np.linspace(0, 0.5, len(points))
        stored = name if name != "0.txt" else "0.las"
        file.write(str(folder / stored))
        write_text(folder / "0.txt", "time x y z\n4 0 0 1\n5 1.5 0 1\n6 3 0.5 1\n")
        return folder / name

    return Target(write, read_whole_drive)


NUSCENES_TABLES = (
    "scene",
    "sample",
    "sample_data",
    "ego_pose",
    "calibrated_sensor",
    "sensor",
    "sample_annotation",
    "instance",
    "category",
)


LABEL = "Car 0.00 0 1.85 387 181 423 203 1.5 1.6 4 2 1.7 10 1.57"


def kitti_labels() -> Target:
    def write(folder: Path) -> Path:
        root = write_kitti_object(folder, scans=(0, 1))
        return write_text(root / "label_2/000000.txt", f"{LABEL}\nDontCare -1 -1 -10\n{LABEL}\n")

    return Target(write, read_whole_drive)


def image(name: str, save: Callable[[Path], None]) -> Target:
    def write(folder: Path) -> Path:
        root = write_kitti_object(folder, scans=(0,))
        (root / "image_2/000000.png").unlink()
        path = root / "image_2" / name
        save(path)
        return path

    return Target(write, read_whole_drive)


def save_jpeg(path: Path) -> None:
    from PIL import Image

    Image.new("RGB", (24, 16), (200, 30, 90)).save(path)


def settings_file(folder: Path) -> Path:
    return write_text(folder / "settings.toml", Settings(tau=20).to_toml())


TARGETS = {
    "bin of four": scan_file("0.bin", floats(4)),
    "bin of five": scan_file("0.bin", floats(5)),
    "pcd.bin": scan_file("0.pcd.bin", floats(5)),
    "npy float32": scan_file("0.npy", npy("<f4")),
    "npy float64": scan_file("0.npy", npy("<f8")),
    "pcd ascii": scan_file("0.pcd", pcd("ascii")),
    "pcd binary": scan_file("0.pcd", pcd("binary")),
    "pcd compressed": scan_file("0.pcd", pcd("binary_compressed", "0 0 0 1 0 0 0")),
    "ply ascii": scan_file("0.ply", ply("ascii")),
    "ply little endian": scan_file("0.ply", ply("binary_little_endian")),
    "ply big endian": scan_file("0.ply", ply("binary_big_endian")),
    "poses": kitti_raw("poses.txt", f"{pose_line(0)}\n{pose_line(1.5, -2, 1e-3)}\n"),
    "timestamps": kitti_raw(
        "velodyne_points/timestamps.txt", "2011-09-26 13:02:25.967790592\n" * 2
    ),
    "oxts": kitti_raw("oxts/data/0000000000.txt", "48.1 8.2 100.5 0.1 0.2 0.3 1 2\n"),
    "calibration of cameras": kitti_raw("../calib_cam_to_cam.txt"),
    "calibration of the scanner": kitti_raw("../calib_velo_to_cam.txt"),
    "odometry calibration": odometry("calib.txt"),
    "odometry poses": odometry("poses.txt"),
    "odometry times": odometry("times.txt"),
    "labels": odometry("labels/000001.label"),
    "tracking calibration": tracking("calib/0000.txt", ""),
    "tracking oxts": tracking("oxts/0000.txt", "48.1 8.2 100.5 0.1 0.2 0.3\n"),
    "object labels": kitti_labels(),
    "tracking labels": tracking("label_02/0000.txt", f"0 3 {LABEL}\n0 -1 {LABEL}\n1 3 {LABEL}\n"),
    "object calibration": kitti_object("calib/000000.txt"),
    "KITTI-360 poses": kitti_360(f"data_poses/{KITTI_360}/poses.txt"),
    "KITTI-360 scanner": kitti_360("calibration/calib_cam_to_velo.txt"),
    "KITTI-360 places": kitti_360("calibration/calib_cam_to_pose.txt"),
    "KITTI-360 cameras": kitti_360("calibration/perspective.txt"),
    "3dtk": stations_3dtk("scan001.3d"),
    "3dtk pose": stations_3dtk("scan001.pose"),
    "ptx": scan_file("0.ptx", ptx().encode()),
    **{f"nuScenes {name}": nuscenes(name) for name in NUSCENES_TABLES},
    "PointCloud2": Target(cloud_message, read_whole_drive),
    "png": image("000000.png", lambda path: write_png(path, 24, 16, grey=77)),
    "jpeg": image("000000.jpg", save_jpeg),
    "settings": Target(settings_file, lambda folder: Settings.from_toml(folder / "settings.toml")),
}
if find_spec("pyarrow"):  # extra argoverse
    TARGETS |= {
        "Argoverse sweep": argoverse(f"sensors/lidar/{TIMES_NS[1]}.feather"),
        "Argoverse poses": argoverse("city_SE3_egovehicle.feather"),
        "Argoverse places": argoverse("calibration/egovehicle_SE3_sensor.feather"),
        "Argoverse annotations": argoverse("annotations.feather"),
        "Argoverse intrinsics": argoverse("calibration/intrinsics.feather"),
    }
if find_spec("pye57"):  # extra e57
    TARGETS["e57"] = Target(e57_file, read_whole_drive)
if find_spec("rosbags"):  # writes the recordings, with the libraries of the extra ros
    TARGETS |= {
        "ros1 bag": ros_bag("ros1"),
        "ros1 bag lz4": ros_bag("ros1", "lz4"),
        "ros2 database": ros_bag("sqlite3"),
        "ros2 database zstd": ros_bag("sqlite3", "message"),
        "mcap": ros_bag("mcap"),
        "mcap with a camera": Target(camera_message, read_whole_drive),
        "mcap zstd": ros_bag("mcap", "storage"),
    }
if find_spec("laspy") and find_spec("lazrs"):  # extra las
    TARGETS |= {name: las(f"0.{name}") for name in ("las", "laz")}
    TARGETS["trajectory"] = las("0.txt")
"""Targets by name."""
