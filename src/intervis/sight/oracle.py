"""The exact oracle: the definition in `evidence`, slow and obvious, in float64 and plain numpy.

It shares with the engine the charts of the scans (what was seen) and the tables of the model
(what that means), and no line of how a sight line is walked, a chart is read or scans are chosen.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from intervis.arrays import BoolArray, Float64Array
from intervis.sight import occupancy_model as model
from intervis.sight.atlas import CARRIED, NEAR_M, Memory
from intervis.sight.block import MOST_MARKS
from intervis.sight.ground import CELL_M, CELLS
from intervis.sight.moved import LEAST_WAY_M
from intervis.sight.occupancy_model import MODEL


class Verdict(NamedTuple):
    """One line: the three parts of its exponent, and the length that no scan saw.

    Of that, `shadow_m` lies behind seen surfaces; `judged_m` is the length looked at. `apart_s` is
    the time between the moment and the nearest of the scans, of which the scene has so many.
    """

    open: float
    seen: float
    hidden: float
    unknown_m: float
    shadow_m: float
    judged_m: float
    apart_s: float
    scans: int

    @property
    def exponent(self) -> float:
        """What stops the line: x of `evidence`."""
        return model.NOISE + self.open + self.seen + self.hidden

    @property
    def probability(self) -> float:
        """P(visible)."""
        gone, came = model.changes(self.apart_s, self.scans)
        return float(model.probability(self.exponent, gone, came))

    @property
    def state(self) -> int:
        """1 visible, 0 occluded, -1 unknown."""
        if self.seen > model.OCCLUDED_SEEN:
            return 0
        if (
            self.probability >= model.VISIBLE_FROM
            and self.seen < model.VISIBLE_SEEN
            and self.hidden < model.VISIBLE_HIDDEN
            and self.unknown_m <= min(model.UNKNOWN_M, model.UNKNOWN_SHARE * self.judged_m)
            and self.shadow_m <= model.SHADOW_M
        ):
            return 1
        return -1


def judge_line(memory: Memory, a: Float64Array, b: Float64Array) -> Verdict:
    """The verdict on the line between two finite points of the scene, (3,) each."""
    a, b = sorted((np.asarray(a, np.float64), np.asarray(b, np.float64)), key=tuple)
    marks, piece = _marks(a, b)
    odds = np.zeros(len(marks))
    free, surface, behind = np.zeros((3, len(marks)), bool)
    scans = _chosen_scans(memory, a, b)
    height = np.zeros(len(marks))
    depths = []
    weights = model.scan_weights(len(scans))
    for rank, k in enumerate(scans):
        points = marks @ memory.sensor_from_scene[k, :, :3].T + memory.sensor_from_scene[k, :, 3]
        if rank == 0:
            height = _height_above_ground(memory, k, points)
        depth, solid, known = _depth_behind_surface(memory, k, points)
        depths.append(depth)
        say = np.where(
            solid,
            _read(MODEL.solid, depth, model.DEPTH_TABLE_FROM_M, model.TABLE_PER_M),
            _read(MODEL.scatter, depth, model.DEPTH_TABLE_FROM_M, model.TABLE_PER_M),
        )
        odds += np.where(known, weights[rank] * say, 0.0)
        free |= known & (depth < model.SURFACE_FROM_M)
        surface |= known & (depth >= model.SURFACE_FROM_M) & (depth <= model.SURFACE_TO_M)
        behind |= known & (depth > model.SURFACE_TO_M)
    odds += _read(MODEL.heights, height, model.HEIGHT_TABLE_FROM_M, model.TABLE_PER_M)
    here, gone = _moved(memory, a, b, scans, marks, depths, height)
    odds = np.where(here, np.maximum(odds, model.MOVED_HERE), odds)
    odds = np.where(gone, np.minimum(odds, model.MOVED_AWAY), odds)
    buried = (height < -model.BURIED_M) & ~free
    surface |= here | buried
    share = _read(MODEL.shares, odds, model.SHARE_TABLE_FROM, model.SHARES_PER_ODDS)
    filled = piece * np.where(buried, model.BURIED_RATE_PER_M, model.RATE_PER_M * share)
    open_space, dark = free & ~surface, ~free & ~surface
    later_s = float(memory.later_s[scans[0]])
    return Verdict(
        float(filled[open_space].sum()),
        float(filled[surface].sum()),
        float(filled[dark].sum()),
        float(piece * np.count_nonzero(dark)),
        float(piece * np.count_nonzero(dark & behind)),
        max(float(np.linalg.norm(b - a)) - 2.0 * model.END_M, 0.0),
        model.USUAL_S if np.isnan(later_s) else abs(later_s),
        len(memory.position),
    )


def _marks(a: Float64Array, b: Float64Array) -> tuple[Float64Array, float]:
    """Middles (K, 3) of equal pieces of a line, those near its ends left out; a piece's length."""
    length = float(np.linalg.norm(b - a))
    count = int(np.clip(np.ceil(length / model.MARK_M), 1, MOST_MARKS))
    share = (np.arange(count) + 0.5) / count
    inside = np.minimum(share, 1.0 - share) * length > model.END_M
    return a + share[inside, None] * (b - a), length / count


