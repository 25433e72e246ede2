"""What the marks of sight lines add up to, once the engine knows the odds of each."""

from typing import NamedTuple

import numpy as np

from intervis.arrays import Float64Array, IntArray
from intervis.kernels import kernel
from intervis.sight.block import (
    CLEAR,
    FIRST,
    GAP,
    HEIGHT,
    HIDDEN,
    NEAR,
    OPEN,
    PIECE,
    RANK,
    SEEN,
    SHADOW,
    UNSEEN,
    Block,
)
from intervis.sight.occupancy_model import NOISE, Model


class Findings(NamedTuple):
    """What the marks of L lines add up to; see `evidence`.

    The exponent in three parts: `open`, marks in free space; `seen`, marks at seen surfaces;
    `hidden`, marks that no scan saw, whose length is `unknown_m`, the part behind seen surfaces
    `shadow_m`. `apart_s` is the time between the moment and the nearest scan. `clearance_m` is the
    least gap to a surface or the ground on the way (inf with none); `worst_m` the distance from
    the line's first end to the mark at a seen surface that is most likely filled, `worst_scan` the
    scan that says so (-1: there is none).
    """

    open: Float64Array
    seen: Float64Array
    hidden: Float64Array
    unknown_m: Float64Array
    shadow_m: Float64Array
    apart_s: Float64Array
    clearance_m: Float64Array
    worst_m: Float64Array
    worst_scan: IntArray

    @property
    def exponent(self) -> Float64Array:
        """What stops the line: x of `evidence`."""
        return NOISE + self.open + self.seen + self.hidden


@kernel
def new_findings(count: int) -> Findings:
    """Room for the findings on so many lines."""
    v = np.empty((8, count))
    return Findings(v[0], v[1], v[2], v[3], v[4], v[5], v[6], v[7], np.empty(count, np.int64))


@kernel
def sort_out(marks: Float64Array, count: int, model: Model) -> None:
    """Split the probabilities of the marks by what was seen there."""
    surface_to_m, buried_m = model.surface_to_m, model.buried_m
    buried_share = model.buried_rate_per_m / model.rate_per_m
    gap, near, height = marks[GAP], marks[NEAR], marks[HEIGHT]
    seen, free, hidden = marks[SEEN], marks[OPEN], marks[HIDDEN]
    unseen, shadow, clear = marks[UNSEEN], marks[SHADOW], marks[CLEAR]
    for m in range(count):
        # One choice at a time, of numbers read before: conditions joined by "and", or a load that
        # hangs on one, take twice as long.
        ahead, depth, above, share = gap[m], near[m], height[m], seen[m]
        met = depth if depth <= surface_to_m else np.inf
        in_earth = above if ahead == np.inf else 0.0
        met = 0.0 if in_earth < -buried_m else met
        share = buried_share if in_earth < -buried_m else share
        in_seen = share if met < np.inf else 0.0
        in_open = share - in_seen if ahead < np.inf else 0.0
        seen[m] = in_seen
        free[m] = in_open
        hidden[m] = share - in_seen - in_open
        not_met = 1.0 if met == np.inf else 0.0
        in_dark = not_met if ahead == np.inf else 0.0
        unseen[m] = in_dark
        shadow[m] = in_dark if depth < np.inf else 0.0
        least = min(ahead, above) if met == np.inf else np.inf
        clear[m] = least if ahead < np.inf else np.inf


@kernel
def add_up(
    times_s: Float64Array, count: int, block: Block, model: Model, at: int, found: Findings
) -> None:
    """The findings on a block's lines, whose marks are sorted out; the first is line `at`.

    `times_s` (S,): how long after the moment asked about each scan was taken, NaN with none.
    """
    marks, rate_per_m = block.marks, model.rate_per_m
    seen, free, hidden = marks[SEEN], marks[OPEN], marks[HIDDEN]
    unseen, shadow, clear = marks[UNSEEN], marks[SHADOW], marks[CLEAR]
    rank, height = marks[RANK], marks[HEIGHT]
    for i in range(count):
        begin, end, piece = block.span[i, 0], block.span[i, 1], block.lines[i, PIECE]
        in_seen, in_open, in_hidden, least = 0.0, 0.0, 0.0, np.inf
        marks_unseen, marks_in_shadow = 0.0, 0.0
        for m in range(begin, end):
            in_seen += seen[m]
            in_open += free[m]
            in_hidden += hidden[m]
            marks_unseen += unseen[m]
            marks_in_shadow += shadow[m]
            least = min(least, clear[m])
        worst, worst_height, worst_at, worst_scan = 0.0, np.inf, 0.0, -1
        if in_seen > 0.0:
            for m in range(begin, end):
                # of marks under the ground, all as bad, the one next to its surface
                if seen[m] > worst or (seen[m] == worst > 0.0 and height[m] > worst_height):
                    worst, worst_height = seen[m], height[m]
                    worst_scan = block.chosen[i, int(rank[m])]
                    worst_at = m - begin + block.lines[i, FIRST]
        found.seen[at + i] = in_seen * rate_per_m * piece
        found.open[at + i] = in_open * rate_per_m * piece
        found.hidden[at + i] = in_hidden * rate_per_m * piece
        found.unknown_m[at + i] = marks_unseen * piece
        found.shadow_m[at + i] = marks_in_shadow * piece
        later_s = times_s[block.chosen[i, 0]]
        found.apart_s[at + i] = model.usual_s if np.isnan(later_s) else abs(later_s)
        found.clearance_m[at + i] = max(least, 0.0)
        found.worst_m[at + i] = worst_at * piece
        found.worst_scan[at + i] = worst_scan
