"""The occupancy model: from observed ranges to visible, occluded and unknown.

This page defines what the engine computes. A sight line is sampled every `STEP_M` at most, at the
midpoints of equal steps; samples within `END_MARGIN_M` of an end are left out, because the ends may
lie on surfaces.

**Inverse sensor model.** The range image of a scan (`range_image`) holds a surface range for each
direction. The depth of a sample behind it is d = rho(sample) - rho(surface), in metres:

    d << 0      a beam passed through: free
    d near 0    on the surface
    d > 0       behind the surface: occluded from that scan, more likely occupied if close to it
    no surface  no beam, or no return: the scan does not contribute

The `SCANS` scans nearest to one of the line's ends contribute. The log-odds that the sample at
height h above ground is occupied are

    log_odds = height_log_odds(h) + sum over scans k of weight_k depth_log_odds(d_k)

where weight_k (`scan_weights`) decays with the rank of the scan. `depth_log_odds` has one curve for
surfaces and one for volumetric returns.

**Dynamic objects.** A query time is optional. With one, each second between it and a scan adds
`AGE_COST_M_PER_S` to that scan's distance. Two scans bracket the query: the nearest scan, and the
nearest scan on the other side of the query time (without a query time: of the line's end, which the
sensor passed between the two). `fraction` is the part of the time (of the way) that had passed. A
sample between `DYNAMIC_MIN_HEIGHT_M` and `DYNAMIC_MAX_HEIGHT_M` above ground is dynamic if one of
the two scans saw it occupied (d from `SURFACE_FROM_M` to `DYNAMIC_MAX_DEPTH_M`) and the other saw
it free (d < `FREE_DEPTH_M`). An object at p in one scan and at q in the other was at
p + fraction (q - p). The rule looks for such p and q on a line through the sample along the
sensor's path, up to `MOTION_REACH_M` apart, both on a surface of their own scan, at least one of
them free in the other. If it finds a pair, the sample is occupied: log_odds >=
`DYNAMIC_OCCUPIED_LOG_ODDS`. If not, the object had left or had not arrived: log_odds <=
`DYNAMIC_FREE_LOG_ODDS`. With a query time outside the time span of the scans, samples that the
nearest scan saw free get the second bound.

**Transmittance.** An occupied sample attenuates the line by `ATTENUATION_PER_M` per metre. With the
occupancy P(occupied) = 1 / (1 + exp(-log_odds)), the optical depth of the line is

    x = BASE_OPTICAL_DEPTH + sum over samples of ATTENUATION_PER_M occupancy step

A sample more than `BELOW_GROUND_M` below the nearest scan's ground, and free in no scan, attenuates
by `BELOW_GROUND_ATTENUATION_PER_M` instead, whatever its log-odds.

**Probability.** For independent samples, exp(-x) would be the probability that the line is clear.
Errors of neighbouring samples are correlated, which the power `SHARPNESS` corrects. Since the scans
were taken, a fraction `disappeared` of the occluded lines has become visible, and a fraction
`appeared` of the visible lines has become occluded (`change_fractions`):

    Q = 1 / (1 + c (exp(x) - 1) ** SHARPNESS),   c = (0.5 - appeared) / (0.5 - disappeared)
    P(visible) = disappeared + (1 - disappeared - appeared) Q

The factor c keeps P = 0.5 where Q without it is 0.5.

**Three answers.** x is the sum of three parts: `surface` (samples with `SURFACE_FROM_M` <= d <=
`SURFACE_TO_M` for some scan, below ground, or occupied by a dynamic object), `free` (other samples
that some scan saw free) and `unobserved` (samples that no scan observed).

    occluded (0)   surface > OCCLUDED_MIN_SURFACE: the line meets an observed surface
    visible  (1)   surface < VISIBLE_MAX_SURFACE, unobserved < VISIBLE_MAX_UNOBSERVED and
                   P >= VISIBLE_MIN_PROBABILITY; at most VISIBLE_MAX_UNOBSERVED_M and at most the
                   fraction VISIBLE_MAX_UNOBSERVED_FRACTION of its length is unobserved, and at most
                   VISIBLE_MAX_OCCLUDED_SPACE_M is unobserved and behind a surface
    unknown (-1)   all other lines

All rules treat the two ends alike: the answer for (a, b) is the answer for (b, a).

**Where the numbers come from.** `intervis calibrate` fits the curves, the attenuation, the
sharpness and the change fractions by maximum likelihood; see `intervis.lab.calibrate`. The values
below were fitted before that command existed, by the same likelihood: the curves on held-out
returns of pairs (0,3) (3,12) (14,1) (21,12) (8,15) (18,9) (12,6) (16,20) of a public KITTI drive of
22 scans, half of them in protocol `single`, half in `map`; `SHARPNESS` and the change fractions on
those pairs, ten pairs of another drive and twelve of two built-in streets, in all protocols.
`WEIGHT_DECAY`, `SCANS` and `CORRELATION` were chosen on those pairs and checked on six more of the
same drive. The thresholds of the three answers were chosen in built-in worlds. The rule for dynamic
objects was studied on the eight pairs, on another drive in traffic and in two built-in streets: of
the dynamic samples that it calls occupied the reference scan saw 59 to 86 % occupied, of those that
it calls free 5 to 13 %. Motion steps of 0.3 to 1 m, a reach of 5 to 12 m and `DYNAMIC_MAX_DEPTH_M`
from 2 to 10 m changed the scores by at most 0.008.
"""