def _chosen_scans(memory: Memory, a: Float64Array, b: Float64Array) -> list[int]:
    """Indices of the scans with a say: by distance to the nearer end, newest first among equals."""
    to_a = np.linalg.norm(memory.position - a, axis=1)
    to_b = np.linalg.norm(memory.position - b, axis=1)
    away = np.floor((np.minimum(to_a, to_b) + memory.age_m) / NEAR_M)
    newest_first = sorted(range(len(away)), key=lambda k: (away[k], -k))
    return newest_first[: model.SCANS]


def _moved(
    memory: Memory,
    a: Float64Array,
    b: Float64Array,
    scans: list[int],
    marks: Float64Array,
    depths: list[Float64Array],
    height: Float64Array,
) -> tuple[BoolArray, BoolArray]:
    """Marks where something that moved stood, and marks that it left or has yet to reach."""
    near = memory.position[scans[0], :2]
    ends = sorted((a, b), key=lambda end: float(np.sum((end - memory.position[scans[0]]) ** 2)))
    end = ends[0][:2]
    later_s = memory.later_s[scans]
    if np.isnan(later_s[0]):
        far = memory.position[scans, :2]
        beyond = [n for n in range(1, len(scans)) if (far[n] - end) @ (end - near) > 0]
    else:
        beyond = [n for n in range(1, len(scans)) if later_s[0] * later_s[n] < 0]
    nothing = np.zeros(len(marks), bool)
    at_height = _within(height, model.CHANGED_LOW_M, model.CHANGED_HIGH_M)
    if not beyond:
        timed = len(scans) > 1 and not np.isnan(later_s[0])
        return nothing, at_height & (depths[0] < model.CHANGED_FROM_M) & timed
    across = scans[beyond[0]]
    length = float(np.linalg.norm(memory.position[across, :2] - near))
    if length < LEAST_WAY_M:
        return nothing, nothing
    way = np.append((memory.position[across, :2] - near) / length, 0.0)
    share = float(np.clip((end - near) @ way[:2] / length, 0.0, 1.0))
    if not np.isnan(later_s[0]):
        share = later_s[0] / (later_s[0] - later_s[beyond[0]])

    both = np.array([depths[0], depths[beyond[0]]])
    with np.errstate(invalid="ignore"):
        changed = (both.min(axis=0) < model.CHANGED_FROM_M) & _within(
            both.max(axis=0), model.SURFACE_FROM_M, model.CHANGED_TO_M
        )
    changed &= at_height
    here = nothing.copy()
    if not changed.any():
        return nothing, nothing
    reach = np.arange(0.5 * model.MOVED_STEP_M, model.MOVED_REACH_M, model.MOVED_STEP_M)
    for moved_m in np.concatenate([-reach, reach]):
        first = marks[changed] - share * moved_m * way
        second = marks[changed] + (1.0 - share) * moved_m * way
        saw = {
            (k, name): _depth_in_scene(memory, k, points)
            for k in (scans[0], across)
            for name, points in (("first", first), ("second", second))
        }
        here[changed] |= (
            _within(saw[scans[0], "first"], model.SURFACE_FROM_M, model.SURFACE_TO_M)
            & _within(saw[across, "second"], model.SURFACE_FROM_M, model.SURFACE_TO_M)
            & (
                (saw[across, "first"] < model.CHANGED_FROM_M)
                | (saw[scans[0], "second"] < model.CHANGED_FROM_M)
            )
        )
    return here, changed & ~here


