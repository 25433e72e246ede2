"""Things that move: where they stood between two scans, at the moment that is asked about.

The rule is stated in `evidence`.
"""

import numpy as np

from intervis.arrays import Float64Array, IntArray
from intervis.kernels import kernel
from intervis.sight.atlas import Memory, depth_at
from intervis.sight.evidence import Model

NONE, ALONE = 0, -1
LEAST_WAY_M = 0.5
"""Two scans nearer together than this tell no direction."""


@kernel
def scan_across(
    memory: Memory, a: Float64Array, b: Float64Array, chosen: IntArray, way: Float64Array
) -> int:
    """Rank of the scan across: the nearest one on the other side of the moment.

    `NONE` where there is none, `ALONE` where a moment is asked about that no other scan lies
    beyond: the nearest one has the last word.

    Where no moment is asked about, that is when the sensor passed the line's end that the nearest
    scan is closer to. `way` becomes the direction (x, y) from the nearest scan to the one across,
    and the share of the way, or of the time, that had gone by at that moment.
    """
    near = memory.position[chosen[0]]
    to_a = (a[0] - near[0]) ** 2 + (a[1] - near[1]) ** 2 + (a[2] - near[2]) ** 2
    to_b = (b[0] - near[0]) ** 2 + (b[1] - near[1]) ** 2 + (b[2] - near[2]) ** 2
    end = a if to_a <= to_b else b
    u, v = end[0] - near[0], end[1] - near[1]
    later_s = memory.later_s[chosen[0]]
    timed = not np.isnan(later_s)
    for n in range(1, len(chosen)):
        far = memory.position[chosen[n]]
        if timed:
            beyond = later_s * memory.later_s[chosen[n]] < 0.0
        else:
            beyond = (far[0] - end[0]) * u + (far[1] - end[1]) * v > 0.0
        if beyond:
            p, q = far[0] - near[0], far[1] - near[1]
            length = np.sqrt(p * p + q * q)
            if length < LEAST_WAY_M:
                return NONE
            way[0], way[1] = p / length, q / length
            if timed:
                way[2] = later_s / (later_s - memory.later_s[chosen[n]])
            else:
                way[2] = min(max((u * way[0] + v * way[1]) / length, 0.0), 1.0)
            return n
    return ALONE if timed else NONE


@kernel
def has_changed(one: float, other: float, height_m: float, model: Model) -> bool:
    """Whether one scan saw a mark filled that the other saw through, at a height of traffic."""
    through = one < model.changed_from_m or other < model.changed_from_m
    deep = max(one, other)  # no number where either scan saw nothing: then not changed
    filled = model.surface_from_m <= deep <= model.changed_to_m
    return bool(through and filled and model.changed_low_m <= height_m <= model.changed_high_m)


@kernel
def has_left(depth_m: float, height_m: float, model: Model) -> bool:
    """Whether the scan nearest to the moment saw through a mark, at a height of traffic."""
    at_height = model.changed_low_m <= height_m <= model.changed_high_m
    return bool(at_height and depth_m < model.changed_from_m)


@kernel
def stood_here(
    memory: Memory,
    near: int,
    across: int,
    x: float,
    y: float,
    z: float,
    way: Float64Array,
    model: Model,
) -> bool:
    """Whether something on its way from one scan's surface to the other's stood at a point."""
    before, after = way[2], 1.0 - way[2]
    at_near, way_near = _in_sensor(memory, near, x, y, z, way)
    at_across, way_across = _in_sensor(memory, across, x, y, z, way)
    step = 0.5 * model.moved_step_m
    while step < model.moved_reach_m:
        for side in (-step, step):
            p, q = -side * before, side * after
            depth = _depth(memory, near, at_near, way_near, p)
            if not model.surface_from_m <= depth <= model.surface_to_m:
                continue
            depth = _depth(memory, across, at_across, way_across, q)
            if not model.surface_from_m <= depth <= model.surface_to_m:
                continue
            if (
                _depth(memory, across, at_across, way_across, p) < model.changed_from_m
                or _depth(memory, near, at_near, way_near, q) < model.changed_from_m
            ):
                return True
        step += model.moved_step_m
    return False


Vector = tuple[float, float, float]


@kernel
def _in_sensor(
    memory: Memory, k: int, x: float, y: float, z: float, way: Float64Array
) -> tuple[Vector, Vector]:
    """A point of the scene and a level direction in the frame of scan k's sensor."""
    g = memory.sensor_from_scene[k]
    point = (
        g[0, 0] * x + g[0, 1] * y + g[0, 2] * z + g[0, 3],
        g[1, 0] * x + g[1, 1] * y + g[1, 2] * z + g[1, 3],
        g[2, 0] * x + g[2, 1] * y + g[2, 2] * z + g[2, 3],
    )
    direction = (
        g[0, 0] * way[0] + g[0, 1] * way[1],
        g[1, 0] * way[0] + g[1, 1] * way[1],
        g[2, 0] * way[0] + g[2, 1] * way[1],
    )
    return point, direction


@kernel
def _depth(memory: Memory, k: int, at: Vector, way: Vector, shift_m: float) -> float:
    """How deep a point of scan k's frame, shifted along a direction, lies behind its surface."""
    return depth_at(
        memory, k, at[0] + shift_m * way[0], at[1] + shift_m * way[1], at[2] + shift_m * way[2]
    )
