"""A simulated drive: scans and images of the street, written in KITTI's raw layout."""

import io
import json
from dataclasses import asdict
from numbers import Integral
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import intervis
from intervis.drives.kitti_writer import (
    START,
    Layout,
    pose_text,
    scan_bytes,
    timestamp_text,
)
from intervis.errors import MissingExtraError, OutputError, SettingsError
from intervis.files import write_bytes
from intervis.lab.worlds.mounted_scanner import EGO_FROM_VELO, MountedScanner
from intervis.lab.worlds.point_classes import point_labels
from intervis.lab.worlds.ray_casting import require_embreex
from intervis.lab.worlds.recording import FILE_NAME, PERIOD_S, world_bytes
from intervis.lab.worlds.renderer import render
from intervis.lab.worlds.scanner import Scanner
from intervis.lab.worlds.sensor_rig import SensorRig
from intervis.lab.worlds.street.layout import build_street
from intervis.lab.worlds.world import World
from intervis.output_folder import refuse_links_below
from intervis.progress import Progress, reporter
from intervis.transform import inverse

METADATA_NAME = "simulation.json"
MADE_BY = "intervis simulate"
EDITION = 2
"""Increased whenever the same seed gives another drive; frames of older editions are replaced."""


def simulate(
    out: Path | str,
    *,
    frames: int = 10,
    seed: int = 0,
    progress: Progress | None = None,
    scanner: Scanner | MountedScanner | None = None,
    images: bool = True,
    motion_distortion: bool = False,
    labels: bool = False,
) -> Path:
    """Simulate a drive through the built-in street and write it in KITTI's raw layout.

    Writes under `out` the folder ``2011_09_26/`` with three calibration files and, in
    ``2011_09_26_drive_0001_sync/``, ``velodyne_points`` and ``image_02`` (data and timestamps),
    ``poses.txt`` (exact world_from_velo in the format of KITTI odometry; the first is the
    identity), ``world.npz`` (the triangles, see `load_world`) and ``simulation.json`` (version,
    seed and scanner). The bytes of frame k do not depend on the number of frames. A second call
    for the same drive keeps the frames that exist; a call for another simulated drive replaces
    them; a folder with other content is refused.

    Parameters
    ----------
    out : path
        Root folder; created where it does not exist.
    frames : int
        Number of frames, at 10 Hz; the street is about 330 frames long.
    seed : int
        Selects street, traffic and noise; 0 or more.
    progress : callable, optional
        Called with a note after each frame.
    scanner : Scanner or MountedScanner, optional
        Instead of the HDL-64E; a mounted one has its own place on the vehicle.
    images : bool
        False omits the images.
    motion_distortion : bool
        Vehicle and actors move during a sweep; the layout has no times of points.
    labels : bool
        Write the class and the actor of each return, as SemanticKITTI does, to
        ``velodyne_points/labels``.

    Returns
    -------
    Path
        The drive's folder.

    Raises
    ------
    SettingsError
        `frames` is not positive or exceeds the street, or `seed` is negative.
    OutputError
        The folder cannot be written, or holds files that `simulate` did not write.
    MissingExtraError
        The packages of the extra ``lab`` are not installed.
    """
    require_embreex()  # before anything is written
    if images:
        require_pillow()
    seed, frames = whole_number("seed", seed, 0), whole_number("frames", frames, 1)
    world, sensor, rig = build_street(seed), scanner or Scanner(), SensorRig()
    metadata: dict[str, Any] = {}
    if isinstance(sensor, MountedScanner):
        velo_from_scanner = inverse(EGO_FROM_VELO) @ sensor.ego_from_scanner
        world, rig = world.seen_from(velo_from_scanner), rig.seen_from(velo_from_scanner)
        metadata["scanner"] = {"name": sensor.model, "mount": sensor.mount}
    else:
        metadata["scanner"] = asdict(sensor)
    if motion_distortion:
        metadata["motion_distortion"] = True
    if labels:
        metadata["labels"] = True
    most = int(world.last_s / PERIOD_S) + 1
    if frames > most:
        raise SettingsError(f"frames must be at most {most}, where the street ends, got {frames}.")
    layout = Layout(Path(out))
    metadata = {
        "made_by": MADE_BY,
        "version": intervis.__version__,
        "edition": EDITION,
        "seed": seed,
        "images": images,
        **metadata,
    }
    _prepare(layout, rig, metadata, frames)
    _write_sequence_files(layout, world, frames, images)
    for number in range(frames):
        _write_frame(layout, world, sensor, rig, seed, number, images, motion_distortion, labels)
        reporter(progress)(f"frame {number}")
    return layout.drive