def _within(value: Float64Array, least: float, most: float) -> BoolArray:
    return np.asarray((value >= least) & (value <= most))


def _depth_in_scene(memory: Memory, k: int, points: Float64Array) -> Float64Array:
    """How far points of the scene lie behind scan k's surface; NaN where there is none."""
    turned = points @ memory.sensor_from_scene[k, :, :3].T + memory.sensor_from_scene[k, :, 3]
    return _depth_behind_surface(memory, k, turned)[0]


def _height_above_ground(memory: Memory, k: int, points: Float64Array) -> Float64Array:
    cell = np.floor(points[:, :2] / CELL_M).astype(int) + CELLS // 2
    a, b = np.clip(cell, 0, CELLS - 1).T
    return np.asarray(points[:, 2] - memory.ground[k][a, b])


def _depth_behind_surface(
    memory: Memory, k: int, points: Float64Array
) -> tuple[Float64Array, BoolArray, BoolArray]:
    """How far points lie behind scan k's surface, whether that is solid, whether there is one."""
    rows, columns = int(memory.rows[k]), int(memory.columns[k])
    start = int(memory.offset[k])
    image = memory.cells[start : start + rows * columns].reshape(columns, rows)
    rho = np.hypot(points[:, 0], points[:, 1])
    with np.errstate(divide="ignore", invalid="ignore"):
        place = (points[:, 2] / rho - memory.slope_from[k]) * memory.rows_per_slope[k]
    on_chart = (place >= 0.0) & (place < rows - 1.0)
    place = np.where(on_chart, place, 0.0)
    row = place.astype(int)
    share = place - row
    column = np.minimum((_turn(points) * (columns / 8.0)).astype(int), columns - 1)

    low, high = image[column, row], image[column, row + 1]
    nearer = np.where(share >= 0.5, high, low)
    a, b = np.abs(low).astype(np.float64), np.abs(high).astype(np.float64)
    one_surface = (a > 0) & (b > 0) & (np.abs(a - b) < CARRIED * np.minimum(a, b))
    units = np.where(one_surface, a + (b - a) * share, np.abs(nearer).astype(np.float64))
    surface = units * memory.unit_m[k]
    known = on_chart & (nearer != 0)
    return np.where(known, rho - surface, np.nan), nearer > 0, known


def _turn(points: Float64Array) -> Float64Array:
    """Azimuth from 0 to 8 as charts measure it, by cases."""
    x, y = points[:, 0], points[:, 1]
    across, along = np.minimum(np.abs(x), np.abs(y)), np.maximum(np.abs(x), np.abs(y))
    with np.errstate(divide="ignore", invalid="ignore"):
        m = np.where(along > 0, across / along, 0.0)
    eighth = m * (1.3147 - m * (0.2343 + 0.0804 * m))
    quarter = np.where(np.abs(y) <= np.abs(x), eighth, 2.0 - eighth)
    half = np.where(x < 0, 4.0 - quarter, quarter)
    return np.asarray(np.where(y < 0, 8.0 - half, half))


def _read(
    table: Float64Array, value: Float64Array, start: float, per_unit: float
) -> NDArray[np.float64]:
    """A table's entries; below its start the first one, beyond its end the last."""
    at = np.where(np.isnan(value), 0.0, (value - start) * per_unit)
    return np.asarray(table[np.clip(at, 0, len(table) - 1).astype(int)])
