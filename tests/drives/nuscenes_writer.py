"""A scene in the tables of nuScenes, written from plain numbers."""

import json
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

X_RIGHT = Rotation.from_euler("z", -90, degrees=True)
"""ego_from_sensor of nuScenes' scanner: its x looks to the vehicle's right, its y ahead."""

CAMERA = Rotation.from_matrix([[0, 0, 1], [-1, 0, 0], [0, -1, 0]])
"""ego_from_camera of a camera that looks ahead: z ahead, x right, y down."""

INTRINSICS = [[1266.0, 0, 816.0], [0, 1266.0, 491.0], [0, 0, 1]]


def quaternion(rotation):
    x, y, z, w = rotation.as_quat().tolist()
    return [w, x, y, z]


class Tables:
    """Tables that grow; every record gets a token."""

    def __init__(self, root: Path, version: str = "v1.0-mini"):
        self.root, self.folder = root, root / version
        names = ("scene", "sample", "sample_data", "ego_pose", "calibrated_sensor", "sensor", "log")
        self.tables: dict[str, list[dict]] = {name: [] for name in names}

    def add(self, table: str, **values) -> str:
        token = f"{table}{len(self.tables[table])}"
        self.tables[table].append({"token": token, **values})
        return token

    def sensor(self, channel, modality, rotation, translation, intrinsics=()):
        token = self.add("sensor", channel=channel, modality=modality)
        return self.add(
            "calibrated_sensor",
            sensor_token=token,
            rotation=quaternion(rotation),
            translation=list(translation),
            camera_intrinsic=intrinsics,
        )

    def file(self, name, sample, sensor, time_us, yaw_deg, position, content, key_frame=True):
        """A file of a sensor at a time, the vehicle at a position with a yaw."""
        turn = Rotation.from_euler("z", yaw_deg, degrees=True)
        ego = self.add(
            "ego_pose", rotation=quaternion(turn), translation=list(position), timestamp=time_us
        )
        if content is not None:
            path = self.root / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
        return self.add(
            "sample_data",
            sample_token=sample,
            ego_pose_token=ego,
            calibrated_sensor_token=sensor,
            timestamp=time_us,
            filename=name,
            is_key_frame=key_frame,
            fileformat="pcd",
            width=1600 if name.endswith((".jpg", ".png")) else 0,
            height=900 if name.endswith((".jpg", ".png")) else 0,
            prev="",
            next="",
        )

    def write(self):
        self.folder.mkdir(parents=True, exist_ok=True)
        for name, records in self.tables.items():
            (self.folder / f"{name}.json").write_text(json.dumps(records, indent=0))
        return self.folder


def sweep_bytes(points):
    """x y z intensity ring of points in the sensor's axes."""
    rows = np.column_stack([points, np.arange(len(points)), np.arange(len(points)) % 32])
    return rows.astype("<f4").tobytes()


POINTS = np.array([[2.0, 5.0, 1.0], [-1.0, 0.5, -1.5], [0.0, 30.0, 0.25]])
"""In the sensor's axes: the first is 2 m to the right, 5 m ahead, 1 m up."""


def write_scene(root: Path, version: str = "v1.0-mini", scenes=("scene-0061",)) -> Tables:
    """Scenes of two samples: three sweeps, and two images 50 ms before the samples' sweeps.

    The vehicle looks along the world's y and drives 1 m in 0.1 s, from (100, 200, 0). The scanner
    stands at (1, 0, 1.8) of it, the camera at (1.7, 0, 1.5).
    """
    tables = Tables(root, version)
    lidar = tables.sensor("LIDAR_TOP", "lidar", X_RIGHT, (1, 0, 1.8))
    front = tables.sensor("CAM_FRONT", "camera", CAMERA, (1.7, 0, 1.5), INTRINSICS)
    back = tables.sensor(
        "CAM_BACK", "camera", Rotation.from_euler("z", 180, degrees=True) * CAMERA, (0, 0, 1.5),
        INTRINSICS,
    )  # fmt: skip
    radar = tables.sensor("RADAR_FRONT", "radar", Rotation.identity(), (3, 0, 0.5))
    for name in scenes:
        scene = tables.add("scene", name=name, description="made", nbr_samples=2, log_token="log0")
        samples = [tables.add("sample", scene_token=scene, timestamp=0) for _ in range(2)]
        base_us = 1_532_402_927_647_951
        for nth in range(3):  # sweep 1 lies between the samples
            time_us = base_us + 100_000 * nth
            tables.file(
                f"{'sweeps' if nth == 1 else 'samples'}/LIDAR_TOP/{name}-{nth}.pcd.bin",
                *(samples[nth // 2], lidar, time_us, 90, (100, 200 + nth, 0)),
                sweep_bytes(POINTS + np.array([0, nth, 0])),
                nth != 1,
            )
        for nth in (0, 2):
            for sensor, channel in ((front, "CAM_FRONT"), (back, "CAM_BACK")):
                tables.file(
                    f"samples/{channel}/{name}-{nth}.jpg",
                    *(samples[nth // 2], sensor, base_us + 100_000 * nth - 50_000),
                    *(90, (100, 199.5 + nth, 0), b""),
                )
        tables.file("samples/RADAR_FRONT/1.pcd", samples[0], radar, base_us, 0, (0, 0, 0), b"")
    tables.write()
    return tables
