"""Sight lines with known answers, and their samples as one flat table."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from intervis.arrays import BoolArray, Float64Array, IntArray
from intervis.lab.truth.baselines.input_scans import scene_of
from intervis.lab.truth.query_set import QuerySet
from intervis.sight.kernels.packed_scans import PackedScans
from intervis.sight.occupancy_model import FITTED
from intervis.sight.reference import (
    LineSamples,
    end_occluded_m,
    is_bracketed,
    movable,
    reference_samples,
    time_gap_s,
)


@dataclass(frozen=True, eq=False)
class QueryLines:
    """L lines of one query set: what may be used, ends, and the answers.

    Attributes
    ----------
    label : str
    scans : PackedScans
        The scans that the engine may use.
    starts, ends : (L, 3) float64 arrays
        Scene frame, metres.
    visible : (L,) bool array
    family : str
        All families have the same weight, and so have the query sets of a family.
    unit : str
        The scans that it belongs to: lines of one unit depend on each other.
    sources : tuple of str
        Scanner, mount and world, or the drive: see `intervis.lab.calibrate.left_out`.
    """

    label: str
    scans: PackedScans
    starts: Float64Array
    ends: Float64Array
    visible: BoolArray
    family: str = ""
    unit: str = ""
    sources: tuple[str, ...] = ()


def query_lines(query_set: QuerySet, count: int, rng: np.random.Generator) -> QueryLines:
    """At most `count` random lines of a query set, with the scene that answers them."""
    overall = query_set.overall
    usable = np.arange(len(query_set.targets)) if overall is None else np.flatnonzero(overall)
    rows = np.sort(rng.permutation(usable)[:count])
    return QueryLines(
        query_set.label,
        scene_of(query_set.inputs).packed_scans(query_set.inputs.moment_s),
        np.broadcast_to(query_set.viewpoint, (len(rows), 3)).copy(),
        query_set.targets[rows],
        query_set.visible[rows],
    )


@dataclass(frozen=True, eq=False)
class SampleTable:
    """The samples of L lines, K in all.

    Attributes
    ----------
    line : (K,) int64 array
        Which line a sample belongs to.
    step_m : (K,) float64 array
    by_rank : list of (K, 3 D) sparse arrays
        For each rank of a contributing scan: interpolation weights of the knots of the volumetric,
        the surface and the dropout curve; a row is empty if that scan has neither a return nor a
        dropout in the direction.
    height : (K, H + G) sparse array
        Interpolation weights of the knots of the height curves over known and over assumed ground;
        a row is empty where there is neither.
    height_log_odds : (K,) float64 array
        Log-odds that are not fitted: `unknown_height_log_odds` without any ground, else 0.
    scans : (K,) int64 array
        Number of scans that contribute to the line.
    occupied, left : (K,) bool arrays
        See `intervis.sight.reference.LineSamples`.
    movable : (K,) bool array
        See `intervis.sight.reference.movable`.
    visible : (L,) bool array
    weight : (L,) float64 array
        Weights of the lines; those of a family sum to 1.
    time_gap_s, end_occluded_m : (L,) float64 arrays
    bracketed : (L,) bool array
    """

    line: IntArray
    step_m: Float64Array
    by_rank: list[sparse.csr_array]
    height: sparse.csr_array
    height_log_odds: Float64Array
    scans: IntArray
    occupied: BoolArray
    left: BoolArray
    movable: BoolArray
    visible: BoolArray
    weight: Float64Array
    time_gap_s: Float64Array
    end_occluded_m: Float64Array
    bracketed: BoolArray


def hat_weights(value: Float64Array, knots: Float64Array) -> sparse.csr_array:
    """Weights (K, D) of linear interpolation: ``weights @ curve`` is ``np.interp``.

    Rows with NaN are empty.

    Examples
    --------
    >>> hat_weights(np.array([0.5, 9.0, np.nan]), np.array([0.0, 2.0, 4.0])).toarray()
    array([[0.75, 0.25, 0.  ],
           [0.  , 0.  , 1.  ],
           [0.  , 0.  , 0.  ]])
    """
    known = np.flatnonzero(~np.isnan(value))
    clipped = np.clip(value[known], knots[0], knots[-1])
    low = np.clip(np.searchsorted(knots, clipped, side="right") - 1, 0, len(knots) - 2)
    fraction = (clipped - knots[low]) / (knots[low + 1] - knots[low])
    rows = np.concatenate([known, known])
    columns = np.concatenate([low, low + 1])
    weights = np.concatenate([1.0 - fraction, fraction])
    table = sparse.coo_array((weights, (rows, columns)), shape=(len(value), len(knots)))
    csr = sparse.csr_array(table)
    csr.eliminate_zeros()
    return csr


def sample_table(
    query_sets: Iterable[QueryLines],
    depth_m: Float64Array,
    height_m: Float64Array,
    assumed_height_m: Float64Array,
) -> SampleTable:
    """Sample the lines of all query sets by the reference implementation.

    Parameters
    ----------
    query_sets : iterable of QueryLines
    depth_m, height_m, assumed_height_m : (D,), (H,) and (G,) float64 arrays
        Knots of the curves.
    """
    lines: list[LineSamples] = []
    visible, weight, gap_s, bracketed, families = [], [], [], [], []
    for queries in query_sets:
        for a, b in zip(queries.starts, queries.ends, strict=True):
            lines.append(reference_samples(queries.scans, a, b))
            gap_s.append(time_gap_s(queries.scans, a, b))
            bracketed.append(is_bracketed(queries.scans, a, b))
        visible.append(queries.visible)
        weight.append(np.full(len(queries.starts), 1.0 / len(queries.starts)))
        families.append(queries.family)
    sizes = Counter(families)
    weight = [one / sizes[family] for one, family in zip(weight, families, strict=True)]
    counts = np.array([len(line.height) for line in lines])
    ranks = max(len(line.weights) for line in lines)
    height = np.concatenate([line.height for line in lines])
    assumed = np.concatenate([line.assumed_height for line in lines])
    heights = [hat_weights(height, height_m), hat_weights(assumed, assumed_height_m)]
    return SampleTable(
        line=np.repeat(np.arange(len(lines)), counts),
        # Samples along the surface that an end lies on do not attenuate.
        step_m=np.concatenate([np.where(line.along_end, 0.0, line.step) for line in lines]),
        by_rank=[_depth_weights(lines, rank, depth_m) for rank in range(ranks)],
        height=sparse.csr_array(sparse.hstack(heights)),
        height_log_odds=np.where(
            np.isnan(height) & np.isnan(assumed), FITTED["unknown_height_log_odds"], 0.0
        ),
        scans=np.repeat([len(line.weights) for line in lines], counts),
        occupied=np.concatenate([line.occupied for line in lines]),
        left=np.concatenate([line.left for line in lines]),
        movable=np.concatenate([movable(line) for line in lines]),
        visible=np.concatenate(visible),
        weight=np.concatenate(weight),
        time_gap_s=np.array(gap_s),
        end_occluded_m=np.array([end_occluded_m(line) for line in lines]),
        bracketed=np.array(bracketed),
    )


def lines_of(table: SampleTable, rows: BoolArray) -> SampleTable:
    """The table of some of its lines, `rows` (L,). Each line keeps its weight."""
    samples = rows[table.line]
    of_lines = ("visible", "weight", "time_gap_s", "end_occluded_m", "bracketed")
    of_samples = (
        *("step_m", "height", "height_log_odds"),
        *("scans", "occupied", "left", "movable"),
    )
    return SampleTable(
        line=(np.cumsum(rows) - 1)[table.line[samples]],
        by_rank=[weights[samples] for weights in table.by_rank],
        **{name: getattr(table, name)[samples] for name in of_samples},
        **{name: getattr(table, name)[rows] for name in of_lines},
    )


def _depth_weights(lines: list[LineSamples], rank: int, depth_m: Float64Array) -> sparse.csr_array:
    """Interpolation weights for the scan of one rank: volumetric, surface and dropout knots."""
    depth, surface, dropout = [], [], []
    for line in lines:
        unobserved = np.full(len(line.height), np.nan)
        has = rank < len(line.weights)
        depth.append(np.where(line.known[rank], line.depth[rank], np.nan) if has else unobserved)
        surface.append(line.is_surface[rank] if has else np.zeros(len(line.height), bool))
        dropout.append(line.dropout_depth[rank] if has else unobserved)
    value, is_surface = np.concatenate(depth), np.concatenate(surface)
    volumetric = hat_weights(np.where(is_surface, np.nan, value), depth_m)
    of_surface = hat_weights(np.where(is_surface, value, np.nan), depth_m)
    of_dropout = hat_weights(np.concatenate(dropout), depth_m)
    return sparse.csr_array(sparse.hstack([volumetric, of_surface, of_dropout]))


@dataclass(frozen=True, eq=False)
class LineDepths:
    """L lines with known answers, and what decides on their probability.

    Attributes
    ----------
    optical_depth, movable : (L,) float64 arrays
        Without the term of occluded ends; its movable part.
    end_occluded_m, time_gap_s : (L,) float64 arrays
    bracketed, visible : (L,) bool arrays
    weight : (L,) float64 array
    """

    optical_depth: Float64Array
    movable: Float64Array
    end_occluded_m: Float64Array
    time_gap_s: Float64Array
    bracketed: BoolArray
    visible: BoolArray
    weight: Float64Array
