"""Visibility masks of a frame: what of a grid is occupied, occluded, invalid, and seen by whom.

Three definitions:

- ``exact``: the grid is carved by the scans (`Carver`). *Occluded* lies behind a
  surface that the scan of the frame observed. *Invalid* is what no scan observed, and an occupied
  voxel without a label where there are labels. A camera sees an observed voxel if its
  centre lies in the image and the sight line to it is visible (`intervis.Scene.sight`).
- ``semantickitti``: what SemanticKITTI's tool does (`voxelizer`); it needs labels.
- ``occ3d``: what the paper of Occ3D prints (arXiv:2304.14365, algorithms 1 to 3): a beam makes the
  voxels that it crosses free and the one in which it ends occupied, and occupied wins; the ray of
  each pixel takes over what the scanners observed, up to the first occupied voxel. *Invalid* is
  what no beam crossed; *occluded* is what no beam of the scan of the frame crossed.
"""

from __future__ import annotations  # help() shows the names of the array types

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from intervis.arguments import flag_of, mapping_of, object_of, objects_of, shown
from intervis.arrays import (
    BoolArray,
    Float32Array,
    Float64Array,
    FloatArray,
    UInt8Array,
    array_of,
    checked_points,
)
from intervis.errors import PointsError, SceneError, SettingsError
from intervis.progress import Progress, reporter, silent
from intervis.sight import Scene
from intervis.sight.kernels.carved_sums import FREE_SPACE, OCCLUDED, OCCUPIED, UNKNOWN
from intervis.transform import checked_pose, transform
from intervis.uses.voxels.camera_voxels import PosedCamera, in_view, seen_by_lines, seen_by_pixels
from intervis.uses.voxels.carving import CarvedGrid, Carver, is_return
from intervis.uses.voxels.kernels.ray_walk import CROSSED, ENDED, mark_beams
from intervis.uses.voxels.voxel_grid import VoxelGrid
from intervis.uses.voxels.voxelizer import MOVING_CLASSES, blocked_masks, tool_keeps, voted_labels

DEFINITIONS = ("exact", "semantickitti", "occ3d")


@dataclass(frozen=True, eq=False)
class PosedScan:
    """A scan and its place in the grid's frame.

    Attributes
    ----------
    points : (N, 3) float array
        Sensor frame, metres.
    grid_from_sensor : (4, 4) float64 array
    scanner : str
    labels : (N,) uint16 array or None
        Class of each point, 0 unlabelled.
    is_now : bool
        Whether it belongs to the frame itself; others are only added to its target.
    """

    points: FloatArray
    grid_from_sensor: Float64Array
    scanner: str = "lidar"
    labels: NDArray[np.uint16] | None = None
    is_now: bool = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", checked_points(self.points))
        pose = checked_pose(self.grid_from_sensor, "grid_from_sensor")
        object.__setattr__(self, "grid_from_sensor", pose)
        flag_of(self.is_now, "is_now")
        object_of(self.scanner, str, "the name of a scanner")
        if self.labels is not None:
            object.__setattr__(self, "labels", _checked_labels(self.labels, len(self.points)))

    def only(self, kept: BoolArray) -> PosedScan:
        """The scan with some of its points."""
        labels = None if self.labels is None else self.labels[kept]
        points = np.asarray(self.points[kept])
        return PosedScan(points, self.grid_from_sensor, self.scanner, labels, self.is_now)


def _checked_labels(labels: ArrayLike, count: int) -> NDArray[np.uint16]:
    """Classes (N,) of points."""
    array = array_of(labels, "labels")
    if array.shape != (count,) or array.dtype.kind not in "iu":
        raise PointsError(f"{count} points need as many labels, whole numbers.")
    if array.size and not (array.min() >= 0 and array.max() < 1 << 16):
        raise PointsError("labels must be classes from 0 to 65535.")
    return array.astype(np.uint16, copy=False)


