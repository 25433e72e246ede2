"""The occupancy model: from observed ranges to visible, occluded and unknown.

This docstring defines what the engine computes. A sight line is sampled every `STEP_M` at most, at
the midpoints of equal steps; samples within `END_MARGIN_M` of an end are left out, because the ends
may lie on surfaces. A line may leave such a surface at a grazing angle: from either end inwards,
samples up to the first one with abs(d) > `END_SURFACE_M` for all scans, with d as below, are free
if that one is free or if they are at least `GRAZING_SAMPLES`.

**Inverse sensor model.** The range image of a scan (`range_image`) holds a surface range for each
direction. The depth of a sample behind it is d = r(sample) - r(surface), in metres, with the planar
range r of the range image (the horizontal range, or |z| where a beam is steeper than 45 degrees):

    d << 0      a beam passed through: free
    d near 0    on the surface
    d > 0       behind the surface: occluded from that scan, more likely occupied if close to it
    no surface  no beam, or no return: the scan does not contribute

A dropout is a beam without a return between two returns of one surface (`range_image`). Its depth
counts from where that surface would lie; it adds to the log-odds, but nothing was observed there:
for all rules below, the direction has no surface.

The `SCANS` scans nearest to either end of the line contribute. The log-odds that the sample at
height h above ground is occupied are

    log_odds = height_log_odds(h) + sum over scans k of weight_k depth_log_odds(d_k)

where h counts along gravity (`Scene.up`), from the nearest scan's ground. Where that scan
does not show the ground, `assumed_height_log_odds` of the height above the nearest ground that it
shows stands in, and `unknown_height_log_odds` if it shows none;
weight_k (`scan_weights`) decays with the rank of the scan. `depth_log_odds` has one curve for
surfaces, one for volumetric returns (`range_image`: leaves, wires, edges) and one for dropouts.

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
nearest scan saw free get log_odds <= `DYNAMIC_FREE_LOG_ODDS`.

**Transmittance.** An occupied sample attenuates the line by `ATTENUATION_PER_M` per metre. With the
occupancy P(occupied) = 1 / (1 + exp(-log_odds)), the optical depth of the line is

    x = BASE_OPTICAL_DEPTH + sum over samples of ATTENUATION_PER_M occupancy step
        + END_OCCLUDED_DEPTH e ** END_OCCLUDED_POWER

Here e is the length, in metres, of the occluded space that reaches an end of the line (of both
ends, if both do): such an end may lie inside a solid body.

**Probability.** For independent samples, exp(-x) would be the probability that the line is clear.
Errors of neighbouring samples are correlated, which the power `SHARPNESS` corrects. Until the query
time, a fraction `disappeared` of the movable blockers has gone, and a fraction `appeared` of the
visible lines has become occluded (`change_fractions`; both are 0 without a query time). With the
part x_movable of x from surfaces at heights of traffic and people:

    Q(x) = 1 / (1 + (exp(x) - 1) ** SHARPNESS)
    P(visible) = Q(x) + disappeared (Q(x - x_movable) - Q(x)) - appeared Q(x)

**Three answers.** Beside `BASE_OPTICAL_DEPTH`, x is the sum of three parts, and each sample belongs
to one of them: `surface` (samples with `SURFACE_FROM_M` <= d <= `SURFACE_TO_M` for some scan, or
occupied by a dynamic object), `free` (other samples with d < `SURFACE_FROM_M` for some
scan) and `unobserved` (all others: no scan has a surface in their direction, or they lie deeper
than `SURFACE_TO_M` behind it).

The line is *mostly observed* if at most `OBSERVED_MAX_UNOBSERVED_M` and at most the fraction
`OBSERVED_MAX_UNOBSERVED_FRACTION` of its length is unobserved, and at most
`OBSERVED_MAX_OCCLUDED_SPACE_M` of that lies behind a surface. Thresholds of P decide on the state:

    occluded (0)   P <= occluded_to, and surface >= OCCLUDED_MIN_SURFACE
    visible  (1)   P >= visible_from if mostly observed, else P >= visible_unobserved_from
    unknown (-1)   all other lines

They depend on the risk that the caller states (`thresholds_for`): how often each of the two words
may be wrong. They come from conformal risk control (Angelopoulos et al., ICLR 2024) on calibration
scans; `intervis.lab.calibrate.risk` says how, and under which assumption they hold.

All rules treat the two ends alike: the answer for (a, b) is the answer for (b, a).

**Where the numbers come from.** `occupancy_model.toml` holds every fitted number and what it was
fitted to; `intervis calibrate` fits them again (`intervis.lab.calibrate`). The constants below were
chosen by hand; a comment says what each stands for. The rule for dynamic objects was studied on
eight pairs of a KITTI drive, on a second drive in traffic and in two built-in streets: of the
dynamic samples that it calls occupied the reference scan saw 59 to 86 % occupied, of those that it
calls free 5 to 13 %. Motion steps of 0.3 to 1 m, a reach of 5 to 12 m and `DYNAMIC_MAX_DEPTH_M`
from 2 to 10 m changed the scores by at most 0.008.
"""

