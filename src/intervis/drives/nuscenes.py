"""nuScenes, and data sets in its schema (Lyft Level 5): a scene is a drive.

Tables ``scene.json``, ``sample.json``, ``sample_data.json``, ``ego_pose.json``,
``calibrated_sensor.json`` and ``sensor.json`` lie in a folder (``v1.0-mini``, ``data``); the files
that they name lie beside that folder. A scene is given by its name below either folder
(``nuscenes/scene-0061``), although no folder has this name.

The sweeps of the main scanner are the frames, numbered from 0 in the order of time, whether a sweep
is a key frame or not. The files of nuScenes have x right, y forward; those of other data sets other
axes. Points are turned by whole right angles into x forward, y left, z up of the vehicle.
"""

import logging
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from intervis.arrays import Float64Array
from intervis.drives.boxes import Box
from intervis.drives.calibration import CameraCalibration
from intervis.drives.camera_choice import pick_named_camera
from intervis.drives.drive import Drive
from intervis.drives.frame import ScannerScan
from intervis.drives.nuscenes_sweeps import (
    CameraSweep,
    Channel,
    Sweep,
    channels_of,
    is_plain_name,
)
from intervis.drives.nuscenes_tables import (
    Record,
    numbers_of,
    pose_of,
    read_table,
    record_of,
    text_of,
)
from intervis.drives.scan import Scan
from intervis.drives.scan_file import read_nuscenes, reading
from intervis.drives.vehicle_axes import sensor_from_velo
from intervis.errors import DriveError
from intervis.transform import inverse

log = logging.getLogger(__name__)

EXPECTED_FILES = "scene.json and sample_data.json, also under v1.0-*/ (nuScenes)"
MAIN_SCANNER, MAIN_CAMERA = "LIDAR_TOP", "CAM_FRONT"
IMAGE_WITHIN_NS = 100_000_000
VISIBILITY = {"1": "v0-40", "2": "v40-60", "3": "v60-80", "4": "v80-100"}
"""Levels of the table ``visibility``: per cent of an object that the cameras see."""

"""An image belongs to a sweep where it was taken within this time of it."""


# --- finding scenes ---


def find_roots(path: Path) -> list[Path]:
    """Names of scenes below the folders of their tables; no folder has these names."""
    return [folder / name for folder in _table_folders(path) for name in sorted(_scenes(folder))]


def find_scene(path: Path) -> Path | None:
    """The scene that a path names below a folder with tables, or beside it; None where none."""
    if not path.parent.is_dir():
        return None
    found = [root for root in find_roots(path.parent) if root.name == path.name]
    if len(found) > 1:
        names = ", ".join(str(root.relative_to(path.parent)) for root in found)
        raise DriveError(f"{path.parent} holds the scene {path.name} twice: {names}.")
    return found[0] if found else None


def _table_folders(path: Path) -> list[Path]:
    folders = [path, *sorted(entry for entry in path.iterdir() if entry.is_dir())]
    return [
        folder
        for folder in folders
        if all((folder / f"{name}.json").is_file() for name in ("scene", "sample_data"))
    ]


def _scenes(folder: Path) -> dict[str, str]:
    """Tokens of scenes by name."""
    table = folder / "scene.json"
    scenes = {}
    for nth, (token, record) in enumerate(read_table(folder, "scene").items()):
        names = (text_of(table, record, "name"), token, f"scene {nth}")
        scenes[next(name for name in names if is_plain_name(name))] = token
    return scenes


# --- reading a scene ---


def read_drive(root: Path, camera: str | None) -> Drive:
    """Read the scene that `find_roots` or `find_scene` returned."""
    folder = root.parent
    channels = channels_of(folder, _scenes(folder)[root.name])
    scanners = {name: found for name, found in channels.items() if found[0] == "lidar"}
    if not scanners:
        raise DriveError(f"{root} lists no sweep of a lidar in its tables.")
    main = (scanners.get(MAIN_SCANNER) or next(iter(scanners.values())))[1]
    cameras = {name: found[1] for name, found in channels.items() if found[0] == "camera"}
    chosen = pick_named_camera(camera, cameras, MAIN_CAMERA, root)
    there = {number: sweep for number, sweep in enumerate(main.sweeps) if sweep.path.is_file()}
    if not there:
        raise DriveError(
            f"none of the scans of {root} exists, for example {main.sweeps[0].path}: put"
            " samples and sweeps beside the tables."
        )
    if len(there) < len(main.sweeps):
        log.warning(
            "%d of the %d sweeps of %s do not exist: they become no frames.",
            *(len(main.sweeps) - len(there), len(main.sweeps), root.name),
        )
    images = {}
    if chosen:
        for number, sweep in there.items():
            image = cameras[chosen].nearest(sweep.time_ns)
            if abs(image.time_ns - sweep.time_ns) <= IMAGE_WITHIN_NS and image.path.is_file():
                images[number] = image.path
    others = tuple(channel for _, channel in scanners.values() if channel is not main)
    return Drive(
        root=root,
        name=root.name,
        layout="nuscenes",
        scan_paths={number: sweep.path for number, sweep in there.items()},
        image_paths=images,
        camera_names=tuple(sorted(cameras)),
        camera_name=chosen,
        calibration=_SceneCalibration(there, cameras[chosen], folder) if chosen else None,
        poses={number: _world_from_velo(sweep) for number, sweep in there.items()},
        timestamps_ns={number: sweep.time_ns for number, sweep in there.items()},
        metadata_files=tuple(
            folder / f"{name}.json" for name in ("scene", "sample", "calibrated_sensor", "sensor")
        ),
        read=_SceneReader(there),
        scanner=main.name,
        ego_from_velo=_ego_from_velo(next(iter(there.values()))),
        read_other_scans=_OtherScans(there, others) if others else None,
        read_boxes=_Boxes(folder, there) if (folder / "sample_annotation.json").is_file() else None,
    )