import numpy as np
from numpy.typing import ArrayLike

from intervis.arrays import Float64Array
from intervis.sight.kernels.parameters import OccupancyModel, Parameters, Tables

STEP_M = 0.3
END_MARGIN_M = 0.4
SCANS = 6
"""Number of scans that contribute to a line at most."""
WEIGHT_DECAY = 0.6
"""Ratio of the weights of a scan and the next nearer one."""
AGE_COST_M_PER_S = 20.0
"""Distance that a second between scan and query time is worth."""
CORRELATION = 0.3
"""Correlation of the errors of several scans, from 0 (independent) to 1 (identical)."""
ATTENUATION_PER_M = 1.31
BELOW_GROUND_M, BELOW_GROUND_ATTENUATION_PER_M = 0.5, 4.0
BASE_OPTICAL_DEPTH = 2e-3
SHARPNESS = 1.65
CHANGE_TIME_S = 5.0
"""Time constant with which dynamic objects leave."""
DISAPPEARED_SINGLE_SCAN, APPEARED_SINGLE_SCAN = 0.77, 0.41
"""Change fractions after a long time if one scan contributes and nothing tells what moves."""
DISAPPEARED, APPEARED = 0.27, 0.19
"""Change fractions after a long time if several scans contribute."""
MAX_CHANGED = 0.45
"""Upper limit of both: an occluded line is never more likely visible than a visible one."""
DEFAULT_TIME_GAP_S = 1.0
"""Time between scans and query that is assumed if no query time is given."""
VISIBLE_MIN_PROBABILITY, VISIBLE_MAX_SURFACE, VISIBLE_MAX_UNOBSERVED = 0.85, 0.3, 0.25
VISIBLE_MAX_UNOBSERVED_M, VISIBLE_MAX_UNOBSERVED_FRACTION = 3.0, 0.5
VISIBLE_MAX_OCCLUDED_SPACE_M = 1.0
OCCLUDED_MIN_SURFACE = 0.95
SURFACE_FROM_M, SURFACE_TO_M = -0.2, 1.3
FREE_DEPTH_M, DYNAMIC_MAX_DEPTH_M = -0.7, 3.0
DYNAMIC_MIN_HEIGHT_M, DYNAMIC_MAX_HEIGHT_M = 0.2, 3.0
"""Heights above ground of traffic and people."""
MOTION_STEP_M, MOTION_REACH_M = 1.0, 6.0
DYNAMIC_OCCUPIED_LOG_ODDS, DYNAMIC_FREE_LOG_ODDS = 1.5, -3.0

DEPTH_M = np.array([-4, -1.5, -0.7, -0.3, -0.1, 0.1, 0.3, 0.6, 1, 1.6, 2.5, 4, 7, 12, 20])
SURFACE_LOG_ODDS = np.array(
    [-2.08, -0.51, -1, 0.24, 3.59, 6.84, 8, 6.82, 4.05, 1.89, 1.12, 1.48, 1.65, 0.88, -0.24]
)
VOLUMETRIC_LOG_ODDS = np.array(
    [-2.91, -1.48, -0.46, 0.48, 1.47, 2.33, 2.76, 2.66, 2.08, 1.19, 0.65, 0.52, 0.37, -0.14, -0.98]
)
HEIGHT_M = np.array([-0.3, 0.1, 0.4, 0.8, 1.2, 1.6, 2, 2.6, 3.5, 6])
HEIGHT_LOG_ODDS = np.array([-5, -4.51, -3.99, -3.85, -3.55, -4.42, -5.48, -5.86, -6.62, -7.36])

