"""A simulated drive: the street, scanned and photographed, written in KITTI's raw layout."""

import io
import json
from collections.abc import Callable
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
    stamp_text,
)
from intervis.errors import MissingExtraError, OutputError, SettingsError
from intervis.files import write_bytes
from intervis.lab.worlds.ray_casting import require_embreex
from intervis.lab.worlds.recording import FILE_NAME, PERIOD_S, world_bytes
from intervis.lab.worlds.renderer import render
from intervis.lab.worlds.scanner import Scanner
from intervis.lab.worlds.street.layout import build_street
from intervis.lab.worlds.vehicle import Calibration
from intervis.lab.worlds.world import World

STAMP_NAME = "simulation.json"
EDITION = 2
"""Goes up whenever the same seed gives another drive: kept files of older editions are not."""


def simulate(
    out: Path | str,
    *,
    frames: int = 10,
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
    scanner: Scanner | None = None,
    images: bool = True,
) -> Path:
    """Drive down the built-in street and write what a car of KITTI's would have brought home.

    Under `out` come ``2011_09_26/`` with three calibration files and, in
    ``2011_09_26_drive_0001_sync/``, ``velodyne_points`` and ``image_02`` (data and timestamps),
    ``poses.txt`` (exact world_from_velo, KITTI's odometry format; the first is the identity),
    ``world.npz`` (the triangles, see `load_world`) and ``simulation.json`` (how it was made).
    Frame k is the same, to the byte, however many frames are asked for. Called again for the same
    drive it keeps the frames that are there; for another drive of its own it replaces them; a
    folder that holds anything else it refuses.

    Parameters
    ----------
    out : path
        Root folder; made where it does not exist.
    frames : int
        How many, at 10 Hz; the street ends after 330-odd.
    seed : int
        Which street, traffic and noise, 0 or more.
    progress : callable, optional
        Called with (frames done, frames in all) after each frame.
    scanner : Scanner, optional
        Another LiDAR.
    images : bool
        False leaves the pictures out.

    Returns
    -------
    Path
        The drive's folder.

    Raises
    ------
    SettingsError
        `frames` is not positive or more than the street is long, or `seed` is negative.
    OutputError
        The folder cannot be written, or holds something that `simulate` did not write.
    MissingExtraError
        The packages of the extra ``lab`` are not installed.
    """
    require_embreex()  # before anything is written
    if images:
        _require_pillow()
    seed, frames = _whole("seed", seed, 0), _whole("frames", frames, 1)
    world, sensor, calibration = build_street(seed), scanner or Scanner(), Calibration()
    most = int(world.last_s / PERIOD_S) + 1
    if frames > most:
        raise SettingsError(f"frames must be at most {most}, where the street ends, got {frames}.")
    layout = Layout(Path(out))
    stamp = {
        "made_by": "intervis simulate",
        "version": intervis.__version__,
        "edition": EDITION,
        "seed": seed,
        "images": images,
        "scanner": asdict(sensor),
    }
    _prepare(layout, calibration, stamp, frames)
    _describe(layout, world, frames, images)
    for number in range(frames):
        _write_frame(layout, world, sensor, calibration, seed, number, images)
        if progress is not None:
            progress(number + 1, frames)
    return layout.drive


def _whole(name: str, number: object, least: int) -> int:
    if isinstance(number, bool) or not isinstance(number, Integral) or number < least:
        raise SettingsError(f"{name} must be a whole number of {least} or more, got {number!r}.")
    return int(number)


def _prepare(layout: Layout, calibration: Calibration, stamp: dict[str, Any], frames: int) -> None:
    """Calibration and stamp; what an earlier simulation left and this one will not have goes."""
    text = json.dumps(stamp, indent=1) + "\n"
    stamp_path = layout.drive / STAMP_NAME
    files = {layout.date / name: body for name, body in calibration.files(START).items()}
    try:
        before = stamp_path.read_text() if stamp_path.is_file() else None
        if before is None:
            _refuse_foreign(layout, files)
        kept = layout.expected(frames) if before == text else set()
        for path in layout.frame_files():
            if path not in kept:
                path.unlink()
    except OSError as error:
        raise OutputError(f"cannot use {layout.root}: {error.strerror or error}.") from None
    for path, body in files.items():
        write_bytes(path, body.encode())
    write_bytes(stamp_path, text.encode())


def _refuse_foreign(layout: Layout, files: dict[Path, str]) -> None:
    """Another recording of that day must not be overwritten: KITTI has a drive of this name."""
    foreign = [path for path, body in files.items() if path.is_file() and path.read_text() != body]
    if layout.drive.is_dir() and any(layout.drive.iterdir()):
        foreign.append(layout.drive)
    if foreign:
        raise OutputError(
            f"{foreign[0]} was not written by `intervis simulate` and is left as it is;"
            " choose another folder for the output."
        )


def _describe(layout: Layout, world: World, frames: int, images: bool) -> None:
    """Everything that is known before the first ray: poses, times, triangles."""
    poses = np.array([world.vehicle_pose_at(number * PERIOD_S) for number in range(frames)])
    stamps = stamp_text(frames, PERIOD_S).encode()
    write_bytes(layout.drive / FILE_NAME, world_bytes(world, frames))
    write_bytes(layout.drive / "poses.txt", pose_text(poses).encode())
    write_bytes(layout.drive / "velodyne_points" / "timestamps.txt", stamps)
    if images:
        write_bytes(layout.drive / "image_02" / "timestamps.txt", stamps)


def _write_frame(
    layout: Layout,
    world: World,
    scanner: Scanner,
    calibration: Calibration,
    seed: int,
    number: int,
    images: bool,
) -> None:
    scan, image = layout.scan(number), layout.image(number)
    if scan.is_file() and (image.is_file() or not images):
        return
    time_s = number * PERIOD_S
    moment, pose = world.at(time_s), world.vehicle_pose_at(time_s)
    rng = np.random.default_rng([seed, number])
    points, attributes = scanner.scan(moment, pose, rng)
    write_bytes(scan, scan_bytes(points, attributes["intensity"]))
    if images:
        picture = render(moment, calibration.camera(), calibration.cam_from_velo, pose)
        write_bytes(image, _png_bytes(picture))


def _require_pillow() -> Any:
    """Pillow's module Image."""
    try:
        from PIL import Image
    except ImportError:
        raise MissingExtraError("pillow", "lab", "writing the pictures of a drive") from None
    return Image


def _png_bytes(picture: NDArray[np.uint8]) -> bytes:
    """The bytes of a PNG file of a picture (H, W, 3)."""
    buffer = io.BytesIO()
    _require_pillow().fromarray(picture).save(buffer, "PNG", compress_level=4)
    return buffer.getvalue()