import tomllib
from collections.abc import Mapping
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from intervis.arrays import BoolArray, Float64Array
from intervis.sight.kernels.parameters import OccupancyModel, Parameters, Tables, Thresholds

FITTED_FILE = "occupancy_model.toml"
FITTED: Mapping[str, Any] = tomllib.loads(
    files("intervis.sight").joinpath(FITTED_FILE).read_text(encoding="utf-8")
)["numbers"]
"""The fitted numbers by name, in lower case."""

# A step of 0.2 m takes 1.4 times the time and raises MCC on held-out returns by 0.003 to 0.005.
STEP_M = 0.3
# Ends lie on surfaces, give or take range noise and pose errors.
END_MARGIN_M = 0.4
# Contributing scans at most; chosen with `weight_decay` and `correlation`.
SCANS = 6
WEIGHT_DECAY: float = FITTED["weight_decay"]
"""Ratio of the weights of a scan and the next nearer one."""
CORRELATION: float = FITTED["correlation"]
"""Correlation of the errors of several scans, from 0 (independent) to 1 (identical)."""
# Metres of distance that one second between scan and query is worth.
AGE_COST_M_PER_S = 20.0
ATTENUATION_PER_M: float = FITTED["attenuation_per_m"]
BASE_OPTICAL_DEPTH: float = FITTED["base_optical_depth"]
END_OCCLUDED_DEPTH: float = FITTED["end_occluded_depth"]
END_OCCLUDED_POWER: float = FITTED["end_occluded_power"]
# The ground map is uncertain by less than this.
BELOW_GROUND_M = 0.5
SHARPNESS: float = FITTED["sharpness"]
CHANGE_TIME_S: float = FITTED["change_time_s"]
"""Time constant of both change fractions, seconds."""
DISAPPEARED_UNBRACKETED: float = FITTED["disappeared_unbracketed"]
APPEARED_UNBRACKETED: float = FITTED["appeared_unbracketed"]
"""Change fractions after a long time if no scans before and after the query time contribute."""
DISAPPEARED: float = FITTED["disappeared"]
APPEARED: float = FITTED["appeared"]
"""Change fractions after a long time if scans before and after the query time contribute."""
# Below 0.5, so that P(visible) still rises with Q.
MAX_CHANGED = 0.45
# A line that is observed but for so much is mostly observed. Unobserved space is rarely occupied,
# so that such lines have a threshold of their own.
OBSERVED_MAX_UNOBSERVED_M, OBSERVED_MAX_UNOBSERVED_FRACTION = 3.0, 0.5
OBSERVED_MAX_OCCLUDED_SPACE_M = 1.0
# Without an observed surface on it a line may be improbable, but nothing is known to occlude it.
OCCLUDED_MIN_SURFACE = 0.1
DEFAULT_RISK, RISK_RANGE = 0.05, (0.001, 0.2)
"""How often "visible" and "occluded" may each be wrong, unless the caller says so."""
# Depths that count as the surface itself.
SURFACE_FROM_M, SURFACE_TO_M = -0.2, 1.3
# A line that ends on a surface leaves it along samples that are not farther from it than this.
END_SURFACE_M = 0.2
# So many samples within that distance: the angle between line and surface is below 20 degrees.
GRAZING_SAMPLES = 4
# At d below this the beam passed through.
FREE_DEPTH_M = -0.7
# Greater depths behind a surface say nothing about the object in front of it.
DYNAMIC_MAX_DEPTH_M = 3.0
# Heights above ground of traffic and people.
DYNAMIC_MIN_HEIGHT_M, DYNAMIC_MAX_HEIGHT_M = 0.2, 3.0
# Search for the two positions of a moving object, along the sensor's path.
MOTION_STEP_M, MOTION_REACH_M = 1.0, 6.0
# Bounds: an occupancy of at least 0.82, or of at most 0.05.
DYNAMIC_OCCUPIED_LOG_ODDS, DYNAMIC_FREE_LOG_ODDS = 1.5, -3.0