@dataclass(frozen=True, eq=False)
class Masks:
    """Masks of a frame; every array has the shape (I, J, K) of the grid.

    Attributes
    ----------
    grid : VoxelGrid
    definition : str
    input : bool array
        Voxels with returns of the frame itself.
    occupied, free : bool array
        Of the target: the frame with the scans that were added.
    occluded, invalid : bool array
        See the definitions.
    label : uint16 array or None
        Class of most returns; None without labels.
    lidar : mapping of str to bool array
        What each scanner of the frame observed.
    camera : mapping of str to bool array
        What each camera of the frame sees.
    posed : mapping of str to PosedCamera
        These cameras.
    state : uint8 array
        As `intervis.uses.voxels.carving.CarvedGrid.state`.
    probability : float32 array or None
        P(occupied); ``exact`` only.
    """

    grid: VoxelGrid
    definition: str
    input: BoolArray
    occupied: BoolArray
    free: BoolArray
    occluded: BoolArray
    invalid: BoolArray
    state: UInt8Array
    label: NDArray[np.uint16] | None = None
    lidar: Mapping[str, BoolArray] = field(default_factory=dict)
    camera: Mapping[str, BoolArray] = field(default_factory=dict)
    probability: Float32Array | None = None
    posed: Mapping[str, PosedCamera] = field(default_factory=dict)

    @property
    def mask_lidar(self) -> BoolArray:
        """What the scans of the target observed."""
        return self.free | self.occupied

    @property
    def mask_camera(self) -> BoolArray:
        """What some camera sees."""
        return _any_of(self.grid, self.camera.values())

    @property
    def in_view(self) -> BoolArray:
        """Voxels whose centre lies in the image of some camera, hidden or not; made when asked."""
        return _any_of(self.grid, (in_view(self.grid, posed) for posed in self.posed.values()))


def _any_of(grid: VoxelGrid, masks: Iterable[BoolArray]) -> BoolArray:
    found = np.zeros(grid.shape, np.bool_)
    for mask in masks:
        found |= mask
    return found


def masks_of(
    grid: VoxelGrid,
    scans: Sequence[PosedScan],
    *,
    definition: str = "exact",
    cameras: Mapping[str, PosedCamera] | None = None,
    keep_moving: bool = False,
    progress: Progress | None = None,
) -> Masks:
    """The masks of a frame.

    Parameters
    ----------
    grid : VoxelGrid
    scans : sequence of PosedScan
        Those of the frame first, then those that are added to its target.
    definition : str
        One of `DEFINITIONS`.
    cameras : mapping of str to PosedCamera
    keep_moving : bool
        False: of scans with labels that are added, returns of moving classes
        (`intervis.uses.voxels.voxelizer.MOVING_CLASSES`) are left out.
    progress : callable, optional
        Called with a note for each scan.

    Raises
    ------
    SettingsError
        The definition is unknown, or needs labels that a scan does not have.
    SceneError
        There is no scan of the frame itself.
    """
    object_of(grid, VoxelGrid, "grid")
    scans = objects_of(scans, PosedScan, "scans")
    if cameras is not None:
        objects_of(mapping_of(cameras, "cameras").values(), PosedCamera, "cameras")
    if not any(scan.is_now for scan in scans):
        raise SceneError("masks need a scan of the frame itself: one with is_now.")
    if not isinstance(definition, str) or definition not in DEFINITIONS:
        raise SettingsError(
            f"there is no definition {shown(definition)}; choose one of {', '.join(DEFINITIONS)}."
        )
    returns = [scan.only(is_return(scan.points)) for scan in scans]
    kept = (
        returns
        if flag_of(keep_moving, "keep_moving")
        else [_without_moving(scan) for scan in returns]
    )
    make = {"exact": _exact, "semantickitti": _semantickitti, "occ3d": _occ3d}[definition]
    return make(grid, kept, cameras or {}, reporter(progress))


def _without_moving(scan: PosedScan) -> PosedScan:
    if scan.labels is None or scan.is_now:
        return scan
    return scan.only(~np.isin(scan.labels, list(MOVING_CLASSES)))


def _voted(grid: VoxelGrid, scans: Sequence[PosedScan]) -> NDArray[np.uint16] | None:
    """The label of most returns of each voxel; None where some scan has none."""
    return None if any(scan.labels is None for scan in scans) else _votes(grid, scans)[1]


def _votes(grid: VoxelGrid, scans: Sequence[PosedScan]) -> tuple[BoolArray, NDArray[np.uint16]]:
    """Voxels with labelled returns, and the label of most of them."""
    return voted_labels(
        grid,
        (
            (transform(scan.grid_from_sensor, scan.points), scan.labels)
            for scan in scans
            if scan.labels is not None
        ),
    )


def _exact(
    grid: VoxelGrid,
    scans: Sequence[PosedScan],
    cameras: Mapping[str, PosedCamera],
    progress: Progress,
) -> Masks:
    now = [scan for scan in scans if scan.is_now]
    of_now = _carved(grid, now)
    whole = of_now if len(now) == len(scans) else _carved(grid, scans, progress)
    observed, label = _observed(whole), _voted(grid, scans)
    return Masks(
        grid,
        "exact",
        input=_held(grid, now),
        occupied=whole.occupied,
        free=whole.free,
        occluded=of_now.occluded,
        invalid=~observed if label is None else ~observed | (whole.occupied & (label == 0)),
        state=whole.state,
        label=label,
        lidar={
            scan.scanner: _observed(of_now if len(now) == 1 else _carved(grid, [scan]))
            for scan in now
        },
        camera=_seen_by_lines(grid, observed, now, cameras),
        posed=cameras,
        probability=whole.probability,
    )


