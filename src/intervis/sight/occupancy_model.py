"""The meaning of the three answers: from what scans saw along a line to "visible".

A sight line is judged at marks, one every `MARK_M` at most, midway in equal pieces of the line;
pieces that end within `END_M` of either end are left out, for the ends may lie on surfaces.

At a mark, each of the nearest scans of the scene says how deep the mark lies behind the surface
that it saw in that direction (`chart`): the depth d = rho(mark) - rho(surface), metres.

    d << 0      a beam went through here and on: free
    d near 0    here is the surface itself
    d > 0       behind the surface: hidden from that scan, more likely solid the nearer
    no surface  no beam, or none came back: that scan has no say

The scans' say is summed with weights (`scan_weights`) to the log-odds that the mark is filled,
beside what the height above ground alone makes of it:

    odds = height_odds(h) + sum_k weight_k depth_odds(d_k)

Things move between scans. Two scans tell where they stood in between: the nearest one, and the
nearest beyond the line's end, so that the sensor passed that end on its way from one to the other,
after a `share` of it. Where a moment is asked about, each second between it and a scan counts as
`AGE_M_PER_S` metres more to that scan; the other scan is the nearest taken on the other side of
the moment, and `share` is that of the time between the two.

A mark that one of the two saw filled (d from `SURFACE_FROM_M` to `CHANGED_TO_M`) and the other saw
through (d < `CHANGED_FROM_M`) has changed: something left, or came. What stood at p in the one
scan and at q in the other was at p + share (q - p) at that time. So the mark is filled, odds >=
`MOVED_HERE`, where it lies between such a p and q on a line along the sensor's way, up to
`MOVED_REACH_M` apart: each at a surface of its own scan, one of them at least seen through by the
other. If there are none, it has been left or not yet been reached: odds <= `MOVED_AWAY`. Marks
nearer to the ground than `CHANGED_LOW_M` or higher than `CHANGED_HIGH_M` are left alone, and so is
all where no scan lies across; but if a moment is asked about that lies before or after all scans,
or at one of them, then what the nearest one saw through is free: odds <= `MOVED_AWAY`.

A filled mark stops the line with `RATE_PER_M` per metre:

    share = 1 / (1 + exp(-odds))
    x = NOISE + sum over marks of RATE_PER_M share length

A mark more than `BURIED_M` under the ground that the nearest scan saw, and that no scan saw free,
is earth: it stops the line with `BURIED_RATE_PER_M` whatever the odds.

Were the marks independent, and nothing had changed since, exp(-x) would be the probability that
the line is open. But marks beside each other err together, which makes the odds of the whole line
steeper, by the power `SHARPNESS`; and of the lines that were blocked a share `gone` is open by the
time that is asked about, of those that were open a share `came` is blocked (`changes`):

    Q = 1 / (1 + c (exp(x) - 1) ** SHARPNESS),   c = (0.5 - came) / (0.5 - gone)
    P(visible) = gone + (1 - gone - came) Q

where c leaves even odds even.

The sum in x has three parts: `seen` from marks at surfaces (-0.2 m <= d <= 1.3 m for some scan), in
earth, or where something that moved stood; `open` from other marks that some scan saw free; and
`hidden` from marks that no scan saw. The three answers are

    occluded (0)   seen > OCCLUDED_SEEN: it meets a surface that some beam has hit
    visible  (1)   seen < VISIBLE_SEEN, hidden < VISIBLE_HIDDEN and P >= VISIBLE_FROM, and of the
                   judged length no more than UNKNOWN_M and UNKNOWN_SHARE was seen by no scan,
                   and no more than SHADOW_M lies unseen behind a surface: it runs through space
                   that beams have crossed
    unknown (-1)   everything else

All of it is even in the two ends: the answer for (a, b) is the answer for (b, a).

The curves were fitted by maximum likelihood, smoothness demanded, to held-out returns
(`intervis.lab.truth`): pairs (0,3) (3,12) (14,1) (21,12) (8,15) (18,9) (12,6) (16,20) of a public
KITTI drive of 22 scans, half of them in protocol `single`, half in `map`. `FADE`, `SCANS` and
`REPEAT` were chosen with those pairs and looked at on six more of the same drive; the thresholds
of the three answers were chosen in built-in worlds. `SHARPNESS` and the shares of what changes
were fitted by maximum likelihood to those eight pairs, ten pairs of another drive and twelve of two
built-in streets, in all three protocols.

What moves was studied on those eight pairs, on another drive in traffic and in two built-in
streets. Of the changed marks at a surface that the rule calls filled the judging scan saw 59 to 86
in 100 filled, of those that it calls left 5 to 13. The scores hardly depend on its numbers: steps
of 0.3 to 1 m, a reach of 5 to 12 m and `CHANGED_TO_M` from 2 to 10 m gave the same within 0.008.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from intervis.arrays import Float64Array

MARK_M = 0.3
END_M = 0.4
SCANS = 6
"""So many scans have a say about one line: those nearest to one of its ends."""
FADE = 0.6
"""Each further scan's say is this share of the one before."""
AGE_M_PER_S = 20.0
"""Of a scan taken before or after the moment asked about, each second counts as such a distance."""
REPEAT = 0.3
"""How much of what a further scan says is taken as repetition, from 0 (nothing) to 1 (all)."""
RATE_PER_M = 1.31
BURIED_M, BURIED_RATE_PER_M = 0.5, 4.0
NOISE = 2e-3
SHARPNESS = 1.65
CHANGE_S = 5.0
"""In this time most of what moves at all has moved on (all but a share of 1 / e)."""
GONE_SEEN_ONCE, CAME_SEEN_ONCE = 0.77, 0.41
"""Where one scan alone has a say: nothing tells what moves from what stands."""
GONE, CAME = 0.27, 0.19
"""Where several scans have a say, and what moves has been told apart."""
MOST_CHANGED = 0.45
"""However long ago: a line that was blocked is never more likely open than one that was open."""
USUAL_S = 1.0
"""Time between the scans and the moment where none is asked about."""
VISIBLE_FROM, VISIBLE_SEEN, VISIBLE_HIDDEN = 0.85, 0.3, 0.25
UNKNOWN_M, UNKNOWN_SHARE, SHADOW_M = 3.0, 0.5, 1.0
OCCLUDED_SEEN = 0.95
SURFACE_FROM_M, SURFACE_TO_M = -0.2, 1.3
CHANGED_FROM_M, CHANGED_TO_M = -0.7, 3.0
CHANGED_LOW_M, CHANGED_HIGH_M = 0.2, 3.0
"""What moves is looked for so high above the ground: traffic and people."""
MOVED_STEP_M, MOVED_REACH_M = 1.0, 6.0
MOVED_HERE, MOVED_AWAY = 1.5, -3.0