# Sampling of the curves for the kernels: 5 cm, 1/32 in log-odds.
ENTRIES_PER_M = 20.0
ENTRIES_PER_LOG_ODDS, LOG_ODDS_FROM, LOG_ODDS_ENTRIES = 32.0, -12.0, 768
DEPTH_FROM_M, HEIGHT_FROM_M = -4.0, -0.5


def scan_weights(count: int) -> Float64Array:
    """Weights (count,) of the contributing scans, nearest first.

    The weights of `count` scans with independent errors would sum to s = 1 + 0.6 + 0.36 + ...;
    because their errors are correlated they sum to s ** (1 - CORRELATION).

    Examples
    --------
    >>> scan_weights(1), scan_weights(2).round(2)
    (array([1.]), array([0.87, 0.52]))
    """
    decaying = WEIGHT_DECAY ** np.arange(count)
    return np.asarray(decaying / decaying.sum() ** CORRELATION)


def depth_log_odds(depth_m: Float64Array, surface: bool = True) -> Float64Array:
    """Log-odds that a sample at that depth behind an observed surface is occupied."""
    curve = SURFACE_LOG_ODDS if surface else VOLUMETRIC_LOG_ODDS
    return np.asarray(np.interp(depth_m, DEPTH_M, curve))


def height_log_odds(height_m: Float64Array) -> Float64Array:
    """Prior log-odds that a sample at that height above ground is occupied."""
    return np.asarray(np.interp(height_m, HEIGHT_M, HEIGHT_LOG_ODDS))


def change_fractions(time_gap_s: ArrayLike, single_scan: bool) -> tuple[Float64Array, Float64Array]:
    """Fractions `disappeared` of occluded and `appeared` of visible lines after a time.

    Examples
    --------
    >>> disappeared, appeared = change_fractions([0.0, 1.0, 100.0], single_scan=True)
    >>> disappeared.round(2), appeared.round(2)
    (array([0.  , 0.14, 0.45]), array([0.  , 0.07, 0.41]))
    """
    changed = 1.0 - np.exp(-np.asarray(time_gap_s) / CHANGE_TIME_S)
    disappeared = DISAPPEARED_SINGLE_SCAN if single_scan else DISAPPEARED
    appeared = APPEARED_SINGLE_SCAN if single_scan else APPEARED
    return np.minimum(disappeared * changed, MAX_CHANGED), np.minimum(
        appeared * changed, MAX_CHANGED
    )


def probability(
    optical_depth: ArrayLike, disappeared: ArrayLike, appeared: ArrayLike
) -> Float64Array:
    """P(visible) of lines with optical depths x and change fractions.

    Examples
    --------
    >>> probability([np.log(2.0), 0.0, 9.0], 0.2, 0.1).round(3)
    array([0.5, 0.9, 0.2])
    """
    disappeared, appeared = np.asarray(disappeared), np.asarray(appeared)
    balance = (0.5 - appeared) / (0.5 - disappeared)
    with np.errstate(over="ignore"):
        unchanged = 1.0 / (1.0 + balance * np.expm1(optical_depth) ** SHARPNESS)
    return np.asarray(disappeared + (1.0 - disappeared - appeared) * unchanged)


def _entry_centres(start: float, last: float) -> Float64Array:
    """Centres of table entries from `start` to past the last knot of a curve."""
    count = int(np.ceil((last - start) * ENTRIES_PER_M)) + 1
    return np.asarray(start + (np.arange(count) + 0.5) / ENTRIES_PER_M)


def fitted_model() -> OccupancyModel:
    """The numbers of this module for engine and reference implementation."""
    parameters = Parameters(**{name: float(globals()[name.upper()]) for name in Parameters._fields})
    depth_m = _entry_centres(DEPTH_FROM_M, DEPTH_M[-1])
    log_odds = LOG_ODDS_FROM + (np.arange(LOG_ODDS_ENTRIES) + 0.5) / ENTRIES_PER_LOG_ODDS
    weights = np.zeros((SCANS, SCANS))
    for count in range(1, SCANS + 1):
        weights[count - 1, :count] = scan_weights(count)
    tables = Tables(
        depth_log_odds=np.concatenate(
            [depth_log_odds(depth_m, surface=False), depth_log_odds(depth_m), [0.0]]
        ),
        height_log_odds=height_log_odds(_entry_centres(HEIGHT_FROM_M, HEIGHT_M[-1])),
        occupancies=1.0 / (1.0 + np.exp(-log_odds)),
        scan_weights=weights,
    )
    return OccupancyModel(parameters, tables)


MODEL = fitted_model()
