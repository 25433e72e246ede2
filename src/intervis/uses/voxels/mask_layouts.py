"""Files of masks, in the layouts of the benchmarks.

Arrays are in C order, indexed [x, y, z]. Where the frame of the grid is nuScenes' LiDAR (x right,
y ahead), the arrays are turned from the axes of this package (x ahead, y left) when written.
"""

from __future__ import annotations  # help() shows the names of the array types

import io
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from intervis.errors import OutputError
from intervis.uses.voxels.masks import Masks
from intervis.uses.voxels.voxel_grid import VoxelGrid
from intervis.uses.voxels.voxelizer import LATER_SCANS

OCC3D_FREE = 17
"""Occ3D-nuScenes' class of free voxels."""
LIDAR_IN_NUSCENES_EGO_M = (0.943713, 0.0, 1.84023)
"""Where the LiDAR of nuScenes stands in the vehicle's frame, metres."""
WAYMO_FREE = 23
"""Occ3D-Waymo's class of free voxels, as its files hold it."""
LIDAR_IN_WAYMO_VEHICLE_M = (1.43, 0.0, 2.184)
"""Where the top LiDAR of Waymo's cars stands in the vehicle's frame, metres."""


@dataclass(frozen=True)
class FrameName:
    """How files of a frame are named: its drive, number, and the stem of its scan's file."""

    drive: str
    number: int
    scan: str


Writer = Callable[[FrameName, Masks], dict[str, bytes]]
"""Content of the files of a frame by their path below the output folder."""


@dataclass(frozen=True)
class MaskLayout:
    """A layout: its grid, and how its files are written.

    Attributes
    ----------
    name : str
    grid : VoxelGrid
        In the frame of the scanner, or of the vehicle where `lidar_in_ego_m` is given.
    definitions : tuple of str
        Definitions whose masks the layout can hold; the first one is the benchmark's own.
    write : Writer
    later : int
        How many later frames the benchmark adds to a target.
    has_cameras : bool
        Whether it holds masks of cameras.
    lidar_in_ego_m : three floats or None
        Place of the scanner in the vehicle's frame.
    vehicle : str
        Whose that place is.
    """

    name: str
    grid: VoxelGrid
    definitions: tuple[str, ...]
    write: Writer
    later: int = 0
    has_cameras: bool = True
    lidar_in_ego_m: tuple[float, float, float] | None = None
    vehicle: str = "nuScenes"


def _bits(mask: NDArray[Any]) -> bytes:
    """A mask as bits, the most significant first."""
    return np.packbits(mask.ravel()).tobytes()


def _labels(masks: Masks, dtype: str = "<u2") -> bytes:
    assert masks.label is not None
    return masks.label.astype(dtype).tobytes()


def _npz(**arrays: Any) -> bytes:
    file = io.BytesIO()
    np.savez_compressed(file, **arrays)
    return file.getvalue()


def _npy(array: NDArray[Any]) -> bytes:
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()


def _semantickitti(name: FrameName, masks: Masks) -> dict[str, bytes]:
    stem = f"voxels/{name.number:06d}"
    files = {
        f"{stem}.bin": _bits(masks.input),
        f"{stem}.occluded": _bits(masks.occluded),
        f"{stem}.invalid": _bits(masks.invalid),
    }
    return files | ({f"{stem}.label": _labels(masks)} if masks.label is not None else {})


def _sscbench_nuscenes(name: FrameName, masks: Masks) -> dict[str, bytes]:
    stem = f"voxels/{name.number:04d}"
    files = {f"{stem}.bin": _bits(masks.input), f"{stem}.invalid": _bits(masks.invalid)}
    return files | ({f"{stem}.label": _labels(masks)} if masks.label is not None else {})


def _sscbench_kitti_360(name: FrameName, masks: Masks) -> dict[str, bytes]:
    stem = f"voxels/{name.number:06d}"
    files = {
        f"{stem}.bin": _bits(masks.input),
        f"{stem}.invalid": masks.invalid.astype(np.uint8).tobytes(),  # a byte for each voxel
    }
    return files | ({f"{stem}.label": _labels(masks)} if masks.label is not None else {})