DEPTH_M = np.array([-4, -1.5, -0.7, -0.3, -0.1, 0.1, 0.3, 0.6, 1, 1.6, 2.5, 4, 7, 12, 20])
SOLID_ODDS = np.array(
    [-2.08, -0.51, -1, 0.24, 3.59, 6.84, 8, 6.82, 4.05, 1.89, 1.12, 1.48, 1.65, 0.88, -0.24]
)
SCATTER_ODDS = np.array(
    [-2.91, -1.48, -0.46, 0.48, 1.47, 2.33, 2.76, 2.66, 2.08, 1.19, 0.65, 0.52, 0.37, -0.14, -0.98]
)
HEIGHT_M = np.array([-0.3, 0.1, 0.4, 0.8, 1.2, 1.6, 2, 2.6, 3.5, 6])
HEIGHT_ODDS = np.array([-5, -4.51, -3.99, -3.85, -3.55, -4.42, -5.48, -5.86, -6.62, -7.36])

TABLE_PER_M = 20.0
SHARES_PER_ODDS, SHARE_TABLE_FROM = 32.0, -12.0
DEPTH_TABLE_FROM_M, HEIGHT_TABLE_FROM_M = -4.0, -0.5


def scan_weights(count: int) -> Float64Array:
    """Weights (count,) of the scans' say, nearest first.

    Scans that look at the same place repeat each other's errors: their weights sum to less than
    those of independent scans would, here to the fading sum's power 1 - REPEAT.

    Examples
    --------
    >>> scan_weights(1), scan_weights(2).round(2)
    (array([1.]), array([0.87, 0.52]))
    """
    fading = FADE ** np.arange(count)
    return np.asarray(fading / fading.sum() ** REPEAT)


def depth_odds(depth_m: Float64Array, solid: bool = True) -> Float64Array:
    """Log-odds that a mark at that depth behind a seen surface is filled."""
    return np.asarray(np.interp(depth_m, DEPTH_M, SOLID_ODDS if solid else SCATTER_ODDS))


def height_odds(height_m: Float64Array) -> Float64Array:
    """Log-odds that a mark so high above the ground is filled, no scan having a say."""
    return np.asarray(np.interp(height_m, HEIGHT_M, HEIGHT_ODDS))


