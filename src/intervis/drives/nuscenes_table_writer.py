"""Writing the tables of nuScenes' schema, record by record: millions of records need no memory.

Records of one sensor, of one object and of one scene name their predecessor and their successor;
each is held back until its successor is known. Tokens are digests of what they name, so the same
drive has the same tokens. Schema: nuscenes.org/nuscenes#data-format
"""

import hashlib
import json
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from intervis.arrays import Float64Array
from intervis.drives.drive_writer import BoxRecord, FrameRecord, Rig, quaternions
from intervis.drives.vehicle_axes import X_RIGHT

VERSION = "v1.0-mini"
FRAMES_PER_SAMPLE = 5
"""Every fifth frame is a key frame, two a second at 10 Hz."""

CATEGORIES = {
    "car": "vehicle.car",
    "bicycle": "vehicle.bicycle",
    "person": "human.pedestrian.adult",
}
VISIBILITY = ("v0-40", "v40-60", "v60-80", "v80-100")
TABLES = (
    *("attribute", "calibrated_sensor", "category", "ego_pose", "instance", "log", "map"),
    *("sample", "sample_annotation", "sample_data", "scene", "sensor", "visibility"),
)


def channel_of(name: str, modality: str) -> str:
    """The channel of a sensor by where it is mounted.

    Examples
    --------
    >>> channel_of("roof", "lidar"), channel_of("rear", "camera")
    ('LIDAR_TOP', 'CAM_BACK')
    """
    place = {"roof": "TOP", "rear": "BACK"}.get(name, name.upper().replace("-", "_"))
    return f"{'LIDAR' if modality == 'lidar' else 'CAM'}_{place}"


def token_of(*parts: object) -> str:
    """32 hexadecimal digits for what some words name."""
    return hashlib.blake2b("\n".join(map(str, parts)).encode(), digest_size=16).hexdigest()


def file_name(scene: str, channel: str, time_ns: int, key_frame: bool) -> str:
    """Path of a sensor's file below the root of the data."""
    folder, ending = ("samples" if key_frame else "sweeps"), "jpg"
    if channel.startswith("LIDAR"):
        ending = "pcd.bin"
    return f"{folder}/{channel}/{scene}__{channel}__{time_ns // 1000}.{ending}"