def _sscbench_waymo(name: FrameName, masks: Masks) -> dict[str, bytes]:
    arrays: dict[str, NDArray[Any]] = {
        "input": masks.input.astype(np.uint8),
        "invalid": masks.invalid.astype(np.uint8),
    }
    if masks.label is not None:
        arrays["labels"] = masks.label
    return {f"voxels/{name.number:03d}.npz": _npz(**arrays)}


def _semantics(masks: Masks, free: int) -> NDArray[np.uint8]:
    """Class of each voxel (I, J, K)."""
    semantics = np.full(masks.grid.shape, free, np.uint8)
    semantics[masks.occupied] = _classes(masks)
    return semantics


def _occ3d_nuscenes(name: FrameName, masks: Masks) -> dict[str, bytes]:
    content = _npz(
        semantics=_semantics(masks, OCC3D_FREE),
        mask_lidar=masks.mask_lidar.astype(np.uint8),
        mask_camera=masks.mask_camera.astype(np.uint8),
    )
    return {f"gts/{name.drive}/{name.number:06d}/labels.npz": content}


def _occ3d_waymo(name: FrameName, masks: Masks) -> dict[str, bytes]:
    content = _npz(
        voxel_label=_semantics(masks, WAYMO_FREE),
        origin_voxel_state=masks.mask_lidar.astype(np.uint8),
        final_voxel_state=masks.mask_camera.astype(np.uint8),
        infov=masks.in_view,
    )
    return {f"{name.drive}/{name.number:03d}_04.npz": content}


def _classes(masks: Masks) -> NDArray[np.uint8]:
    """Class of each occupied voxel, in the order of `numpy.argwhere`; 0 without labels."""
    if masks.label is None:
        return np.zeros(np.count_nonzero(masks.occupied), np.uint8)
    labels = masks.label[masks.occupied]
    if len(labels) and labels.max() > 255:
        raise OutputError(
            f"the layout holds classes up to 255, and the labels go up to {labels.max()}: map them"
            " with --classes FILE.json."
        )
    return labels.astype(np.uint8)


def _file_axes(array: NDArray[Any]) -> NDArray[Any]:
    """An array [x ahead, y left, z] as [x right, y ahead, z]."""
    return np.asarray(np.swapaxes(array[:, ::-1], 0, 1))


def _rows(masks: Masks, order: tuple[int, int, int]) -> NDArray[np.int64]:
    """Rows of the occupied voxels in nuScenes' axes: indices in an order of axes, class."""
    occupied = _file_axes(masks.occupied)
    label = np.zeros(masks.grid.shape, np.int64)
    label[masks.occupied] = _classes(masks)
    index = np.argwhere(occupied)
    return np.column_stack([index[:, order], _file_axes(label)[occupied]])


def _mask_file(masks: Masks) -> bytes:
    return _npz(
        mask_lidar=_file_axes(masks.mask_lidar).astype(np.uint8),
        mask_camera=_file_axes(masks.mask_camera).astype(np.uint8),
    )


def _surroundocc(name: FrameName, masks: Masks) -> dict[str, bytes]:
    return {
        f"samples/{name.scan}.npy": _npy(_rows(masks, (0, 1, 2))),
        f"masks/{name.scan}.npz": _mask_file(masks),
    }


def _openoccupancy(name: FrameName, masks: Masks) -> dict[str, bytes]:
    folder = f"scene_{name.drive}"
    return {
        f"{folder}/occupancy/{name.number:06d}.npy": _npy(_rows(masks, (2, 1, 0))),
        f"{folder}/masks/{name.number:06d}.npz": _mask_file(masks),
    }


def _occnet(name: FrameName, masks: Masks) -> dict[str, bytes]:
    seen = masks.mask_camera if masks.camera else masks.mask_lidar
    stem = f"{name.drive}/{name.number:03d}"
    return {
        f"{stem}_occ.npy": _npy(_flat_rows(masks)),
        f"{stem}_occ_invalid.npy": _npy(np.flatnonzero(_x_fastest(~seen & ~masks.occupied))),
    }