def changes(apart_s: ArrayLike, scans: int) -> tuple[Float64Array, Float64Array]:
    """Shares `gone` of blocked lines and `came` of open ones that have changed after a time.

    Examples
    --------
    >>> gone, came = changes([0.0, 1.0, 100.0], scans=1)
    >>> gone.round(2), came.round(2)
    (array([0.  , 0.14, 0.45]), array([0.  , 0.07, 0.41]))
    """
    moved = 1.0 - np.exp(-np.asarray(apart_s) / CHANGE_S)
    gone, came = (GONE_SEEN_ONCE, CAME_SEEN_ONCE) if scans == 1 else (GONE, CAME)
    return np.minimum(gone * moved, MOST_CHANGED), np.minimum(came * moved, MOST_CHANGED)


def probability(exponent: ArrayLike, gone: ArrayLike, came: ArrayLike) -> Float64Array:
    """P(visible) of lines with exponents x, of which such shares have changed.

    Examples
    --------
    >>> probability([np.log(2.0), 0.0, 9.0], 0.2, 0.1).round(3)
    array([0.5, 0.9, 0.2])
    """
    gone, came = np.asarray(gone), np.asarray(came)
    fair = (0.5 - came) / (0.5 - gone)
    with np.errstate(over="ignore"):
        still = 1.0 / (1.0 + fair * np.expm1(exponent) ** SHARPNESS)
    return np.asarray(gone + (1.0 - gone - came) * still)


def _middles(start: float, last: float) -> Float64Array:
    """Middles of steps of 1 / TABLE_PER_M from `start` to past the last knot of a curve."""
    count = int(np.ceil((last - start) * TABLE_PER_M)) + 1
    return np.asarray(start + (np.arange(count) + 0.5) / TABLE_PER_M)


class Model(NamedTuple):
    """All numbers of this module as kernels take them: curves as tables in steps of 5 cm.

    They are handed to kernels at run time, for compiled code that is kept on disk would go on
    with the numbers it was compiled with.
    """

    mark_m: float
    end_m: float
    rate_per_m: float
    buried_m: float
    buried_rate_per_m: float
    surface_from_m: float
    surface_to_m: float
    changed_from_m: float
    changed_to_m: float
    changed_low_m: float
    changed_high_m: float
    moved_step_m: float
    moved_reach_m: float
    moved_here: float
    moved_away: float
    depth_from_m: float
    height_from_m: float
    per_m: float
    share_from: float
    shares_per_odds: float
    usual_s: float
    solid: Float64Array
    scatter: Float64Array
    heights: Float64Array
    shares: Float64Array
    weights: Float64Array


def usual_model() -> Model:
    """The model as fitted; engine and oracle read the same tables, so that they agree exactly."""
    share_odds = SHARE_TABLE_FROM + (np.arange(768) + 0.5) / SHARES_PER_ODDS
    depth_m = _middles(DEPTH_TABLE_FROM_M, DEPTH_M[-1])
    weights = np.zeros((SCANS, SCANS))
    for count in range(1, SCANS + 1):
        weights[count - 1, :count] = scan_weights(count)
    return Model(
        mark_m=MARK_M,
        end_m=END_M,
        rate_per_m=RATE_PER_M,
        buried_m=BURIED_M,
        buried_rate_per_m=BURIED_RATE_PER_M,
        surface_from_m=SURFACE_FROM_M,
        surface_to_m=SURFACE_TO_M,
        changed_from_m=CHANGED_FROM_M,
        changed_to_m=CHANGED_TO_M,
        changed_low_m=CHANGED_LOW_M,
        changed_high_m=CHANGED_HIGH_M,
        moved_step_m=MOVED_STEP_M,
        moved_reach_m=MOVED_REACH_M,
        moved_here=MOVED_HERE,
        moved_away=MOVED_AWAY,
        depth_from_m=DEPTH_TABLE_FROM_M,
        height_from_m=HEIGHT_TABLE_FROM_M,
        per_m=TABLE_PER_M,
        share_from=SHARE_TABLE_FROM,
        shares_per_odds=SHARES_PER_ODDS,
        usual_s=USUAL_S,
        solid=depth_odds(depth_m),
        scatter=depth_odds(depth_m, solid=False),
        heights=height_odds(_middles(HEIGHT_TABLE_FROM_M, HEIGHT_M[-1])),
        shares=1.0 / (1.0 + np.exp(-share_odds)),
        weights=weights,
    )


MODEL = usual_model()
