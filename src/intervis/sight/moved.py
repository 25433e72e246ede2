"""Things that move: where they stood between two scans, at the moment that is asked about.

The rule is stated in `evidence`.
"""

from typing import NamedTuple

import numpy as np

from intervis.arrays import Float64Array, IntArray
from intervis.kernels import kernel
from intervis.sight.atlas import FROM_SCENE, depth_at
from intervis.sight.block import ACROSS, BY_ACROSS, BY_NEAREST, HEIGHT, MOVED, WAY, in_eights
from intervis.sight.chart import Int16Array
from intervis.sight.occupancy_model import Model

NONE, ALONE = 0, -1
CHANGED, HERE, GONE = 2.0, 1.0, -1.0
"""Two scans saw a mark differently; something that moved stood there; it has gone or not come."""
LEAST_WAY_M = 0.5
"""Two scans nearer together than this tell no direction."""


class Motion(NamedTuple):
    """What a `Model` says of things that move, in numbers alone.

    The model holds tables too. A kernel that is handed arrays counts who holds them, each time,
    and where it is called for each mark that takes longer than its work.
    """

    surface_from_m: float
    surface_to_m: float
    changed_from_m: float
    changed_to_m: float
    low_m: float
    high_m: float
    step_m: float
    reach_m: float


@kernel
def motion_of(model: Model) -> Motion:
    """The numbers of a model about things that move."""
    return Motion(
        model.surface_from_m,
        model.surface_to_m,
        model.changed_from_m,
        model.changed_to_m,
        model.changed_low_m,
        model.changed_high_m,
        model.moved_step_m,
        model.moved_reach_m,
    )


@kernel
def find_across(
    position: Float64Array,
    times_s: Float64Array,
    first: Float64Array,
    second: Float64Array,
    chosen: IntArray,
    lines: Float64Array,
) -> None:
    """Rank of the scan across each line: the nearest one on the other side of the moment.

    `NONE` where there is none, `ALONE` where a moment is asked about that no other scan lies
    beyond: the nearest one has the last word.

    Where no moment is asked about, that is when the sensor passed the line's end that the nearest
    scan is closer to. The line's `WAY` becomes the direction (x, y) from the nearest scan to the
    one across, and the share of the way, or of the time, that had gone by at that moment.
    """
    for i in range(len(first)):
        k = chosen[i, 0]
        x, y, z, later_s = position[k, 0], position[k, 1], position[k, 2], times_s[k]
        a0, a1, a2 = first[i, 0], first[i, 1], first[i, 2]
        b0, b1, b2 = second[i, 0], second[i, 1], second[i, 2]
        to_a = (a0 - x) ** 2 + (a1 - y) ** 2 + (a2 - z) ** 2
        to_b = (b0 - x) ** 2 + (b1 - y) ** 2 + (b2 - z) ** 2
        end_x, end_y = a0 if to_a <= to_b else b0, a1 if to_a <= to_b else b1
        u, v = end_x - x, end_y - y
        timed = not np.isnan(later_s)
        across = 0
        for n in range(chosen.shape[1] - 1, 0, -1):
            k = chosen[i, n]
            ahead = (position[k, 0] - end_x) * u + (position[k, 1] - end_y) * v
            across = n if (-later_s * times_s[k] if timed else ahead) > 0.0 else across
        k = chosen[i, across]
        p, q = position[k, 0] - x, position[k, 1] - y
        length = np.sqrt(p * p + q * q)
        to_x, to_y = p / length, q / length
        way_gone = min(max((u * to_x + v * to_y) / length, 0.0), 1.0)
        lines[i, WAY], lines[i, WAY + 1] = to_x, to_y
        lines[i, WAY + 2] = later_s / (later_s - times_s[k]) if timed else way_gone
        lone = ALONE if timed else NONE
        lines[i, ACROSS] = lone if across == 0 else (NONE if length < LEAST_WAY_M else across)


@kernel
def find_changed(
    marks: Float64Array,
    lines: Float64Array,
    span: IntArray,
    count: int,
    motion: Motion,
) -> None:
    """Find the marks, at a height of traffic, that one scan saw filled and another saw through.

    Where the scan nearest to the moment has the last word, what it saw through has been left.
    """
    surface_from_m, from_m, to_m = motion.surface_from_m, motion.changed_from_m, motion.changed_to_m
    low_m, high_m = motion.low_m, motion.high_m
    for i in range(count):
        begin, end = span[i, 0], span[i, 2]
        by_nearest, by_across = marks[BY_NEAREST, begin:end], marks[BY_ACROSS, begin:end]
        height, moved = marks[HEIGHT, begin:end], marks[MOVED, begin:end]
        two_see = CHANGED if lines[i, ACROSS] > 0.0 else 0.0
        one_sees = GONE if lines[i, ACROSS] == ALONE else 0.0
        for m in range(in_eights(begin, end)):
            one, other, above_m = by_nearest[m], by_across[m], height[m]
            at_height = (above_m >= low_m) & (above_m <= high_m)
            # no number where either scan saw nothing: then not changed
            filled = (max(one, other) >= surface_from_m) & (max(one, other) <= to_m)
            through = (one < from_m) | (other < from_m)
            changed = two_see if at_height & filled & through else 0.0
            moved[m] = one_sees if at_height & (one < from_m) & (two_see == 0.0) else changed


@kernel
def stood_here(
    cells: Int16Array,
    near: Float64Array,
    across: Float64Array,
    x: float,
    y: float,
    z: float,
    way: Float64Array,
    motion: Motion,
) -> bool:
    """Whether something on its way from one scan's surface to the other's stood at a point.

    `near` and `across` are the two scans' rows of the atlas's index.
    """
    surface_from_m, surface_to_m = motion.surface_from_m, motion.surface_to_m
    through_m = motion.changed_from_m
    way_x, way_y, before, after = way[0], way[1], way[2], 1.0 - way[2]
    stood, step = False, 0.5 * motion.step_m
    a, b, c = _in_sensor(near, x, y, z, 1.0)
    da, db, dc = _in_sensor(near, way_x, way_y, 0.0, 0.0)
    u, v, w = _in_sensor(across, x, y, z, 1.0)
    du, dv, dw = _in_sensor(across, way_x, way_y, 0.0, 0.0)
    while step < motion.reach_m and not stood:
        for side in (-step, step):
            p, q = -side * before, side * after
            depth = depth_at(cells, near, a + p * da, b + p * db, c + p * dc)
            if stood or not surface_from_m <= depth <= surface_to_m:
                continue
            depth = depth_at(cells, across, u + q * du, v + q * dv, w + q * dw)
            if not surface_from_m <= depth <= surface_to_m:
                continue
            stood = depth_at(cells, across, u + p * du, v + p * dv, w + p * dw) < through_m
            if not stood:
                stood = depth_at(cells, near, a + q * da, b + q * db, c + q * dc) < through_m
        step += motion.step_m
    return stood


@kernel
def _in_sensor(
    chart: Float64Array, x: float, y: float, z: float, one: float
) -> tuple[float, float, float]:
    """A point of the scene (`one` is 1) or a direction (0) in the frame of a scan's sensor."""
    g = chart[FROM_SCENE:]
    u = g[0] * x + g[1] * y + g[2] * z + g[3] * one
    v = g[4] * x + g[5] * y + g[6] * z + g[7] * one
    return u, v, g[8] * x + g[9] * y + g[10] * z + g[11] * one
