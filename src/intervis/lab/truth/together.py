"""Evaluation of several scanners of one moment: one scan is given, another one is the reference.

Nothing moves between the two scans and no pose drifts, so that all errors are errors of the method.
"""

from collections.abc import Sequence
from typing import Literal, get_args

import numpy as np

from intervis.errors import DriveError
from intervis.lab.truth.baselines import InputScans
from intervis.lab.truth.choices import checked_choice
from intervis.lab.truth.evaluation import methods_for
from intervis.lab.truth.held_out import rule_for_scanner
from intervis.lab.truth.labelled_targets import (
    TargetKind,
    checked_targets,
    labelled_targets,
    targets_suffix,
)
from intervis.lab.truth.methods import Method
from intervis.lab.truth.protocols import TOGETHER
from intervis.lab.truth.query_set import QuerySet, QuerySets
from intervis.lab.truth.results import EvaluationResult, run_methods
from intervis.lab.truth.scanner_set import ScannerSet
from intervis.progress import Progress, reporter
from intervis.transform import inverse, transform

QueryFrame = Literal["scene", "scanner"]
QUERY_FRAMES: tuple[QueryFrame, ...] = get_args(QueryFrame)
"""Frames in which scanners of one moment are queried, see `evaluate_together`."""


def evaluate_together(
    scanners: ScannerSet,
    *,
    frame: str = "scene",
    targets: str = "returns",
    surrounded: bool = True,
    baselines: bool = False,
    progress: Progress | None = None,
    methods: Sequence[Method] | None = None,
) -> EvaluationResult:
    """Evaluate sight lines through the scan of one scanner against a second one of the same moment.

    The methods get the scan of the known scanner. The viewpoint is the place of the reference
    scanner, whose returns are hidden and give the labels (`rule_for_scanner`).

    Parameters
    ----------
    scanners : ScannerSet
        With the pairs to evaluate.
    frame : {"scene", "scanner"}
        Frame of the queries. ``scene``: the scan is added with its pose. ``scanner``: the frame of
        the known scanner, so that a method is not told the tilt.
    targets : {"returns", "space"}
        As in `evaluate_held_out`.
    surrounded : bool
        Whether a label "occluded" needs nearer returns on all sides (`LabelRule`). Without it, most
        such labels of a reference scanner with coarse beams are wrong.
    baselines, progress, methods
        As in `evaluate_held_out`.

    Raises
    ------
    DriveError
        A pair without any labelled point.
    SettingsError
        No such frame or targets.
    """
    results, labels, target_count = run_methods(
        together_query_sets(
            scanners, checked_frame(frame), checked_targets(targets), surrounded=surrounded
        ),
        methods or methods_for("single", baselines=baselines),
        reporter(progress),
    )
    ground_truth = f"a second scanner, queries in the frame of the {frame}"
    ground_truth += targets_suffix(targets)
    if not surrounded:
        ground_truth += ", occluded by any nearer returns"
    return EvaluationResult(scanners.name, ground_truth, TOGETHER, labels, target_count, results)


def checked_frame(name: str) -> QueryFrame:
    """The frame of the queries.

    Raises
    ------
    SettingsError
        There is no such frame.
    """
    return checked_choice(name, QUERY_FRAMES, "there is no frame")


def together_query_sets(
    scanners: ScannerSet,
    frame: QueryFrame = "scene",
    kind: TargetKind = "returns",
    *,
    surrounded: bool = True,
) -> QuerySets:
    """One query set for each pair of scanners; see `evaluate_together`."""
    for names in scanners.pairs:
        known, reference = (scanners.scanner(name) for name in names)
        numbers = scanners.index(known.name), scanners.index(reference.name)
        targets, visible = labelled_targets(
            kind,
            (known.points, known.pose),
            (reference.points, reference.pose),
            rule_for_scanner(reference.points, surrounded=surrounded),
            numbers,
        )
        if len(targets) == 0:
            raise DriveError(
                f"scanner {reference.name} gives no label for any point of scanner {known.name}:"
                " check the poses, and choose scanners that see the same place."
            )
        query_from_scanner = known.pose if frame == "scene" else np.eye(4)
        query_from_scene = query_from_scanner @ inverse(known.pose)
        yield QuerySet(
            ":".join(names),
            InputScans(
                numbers[:1],
                (known.points,),
                (query_from_scanner,),
                *numbers,
                posed=frame == "scene",
            ),
            transform(query_from_scene, reference.pose[:3, 3]),
            transform(query_from_scene, targets),
            visible,
        )
