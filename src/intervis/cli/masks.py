"""``intervis masks``: visibility masks of each frame, in the layouts of the benchmarks."""

from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from intervis.cli import options
from intervis.cli.run import CameraName, Source
from intervis.cli.sight import Point
from intervis.cli.survey import Frames
from intervis.cli.terminal import InterruptedRunError, complain, progress, show, tell

if TYPE_CHECKING:
    from collections.abc import Iterable

    from intervis.arrays import BoolArray, Float64Array
    from intervis.drives import Drive
    from intervis.uses.voxels.drive_masks import MaskSettings
    from intervis.uses.voxels.mask_layouts import MaskLayout
    from intervis.uses.voxels.mask_run import MaskFrame, MaskRun
    from intervis.uses.voxels.masks import Masks
    from intervis.uses.voxels.voxel_grid import VoxelGrid

    NumberedMasks = tuple[int, Masks]

MOVING_LEFT_OUT = "left out; the tool keeps them, and so does --keep-moving"


def masks(
    source: Source,
    out: Annotated[Path, typer.Option("--out", help="Folder for the masks.")],
    layout: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="semantickitti, sscbench-nuscenes, sscbench-kitti360, sscbench-waymo,"
            " occ3d-nuscenes, occ3d-waymo, surroundocc, occnet, openoccupancy, or npz.",
        ),
    ] = "semantickitti",
    definition: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="exact; semantickitti: as its own tool makes them, needs labels; occ3d: as its"
            " paper prints it.",
        ),
    ] = "exact",
    frames: Frames = None,
    stride: Annotated[int, typer.Option(metavar="N", help="Every N-th of these frames.")] = 1,
    later: Annotated[
        int | None,
        typer.Option(
            metavar="N", help="Frames added after each one; default: the benchmark's, 70 or 0."
        ),
    ] = None,
    keep_moving: Annotated[
        bool, typer.Option("--keep-moving", help="Keep labelled moving things of added frames.")
    ] = False,
    cameras: Annotated[
        bool,
        typer.Option("--cameras/--no-cameras", help="Also masks of each camera, or of --camera."),
    ] = True,
    classes: Annotated[
        Path | None,
        typer.Option(metavar="FILE.json", help='Map of classes, as in {"10": 4, "40": 11}.'),
    ] = None,
    lidar_at: Annotated[
        str | None,
        typer.Option(
            metavar="X,Y,Z",
            help="Scanner in the vehicle's frame, metres, for the layouts of Occ3D; default: as the"
            " drive says, or else nuScenes' or Waymo's.",
        ),
    ] = None,
    corner: Annotated[
        str | None, typer.Option(metavar="X,Y,Z", help="Smallest corner of the grid, for npz.")
    ] = None,
    cell: Annotated[
        float | None, typer.Option(metavar="M", help="Edge of a voxel, for npz; metres.")
    ] = None,
    shape: Annotated[
        str | None, typer.Option(metavar="I,J,K", help="Voxels along x, y and z, for npz.")
    ] = None,
    picture: Annotated[
        Path | None,
        typer.Option(metavar="FILE.png|FILE.svg", help="Draw slices of the first grid."),
    ] = None,
    camera: CameraName = None,
) -> int:
    """Write which voxels are occupied, occluded, seen.

    The voxels around each frame, in the layouts of the benchmarks: occupied, occluded, invalid,
    and seen by which camera. The same command resumes an interrupted run.
    """
    frame_range = options.frame_range(frames)
    options.check_output_files({"--picture": picture}, [source, classes])
    options.check_picture_file(picture)
    options.check_no_input(out, [source])

    from intervis.drives import open_drive
    from intervis.run.stream import selected_frames
    from intervis.uses.voxels.drive_masks import (
        MaskSettings,
        drive_cameras,
        frame_masks,
        read_classes,
    )
    from intervis.uses.voxels.mask_run import MaskRun

    chosen = _layout(layout, definition, (corner, cell, shape))
    count = chosen.later if later is None else _whole("--later", later, 0)
    every = _whole("--stride", stride, 1)
    given_place = _lidar_place(chosen, lidar_at)
    class_map = None if classes is None else read_classes(classes)
    drive = open_drive(source, camera=camera)
    options.check_drive_kept(drive, [picture])
    grid_from_velo, mounting = _mounting(chosen, given_place, drive)
    settings = MaskSettings(chosen.grid, definition, count, keep_moving, grid_from_velo, class_map)
    numbers = selected_frames(drive.frame_numbers, frame_range)[::every]
    with_cameras = cameras and chosen.has_cameras and definition != "semantickitti"
    only = camera is not None
    posed = drive_cameras(source, drive, only_selected=only) if with_cameras else {}
    run = MaskRun(drive, numbers, chosen, settings, posed)
    done, masks = _written(run, out)
    if picture is not None and (masks is None or masks[0] != numbers[0]):
        masks = numbers[0], frame_masks(drive, numbers[0], settings, posed)
    _show(run, done, masks, mounting)
    show(f"Masks: {out}")
    if picture is not None and masks is not None:
        _draw(masks[1], settings, picture)
    for frame in done:
        if frame.failure:
            complain(f"frame {frame.number} failed: {frame.failure}")
    return 1 if any(frame.failure for frame in done) else 0


