"""The files of the sensors in a scene of nuScenes, with the place and the time of each."""

from bisect import bisect_left
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from intervis.arrays import Float64Array
from intervis.camera import Camera
from intervis.drives.nuscenes_tables import (
    Record,
    numbers_of,
    pose_of,
    read_table,
    record_of,
    text_of,
    time_ns_of,
)
from intervis.errors import CalibrationError, CameraError

LONGEST_NAME = 1000
"""Letters of the name of a file at most."""


@dataclass(frozen=True)
class Sweep:
    """A file of a sensor: a scan or an image, with its place and time."""

    path: Path
    time_ns: int
    world_from_ego: Float64Array
    ego_from_sensor: Float64Array
    sample: str = ""
    """Token of the sample whose key frame this is."""


@dataclass(frozen=True)
class CameraSweep(Sweep):
    """An image, with its camera."""

    camera: Camera | None = None


@dataclass(frozen=True)
class Channel:
    """The files of one sensor in the order of time."""

    name: str
    sweeps: tuple[Sweep, ...]

    def nearest(self, time_ns: int) -> Sweep:
        """The file nearest in time."""
        place = bisect_left([sweep.time_ns for sweep in self.sweeps], time_ns)
        around = self.sweeps[max(0, place - 1) : place + 1]
        return min(around, key=lambda sweep: abs(sweep.time_ns - time_ns))


def channels_of(folder: Path, scene_token: str) -> dict[str, tuple[str, Channel]]:
    """Modality and files of each sensor in a scene, by the sensor's channel."""
    samples = read_table(folder, "sample", "scene_token", {scene_token})
    sweeps = read_table(folder, "sample_data", "sample_token", samples.keys())
    table = folder / "sample_data.json"
    ego_tokens = {text_of(table, record, "ego_pose_token") for record in sweeps.values()}
    egos = read_table(folder, "ego_pose", "token", ego_tokens)
    calibrated, sensors = (read_table(folder, name) for name in ("calibrated_sensor", "sensor"))
    found: dict[str, list[Sweep]] = defaultdict(list)
    modality = {}
    for record in sweeps.values():
        sensor_of = record_of(folder, calibrated, record, "calibrated_sensor")
        sensor = record_of(folder, sensors, sensor_of, "sensor")
        channel = text_of(folder / "sensor.json", sensor, "channel")
        if not is_plain_name(channel):
            raise CalibrationError(
                f"{folder / 'sensor.json'} has a channel that is not a plain name."
            )
        modality[channel] = text_of(folder / "sensor.json", sensor, "modality")
        if modality[channel] not in ("lidar", "camera"):
            continue
        ego = record_of(folder, egos, record, "ego_pose")
        sweep = Sweep(
            _file(folder, text_of(table, record, "filename")),
            time_ns_of(table, record),
            pose_of(folder / "ego_pose.json", ego),
            pose_of(folder / "calibrated_sensor.json", sensor_of),
            text_of(table, record, "sample_token") if record.get("is_key_frame") is True else "",
        )
        if modality[channel] == "camera":
            sweep = CameraSweep(
                *(sweep.path, sweep.time_ns, sweep.world_from_ego, sweep.ego_from_sensor),
                camera=_camera(folder, record, sensor_of, channel),
            )
        found[channel].append(sweep)
    return {
        name: (modality[name], Channel(name, tuple(sorted(files, key=lambda file: file.time_ns))))
        for name, files in sorted(found.items())
    }


def _file(folder: Path, name: str) -> Path:
    """A file that a table names: beside the folder of tables, or in it; never outside of both."""
    parts = Path(name).parts
    if (
        not parts
        or "\0" in name
        or len(name) > LONGEST_NAME
        or not name.isprintable()
        or ".." in parts
        or Path(name).is_absolute()
    ):
        raise CalibrationError(
            f"{folder / 'sample_data.json'} names the invalid file {name!r:.80}."
        )
    beside = folder.parent / name
    return folder / name if not beside.exists() and (folder / name).exists() else beside


def _camera(folder: Path, record: Record, sensor_of: Record, channel: str) -> Camera:
    intrinsics = numbers_of(folder / "calibrated_sensor.json", sensor_of, "camera_intrinsic", 3, 3)
    projection = np.column_stack([intrinsics, np.zeros(3)])
    width_px, height_px = (record.get(key) for key in ("width", "height"))
    try:
        return Camera(projection, width_px, height_px, name=channel)  # type: ignore[arg-type]
    except CameraError as error:
        raise CalibrationError(f"{folder / 'sample_data.json'}, {channel}: {error}") from None


def is_plain_name(name: str) -> bool:
    """Whether a name in a table can name one entry of a folder."""
    return (
        name.isprintable()
        and "/" not in name
        and name not in ("", ".", "..")
        and len(name) <= LONGEST_NAME
    )
