"""Exact truth over a matrix of scanners, mounts and worlds.

Each cell is one scan of a place, with the sight lines of `intervis.lab.truth.cells`.

A line is *honestly answerable* when one scan determines it. Let beam b of the scan have an echo at
the exact range r_b, and let s_b be its spacing. Of a point p at range r, the beams beside it are
those among its four nearest in angle that are at most s_b away.

- A visible line is answerable when at every sample, 0.1 m apart without 0.3 m at both ends, a beam
  beside it has r_b >= r - s_b r: the beam crossed the space there, within one spacing.
- An occluded line is answerable when it crosses a surface at a point with a beam beside it and
  abs(r_b - r) <= 0.1 m + s_b r: the surface is within one spacing of a return.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from intervis.arrays import BoolArray, Float64Array
from intervis.lab.truth.cells import KINDS, Cell, exact_lines, random_of, scan_of
from intervis.lab.truth.scores import Scores, mean_or_nan, number_or_none, score
from intervis.lab.worlds.beam_pattern import PatternScan
from intervis.lab.worlds.places import PLACES, Place
from intervis.lab.worlds.ray_casting import RayCaster
from intervis.plots.tables import Table
from intervis.progress import Progress, reporter
from intervis.sight import Scene
from intervis.transform import inverse, transform

STEP_M, END_M = 0.1, 0.3
SAME_SURFACE_M = 0.1
MAX_SURFACES = 8


@dataclass(frozen=True, eq=False)
class CellResult:
    """Scores of a cell.

    Attributes
    ----------
    cell : Cell
    scores : Scores
        Over all lines.
    answerable_coverage : float
        Share of the honestly answerable lines that are visible or occluded to the method.
    answerable : float
        Share of the lines that are honestly answerable.
    unknown_said, unknown_true : float
        Of the unknown lines: mean probability, and share that is visible.
    own_returns : float
        Share of the scan's own returns that are visible from its scanner.
    by_kind : dict of str to Scores
    """

    cell: Cell
    scores: Scores
    answerable_coverage: float
    answerable: float
    unknown_said: float
    unknown_true: float
    own_returns: float
    by_kind: dict[str, Scores]

    def to_json(self) -> dict[str, Any]:
        """The result with NaN as None."""
        names = ("answerable_coverage", "answerable", "unknown_said", "unknown_true", "own_returns")
        return {
            "scanner": self.cell.scanner,
            "mount": self.cell.mount,
            "world": self.cell.world,
            **{name: number_or_none(getattr(self, name)) for name in names},
            "scores": self.scores.to_json(),
            "by_kind": {name: scores.to_json() for name, scores in self.by_kind.items()},
        }


def evaluate_cells(
    chosen: Iterable[Cell], *, lines: int = 1500, seed: int = 0, progress: Progress | None = None
) -> Iterator[CellResult]:
    """Score the engine in each cell, with one scan and `lines` sight lines.

    Equal arguments give equal scans and lines.
    """
    places: dict[str, Place] = {}
    for cell in chosen:
        place = places.setdefault(cell.world, PLACES[cell.world](seed))
        result = _evaluated(cell, place, lines, random_of(cell, seed))
        reporter(progress)(f"{cell.scanner} {cell.mount} {cell.world}")
        yield result


def _evaluated(cell: Cell, place: Place, count: int, rng: np.random.Generator) -> CellResult:
    scan = scan_of(cell, place, rng)
    lines = exact_lines(place, scan, count, rng)
    answerable = honestly_answerable(place.caster, scan, lines.starts, lines.ends, lines.visible)
    scene = Scene.from_scan(scan.points, scan.pose)
    sight = scene.sight_lines(lines.starts, lines.ends)
    own = transform(scan.pose, scan.points[rng.permutation(len(scan.points))[:5000]])
    unknown, known = sight.unknown, ~sight.unknown
    return CellResult(
        cell,
        score(lines.visible, sight.probability, sight.state),
        mean_or_nan(known[answerable]),
        mean_or_nan(answerable),
        mean_or_nan(sight.probability[unknown]),
        mean_or_nan(lines.visible[unknown]),
        mean_or_nan(scene.sight(scan.pose[:3, 3], own).visible),
        {
            name: score(lines.visible[own_kind], sight.probability[own_kind], sight.state[own_kind])
            for k, name in enumerate(KINDS)
            if (own_kind := lines.kind == k).any()
        },
    )


def honestly_answerable(
    caster: RayCaster,
    scan: PatternScan,
    starts: Float64Array,
    ends: Float64Array,
    visible: BoolArray,
) -> BoolArray:
    """Which lines (L,) with exact labels `visible` one scan determines; see the module."""
    beside = _Beams(scan)
    found = np.zeros(len(starts), np.bool_)
    for line in np.flatnonzero(visible):
        segment = ends[line] - starts[line]
        length_m = float(np.linalg.norm(segment))
        at_m = np.arange(END_M, length_m - END_M + 1e-9, STEP_M)
        points = starts[line] + at_m[:, None] / length_m * segment
        # A coarse pass first: most lines that fail do so at many samples.
        found[line] = beside.crossed(points[::10]).all() and beside.crossed(points).all()
    active = np.flatnonzero(~visible)
    begin = starts.copy()
    for _ in range(MAX_SURFACES):
        distance_m = caster.first_hit(begin[active], ends[active])
        active, distance_m = active[np.isfinite(distance_m)], distance_m[np.isfinite(distance_m)]
        if not len(active):
            break
        units = ends[active] - begin[active]
        units /= np.linalg.norm(units, axis=1, keepdims=True)
        points = begin[active] + distance_m[:, None] * units
        found[active] = beside.hit(points)
        begin[active] = points + 1e-3 * units
        active = active[~found[active]]
    return found


class _Beams:
    """The beams of a scan, searched by direction."""

    def __init__(self, scan: PatternScan) -> None:
        self._scan = scan
        self._scanner_from_scene = inverse(scan.pose)
        self._tree = cKDTree(scan.pattern.directions)

    def _beside(self, points: Float64Array) -> tuple[Float64Array, Float64Array, Float64Array]:
        """Range (M, 1) of points; range (M, 4) of the beams beside (NaN: none), spacing (M, 4)."""
        local = transform(self._scanner_from_scene, points)
        range_m = np.linalg.norm(local, axis=1, keepdims=True)
        chord, beam = self._tree.query(local / np.maximum(range_m, 1e-9), k=4)
        spacing_rad = self._scan.pattern.spacing_rad[beam]
        echo_m = self._scan.ranges_m[beam]
        usable = np.isfinite(echo_m) & (2 * np.arcsin(np.minimum(chord / 2, 1)) <= spacing_rad)
        return range_m, np.where(usable, echo_m, np.nan), spacing_rad

    def crossed(self, points: Float64Array) -> BoolArray:
        """Whether a beam beside each point (M, 3) passed it."""
        range_m, echo_m, spacing_rad = self._beside(points)
        return np.asarray((echo_m >= range_m * (1 - spacing_rad)).any(axis=1))

    def hit(self, points: Float64Array) -> BoolArray:
        """Whether a beam beside each point (M, 3) has its echo within one spacing of it."""
        range_m, echo_m, spacing_rad = self._beside(points)
        tolerance_m = SAME_SURFACE_M + spacing_rad * range_m
        return np.asarray((np.abs(echo_m - range_m) <= tolerance_m).any(axis=1))


def matrix_table(results: Sequence[CellResult]) -> Table:
    """Cells as rows, and the mean over the cells in the last row."""
    heads = (
        *("scanner", "mount", "world", "visible right", "occluded right", "coverage"),
        *("answerable", "answered of these", "MCC", "Brier", "largest gap"),
        *("unknown said", "unknown true", "own returns"),
    )
    values = np.array([_numbers(result) for result in results]).reshape(-1, len(heads) - 3)
    known = np.isfinite(values).any(axis=0)
    mean = np.full(values.shape[1], np.nan)
    mean[known] = np.nanmean(values[:, known], axis=0)
    names = [(r.cell.scanner, r.cell.mount, r.cell.world) for r in results]
    rows = [
        (*name, *("-" if np.isnan(value) else f"{value:.3f}" for value in row))
        for name, row in zip([*names, ("mean", "", "")], [*values, mean], strict=True)
    ]
    return Table("Exact truth by scanner, mount and world", heads, tuple(rows))


def _numbers(result: CellResult) -> tuple[float, ...]:
    scores = result.scores
    return (
        *(scores.precision_visible, scores.precision_occluded, scores.coverage),
        *(result.answerable, result.answerable_coverage, scores.mcc, scores.brier),
        scores.reliability.max_calibration_error,
        *(result.unknown_said, result.unknown_true, result.own_returns),
    )


def worst_cell(results: Sequence[CellResult]) -> tuple[Cell, str, float]:
    """The cell, name and value of the lowest precision of "visible" or "occluded"."""
    found = [
        (value, name, result.cell)
        for result in results
        for name, value in (
            ("visible right", result.scores.precision_visible),
            ("occluded right", result.scores.precision_occluded),
        )
        if np.isfinite(value)
    ]
    value, name, cell = min(found, key=lambda item: item[0])
    return cell, name, value