def _written(run: "MaskRun", out: Path) -> "tuple[list[MaskFrame], NumberedMasks | None]":
    """Write the masks: what became of each frame, and the masks of the first that was made."""
    first, done = None, []
    try:
        with progress("scans", run.steps) as advance, closing(run.write(out, advance)) as frames:
            for frame in frames:
                if first is None and frame.masks is not None:
                    first = frame.number, frame.masks
                done.append(replace(frame, masks=None))  # one frame is held at a time
    except KeyboardInterrupt:
        if not done:
            raise
        raise InterruptedRunError(
            f"interrupted: the same command resumes the masks in {out}."
        ) from None
    return done, first


def _show(
    run: "MaskRun", done: "list[MaskFrame]", masks: "NumberedMasks | None", mounting: str
) -> None:
    """Print what was written, and what the first masks hold."""
    from intervis.uses.voxels.drive_masks import later_frames

    drive, settings, count = run.drive, run.settings, run.settings.later
    fewer = sum(len(later_frames(drive, number, count)) < count for number in run.numbers)
    if fewer:
        have = "frame has" if fewer == 1 else "frames have"
        tell(f"note: {fewer} {have} fewer than {count} later scans in the drive to add.")
    for frame in done:
        if frame.remade:
            tell(f"note: frame {frame.number} was made again: {frame.remade}")
    frame_count = f"{len(done)} frame{'s' if len(done) != 1 else ''}"
    show(
        f"Drive {drive.name}, {frame_count}; layout {run.layout.name}, definition"
        f" {settings.definition}."
    )
    reused = sum(frame.reused for frame in done)
    if reused:
        show(f"Written by an earlier run: {reused} of {frame_count}.")
    if mounting:
        show(mounting)
    if masks is None:
        return
    if count and masks[1].label is not None:
        kept = "kept" if settings.keep_moving else MOVING_LEFT_OUT
        show(f"Moving things of later frames, by their labels: {kept}.")
    show(_shares(*masks))


def _draw(masks: "Masks", settings: "MaskSettings", picture: Path) -> None:
    from intervis.plots.style import save_figure
    from intervis.uses.voxels.mask_figure import mask_picture

    figure = mask_picture(masks, scanner_m=float(settings.grid_from_velo[2, 3]))
    save_figure(figure, picture, picture.suffix[1:].lower())
    show(f"Picture: {picture}")


def _whole(option: str, number: int, least: int) -> int:
    from intervis.errors import SettingsError

    if number < least:
        raise SettingsError(f"{option} must be {least} or more, got {number}.")
    return number