class NuScenesTables:
    """The thirteen tables in a folder.

    Parameters
    ----------
    folder : Path
        Exists; the tables are made in it.
    rig : Rig
    map_file : str
        The mask that the table ``map`` names.
    frames_per_sample : int
        Every so many frames one is a key frame.
    """

    def __init__(
        self, folder: Path, rig: Rig, map_file: str, frames_per_sample: int = FRAMES_PER_SAMPLE
    ) -> None:
        self._rig, self._map_file = rig, map_file
        self._frames_per_sample = frames_per_sample
        self._files = {name: _TableFile(folder / f"{name}.json") for name in TABLES}
        self._held: dict[tuple[str, str], dict[str, Any]] = {}
        self._instances: dict[str, dict[str, Any]] = {}
        self._logs: list[str] = []
        self._scene: dict[str, Any] = {}
        self._frames = 0
        self._sample = ""
        for level, name in enumerate(VISIBILITY, start=1):
            text = f"visibility between {name[1:].replace('-', ' and ')} %"
            self._write("visibility", str(level), level=name, description=text)
        for category in CATEGORIES.values():
            self._write("category", token_of("category", category), name=category, description="")
        for channel, modality in self._channels().items():
            self._write("sensor", token_of("sensor", channel), channel=channel, modality=modality)

    def _channels(self) -> dict[str, str]:
        lidars = {channel_of(one.name, "lidar"): "lidar" for one in self._rig.scanners}
        return {**lidars, **{channel_of(one.name, "camera"): "camera" for one in self._rig.cameras}}

    def begin_scene(self, name: str, description: str, time_ns: int) -> None:
        """Start a scene; the one before is complete."""
        self._end_scene()
        log = token_of("log", name)
        self._logs.append(log)
        date = datetime.fromtimestamp(time_ns // 10**9, UTC)
        self._write(
            "log",
            log,
            logfile=name,
            vehicle="simulated",
            date_captured=f"{date:%Y-%m-%d}",
            location="street",
        )
        scene = {"name": name, "description": description, "log_token": log, "nbr_samples": 0}
        self._scene = {"token": token_of("scene", name), **scene}
        self._frames = 0
        for scanner in self._rig.scanners:
            motion = scanner.ego_from_velo @ X_RIGHT.T
            self._calibrated(channel_of(scanner.name, "lidar"), motion, [])
        for camera in self._rig.cameras:
            intrinsic = camera.camera.projection[:, :3].tolist()
            self._calibrated(channel_of(camera.name, "camera"), camera.ego_from_cam, intrinsic)

    def _calibrated(self, channel: str, motion: Float64Array, intrinsic: list[Any]) -> None:
        self._write(
            "calibrated_sensor",
            token_of("calibrated", self._scene["name"], channel),
            sensor_token=token_of("sensor", channel),
            **_motion(motion),
            camera_intrinsic=intrinsic,
        )

    def add(self, frame: FrameRecord, returns: Sequence[int]) -> list[str]:
        """Enter a frame; returns the paths of its scans and images, in the order of the rig.

        Parameters
        ----------
        frame : FrameRecord
        returns : sequence of int
            The number of returns in each of its boxes.
        """
        key_frame = self._frames % self._frames_per_sample == 0
        self._frames += 1
        if key_frame:
            self._sample = token_of("sample", self._scene["name"], frame.time_ns)
            self._begin_sample(frame)
            for box, count in zip(frame.boxes, returns, strict=True):
                self._annotate(box, count)
        names = []
        for scanner, _ in zip(self._rig.scanners, frame.scans, strict=True):
            channel = channel_of(scanner.name, "lidar")
            names.append(self._file(channel, frame.time_ns, frame.world_from_ego, key_frame))
        for camera, image in zip(self._rig.cameras, frame.images, strict=False):
            channel = channel_of(camera.name, "camera")
            size = (camera.camera.width_px, camera.camera.height_px)
            names.append(self._file(channel, image.time_ns, image.world_from_ego, key_frame, *size))
        return names

    def _begin_sample(self, frame: FrameRecord) -> None:
        scene = self._scene
        scene["nbr_samples"] += 1
        scene.setdefault("first_sample_token", self._sample)
        scene["last_sample_token"] = self._sample
        record = {"timestamp": frame.time_ns // 1000, "scene_token": scene["token"]}
        self._chain("sample", "scene", {"token": self._sample, **record})

    def _annotate(self, box: BoxRecord, count: int) -> None:
        token = token_of("annotation", self._sample, box.track)
        instance = token_of("instance", self._scene["name"], box.track)
        found = self._instances.setdefault(
            instance,
            {
                "token": instance,
                "category_token": token_of("category", CATEGORIES[box.category]),
                "nbr_annotations": 0,
                "first_annotation_token": token,
            },
        )
        found["nbr_annotations"] += 1
        found["last_annotation_token"] = token
        length_m, width_m, height_m = box.size_m.tolist()
        record = {
            "token": token,
            "sample_token": self._sample,
            "instance_token": instance,
            "attribute_tokens": [],
            "visibility_token": "",  # how much of it the cameras see is not computed
            **_motion(box.world_from_box),
            "size": [width_m, length_m, height_m],
            "num_lidar_pts": count,
            "num_radar_pts": 0,
        }
        self._chain("sample_annotation", instance, record)

    def _file(
        self,
        channel: str,
        time_ns: int,
        world_from_ego: Float64Array,
        key_frame: bool,
        width_px: int = 0,
        height_px: int = 0,
    ) -> str:
        scene = self._scene["name"]
        token = token_of("sample_data", scene, channel, time_ns)
        time_us = time_ns // 1000
        self._write("ego_pose", token, **_motion(world_from_ego), timestamp=time_us)
        name = file_name(scene, channel, time_ns, key_frame)
        record = {
            "token": token,
            "sample_token": self._sample,
            "ego_pose_token": token,
            "calibrated_sensor_token": token_of("calibrated", scene, channel),
            "timestamp": time_us,
            "fileformat": "jpg" if width_px else "pcd",
            "is_key_frame": key_frame,
            "height": height_px,
            "width": width_px,
            "filename": name,
        }
        self._chain("sample_data", channel, record)
        return name

    def _chain(self, table: str, chain: str, record: dict[str, Any]) -> None:
        """Link a record with the one before of its chain, which is written now."""
        before = self._held.get((table, chain))
        record["prev"], record["next"] = before["token"] if before else "", ""
        if before:
            before["next"] = record["token"]
            self._files[table].add(before)
        self._held[table, chain] = record

    def _write(self, table: str, token: str, **values: Any) -> None:
        self._files[table].add({"token": token, **values})

    def _end_scene(self) -> None:
        for (table, _), record in self._held.items():
            self._files[table].add(record)
        for instance in self._instances.values():
            self._files["instance"].add(instance)
        self._held.clear()
        self._instances.clear()
        if self._scene:
            self._files["scene"].add(self._scene)

    def close(self) -> None:
        """Complete the tables."""
        self._end_scene()
        self._write(
            "map",
            token_of("map"),
            log_tokens=self._logs,
            category="semantic_prior",
            filename=self._map_file,
        )
        self.release()

    def release(self) -> None:
        """Close the files, complete or not."""
        for file in self._files.values():
            file.close()


def _motion(motion: Float64Array) -> dict[str, Any]:
    """Translation, and quaternion w, x, y, z."""
    return {
        "translation": motion[:3, 3].tolist(),
        "rotation": quaternions([motion])[0].tolist(),
    }


class _TableFile:
    """A list of records in JSON, one a line."""

    def __init__(self, path: Path) -> None:
        self._file: BinaryIO = path.open("wb")
        self._start = b"[\n"

    def add(self, record: Mapping[str, Any]) -> None:
        self._file.write(self._start + json.dumps(record).encode())
        self._start = b",\n"

    def close(self) -> None:
        if not self._file.closed:
            self._file.write(b"\n]\n" if self._start == b",\n" else b"[]\n")
            self._file.close()


def sensor_axes(points: np.ndarray) -> np.ndarray:
    """Points (N, 3), x forward, y left, as nuScenes has them: x right, y forward; no bit is lost.

    Examples
    --------
    >>> sensor_axes(np.array([[5.0, -2.0, 1.0]])).tolist()  # 5 m ahead, 2 m right
    [[2.0, 5.0, 1.0]]
    """
    return np.column_stack([-points[:, 1], points[:, 0], points[:, 2]])