# Sampling of the curves for the kernels: 5 cm, 1/32 in log-odds.
ENTRIES_PER_M = 20.0
ENTRIES_PER_LOG_ODDS, LOG_ODDS_FROM, LOG_ODDS_ENTRIES = 32.0, -12.0, 768
DEPTH_FROM_M, HEIGHT_FROM_M, ASSUMED_FROM_M = -4.0, -8.0, -8.0


def scan_weights(
    count: int, decay: float = WEIGHT_DECAY, correlation: float = CORRELATION
) -> Float64Array:
    """Weights (count,) of the contributing scans, nearest first.

    The weights of `count` scans with independent errors would sum to
    s = 1 + decay + decay ** 2 + ...; because their errors are correlated they sum to
    s ** (1 - correlation).

    Examples
    --------
    >>> scan_weights(1), scan_weights(2, decay=0.6, correlation=0.3).round(2)
    (array([1.]), array([0.87, 0.52]))
    """
    decaying = decay ** np.arange(count)
    return np.asarray(decaying / decaying.sum() ** correlation)


def _entry_centres(start: float, last: float) -> Float64Array:
    """Centres of table entries from `start` to past the last knot of a curve."""
    count = int(np.ceil((last - start) * ENTRIES_PER_M)) + 1
    return np.asarray(start + (np.arange(count) + 0.5) / ENTRIES_PER_M)


def model_of(fitted: Mapping[str, Any]) -> OccupancyModel:
    """The occupancy model with these fitted numbers, for engine and reference implementation."""
    constants = {name: globals().get(name.upper()) for name in Parameters._fields}
    numbers: dict[str, Any] = constants | {
        name: value for name, value in fitted.items() if name in Parameters._fields
    }
    depth_m = _entry_centres(DEPTH_FROM_M, fitted["depth_m"][-1])
    height_m = _entry_centres(HEIGHT_FROM_M, fitted["height_m"][-1])
    assumed_m = _entry_centres(ASSUMED_FROM_M, fitted["assumed_height_m"][-1])
    numbers["known_height_entries"] = len(height_m)
    parameters = Parameters(**{name: float(value) for name, value in numbers.items()})
    log_odds = LOG_ODDS_FROM + (np.arange(LOG_ODDS_ENTRIES) + 0.5) / ENTRIES_PER_LOG_ODDS
    weights = np.zeros((SCANS, SCANS))
    for count in range(1, SCANS + 1):
        of_count = scan_weights(count, fitted["weight_decay"], fitted["correlation"])
        weights[count - 1, :count] = of_count
    tables = Tables(
        depth_log_odds=np.concatenate(
            [
                np.interp(depth_m, fitted["depth_m"], fitted["volumetric_log_odds"]),
                np.interp(depth_m, fitted["depth_m"], fitted["surface_log_odds"]),
                np.interp(depth_m, fitted["depth_m"], fitted["dropout_log_odds"]),
                [0.0],
            ]
        ),
        height_log_odds=np.concatenate(
            [
                [fitted["unknown_height_log_odds"]],
                np.interp(height_m[1:], fitted["height_m"], fitted["height_log_odds"]),
                np.interp(assumed_m, fitted["assumed_height_m"], fitted["assumed_height_log_odds"]),
            ]
        ),
        occupancies=1.0 / (1.0 + np.exp(-log_odds)),
        scan_weights=weights,
    )
    return OccupancyModel(parameters, tables)


MODEL = model_of(FITTED)


