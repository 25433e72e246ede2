"""Steady from frame to frame: the intervisible region laid over itself by the poses.

The paper says that its results "between consecutive frames are stable and robust" and gives no
number. Here is one: the region of each frame is drawn on one grid over the ground of the world, and
two consecutive frames are compared on the cells that both their meshes cover.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from intervis.arrays import BoolArray, Float64Array, IntArray
from intervis.kernels import kernel
from intervis.lab.paper.experiment import Step, mount, usable
from intervis.method.analysis import Analysis, analyze
from intervis.method.comparison import global_points, interpolation_points
from intervis.settings import Settings
from intervis.transform import transform

if TYPE_CHECKING:
    from intervis.drives import Drive, Frame

CELL_M = 0.5
"""Side of a cell of the ground grid, metres."""

NOTHING, COVERED, IN_REGION = 0, 1, 2


@dataclass(frozen=True, eq=False)
class GroundRegion:
    """One frame's mesh and region on the ground grid of the world.

    Attributes
    ----------
    corner : (2,) int64 array
        Column and row of the first cell, in cells from the origin of the world.
    cells : (columns, rows) int8 array
        0 nothing, 1 the mesh covers the cell's centre, 2 the region does.
    """

    corner: IntArray
    cells: NDArray[np.int8]


@dataclass(frozen=True)
class Overlap:
    """Two regions on the cells that both meshes cover.

    Attributes
    ----------
    iou : float
        Cells in both regions over cells in one of them; NaN where neither has any.
    chance : float
        The same for two regions of these sizes strewn at random over these cells.
    common_m2 : float
        Ground that both meshes cover, square metres.
    """

    iou: float
    chance: float
    common_m2: float


@dataclass(frozen=True, eq=False)
class Steadiness:
    """One method along a drive.

    Attributes
    ----------
    method : str
    numbers : tuple of int
        Frames.
    overlaps : tuple of Overlap
        One for each pair of consecutive frames.
    TPI, seen, area_m2 : (M,) float64 arrays
        Per cent, share of intervisible nodes in per cent, and area of the region, for each frame.
    """

    method: str
    numbers: tuple[int, ...]
    overlaps: tuple[Overlap, ...]
    TPI: Float64Array
    seen: Float64Array
    area_m2: Float64Array

    @property
    def iou(self) -> float:
        """Mean over the pairs."""
        return float(np.nanmean([overlap.iou for overlap in self.overlaps]))

    @property
    def chance(self) -> float:
        """Mean of what chance would give."""
        return float(np.nanmean([overlap.chance for overlap in self.overlaps]))

    @property
    def beyond_chance(self) -> float:
        """(IoU - chance) / (1 - chance): 0 for strewn regions, 1 for regions that stay."""
        return (self.iou - self.chance) / (1.0 - self.chance)


def follow_drive(
    drive: "Drive",
    numbers: Sequence[int],
    settings: Settings,
    *,
    with_global: bool = True,
    step: Step = lambda note: None,
) -> list[Steadiness]:
    """The three methods over the same consecutive frames, which must have poses."""
    methods: dict[str, Callable[[Frame, Settings], Analysis]] = {
        "ours": lambda frame, used: analyze(frame.points, settings=used, **mount(frame)),
        "interpolation points": lambda frame, used: interpolation_points(
            frame.points, settings=used, **mount(frame)
        ),
    }
    if with_global:
        methods["global points"] = lambda frame, _: global_points(frame.points, **mount(frame))
    regions: dict[str, list[GroundRegion]] = {name: [] for name in methods}
    measured: dict[str, list[tuple[float, float]]] = {name: [] for name in methods}
    for number in numbers:
        frame, used, _ = usable(drive[number], settings)
        assert frame.pose is not None
        for name, method in methods.items():
            result = method(frame, used)
            regions[name].append(ground_region(result, frame.pose))
            measured[name].append((result.measures.TPI, 100 * result.node_intervisible.mean()))
        step(f"steadiness, frame {number}")
    return [steadiness(name, numbers, regions[name], measured[name]) for name in methods]


def steadiness(
    method: str,
    numbers: Sequence[int],
    regions: Sequence[GroundRegion],
    measured: Sequence[tuple[float, float]],
) -> Steadiness:
    """Put the regions and measures of consecutive frames together."""
    columns = np.array(measured, dtype=np.float64).reshape(-1, 2)
    area_m2 = [CELL_M**2 * float((region.cells == IN_REGION).sum()) for region in regions]
    return Steadiness(
        method=method,
        numbers=tuple(numbers),
        overlaps=tuple(overlap(first, second) for first, second in pairwise(regions)),
        TPI=columns[:, 0],
        seen=columns[:, 1],
        area_m2=np.array(area_m2),
    )


def ground_region(result: Analysis, world_from_velo: Float64Array) -> GroundRegion:
    """A frame's mesh and region, moved to the world and drawn on its ground grid."""
    return draw_region(result.node_points, result.triangles, result.region, world_from_velo)


