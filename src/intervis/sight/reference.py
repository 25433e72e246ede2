"""The reference implementation of `occupancy_model`: plain numpy in float64, one line at a time.

It shares the range images and the model's tables with the engine. It shares no code that samples a
line, reads a range image or selects scans.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from intervis.arrays import BoolArray, Float64Array
from intervis.sight import occupancy_model as model
from intervis.sight.kernels.batch import MAX_SAMPLES
from intervis.sight.kernels.dynamics import MIN_BASELINE_M
from intervis.sight.kernels.packed_scans import (
    DISTANCE_STEP_M,
    MAX_INTERPOLATED_JUMP,
    PackedScans,
)
from intervis.sight.kernels.terrain import ASSUMED_OFFSET_M, BORDER_M, CELL_M, CELLS
from intervis.sight.occupancy_model import MODEL


class ReferenceResult(NamedTuple):
    """One line: the three parts of its optical depth, and its unobserved length.

    `occluded_space_m` is the part of `unobserved_m` behind observed surfaces, `end_occluded_m` the
    part of that which reaches an end, `length_m` the length of the line. `time_gap_s` is the time
    between the query and the nearest scan, `bracketed` whether scans before and after
    the query time contribute.
    """

    free: float
    surface: float
    movable: float
    unobserved: float
    unobserved_m: float
    occluded_space_m: float
    end_occluded_m: float
    length_m: float
    time_gap_s: float
    bracketed: bool

    @property
    def optical_depth(self) -> float:
        """The sum x of `occupancy_model`."""
        at_end = model.end_optical_depth(self.end_occluded_m)
        return model.BASE_OPTICAL_DEPTH + self.free + self.surface + self.unobserved + float(at_end)

    @property
    def probability(self) -> float:
        """P(visible)."""
        fractions = model.change_fractions(self.time_gap_s, self.bracketed)
        return float(model.probability(self.optical_depth, self.movable, *fractions))

    @property
    def state(self) -> int:
        """1 visible, 0 occluded, -1 unknown."""
        thresholds = model.DEFAULT_THRESHOLDS
        meets_surface = self.surface >= model.OCCLUDED_MIN_SURFACE
        if meets_surface and self.probability <= thresholds.occluded_to:
            return 0
        observed = model.mostly_observed(self.unobserved_m, self.occluded_space_m, self.length_m)
        least = thresholds.visible_from if observed else thresholds.visible_unobserved_from
        return 1 if self.probability >= least else -1

    @property
    def observed(self) -> float:
        """Share of the sampled length that some scan observed."""
        sampled_m = self.length_m - 2.0 * model.END_MARGIN_M
        return 1.0 - min(self.unobserved_m / sampled_m, 1.0) if sampled_m > 0.0 else 1.0


class LineSamples(NamedTuple):
    """The K samples of one line, and what each of its C contributing scans says of them.

    `step` is their spacing in metres. `depth`, `is_surface`, `known` are (C, K): depth behind the
    scan's surface, whether that is a surface return, whether the scan observed the direction.
    `dropout_depth` (C, K) is the depth behind the surface that a dropout interrupts, else NaN.
    `weights` (C,) are the weights of the scans. `height` is the height above known ground,
    `assumed_height` that above assumed ground, NaN where the other one applies. The masks
    `occupied` and `left` are the results of the rule for dynamic objects; `free`, `at_surface` and
    `behind` (a surface) classify the samples; `along_end` are those along the surface that an end
    lies on.
    """

    step: float
    depth: Float64Array
    is_surface: BoolArray
    known: BoolArray
    dropout_depth: Float64Array
    weights: Float64Array
    height: Float64Array
    assumed_height: Float64Array
    occupied: BoolArray
    left: BoolArray
    free: BoolArray
    at_surface: BoolArray
    behind: BoolArray
    along_end: BoolArray


def reference_samples(scans: PackedScans, a: Float64Array, b: Float64Array) -> LineSamples:
    """The samples of the line between two finite points of the scene, (3,) each."""
    a, b = sorted((np.asarray(a, np.float64), np.asarray(b, np.float64)), key=tuple)
    samples, step = _samples(a, b)
    chosen = _chosen_scans(scans, a, b)
    points = [_in_sensor_frame(scans, k, samples) for k in chosen]
    height, assumed_height = _height_above_ground(scans, chosen[0], samples)
    each = [_depth_behind_surface(scans, k, p) for k, p in zip(chosen, points, strict=True)]
    depth, is_surface, known, dropout_depth = (
        np.array(values) for values in zip(*each, strict=True)
    )
    occupied, left = _dynamic(scans, a, b, chosen, samples, list(depth), height)
    with np.errstate(invalid="ignore"):
        free = _any_scan(known & (depth < model.SURFACE_FROM_M))
        behind = _any_scan(known & (depth > model.SURFACE_TO_M))
    on_surface = _any_scan(known & _within(depth, model.SURFACE_FROM_M, model.SURFACE_TO_M))
    nearest = np.min(
        np.where(known & (depth >= model.SURFACE_FROM_M), np.abs(depth), np.inf), axis=0
    )
    stops = (nearest > model.END_SURFACE_M) | (height < -model.BELOW_GROUND_M) | occupied
    leaves = np.isinf(nearest) & free & ~(height < -model.BELOW_GROUND_M)
    along_end = (
        _run_before_first(stops, leaves) | _run_before_first(stops[::-1], leaves[::-1])[::-1]
    )
    free |= along_end
    on_surface &= ~along_end
    return LineSamples(
        step=step,
        depth=depth,
        is_surface=is_surface,
        known=known,
        dropout_depth=dropout_depth,
        weights=model.scan_weights(len(chosen)),
        height=height,
        assumed_height=assumed_height,
        occupied=occupied,
        left=left,
        free=free,
        at_surface=on_surface | occupied,
        behind=behind,
        along_end=along_end,
    )


def _run_before_first(stops: BoolArray, leaves: BoolArray) -> BoolArray:
    """The samples before the first stop, if the line leaves the surface there."""
    found = np.flatnonzero(stops)
    length = int(found[0]) if len(found) else len(stops)
    clears = not len(found) or leaves[length] or length >= model.GRAZING_SAMPLES
    return (np.arange(len(stops)) < length) & bool(clears)


def reference_result(scans: PackedScans, a: Float64Array, b: Float64Array) -> ReferenceResult:
    """The result for the line between two finite points of the scene, (3,) each."""
    line = reference_samples(scans, a, b)
    optical_depth = line.step * attenuation_per_m(line)
    in_free, unobserved = line.free & ~line.at_surface, ~line.free & ~line.at_surface
    length_m = float(np.linalg.norm(np.asarray(b, np.float64) - np.asarray(a, np.float64)))
    return ReferenceResult(
        float(optical_depth[in_free].sum()),
        float(optical_depth[line.at_surface].sum()),
        float(optical_depth[movable(line)].sum()),
        float(optical_depth[unobserved].sum()),
        float(line.step * np.count_nonzero(unobserved)),
        float(line.step * np.count_nonzero(unobserved & line.behind)),
        end_occluded_m(line),
        length_m,
        time_gap_s(scans, a, b),
        is_bracketed(scans, a, b),
    )


def movable(line: LineSamples) -> BoolArray:
    """Samples at surfaces that may move: at heights of traffic and people above known ground."""
    in_traffic = _within(line.height, model.DYNAMIC_MIN_HEIGHT_M, model.DYNAMIC_MAX_HEIGHT_M)
    return np.asarray(line.at_surface & in_traffic)


def end_occluded_m(line: LineSamples) -> float:
    """Length of the occluded space that reaches an end of the line, or both ends, metres."""
    occluded_space = ~line.free & ~line.at_surface & line.behind
    return float(line.step * _count_at_ends(occluded_space))


def _count_at_ends(flags: BoolArray) -> int:
    """Samples that hold the flag, from the first one or the last one on without a break."""
    if flags.all():
        return len(flags)
    first, last = np.flatnonzero(~flags)[[0, -1]]
    return int(first + len(flags) - 1 - last)


def attenuation_per_m(line: LineSamples) -> Float64Array:
    """Optical depth per metre of the samples of a line."""
    tables = np.split(MODEL.tables.depth_log_odds[:-1], 3)
    log_odds = np.zeros(len(line.height))
    for k, weight in enumerate(line.weights):
        depths = (line.depth[k], line.depth[k], line.dropout_depth[k])
        volumetric, surface, dropout = (
            _read(table, depth, model.DEPTH_FROM_M, model.ENTRIES_PER_M)
            for table, depth in zip(tables, depths, strict=True)
        )
        observed = np.where(line.is_surface[k], surface, volumetric)
        log_odds += np.where(line.known[k], weight * observed, 0.0)
        log_odds += np.where(np.isnan(line.dropout_depth[k]), 0.0, weight * dropout)
    known, assumed = np.split(
        MODEL.tables.height_log_odds, [int(MODEL.parameters.known_height_entries)]
    )
    log_odds += np.where(
        np.isnan(line.assumed_height),
        _read(known, line.height, model.HEIGHT_FROM_M, model.ENTRIES_PER_M),
        _read(assumed, line.assumed_height, model.ASSUMED_FROM_M, model.ENTRIES_PER_M),
    )
    at_least = np.maximum(log_odds, model.DYNAMIC_OCCUPIED_LOG_ODDS)
    log_odds = np.where(line.occupied, at_least, log_odds)
    at_most = np.minimum(log_odds, model.DYNAMIC_FREE_LOG_ODDS)
    log_odds = np.where(line.left, at_most, log_odds)
    log_odds = np.where(line.along_end, model.LOG_ODDS_FROM, log_odds)
    occupancy = _read(
        MODEL.tables.occupancies, log_odds, model.LOG_ODDS_FROM, model.ENTRIES_PER_LOG_ODDS
    )
    return model.ATTENUATION_PER_M * occupancy


def time_gap_s(scans: PackedScans, a: Float64Array, b: Float64Array) -> float:
    """Time between the query and the scan nearest to the line, seconds."""
    offset_s = float(scans.time_offset_s[_chosen_scans(scans, a, b)[0]])
    return 0.0 if np.isnan(offset_s) else abs(offset_s)


def is_bracketed(scans: PackedScans, a: Float64Array, b: Float64Array) -> bool:
    """Whether a scan on the other side of the query time than the nearest one contributes."""
    offset_s = scans.time_offset_s[_chosen_scans(scans, a, b)]
    return bool((offset_s[0] * offset_s[1:] < 0.0).any())


def _samples(a: Float64Array, b: Float64Array) -> tuple[Float64Array, float]:
    """Midpoints (K, 3) of equal steps outside the end margins, and the length of a step."""
    length = float(np.linalg.norm(b - a))
    count = int(np.clip(np.ceil(length / model.STEP_M), 1, MAX_SAMPLES))
    position = (np.arange(count) + 0.5) / count
    inside = np.minimum(position, 1.0 - position) * length > model.END_MARGIN_M
    return a + position[inside, None] * (b - a), length / count


def _chosen_scans(scans: PackedScans, a: Float64Array, b: Float64Array) -> list[int]:
    """Indices of the contributing scans: by distance to the nearer end, newest first if equal."""
    to_a = np.linalg.norm(scans.position - a, axis=1)
    to_b = np.linalg.norm(scans.position - b, axis=1)
    distance = np.floor((np.minimum(to_a, to_b) + scans.age_cost_m) / DISTANCE_STEP_M)
    newest_first = sorted(range(len(distance)), key=lambda k: (distance[k], -k))
    return newest_first[: model.SCANS]


def _dynamic(
    scans: PackedScans,
    a: Float64Array,
    b: Float64Array,
    chosen: list[int],
    samples: Float64Array,
    depths: list[Float64Array],
    height: Float64Array,
) -> tuple[BoolArray, BoolArray]:
    """Samples that a dynamic object occupied, and samples that it had left or not reached."""
    nearest = scans.position[chosen[0], :2]
    ends = sorted((a, b), key=lambda end: float(np.sum((end - scans.position[chosen[0]]) ** 2)))
    end = ends[0][:2]
    offset_s = scans.time_offset_s[chosen]
    timed = not np.isnan(offset_s[0])
    if timed:
        beyond = [n for n in range(1, len(chosen)) if offset_s[0] * offset_s[n] < 0]
    else:
        position = scans.position[chosen, :2]
        beyond = [n for n in range(1, len(chosen)) if (position[n] - end) @ (end - nearest) > 0]
    nothing = np.zeros(len(samples), bool)
    at_height = _within(height, model.DYNAMIC_MIN_HEIGHT_M, model.DYNAMIC_MAX_HEIGHT_M)
    if not beyond:
        decides = timed and len(chosen) > 1
        return nothing, at_height & (depths[0] < model.FREE_DEPTH_M) & decides
    bracketing = chosen[beyond[0]]
    length = float(np.linalg.norm(scans.position[bracketing, :2] - nearest))
    if length < MIN_BASELINE_M:
        return nothing, nothing
    direction = np.append((scans.position[bracketing, :2] - nearest) / length, 0.0)
    fraction = float(np.clip((end - nearest) @ direction[:2] / length, 0.0, 1.0))
    if timed:
        fraction = offset_s[0] / (offset_s[0] - offset_s[beyond[0]])

    both = np.array([depths[0], depths[beyond[0]]])
    with np.errstate(invalid="ignore"):
        disagree = (both.min(axis=0) < model.FREE_DEPTH_M) & _within(
            both.max(axis=0), model.SURFACE_FROM_M, model.DYNAMIC_MAX_DEPTH_M
        )
    disagree &= at_height
    if not disagree.any():
        return nothing, nothing
    occupied = nothing.copy()
    reach = np.arange(0.5 * model.MOTION_STEP_M, model.MOTION_REACH_M, model.MOTION_STEP_M)
    for moved_m in np.concatenate([-reach, reach]):
        first = samples[disagree] - fraction * moved_m * direction
        second = samples[disagree] + (1.0 - fraction) * moved_m * direction
        depth = {
            (k, name): _depth_behind_surface(scans, k, _in_sensor_frame(scans, k, points))[0]
            for k in (chosen[0], bracketing)
            for name, points in (("first", first), ("second", second))
        }
        occupied[disagree] |= (
            _within(depth[chosen[0], "first"], model.SURFACE_FROM_M, model.SURFACE_TO_M)
            & _within(depth[bracketing, "second"], model.SURFACE_FROM_M, model.SURFACE_TO_M)
            & (
                (depth[bracketing, "first"] < model.FREE_DEPTH_M)
                | (depth[chosen[0], "second"] < model.FREE_DEPTH_M)
            )
        )
    return occupied, disagree & ~occupied


def _any_scan(mask: BoolArray) -> BoolArray:
    return np.asarray(mask.any(axis=0))


def _within(value: Float64Array, least: float, most: float) -> BoolArray:
    return np.asarray((value >= least) & (value <= most))


def _in_sensor_frame(scans: PackedScans, k: int, points: Float64Array) -> Float64Array:
    sensor_from_scene = scans.sensor_from_scene[k]
    return np.asarray(points @ sensor_from_scene[:, :3].T + sensor_from_scene[:, 3])


def _height_above_ground(
    scans: PackedScans, k: int, points: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """Heights above the known ground, and above the assumed one; NaN where it is the other."""
    from_sensor = (points - scans.position[k]) @ scans.level_from_scene.T
    cell = np.floor((from_sensor[:, :2] + BORDER_M) / CELL_M).astype(int) + CELLS // 2
    a, b = np.clip(cell, 0, CELLS - 1).T
    ground = scans.ground[k][a, b].astype(np.float64)
    height = from_sensor[:, 2] - ground
    assumed = ground < -0.5 * ASSUMED_OFFSET_M
    return np.where(assumed, np.nan, height), np.where(assumed, height - ASSUMED_OFFSET_M, np.nan)


def _depth_behind_surface(
    scans: PackedScans, k: int, points: Float64Array
) -> tuple[Float64Array, BoolArray, BoolArray, Float64Array]:
    """Depth of points behind scan k's surface (NaN: unobserved), is it a surface, is it known;
    and behind the surface that a dropout interrupts (NaN: no dropout).
    """
    rows, columns = int(scans.rows[k]), int(scans.columns[k])
    start = int(scans.offset[k])
    image = scans.pixels[start : start + rows * columns].reshape(columns, rows)
    planar_range, elevation = _planar_range_and_elevation(points)
    place = (elevation - scans.elevation_from[k]) * scans.rows_per_unit[k]
    inside = (place >= 0.0) & (place < rows - 1.0)
    place = np.where(inside, place, 0.0)
    row = place.astype(int)
    fraction = place - row
    column = np.minimum((_pseudo_azimuth(points) * (columns / 8.0)).astype(int), columns - 1)

    low, high = image[column, row], image[column, row + 1]
    nearer = np.where(fraction >= 0.5, high, low)
    a, b = np.abs(low).astype(np.float64), np.abs(high).astype(np.float64)
    one_surface = (a > 0) & (b > 0) & (np.abs(a - b) < MAX_INTERPOLATED_JUMP * np.minimum(a, b))
    units = np.where(one_surface, a + (b - a) * fraction, np.abs(nearer).astype(np.float64))
    surface = units * scans.unit_m[k]
    dropout = inside & (nearer < 0) & (nearer % 2 == 1)
    known = inside & (nearer != 0) & ~dropout
    depth = planar_range - surface
    return (
        np.where(known, depth, np.nan),
        nearer > 0,
        known,
        np.where(dropout, depth, np.nan),
    )


def _planar_range_and_elevation(points: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Planar range, and elevation from -2 to 2 as range images measure it, by cases."""
    rho, z = np.hypot(points[:, 0], points[:, 1]), points[:, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        side, cap = z / rho, np.sign(z) * (2.0 - rho / np.abs(z))
    steep = np.abs(z) > rho
    elevation = np.where(steep, cap, np.where(rho > 0.0, side, 0.0))
    return np.where(steep, np.abs(z), rho), elevation


def _pseudo_azimuth(points: Float64Array) -> Float64Array:
    """Azimuth from 0 to 8 as range images measure it, by cases."""
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