def change_fractions(
    time_gap_s: ArrayLike, bracketed: ArrayLike, parameters: Parameters = MODEL.parameters
) -> tuple[Float64Array, Float64Array]:
    """Fractions `disappeared` of occluded and `appeared` of visible lines after a time.

    `bracketed` says for each line, or for all, whether scans before and after the query time
    contribute.

    Examples
    --------
    >>> disappeared, appeared = change_fractions([0.0, 1.0, 100.0], bracketed=False)
    >>> float(disappeared[0]), float(appeared[0]), bool((np.diff(appeared) > 0).all())
    (0.0, 0.0, True)
    """
    p = parameters
    changed = 1.0 - np.exp(-np.asarray(time_gap_s) / p.change_time_s)
    disappeared = np.where(bracketed, p.disappeared, p.disappeared_unbracketed)
    appeared = np.where(bracketed, p.appeared, p.appeared_unbracketed)
    return np.minimum(disappeared * changed, p.max_changed), np.minimum(
        appeared * changed, p.max_changed
    )


def end_optical_depth(
    end_occluded_m: ArrayLike, parameters: Parameters = MODEL.parameters
) -> Float64Array:
    """Optical depth of occluded space of this length, metres, that reaches an end of a line.

    Examples
    --------
    >>> bool((np.diff(end_optical_depth([0.0, 1.0, 5.0])) > 0).all())
    True
    """
    return np.asarray(
        parameters.end_occluded_depth
        * np.asarray(end_occluded_m, np.float64) ** parameters.end_occluded_power
    )


def probability(
    optical_depth: ArrayLike,
    movable: ArrayLike,
    disappeared: ArrayLike,
    appeared: ArrayLike,
    sharpness: float = SHARPNESS,
) -> Float64Array:
    """P(visible) of lines with optical depths x, the movable part of it, and change fractions.

    Examples
    --------
    A clear line, one that a wall occludes, and one that a car occludes:

    >>> probability([0.0, 9.0, 9.0], [0.0, 0.0, 9.0], 0.2, 0.1).round(3)
    array([0.9, 0. , 0.2])
    """
    unchanged = unchanged_probability(optical_depth, sharpness)
    without = np.maximum(np.asarray(optical_depth) - np.asarray(movable), 0.0)
    static = unchanged_probability(without, sharpness)
    return np.asarray(
        unchanged
        + np.asarray(disappeared) * (static - unchanged)
        - np.asarray(appeared) * unchanged
    )


def unchanged_probability(optical_depth: ArrayLike, sharpness: float = SHARPNESS) -> Float64Array:
    """Q(x): the probability that a line is clear if nothing moves.

    Examples
    --------
    >>> unchanged_probability([0.0, np.log(2.0)])
    array([1. , 0.5])
    """
    with np.errstate(over="ignore"):
        return np.asarray(1.0 / (1.0 + np.expm1(optical_depth) ** sharpness))


def mostly_observed(
    unobserved_m: ArrayLike, occluded_space_m: ArrayLike, length_m: ArrayLike
) -> BoolArray:
    """Which lines were observed but for a small part.

    Parameters
    ----------
    unobserved_m, occluded_space_m, length_m : (L,) float64 arrays
        Length that is unobserved, the part of it behind surfaces, and length of the line, metres.

    Examples
    --------
    The second line is half unobserved, outside the end margins:

    >>> mostly_observed([0.5, 2.5], 0.0, 5.0)
    array([ True, False])
    """
    sampled_m = np.maximum(np.asarray(length_m) - 2.0 * END_MARGIN_M, 0.0)
    allowed_m = np.minimum(OBSERVED_MAX_UNOBSERVED_M, OBSERVED_MAX_UNOBSERVED_FRACTION * sampled_m)
    return np.asarray(
        (np.asarray(unobserved_m) <= allowed_m)
        & (np.asarray(occluded_space_m) <= OBSERVED_MAX_OCCLUDED_SPACE_M)
    )


def thresholds_for(risk: float, fitted: Mapping[str, Any] = FITTED) -> Thresholds:
    """The thresholds of a stated risk: those of the next lower risk that was calibrated.

    Parameters
    ----------
    risk : float
        How often "visible" and "occluded" may each be wrong, from 0.001 to 0.2.
    fitted : mapping
        With `risks`, ascending, and a list for each field of `Thresholds`.

    Examples
    --------
    >>> strict, lenient = thresholds_for(0.01), thresholds_for(0.1)
    >>> strict.visible_from >= lenient.visible_from, strict.occluded_to <= lenient.occluded_to
    (True, True)
    """
    row = int(np.searchsorted(fitted["risks"], risk * (1.0 + 1e-9), side="right")) - 1
    return Thresholds(*(float(fitted[name][row]) for name in Thresholds._fields))


DEFAULT_THRESHOLDS = thresholds_for(DEFAULT_RISK)