def _seen_by_lines(
    grid: VoxelGrid,
    observed: BoolArray,
    scans: Sequence[PosedScan],
    cameras: Mapping[str, PosedCamera],
) -> dict[str, BoolArray]:
    if not cameras:
        return {}
    scene = Scene(max_scans=len(scans))
    for scan in scans:
        scene.add(scan.points, scan.grid_from_sensor)
    return {name: seen_by_lines(grid, observed, posed, scene) for name, posed in cameras.items()}


def _semantickitti(
    grid: VoxelGrid,
    scans: Sequence[PosedScan],
    cameras: Mapping[str, PosedCamera],
    progress: Progress,
) -> Masks:
    if cameras:
        raise SettingsError("the definition semantickitti has no masks of cameras: leave them out.")
    if any(scan.labels is None for scan in scans):
        raise SettingsError(
            "the definition semantickitti needs labels of points for every scan, because"
            " SemanticKITTI's tool skips scans without: add labels/*.label, or choose the"
            " definition exact."
        )
    entered = [scan.only(tool_keeps(scan.points)) for scan in scans]
    now = [scan for scan in entered if scan.is_now]
    occupied, label = _votes(grid, entered)
    progress("labels")
    later = np.array([scan.grid_from_sensor[:3, 3] for scan in entered if not scan.is_now])
    occluded, invalid = blocked_masks(grid, occupied, later)
    progress("walks")
    state = np.where(occupied, OCCUPIED, np.where(invalid, OCCLUDED, FREE_SPACE)).astype(np.uint8)
    return Masks(
        grid,
        "semantickitti",
        input=_votes(grid, now)[1] > 0,
        occupied=occupied,
        free=state == FREE_SPACE,
        occluded=occluded,
        invalid=invalid,
        state=state,
        label=label,
    )


def _occ3d(
    grid: VoxelGrid,
    scans: Sequence[PosedScan],
    cameras: Mapping[str, PosedCamera],
    progress: Progress,
) -> Masks:
    marks, of_scanner = np.zeros(grid.shape, np.uint8), {}
    of_now = np.zeros(grid.shape, np.uint8)
    for scan in scans:
        mine = beam_marks(
            grid, transform(scan.grid_from_sensor, scan.points), scan.grid_from_sensor
        )
        marks |= mine
        if scan.is_now:
            of_scanner[scan.scanner] = mine > 0
            of_now |= mine
        progress("scan")
    occupied = (marks & ENDED) > 0
    state = np.where(occupied, OCCUPIED, np.where(marks & CROSSED, FREE_SPACE, UNKNOWN))
    state = state.astype(np.uint8)
    seen = {name: seen_by_pixels(grid, state, posed) > 0 for name, posed in cameras.items()}
    return Masks(
        grid,
        "occ3d",
        input=(of_now & ENDED) > 0,
        occupied=occupied,
        free=state == FREE_SPACE,
        occluded=of_now == 0,
        invalid=state == UNKNOWN,
        state=state,
        label=_voted(grid, scans),
        lidar=of_scanner,
        camera=seen,
        posed=cameras,
    )


def beam_marks(grid: VoxelGrid, points: FloatArray, grid_from_sensor: Float64Array) -> UInt8Array:
    """Marks (I, J, K) of the voxels that beams to points (N, 3) cross and end in."""
    marks = np.zeros(grid.shape, np.uint8)
    origin = (grid_from_sensor[:3, 3] - grid.corner) / grid.cell_m
    ends = (np.asarray(points, np.float64) - grid.corner) / grid.cell_m

    mark_beams(origin, ends, marks)  # on one thread: marks are read, changed and written
    return marks


def _carved(grid: VoxelGrid, scans: Sequence[PosedScan], progress: Progress = silent) -> CarvedGrid:
    carver = Carver(grid)
    for scan in scans:
        carver.add(scan.points, scan.grid_from_sensor, now=scan.is_now)
        progress("scan")
    return carver.result()


def _observed(carved: CarvedGrid) -> BoolArray:
    return carved.free | carved.occupied


def _held(grid: VoxelGrid, scans: Sequence[PosedScan]) -> BoolArray:
    """Voxels with returns."""
    points = [transform(scan.grid_from_sensor, scan.points) for scan in scans]
    return grid.occupied_by(np.concatenate(points))
