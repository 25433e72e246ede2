"""The engine beside the baselines in generated worlds.

A baseline answers many targets from one viewpoint. Each query set therefore is one cell of
`intervis.lab.truth.cells` and one free viewpoint of its place; the targets are returns of the
cell's scan, and rays cast at the triangles give the labels. `intervis.lab.truth.matrix` asks the
engine other lines as well.
"""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from intervis.lab.truth.baselines import InputScans
from intervis.lab.truth.cells import MAX_LENGTH_M, Cell, free_points, random_of, scan_of
from intervis.lab.truth.evaluation import methods_for
from intervis.lab.truth.exact_world import exact_labels
from intervis.lab.truth.methods import Method
from intervis.lab.truth.query_set import QuerySet
from intervis.lab.truth.results import EvaluationResult, run_methods
from intervis.lab.worlds.places import PLACES, Place
from intervis.progress import Progress, reporter
from intervis.transform import transform

VIEWPOINTS, TARGETS = 2, 1000
"""Viewpoints of a cell, and targets of a viewpoint, at most."""


def evaluate_baselines(
    chosen: Sequence[Cell],
    *,
    seed: int = 0,
    methods: Sequence[Method] | None = None,
    progress: Progress | None = None,
) -> EvaluationResult:
    """Evaluate the engine and all baselines on returns of one scan a cell.

    Equal arguments give equal query sets. `methods` replaces engine and baselines.
    """
    results, labels, count = run_methods(
        cell_query_sets(chosen, seed),
        methods or methods_for("single", baselines=True),
        reporter(progress),
    )
    return EvaluationResult("matrix", "exact worlds", "single", labels, count, results)


def cell_query_sets(chosen: Iterable[Cell], seed: int) -> Iterator[QuerySet]:
    """The query sets of the cells; viewpoints from which all or no targets are visible are left
    out, because no correlation is defined for them.
    """
    places: dict[str, Place] = {}
    for cell in chosen:
        place = places.setdefault(cell.world, PLACES[cell.world](seed))
        rng = random_of(cell, seed)
        scan = scan_of(cell, place, rng)
        returns = transform(scan.pose, scan.points.astype(np.float64))
        inputs = InputScans((0,), (scan.points,), (scan.pose,), 0, 0)
        for n, viewpoint in enumerate(free_points(place, scan.pose[:3, 3], VIEWPOINTS, rng)):
            near = np.flatnonzero(np.linalg.norm(returns - viewpoint, axis=1) <= MAX_LENGTH_M)
            targets = returns[rng.permutation(near)[:TARGETS]]
            every = np.ones(len(targets), np.bool_)
            visible, occluded = exact_labels(place.caster, viewpoint, targets, every)
            labelled = visible | occluded
            if visible.any() and occluded.any():
                yield QuerySet(
                    f"{cell.scanner} {cell.mount} {cell.world} {n}",
                    inputs,
                    viewpoint,
                    targets[labelled],
                    visible[labelled],
                )