def _x_fastest(array: NDArray[Any]) -> NDArray[Any]:
    """An array in nuScenes' axes as a row, x + X (y + Y z)."""
    return _file_axes(array).ravel(order="F")


def _flat_rows(masks: Masks) -> NDArray[np.int64]:
    """Rows of the occupied voxels: index in the row of `_x_fastest`, class."""
    label = np.zeros(masks.grid.shape, np.int64)
    label[masks.occupied] = _classes(masks)
    index = np.flatnonzero(_x_fastest(masks.occupied))
    return np.column_stack([index, _x_fastest(label)[index]])


def _plain(name: FrameName, masks: Masks) -> dict[str, bytes]:
    arrays: dict[str, Any] = {
        "state": masks.state,
        "input": masks.input,
        "occluded": masks.occluded,
        "invalid": masks.invalid,
        "mask_lidar": masks.mask_lidar,
        "mask_camera": masks.mask_camera,
        "corner": masks.grid.corner,
        "cell_m": masks.grid.cell_m,
        **{f"mask_lidar_{key}": mask for key, mask in masks.lidar.items()},
        **{f"mask_camera_{key}": mask for key, mask in masks.camera.items()},
    }
    if masks.label is not None:
        arrays["label"] = masks.label
    if masks.probability is not None:
        arrays["probability"] = masks.probability
    return {f"{name.number:06d}.npz": _npz(**arrays)}


_KITTI_GRID = VoxelGrid([0.0, -25.6, -2.0], 0.2, (256, 256, 32))
_KITTI = ("semantickitti", "exact")
_RAYS = ("occ3d", "exact")
LAYOUTS: dict[str, MaskLayout] = {
    layout.name: layout
    for layout in (
        MaskLayout(
            "semantickitti",
            _KITTI_GRID,
            _KITTI,
            _semantickitti,
            later=LATER_SCANS,
            has_cameras=False,
        ),
        MaskLayout(
            "sscbench-nuscenes",
            _KITTI_GRID,
            _KITTI,
            _sscbench_nuscenes,
            later=70,
            has_cameras=False,
        ),
        MaskLayout(
            "sscbench-kitti360",
            _KITTI_GRID,
            _KITTI,
            _sscbench_kitti_360,
            later=70,
            has_cameras=False,
        ),
        MaskLayout(
            "sscbench-waymo",
            _KITTI_GRID,
            _KITTI,
            _sscbench_waymo,
            later=LATER_SCANS,
            has_cameras=False,
        ),
        MaskLayout(
            "occ3d-nuscenes",
            VoxelGrid([-40.0, -40.0, -1.0], 0.4, (200, 200, 16)),
            _RAYS,
            _occ3d_nuscenes,
            lidar_in_ego_m=LIDAR_IN_NUSCENES_EGO_M,
        ),
        MaskLayout(
            "occ3d-waymo",
            VoxelGrid([-40.0, -40.0, -1.0], 0.4, (200, 200, 16)),
            _RAYS,
            _occ3d_waymo,
            lidar_in_ego_m=LIDAR_IN_WAYMO_VEHICLE_M,
            vehicle="Waymo",
        ),
        MaskLayout(
            "surroundocc",
            VoxelGrid([-50.0, -50.0, -5.0], 0.5, (200, 200, 16)),
            _RAYS,
            _surroundocc,
        ),
        MaskLayout(
            "occnet",
            VoxelGrid([-50.0, -50.0, -5.0], 0.5, (200, 200, 16)),
            _RAYS,
            _occnet,
        ),
        MaskLayout(
            "openoccupancy",
            VoxelGrid([-51.2, -51.2, -5.0], 0.2, (512, 512, 40)),
            _RAYS,
            _openoccupancy,
        ),
        MaskLayout("npz", _KITTI_GRID, ("exact", "semantickitti", "occ3d"), _plain),
    )
}
"""The layouts by name."""


def layout_named(name: str) -> MaskLayout:
    """The layout of that name.

    Raises
    ------
    OutputError
        There is none.
    """
    if name not in LAYOUTS:
        raise OutputError(f"there is no layout {name!r}; choose one of {', '.join(LAYOUTS)}.")
    return LAYOUTS[name]
