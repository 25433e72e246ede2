"""Simulated drives in any layout: several scanners, cameras, boxes, motion during a sweep.

The drive is written whole or not at all. KITTI's raw layout is written by
`intervis.lab.worlds.simulation`, which can go on.
"""

import json
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import intervis
from intervis.drives import argoverse_writer, pcd_writer
from intervis.drives.argoverse_writer import ArgoverseWriter
from intervis.drives.drive_writer import DriveWriter, Rig
from intervis.drives.mcap_writer import McapWriter
from intervis.drives.nuscenes_writer import NuScenesWriter
from intervis.drives.pcd_writer import PcdWriter
from intervis.errors import SettingsError
from intervis.files import check_new_folder, whole_folder
from intervis.lab.worlds.mounted_scanner import checked_scanners, mounted
from intervis.lab.worlds.ray_casting import require_embreex
from intervis.lab.worlds.simulated_drive import SimulatedDrive, rig_of
from intervis.lab.worlds.simulation import (
    MADE_BY,
    METADATA_NAME,
    require_pillow,
    simulate,
    whole_number,
)
from intervis.lab.worlds.street.layout import build_street
from intervis.progress import Progress, reporter


@dataclass(frozen=True)
class _Layout:
    """A layout: its usual scanners, its writer, the check of what it can hold."""

    scanners: tuple[str, ...]
    writer: Callable[[Path, Rig], DriveWriter]
    has_images: bool = False
    check: Callable[[Rig], None] = lambda rig: None


_WRITERS = {
    "nuscenes": _Layout(("hdl-32e",), NuScenesWriter, has_images=True),
    "argoverse2": _Layout(
        ("hdl-32e@roof", "hdl-32e@under"),
        ArgoverseWriter,
        has_images=True,
        check=argoverse_writer.check_rig,
    ),
    "pcd": _Layout(("hdl-64e",), PcdWriter, check=pcd_writer.check_rig),
    "mcap": _Layout(("os1-128",), McapWriter, has_images=True),
}
LAYOUTS = ("kitti", *_WRITERS)
"""The layouts by name."""


def simulate_drive(
    out: Path | str,
    layout: str = "kitti",
    scanners: Sequence[str] = (),
    *,
    frames: int = 10,
    seed: int = 0,
    images: bool = True,
    motion_distortion: bool = False,
    labels: bool = False,
    progress: Progress | None = None,
) -> Path:
    """Simulate a drive through the built-in street and write it in a layout.

    Parameters
    ----------
    out : path
        Folder for the drive: new or empty, but for KITTI's layout (see `simulate`).
    layout : str
        ``kitti``, ``nuscenes``, ``argoverse2``, ``pcd`` or ``mcap``.
    scanners : sequence of str
        ``PRESET`` or ``PRESET@MOUNT`` each; by default what is usual in the layout. Presets are
        those of `intervis.lab.worlds.presets`, mounts those of `intervis.lab.worlds.mounts`. On
        ``mast`` and ``tripod`` scanners stand beside the street, and there are no images.
    frames : int
        Number of frames, 0.1 s apart, or as far as a sweep takes.
    seed : int
        Selects street, traffic and noise; 0 or more.
    images : bool
        False omits the images; layouts without images have none.
    motion_distortion : bool
        Vehicle and actors move during a sweep. By default all beams of a sweep are fired at once.
    labels : bool
        KITTI's layout only: labels of the points (see `simulate`).
    progress : callable, optional
        Called with a note after each frame.

    Returns
    -------
    Path
        What `intervis.open_drive` takes.

    Raises
    ------
    SettingsError
        A name is unknown, the layout cannot hold the scanners, or a number is out of range.
    OutputError
        The folder holds files, or cannot be written; nothing is left of a drive that is cut off.
    MissingExtraError
        A package of the extra ``lab`` (or ``argoverse``) is not installed.
    """
    require_embreex()
    if layout not in LAYOUTS:
        raise SettingsError(
            f"there is no layout {str(layout)!r:.60}: choose from {', '.join(LAYOUTS)}."
        )
    seed, frames = whole_number("seed", seed, 0), whole_number("frames", frames, 1)
    if layout == "kitti":
        return _simulate_kitti(
            out, scanners, frames, seed, images, motion_distortion, labels, reporter(progress)
        )
    if labels:
        raise SettingsError(
            f"labels of points are written in KITTI's layout only, not in {layout}."
        )
    drive = _drive(layout, scanners, frames, seed, images, motion_distortion, Path(out))
    metadata = {
        "made_by": MADE_BY,
        "version": intervis.__version__,
        "seed": seed,
        "layout": layout,
        "scanners": {scanner.mount: scanner.model for scanner in drive.scanners},
        "motion_distortion": motion_distortion,
    }
    with whole_folder(Path(out)) as part:
        writer = _WRITERS[layout].writer(part, drive.rig)
        with closing(_Released(writer)):
            for number in range(frames):
                writer.add(drive.frame(number))
                reporter(progress)(f"frame {number}")
            below = writer.close()
        (part / METADATA_NAME).write_text(json.dumps(metadata, indent=1) + "\n")
    return Path(out) / below


def _drive(
    layout: str,
    scanners: Sequence[str],
    frames: int,
    seed: int,
    images: bool,
    motion: bool,
    out: Path,
) -> SimulatedDrive:
    """The drive, if the layout can hold its scanners and the folder is free."""
    kind = _WRITERS[layout]
    chosen = [mounted(text) for text in scanners or kind.scanners]
    checked_scanners(chosen)
    cameras = images and kind.has_images and not chosen[0].is_on_ground
    rig = rig_of(chosen, cameras)
    kind.check(rig)
    if cameras:
        require_pillow()
    check_new_folder(out)
    drive = SimulatedDrive(build_street(seed), tuple(chosen), rig, seed, motion)
    drive.check_length(frames)
    return drive


@dataclass
class _Released:
    """Closes the files of a writer, whatever happens."""

    writer: DriveWriter

    def close(self) -> None:
        self.writer.release()


def _simulate_kitti(
    out: Path | str,
    scanners: Sequence[str],
    frames: int,
    seed: int,
    images: bool,
    motion_distortion: bool,
    labels: bool,
    progress: Progress,
) -> Path:
    if len(scanners) > 1:
        raise SettingsError(
            f"KITTI's layout takes one scanner, not {len(scanners)}: choose nuscenes or mcap for"
            " several."
        )
    own = mounted(scanners[0]) if scanners and scanners[0] != "hdl-64e" else None
    if own is not None and own.is_on_ground:
        raise SettingsError(
            "KITTI's layout is that of a vehicle: choose pcd or mcap for a scanner on a mast or a"
            " tripod."
        )
    return simulate(
        out,
        frames=frames,
        seed=seed,
        scanner=own,
        images=images,
        motion_distortion=motion_distortion,
        labels=labels,
        progress=progress,
    )