def whole_number(name: str, number: object, least: int) -> int:
    """The whole number of an option.

    Raises
    ------
    SettingsError
        It is no whole number, or less than `least`.
    """
    if isinstance(number, bool) or not isinstance(number, Integral) or number < least:
        raise SettingsError(f"{name} must be a whole number of {least} or more, got {number!r}.")
    return int(number)


def _prepare(layout: Layout, rig: SensorRig, metadata: dict[str, Any], frames: int) -> None:
    """Write calibration and metadata; delete frames of another or longer simulated drive."""
    text = json.dumps(metadata, indent=1) + "\n"
    metadata_path = layout.drive / METADATA_NAME
    for path in layout.expected(1):
        refuse_links_below(layout.root, path)
    files = {layout.date / name: body for name, body in rig.calibration_files(START).items()}
    try:
        before = metadata_path.read_text(errors="replace") if metadata_path.is_file() else None
        if before is None or MADE_BY not in before:
            _refuse_foreign(layout, files)
        kept = layout.expected(frames) if before == text else set()
        for path in layout.frame_files():
            if path not in kept:
                path.unlink()
    except OSError as error:
        raise OutputError(f"cannot use {layout.root}: {error.strerror or error}.") from None
    for path, body in files.items():
        write_bytes(path, body.encode())
    write_bytes(metadata_path, text.encode())


def _refuse_foreign(layout: Layout, files: dict[Path, str]) -> None:
    """Raise where the folder holds another recording: KITTI has a drive of this name."""
    foreign = [path for path, body in files.items() if path.is_file() and path.read_text() != body]
    if layout.drive.is_dir() and any(layout.drive.iterdir()):
        foreign.append(layout.drive)
    if foreign:
        raise OutputError(
            f"{foreign[0]} was not written by `intervis simulate` and was not changed;"
            " choose another output folder."
        )


def _write_sequence_files(layout: Layout, world: World, frames: int, images: bool) -> None:
    """Write triangles, poses and timestamps."""
    poses = np.array([world.vehicle_pose_at(number * PERIOD_S) for number in range(frames)])
    timestamps = timestamp_text(frames, PERIOD_S).encode()
    write_bytes(layout.drive / FILE_NAME, world_bytes(world, frames))
    write_bytes(layout.drive / "poses.txt", pose_text(poses).encode())
    write_bytes(layout.drive / "velodyne_points" / "timestamps.txt", timestamps)
    if images:
        write_bytes(layout.drive / "image_02" / "timestamps.txt", timestamps)


def _write_frame(
    layout: Layout,
    world: World,
    scanner: Scanner | MountedScanner,
    rig: SensorRig,
    seed: int,
    number: int,
    images: bool,
    motion: bool,
    labels: bool,
) -> None:
    scan, image, label = layout.scan(number), layout.image(number), layout.labels(number)
    if scan.is_file() and (image.is_file() or not images) and (label.is_file() or not labels):
        return
    time_s = number * PERIOD_S
    snapshot, pose = world.at(time_s), world.vehicle_pose_at(time_s)
    rng = np.random.default_rng([seed, number])
    if isinstance(scanner, MountedScanner):
        ego_from_scanner = scanner.ego_from_scanner
        world_from_ego = lambda moment_s: (  # noqa: E731
            world.vehicle_pose_at(moment_s) @ inverse(ego_from_scanner)
        )
        points, attributes = scanner.sweep(world, world_from_ego, time_s, rng, motion=motion)
    elif motion:
        points, attributes = scanner.sweep(world, time_s, rng)
    else:
        points, attributes = scanner.scan(snapshot, pose, rng)
    write_bytes(scan, scan_bytes(points, attributes["intensity"]))
    if labels:
        numbers = point_labels(world, attributes["label"], attributes["object"])
        write_bytes(label, numbers.astype("<u4").tobytes())
    if images:
        picture = render(snapshot, rig.camera(), rig.cam_from_velo, pose)
        write_bytes(image, _png_bytes(picture))


def require_pillow() -> Any:
    """Pillow's module Image."""
    try:
        from PIL import Image
    except ImportError:
        raise MissingExtraError("pillow", "lab", "writing the pictures of a drive") from None
    return Image


def _png_bytes(picture: NDArray[np.uint8]) -> bytes:
    """The bytes of a PNG file of a picture (H, W, 3)."""
    buffer = io.BytesIO()
    require_pillow().fromarray(picture).save(buffer, "PNG", compress_level=4)
    return buffer.getvalue()