def _layout(
    name: str, definition: str, grid: tuple[str | None, float | None, str | None]
) -> "MaskLayout":
    """The layout of that name, with the grid of the options."""
    from intervis.errors import SettingsError
    from intervis.uses.voxels.mask_layouts import layout_named
    from intervis.uses.voxels.masks import DEFINITIONS

    layout = layout_named(name)
    if definition not in DEFINITIONS:
        raise SettingsError(
            f"there is no definition {definition!r}; choose one of {', '.join(DEFINITIONS)}."
        )
    if definition not in layout.definitions:
        raise SettingsError(
            f"the layout {name} has no room for masks of the definition {definition}; choose"
            f" {' or '.join(layout.definitions)}, or the layout npz."
        )
    if any(part is not None for part in grid):
        if name != "npz":
            raise SettingsError(f"the grid of {name} is fixed: choose the layout npz for another.")
        return replace(layout, grid=_grid(layout.grid, *grid))
    return layout


def _grid(
    default: "VoxelGrid", corner: str | None, cell: float | None, shape: str | None
) -> "VoxelGrid":
    from intervis.errors import SettingsError
    from intervis.uses.voxels.voxel_grid import VoxelGrid

    counts: list[int] | tuple[int, int, int] = default.shape
    if shape is not None:
        try:
            counts = [int(part) for part in shape.split(",")]
        except ValueError:
            raise SettingsError(f"--shape must be three whole numbers, got {shape!r}.") from None
    return VoxelGrid(
        default.corner if corner is None else options.coordinates(corner, "--corner"),
        default.cell_m if cell is None else cell,
        counts,
    )


def _lidar_place(layout: "MaskLayout", lidar_at: str | None) -> Point | None:
    """The place of the scanner that ``--lidar-at`` gives."""
    from intervis.errors import SettingsError

    if lidar_at is None:
        return None
    if layout.lidar_in_ego_m is None:
        raise SettingsError(f"--lidar-at has no use: the grid of {layout.name} is the LiDAR's.")
    return options.coordinates(lidar_at, "--lidar-at")


def _mounting(
    layout: "MaskLayout", given: Point | None, drive: "Drive"
) -> tuple["Float64Array", str]:
    """The frame of the grid from the scanner's, and a sentence that says whose it is."""
    import numpy as np

    from intervis.transform import rigid

    if layout.lidar_in_ego_m is None:
        return np.eye(4), ""
    if given is not None:
        pose, whose = rigid(np.eye(3), given), "as --lidar-at says"
    elif drive.ego_from_velo is not None:
        pose, whose = drive.ego_from_velo, "as the drive says"
    else:
        pose = rigid(np.eye(3), layout.lidar_in_ego_m)
        whose = (
            f"that of {layout.vehicle}, assumed because the drive says none: --lidar-at gives"
            " another"
        )
    place = ", ".join(f"{value:.2f}" for value in pose[:3, 3])
    return pose, f"Scanner at ({place}) m in the vehicle's frame, {whose}."


def _shares(number: int, masks: "Masks") -> str:
    """Shares of the states, which sum to 100 %, and of the masks, which overlap."""
    from intervis.uses.voxels.carving import STATES

    states = _listed((name, masks.state == value) for value, name in STATES.items())
    seen = [(f"seen by {name}", mask) for name, mask in masks.camera.items()]
    of_masks = _listed([("occluded", masks.occluded), ("invalid", masks.invalid), *seen])
    label = "" if masks.label is not None else "; no labels"
    return (
        f"Frame {number}, {masks.grid.size:,} voxels: {states}{label}.\n"
        f"Its masks, which overlap: {of_masks}."
    )


def _listed(parts: "Iterable[tuple[str, BoolArray]]") -> str:
    return ", ".join(f"{100 * float(mask.mean()):.1f} % {name}" for name, mask in parts)