def draw_region(
    points: Float64Array, triangles: IntArray, region: BoolArray, world_from_velo: Float64Array
) -> GroundRegion:
    """A mesh of (V, 3) points and its region, moved to the world and drawn on its ground grid."""
    ground = transform(world_from_velo, points)[:, :2] / CELL_M
    if len(triangles) == 0:
        return GroundRegion(np.zeros(2, np.int64), np.zeros((1, 1), np.int8))
    corner = np.floor(ground.min(axis=0)).astype(np.int64)
    size = np.ceil(ground.max(axis=0)).astype(np.int64) - corner + 1
    cells = np.zeros((int(size[0]), int(size[1])), np.int8)
    _draw(ground - corner, triangles, region, cells)
    return GroundRegion(corner, cells)


def overlap(first: GroundRegion, second: GroundRegion) -> Overlap:
    """How much of two regions coincides, where both frames have a mesh.

    Examples
    --------
    >>> here = GroundRegion(np.array([0, 0]), np.array([[2, 2, 1, 0]], np.int8))
    >>> there = GroundRegion(np.array([0, 1]), np.array([[2, 2, 1]], np.int8))
    >>> overlap(here, there).iou
    0.5
    """
    low = np.maximum(first.corner, second.corner)
    high = np.minimum(
        first.corner + first.cells.shape, second.corner + np.array(second.cells.shape)
    )
    if (high <= low).any():
        return Overlap(float("nan"), float("nan"), 0.0)
    a, b = (_window(region, low, high) for region in (first, second))
    common = (a > NOTHING) & (b > NOTHING)
    count = int(common.sum())
    in_a, in_b = common & (a == IN_REGION), common & (b == IN_REGION)
    union = int((in_a | in_b).sum())
    share_a, share_b = in_a.sum() / max(count, 1), in_b.sum() / max(count, 1)
    by_chance = share_a * share_b
    either = share_a + share_b - by_chance
    return Overlap(
        iou=float((in_a & in_b).sum()) / union if union else float("nan"),
        chance=float(by_chance / either) if union else float("nan"),
        common_m2=CELL_M**2 * count,
    )


def _window(region: GroundRegion, low: IntArray, high: IntArray) -> NDArray[np.int8]:
    start, stop = low - region.corner, high - region.corner
    return region.cells[start[0] : stop[0], start[1] : stop[1]]


@kernel
def _draw(
    ground: Float64Array, triangles: IntArray, region: BoolArray, cells: NDArray[np.int8]
) -> None:
    """Mark each cell whose centre lies in a triangle; the region wins where triangles overlap."""
    for f in range(triangles.shape[0]):
        ax, ay = ground[triangles[f, 0]]
        bx, by = ground[triangles[f, 1]]
        cx, cy = ground[triangles[f, 2]]
        turn = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if turn == 0.0:
            continue
        value = np.int8(2) if region[f] else np.int8(1)
        first_x, last_x = int(np.floor(min(ax, bx, cx))), int(np.ceil(max(ax, bx, cx)))
        first_y, last_y = int(np.floor(min(ay, by, cy))), int(np.ceil(max(ay, by, cy)))
        for i in range(max(first_x, 0), min(last_x + 1, cells.shape[0])):
            for j in range(max(first_y, 0), min(last_y + 1, cells.shape[1])):
                x, y = i + 0.5, j + 0.5
                u = ((bx - ax) * (y - ay) - (by - ay) * (x - ax)) / turn
                v = ((cx - bx) * (y - by) - (cy - by) * (x - bx)) / turn
                w = ((ax - cx) * (y - cy) - (ay - cy) * (x - cx)) / turn
                if u >= 0.0 and v >= 0.0 and w >= 0.0 and value > cells[i, j]:
                    cells[i, j] = value