# --- scanners ---


def _ego_from_velo(sweep: Sweep) -> Float64Array:
    return sweep.ego_from_sensor @ sensor_from_velo(sweep.ego_from_sensor)


def _world_from_velo(sweep: Sweep) -> Float64Array:
    return sweep.world_from_ego @ _ego_from_velo(sweep)


def _read(sweep: Sweep) -> Scan:
    velo_from_sensor = sensor_from_velo(sweep.ego_from_sensor).T
    return reading(sweep.path, partial(read_nuscenes, velo_from_file=velo_from_sensor))


@dataclass(frozen=True)
class _SceneReader:
    """Reads the sweeps of the main scanner."""

    sweeps: Mapping[int, Sweep]

    def __call__(self, number: int) -> Scan:
        return _read(self.sweeps[number])


@dataclass(frozen=True)
class _OtherScans:
    """Reads the scans of the other scanners that are nearest in time to a frame."""

    sweeps: Mapping[int, Sweep]
    channels: tuple[Channel, ...]

    def __call__(self, number: int) -> tuple[ScannerScan, ...]:
        scans = []
        for channel in self.channels:
            sweep = channel.nearest(self.sweeps[number].time_ns)
            if not sweep.path.is_file():
                continue
            scan = _read(sweep)
            scans.append(
                ScannerScan(
                    name=channel.name,
                    points=scan.points,
                    attributes=scan.attributes,
                    pose=_world_from_velo(sweep),
                    timestamp_ns=sweep.time_ns,
                )
            )
        return tuple(scans)


# --- boxes ---


@dataclass(frozen=True)
class _Boxes:
    """Reads the annotations of the samples whose key frames the sweeps are."""

    folder: Path
    sweeps: Mapping[int, Sweep]

    def __call__(self, number: int) -> tuple[Box, ...]:
        sweep = self.sweeps[number]
        if not sweep.sample:
            return ()
        samples = frozenset(sweep.sample for sweep in self.sweeps.values() if sweep.sample)
        velo_from_world = inverse(_world_from_velo(sweep))
        return tuple(
            _box(self.folder, annotation, velo_from_world)
            for annotation in _annotations(self.folder, samples)[sweep.sample]
        )


class _Annotation(NamedTuple):
    """A record of the table, and what its tokens name."""

    record: Record
    category: str
    attributes: tuple[str, ...]


@lru_cache(maxsize=1)
def _annotations(folder: Path, samples: frozenset[str]) -> Mapping[str, list[_Annotation]]:
    """Annotations by sample: searched once for all frames of a scene."""
    records = read_table(folder, "sample_annotation", "sample_token", samples)
    table = folder / "sample_annotation.json"
    tokens = {text_of(table, record, "instance_token") for record in records.values()}
    instances = read_table(folder, "instance", "token", tokens)
    categories = read_table(folder, "category")
    attributes = _attributes(folder)
    found: dict[str, list[_Annotation]] = {sample: [] for sample in samples}
    for record in records.values():
        instance = record_of(folder, instances, record, "instance")
        category = record_of(folder, categories, instance, "category")
        annotation = _Annotation(
            record,
            text_of(folder / "category.json", category, "name"),
            _named(attributes, record.get("attribute_tokens")),
        )
        found[text_of(table, record, "sample_token")].append(annotation)
    return found


def _attributes(folder: Path) -> dict[str, str]:
    """Names of attributes by token; none where the data set has no table of them."""
    table = folder / "attribute.json"
    if not table.is_file():
        return {}
    records = read_table(folder, "attribute")
    return {token: text_of(table, record, "name") for token, record in records.items()}


def _named(attributes: Mapping[str, str], tokens: object) -> tuple[str, ...]:
    """Names of the attributes of a record; tokens that the table lacks have none."""
    listed = tokens if isinstance(tokens, list) else []
    return tuple(attributes[token] for token in map(str, listed) if token in attributes)


def _box(folder: Path, annotation: _Annotation, velo_from_world: Float64Array) -> Box:
    record, table = annotation.record, folder / "sample_annotation.json"
    width_m, length_m, height_m = numbers_of(table, record, "size", 3)
    returns = record.get("num_lidar_pts")
    return Box(
        velo_from_world @ pose_of(table, record),
        np.array([length_m, width_m, height_m]),
        annotation.category,
        text_of(table, record, "instance_token"),
        returns if isinstance(returns, int) and returns >= 0 else None,  # Lyft has -1
        VISIBILITY.get(str(record.get("visibility_token")), ""),
        annotation.attributes,
    )


# --- cameras ---


@dataclass(frozen=True)
class _SceneCalibration:
    """Camera and extrinsics of each frame: the vehicle moves between sweep and image."""

    sweeps: Mapping[int, Sweep]
    images: Channel
    folder: Path

    def __call__(self, number: int) -> CameraCalibration:
        sweep = self.sweeps[number]
        image = self.images.nearest(sweep.time_ns)
        assert isinstance(image, CameraSweep)
        assert image.camera is not None
        world_from_cam = image.world_from_ego @ image.ego_from_sensor
        return CameraCalibration(image.camera, inverse(world_from_cam) @ _world_from_velo(sweep))
