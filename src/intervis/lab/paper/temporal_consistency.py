"""Temporal consistency: how much of the intervisible region stays from one frame to the next.

The paper says that its results "between consecutive frames are stable and robust" and gives no
number. Here the region of each frame is drawn on one grid over the ground of the world frame, and
two consecutive frames are compared by intersection over union (IoU) on the cells that both meshes
cover.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from intervis.arrays import BoolArray, Float64Array, IntArray
from intervis.lab.paper.experiment import camera_arguments, usable
from intervis.lab.paper.printed_values import (
    GLOBAL_POINTS,
    INTERPOLATION_POINTS,
    PROPOSED,
)
from intervis.method.analysis import Analysis, analyze
from intervis.method.comparison import global_points, interpolation_points
from intervis.progress import Progress, reporter
from intervis.settings import Settings
from intervis.transform import transform

if TYPE_CHECKING:
    from intervis.drives import Drive, Frame

CELL_M = 0.5
"""Side of a cell of the ground grid, metres."""

EMPTY, COVERED, IN_REGION = 0, 1, 2
"""States of a cell: outside the mesh, in the mesh, in the intervisible region."""


@dataclass(frozen=True, eq=False)
class GroundRegion:
    """The mesh and the region of one frame on the ground grid of the world frame.

    Attributes
    ----------
    corner : (2,) int64 array
        Column and row of the first cell, in cells from the world origin.
    cells : (columns, rows) int8 array
        State of each cell's centre: 0 outside the mesh, 1 in the mesh, 2 in the region.
    """

    corner: IntArray
    cells: NDArray[np.int8]


@dataclass(frozen=True)
class Overlap:
    """Two regions compared on the cells that both meshes cover.

    Attributes
    ----------
    iou : float
        Cells in both regions over cells in at least one; NaN where no cell is in a region.
    chance : float
        IoU expected of two regions of the same sizes whose cells are drawn at random.
    common_m2 : float
        Ground area that both meshes cover, square metres.
    """

    iou: float
    chance: float
    common_m2: float


@dataclass(frozen=True, eq=False)
class TemporalConsistency:
    """One method over the consecutive frames of a drive.

    Attributes
    ----------
    method : str
    numbers : tuple of int
        The M frame numbers.
    overlaps : tuple of Overlap
        One for each of the M - 1 pairs of consecutive frames.
    TPI, nodes_intervisible, area_m2 : (M,) float64 arrays
        TPI in per cent, share of intervisible nodes in per cent, and area of the region.
    """

    method: str
    numbers: tuple[int, ...]
    overlaps: tuple[Overlap, ...]
    TPI: Float64Array
    nodes_intervisible: Float64Array
    area_m2: Float64Array

    @property
    def iou(self) -> float:
        """Mean IoU over the pairs that have one; NaN where none has."""
        return mean_known([overlap.iou for overlap in self.overlaps])

    @property
    def chance(self) -> float:
        """Mean IoU expected by chance; NaN where no pair has one."""
        return mean_known([overlap.chance for overlap in self.overlaps])

    @property
    def beyond_chance(self) -> float:
        """(IoU - chance) / (1 - chance): 0 for random regions, 1 for identical ones."""
        return (self.iou - self.chance) / (1.0 - self.chance)


def mean_known(values: Sequence[float]) -> float:
    """Mean of the values that are not NaN; NaN where all are."""
    known = [value for value in values if not np.isnan(value)]
    return float(np.mean(known)) if known else float("nan")


def sample_std(values: Sequence[float] | Float64Array) -> float:
    """Sample standard deviation; NaN for fewer than two values."""
    return float(np.std(values, ddof=1)) if len(values) > 1 else float("nan")


def follow_drive(
    drive: "Drive",
    numbers: Sequence[int],
    settings: Settings,
    *,
    with_global: bool = True,
    progress: Progress | None = None,
) -> list[TemporalConsistency]:
    """Measure each method over the same consecutive frames, which must have poses."""
    progress = reporter(progress)
    methods: dict[str, Callable[[Frame, Settings], Analysis]] = {
        PROPOSED: lambda frame, used: analyze(
            frame.points, settings=used, **camera_arguments(frame)
        ),
        INTERPOLATION_POINTS: lambda frame, used: interpolation_points(
            frame.points, settings=used, **camera_arguments(frame)
        ),
    }
    if with_global:
        methods[GLOBAL_POINTS] = lambda frame, _: global_points(
            frame.points, **camera_arguments(frame)
        )
    regions: dict[str, list[GroundRegion]] = {name: [] for name in methods}
    measured: dict[str, list[tuple[float, float]]] = {name: [] for name in methods}
    for number in numbers:
        frame, used, _ = usable(drive[number], settings)
        assert frame.pose is not None
        for name, method in methods.items():
            result = method(frame, used)
            regions[name].append(
                ground_region(result.node_points, result.triangles, result.region, frame.pose)
            )
            measured[name].append((result.measures.TPI, 100 * result.node_intervisible.mean()))
        progress(f"temporal consistency, frame {number}")
    return [temporal_consistency(name, numbers, regions[name], measured[name]) for name in methods]


def temporal_consistency(
    method: str,
    numbers: Sequence[int],
    regions: Sequence[GroundRegion],
    measured: Sequence[tuple[float, float]],
) -> TemporalConsistency:
    """Compare the regions of consecutive frames.

    Parameters
    ----------
    method : str
    numbers : (M,) sequence of int
    regions : (M,) sequence of GroundRegion
    measured : (M,) sequence of (float, float)
        TPI and share of intervisible nodes of each frame, per cent.
    """
    columns = np.array(measured, dtype=np.float64).reshape(-1, 2)
    area_m2 = [CELL_M**2 * float((region.cells == IN_REGION).sum()) for region in regions]
    return TemporalConsistency(
        method=method,
        numbers=tuple(numbers),
        overlaps=tuple(overlap(first, second) for first, second in pairwise(regions)),
        TPI=columns[:, 0],
        nodes_intervisible=columns[:, 1],
        area_m2=np.array(area_m2),
    )


def ground_region(
    points_velo: Float64Array,
    triangles: IntArray,
    region: BoolArray,
    world_from_velo: Float64Array,
) -> GroundRegion:
    """Draw a mesh and its region on the ground grid of the world frame.

    Parameters
    ----------
    points_velo : (V, 3) float64 array
    triangles : (F, 3) int64 array
    region : (F,) bool array
        Triangles of the intervisible region. A cell that lies in one of them is in the region,
        whatever other triangles cover it.
    world_from_velo : (4, 4) float64 array
    """
    ground = transform(world_from_velo, points_velo)[:, :2] / CELL_M
    if len(triangles) == 0:
        return GroundRegion(np.zeros(2, np.int64), np.zeros((1, 1), np.int8))
    corner = np.floor(ground.min(axis=0)).astype(np.int64)
    columns, rows = np.ceil(ground.max(axis=0)).astype(np.int64) - corner + 1
    corners = (ground - corner)[triangles]
    cells = np.where(_covered(corners, columns, rows), COVERED, EMPTY).astype(np.int8)
    cells[_covered(corners[region], columns, rows)] = IN_REGION
    return GroundRegion(corner, cells)


def _covered(corners: Float64Array, columns: int, rows: int) -> BoolArray:
    """(columns, rows) cells whose centre lies in one of (F, 3, 2) triangles, borders included.

    Each triangle is cut along the centre line x = i + 0.5 of every column i that it crosses. The
    cut is an interval of rows: +1 is written at its first row and -1 behind its last, and a
    cumulative sum along each column counts the triangles over each cell.
    """
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    double_area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (
        c[:, 0] - a[:, 0]
    )
    corners = corners[double_area != 0]
    first = np.ceil(corners[:, :, 0].min(axis=1) - 0.5).astype(np.int64)
    last = np.floor(corners[:, :, 0].max(axis=1) - 0.5).astype(np.int64)
    count = np.maximum(last - first + 1, 0)
    triangle = np.repeat(np.arange(len(corners)), count)
    column = np.arange(len(triangle)) - np.repeat(np.cumsum(count) - count, count) + first[triangle]
    start, stop = corners[triangle], np.roll(corners, -1, axis=1)[triangle]
    run = stop[:, :, 0] - start[:, :, 0]
    along = column[:, None] + 0.5 - start[:, :, 0]
    with np.errstate(divide="ignore", invalid="ignore"):  # a side along y has run 0
        share = along / run
        y = start[:, :, 1] + share * (stop[:, :, 1] - start[:, :, 1])
    y[~((share >= 0) & (share <= 1))] = np.nan
    low = np.ceil(np.nanmin(y, axis=1) - 0.5).astype(np.int64)
    high = np.floor(np.nanmax(y, axis=1) - 0.5).astype(np.int64)
    change = np.zeros((columns, rows + 1), np.int64)
    hit = low <= high
    np.add.at(change, (column[hit], low[hit]), 1)
    np.add.at(change, (column[hit], high[hit] + 1), -1)
    covered: BoolArray = np.cumsum(change, axis=1)[:, :rows] > 0
    return covered


def overlap(first: GroundRegion, second: GroundRegion) -> Overlap:
    """Compare two regions on the cells that both meshes cover.

    Examples
    --------
    >>> here = GroundRegion(np.array([0, 0]), np.array([[2, 2, 1, 0]], np.int8))
    >>> there = GroundRegion(np.array([0, 1]), np.array([[2, 2, 1]], np.int8))
    >>> overlap(here, there).iou
    0.5
    """
    low = np.maximum(first.corner, second.corner)
    high = np.minimum(first.corner + first.cells.shape, second.corner + second.cells.shape)
    if (high <= low).any():
        return Overlap(float("nan"), float("nan"), 0.0)
    a, b = (_window(region, low, high) for region in (first, second))
    common = (a > EMPTY) & (b > EMPTY)
    count = int(common.sum())
    in_a, in_b = common & (a == IN_REGION), common & (b == IN_REGION)
    union = int((in_a | in_b).sum())
    share_a, share_b = in_a.sum() / max(count, 1), in_b.sum() / max(count, 1)
    both = share_a * share_b
    either = share_a + share_b - both
    return Overlap(
        iou=float((in_a & in_b).sum()) / union if union else float("nan"),
        chance=float(both / either) if union else float("nan"),
        common_m2=CELL_M**2 * count,
    )


def _window(region: GroundRegion, low: IntArray, high: IntArray) -> NDArray[np.int8]:
    start, stop = low - region.corner, high - region.corner
    return region.cells[start[0] : stop[0], start[1] : stop[1]]
